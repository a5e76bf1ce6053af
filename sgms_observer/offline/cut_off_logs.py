"""Logs that cut the effort off, with their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.offline.recording import Recording

_DIGITS = 3  # of a limit; its further ones differ between the pieces of a log, which are rounded by their noise


@dataclass(frozen=True)
class CutOffLog:
    """A log that shows no effort beyond a limit.

    Attributes:
        name: of its recordings.
        limits: one or two [N or N m].
        share: of the samples that are at a limit [-].
    """

    name: str
    limits: tuple[float, ...]
    share: float


def cut_off_logs(recordings: Sequence[Recording]) -> list[CutOffLog]:
    """Return the logs that cut the effort off.

    Args:
        recordings: those of one name with the same limits are pieces of one log.
    """
    logs: dict[tuple[str, ...], list[Recording]] = {}
    for one in recordings:
        if limits := [limit for limit in one.effort_limits if math.isfinite(limit)]:
            logs.setdefault((one.name, *(f"{limit:.{_DIGITS}g}" for limit in limits)), []).append(one)
    found = []
    for pieces in logs.values():
        limits = [limit for limit in pieces[0].effort_limits if math.isfinite(limit)]
        at_limit = [
            (piece.effort <= piece.effort_limits[0]) | (piece.effort >= piece.effort_limits[1]) for piece in pieces
        ]
        found.append(CutOffLog(pieces[0].name, tuple(limits), float(np.mean(np.concatenate(at_limit)))))
    return found
