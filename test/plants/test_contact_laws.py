"""Physics of the contact laws: dissipation, steady sliding, presliding, rest, step size."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sgms_observer.arrays import Floats
from sgms_observer.jit import HAS_NUMBA
from sim_plant.plants.contact import LAWS, advance, draw_law, rested_state
from sim_plant.plants.machine import Machine, draw
from sim_plant.plants.owner import loading_curve, steady_curve
from sim_plant.plants.stribeck import KNEE, STATIC, relaxed

needs_numba = pytest.mark.skipif(not HAS_NUMBA, reason="hundreds of thousands of steps in plain Python")
by_law = pytest.mark.parametrize("law", LAWS)


@cache
def machine_of(law: str) -> Machine:
    return draw(3, law)


def force_along(
    machine: Machine, velocity: Floats, step: float, state: Floats | None = None, scale: float = 1.0
) -> Floats:
    """Return the contact's force [N] after each step of ``velocity`` [m/s]."""
    state = rested_state() if state is None else state
    number = LAWS.index(machine.law)
    return np.array([advance(number, v, step, scale, machine.curve, machine.law_parameters, state) for v in velocity])


@by_law
def test_steady_sliding_is_the_curve(law: str) -> None:
    machine = machine_of(law)
    for speed in (0.3 * machine.curve[KNEE], machine.curve[KNEE], 0.5 * machine.speed):
        duration = 200.0 * machine.distance / speed
        for scale in (1.0, 1.2):
            force = force_along(machine, np.full(4000, -speed), duration / 4000, scale=scale)
            assert force[-1] == pytest.approx(-scale * steady_curve(machine, np.array([speed]))[0], rel=3.0e-3)


@needs_numba
@by_law
@pytest.mark.parametrize("reach", [0.1, 0.5, 2.0, 50.0])
def test_closed_cycles_dissipate(law: str, reach: float) -> None:
    machine = machine_of(law)
    period, count = 0.2, 20_000
    phase = 2.0 * np.pi * (np.arange(3 * count) + 0.5) / count
    velocity = reach * machine.distance * 2.0 * np.pi / period * np.cos(phase)
    force = force_along(machine, velocity, period / count)
    work = (0.5 * (force + np.concatenate(([0.0], force[:-1]))) * velocity)[2 * count :].sum() * period / count
    largest = 4.2 * machine.curve[STATIC] * reach * machine.distance  # what dry friction would take
    assert (0.3 if reach > 1.0 else -1.0e-9) * largest < work < largest


@needs_numba
@by_law
def test_presliding_is_a_spring_with_hysteresis(law: str) -> None:
    machine = machine_of(law)
    travel, force = loading_curve(machine)
    assert np.all(np.diff(force) > -0.02 * machine.curve[STATIC])
    half = np.interp(0.5 * force.max(), force, travel)
    assert 0.1 * machine.distance < half < 2.0 * machine.distance
    slope = force[0] / travel[0]
    assert 0.3 < slope * machine.distance / machine.curve[STATIC] < 4.0


@by_law
def test_force_is_odd_in_the_motion(law: str) -> None:
    machine = machine_of(law)
    velocity = machine.curve[KNEE] * np.sin(np.linspace(0.0, 9.0, 300))
    forth, back = (force_along(machine, side * velocity, 1.0e-4) for side in (1.0, -1.0))
    assert forth == pytest.approx(-back, rel=1.0e-9, abs=1.0e-12 * machine.curve[STATIC])


@by_law
def test_force_does_not_hang_on_the_step(law: str) -> None:
    machine = machine_of(law)
    period = 0.1
    coarse, fine = (
        force_along(
            machine,
            20.0 * machine.distance * 2.0 * np.pi / period * np.cos(2.0 * np.pi * (np.arange(n) + 0.5) / n),
            period / n,
        )[n // 8 - 1 :: n // 8]
        for n in (4000, 16_000)
    )
    assert coarse == pytest.approx(fine, abs=0.01 * machine.curve[STATIC])


@needs_numba
def test_leuven_remembers_its_return_points() -> None:
    """A minor loop closes where it began, and the branch goes on as if it had not been there (wiping out)."""
    machine = machine_of("leuven")
    there = np.full(100, 1.0) * 0.3 * machine.distance
    loop = np.concatenate((there, -0.5 * there, 0.2 * there, -0.2 * there, 0.5 * there, there))
    plain = np.concatenate((there, there))
    curve = machine.curve.copy()
    curve[:2] = 1.0e6 * machine.curve[STATIC]  # far from sliding: presliding alone
    step, results = 0.01, []
    for velocity in (loop, plain):
        results.append(force_along(replace(machine, curve=curve), velocity, step))
    assert results[0][499] == pytest.approx(results[0][99], rel=1.0e-6)
    assert results[0][500:] == pytest.approx(results[1][100:], rel=1.0e-6)
    assert results[0][399] == pytest.approx(results[0][199], rel=1.0e-6)
    assert results[0][159] < results[0][299] < results[0][99]  # at one place, on the way back and on the way out


def drift_under_jitter(law: str) -> float:
    """Return the share of an elastic force that a jitter of 1 % of the slip distance makes the contact forget."""
    machine = machine_of(law)
    state = rested_state()
    force_along(machine, np.full(100, 0.2 * machine.distance), 0.01, state)
    first = force_along(machine, np.zeros(1), 1.0e-4, state)[0]
    sides = np.tile([1.0] * 50 + [-1.0] * 50, 400) * 0.01 * machine.distance / (50 * 1.0e-4)
    force_along(machine, sides, 1.0e-4, state)
    return float(1.0 - force_along(machine, np.zeros(1), 1.0e-4, state)[0] / first)


@needs_numba
def test_bristles_drift_where_their_law_says_so() -> None:
    assert drift_under_jitter("lugre") > 0.5
    assert abs(drift_under_jitter("elasto_plastic")) < 1.0e-9
    assert abs(drift_under_jitter("leuven")) < 0.02


@needs_numba
def test_rate_and_state_strengthens_at_rest() -> None:
    machine = machine_of("rate_state")
    speed = machine.curve[KNEE]
    peaks = []
    for rest in (0.01, 0.1, 1.0, 10.0):
        state = rested_state()
        force_along(machine, np.full(3000, speed), 100.0 * machine.distance / speed / 3000, state)
        force_along(machine, np.zeros(1000), rest / 1000, state)
        peaks.append(force_along(machine, np.full(4000, speed), 5.0 * machine.distance / speed / 4000, state).max())
    growth = np.diff(peaks)
    assert np.all(growth > 0.0)
    evolution = machine.law_parameters[2]
    assert growth[-1] == pytest.approx(evolution * np.log(10.0), rel=0.3)  # B ln(t), Dieterich 1972


def test_relaxation_is_exact() -> None:
    for rate in (0.0, 1.0e-9, 0.5, 40.0):
        whole = relaxed(2.0, 3.0, rate, 0.7)
        halves = relaxed(relaxed(2.0, 3.0, rate, 0.35), 3.0, rate, 0.35)
        assert whole == pytest.approx(halves, rel=1.0e-12)


def test_unknown_law_is_refused() -> None:
    with pytest.raises(ValueError, match=r"'stone' is unknown; use one of lugre"):
        draw_law("stone", np.random.default_rng(0), np.ones(4), 1.0, 1.0, 1.0)
    with pytest.raises(ValueError, match=r"'stone' is unknown; use one of lugre"):
        draw(0, "stone")
