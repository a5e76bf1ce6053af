"""A recording made ready for identification: evenly sampled, finite, without holes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sgms_observer.errors import DataError
from sgms_observer.observer.samples import Samples

Floats = NDArray[np.float64]

_MINIMUM_LENGTH = 200
_EVEN = 0.02  # share of the period by which a stamp may stray before the signals are interpolated
_MEDIAN_OF_NORMAL = 0.6745  # median of the magnitude of a standard normal number
_THIRD_DIFFERENCE = math.sqrt(20.0)  # standard deviation of the third difference of white noise of 1
_QUANTISED = 0.9  # share of samples that differ from the one before, below which the encoder's steps are seen
_GAP = 3.5  # a longer pause than this many periods splits the recording


@dataclass(frozen=True)
class Recording:
    """One evenly sampled piece of a recording.

    Attributes:
        name: where it comes from, for people.
        period: time between two samples [s].
        position: measured position [m], shape (n,).
        effort: effort of the actuator [N], shape (n,).
        reference_position: set-point [m], shape (n,); NaN where there is none.
        sha256: hash of the file it comes from; empty when there is none.
        start: stamp of the first sample [s].
    """

    name: str
    period: float
    position: Floats
    effort: Floats
    reference_position: Floats
    sha256: str = ""
    start: float = 0.0

    def __len__(self) -> int:
        return len(self.position)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self) * self.period

    @property
    def position_noise(self) -> float:
        """Standard deviation of what the position jumps from sample to sample: noise and the encoder's steps [m]."""
        third = np.abs(np.diff(self.position, 3))
        noise = float(np.median(third)) / _MEDIAN_OF_NORMAL / _THIRD_DIFFERENCE
        steps = np.abs(np.diff(self.position))
        moved = steps[steps > 0.0]
        if len(moved) and len(moved) < _QUANTISED * len(steps):  # an encoder that often shows the same number twice
            noise = max(noise, float(np.min(moved)) / math.sqrt(12.0))
        return noise

    def shaken(self, seed: int) -> Recording:
        """Return the recording with as much noise again on its position.

        Args:
            seed: of the noise.
        """
        noise = np.random.default_rng(seed).normal(0.0, self.position_noise, len(self))
        return replace(self, position=self.position + noise)

    def part(self, first: int, last: int) -> Recording:
        """Return some of the samples.

        Args:
            first: number of the first one.
            last: number of the one behind the last.
        """
        cut = slice(first, last)
        return Recording(
            self.name, self.period, self.position[cut], self.effort[cut], self.reference_position[cut], self.sha256,
            self.start + first * self.period,
        )


def recordings_from_samples(samples: Samples, name: str, sha256: str = "") -> tuple[Recording, ...]:
    """Cut a block of samples into evenly sampled pieces.

    Args:
        samples: everything one axis recorded.
        name: where it comes from, for people.
        sha256: hash of the file it comes from.

    Returns:
        Pieces between pauses, each long enough to learn from, in order of time.

    Raises:
        DataError: if nothing usable is left.
    """
    good = np.isfinite(samples.position) & np.isfinite(samples.effort)
    stamp = samples.stamp_ns[good]
    if len(stamp) < _MINIMUM_LENGTH:
        raise DataError(
            f"{name} holds {len(stamp)} samples with both position and control_effort; identification needs at least"
            f" {_MINIMUM_LENGTH}: record both topics"
        )
    keep = np.concatenate(([True], np.diff(stamp) > 0))
    seconds = (stamp[keep] - stamp[0]) * 1e-9
    signals = [values[good][keep] for values in (samples.position, samples.effort, samples.reference_position)]
    pauses = np.diff(seconds)
    typical = float(np.median(pauses))
    whole = pauses <= _GAP * typical
    period = _mean_period(pauses[whole], typical)
    edges = [0, *(np.flatnonzero(~whole) + 1).tolist(), len(seconds)]
    pieces = [
        _even_piece(name, sha256, period, seconds[a:b], [values[a:b] for values in signals], stamp[0] * 1e-9)
        for a, b in pairwise(edges)
        if b - a >= _MINIMUM_LENGTH
    ]
    if not pieces:
        raise DataError(
            f"{name} is broken by pauses into pieces shorter than {_MINIMUM_LENGTH} samples; record it again"
        )
    return tuple(pieces)


def _mean_period(pauses: Floats, typical: float) -> float:
    """Return the period from first to last: a clock that ticks coarsely has a median that drifts off."""
    return float(np.sum(pauses) / np.sum(np.maximum(np.round(pauses / typical), 1.0)))


def _even_piece(
    name: str, sha256: str, period: float, seconds: Floats, signals: Sequence[Floats], origin: float
) -> Recording:
    """Return one piece on an even grid, interpolated only where the stamps stray."""
    count = round(float(seconds[-1] - seconds[0]) / period) + 1
    grid = seconds[0] + period * np.arange(count)
    if count == len(seconds) and float(np.max(np.abs(grid - seconds))) <= _EVEN * period:
        position, effort, reference = (np.ascontiguousarray(values, dtype=np.float64) for values in signals)
    else:
        position, effort, reference = (np.interp(grid, seconds, values) for values in signals)
    return Recording(name, period, position, effort, reference, sha256, origin + float(seconds[0]))


def join_samples(blocks: Sequence[Samples]) -> Samples:
    """Return consecutive blocks as one; without any block, an empty one.

    Args:
        blocks: in the order of time.
    """
    if not blocks:
        nothing = np.empty(0)
        return Samples(np.empty(0, dtype=np.int64), nothing, nothing, nothing, nothing)
    return Samples(
        np.concatenate([block.stamp_ns for block in blocks]),
        np.concatenate([block.position for block in blocks]),
        np.concatenate([block.effort for block in blocks]),
        np.concatenate([block.reference_position for block in blocks]),
        np.concatenate([block.reference_velocity for block in blocks]),
    )
