"""The size of a hidden effect: what it does to the force, as a share of the Coulomb force."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import butter, filtfilt

from sim_plant.blind.hidden_effect import Hidden, Kind, Maker
from sim_plant.blind.motion import PERIOD
from sim_plant.blind.recording import FORCE_BAND, Track

PEAK = 0.995
"""Quantile of the hidden force's magnitude that counts as its peak: 150 ms of 30 s may lie above."""
ROUNDS = 8
CLOSE = 0.05
VISIBLE = 0.5


class NotShownError(ValueError):
    """The motion does not show the effect as it was drawn; draw again."""


def measured_size(track: Track, coulomb_force: float) -> float:
    """Return the peak of the hidden force below ``FORCE_BAND`` (its rms where that is larger: rare, hard blows).

    Args:
        track: recording with the hidden force.
        coulomb_force: unit of the size [N].
    """
    slow = filtfilt(*butter(2, 2.0 * PERIOD * FORCE_BAND), track.hidden_force)
    return max(float(np.quantile(np.abs(slow), PEAK)) / coulomb_force, rms_size(track, coulomb_force))


def rms_size(track: Track, coulomb_force: float) -> float:
    """Return the rms of the hidden force over the recording, as a share of the Coulomb force."""
    return float(np.sqrt(np.mean(track.hidden_force**2))) / coulomb_force


def sized(kind: Kind, make: Maker, size: float, run: Callable[[Hidden], Track]) -> Hidden:
    """Return the effect with the strength that gives it ``size``.

    Args:
        kind: menu entry; where the strength is the size, nothing is run.
        make: the drawn effect.
        size: wanted share of the Coulomb force.
        run: records the main motion with an effect hidden.
    """
    if kind.is_direct:
        return make(size)
    strength, low, high = size, 0.0, np.inf
    for _ in range(ROUNDS):
        hidden = make(strength)
        ratio = size / max(measured_size(run(hidden), hidden.known.coulomb_force), 1.0e-6)
        if abs(ratio - 1.0) < CLOSE:
            break
        low, high = (max(low, strength), high) if ratio > 1.0 else (low, min(high, strength))
        guess = strength * float(np.clip(ratio, 0.2, 5.0))
        if low < guess < high:
            strength = guess
        else:
            strength = float(np.sqrt(max(low, 0.1 * high) * high))
    hidden = make(strength)
    if measured_size(run(hidden), hidden.known.coulomb_force) < VISIBLE * size:
        raise NotShownError(f"{kind.name} cannot be shown by this motion as it was drawn")
    return hidden
