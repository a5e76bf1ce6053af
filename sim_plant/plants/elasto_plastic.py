"""Elasto-plastic bristle: purely elastic below a breakaway deflection, hence no drift under small forces.

    z' = v - alpha(z, v) sigma_0 |v| z / s(v),    F = sigma_0 z + sigma_1 z'

alpha is 0 below the breakaway deflection and while z and v have opposite signs, 1 above the steady deflection
s(v) / sigma_0, and half a sine wave between them.

Source: Dupont, Hayward, Armstrong, Altpeter 2002, Single state elastoplastic friction models, IEEE Trans. Automatic
Control 47(5), eqs. 14-18.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sgms_observer.jit import njit
from sim_plant.plants.stribeck import COULOMB, STATIC, relaxed, sliding_force

Floats = NDArray[np.float64]
STIFFNESS, DAMPING, BREAKAWAY = 0, 1, 2


def draw(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return stiffness sigma_0 [N/m], damping sigma_1 [N s/m] and the breakaway deflection [m].

    Arguments as of ``contact.draw_law``.
    """
    stiffness = curve[STATIC] / distance
    damping = 2.0 * rng.uniform(0.02, 0.1) * math.sqrt(stiffness * mass)
    return np.array([stiffness, damping, rng.uniform(0.3, 0.7) * curve[COULOMB] / stiffness, 0.0, 0.0])


@njit
def plastic_share(deflection: float, velocity: float, breakaway: float, steady: float) -> float:
    """Return alpha, the share of the motion that is plastic.

    Args:
        deflection: z [m].
        velocity: sliding velocity [m/s].
        breakaway: deflection below which nothing slips [m].
        steady: deflection of steady sliding [m].
    """
    if deflection * velocity <= 0.0:
        return 0.0
    size = abs(deflection)
    if size <= breakaway:
        return 0.0
    if size >= steady:
        return 1.0
    return 0.5 + 0.5 * math.sin(math.pi * (size - 0.5 * (steady + breakaway)) / (steady - breakaway))


@njit
def step(velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats) -> float:
    """Advance the bristle at constant velocity and return its force [N].

    Arguments as of ``contact.advance``; the state: deflection z [m] in its first place; changed.
    The scale is a factor on the sliding force and on the breakaway deflection.
    """
    steady = scale * sliding_force(velocity, curve) / law[STIFFNESS]
    before = state[0]
    share = plastic_share(before, velocity, scale * law[BREAKAWAY], steady)
    state[0] = relaxed(before, velocity, share * abs(velocity) / steady, duration)
    return float(law[STIFFNESS] * state[0] + law[DAMPING] * (state[0] - before) / duration)
