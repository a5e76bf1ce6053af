"""The compensation ahead is what the observer says when that time comes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgms_observer.compensation.horizon import KnownMotion
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.settings.axis import AxisSettings, EffectSettings, Settings
from sim_plant.table import SimulatedTable

PERIOD = 5.0e-4
START = 10**12
LOOK_AHEAD = 2.0e-3


def _axis(*effects: EffectSettings, model: str = "gms") -> AxisSettings:
    axis = AxisSettings(mass=3.0, effects=effects)
    return replace(
        axis,
        friction=replace(axis.friction, model=model),
        filter=replace(axis.filter, window=4.0e-3),
        compensation=replace(axis.compensation, enabled=True, gain=1.0, limit=50.0, look_ahead=LOOK_AHEAD),
    )


def _known(table: SimulatedTable, reach: float) -> KnownMotion:
    time = np.arange(-0.01, reach, 1e-3)
    position, velocity = table.stages[0].reference_ahead(time)
    stamps = START + round(table.stages[0].samples_done * PERIOD * 1e9) + np.rint(time * 1e9).astype(np.int64)
    return KnownMotion(stamps, position, velocity)


EFFECTS = {
    "none": (),
    "offset": (EffectSettings("offset", (2.0,)),),
    "cogging": (EffectSettings("cogging", (1.4, 1.0e-3, 0.3, 0.0, 0.0)),),
    "mass": (EffectSettings("mass_error", (0.5,)),),
    "delay": (EffectSettings("actuator_delay", (4.0e-3,)),),
}


@pytest.mark.parametrize("model", ["gms", "sgms"])
@pytest.mark.parametrize("name", EFFECTS)
def test_it_is_what_the_observer_says_when_the_time_comes(name: str, model: str) -> None:
    axis = _axis(*EFFECTS[name], model=model)
    observer = AxisObserver(axis, PERIOD)
    table = SimulatedTable(Settings(axes=(replace(axis, stage_effects=()),), sample_period=PERIOD), START)
    (first,) = table.step(1200)
    latest = observer.step(first.samples)
    horizon = observer.horizon(latest, _known(table, 0.5), 0.3)
    assert horizon is not None and horizon.effort[-1] == 0.0
    assert horizon.time_ns[0] == latest.stamp_ns[-1] + round(LOOK_AHEAD * 1e9)
    (then,) = table.step(500)
    said = observer.step(then.samples)
    due = said.stamp_ns + round(LOOK_AHEAD * 1e9)
    inside = horizon.time_ns < horizon.time_ns[-1] - 0.06 * 1e9
    later = np.interp(horizon.time_ns[inside] - START, due - START, said.compensation)
    difference = horizon.effort[inside] - later
    assert np.sqrt(np.mean(difference**2)) < 0.03 * np.ptp(later)


def test_it_changes_nothing() -> None:
    axis = _axis(*EFFECTS["cogging"])
    table = SimulatedTable(Settings(axes=(axis,), sample_period=PERIOD), START)
    records = [table.step(600)[0], table.step(600)[0]]
    one, other = AxisObserver(axis, PERIOD), AxisObserver(axis, PERIOD)
    latest = one.step(records[0].samples)
    other.step(records[0].samples)
    stamps = np.arange(0, 10**9, 10**6) + records[0].stamp_ns[0]
    position = 2e-4 * np.sin(10.0 * np.pi * (stamps - START) * 1e-9)
    velocity = 2e-3 * np.pi * np.cos(10.0 * np.pi * (stamps - START) * 1e-9)
    assert one.horizon(latest, KnownMotion(stamps, position, velocity), 0.3) is not None
    assert np.array_equal(one.step(records[1].samples).compensation, other.step(records[1].samples).compensation)


def test_a_reference_that_is_not_followed_or_too_short_gives_none() -> None:
    axis = _axis()
    observer = AxisObserver(axis, PERIOD)
    table = SimulatedTable(Settings(axes=(axis,), sample_period=PERIOD), START)
    latest = observer.step(table.step(1200)[0].samples)
    known = _known(table, 0.5)
    assert observer.horizon(latest, known, 0.3) is not None
    assert observer.horizon(latest, KnownMotion(known.time_ns, known.position + 1e-4, known.velocity), 0.3) is None
    assert observer.horizon(latest, KnownMotion(known.time_ns + 10**8, known.position, known.velocity), 0.3) is None
    assert observer.horizon(latest, _known(table, 1.5e-3), 0.3) is None
    assert observer.horizon(latest, known, 0.0) is None


def test_switched_off_it_is_zero() -> None:
    axis = _axis()
    off = replace(axis, compensation=replace(axis.compensation, enabled=False))
    observer = AxisObserver(off, PERIOD)
    table = SimulatedTable(Settings(axes=(axis,), sample_period=PERIOD), START)
    horizon = observer.horizon(observer.step(table.step(1200)[0].samples), _known(table, 0.5), 0.3)
    assert horizon is not None and not horizon.effort.any()


def test_a_motion_between_points_is_the_cubic_through_them() -> None:
    time = np.arange(0.0, 0.5, 0.01)
    sine = KnownMotion(np.rint(time * 1e9).astype(np.int64), np.sin(6 * time), 6 * np.cos(6 * time))
    between = np.arange(0.0, 0.49, 0.0013)
    position, velocity, acceleration = sine.at(np.rint(between * 1e9).astype(np.int64))
    assert np.allclose(position, np.sin(6 * between), atol=1e-6)
    assert np.allclose(velocity, 6 * np.cos(6 * between), atol=1e-4)
    assert np.allclose(acceleration, -36 * np.sin(6 * between), atol=0.1)


def test_points_from_outside_are_put_in_order_or_refused() -> None:
    position = np.array([0.0, 1.0, np.nan, 2.0, 3.0])
    motion = KnownMotion.of(np.array([0, 10, 20, 5, 30]), position)
    assert motion is not None and motion.time_ns.tolist() == [0, 10, 30]
    assert motion.at(np.array([20]))[0].tolist() == [2.0]
    assert KnownMotion.of(np.array([1]), np.array([0.0])) is None
    assert KnownMotion.of(np.zeros(0, np.int64), np.zeros(0)) is None
