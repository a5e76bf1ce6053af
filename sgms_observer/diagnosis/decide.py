"""Decisions: whether a candidate belongs into the model, and what the whole run may claim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.fit import Refit
from sgms_observer.diagnosis.gate import Gate
from sgms_observer.diagnosis.level import PARTS_OF_THE_LEVEL
from sgms_observer.diagnosis.name import Candidate, alternatives
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.diagnosis.structure import excess, frequencies
from sgms_observer.diagnosis.tolerance import Deviation
from sgms_observer.diagnosis.twins import Calibration
from sgms_observer.effects.catalogue import effect

Floats = NDArray[np.float64]

NAMING = ("effect_found", "ambiguous")
"""Verdicts that carry a name."""
ALARM = 20.0
"""Standardised gain that counts as an alarm, if the twins' own largest is below."""
STRUCTURAL_ALARM = {
    "presliding": 63.0,
    "dwell_breakaway": 51.0,
    "backlash": 48.0,
    "nonlinear_viscous": 40.0,
    "eddy_current": 38.0,
    "flexible_mode": 35.0,
    "stribeck": 26.0,
}
"""The same for effects that look like what few elements and an encoder's grid leave behind, which no twin of the
nominal model has; half as much again as the largest seen on the tuning seeds with nothing hidden."""
STRUCTURAL_LENGTH = 30.0
"""Length of those recordings [s]. In a longer one, what returns in every second takes more in proportion; chance does
not."""
COARSE_ALARM = 10.0
"""Alarms count from this many times the threshold where the encoder itself is coarser than told."""
ALARM_GAIN = 40.0
"""Squared residual, in units of the noise, that an effect has to take."""
CLOSES = 0.6
"""An effect is accepted when it takes this share of what is more than noise."""
NEXT_SHARE = 0.08
"""A further effect has to take this share of what the first one took: less may be the first one's shape,"""
LEAST_SHARE = 0.01
"""unless it takes this share"""
FINISHES = 0.75
"""and closes this share of what is left of the held-out gap: what a wrong shape leaves, no single effect finishes."""
OWN_GAIN = 4.0 * ALARM_GAIN
"""An effect whose first look gave no alarm of its own has to take this much once it is fitted fully."""
BOLD = 1000.0
"""A first effect that takes this much where it was fitted need not yet stand out on held-out data, only help: another
one may hide it there. What is named in the end has to close the gap together."""
LEAST = 0.15
"""Where the best candidate is refused, the next one counts if it takes this share of what the best one takes: a sharp
line stands out of the noise although it is the smaller part of the gap."""
KIN = 0.3
"""A further effect that alone would have taken this share of what the first one took,"""
OWN_SHARE = 0.8
"""and takes less than this share of that beside it, is of its kind"""
KIN_SHARE = 0.25
"""and has to take this share on top of it."""
LOUD = 1.2
"""What exceeds the noise band by band is an alarm where the held-out gap, too, is this many times its floor."""
WIDE = 2.5
"""A held-out gap this many times its floor is no accident where an alarm was refused,"""
FAR = 3.0
"""and one this many times its floor is none at all: the refit has bent the model to the recordings it learnt from. On
tuning seeds with nothing hidden the largest seen was 2.1."""


@dataclass(frozen=True)
class Round:
    """One pass through the loop.

    Attributes:
        screen: first look.
        scores: standardised gain of each effect.
        listed: fitted candidates, best first.
        excess_before: squared residual beyond noise, per band.
        excess_after: the same with the best candidate.
        accepted: whether the best candidate was taken into the model.
        closure: share of the closable gap that the best candidate closes on the recordings to judge on, or None.
        alternatives: names the recordings cannot tell from it.
    """

    screen: Screen
    scores: dict[str, float]
    listed: tuple[Candidate, ...]
    excess_before: Floats
    excess_after: Floats
    accepted: bool
    alternatives: tuple[str, ...]
    closure: float | None = None


def alarm_threshold(name: str, calibration: Calibration) -> float:
    """Return the standardised gain from which an effect counts as an alarm."""
    structural = STRUCTURAL_ALARM.get(name, 0.0) * max(1.0, calibration.seconds / STRUCTURAL_LENGTH)
    return max(structural, ALARM, float(calibration.largest.max()))


