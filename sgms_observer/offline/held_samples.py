"""Positions that a slow bus repeats: how many samples each lasts.

A logger that samples faster than the drive updates its position writes each value several times. Read at the rate of
the logger, such a position stands still and jumps in turn.
"""

from __future__ import annotations

import numpy as np

from sgms_observer.arrays import Floats

_MIN_CHANGES = 50
"""Fewer changes than this do not show when a position is updated."""
_MIN_SHARE = 0.99
"""Share of the changes that lie a multiple of the update's period apart; the rest are single wrong samples."""
_MIN_STEPS = 1.5
"""Median change in encoder steps: a single step at a time may come from slow motion."""


def samples_per_change(position: Floats, step: float) -> tuple[int, int]:
    """Return the number of samples from one update of a position to the next, and the first sample with an update.

    Args:
        position: evenly sampled, shape (n,) [m or rad].
        step: of the encoder [m or rad]; 0 for none.
    """
    change = np.diff(position)
    changed = np.flatnonzero(change) + 1
    if len(changed) < _MIN_CHANGES or float(np.median(np.abs(change[changed - 1]))) < _MIN_STEPS * step:
        return 1, 0
    count = int(np.argmax(np.bincount(np.diff(changed))))
    phases = np.bincount(changed % count, minlength=count)
    if count == 1 or int(phases.max()) < _MIN_SHARE * len(changed):
        return 1, 0
    return count, int(np.argmax(phases))
