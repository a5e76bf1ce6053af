"""Limits beyond which a log shows no effort: of a measuring amplifier, of a number format, or of the drive."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

from sgms_observer.arrays import Floats

MIN_Z_SCORE = 3.0
"""Z-score at which something that a log shows is sure: Shewhart's limit."""
_VISITS = 3
"""Separate visits that a limit needs at least: a machine may rest at zero before its motion and after it."""
_LARGEST_CHANCE = float(stats.norm.sf(MIN_Z_SCORE)) / 2.0
"""Of a limit that is none: two ends are tried."""
_NEEDED = math.ceil(-math.log2(_LARGEST_CHANCE))
"""Times at an extreme value that are sure if the next value is never seen."""
NO_LIMITS = (-math.inf, math.inf)


def effort_limits(effort: Floats) -> tuple[float, float]:
    """Return the smallest and the largest effort that a log shows where they are limits, infinite where they are not.

    A signal that turns at its largest value has it hardly more often than the value below, which it passes on its way
    up and down. A signal that is cut off stays at its largest value. How long any other value lasts without a change
    tells how long a value may last for other reasons: held by the drive, rounded by the log, or at rest. In units of
    the longest such time, the times at the largest value and at the next one are compared by a sign test. One visit
    counts for a third of what is needed at most.

    Args:
        effort: recorded efforts, in order of time, shape (n,) [N or N m].
    """
    if len(effort) == 0:
        return NO_LIMITS
    starts = np.flatnonzero(np.diff(effort, prepend=math.nan) != 0.0)
    lengths, held = np.diff(starts, append=len(effort)), effort[starts]
    values, place = np.unique(held, return_inverse=True)
    if len(values) < 4:
        return NO_LIMITS
    longest = int(np.max(lengths[(place > 0) & (place < len(values) - 1)]))
    counts = np.bincount(place, weights=np.minimum(lengths / longest, _NEEDED / _VISITS))
    low = float(values[0]) if _is_limit(counts[0], counts[1]) else -math.inf
    high = float(values[-1]) if _is_limit(counts[-1], counts[-2]) else math.inf
    return low, high


def _is_limit(count: float, next_count: float) -> bool:
    """Return whether an extreme value surely lasts longer than the value next to it."""
    times = math.floor(count)
    chance = stats.binom.sf(times - 1, times + math.ceil(next_count), 0.5)
    return bool(chance < _LARGEST_CHANCE)
