"""Rate-and-state friction behind an elastic contact: it creeps, strengthens at rest and remembers a distance.

    theta' = 1 - |w| theta / L,    F = A asinh(w / (2 v_0) exp((F_0 + B ln(theta v_0 / L)) / A)) = k z,    z' = v - w

w is the speed of slip behind the elastic contact of stiffness k. In steady sliding F = F_0 + (A - B) ln(v / v_0).

Source: Dieterich 1979, J. Geophysical Research 84(B5), and Ruina 1983, 88(B12) (ageing law); the regularised form:
Rice, Lapusta, Ranjith 2001, J. Mechanics and Physics of Solids 49(9).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit
from sim_plant.plants.stribeck import COULOMB, KNEE, STATIC

STIFFNESS, DIRECT, EVOLUTION, REFERENCE_VELOCITY, LENGTH = 0, 1, 2, 3, 4
DEFLECTION, AGE = 0, 1


def draw(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return stiffness k [N/m], A [N], B [N], reference velocity v_0 [m/s] and length L [m].

    The Coulomb force holds at the top speed, the static force at a tenth of the curve's knee.

    Arguments as of ``contact.draw_law``.
    """
    direct = rng.uniform(0.008, 0.02) * curve[COULOMB]
    fall = (curve[STATIC] - curve[COULOMB]) / math.log(10.0 * speed / curve[KNEE])
    return np.array([curve[STATIC] / distance, direct, direct + fall, speed, distance * rng.uniform(0.3, 1.0)])


@njit
def steady_force(velocity: float, curve: Floats, law: Floats) -> float:
    """Return the force of steady sliding [N].

    Args:
        velocity: sliding velocity, above zero [m/s].
        curve: sliding curve, see ``stribeck``.
        law: columns named above.
    """
    v_0 = law[REFERENCE_VELOCITY]
    exponent = (curve[COULOMB] + law[EVOLUTION] * math.log(v_0 / velocity)) / law[DIRECT]
    log_argument = math.log(0.5 * velocity / v_0) + exponent
    if log_argument > 30.0:  # asinh(x) = ln(2 x) to the last digit
        return float(law[DIRECT] * (log_argument + math.log(2.0)))
    return float(law[DIRECT] * math.asinh(math.exp(log_argument)))


@njit
def _slip_speed(load: float, stress: float, v_0: float) -> float:
    """Return the speed of slip [m/s] under a force ``load`` at a strength ``stress``, both in units of A."""
    return v_0 * (math.exp(load - stress) - math.exp(-load - stress))


@njit
def step(velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats) -> float:
    """Advance the contact at constant velocity (backward Euler in the deflection) and return its force [N].

    Arguments as of ``contact.advance``; the state: deflection z [m] and age theta [s]; changed.
    """
    v_0, length = law[REFERENCE_VELOCITY], law[LENGTH]
    unit = scale * law[DIRECT]
    stress = (curve[COULOMB] + law[EVOLUTION] * math.log(state[AGE] * v_0 / length)) / law[DIRECT]
    slip_gain = law[STIFFNESS] * duration / unit
    goal = law[STIFFNESS] * (state[DEFLECTION] + velocity * duration) / unit
    side = 1.0 if goal >= 0.0 else -1.0
    goal = abs(goal)
    # y + slip_gain * slip(y) = goal is convex and rising: Newton from above falls onto the root.
    load = goal
    if goal > 0.0:
        load = min(goal, stress + math.log(goal / (slip_gain * v_0) + math.exp(-stress)) + 1.0e-9)
        load = max(load, 0.0)
        for _ in range(30):
            rise = v_0 * (math.exp(load - stress) + math.exp(-load - stress))
            change = (load + slip_gain * _slip_speed(load, stress, v_0) - goal) / (1.0 + slip_gain * rise)
            load -= change
            if abs(change) < 1.0e-9 * (1.0 + load):
                break
    slip = abs(_slip_speed(load, stress, v_0))
    x = slip * duration / length
    mean = 1.0 - 0.5 * x if x < 1.0e-6 else -math.expm1(-x) / x
    state[AGE] = state[AGE] * math.exp(-x) + duration * mean
    force = side * load * unit
    state[DEFLECTION] = force / law[STIFFNESS]
    return float(force)
