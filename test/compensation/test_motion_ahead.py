"""Looking ahead: smooth set-points are carried on exactly, corners and noise are not carried on at all."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgms_observer.arrays import Floats
from sgms_observer.compensation.motion_ahead import (
    AHEAD_POSITION,
    AHEAD_VELOCITY,
    AHEAD_WIDTH,
    MEMORY_SIZE,
    look_ahead_block,
    travel_after,
    turning_times,
    velocity_after,
)
from sgms_observer.filters.motion import ELAPSED, LEAD, PRESENT_POSITION, PRESENT_VELOCITY

PERIOD = 1e-4


def _ahead(position: Floats, velocity: Floats, look_ahead: float, period: float = PERIOD) -> Floats:
    motion = np.zeros((len(position), LEAD))
    motion[:, ELAPSED] = period
    out = np.empty((len(position), AHEAD_WIDTH))
    look_ahead_block(np.zeros(MEMORY_SIZE), look_ahead, 2e-5, 0.0, motion, position, velocity, out)
    return out


@pytest.mark.parametrize("look_ahead", [2e-4, 5e-3, 15e-3])
def test_a_sine_is_met_where_it_will_be(look_ahead: float) -> None:
    time, omega = PERIOD * np.arange(6000), 2 * np.pi * 5.0
    position, velocity = 2e-4 * np.sin(omega * time), 2e-4 * omega * np.cos(omega * time)
    out = _ahead(position, velocity, look_ahead)[10:]
    later = time[10:] + look_ahead
    # the series breaks off behind the jerk: its next term, and a sample's worth of limiter
    bound = (omega * look_ahead) ** 4 / 24 + omega**3 * look_ahead**2 * PERIOD
    assert np.max(np.abs(out[:, AHEAD_POSITION] - 2e-4 * np.sin(omega * later))) < 2e-4 * bound
    bound = (omega * look_ahead) ** 4 / 6 + 2 * (omega * look_ahead) ** 3 / 6 + omega**2 * look_ahead * PERIOD * 3
    assert np.max(np.abs(out[:, AHEAD_VELOCITY] - 2e-4 * omega * np.cos(omega * later))) < 2e-4 * omega * bound


def test_corners_of_a_piecewise_linear_reference_are_not_carried_on() -> None:
    corners = np.array([0.0, 1e-3, 1.5e-3, 0.5e-3, 0.5e-3])
    position = np.interp(np.arange(4000), np.arange(5) * 1000, corners)
    velocity = np.diff(position, append=position[-1]) / PERIOD
    out = _ahead(position, velocity, 10e-3)
    assert np.max(np.abs(out[5:, AHEAD_VELOCITY] - velocity[5:])) < 1e-9


def test_noise_of_a_set_point_is_carried_on_little() -> None:
    noise = np.random.default_rng(3).normal(0.0, 1e-6, 5000)
    out = _ahead(np.cumsum(noise) * PERIOD, noise, 5e-3)
    is_carried_on = out[:, AHEAD_VELOCITY] != noise
    plain = np.diff(noise, prepend=0.0) / PERIOD * 5e-3  # what a plain difference adds at every sample
    assert np.mean(is_carried_on) < 0.2
    assert np.std(out[:, AHEAD_VELOCITY] - noise) < 1.2 * np.std(plain)


def test_without_a_reference_a_resting_axis_is_met_where_it_is() -> None:
    motion = np.zeros((3, LEAD))
    motion[:, ELAPSED], motion[:, PRESENT_POSITION], motion[:, PRESENT_VELOCITY] = PERIOD, 0.3, (1e-6, 1e-2, -1e-2)
    out = np.empty((3, AHEAD_WIDTH))
    missing = np.full(3, np.nan)
    look_ahead_block(np.zeros(MEMORY_SIZE), 1e-2, 2e-5, 0.0, motion, missing, missing, out)
    assert out[:, AHEAD_POSITION].tolist() == pytest.approx([0.3, 0.3001, 0.2999], abs=1e-12)


_VALUE = st.floats(-1.0, 1.0).map(lambda value: round(value, 6))


@given(_VALUE, _VALUE, _VALUE, st.sampled_from([0.1, 1.0, 10.0]))
def test_turning_times_are_where_the_velocity_changes_sign(v: float, a: float, j: float, end: float) -> None:
    first, second = turning_times(v, a, j, end)
    assert 0.0 < first <= second <= end
    grid = np.linspace(0.0, end, 2001)
    signs = np.sign(np.round(velocity_after(v, a, j, grid), 9))
    crossings = grid[1:][(signs[1:] * signs[:-1] < 0.0)]
    for crossing in crossings:
        assert min(abs(first - crossing), abs(second - crossing)) <= end / 1000
    for turn in (first, second):
        if turn < end:
            assert velocity_after(v, a, j, turn) == pytest.approx(0.0, abs=1e-9 * (1.0 + end**2))


@given(_VALUE, _VALUE, _VALUE)
def test_the_travel_is_the_integral_of_the_velocity(v: float, a: float, j: float) -> None:
    grid = np.linspace(0.0, 2.0, 4001)
    rate = velocity_after(v, a, j, grid)
    integral = float(np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(grid)))
    assert travel_after(v, a, j, 2.0) == pytest.approx(integral, abs=1e-6)
