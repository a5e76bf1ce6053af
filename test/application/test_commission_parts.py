"""Parts of a commissioning without a graph: motions, guard, tracking, ledger, and what stops a gain."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgms_observer.application.commission.check import topic_faults
from sgms_observer.application.commission.compensate import MAX_PEAK_RATIO, TrackingWatch
from sgms_observer.application.commission.ledger import DONE, FAILED, SKIPPED, Ledger
from sgms_observer.application.commission.motion import (
    Motion,
    approach,
    checked,
    learning_motion,
    motion_from_rows,
    representative_motion,
    sign_motion,
)
from sgms_observer.application.commission.table import MAX_GAP, Guard, Heard, HeldUp, Topics
from sgms_observer.application.commission.tracking import Tracker
from sgms_observer.errors import ConfigurationError, DataError
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings

AXIS = AxisSettings(name="x", mass=3.0)
LIMITS = ExcitationLimits(0.02, 0.05, 1.0)
PERIOD = 1.0e-3


def heard(time: Any, position: Any, set_point: Any, velocity: Any = 0.0, effort: Any = 1.0) -> Heard:
    """Return samples at times [s]."""
    time = np.asarray(time, dtype=np.float64)
    columns = [np.broadcast_to(np.asarray(one, dtype=np.float64), time.shape) for one in (position, effort, set_point)]
    speed = np.broadcast_to(np.asarray(velocity, dtype=np.float64), time.shape)
    return Heard(Samples(np.rint(1e9 * time).astype(np.int64), columns[0], columns[1], columns[2], speed), time)


@given(
    stroke=st.floats(1e-3, 1.0), speed=st.floats(1e-3, 1.0), acceleration=st.floats(0.05, 20.0),
    period=st.sampled_from([1e-3, 5e-3]), seconds=st.floats(10.0, 25.0), start=st.floats(-0.5, 0.5),
)  # fmt: skip
def test_motions_keep_inside_the_limits(
    stroke: float, speed: float, acceleration: float, period: float, seconds: float, start: float
) -> None:
    limits = ExcitationLimits(stroke, speed, acceleration)
    own = representative_motion(limits, period)
    way = approach(start * stroke, float(own.position[0]), limits, period)
    learn = learning_motion(limits, period, 1e-5, 1e-3, seconds)
    for motion in (own, learn, sign_motion(limits, period), own.after(way)):
        assert checked(motion, limits, 0.0, "it") is motion
        assert motion.velocity[0] == motion.velocity[-1] == 0.0


def test_a_motion_beyond_the_limits_is_refused_with_the_option() -> None:
    time = np.arange(0.0, 2.0, PERIOD)
    wide = motion_from_rows(time, 0.015 * np.sin(np.pi * time), PERIOD)
    with pytest.raises(ConfigurationError, match="--stroke"):
        checked(wide, LIMITS, 0.0, "own.csv")
    fast = motion_from_rows(time, 1e-3 * np.sin(40.0 * np.pi * time), PERIOD)
    with pytest.raises(ConfigurationError, match="--speed"):
        checked(fast, LIMITS, 0.0, "own.csv")


def test_the_guard_lets_a_good_motion_pass() -> None:
    guard = Guard(AXIS, LIMITS, 0.0, 0.0)
    motion = representative_motion(LIMITS, PERIOD)
    time = PERIOD * np.arange(len(motion.position))
    velocity = motion.velocity
    for first in range(0, len(time), 7):
        rows = slice(first, first + 7)
        force = 4.0 * np.sign(velocity[rows])
        guard(heard(time[rows], motion.position[rows] + 4e-6, motion.position[rows], velocity[rows], force))
    assert guard.sign > 0.5


@pytest.mark.parametrize(
    ("position", "set_point", "sentence"),
    [
        (lambda t: 0.012 + 0.0 * t, lambda t: 0.012 + 0.0 * t, "outside"),
        (lambda t: 0.2 * t, lambda t: 0.2 * t, "moves at"),
        (lambda t: 0.0 * t, lambda t: 0.02 * t, "stalls"),
        (lambda t: -0.02 * t, lambda t: 0.02 * t, "against its reference"),
        (lambda t: 0.01 * t, lambda t: 0.03 * t, "away from its reference"),
    ],
)
def test_the_guard_stops(position: Any, set_point: Any, sentence: str) -> None:
    guard = Guard(AXIS, LIMITS, 0.0, 0.0)
    time = np.arange(0.0, 0.3, PERIOD)
    with pytest.raises(DataError, match=sentence):
        for first in range(0, len(time), 5):
            part = time[first : first + 5]
            guard(heard(part, position(part), set_point(part)))


@pytest.mark.parametrize("late", [0.01, 0.04])
def test_a_late_table_is_neither_stalled_nor_reversed(late: float) -> None:
    """A busy computer hears its set-points later than usual; the axis is where they told it to be a moment ago."""
    guard = Guard(AXIS, LIMITS, 0.0, 0.0)
    time = np.arange(0.0, 2.0, PERIOD)
    set_point = 5e-4 * np.sin(40.0 * time)
    for first in range(0, len(time), 5):
        rows = slice(first, first + 5)
        behind = late if time[first] > 1.0 else 0.0
        guard(heard(time[rows], np.interp(time[rows] - behind, time, set_point), set_point[rows]))


def test_a_gap_is_no_fault_of_the_axis() -> None:
    guard = Guard(AXIS, LIMITS, 0.0, 0.0)
    guard(heard([0.0, 1e-3], 0.0, 0.0))
    with pytest.raises(HeldUp):
        guard(heard([2e-3 + MAX_GAP], 0.0, 0.0))


@pytest.mark.parametrize("delay", [-0.2, 0.0, 0.012, 0.15])
def test_the_delay_of_a_table_is_found(delay: float) -> None:
    motion = sign_motion(LIMITS, PERIOD)
    tracker = Tracker(motion, 0.3)
    time = PERIOD * np.arange(len(motion.position))
    tracker(heard(time, 0.3 + np.interp(time - delay, time, motion.position), 0.0))
    assert tracker.best_delay() == pytest.approx(delay, abs=1.5 * PERIOD)
    assert tracker.tracking(delay).rms < 1e-6


def test_a_growing_error_lets_go_at_once() -> None:
    released: list[bool] = []
    session: Any = SimpleNamespace(delay=0.0, table=SimpleNamespace(release=lambda: released.append(True)))
    watch = TrackingWatch(session, 1e-6, 0.3)
    watch(heard([-0.1], 9e-6, 0.0))  # on the way to the start
    watch(heard([0.1], MAX_PEAK_RATIO * 0.99e-6, 0.0))
    assert not released and not watch.has_released
    watch(heard([0.2], MAX_PEAK_RATIO * 1.01e-6, 0.0))
    watch(heard([0.3], 9e-6, 0.0))
    assert released == [True] and watch.has_released


def test_the_ledger_goes_on_where_it_ended(tmp_path: Path) -> None:
    request = {"config": "a.yaml", "axis": None}
    ledger = Ledger.open(tmp_path, request, False)
    ledger.note("check", DONE, 1.0, "fine", ["commission.json"])
    (tmp_path / "bag").mkdir()
    ledger.note("record", DONE, 2.0, "recorded", ["bag"])
    ledger.note("identify", FAILED, 3.0, "why")
    again = Ledger.open(tmp_path, request, False)
    assert [again.is_finished(name) for name in ("check", "record", "identify", "diagnose")] == [
        True,
        True,
        False,
        False,
    ]
    (tmp_path / "bag").rmdir()
    assert not again.is_finished("record")
    again.note("record", SKIPPED, 0.0, "no time")
    assert not again.is_finished("record")
    assert list(json.loads((tmp_path / "commission.json").read_text())["steps"][-1].items())[:2] == [
        ("name", "record"), ("state", "skipped"),
    ]  # fmt: skip
    with pytest.raises(ConfigurationError, match="another config"):
        Ledger.open(tmp_path, {**request, "config": "b.yaml"}, False)
    assert not Ledger.open(tmp_path, request, True).steps


def test_faults_of_the_topics_are_told_at_once() -> None:
    stamps = np.arange(100, dtype=np.int64) * 2_000_000
    nothing = np.full(100, np.nan)
    samples = Samples(stamps, np.zeros(100), nothing, nothing, nothing)
    names = {"position": ("x",), "control_effort": ("x",)}
    faults = topic_faults(Topics(names, samples, 0, 0.2, 0, 1, 1), AXIS, PERIOD)
    for word in ("sample_period: 0.002", "control_effort", "subscribes", "publishes reference", "observer"):
        assert any(word in fault for fault in faults), word
    assert (
        "names y and not x"
        in topic_faults(Topics({**names, "position": ("y",)}, samples, 0, 0.2, 1, 0, 0), AXIS, PERIOD)[0]
    )


def test_a_recording_begins_where_the_axis_slides() -> None:
    motion = Motion(PERIOD, np.array([0.0, 0.0, 1e-5, 3e-4, 5e-4]))
    assert motion.sliding_from(2e-4) == 3
