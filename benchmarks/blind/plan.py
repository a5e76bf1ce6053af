"""Which cases a blind set is made of; seeds for tuning and seeds for reporting never meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sim_plant.blind.menu import INSIDE, KINDS, NOTHING, OUTSIDE, PAIRS

FIRST_SEED = {"tuning": 0, "report": 100_000}
"""Thresholds are tuned on one set of seeds and reported on another. Seeds from 10,000, 20,000, 40,000, 60,000,
80,000 and 130,000 served for one report each, showed faults that were then mended, and count as tuning since."""
SMALL = 0.05
LARGE = (0.10, 0.25)


@dataclass(frozen=True)
class Case:
    """One case to make: ``size`` 0 is the twin that tells what gap is left without the effect."""

    seed: int
    effect: str
    size: float


@dataclass(frozen=True)
class Amounts:
    """How many cases of each kind: nothing hidden; each effect large, small; each outside effect; each pair."""

    nothing: int
    large: int
    small: int
    outside: int
    pairs: int


AMOUNTS = {
    "quick": Amounts(10, 1, 1, 1, 1),
    "half": Amounts(50, 3, 2, 3, 2),
    "report": Amounts(110, 3, 2, 3, 2),
    "full": Amounts(120, 6, 4, 6, 4),
}


def cases(seeds: str, amount: str) -> list[Case]:
    """Return the cases of a set, in an order in which every beginning is a fair sample of the whole.

    Args:
        seeds: ``tuning`` or ``report``.
        amount: a key of ``AMOUNTS``.
    """
    first, amounts = FIRST_SEED[seeds], AMOUNTS[amount]
    rng = np.random.default_rng([first, 77])
    listed: list[Case] = [Case(first + i, NOTHING, 0.0) for i in range(amounts.nothing)]
    turn = 0

    def next_seed() -> int:
        nonlocal turn
        turn += 1
        return first + turn % amounts.nothing

    for _ in range(amounts.large):
        listed += [Case(next_seed(), name, round(float(rng.uniform(*LARGE)), 4)) for name in INSIDE]
    for _ in range(amounts.small):
        listed += [Case(next_seed(), name, SMALL) for name in INSIDE if KINDS[name].smallest <= SMALL]
    for _ in range(amounts.outside):
        listed += [Case(next_seed(), name, round(float(rng.uniform(*LARGE)), 4)) for name in OUTSIDE]
    for _ in range(amounts.pairs):
        listed += [Case(next_seed(), "+".join(pair), round(float(rng.uniform(*LARGE)), 4)) for pair in PAIRS]
    listed += [Case(one.seed, one.effect, 0.0) for one in listed if one.size > 0.0 and twin(one).effect != NOTHING]
    listed = list(dict.fromkeys(listed))
    return [listed[i] for i in rng.permutation(len(listed))]


def twin(case: Case) -> Case:
    """Return the case that differs in the effect alone."""
    has_own_stage = "frictional_lag" in case.effect or "cross_axis" in case.effect
    return Case(case.seed, case.effect if has_own_stage else NOTHING, 0.0)
