"""Positions that a slow bus repeats are read at the rate of their changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.bag_info import inspect_bag
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.errors import DataError
from sgms_observer.observer.samples import Samples
from sgms_observer.offline.recording import at_rate_of_changes, read_recordings
from sgms_observer.settings.axis import AxisSettings

PERIOD, STEP = 1.0e-3, 1.0e-6
TIME = PERIOD * np.arange(20_000)
MOTION = np.round((0.05 * np.sin(2.0 * TIME) + 0.01 * np.sin(7.0 * TIME)) / STEP) * STEP


def _held(count: int, phase: int = 0) -> np.ndarray:
    """Return the motion as a drive shows it that updates its position with every ``count``-th sample."""
    return MOTION[np.maximum((np.arange(len(TIME)) - phase) // count * count + phase, 0)]


def _samples(position: np.ndarray, stamps: np.ndarray | None = None) -> Samples:
    """Return samples of a log, in SI units."""
    stamps = np.rint((1.0 + TIME) * 1e9).astype(np.int64) if stamps is None else stamps
    nothing = np.full(len(position), np.nan)
    return Samples(stamps[: len(position)], position, np.cos(TIME)[: len(position)], nothing, nothing)


@pytest.mark.parametrize(("count", "phase"), [(2, 0), (4, 3), (8, 5)])
def test_repeated_positions_are_left_out(count: int, phase: int) -> None:
    source = _samples(_held(count, phase))
    found = at_rate_of_changes(source, "slow bus")
    first = phase or count  # a log that begins with an update does not show it
    assert found.count == count
    assert np.array_equal(found.samples.position, MOTION[first::count])
    assert np.array_equal(found.samples.effort, source.effort[first::count])
    assert np.array_equal(found.samples.stamp_ns, source.stamp_ns[first::count])
    rate = f"{1000.0 / count:g}"
    assert found.note == (
        f"slow bus: the position changes with one sample in {count} only; position and effort were read at {rate} Hz"
    )


@pytest.mark.parametrize(
    "position",
    [
        MOTION,
        np.round(MOTION / 1.0e-4) * 1.0e-4,  # a coarse encoder repeats its positions where it moves slowly
        np.arange(20_000) // 4 * STEP,  # a step at a time: a slow motion, which no held position could be told from
        np.zeros(20_000),
        np.random.default_rng(1).normal(size=20_000),
    ],
)
def test_other_positions_stay(position: np.ndarray) -> None:
    samples = _samples(position)
    found = at_rate_of_changes(samples, "log")
    assert found.samples is samples and (found.count, found.note) == (1, "")


def test_a_position_that_changes_too_seldom_is_refused() -> None:
    with pytest.raises(DataError, match=r"the position of log changes at 10 Hz only; record a position that is upda"):
        at_rate_of_changes(_samples(_held(100)), "log")


def test_few_wrong_samples_do_not_hide_it() -> None:
    position = _held(4)
    position[[1001, 7002]] += 0.01
    assert at_rate_of_changes(_samples(position), "log").count == 4


def test_lost_samples_and_a_clock_that_drifts_do_not_hide_it() -> None:
    kept = np.delete(np.arange(len(TIME)), [3001, 7001, 7002, 15_400])
    samples = _samples(_held(8))
    lost = Samples(*(getattr(samples, name)[kept] for name in Samples.__dataclass_fields__))
    assert at_rate_of_changes(lost, "log").count == 8
    updates = np.floor(TIME * 125.013) / 125.013  # the drive's clock runs 0.01 % fast
    assert at_rate_of_changes(_samples(np.interp(updates, TIME, MOTION)), "log").count == 8


def test_bags_are_read_so(tmp_path: Path) -> None:
    stamps = np.rint((1.0 + TIME) * 1e9).astype(np.int64)
    write_table(Table(stamps, _held(4), np.cos(TIME), None, None, ()), tmp_path / "bag", "x")
    (found,) = read_recordings(tmp_path / "bag", AxisSettings())
    assert found.period == pytest.approx(4.0 * PERIOD)
    (axis,) = inspect_bag(tmp_path / "bag", {}).axes
    assert any("the position changes with one sample in 4 only" in note for note in axis.facts.notes)
    assert axis.facts.rate == pytest.approx(1000.0)
