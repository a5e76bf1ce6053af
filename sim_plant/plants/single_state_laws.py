"""Contact laws with one internal state over a sliding curve: LuGre, elasto-plastic and Bouc-Wen.

s(v) is the sliding force of ``stribeck``, z the deflection of a bristle [m] and zeta a share of s(v) [-].

LuGre has one damped bristle: presliding, frictional lag and a damping that fades with speed.

    z' = v - sigma_0 |v| z / s(v),    F = sigma_0 z + sigma_1 exp(-(v / v_d)^2) z'

The elasto-plastic bristle is purely elastic below a breakaway deflection, hence no drift under small forces.

    z' = v - alpha(z, v) sigma_0 |v| z / s(v),    F = sigma_0 z + sigma_1 z'

alpha is 0 below the breakaway deflection and while z and v have opposite signs, 1 above the steady deflection
s(v) / sigma_0, and half a sine wave between them.

Bouc-Wen is a hysteresis whose bound is the sliding force; Dahl's model is n = 1, beta = 1.

    D zeta' = v - |v| |zeta|^(n - 1) zeta k,    F = s(v) zeta

with k = 1 while zeta and v have the same sign and k = 2 beta - 1 while they have opposite ones.

Sources: Canudas de Wit, Olsson, Astrom, Lischinsky 1995, A new model for control of systems with friction, IEEE Trans.
Automatic Control 40(3); the fading damping: Olsson 1996, Control systems with friction, section 3.6. Dupont, Hayward,
Armstrong, Altpeter 2002, Single state elastoplastic friction models, IEEE Trans. Automatic Control 47(5), eqs. 14-18.
Wen 1976, Method for random vibration of hysteretic systems, J. Engineering Mechanics 102(2), normalised as in Ikhouane,
Rodellar 2007, Systems with hysteresis, section 2.3; Dahl 1968, TOR-0158(3107-18)-1, Aerospace Corporation.

All functions named ``draw_...`` take the arguments of ``contact.draw_law``, all named ``..._step`` those of
``contact.advance``; the state is in the first place of its array and is changed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit
from sim_plant.plants.stribeck import COULOMB, KNEE, STATIC, relaxed, sliding_force

STIFFNESS, DAMPING, FADING_VELOCITY, BREAKAWAY = 0, 1, 2, 2
"""Columns of LuGre (the first three) and of the elasto-plastic bristle."""
DISTANCE, POWER, BETA = 0, 1, 2
"""Columns of Bouc-Wen."""


def draw_lugre(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return stiffness sigma_0 [N/m], damping sigma_1 [N s/m] and its fading velocity v_d [m/s]."""
    stiffness = curve[STATIC] / distance
    damping = 2.0 * rng.uniform(0.05, 0.3) * math.sqrt(stiffness * mass)
    return np.array([stiffness, damping, curve[KNEE] * rng.uniform(0.5, 1.5), 0.0, 0.0])


@njit
def lugre_step(velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats) -> float:
    """Advance the bristle at constant velocity and return its force [N]; the state is z [m]."""
    steady = scale * sliding_force(velocity, curve) / law[STIFFNESS]
    before = state[0]
    state[0] = relaxed(before, velocity, abs(velocity) / steady, duration)
    damping = law[DAMPING] * math.exp(-((velocity / law[FADING_VELOCITY]) ** 2))
    return float(law[STIFFNESS] * state[0] + damping * (state[0] - before) / duration)


def draw_elasto_plastic(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return stiffness sigma_0 [N/m], damping sigma_1 [N s/m] and the breakaway deflection [m]."""
    stiffness = curve[STATIC] / distance
    damping = 2.0 * rng.uniform(0.02, 0.1) * math.sqrt(stiffness * mass)
    return np.array([stiffness, damping, rng.uniform(0.3, 0.7) * curve[COULOMB] / stiffness, 0.0, 0.0])


@njit
def _plastic_share(deflection: float, velocity: float, breakaway: float, steady: float) -> float:
    """Return alpha, the plastic share of the motion: 0 below the deflection ``breakaway``, 1 from ``steady`` on [m]."""
    if deflection * velocity <= 0.0:
        return 0.0
    size = abs(deflection)
    if size <= breakaway:
        return 0.0
    if size >= steady:
        return 1.0
    return 0.5 + 0.5 * math.sin(math.pi * (size - 0.5 * (steady + breakaway)) / (steady - breakaway))


@njit
def elasto_plastic_step(
    velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats
) -> float:
    """Advance the bristle at constant velocity and return its force [N]; the state is z [m].

    The scale is a factor on the sliding force and on the breakaway deflection.
    """
    steady = scale * sliding_force(velocity, curve) / law[STIFFNESS]
    before = state[0]
    share = _plastic_share(before, velocity, scale * law[BREAKAWAY], steady)
    state[0] = relaxed(before, velocity, share * abs(velocity) / steady, duration)
    return float(law[STIFFNESS] * state[0] + law[DAMPING] * (state[0] - before) / duration)


def draw_bouc_wen(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return the distance D [m], the power n and the share beta."""
    return np.array([distance, rng.uniform(1.2, 2.5), rng.uniform(0.55, 0.95), 0.0, 0.0])


@njit
def bouc_wen_step(velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats) -> float:
    """Advance the hysteresis at constant velocity and return its force [N]; the state is zeta [-]."""
    zeta = state[0]
    pace = abs(velocity) / law[DISTANCE]
    share = 1.0 if zeta * velocity >= 0.0 else 2.0 * law[BETA] - 1.0
    decay = pace * abs(zeta) ** (law[POWER] - 1.0) * share
    state[0] = min(max(relaxed(zeta, velocity / law[DISTANCE], decay, duration), -1.0), 1.0)
    return float(scale * sliding_force(velocity, curve) * state[0])
