"""Efforts that a log cuts off: mass and friction of a fit come out too small."""

from __future__ import annotations

from collections.abc import Sequence

from sgms_observer.offline.cut_off_logs import cut_off_logs
from sgms_observer.offline.recording import Recording


def cut_effort_warnings(recordings: Sequence[Recording]) -> list[str]:
    """Return a sentence about each log that shows no effort beyond a limit.

    Args:
        recordings: evenly sampled pieces.
    """
    return [
        f"the effort of {log.name} is cut off at {' and '.join(f'{limit:.4g}' for limit in log.limits)} N or N m, which"
        f" {100.0 * log.share:.2g} % of the samples have: unless the drive was at its limit, mass and friction come out"
        " too small; log a larger range, or move with less force"
        for log in cut_off_logs(recordings)
    ]
