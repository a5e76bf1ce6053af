"""The plants by name: a contact law, and what its machines have in common; the seed draws the rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sim_plant.plants.machine import Machine, draw


@dataclass(frozen=True)
class Plant:
    """One kind of machine.

    Attributes:
        law: contact law.
        fixed: arguments of ``machine.draw`` that are not left to the seed.
        summary: what is special, in a few words.
    """

    law: str
    fixed: dict[str, Any]
    summary: str


PLANTS: dict[str, Plant] = {
    "lugre": Plant("lugre", {}, "LuGre, logged at 1 kHz"),
    "elasto_plastic": Plant("elasto_plastic", {}, "elasto-plastic bristle, logged at 1 kHz"),
    "bouc_wen": Plant("bouc_wen", {}, "Bouc-Wen hysteresis, logged at 1 kHz"),
    "rate_state": Plant("rate_state", {}, "rate-and-state friction, logged at 1 kHz"),
    "robot_joint": Plant(
        "lugre", {"is_rotary": True, "log_rate": 500.0, "has_integrator": False}, "LuGre, rotary, logged at 500 Hz"
    ),
    "gantry": Plant(
        "elasto_plastic",
        {"coulomb_force": 1000.0, "resolution": 1.0e-4, "log_rate": 250.0},
        "elasto-plastic, 1000 N, encoder of 100 um, logged at 250 Hz",
    ),
    "slow_log": Plant("bouc_wen", {"log_rate": 100.0}, "Bouc-Wen, logged at 100 Hz"),
    "fast_log": Plant(
        "rate_state",
        {"coulomb_force": 0.1, "resolution": 1.0e-9, "log_rate": 10_000.0},
        "rate-and-state, 0.1 N, encoder of 1 nm, logged at 10 kHz",
    ),
    "leuven": Plant("leuven", {}, "Leuven hysteresis, logged at 1 kHz"),
}
"""Every plant; leaving one out leaves out a whole row."""


_ROOM = 32
"""Plants that a seed has room for, so that a new plant at the end changes none before it."""


def draw_plant(name: str, seed: int) -> Machine:
    """Return one machine of a plant.

    Args:
        name: one of ``PLANTS``.
        seed: of everything that the plant does not fix; plants do not share their chance.

    Raises:
        ValueError: for an unknown plant.
    """
    if name not in PLANTS:
        raise ValueError(f"plant {name!r} is unknown; use one of {', '.join(PLANTS)}")
    own_seed = _ROOM * seed + list(PLANTS).index(name)
    return draw(own_seed, PLANTS[name].law, **PLANTS[name].fixed)
