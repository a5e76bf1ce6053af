"""Lateness: samples of a live run whose compensation arrived late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RECOVERY = 0.05
"""Recovery time of the axis after a late compensation [s]: several time constants of the controller."""

_SAME = 1.0e-9  # N


@dataclass(frozen=True)
class Lateness:
    """Lateness of each sample.

    Attributes:
        is_known: whether the recording tells what was applied.
        is_late: where something else was applied than what was meant for that time, shape (n,).
        is_clear: where nothing was late and nothing had been for ``RECOVERY``, shape (n,).
    """

    is_known: bool
    is_late: NDArray[np.bool_]
    is_clear: NDArray[np.bool_]


@dataclass(frozen=True)
class Sent:
    """Compensation that was sent to the stage.

    Attributes:
        stamp_ns: stamps of the single values [ns], increasing, shape (m,).
        force: the single values [N], shape (m,).
        lead: time from a single value's stamp to its action [s].
        horizons: times [ns] and values [N] of each horizon.
        ahead: time from a sample to the one at which the stage reads a horizon for it [s].
    """

    stamp_ns: Ints
    force: Floats
    lead: float
    horizons: Sequence[tuple[Ints, Floats]] = ()
    ahead: float = 0.0

    def holds(self, time_ns: Ints, applied: Floats) -> NDArray[np.bool_]:
        """Return whether each applied force is the one that was sent for its time, shape (n,).

        Args:
            time_ns: samples, increasing [ns], shape (n,).
            applied: forces at them [N], shape (n,).
        """
        place = np.searchsorted(self.stamp_ns + round(self.lead * 1e9), time_ns, side="right") - 1
        meant = np.where(place >= 0, self.force[np.maximum(place, 0)], 0.0)
        found: NDArray[np.bool_] = np.abs(applied - meant) <= _SAME
        read_ns = time_ns + round(self.ahead * 1e9)
        for times, values in self.horizons:
            rows = slice(*np.searchsorted(read_ns, [times[0], times[-1] + 1]))
            value = np.interp((read_ns[rows] - times[0]).astype(float), (times - times[0]).astype(float), values)
            found[rows] |= np.abs(applied[rows] - value) <= _SAME
        return found


def judge_lateness(stamp_ns: Ints, applied_ns: Ints, applied: Floats, sent: Sent) -> Lateness:
    """Compare the applied compensation with the one that was sent for that time.

    Args:
        stamp_ns: the samples to judge [ns], shape (n,).
        applied_ns: samples at which the stage said what it applied, increasing [ns].
        applied: what it applied [N], NaN where it did not say.
        sent: what was sent to it.
    """
    count = len(stamp_ns)
    nothing = Lateness(False, np.zeros(count, bool), np.ones(count, bool))
    if not len(sent.stamp_ns) or not np.isfinite(applied).any():
        return nothing
    was_late = np.isfinite(applied) & ~sent.holds(applied_ns, applied)
    is_late = np.isin(stamp_ns, applied_ns[was_late])
    late_ns = applied_ns[was_late]
    before = np.searchsorted(late_ns, stamp_ns, side="right") - 1
    since = stamp_ns - late_ns[np.maximum(before, 0)] if len(late_ns) else np.zeros(count, np.int64)
    has_been = (before >= 0) & (since < round(RECOVERY * 1e9))
    return Lateness(True, is_late, ~has_been)
