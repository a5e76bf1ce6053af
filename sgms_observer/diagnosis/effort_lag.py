"""Lag between the stamp of an effort sample and its action.

An effort that is held until the next sample acts half a sample late on average. A drive whose own loop is n times
faster than the recording holds its effort for 1/n of a sample only, and a compensation that comes from a topic is held
beside it. So each recording has its own lag between zero and that of the settings, and a recording in which the
compensation is switched on or off has one for each part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy import stats

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.fit import Refit
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.motion import MIN_DURATION, EffortLag, Motion, delayed
from sgms_observer.diagnosis.whitened import WhitenedData

MIN_HELD_LAG = 0.25
"""Smallest lag of a held effort, in samples."""
MAX_STAMP_ERROR = 0.12
"""Largest lag that counts as an error of the stamps, in samples; a larger lag is an actuator delay."""
MIN_CHI2_REDUCTION = 20.0
"""Smallest decrease of the whitened squared residual for which a lag leaves that of the settings."""
MIN_STEP_REDUCTION = 1.0
"""Smallest decrease for which a lag that differs from that of the settings goes on: a standard error."""
_STEP = 0.1  # samples, of the derivative


def fitted_effort_lags(data: WhitenedData, found: Refit, stated_lag: float) -> tuple[EffortLag, ...]:
    """Return the lag of the effort that fits each recording.

    A larger lag than that of the settings is left to the effect ``actuator_delay``: it becomes that of the settings. An
    effort that acts before its stamp counts as one that acts at it.

    Args:
        data: recordings.
        found: refit of the nominal model to them.
        stated_lag: lag of the settings, in samples.
    """
    nothing = [np.zeros(len(motion.time)) for motion in data.motions]
    columns = np.column_stack([
        data.whitened([*nothing[:place], part, *nothing[place + 1 :]])
        for place, motion in enumerate(data.motions)
        for part in _late_effort_parts(motion)
    ])  # fmt: skip
    jacobian, n = found.jacobian, len(found.logs)
    prior = jacobian[len(columns) :, :n] @ found.logs  # the rows below those of the residual
    columns = np.vstack([columns, np.zeros((len(prior), columns.shape[1]))])
    basis = np.linalg.qr(jacobian)[0]
    left = columns - basis @ (basis.T @ columns)
    normal = left.T @ left
    late = -np.linalg.pinv(normal) @ (left.T @ np.concatenate([found.residual, prior]))
    has_left = np.array([lag != stated_lag for motion in data.motions for lag in motion.lag.values])
    is_significant = late**2 * np.diag(normal) >= np.where(has_left, MIN_STEP_REDUCTION, MIN_CHI2_REDUCTION)
    steps = iter(np.where(is_significant, late, 0.0).tolist())
    return tuple(
        replace(motion.lag, values=tuple(_lag_after(lag, next(steps), stated_lag) for lag in motion.lag.values))
        for motion in data.motions
    )


def _lag_after(lag: float, step: float, stated_lag: float) -> float:
    """Return a lag after a step of its fit, in samples: between none and the stated one, but for inexact stamps."""
    if -MAX_STAMP_ERROR < lag + step < stated_lag + MAX_STAMP_ERROR:
        return lag + step
    return stated_lag if step > 0.0 else 0.0


def changes_of_lag(rest: WeightedResidual, place: int, stated_lag: float, criteria: Criteria) -> tuple[float, ...]:
    """Return the times at which the lag of the effort changes in a recording [s].

    The recording is divided where constant lags fit it best. Parts whose lags do not surely differ are joined again:
    they are judged by their scatter between blocks, so what a model misses does not count as a change. The blocks
    scatter more than by noise, so none counts more than an average one.

    Args:
        rest: residual of the recordings, with weights.
        place: index of the recording.
        stated_lag: lag of the settings, in samples: between no lag and this one the lag may change.
        criteria: length of a block, and thresholds.
    """
    motion, weight = rest.motions[place], rest.weights[place]
    column = motion.low_pass(_late_effort(motion)) * weight
    size = max(1, round(criteria.block / motion.residual_period))
    count = len(column) // size
    lag = motion.lag.at(motion.thinned(motion.time))
    parts = (column * column, column * (column * lag - rest.weighted[place]))
    information, score = (part[: count * size].reshape(count, size).sum(axis=1) for part in parts)
    shares = np.minimum(1.0, information.mean() / np.maximum(information, 1e-300))
    information, score = shares * information, shares * score
    cuts = _best_cuts(information, score, int(np.ceil(MIN_DURATION / criteria.block)) + 1)
    least = float(stats.norm.sf(criteria.min_z_score)) / max(1, count)

    def chance_at(number: int) -> float:
        """Return the probability that chance makes the difference at a cut; 1 for a difference of another cause."""
        ends = (0, *cuts, count)
        first, last = (_late(information[i:j], score[i:j]) for i, j in pairwise(ends[number : number + 3]))
        is_likely = MAX_STAMP_ERROR < abs(last.mean - first.mean) < stated_lag + MAX_STAMP_ERROR
        return _chance_of_difference(first, last) if is_likely else 1.0

    while cuts:
        chances = [chance_at(number) for number in range(len(cuts))]
        if max(chances) < least:
            break
        cuts.pop(int(np.argmax(chances)))
    return tuple(float(motion.thinned(motion.time)[cut * size]) for cut in cuts)


def _best_cuts(information: Floats, score: Floats, shortest: int) -> list[int]:
    """Return the cuts between parts of constant lag that leave least, by Bayes' information criterion.

    Args:
        information, score: of the lag in each block, shape (n,).
        shortest: fewest blocks of a part.

    Source: Yao 1988, Statistics & Probability Letters 6(3) (criterion); Jackson et al. 2005, IEEE Signal Processing
    Letters 12(2) (optimal partitioning).
    """
    count = len(score)
    lag = score / np.maximum(information, 1e-300)
    ahead, behind = information[1:], information[:-1]
    variance = float(np.mean(ahead * behind / np.maximum(ahead + behind, 1e-300) * np.diff(lag) ** 2))
    sums = [np.concatenate(([0.0], np.cumsum(one))) for one in (information, score)]
    best, previous = np.full(count + 1, math.inf), np.zeros(count + 1, dtype=np.intp)
    best[0] = 0.0
    for end in range(shortest, count + 1):
        begin = np.arange(end - shortest + 1)
        total, mean = (one[end] - one[begin] for one in sums)
        left = best[begin] - mean**2 / np.maximum(total, 1e-300) + 2.0 * variance * math.log(count)
        previous[end] = int(np.argmin(left))
        best[end] = left[previous[end]]
    cuts: list[int] = []
    place = int(previous[count])
    while place > 0:
        cuts.insert(0, place)
        place = int(previous[place])
    return cuts


def with_real_changes(lags: Sequence[EffortLag]) -> tuple[EffortLag, ...]:
    """Return fitted lags without the changes that are within an error of the stamps."""
    return tuple(_with_real_changes(lag) for lag in lags)


def _with_real_changes(lag: EffortLag) -> EffortLag:
    """Return a fitted lag without the changes within an error of the stamps; the smallest is removed first."""
    while lag.changes:
        steps = np.abs(np.diff(lag.values))
        least = int(np.argmin(steps))
        if steps[least] > MAX_STAMP_ERROR:
            break
        mean = 0.5 * (lag.values[least] + lag.values[least + 1])
        lag = EffortLag(
            (*lag.values[:least], mean, *lag.values[least + 2 :]), (*lag.changes[:least], *lag.changes[least + 1 :])
        )
    return lag


def notes_on_changes(motions: Sequence[Motion]) -> list[str]:
    """Return a sentence about each recording in which the lag of the effort changes."""
    return [
        f"{motion.name}: until {motion.lag.changes[0]:.1f} s the effort acts {motion.lag.values[0]:.2f} samples after"
        " its stamp, then "
        + ", ".join(
            f"{value:.2f} (until {change:.1f} s)" if math.isfinite(change) else f"{value:.2f}"
            for value, change in zip(motion.lag.values[1:], (*motion.lag.changes[1:], math.inf), strict=True)
        )
        for motion in motions
        if motion.lag.changes
    ]


def _late_effort(motion: Motion) -> Floats:
    """Return by how much the effort of a motion changes if it is late by one more sample [N], shape (n,)."""
    return (delayed(motion.effort, _STEP / motion.step) - motion.effort) / _STEP


def _late_effort_parts(motion: Motion) -> list[Floats]:
    """Return the same for each part of the motion that has its own lag, zero in the other parts."""
    whole, part = _late_effort(motion), motion.lag.part(motion.time)
    return [np.where(part == number, whole, 0.0) for number in range(len(motion.lag.values))]


@dataclass(frozen=True)
class _Late:
    """By how many samples the effort of some blocks is late: estimate, its variance by their scatter, their number."""

    mean: float
    variance: float
    blocks: int


def _late(information: Floats, score: Floats) -> _Late:
    """Return by how many samples the effort of some blocks is late."""
    total, count = float(information.sum()), len(information)
    if total <= 0.0:
        return _Late(0.0, math.inf, count)
    mean = float(score.sum()) / total
    scatter = float(np.sum((score - mean * information) ** 2)) * count / (count - 1)
    return _Late(mean, scatter / total**2, count)


def _chance_of_difference(one: _Late, other: _Late) -> float:
    """Return the probability that chance makes such a difference (Welch 1947, Biometrika 34)."""
    variance = one.variance + other.variance
    if not 0.0 < variance < math.inf:
        return 1.0
    freedom = variance**2 / sum(part.variance**2 / (part.blocks - 1) for part in (one, other))
    return float(2.0 * stats.t.sf(abs(one.mean - other.mean) / math.sqrt(variance), freedom))
