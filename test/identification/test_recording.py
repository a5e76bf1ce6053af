"""Recordings are brought to an even grid without losing what was measured."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.identification.recording import recordings_from_samples
from sgms_observer.observer.samples import Samples

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
