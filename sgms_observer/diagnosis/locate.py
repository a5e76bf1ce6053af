"""Dependence of the residual on coordinates: position, velocity, time and history of the contact."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.diagnosis.coordinates import coordinates_of
from sgms_observer.diagnosis.motion import Motion

BINS = 16
SHIFTS = 199
MAX_RANGE_SHARE = 0.9
"""Largest range of the largest residuals, as a share of what was visited, that says where the residual is."""


@dataclass(frozen=True)
class Located:
    """Mean residual over one coordinate.

    Attributes:
        coordinate: name of the coordinate.
        unit: its unit.
        centres: centre of each bin.
        mean: mean residual of each bin [N].
        band: half width that contains 95 % of the means of circularly shifted residuals [N].
        share: share of the slow residual's variance that the bins explain.
        p_value: share of shifted residuals that the bins explain as well.
        low, high: ends of the range of the bins with the largest mean residual.
        visited: length of the range of all bins; infinite if it is not known.
    """

    coordinate: str
    unit: str
    centres: Floats
    mean: Floats
    band: Floats
    share: float
    p_value: float
    low: float
    high: float
    visited: float = math.inf

    @property
    def is_in_a_range(self) -> bool:
        """Return whether the largest residuals lie in a part of what was visited, rather than all over it."""
        return self.high - self.low <= MAX_RANGE_SHARE * self.visited


COORDINATE_UNITS = {
    "position": "m", "velocity": "m/s", "acceleration": "m/s^2", "time": "s", "effort": "N", "time since reversal": "s",
    "distance since reversal": "m", "dwell": "s",
}  # fmt: skip
"""Coordinates, with their units on a prismatic axis."""


def locate(residual: Sequence[Floats], motions: Sequence[Motion], seed: int) -> list[Located]:
    """Return the mean residual over every coordinate, with its sign and relative to the direction of motion.

    Args:
        residual: band-limited residual of each motion [N].
        motions: the motions.
        seed: seed of the circular shifts.

    Returns:
        Coordinates, the smallest p-value first.
    """
    rng = np.random.default_rng([seed, 78])
    values = np.concatenate(list(residual))
    period = motions[0].residual_period
    width = max(1, int(0.04 / period))
    slow = np.convolve(values, np.ones(width) / width, mode="same")
    direction = np.sign(np.concatenate([motion.thinned(motion.velocity) for motion in motions]))
    shifts = rng.integers(int(0.05 * len(slow)), int(0.95 * len(slow)), SHIFTS)
    found = []
    known = np.vstack([coordinates_of(motion, tuple(COORDINATE_UNITS)) for motion in motions])
    for place, (name, unit) in enumerate(COORDINATE_UNITS.items()):
        coordinate = known[:, place]
        for label, signal in ((name, slow), (f"{name}, along the motion", slow * direction)):
            item = _binned(label, unit, coordinate, signal, shifts)
            if item is not None:
                found.append(item)
    return sorted(found, key=lambda item: (item.p_value, -item.share))


def _binned(label: str, unit: str, coordinate: Floats, signal: Floats, shifts: Ints) -> Located | None:
    """Return the residual over one coordinate, or None if the coordinate hardly varies."""
    edges = np.unique(np.quantile(coordinate, np.linspace(0.0, 1.0, BINS + 1)))
    if len(edges) < 4:
        return None
    place = np.clip(np.searchsorted(edges, coordinate, side="right") - 1, 0, len(edges) - 2)
    count = np.maximum(np.bincount(place, minlength=len(edges) - 1), 1)

    def means(values: Floats) -> Floats:
        return np.bincount(place, weights=values, minlength=len(edges) - 1) / count

    mean = means(signal)
    variance = float(np.var(signal)) + 1e-300
    overall = float(signal.mean())

    def explained(m: Floats) -> float:
        return float(np.sum(count * (m - overall) ** 2) / len(signal) / variance)

    share = explained(mean)
    shifted = [means(np.roll(signal, int(s))) for s in shifts]
    chance = np.array([explained(m) for m in shifted])
    band = np.quantile(np.abs(np.array(shifted) - overall), 0.95, axis=0)
    worst = np.abs(mean - overall) >= 0.5 * np.max(np.abs(mean - overall))
    rows = np.flatnonzero(worst)
    p = float((1 + np.sum(chance >= share)) / (1 + len(chance)))
    centres = 0.5 * (edges[1:] + edges[:-1])
    low, high, visited = float(edges[rows[0]]), float(edges[rows[-1] + 1]), float(edges[-1] - edges[0])
    return Located(label, unit, centres, mean, band, share, p, low, high, visited)
