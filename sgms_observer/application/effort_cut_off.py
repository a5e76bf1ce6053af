"""Efforts that a log cuts off: mass and friction of a fit come out too small."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sgms_observer.offline.recording import Recording


def cut_off_sentences(recordings: Sequence[Recording]) -> list[str]:
    """Return a sentence about each log that shows no effort beyond a limit.

    Args:
        recordings: evenly sampled pieces.
    """
    found = []
    for name in dict.fromkeys(piece.name for piece in recordings):
        pieces = [piece for piece in recordings if piece.name == name]
        limits = " and ".join(f"{limit:.4g}" for limit in pieces[0].effort_limits if math.isfinite(limit))
        if not limits:
            continue
        at_limit = [
            (piece.effort <= piece.effort_limits[0]) | (piece.effort >= piece.effort_limits[1]) for piece in pieces
        ]
        found.append(
            f"the effort of {name} is cut off at {limits} N or N m, which"
            f" {100.0 * float(np.mean(np.concatenate(at_limit))):.2g} % of the samples have:"
            " unless the drive was at its limit, mass and friction come out too small; log a larger range, or move with"
            " less force"
        )
    return found
