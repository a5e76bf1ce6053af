"""Which samples of a live run got the compensation that was made for them, and which got it late."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RECOVERY = 0.05
"""Time after a late compensation that the axis still needs to come back [s]: a few of the controller's."""

_SAME = 1.0e-9  # N


@dataclass(frozen=True)
class Lateness:
    """What came in time.

    Attributes:
        is_known: whether the recording tells what was applied.
        is_late: where something else was applied than what was meant for that time, shape (n,).
        is_clear: where nothing was late and nothing had been for ``RECOVERY``, shape (n,).
    """

    is_known: bool
    is_late: NDArray[np.bool_]
    is_clear: NDArray[np.bool_]


def judge_lateness(
    stamp_ns: Ints, applied_ns: Ints, applied: Floats, sent_ns: Ints, sent: Floats, lead: float
) -> Lateness:
    """Compare what went into the effort with what was sent for that time.

    Args:
        stamp_ns: the samples to judge [ns], shape (n,).
        applied_ns: samples at which the stage said what it applied [ns].
        applied: what it applied [N], NaN where it did not say.
        sent_ns: stamps of the compensations [ns], increasing.
        sent: the compensations [N].
        lead: time from a compensation's stamp to its action [s].
    """
    count = len(stamp_ns)
    nothing = Lateness(False, np.zeros(count, bool), np.ones(count, bool))
    if not len(sent_ns) or not np.isfinite(applied).any():
        return nothing
    place = np.searchsorted(sent_ns + round(lead * 1e9), applied_ns, side="right") - 1
    meant = np.where(place >= 0, sent[np.maximum(place, 0)], 0.0)
    was_late = np.isfinite(applied) & (np.abs(applied - meant) > _SAME)
    is_late = np.isin(stamp_ns, applied_ns[was_late])
    late_ns = applied_ns[was_late]
    before = np.searchsorted(late_ns, stamp_ns, side="right") - 1
    since = stamp_ns - late_ns[np.maximum(before, 0)] if len(late_ns) else np.zeros(count, np.int64)
    has_been = (before >= 0) & (since < round(RECOVERY * 1e9))
    return Lateness(True, is_late, ~has_been)