def judge(
    screen: Screen,
    scores: dict[str, float],
    listed: Sequence[Candidate],
    now: Floats,
    current: Refit,
    rounds: Sequence[Round],
    strong: Sequence[str],
    gate: Gate,
) -> Round:
    """Return the round with the decision whether its best candidate belongs into the model."""
    if not listed:
        return Round(screen, scores, (), now, now, False, ())
    order = list(listed)
    for place, best in enumerate(listed):
        if best.taken < LEAST * listed[0].taken:
            break
        after = excess(best.refit.residual, frequencies(screen.judged))
        closure = gate.closure(current.model, best.refit.model)
        passes = gate.passes(current.model, best.refit.model, not rounds) or (
            not rounds and best.taken > BOLD and gate.gap(best.refit.model) < gate.gap(current.model)
        )
        is_own = best.name in strong or best.taken > OWN_GAIN
        if strong and is_own and passes and _is_acceptable(best, after, rounds, current, closure):
            order = [best, *(item for item in listed if item is not best)]
            others = alternatives(order[place:] if place else order, float(after.sum()))
            return Round(screen, scores, tuple(order), now, after, True, others, closure)
    after = excess(listed[0].refit.residual, frequencies(screen.judged))
    closure = gate.closure(current.model, listed[0].refit.model)
    return Round(screen, scores, tuple(order), now, after, False, (), closure)


def _is_acceptable(
    best: Candidate, after: Floats, rounds: Sequence[Round], current: Refit, closure: float | None
) -> bool:
    """Return whether a candidate explains enough, and more than the shape of the effects before it."""
    if best.taken <= ALARM_GAIN or best.at_bound:
        return False
    if not rounds:
        share = best.taken / (best.taken + float(after.sum()))
        return share > CLOSES or (best.taken > OWN_GAIN and share > 0.3)
    finishes = closure is not None and closure > FINISHES
    needed = (LEAST_SHARE if finishes else NEXT_SHARE) * rounds[0].listed[0].taken
    for item in rounds:
        name = item.listed[0].name
        alone = {one.name: one.taken for one in item.listed}.get(best.name, 0.0)
        shares = alone > KIN * item.listed[0].taken and best.taken < OWN_SHARE * alone
        if shares or is_kin(best.name, name):
            needed = max(needed, KIN_SHARE * max(item.listed[0].taken, power(current, name)))
    return best.taken > needed


def is_kin(one: str, other: str) -> bool:
    """Return whether the catalogue calls two effects easily confused, with each other or both with a third."""
    near, far = {one, *effect(one).confusable_with}, {other, *effect(other).confusable_with}
    return bool(near & far)


def power(found: Refit, name: str) -> float:
    """Return the squared residual that an effect's strength takes now, in units of the noise; 0 where it has none."""
    effects = [item.name for item in found.effects]
    if name not in effects:
        return 0.0
    index = effects.index(name)
    strong = [j for j, parameter in enumerate(effect(name).parameters) if parameter.is_strength]
    squares = [
        (found.effects[i].values[j] / deviation) ** 2
        for (i, j), deviation in zip(found.free, found.deviations(), strict=True)
        if i == index and j in strong and deviation > 0.0
    ]
    return max(squares, default=0.0)


def verdict_of(
    rounds: Sequence[Round],
    current: Refit,
    deviation: Deviation | None,
    resolution: float | None,
    is_poor: bool,
    gate: Gate,
    found: Refit,
    owners: tuple[Refit, Refit],
) -> str:
    """Return the verdict of the whole run.

    Args:
        rounds: passes through the loop.
        current: fit with every accepted effect.
        deviation: mass error or actuator gain, or None.
        resolution: coarser encoder step than told, or None.
        is_poor: whether the recordings hold too little motion.
        gate: recordings to judge on.
        found: fit without the effects.
        owners: fits without and with the effects, with the owner's own number of elements.
    """
    if is_poor:
        return "cannot_tell"
    accepted = [item for item in rounds if item.accepted]
    if accepted:
        total = sum(item.listed[0].taken for item in accepted)
        left = float(rounds[-1].excess_before.sum()) if rounds[0].excess_before.sum() > 0.0 else 0.0
        # the refit after an effect is found weighs anew, and its elements may lose on held-out data what it had closed
        reached = min((current.model, accepted[-1].listed[0].refit.model), key=gate.gap)
        closure = gate.closure(found.model, reached)
        if closure is not None and any(item.listed[0].name in PARTS_OF_THE_LEVEL for item in accepted):
            # more elements than the owner's bend to stand in for a part of the level: what is left to close is his
            closure = max(closure, gate.closure(*(fit.model for fit in owners)) or 0.0)
        if closure is None and total / (total + left) < CLOSES:
            return "unknown_effect"
        if closure is not None and closure <= gate.enough(len(accepted)):
            return "unknown_effect"
        return "ambiguous" if any(item.alternatives for item in accepted) else "effect_found"
    is_wide = gate.gap(current.model) > WIDE * gate.floor and any(
        score > ALARM for item in rounds for name, score in item.scores.items() if name not in STRUCTURAL_ALARM
    )
    is_far = gate.is_unseen and gate.gap(current.model) > FAR * gate.floor
    if is_far or any(item.listed and (is_wide or item.excess_before.sum() > 0.0) for item in rounds):
        return "unknown_effect"
    if deviation is not None:
        return "ambiguous" if deviation.alternatives else "effect_found"
    if resolution is not None:
        return "effect_found"
    return "no_effect"
