"""Chooses segments with the most information about the asked quantities in the given time.

The Fisher information of a reference is the sum over its segments. For each asked quantity the criterion is the
information that remains when everything else is fitted as well (the Schur complement). Where the prediction has a known
error, the square of the shift that it causes in an estimate is added to the variance. Segments are added by gain per
second, then exchanged in both directions while that helps: one is removed and the time filled again, or one is added
and those with the least gain per second are removed. Removal alone never finds a segment that is longer than the
removed ones.

Sources: Fedorov 1972, Theory of Optimal Experiments (sequential design and exchange); Pukelsheim 1993, Optimal Design
of Experiments, ch. 3 (information for parameters of interest) and ch. 6 (matrix means); Atkinson, Fedorov 1975, The
design of experiments for discriminating between two models, Biometrika 62(1) (evidence between two effects); Pronzato,
Walter 1985, Robust experiment design via stochastic approximation, Mathematical Biosciences 75(1) (several models);
Dette 1997, Designing experiments with respect to 'standardized' optimality criteria, J. Royal Statistical Society B
59(1) (smallest efficiency).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from sgms_observer.arrays import Booleans, Floats, Ints

Result = TypeVar("Result")

_STEEPNESS = 4.0
"""Exponent of the mean that replaces the smallest efficiency: it is smooth, so that single segments can be compared."""
_PASSES = 4  # largest number of rounds of exchanges; they end earlier without a gain
_GAIN = 1.0e-6  # of the criterion; a smaller gain is rounding


@dataclass(frozen=True)
class Goal:
    """Quantities of one model, the information of each segment about them, and their weights.

    Attributes:
        names: of the quantities.
        information: Fisher information of each segment about all columns, shape (segments, p, p).
        bias: product of all columns with each error of the prediction, by segment, shape (segments, p, b).
        prior: information before the recording, shape (p, p).
        wanted: weights of the columns in each quantity, shape (k, p).
        rivals: columns that are fitted beside each quantity, a mask of shape (k, p).
        weight: of each quantity, shape (k,).
        is_smallest: whether the smallest efficiency counts instead of their geometric mean.
        share: weight of this goal.
    """

    names: tuple[str, ...]
    information: Floats
    bias: Floats
    prior: Floats
    wanted: Floats
    rivals: Booleans
    weight: Floats
    is_smallest: bool
    share: float

    def left(self, counts: Floats) -> Floats:
        """Return the information about each quantity that remains when its rivals are fitted as well.

        Args:
            counts: how often each segment is done, shape (..., segments).

        Returns:
            One over the mean squared error, shape (..., k).
        """
        matrix = np.tensordot(counts, self.information, axes=1) + self.prior
        bias = np.tensordot(counts, self.bias, axes=1)
        out = np.empty((*matrix.shape[:-2], len(self.names)))
        groups: dict[bytes, list[int]] = {}
        for number in range(len(self.names)):
            groups.setdefault(self.rivals[number].tobytes(), []).append(number)
        for numbers in groups.values():
            mask = np.flatnonzero(self.rivals[numbers[0]])
            part = matrix[..., mask[:, None], mask[None, :]]
            wanted = self.wanted[np.ix_(np.array(numbers), mask)]
            solved = np.linalg.solve(part, np.broadcast_to(wanted.T, (*part.shape[:-1], len(numbers))))
            shift = np.einsum("...pk,...pb->...kb", solved, bias[..., mask, :])
            error = np.einsum("kp,...pk->...k", wanted, solved) + np.sum(shift**2, axis=-1)
            out[..., numbers] = 1.0 / np.maximum(error, 1.0e-300)
        return out

    def best_alone(self, seconds: float, durations: Floats) -> Floats:
        """Return the information about each quantity of its best single segment, repeated for the whole time.

        Args:
            seconds: of the reference [s].
            durations: of each segment [s].
        """
        return np.asarray(np.max(self.left(np.diag(seconds / durations)), axis=0))


@dataclass(frozen=True)
class Choice:
    """Segments of a reference.

    Attributes:
        counts: how often each segment is done, shape (segments,).
        efficiency: information about each quantity of each goal, over that of the best single segment.
    """

    counts: Ints
    efficiency: tuple[Floats, ...]


class Design:
    """Choose segments.

    Args:
        goals: the goals.
        durations: of each segment [s].
        seconds: time for all [s].
    """

    def __init__(self, goals: Sequence[Goal], durations: Floats, seconds: float) -> None:
        self.goals, self.durations, self.seconds = list(goals), durations, seconds
        self.best = [goal.best_alone(seconds, durations) for goal in self.goals]
        self._results: dict[tuple[str, bytes], Any] = {}

    def value(self, counts: Floats) -> Floats:
        """Return the criterion of references.

        Args:
            counts: how often each segment is done, shape (..., segments).
        """
        total: Floats = np.zeros(counts.shape[:-1])
        for goal, best in zip(self.goals, self.best, strict=True):
            left = goal.left(counts)
            total = total + goal.share * _mean(np.log(left / best), goal)
        return total

    def choose(self) -> Choice:
        """Return the segments: greedily by gain per second, then exchanged while that helps."""
        counts: Ints = self._once(self._filled, np.zeros(len(self.durations), dtype=np.int64))
        value = self._once(self._value_of, counts)
        for _ in range(_PASSES):
            before = value
            for number in range(len(counts)):
                for copies in (1, -1, -2, -int(counts[number])):
                    other = counts.copy()
                    other[number] = max(0, other[number] + copies)
                    if other[number] == counts[number]:
                        continue
                    other = self._once(self._filled, self._once(self._shortened, other))
                    new = self._once(self._value_of, other)
                    if new > value + _GAIN:
                        counts, value = other, new
            if value <= before + _GAIN:
                break
        efficiency = tuple(
            goal.left(counts.astype(float)) / best for goal, best in zip(self.goals, self.best, strict=True)
        )
        return Choice(counts, efficiency)

    def _once(self, work: Callable[[Ints], Result], counts: Ints) -> Result:
        """Return a result from memory where the same segments came before: four of five exchanges end where others did.

        Args:
            work: one of the methods below.
            counts: its argument.
        """
        key = (work.__name__, counts.tobytes())
        if key not in self._results:
            self._results[key] = work(counts)
        found: Result = self._results[key]
        return found

    def _value_of(self, counts: Ints) -> float:
        """Return the criterion of one reference."""
        return float(self.value(counts.astype(float)))

    def _shortened(self, counts: Ints) -> Ints:
        """Remove the segments with the least information per second until the rest fits into the time."""
        counts = counts.copy()
        while float(counts @ self.durations) > self.seconds:
            held = np.flatnonzero(counts)
            trial = np.repeat(counts[None, :].astype(float), len(held), axis=0)
            trial[np.arange(len(held)), held] -= 1.0
            lost = self._value_of(counts) - self.value(trial)
            counts[held[int(np.argmin(lost / self.durations[held]))]] -= 1
        return counts

    def _filled(self, counts: Ints) -> Ints:
        """Add segments as long as one fits."""
        counts = counts.copy()
        here = self._value_of(counts)
        while True:
            free = self.seconds - float(counts @ self.durations)
            fitting = np.flatnonzero(self.durations <= free)
            if not len(fitting):
                return counts
            trial = np.repeat(counts[None, :].astype(float), len(fitting), axis=0)
            trial[np.arange(len(fitting)), fitting] += 1.0
            values = self.value(trial)
            best = int(np.argmax((values - here) / self.durations[fitting]))
            counts[fitting[best]] += 1
            here = float(values[best])


def _mean(logs: Floats, goal: Goal) -> Floats:
    """Return the mean of the logarithms of efficiencies, or a smooth smallest one; shape (..., k) to (...)."""
    weight = goal.weight / np.sum(goal.weight)
    if not goal.is_smallest:
        return np.asarray(logs @ weight)
    least = np.min(logs, axis=-1, keepdims=True)
    return np.asarray(least[..., 0] - np.log(np.exp(-_STEEPNESS * (logs - least)) @ weight) / _STEEPNESS)


def spread_evenly(counts: Ints) -> list[int]:
    """Return the numbers of the segments in an order that spreads the copies of each evenly over the time.

    A drift then changes between copies of the same motion, and is not confused with an effect.

    Args:
        counts: how often each segment is done, shape (segments,).
    """
    places = [((copy + 0.5) / count, number) for number, count in enumerate(counts.tolist()) for copy in range(count)]
    return [number for _place, number in sorted(places)]
