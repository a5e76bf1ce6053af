"""Effects that later ones have made needless: they were taken first, and the model does as well without them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from sgms_observer.discrepancy.decide import ALARM_GAIN, Round
from sgms_observer.discrepancy.fit import Judged, Refit, refit
from sgms_observer.discrepancy.gate import SURE, Gate, sureness
from sgms_observer.discrepancy.model import Model
from sgms_observer.settings.axis import EffectSettings

STEPS = 6
Kept = Callable[[Sequence[EffectSettings]], list[tuple[int, int]]]


def pruned(
    judged: Judged,
    nominal: Model,
    tolerance: float,
    current: Refit,
    rounds: Sequence[Round],
    gate: Gate,
    kept: Kept,
    limit: float | None,
) -> tuple[Refit, list[Round]]:
    """Return the fit and the rounds without effects that no longer take anything, here or on held-out data.

    Args:
        judged: recordings to learn from.
        nominal: the given model.
        tolerance: of its parameters.
        current: fit with every accepted effect.
        rounds: passes through the loop.
        gate: recordings to judge on.
        kept: gives the parameters of effects that are never fitted.
        limit: of the friction parameters, see ``refit``.
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
        without = refit(judged, nominal, tolerance, fewer, current.logs, kept(fewer), STEPS, None, limit)
        is_needed = 2.0 * (without.cost - current.cost) > ALARM_GAIN
        if is_needed and sureness(without.model, current.model, gate.motions) > SURE:
            place += 1
            continue
        current, left[number] = without, replace(item, accepted=False)
    return current, left
