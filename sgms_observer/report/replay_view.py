"""What is gathered for the page of a replay: signals of bounded size, and the outputs that the recording holds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.errors import SgmsError
from sgms_observer.observer.outgoing import ESTIMATE
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.report.recorded import SETTLE, recorded_lateness, signal_of
from sgms_observer.report.run_pictures import Run
from sgms_observer.report.time_plot import extreme_rows
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.status import Status

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_MOST_ROWS = 60_000
"""Rows of the whole recording that are kept for the plot, about; each is the largest or smallest of its piece."""
_MOST_RECENT = 20_000
"""Rows of the last motion that are kept whole, for friction over velocity and position."""
_MOST_COMPARED = 2_000_000
"""Longest recording whose outputs are compared: they are read into memory [samples]."""
_MOVES = 0.2
"""A block shows motion where its largest velocity reaches this share of the largest one so far."""
_TRUTH = "friction_true"

TIME, POSITION, SET_POINT, VELOCITY, FRICTION, STD, COMPENSATION, INNOVATION = range(8)


class AxisView:
    """What a page shows of one axis, gathered block by block in a memory that does not grow with the recording.

    Args:
        axis: its settings.
        first_ns: begin of the recording [ns].
        expected: samples that the recording holds, about.
    """

    def __init__(self, axis: AxisSettings, first_ns: int, expected: float) -> None:
        self.axis = axis
        self._first_ns = first_ns
        self._share = min(1.0, _MOST_ROWS / max(1.0, expected))
        self._kept: list[Floats] = []
        self._recent: list[Floats] = []
        self._fastest = 0.0
        self.samples = 0
        self.lowest, self.highest, self.largest_compensation = math.inf, -math.inf, 0.0
        self._squares, self._tracked, self.tracking_peak = 0.0, 0, 0.0

    def add(self, samples: Samples, estimates: Estimates) -> None:
        """Take in a block.

        Args:
            samples: what was measured.
            estimates: of these samples.
        """
        is_starting = estimates.status == Status.STARTING
        friction = np.where(is_starting, math.nan, estimates.friction)
        time = (samples.stamp_ns - self._first_ns) * 1e-9
        columns = (samples.position, samples.reference_position, estimates.velocity, friction,
                   estimates.friction_std, estimates.compensation, estimates.innovation)  # fmt: skip
        block = np.stack([time, *columns], axis=1)
        most = max(1, round(self._share * len(time)))
        signals = [block[:, SET_POINT] - block[:, POSITION], *(block[:, k] for k in (FRICTION, INNOVATION))]
        self._kept.append(block[extreme_rows(signals, most)])
        self._keep_recent(block)
        self.samples += len(time)
        self.lowest = min(self.lowest, float(np.nanmin(block[:, FRICTION], initial=math.inf)))
        self.highest = max(self.highest, float(np.nanmax(block[:, FRICTION], initial=-math.inf)))
        largest = float(np.nanmax(np.abs(block[:, COMPENSATION]), initial=0.0))
        self.largest_compensation = max(self.largest_compensation, largest)
        error = signals[0][np.isfinite(signals[0])]
        self._squares += float(np.sum(error**2))
        self._tracked += len(error)
        self.tracking_peak = max(self.tracking_peak, float(np.max(np.abs(error), initial=0.0)))

    @property
    def rows(self) -> Floats:
        """Return the kept rows of the whole recording, a column for each signal."""
        return np.concatenate(self._kept)

    @property
    def tracking_rms(self) -> float:
        """Return the rms tracking error [m]; NaN without a set-point."""
        return math.sqrt(self._squares / self._tracked) if self._tracked else math.nan

    def recent(self, truth: tuple[Ints, Floats] | None) -> Run:
        """Return the last motion, whole.

        Args:
            truth: stamps [ns] and true friction [N]; None if it is not known.
        """
        rows = np.concatenate(self._recent)
        unknown = np.full(len(rows), math.nan)
        true = unknown if truth is None else _at(truth, self._stamps(rows))
        return Run(rows[:, TIME], rows[:, POSITION], rows[:, VELOCITY], rows[:, SET_POINT], rows[:, FRICTION],
                   rows[:, STD], true, rows[:, COMPENSATION], self.axis.units)  # fmt: skip

    def truth_at_rows(self, truth: tuple[Ints, Floats]) -> Floats:
        """Return the true friction at the kept rows [N]; NaN where it is not known.

        Args:
            truth: stamps [ns] and true friction [N].
        """
        return _at(truth, self._stamps(self.rows))

    def _stamps(self, rows: Floats) -> Ints:
        return self._first_ns + np.rint(rows[:, TIME] * 1e9).astype(np.int64)

    def _keep_recent(self, block: Floats) -> None:
        fastest = float(np.nanmax(np.abs(block[:, VELOCITY]), initial=0.0))
        self._fastest = max(self._fastest, fastest)
        if self._recent and fastest < _MOVES * self._fastest:
            return
        if self._recent and block[0, TIME] > self._recent[-1][-1, TIME] + 2.0 * (block[-1, TIME] - block[0, TIME]):
            hole = np.full((1, block.shape[1]), math.nan)
            hole[0, TIME] = self._recent[-1][-1, TIME]
            self._recent.append(hole)
        self._recent.append(block)
        while sum(map(len, self._recent[1:])) >= _MOST_RECENT:
            del self._recent[0]


@dataclass(frozen=True)
class Recorded:
    """The outputs that a recording holds of one axis, beside those of its replay.

    Attributes:
        compared: recorded estimates of the same stamps; 0 without any.
        same: those that the replay gave again to the last bit.
        difference: rms of replayed minus recorded friction [N].
        late_share: share of the samples whose compensation came late; NaN if the recording does not tell.
        truth: stamps [ns] and true friction of a simulated recording [N]; None without.
        error: rms of estimated minus true friction after ``SETTLE`` [N]; NaN without the truth.
    """

    compared: int = 0
    same: int = 0
    difference: float = math.nan
    late_share: float = math.nan
    truth: tuple[Ints, Floats] | None = None
    error: float = math.nan


def recorded_outputs(view: AxisView, bag: Path, replayed: Path, sample_period: float) -> Recorded:
    """Return what the recording holds of the outputs of one axis, and of the truth.

    Args:
        view: the axis.
        bag: the recording.
        replayed: bag with the estimates of the replay.
        sample_period: time between two samples [s].
    """
    if view.samples > _MOST_COMPARED:
        return Recorded()
    name = view.axis.name
    stamps, again = signal_of(replayed, ESTIMATE, name)
    truth, error = _effort(bag, _TRUTH, name), math.nan
    if truth is not None:
        missed = again["effort"] - _at(truth, stamps)
        error = _rms(missed[np.isfinite(missed) & (stamps >= stamps[0] + SETTLE * 1e9)])
    before = _effort(bag, ESTIMATE, name)
    found = _at(before, stamps) if before is not None else np.full(len(stamps), math.nan)
    is_there = np.isfinite(found)
    compared, same = int(np.sum(is_there)), int(np.sum(found == again["effort"]))
    late = math.nan
    if 2 * same > compared:  # the same settings: then the look-ahead of the file is the one of the live run
        try:
            way = recorded_lateness(bag, view.axis, stamps, sample_period)
            late = float(np.mean(way.is_late)) if way.is_known else math.nan
        except SgmsError:
            pass  # it holds no compensation or no set-point
    return Recorded(compared, same, _rms(again["effort"][is_there] - found[is_there]), late, truth, error)


def _effort(bag: Path, topic: str, axis: str) -> tuple[Ints, Floats] | None:
    """Return stamps and efforts of a topic; None if the bag does not hold it."""
    try:
        stamps, fields = signal_of(bag, topic, axis)
    except SgmsError:
        return None
    return stamps, fields["effort"]


def _at(signal: tuple[Ints, Floats], stamps: Ints) -> Floats:
    """Return a signal at stamps; NaN where it has none."""
    place = np.minimum(np.searchsorted(signal[0], stamps), len(signal[0]) - 1)
    return np.where(signal[0][place] == stamps, signal[1][place], math.nan)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan
