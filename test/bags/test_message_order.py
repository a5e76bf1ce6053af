"""Recordings whose messages did not come in the order of their stamps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from bag_samples import START, STEP, write_with_rosbags

from sgms_observer.application.axis_facts import read_axis_facts
from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.source import survey_bag
from sgms_observer.offline.recording import read_recordings
from sgms_observer.settings.axis import AxisSettings

COUNT = 3000
POSITION, EFFORT = JointStateEncoder(("x",), ("position",)), JointStateEncoder(("x",), ("effort",))
SECONDS = 1.0e-3 * np.arange(COUNT)
SIGNALS = (0.01 * np.sin(3.0 * SECONDS), np.cos(7.0 * SECONDS))


def _write(path: Path, positions: np.ndarray, efforts: np.ndarray) -> Path:
    """Write samples whose numbers come in given orders."""
    messages = []
    for place, (first, second) in enumerate(zip(positions.tolist(), efforts.tolist(), strict=True)):
        log_ns = START + place * STEP
        position = POSITION.encode(START + first * STEP, (float(SIGNALS[0][first]),))
        effort = EFFORT.encode(START + second * STEP, (float(SIGNALS[1][second]),))
        messages += [("/position", log_ns + 1000, position), ("/control_effort", log_ns + 2000, effort)]
    return write_with_rosbags(path, messages)


def _swapped(*places: int) -> np.ndarray:
    order = np.arange(COUNT)
    for place in places:
        order[[place, place + 1]] = order[[place + 1, place]]
    return order


def test_messages_that_came_late_are_sorted_with_a_note(tmp_path: Path) -> None:
    """They were dropped and interpolated, without a note."""
    even = np.arange(COUNT)
    (right,) = read_recordings(_write(tmp_path / "even", even, even), AxisSettings())
    bag = _write(tmp_path / "bag", _swapped(100, 700, 1500), _swapped(102, 2000))
    found = read_recordings(bag, AxisSettings())
    (piece,) = found.pieces
    assert np.array_equal(piece.position, right.position) and np.array_equal(piece.effort, right.effort)
    assert found.notes == (
        "bag: 5 values of position, control_effort or reference came after a later one; all were sorted by their"
        " stamps; where there are many, check for two publishers of one topic",
    )
    survey = next(topic for topic in survey_bag(bag)[0] if topic.name == "/position")
    facts = read_axis_facts(bag, AxisSettings(), survey, {})
    assert (facts.gaps, facts.backward_stamps, facts.missing_efforts) == (0, 3, 0.0)
    assert facts.notes == found.notes


def test_a_clock_that_was_set_back_is_not_sorted(tmp_path: Path) -> None:
    """Two motions may have the same stamps: the second one is dropped, and a note counts it."""
    order = np.concatenate((np.arange(2000), np.arange(500, 1500)))
    found = read_recordings(_write(tmp_path / "bag", order, order), AxisSettings())
    (piece,) = found.pieces
    assert np.allclose(piece.position, SIGNALS[0][:2000], atol=1.0e-9)
    assert found.notes == (
        "bag: the stamps of a topic step back by more than a second once, so that no message was sorted; check the"
        " clock, and the driver for single wrong stamps",
        "bag: 1000 of 3000 samples with duplicate or backward stamps dropped",
    )


def test_efforts_alone_out_of_order_are_sorted(tmp_path: Path) -> None:
    even = np.arange(COUNT)
    found = read_recordings(_write(tmp_path / "bag", even, _swapped(5, 800, 2700)), AxisSettings())
    (piece,) = found.pieces
    assert len(piece) == COUNT and np.allclose(piece.effort, SIGNALS[1], atol=1.0e-9)
    assert [note.split(" of position")[0] for note in found.notes] == ["bag: 3 values"]


def test_the_clock_of_the_efforts_alone_is_set_back(tmp_path: Path) -> None:
    """The samples whose efforts are lost are counted."""
    even = np.arange(COUNT)
    efforts = np.where(even < 2500, even, even - 2000)
    found = read_recordings(_write(tmp_path / "bag", even, efforts), AxisSettings())
    assert sum(len(piece) for piece in found.pieces) == 2500
    assert found.notes[0] == (
        "bag: the stamps of a topic step back by more than a second once, so that no message was sorted; positions"
        " without a control_effort of the same time: 500; control_efforts without a position of the same time: 500;"
        " check the clock, and the driver for single wrong stamps"
    )


def test_one_wrong_stamp_switches_sorting_off_with_a_note(tmp_path: Path) -> None:
    """The stamp after one that is 2 s ahead steps back by more than a second."""
    order = _swapped(100)
    efforts = np.arange(COUNT)
    efforts[500] = 2500
    found = read_recordings(_write(tmp_path / "bag", order, efforts), AxisSettings())
    assert "no message was sorted; values that came after a later one and were dropped: 1;" in found.notes[0]


@pytest.mark.parametrize("distance", [1, 200])
def test_one_late_message_of_any_delay_below_a_second(tmp_path: Path, distance: int) -> None:
    order = np.insert(np.delete(np.arange(COUNT), 1000), 1000 + distance, 1000)
    found = read_recordings(_write(tmp_path / "bag", order, np.arange(COUNT)), AxisSettings())
    assert np.allclose(found[0].position, SIGNALS[0], atol=1.0e-9)
    assert found.notes[0].startswith("bag: one value of position, control_effort or reference came after a later one")
