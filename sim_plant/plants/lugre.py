"""LuGre: one bristle with damping; presliding, frictional lag and a damping that fades with speed.

    z' = v - sigma_0 |v| z / s(v),    F = sigma_0 z + sigma_1 exp(-(v / v_d)^2) z'

Source: Canudas de Wit, Olsson, Astrom, Lischinsky 1995, A new model for control of systems with friction, IEEE Trans.
Automatic Control 40(3); the fading damping: Olsson 1996, Control systems with friction, section 3.6.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sgms_observer.jit import njit
from sim_plant.plants.stribeck import KNEE, STATIC, relaxed, sliding_force

Floats = NDArray[np.float64]
STIFFNESS, DAMPING, FADING_VELOCITY = 0, 1, 2


def draw(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return stiffness sigma_0 [N/m], damping sigma_1 [N s/m] and its fading velocity v_d [m/s].

    Arguments as of ``contact.draw_law``.
    """
    stiffness = curve[STATIC] / distance
    damping = 2.0 * rng.uniform(0.05, 0.3) * math.sqrt(stiffness * mass)
    return np.array([stiffness, damping, curve[KNEE] * rng.uniform(0.5, 1.5), 0.0, 0.0])


@njit
def step(velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats) -> float:
    """Advance the bristle at constant velocity and return its force [N].

    Arguments as of ``contact.advance``; the state: deflection z [m] in its first place; changed.
    """
    steady = scale * sliding_force(velocity, curve) / law[STIFFNESS]
    before = state[0]
    state[0] = relaxed(before, velocity, abs(velocity) / steady, duration)
    damping = law[DAMPING] * math.exp(-((velocity / law[FADING_VELOCITY]) ** 2))
    return float(law[STIFFNESS] * state[0] + damping * (state[0] - before) / duration)
