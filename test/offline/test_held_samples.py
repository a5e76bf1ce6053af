"""Positions that a slow bus repeats are read at the rate of their changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.bag_info import inspect_bag
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.errors import DataError
from sgms_observer.offline.held_samples import samples_per_change
from sgms_observer.offline.recording import Recording, Recordings, at_rate_of_changes, read_recordings
from sgms_observer.settings.axis import AxisSettings

PERIOD, STEP = 1.0e-3, 1.0e-6
TIME = PERIOD * np.arange(20_000)
MOTION = np.round((0.05 * np.sin(2.0 * TIME) + 0.01 * np.sin(7.0 * TIME)) / STEP) * STEP


def _held(count: int, phase: int = 0) -> np.ndarray:
    """Return the motion as a drive shows it that updates its position with every ``count``-th sample."""
    return MOTION[np.maximum((np.arange(len(TIME)) - phase) // count * count + phase, 0)]


@pytest.mark.parametrize(("count", "phase"), [(2, 0), (4, 3), (8, 5)])
def test_repeated_positions_are_left_out(count: int, phase: int) -> None:
    piece = Recording("slow bus", PERIOD, _held(count, phase), np.cos(TIME), start=5.0)
    (found,), notes = (read := at_rate_of_changes(Recordings((piece,)))).pieces, read.notes
    assert found.period == count * PERIOD
    assert np.array_equal(found.position, MOTION[phase::count])
    assert np.array_equal(found.effort, piece.effort[phase::count])
    assert found.start == pytest.approx(5.0 + phase * PERIOD)
    rate = f"{1000.0 / count:g}"
    assert notes == (f"slow bus: the position changes with one sample in {count} only; position and effort were read"
                     f" at {rate} Hz",)  # fmt: skip


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
    recordings = Recordings((Recording("log", PERIOD, position, np.cos(TIME)),), ("a note",))
    assert at_rate_of_changes(recordings) == recordings


def test_a_position_that_changes_too_seldom_is_refused() -> None:
    with pytest.raises(DataError, match=r"the position of log changes at 10 Hz only; record a position that is upda"):
        at_rate_of_changes(Recordings((Recording("log", PERIOD, _held(100), np.cos(TIME)),)))
    short = Recording("log", PERIOD, _held(8)[:1500], np.cos(TIME[:1500]))
    with pytest.raises(DataError, match="no piece holds 200 changes of the position"):
        at_rate_of_changes(Recordings((short,)))


def test_few_wrong_samples_do_not_hide_it() -> None:
    position = _held(4)
    position[[1001, 7002]] += 0.01
    assert samples_per_change(position, STEP) == (4, 0)


def test_bags_are_read_so(tmp_path: Path) -> None:
    stamps = np.rint((1.0 + TIME) * 1e9).astype(np.int64)
    write_table(Table(stamps, _held(4), np.cos(TIME), None, None, ()), tmp_path / "bag", "x")
    (found,) = read_recordings(tmp_path / "bag", AxisSettings())
    assert found.period == pytest.approx(4.0 * PERIOD)
    (axis,) = inspect_bag(tmp_path / "bag", {}).axes
    assert any("the position changes with one sample in 4 only" in note for note in axis.facts.notes)
    assert axis.facts.rate == pytest.approx(1000.0)
