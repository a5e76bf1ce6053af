"""How much of a whitened residual is more than noise, band by band."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.fit import Judged
from sgms_observer.diagnosis.motion import BAND

Floats = NDArray[np.float64]

EDGES = (0.0, 1.0, 3.0, 8.0, 25.0)
"""Bands in which a residual is compared with its noise [Hz]; above them colour alone does not tell cause from noise."""
SLACK = (1.5, 0.8, 0.4, 0.3)
"""Share by which a band may exceed its noise: what few elements and an encoder's grid leave behind."""


def frequencies(judged: Judged) -> Floats:
    """Return the frequency of each whitened residual [Hz]."""
    parts = []
    for motion, noise in zip(judged.motions, judged.noise, strict=True):
        grid = np.fft.rfftfreq(len(motion.thinned(motion.time)), noise.period)
        grid = grid[grid <= BAND]
        parts.append(np.concatenate([grid, grid[1:]]))
    return np.concatenate(parts)


def excess(residual: Floats, frequency: Floats, has_slack: bool = True) -> Floats:
    """Return the squared residual of each band beyond what noise explains (0 where it explains all).

    Args:
        residual: whitened residual.
        frequency: of each entry, see ``frequencies``.
        has_slack: whether ``SLACK`` and three standard deviations of chance are taken off first.
    """
    found = np.zeros(len(SLACK))
    for i, slack in enumerate(SLACK):
        rows = (frequency >= EDGES[i]) & (frequency < EDGES[i + 1])
        count = float(rows.sum())
        allowed = count + (slack * count + 3.0 * np.sqrt(2.0 * count) if has_slack else 0.0)
        square = float(residual[rows] @ residual[rows])
        found[i] = square - count if square > allowed else 0.0
    return found
