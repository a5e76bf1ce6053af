"""Effects that later ones have made needless: they were taken first, and the model does as well without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sgms_observer.diagnosis.decide import ALARM_GAIN, BOLD, Round
from sgms_observer.diagnosis.fit import Refit, Refits
from sgms_observer.diagnosis.gate import SURE, Gate, sureness

STEPS = 6


def pruned(
    refits: Refits,
    current: Refit,
    rounds: Sequence[Round],
    gate: Gate,
) -> tuple[Refit, list[Round]]:
    """Return the fit and the rounds without effects that no longer take anything, here or on held-out data.

    As when it was named, one that takes much here need only help there.

    Args:
        refits: to the recordings to learn from.
        current: fit with every accepted effect.
        rounds: passes through the loop.
        gate: recordings to judge on.
    """
    left = list(rounds)
    own = len(current.effects) - sum(item.accepted for item in left)
    place = own
    for number, item in enumerate(rounds):
        if not item.accepted:
            continue
        if len(current.effects) - own < 2:
            break
        fewer = (*current.effects[:place], *current.effects[place + 1 :])
        without = refits.of(fewer, current.logs, STEPS)
        takes = 2.0 * (without.cost - current.cost)
        needed = 0.0 if takes > BOLD else SURE
        if takes > ALARM_GAIN and sureness(without.model, current.model, gate.motions) > needed:
            place += 1
            continue
        current, left[number] = without, replace(item, accepted=False)
    return current, left
