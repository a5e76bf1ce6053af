"""Lag between the stamp of an effort sample and its action.

An effort that is held until the next sample acts half a sample late on average. A drive whose own loop is n times
faster than the recording holds its effort for 1/n of a sample only, and a compensation that comes from a topic is held
beside it. So each recording has its own lag between zero and that of the settings, and a recording in which the
compensation is switched on has two.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.fit import Refit, WhitenedData
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.motion import MIN_DURATION, EffortLag, Motion, delayed

Floats = NDArray[np.float64]

MIN_HELD_LAG = 0.25
"""Smallest lag of a held effort, in samples."""
MAX_STAMP_ERROR = 0.12
"""Largest lag that counts as an error of the stamps, in samples; a larger lag is an actuator delay."""
MIN_CHI2_REDUCTION = 20.0
"""Smallest decrease of the whitened squared residual for which a lag is changed."""
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
    is_sure = late**2 * np.diag(normal) >= MIN_CHI2_REDUCTION
    steps = iter(np.where(is_sure, late, 0.0).tolist())
    return tuple(
        replace(motion.lag, first=values[0], last=values[-1])
        for motion in data.motions
        for values in [[_lag_after(lag, next(steps), stated_lag) for lag in motion.lag.values]]
    )


def _lag_after(lag: float, step: float, stated_lag: float) -> float:
    """Return a lag after a step of its fit, in samples: between none and the stated one, but for inexact stamps."""
    if -MAX_STAMP_ERROR < lag + step < stated_lag + MAX_STAMP_ERROR:
        return lag + step
    return stated_lag if step > 0.0 else 0.0


def change_of_lag(rest: WeightedResidual, place: int, stated_lag: float, criteria: Criteria) -> float:
    """Return the time at which the lag of the effort changes in a recording [s]; infinite if it does not.

    The lag of each part is judged by its scatter between blocks: what a model misses does not count as a change.

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
    parts = (column * column, -column * rest.weighted[place])
    information, score = (part[: count * size].reshape(count, size).sum(axis=1) for part in parts)
    margin = int(np.ceil(MIN_DURATION / criteria.block)) + 1
    places = range(margin, count - margin + 1)
    least, time = float(stats.norm.sf(criteria.min_z_score)) / max(1, len(places)), math.inf
    for cut in places:
        first, last = (_late(information[part], score[part]) for part in (slice(None, cut), slice(cut, None)))
        chance = _chance_of_difference(first, last)
        if MAX_STAMP_ERROR < abs(last.mean - first.mean) < stated_lag + MAX_STAMP_ERROR and chance < least:
            least, time = chance, float(motion.thinned(motion.time)[cut * size])
    return time


def with_real_changes(lags: Sequence[EffortLag]) -> tuple[EffortLag, ...]:
    """Return fitted lags without the changes that are within an error of the stamps."""
    return tuple(
        EffortLag.constant(0.5 * (lag.first + lag.last))
        if lag.changes and abs(lag.last - lag.first) <= MAX_STAMP_ERROR
        else lag
        for lag in lags
    )


def notes_on_changes(motions: Sequence[Motion]) -> list[str]:
    """Return a sentence about each recording in which the lag of the effort changes."""
    return [
        f"{motion.name}: until {motion.lag.change:.1f} s the effort acts {motion.lag.first:.2f} samples after its"
        f" stamp, then {motion.lag.last:.2f}"
        for motion in motions
        if motion.lag.changes
    ]


def _late_effort(motion: Motion) -> Floats:
    """Return by how much the effort of a motion changes if it is late by one more sample [N], shape (n,)."""
    return (delayed(motion.effort, _STEP / motion.step) - motion.effort) / _STEP


def _late_effort_parts(motion: Motion) -> list[Floats]:
    """Return the same for the parts of the motion before and after the lag changes, each zero in the other one."""
    whole = _late_effort(motion)
    if not motion.lag.changes:
        return [whole]
    is_before = motion.time < motion.lag.change
    return [np.where(is_before, whole, 0.0), np.where(is_before, 0.0, whole)]


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
