"""Positions that a slow bus repeats: the samples that hold an update.

A logger that samples faster than the drive updates its position writes each value several times. Read at the rate of
the logger, such a position stands still and jumps in turn.
"""

from __future__ import annotations

import numpy as np

from sgms_observer.arrays import Floats, Ints

_MIN_CHANGES = 50
"""Fewer changes than this do not show when a position is updated."""
_MIN_SHARE = 0.99
"""Share of the changes that lie a multiple of the update's period apart; the rest are single wrong samples."""
_MIN_STEPS = 1.5
"""Median change in encoder steps: a single step at a time may come from slow motion."""


def updates_of(number: Ints, position: Floats, step: float) -> tuple[int, Ints]:
    """Return the number of samples from one update of a position to the next, and the rows with an update.

    Lost samples and a drive whose clock drifts against that of the logger change when updates come, but hardly any
    distance between two of them.

    Args:
        number: of each sample from the first one, counting those that are missing, shape (n,).
        position: shape (n,) [m or rad].
        step: of the encoder [m or rad]; 0 for none.
    """
    every = np.arange(len(position))
    change = np.diff(position)
    changed = np.flatnonzero(change) + 1
    if len(changed) < _MIN_CHANGES or float(np.median(np.abs(change[changed - 1]))) < _MIN_STEPS * step:
        return 1, every
    distance = np.diff(number[changed])
    count = int(np.argmax(np.bincount(distance)))
    if count <= 1 or float(np.mean(distance % count == 0)) < _MIN_SHARE:
        return 1, every
    last = np.maximum.accumulate(np.where(np.isin(every, changed), every, -1))  # a position at rest has updates, too
    return count, every[(last >= 0) & ((number - number[last]) % count == 0)]
