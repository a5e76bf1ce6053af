"""Lag between the stamp of an effort sample and its action.

An effort that is held until the next sample acts half a sample late on average. A drive whose own loop is n times
faster than the recording holds its effort for 1/n of a sample only, and a compensation that comes from a topic is held
beside it. So each recording has its own lag between zero and that of the settings, and a recording in which the
compensation is switched on has two.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.fit import Refit, WhitenedData
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.motion import MIN_DURATION, Motion, delayed
from sgms_observer.offline.recording import Recording

Floats = NDArray[np.float64]

MIN_HELD_LAG = 0.25
"""Smallest lag of a held effort, in samples."""
MAX_STAMP_ERROR = 0.12
"""Largest lag that counts as an error of the stamps, in samples; a larger lag is an actuator delay."""
MIN_CHI2_REDUCTION = 20.0
"""Smallest decrease of the whitened squared residual for which a lag is changed."""
_STEP = 0.1  # samples, of the derivative


def fitted_effort_lags(data: WhitenedData, found: Refit, stated_lag: float) -> tuple[float, ...]:
    """Return the lag of the effort that fits each recording, in samples.

    A larger lag than that of the settings is left to the effect ``actuator_delay``. It returns to that of the settings.

    Args:
        data: recordings.
        found: refit of the nominal model to them.
        stated_lag: lag of the settings.
    """
    derivative = _late_effort(data.motions)
    columns = np.column_stack([
        data.whitened([column if place == own else np.zeros_like(column) for place, column in enumerate(derivative)])
        for own in range(len(derivative))
    ])  # fmt: skip
    jacobian, n = found.jacobian, len(found.logs)
    prior = jacobian[len(columns) :, :n] @ found.logs  # the rows below the residual
    columns = np.vstack([columns, np.zeros((len(prior), columns.shape[1]))])
    basis = np.linalg.qr(jacobian)[0]
    left = columns - basis @ (basis.T @ columns)
    normal = left.T @ left
    late = -np.linalg.pinv(normal) @ (left.T @ np.concatenate([found.residual, prior]))
    is_sure = late**2 * np.diag(normal) >= MIN_CHI2_REDUCTION
    lags = []
    for motion, more, sure in zip(data.motions, late.tolist(), is_sure.tolist(), strict=True):
        lag = motion.lag + more
        is_holding = -MAX_STAMP_ERROR < lag < stated_lag + MAX_STAMP_ERROR
        lags.append(motion.lag if not sure else lag if is_holding else stated_lag if more > 0.0 else motion.lag)
    return tuple(lags)


def change_of_lag(rest: WeightedResidual, place: int, stated_lag: float, criteria: Criteria) -> float | None:
    """Return the time at which the lag of the effort changes in a recording [s]; None if it does not.

    The lag of each part is judged by its scatter between blocks: what a model misses does not count as a change.

    Args:
        rest: residual of the recordings, with weights.
        place: index of the recording.
        stated_lag: lag of the settings, in samples: between no lag and this one the lag may change.
        criteria: length of a block, and thresholds.
    """
    motion, weight = rest.motions[place], rest.weights[place]
    column = motion.low_pass(_late_effort([motion])[0]) * weight
    size = max(1, round(criteria.block / motion.residual_period))
    count = len(column) // size
    parts = (column * column, -column * rest.weighted[place])
    information, score = (part[: count * size].reshape(count, size).sum(axis=1) for part in parts)
    margin = int(np.ceil(MIN_DURATION / criteria.block)) + 1
    places = range(margin, count - margin + 1)
    best, time, most = 0.0, 0.0, criteria.z_score_of(max(1, len(places)))
    for cut in places:
        sides = [_late(information[part], score[part]) for part in (slice(None, cut), slice(cut, None))]
        (first, first_error), (last, last_error) = sides
        error = float(np.hypot(first_error, last_error))
        change = abs(last - first)
        if error > 0.0 and MAX_STAMP_ERROR < change < stated_lag + MAX_STAMP_ERROR and change / error > best:
            best, time = change / error, cut * size * motion.residual_period + float(motion.thinned(motion.time)[0])
    return time if best > most else None


def pieces_of_one_lag(
    records: Sequence[Recording], rest: WeightedResidual, stated_lag: float, criteria: Criteria
) -> tuple[Recording, ...]:
    """Return recordings, each cut where the lag of its effort changes.

    Args:
        records: the recordings.
        rest: their residual, with weights.
        stated_lag: lag of the settings, in samples.
        criteria: length of a block, and thresholds.
    """
    pieces: list[Recording] = []
    for place, record in enumerate(records):
        time = change_of_lag(rest, place, stated_lag, criteria)
        ends = [0, *([] if time is None else [round(time / record.period)]), len(record)]
        pieces += [record if time is None else record.part(*pair) for pair in pairwise(ends)]
    return tuple(pieces)


def notes_on_cuts(records: Sequence[Recording], motions: Sequence[Motion]) -> list[str]:
    """Return a sentence about each recording that was cut where the lag of its effort changes.

    Args:
        records: the pieces.
        motions: the same, filtered.
    """
    return [
        f"{later.name}: from {later.start - earlier.start:.1f} s on the effort acts {after.lag:.2f} samples after its"
        f" stamp, before that {before.lag:.2f}; read as two recordings"
        for (earlier, before), (later, after) in pairwise(zip(records, motions, strict=True))
        if abs(earlier.start + earlier.duration - later.start) < 0.5 * later.period  # nothing lies between
    ]


def _late_effort(motions: Sequence[Motion]) -> list[Floats]:
    """Return by how much the effort of each motion changes if it is late by one more sample [N]."""
    shifts = [_STEP / motion.step for motion in motions]
    return [
        (delayed(motion.effort, shift) - motion.effort) / _STEP for motion, shift in zip(motions, shifts, strict=True)
    ]


def _late(information: Floats, score: Floats) -> tuple[float, float]:
    """Return by how many samples the effort of some blocks is late, and its standard error from their scatter."""
    total = float(information.sum())
    if total <= 0.0:
        return 0.0, np.inf
    late = float(score.sum()) / total
    return late, float(np.sqrt(np.sum((score - late * information) ** 2))) / total
