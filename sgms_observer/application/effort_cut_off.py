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
    for name, (low, high) in dict.fromkeys((piece.name, piece.effort_limits) for piece in recordings):
        limits = " and ".join(f"{limit:.4g}" for limit in (low, high) if math.isfinite(limit))
        if not limits:
            continue
        effort = np.concatenate([piece.effort for piece in recordings if piece.name == name])
        share = float(np.mean((effort <= low) | (effort >= high)))
        found.append(
            f"the effort of {name} is cut off at {limits} N or N m, which {100.0 * share:.2g} % of the samples have:"
            " unless the drive was at its limit, mass and friction come out too small; log a larger range, or move with"
            " less force"
        )
    return found
