"""The position controller: pole placement, integral action and its limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sgms_observer.settings.axis import ControllerSettings
from sim_plant.kernel import ControllerGains, ControllerMemory, control, controller_gains

PERIOD = 1e-4
START = ControllerMemory(math.nan, 0.0, 0.0)


def gains(**settings: float) -> ControllerGains:
    return controller_gains(ControllerSettings(**settings), 3.0, PERIOD)


def test_free_mass_answers_with_bandwidth_and_damping() -> None:
    wanted = gains(bandwidth=20.0, damping_ratio=0.5)
    memory, position, velocity, path = START, 1e-3, 0.0, []
    for _ in range(5000):
        effort, memory = control(wanted, memory, position, 0.0, 0.0, 0.0, 0.0)
        velocity += effort / 3.0 * PERIOD
        position += velocity * PERIOD
        path.append(position)
    answer = np.array(path)
    damped = 2 * np.pi * 20.0 * np.sqrt(1 - 0.25)
    lowest = int(np.argmin(answer))
    assert lowest * PERIOD == pytest.approx(np.pi / damped, rel=0.1)  # the velocity filter costs a little phase
    assert -answer[lowest] / 1e-3 == pytest.approx(np.exp(-np.pi * 0.5 / np.sqrt(0.75)), rel=0.5)
    assert np.abs(answer[-100:]).max() < 1e-9


def test_effort_of_each_part() -> None:
    parts = gains(feedforward_mass=1.0)
    effort, _ = control(parts, START, 0.0, 1e-6, 0.0, 0.0, 0.0)
    assert effort == pytest.approx(3.0 * (200 * np.pi) ** 2 * 1e-6)
    effort, _ = control(parts, START, 0.0, 0.0, 1e-3, 0.0, 0.0)
    assert effort == pytest.approx(2 * 0.7 * 200 * np.pi * 3.0 * 1e-3)
    effort, _ = control(parts, START, 0.0, 0.0, 0.0, 2.0, 0.5)
    assert effort == pytest.approx(6.5)


def test_integral_grows_within_the_limit_and_leaves_it_at_once() -> None:
    wanted = gains(integral_rate=10.0, effort_limit=5.0)
    memory = START
    for _ in range(20_000):
        effort, memory = control(wanted, memory, 0.0, 1e-6, 0.0, 0.0, 0.0)
        assert abs(effort) <= 5.0
    assert 5.0 - wanted.integral_gain * PERIOD * 1e-6 <= effort <= 5.0
    assert memory.integral < 5.0
    effort, _ = control(wanted, memory, 0.0, -1e-6, 0.0, 0.0, 0.0)
    assert effort < 5.0 - 1.5 * wanted.position_gain * 1e-6


def test_feedforward_cannot_exceed_the_limit() -> None:
    for force in (1e9, -1e9):
        effort, _ = control(gains(effort_limit=7.0), START, 0.0, 0.0, 0.0, 0.0, force)
        assert effort == math.copysign(7.0, force)
