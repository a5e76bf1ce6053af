"""Statistics of the observer node, collected between two diagnostics messages. Imports no ROS."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

import numpy as np

from sgms_observer.estimators.estimator import Results
from sgms_observer.observer.samples import Estimates
from sgms_observer.status import Status

_KEPT_TIMES = 20_000
_STATUS = tuple(Status)  # by code
_Counts = TypeVar("_Counts", bound=Any)  # a dataclass of whole numbers


@dataclass
class AxisStatistics:
    """Counts of one axis, since the last report and since the start.

    Attributes:
        samples: samples since the last report.
        total: samples since the start.
        totals: samples per ``Status`` since the start.
        recent: statuses since the last report.
        latest: status of the latest sample.
    """

    samples: int = 0
    total: int = 0
    totals: dict[Status, int] = field(default_factory=dict)
    recent: set[Status] = field(default_factory=set)
    latest: Status = Status.STARTING
    _nis_sum: float = 0.0
    _nis_count: int = 0

    def add(self, estimates: Estimates | Results) -> None:
        """Count a block of estimates.

        Args:
            estimates: of this axis.
        """
        codes = estimates.status
        self.samples += len(codes)
        self.total += len(codes)
        if len(codes) == 1:
            self._add_one(int(codes[0]), float(estimates.innovation[0]), float(estimates.innovation_std[0]))
            return
        for code, count in enumerate(np.bincount(codes).tolist()):
            if count:
                status = _STATUS[code]
                self.totals[status] = self.totals.get(status, 0) + count
                self.recent.add(status)
        self.latest = _STATUS[codes[-1]]
        corrected = np.isfinite(estimates.innovation) & (estimates.innovation_std > 0.0)
        if corrected.any():
            ratio = estimates.innovation[corrected] / estimates.innovation_std[corrected]
            self._nis_sum += float(ratio @ ratio)
            self._nis_count += int(ratio.size)

    def _add_one(self, code: int, innovation: float, deviation: float) -> None:
        """Count a live sample; nine times faster than a block of one."""
        status = self.latest = _STATUS[code]
        self.totals[status] = self.totals.get(status, 0) + 1
        self.recent.add(status)
        if math.isfinite(innovation) and deviation > 0.0:
            ratio = innovation / deviation
            self._nis_sum += ratio * ratio
            self._nis_count += 1

    @property
    def worst(self) -> Status:
        """Return the worst status since the last report."""
        return max(self.recent, default=Status.RUNNING)

    @property
    def rejected(self) -> int:
        """Return the samples that disagreed with the model and were not used, since the start."""
        return self.totals.get(Status.SAMPLE_REJECTED, 0)

    @property
    def nis(self) -> float:
        """Return the mean normalised innovation squared since the last report; NaN without a correction."""
        return self._nis_sum / self._nis_count if self._nis_count else math.nan

    def start_anew(self) -> None:
        """Begin the next report."""
        self.samples = 0
        self.recent = {self.latest}
        self._nis_sum = 0.0
        self._nis_count = 0


@dataclass(frozen=True)
class StepTimes:
    """Computing times of the steps since the last report.

    Attributes:
        median: median of the times [s].
        p99: 99 % quantile of the times [s].
        longest: largest time [s].
        samples_per_step: mean number of samples of a step [-].
    """

    median: float
    p99: float
    longest: float
    samples_per_step: float


class StepClock:
    """Collects the time each step took, and the steps that took longer than their samples lasted.

    Args:
        sample_period: nominal time between two samples [s].
    """

    def __init__(self, sample_period: float) -> None:
        self._period = sample_period
        self._seconds: list[float] = []
        self._samples = 0
        self.deadline_misses = 0

    def add(self, seconds: float, samples: int) -> None:
        """Count one step.

        Args:
            seconds: its computing time [s].
            samples: number of its samples.
        """
        self.deadline_misses += seconds > samples * self._period
        self._samples += samples
        if len(self._seconds) < _KEPT_TIMES:
            self._seconds.append(seconds)

    def take(self) -> StepTimes:
        """Return the times since the last call, and drop them."""
        steps = len(self._seconds)
        if not steps:
            return StepTimes(math.nan, math.nan, math.nan, math.nan)
        median, p99, longest = np.percentile(self._seconds, (50.0, 99.0, 100.0)).tolist()
        times = StepTimes(median, p99, longest, self._samples / steps)
        self._seconds.clear()
        self._samples = 0
        return times


class Growth:
    """Gives the increase of counters. A fault that has ended stays in the total and is not reported again."""

    def __init__(self) -> None:
        self._before: dict[Hashable, Any] = {}

    def take(self, key: Hashable, counts: _Counts) -> _Counts:
        """Return the increase of these counters since the last call.

        Args:
            key: whose counters they are.
            counts: a dataclass of whole numbers.
        """
        before = self._before.get(key)
        self._before[key] = replace(counts)
        if before is None:
            return counts
        names = [field.name for field in fields(counts)]
        return replace(counts, **{name: getattr(counts, name) - getattr(before, name) for name in names})


class Sentences:
    """Gives each sentence once, when it becomes true.

    The numbers in a sentence may grow without making it new.
    """

    def __init__(self) -> None:
        self._said: set[str] = set()

    def new(self, sentences: Sequence[str]) -> list[str]:
        """Return the sentences whose text, apart from numbers, was not there the last time.

        Args:
            sentences: all that hold now.
        """
        now = {_without_numbers(sentence): sentence for sentence in sentences}
        new = [sentence for key, sentence in now.items() if key not in self._said]
        self._said = set(now)
        return new


def _without_numbers(sentence: str) -> str:
    return "".join(letter for letter in sentence if not letter.isdigit())
