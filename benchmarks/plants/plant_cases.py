"""Which cases the benchmark over plants is made of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_plant.plants.effects import KINDS, menu
from sim_plant.plants.machine import PLANTS, draw_plant

SECOND = "second"
"""The plant that is read from outside of the repository, with ``--shared``."""
SECOND_EFFECTS = (
    "cogging", "asymmetry", "offset", "tight_spot", "spring", "mass", "quadratic", "thermal", "delay", "gain",
    "deadzone", "flex", "dwell", "vibration", "pulses",
)  # fmt: skip
"""What the second plant can hide."""
SECOND_OUTSIDE = ("pulses",)
SECOND_SHARE = 0.17
"""Nominal share of the Coulomb force at the second plant's strength 1; its effects lie between 10 and 25 %."""
NOTHING = "nothing"
SMALL = 0.05
MODERATE = (0.10, 0.25)
BEYOND_TOLERANCE = (0.15, 0.25)
"""Sizes of effects that scale what the owner's file may have wrong by 5 % anyway: mass and gain."""


@dataclass(frozen=True)
class Case:
    """One case: ``size`` is the share of the Coulomb force, 0 with nothing hidden."""

    plant: str
    seed: int
    effect: str
    size: float

    @property
    def name(self) -> str:
        """Return a name that is a file name; it must not be given to the workflow."""
        return f"{self.plant}-{self.seed}-{self.effect}-{round(1000 * self.size):03d}"


@dataclass(frozen=True)
class Amount:
    """How many seeds: with nothing hidden, of each effect inside the catalogue (moderate, small), outside of it."""

    nothing: int
    moderate: int
    small: int
    outside: int


AMOUNTS = {
    "smoke": Amount(1, 0, 0, 0),
    "quick": Amount(4, 1, 0, 1),
    "half": Amount(10, 1, 1, 1),
    "report": Amount(20, 2, 2, 3),
    "full": Amount(40, 4, 3, 4),
}


def cases(plant: str, amount: str, first_seed: int) -> list[Case]:
    """Return the cases of one plant, in an order in which every beginning is a fair sample of the whole.

    Args:
        plant: one of ``PLANTS``, or ``SECOND``.
        amount: a key of ``AMOUNTS``.
        first_seed: seeds count on from here.
    """
    number = AMOUNTS[amount]
    every = (*PLANTS, SECOND)
    rng = np.random.default_rng([first_seed, every.index(plant)])
    if plant == SECOND:
        inside, outside = [one for one in SECOND_EFFECTS if one not in SECOND_OUTSIDE], list(SECOND_OUTSIDE)
        with_small = inside
    else:
        names = menu(draw_plant(plant, first_seed))
        inside = [one for one in names if KINDS[one].is_inside]
        outside = [one for one in names if not KINDS[one].is_inside]
        with_small = [one for one in inside if KINDS[one].has_small]
    listed = [Case(plant, first_seed + i, NOTHING, 0.0) for i in range(number.nothing)]
    turn = 0
    for group, repeats, is_small in (
        (inside, number.moderate, False), (with_small, number.small, True), (outside, number.outside, False)
    ):  # fmt: skip
        for _ in range(repeats):
            for effect in group:
                if plant == SECOND:
                    size = SECOND_SHARE * (0.5 if is_small else 1.0)
                else:
                    sizes = MODERATE if KINDS[effect].has_small else BEYOND_TOLERANCE
                    size = SMALL if is_small else round(float(rng.uniform(*sizes)), 3)
                listed.append(Case(plant, first_seed + turn % max(4, number.nothing), effect, size))
                turn += 1
    return [listed[i] for i in rng.permutation(len(listed))]
