"""Names looked at again: what was named while a further effect was still hidden may have been shaped by that one."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import repeat

from sgms_observer.diagnosis.decide import Round
from sgms_observer.diagnosis.fit import Refit, Refits
from sgms_observer.diagnosis.gate import Gate
from sgms_observer.diagnosis.name import CONTENDS, POLISH, alternatives, candidate_of
from sgms_observer.diagnosis.structure import excess, frequencies


def renamed(
    refits: Refits,
    current: Refit,
    rounds: Sequence[Round],
    gate: Gate,
    workers: int,
) -> tuple[Refit, list[Round]]:
    """Return the fit and the rounds with each name decided anew beside all the other effects.

    In each round the effects that came near to the one that was taken stand in for it. One of them takes its place
    where the recordings are fitted better with it and the gap on those to judge on is no wider.

    Args:
        refits: to the recordings to learn from.
        current: fit with every accepted effect.
        rounds: passes through the loop.
        gate: recordings to judge on.
        workers: threads.
    """
    left = list(rounds)
    accepted = [number for number, item in enumerate(left) if item.accepted]
    own = len(current.effects) - len(accepted)
    if len(accepted) < 2:
        return current, left

    for place, number in enumerate(accepted, start=own):
        first = left[number].listed[0]
        held = {item.name for item in current.effects}
        rivals = [
            item.refit.effects[-1]
            for item in left[number].listed[1:]
            if item.taken > CONTENDS * first.taken and item.name not in held and not item.at_bound
        ]
        known = tuple(name for name in left[number].alternatives if name not in held)
        left[number] = replace(left[number], alternatives=known)  # what is in the model as well is no alternative
        if not rivals:
            continue
        others = (*current.effects[:place], *current.effects[place + 1 :])
        without = refits.of(others, current.logs, POLISH)
        stood_in = [(*others[:place], one, *others[place:]) for one in (current.effects[place], *rivals)]
        with ThreadPoolExecutor(max_workers=workers) as pool:
            fits = pool.map(refits.of, stood_in, repeat(current.logs), repeat(POLISH))
            tried = [candidate_of(refits, without, found, place) for found in fits]
        best = max(tried, key=lambda item: item.taken)
        if best.at_bound or gate.gap(best.refit.model) > gate.gap(tried[0].refit.model):
            best = tried[0]
        order = [best, *sorted((item for item in tried if item is not best), key=lambda item: -item.taken)]
        after = excess(best.refit.residual, frequencies(refits.judged))
        left[number] = replace(left[number], listed=tuple(order), alternatives=alternatives(order, float(after.sum())))
        current = best.refit
    return current, left
