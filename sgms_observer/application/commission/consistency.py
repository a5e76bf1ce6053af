"""Checks the standard deviations of an observer over a recording, before its compensation acts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.bags.reader import BagSamples
from sgms_observer.errors import DataError
from sgms_observer.observer.all_axes import AllAxes
from sgms_observer.settings.load import load_settings
from sgms_observer.status import Status

MAX_NIS = 2.0
"""Largest mean NIS of an observer with consistent standard deviations. Below 1 they are larger than the innovations."""
MAX_STD_SHARE = 0.5
"""Largest standard deviation of the estimated friction, as a share of the Coulomb force. Two standard deviations reach
that force then: beyond it not even the sign of the friction is known."""


@dataclass(frozen=True)
class Consistency:
    """Consistency of an observer over a recording.

    Attributes:
        nis: mean normalised innovation squared [-]; NaN without a correction.
        std_share: median standard deviation of the friction over the Coulomb force [-].
    """

    nis: float
    std_share: float

    @property
    def is_too_sure(self) -> bool:
        """Return whether the innovations are larger than the observer expects."""
        return self.nis > MAX_NIS


def consistency_of(bag: Path, config: Path, name: str) -> Consistency:
    """Return the consistency of the observer over a recording, from the numbers that the node would publish.

    Args:
        bag: the recording.
        config: parameter file of the observer.
        name: of the axis.

    Raises:
        DataError: the observer has no estimate.
    """
    settings = load_settings(config)
    axis = settings.wanted_axes([name], str(config))[0]
    observer = AllAxes([axis], settings.sample_period)
    squares, spreads = list[np.ndarray](), list[np.ndarray]()
    for _, samples in BagSamples(bag, {name: settings.scales[name]}, settings.sample_period):
        estimates = observer.step({0: samples})[0]
        corrected = np.isfinite(estimates.innovation) & (estimates.innovation_std > 0.0)
        squares.append((estimates.innovation[corrected] / estimates.innovation_std[corrected]) ** 2)
        runs = (estimates.status == Status.RUNNING) & np.isfinite(estimates.friction_std)
        spreads.append(estimates.friction_std[runs])
    square, spread = (np.concatenate(parts) if parts else np.zeros(0) for parts in (squares, spreads))
    if not spread.size:
        raise DataError(f"the observer estimates nothing over {bag}; run sgms replay on it to see why")
    nis = float(np.mean(square)) if square.size else math.nan
    return Consistency(nis, float(np.median(spread)) / axis.friction.coulomb_force)
