"""The contact laws by name, and one compiled step for all of them."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit
from sim_plant.plants import leuven, rate_state, single_state_laws
from sim_plant.plants.leuven import step as leuven_step
from sim_plant.plants.rate_state import step as rate_state_step
from sim_plant.plants.single_state_laws import bouc_wen_step, elasto_plastic_step, lugre_step

LAWS = ("lugre", "elasto_plastic", "bouc_wen", "rate_state", "leuven")
"""Names of the contact laws; their place here is their number in the compiled step."""

_DRAWS = {
    "lugre": single_state_laws.draw_lugre,
    "elasto_plastic": single_state_laws.draw_elasto_plastic,
    "bouc_wen": single_state_laws.draw_bouc_wen,
    "rate_state": rate_state.draw,
    "leuven": leuven.draw,
}


def draw_law(law: str, rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return the parameters of one law, columns as named in its module.

    Args:
        law: one of ``LAWS``.
        rng: source of chance.
        curve: sliding curve, see ``stribeck``.
        distance: static force over stiffness [m].
        mass: moving mass [kg].
        speed: top speed of the machine [m/s].

    Raises:
        ValueError: for an unknown law.
    """
    if law not in _DRAWS:
        raise ValueError(f"contact law {law!r} is unknown; use one of {', '.join(LAWS)}")
    return _DRAWS[law](rng, curve, distance, mass, speed)


def rested_state() -> Floats:
    """Return the state of an unloaded contact that has rested for a second."""
    state = np.zeros(leuven.STACK + 2 * leuven.MAX_OPEN)
    state[rate_state.AGE] = 1.0
    return state


@njit
def advance(
    number: int, velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats
) -> float:
    """Advance one contact at constant velocity and return its force [N].

    Args:
        number: place of the law in ``LAWS``.
        velocity: sliding velocity [m/s].
        duration: of the step [s].
        scale: factor on the sliding force.
        curve: sliding curve, see ``stribeck``.
        law: parameters of the law.
        state: changed.
    """
    if number == 0:
        return lugre_step(velocity, duration, scale, curve, law, state)
    if number == 1:
        return elasto_plastic_step(velocity, duration, scale, curve, law, state)
    if number == 2:
        return bouc_wen_step(velocity, duration, scale, curve, law, state)
    if number == 3:
        return rate_state_step(velocity, duration, scale, curve, law, state)
    return leuven_step(velocity, duration, scale, curve, law, state)
