"""Bouc-Wen hysteresis whose bound is the sliding force; Dahl's model is n = 1, beta = 1.

    D zeta' = v - |v| |zeta|^(n - 1) zeta k,    F = s(v) zeta

with k = 1 while zeta and v have the same sign and k = 2 beta - 1 while they have opposite ones.

Source: Wen 1976, Method for random vibration of hysteretic systems, J. Engineering Mechanics 102(2), normalised as in
Ikhouane, Rodellar 2007, Systems with hysteresis, section 2.3; Dahl 1968, TOR-0158(3107-18)-1, Aerospace Corporation.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sgms_observer.jit import njit
from sim_plant.plants.stribeck import relaxed, sliding_force

Floats = NDArray[np.float64]
DISTANCE, POWER, BETA = 0, 1, 2


def draw(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return the distance D [m], the power n and the share beta.

    Arguments as of ``contact.draw_law``.
    """
    return np.array([distance, rng.uniform(1.2, 2.5), rng.uniform(0.55, 0.95), 0.0, 0.0])


@njit
def step(velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats) -> float:
    """Advance the hysteresis at constant velocity and return its force [N].

    Arguments as of ``contact.advance``; the state: zeta [-] in its first place; changed.
    """
    zeta = state[0]
    pace = abs(velocity) / law[DISTANCE]
    share = 1.0 if zeta * velocity >= 0.0 else 2.0 * law[BETA] - 1.0
    decay = pace * abs(zeta) ** (law[POWER] - 1.0) * share
    state[0] = min(max(relaxed(zeta, velocity / law[DISTANCE], decay, duration), -1.0), 1.0)
    return float(scale * sliding_force(velocity, curve) * state[0])
