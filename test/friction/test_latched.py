"""The smooth element with slip memory: exact derivatives, GMS in the limit, memory, no branching anywhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from latched_element import latched_step_with_slopes

from sgms_observer.friction.gms import gms_step

STEP = {"period": 1e-4, "fraction": 0.2, "rate": 50.0}


@settings(deadline=None)
@given(
    u=st.floats(-1.1, 1.1),
    slip=st.floats(0.0, 1.0),
    velocity=st.floats(1e-6, 5e-3),
    sign=st.sampled_from((-1.0, 1.0)),
    stiffness=st.floats(1e5, 1e7),
    stribeck=st.floats(2.0, 6.0),
    lam=st.floats(10.0, 300.0),
    gamma=st.floats(3.0, 100.0),
)
def test_derivatives_are_exact(u, slip, velocity, sign, stiffness, stribeck, lam, gamma):
    """Against central differences, whose own error is bounded by the sharpness of the smooth functions."""
    at = [u * 0.2 * stribeck, slip, stiffness, stribeck]

    def step(x):
        return latched_step_with_slopes(
            x[0], x[1], sign * velocity, STEP["period"], x[2], STEP["fraction"], x[3], STEP["rate"], lam, gamma
        )

    result = step(at)
    for j, scale in enumerate((1.0, 1.0, stiffness, stribeck)):
        width = 1e-6 * scale
        high, low = list(at), list(at)
        high[j] += width
        low[j] -= width
        above, below = step(high), step(low)
        for value in (0, 1):
            slope = (above[value] - below[value]) / (2e-6)
            argument = 1.0 + stiffness * velocity * STEP["period"] / (0.2 * stribeck)  # how fast u may move
            third = (argument * max(lam, gamma) * max(1.0, 1.0 / (0.2 * stribeck))) ** 3  # bounds the third derivative
            assert result[2 + 4 * value + j] * scale == pytest.approx(slope, rel=1e-5, abs=1e-12 * third + 1e-8)


def follow(velocity, lam, gamma, is_gms):
    """Return force and mode along a motion, Stribeck curve of Table I, element 4."""
    force, mode, forces = 0.0, 0.0, []
    for v in velocity:
        stribeck = 4.0 + 0.5 * math.exp(-((v / 1e-3) ** 2))
        if is_gms:
            force, mode = gms_step(force, int(mode), v, 1e-4, 0.79e6, 0.83, stribeck, 50.0)
        else:
            force, mode = latched_step_with_slopes(
                force, mode, v, 1e-4, 0.79e6, 0.83, stribeck, 50.0, lam, gamma
            )[:2]  # fmt: skip
        forces.append(force)
    return np.array(forces)


def test_it_becomes_gms_as_it_sharpens():
    time = np.arange(0.0, 0.6, 1e-4)
    velocity = 6.3e-3 * np.cos(2 * math.pi * 5 * time)
    truth = follow(velocity, 0, 0, True)
    errors = [np.abs(follow(velocity, lam, lam / 10, False) - truth).max() for lam in (30.0, 100.0, 1000.0)]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 2.0 * math.log(2.0) / 1000.0 * 0.83 * 4.5


def test_it_remembers_that_it_slips():
    """Slowing down raises the Stribeck curve; a slipping element follows at rate C, a sticking one would jump up."""
    velocity = np.concatenate((np.full(3000, 6e-3), np.full(100, 2e-4)))
    force = follow(velocity, 1000.0, 100.0, False)
    level = 0.83 * (4.0 + 0.5 * math.exp(-(0.2**2)))
    share = (level - force[-1]) / (level - force[2999])
    assert share == pytest.approx(math.exp(-50.0 * 100e-4 / (level / 0.83)), rel=0.02)


def test_a_reversal_resets_it():
    velocity = np.concatenate((np.full(500, 3e-3), np.full(1, -1e-6)))
    result = latched_step_with_slopes(
        follow(velocity[:-1], 1000.0, 100.0, False)[-1], 1.0, -1e-6, 1e-4, 0.79e6, 0.83, 4.5, 50.0, 1000.0, 100.0
    )
    assert result[1] < 1e-12
    assert result[2] == pytest.approx(1.0)


def test_at_rest_nothing_moves():
    assert latched_step_with_slopes(1.0, 0.3, 0.0, 1e-4, 1e6, 0.2, 4.0, 50.0, 1000.0, 100.0)[:2] == (1.0, 0.3)


def test_it_dissipates_over_a_closed_cycle():
    time = np.arange(0.0, 0.4, 1e-4)
    velocity = 6.3e-3 * np.cos(2 * math.pi * 5 * time)
    force = follow(velocity, 1000.0, 100.0, False)
    last = time >= 0.2
    assert np.sum(force[last] * velocity[last]) * 1e-4 > 0.0
