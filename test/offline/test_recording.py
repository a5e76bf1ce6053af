"""Recordings are brought to an even grid without losing what was measured."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.errors import DataError
from sgms_observer.observer.samples import Samples
from sgms_observer.offline.recording import read_recordings, recordings_from_samples
from sgms_observer.settings.axis import AxisSettings

COUNT = 25_000


def _samples(stamp_ns: np.ndarray) -> Samples:
    position = np.round(np.sin(2.0 * np.pi * 1e-9 * (stamp_ns - stamp_ns[0])) / 5.0e-8) * 5.0e-8
    nothing = np.full(len(stamp_ns), np.nan)
    return Samples(stamp_ns, position, np.cos(stamp_ns * 1e-9), nothing, nothing)


def test_a_coarse_clock_leaves_the_samples_as_they_are() -> None:
    tick = 60  # ns: pauses of 999,960 and 1,000,020 ns; the median drifts off by half a millisecond
    samples = _samples(np.arange(COUNT) * 1_000_000 // tick * tick)
    (recording,) = recordings_from_samples(samples, "coarse clock")
    assert recording.period == pytest.approx(1.0e-3, rel=1e-8)
    assert np.array_equal(recording.position, samples.position)
    assert np.array_equal(recording.effort, samples.effort)


def test_lost_samples_do_not_stretch_the_period() -> None:
    kept = np.arange(COUNT)[np.random.default_rng(1).random(COUNT) > 0.2]
    samples = _samples(kept * 1_000_000)
    pieces = recordings_from_samples(samples, "lost samples")
    for piece in pieces:
        assert piece.period == pytest.approx(1.0e-3, rel=1e-8)


def test_pauses_cut() -> None:
    stamp = np.arange(COUNT) * 1_000_000 + np.where(np.arange(COUNT) >= 10_000, 2_500_000_000, 0)
    first, second = recordings_from_samples(_samples(stamp), "pause")
    assert (len(first), len(second)) == (10_000, COUNT - 10_000)
    assert second.start - first.start == pytest.approx(12.5, abs=1e-6)


def test_exactly_100_hz_with_stamps_rounded_to_milliseconds_is_even() -> None:
    samples = _samples(np.arange(3000) * 10_000_000)
    found = recordings_from_samples(samples, "100 Hz")
    assert found.notes == ()
    assert found[0].period == pytest.approx(0.01, rel=1e-9)
    assert np.array_equal(found[0].position, samples.position)


def test_duplicate_and_backward_stamps_are_dropped_and_counted() -> None:
    stamp = np.arange(COUNT) * 1_000_000
    stamp[100], stamp[200] = stamp[99], stamp[150]
    (piece,), notes = (found := recordings_from_samples(_samples(stamp), "log")).pieces, found.notes
    assert notes[0] == "log: 2 of 25000 samples with duplicate or backward stamps dropped"
    assert piece.period == pytest.approx(1.0e-3, rel=1e-8)


def test_jitter_is_interpolated_with_a_note() -> None:
    rng = np.random.default_rng(4)
    seconds = 0.01 * np.arange(3000) + rng.uniform(0.0, 0.006, 3000)
    stamp = np.rint(seconds * 1e9).astype(np.int64)
    nothing = np.full(3000, np.nan)
    position = np.sin(2.0 * np.pi * 0.5 * (stamp - stamp[0]) * 1e-9)
    found = recordings_from_samples(Samples(stamp, position, position, nothing, nothing), "jitter")
    piece = found[0]
    assert "interpolated" in found.notes[0]
    true = np.sin(2.0 * np.pi * 0.5 * piece.period * np.arange(len(piece)))
    assert np.abs(piece.position - true)[5:-5].max() < 2.0e-5  # a straight line between samples is off by 1e-4


def _strayed(moves: float = 1.0, samples_stray: bool = False) -> Samples:
    """Return samples whose stamps stray by a tenth of a period; every 250th is missing.

    Args:
        moves: share of the time in which the position moves; then it rests.
        samples_stray: whether the samples were taken at their stamps, or evenly.
    """
    rng, count = np.random.default_rng(7), 6000
    even = 1.0e-3 * np.arange(count)
    stamps = even + rng.normal(0.0, 1.0e-4, count)
    position = np.sin(2.0 * np.pi * np.minimum(stamps if samples_stray else even, moves * even[-1]))
    position += rng.normal(0.0, 1.0e-6, count)
    kept = np.arange(1, count + 1) % 250 != 0
    kept[-1] = True
    nothing = np.full(np.count_nonzero(kept), np.nan)
    stamp = np.rint((1.0 + stamps[kept]) * 1e9).astype(np.int64)
    return Samples(stamp, position[kept], position[kept], nothing, nothing)


@pytest.mark.parametrize("moves", [1.0, 0.2])
def test_samples_that_were_taken_evenly_are_not_moved_to_stamps_that_stray(moves: float) -> None:
    found = recordings_from_samples(_strayed(moves), "log")
    (piece,), (note, lost) = found.pieces, found.notes
    assert piece.period == pytest.approx(1.0e-3, rel=1.0e-5) and piece.start == pytest.approx(1.0, abs=1.0e-5)
    true = np.sin(2.0 * np.pi * np.minimum(1.0e-3 * np.arange(6000), moves * 5.999))
    assert np.abs(piece.position - true).max() < 1.0e-5  # 2e-3 at the stamps
    assert "the positions show that the samples were taken evenly, at" in note
    assert lost == "log: 23 samples are missing, the first at 0.249 s; they were interpolated"
    (coupled,) = recordings_from_samples(_strayed(moves), "log", _strayed(moves)).pieces
    assert coupled.other_position is not None
    assert np.abs(coupled.other_position - true).max() < 5.0e-5  # 2e-3 at the stamps; by straight lines


def _late(spread: float, lost: float) -> tuple[Samples, np.ndarray]:
    """Return samples taken every millisecond that a logger stamps late, in order, and their true positions.

    Args:
        spread: mean delay of the logger, in periods.
        lost: share of the samples that it loses.
    """
    rng, count = np.random.default_rng(5), 20_000
    taken = 1.0e-3 * np.arange(count)
    logged = rng.random(count) >= lost
    stamps = np.sort(1.0 + taken + 1.0e-3 * rng.exponential(spread, count))[logged]
    true = np.round(0.05 * np.sin(2.0 * np.pi * 0.5 * taken) + 0.01 * np.sin(2.0 * np.pi * 2.3 * taken), 6)
    nothing = np.full(len(stamps), np.nan)
    return Samples(np.rint(stamps * 1e9).astype(np.int64), true[logged], true[logged], nothing, nothing), true


@pytest.mark.parametrize("spread", [0.05, 0.1, 0.2, 0.3])
def test_samples_that_a_logger_stamps_late_are_counted(spread: float) -> None:
    """Pauses of 1.6 and 0.4 periods were counted as three periods: 1092 Hz for a delay of 0.3 periods."""
    samples, true = _late(spread, 0.0)
    (piece,) = recordings_from_samples(samples, "log")
    assert piece.period == pytest.approx(1.0e-3, rel=1.0e-5)
    assert np.array_equal(piece.position, true)


@pytest.mark.parametrize("lost", [0.003, 0.05, 0.2])
def test_the_rate_of_late_stamps_is_right_where_samples_are_missing(lost: float) -> None:
    assert recordings_from_samples(_late(0.2, lost)[0], "log")[0].period == pytest.approx(1.0e-3, rel=3.0e-4)


def test_samples_that_were_taken_at_their_stamps_are_read_there() -> None:
    found = recordings_from_samples(_strayed(samples_stray=True), "log")
    (piece,), (note, lost) = found.pieces, found.notes
    assert "the signals were interpolated at" in note and "23 samples are missing" in lost
    assert 0.02 < float(note.split("by up to ")[1].split(" ")[0]) < 0.5  # ten standard deviations are one period
    true = np.sin(2.0 * np.pi * (piece.start - 1.0 + piece.period * np.arange(len(piece))))
    assert np.abs(piece.position - true)[5:-5].max() < 1.0e-5


@pytest.mark.parametrize(
    ("lost", "note"),
    [
        ([3200], "log: one sample is missing, at 3.200 s; it was interpolated"),
        ([5980], "log: one sample is missing, at 5.980 s; it was interpolated"),
        ([700, 701, 4000], "log: 3 samples are missing, the first at 0.700 s; they were interpolated"),
    ],
)
def test_a_lost_sample_is_not_jitter(lost: list[int], note: str) -> None:
    """The note was: stamps stray by up to 1 periods."""
    kept = np.delete(np.arange(6000), lost)
    true = 0.05 * np.sin(2.0 * np.pi * 0.5 * 1.0e-3 * np.arange(6000))
    nothing = np.full(len(kept), np.nan)
    logged = Samples(1_000_000_000 + 1_000_000 * kept, true[kept], true[kept], nothing, nothing)
    found = recordings_from_samples(logged, "log")
    (piece,) = found.pieces
    assert found.notes == (note,)
    assert np.abs(piece.position - true).max() < 1.0e-9


def test_a_hiccup_leaves_a_short_piece_out_and_goes_on() -> None:
    stamp = np.arange(COUNT) * 1_000_000
    stamp[150:] += 1_000_000_000
    found = recordings_from_samples(_samples(stamp), "hiccup")
    assert [len(piece) for piece in found] == [COUNT - 150]
    assert "skipped (150 samples)" in found.notes[0]
    assert " 1 piece between pauses holds fewer than " in found.notes[0] and " and was skipped (" in found.notes[0]


@pytest.mark.parametrize("rate", [20.0, 93.5, 20_000.0])
def test_rates_from_20_hz_to_20_khz(rate: float) -> None:
    stamp = np.rint(np.arange(2000) / rate * 1e9).astype(np.int64)
    assert recordings_from_samples(_samples(stamp), "log")[0].period == pytest.approx(1.0 / rate, rel=1e-6)


def test_a_log_below_20_hz_is_refused_with_its_rate() -> None:
    with pytest.raises(DataError, match="sampled at 5 Hz; record"):
        recordings_from_samples(_samples(np.arange(2000) * 200_000_000), "slow")


def test_a_log_whose_clock_drifts_and_starts_oddly_keeps_its_samples() -> None:
    """The cart's log: a first pause of its own, then a period that grows by 0.3 permille halfway."""
    seconds = np.concatenate(([0.0], 0.00085 + np.cumsum(np.where(np.arange(3000) < 1500, 6.670e-3, 6.672e-3))))
    samples = _samples(np.rint(seconds * 1e9).astype(np.int64))
    found = recordings_from_samples(samples, "drift")
    assert found.notes == ()
    assert np.array_equal(found[0].position, samples.position[1:])


def test_a_fast_motion_logged_slowly_keeps_its_encoders_step_when_a_bag_is_read(tmp_path: Path) -> None:
    step, rate = 5.8e-8, 100.0
    t = np.arange(3000) / rate
    motion = np.where(t < 2.0, 2.0e-6 * np.sin(t), 0.05 * np.sin(2.0 * np.pi * 9.0 * t))
    position = np.round(motion / step) * step  # what the fast part leaves of third differences passes for noise
    write_table(Table((t * 1e9).astype(np.int64), position, np.cos(t), None, None, ()), tmp_path / "bag", "x")
    (found,) = read_recordings(tmp_path / "bag", AxisSettings())
    assert found.encoder_step == pytest.approx(step, rel=1e-6)
    assert np.max(np.abs(found.position - position)) < 0.01 * step
