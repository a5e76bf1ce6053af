"""Where simulation and measurement disagree: the residual over position, velocity, time and history."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.motion import Motion

Floats = NDArray[np.float64]

BINS = 16
SHIFTS = 199
STILL = 1.0e-4  # m/s


@dataclass(frozen=True)
class Located:
    """Disagreement over one coordinate.

    Attributes:
        coordinate: name for people.
        unit: its unit.
        centres: middle of each bin.
        mean: mean residual of each bin [N].
        band: half width within which means lie by chance (95 % of circular shifts) [N].
        share: share of the slow residual's variance that the bins explain.
        p_value: how often a shifted residual is explained as well.
        low, high: ends of the bins with the largest disagreement.
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


def coordinates(motions: Sequence[Motion]) -> dict[str, tuple[str, Floats]]:
    """Return unit and values of each coordinate at the rate of residuals."""

    def of(name: str) -> Floats:
        return np.concatenate([motion.thinned(getattr(motion, name)) for motion in motions])

    velocity = of("velocity")
    history = [history_of(motion) for motion in motions]
    listed = {
        "position": ("m", of("position")),
        "velocity": ("m/s", velocity),
        "acceleration": ("m/s^2", of("acceleration")),
        "time": ("s", of("time")),
        "effort": ("N", of("effort")),
        "time since reversal": ("s", np.concatenate([item[0] for item in history])),
        "distance since reversal": ("m", np.concatenate([item[1] for item in history])),
        "dwell before this motion": ("s", np.concatenate([item[2] for item in history])),
    }
    return listed


def history_of(motion: Motion) -> tuple[Floats, Floats, Floats]:
    """Return time [s] and distance [m] since the last reversal, and the rest before this motion [s]."""
    velocity, period = motion.velocity, motion.period
    n = len(velocity)
    direction = np.where(np.abs(velocity) > STILL, np.sign(velocity), 0.0)
    since, far, rest = np.zeros(n), np.zeros(n), np.zeros(n)
    last, start, resting, before = 0.0, 0, 0, 0.0
    for k in range(n):
        if direction[k] == 0.0:
            resting += 1
        else:
            if resting > 0:
                before = resting * period
                resting = 0
            if direction[k] != last:
                start, last = k, direction[k]
        since[k] = (k - start) * period
        far[k] = abs(motion.position[k] - motion.position[start])
        rest[k] = before
    return motion.thinned(since), motion.thinned(far), motion.thinned(rest)


def locate(residual: Sequence[Floats], motions: Sequence[Motion], seed: int) -> list[Located]:
    """Bin the residual over every coordinate, in the direction of motion and against it.

    Args:
        residual: band-limited residual of each motion [N].
        motions: the motions.
        seed: of the circular shifts.

    Returns:
        Coordinates, the most telling first.
    """
    rng = np.random.default_rng([seed, 78])
    values = np.concatenate(list(residual))
    period = motions[0].residual_period
    width = max(1, int(0.04 / period))
    slow = np.convolve(values, np.ones(width) / width, mode="same")
    direction = np.sign(np.concatenate([motion.thinned(motion.velocity) for motion in motions]))
    shifts = rng.integers(int(0.05 * len(slow)), int(0.95 * len(slow)), SHIFTS)
    found = []
    for name, (unit, coordinate) in coordinates(motions).items():
        for label, signal in ((name, slow), (f"{name}, along the motion", slow * direction)):
            item = _binned(label, unit, coordinate, signal, shifts)
            if item is not None:
                found.append(item)
    return sorted(found, key=lambda item: (item.p_value, -item.share))


def _binned(label: str, unit: str, coordinate: Floats, signal: Floats, shifts: NDArray[np.int64]) -> Located | None:
    """Return the residual over one coordinate, or None when it hardly varies."""
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
    return Located(label, unit, centres, mean, band, share, p, float(edges[rows[0]]), float(edges[rows[-1] + 1]))
