"""Decisions: whether a candidate belongs into the model, and what the whole run may claim."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.discrepancy.fit import Refit
from sgms_observer.discrepancy.gate import SEVERAL, WHOLE, Gate
from sgms_observer.discrepancy.name import Candidate, alternatives
from sgms_observer.discrepancy.screen import Screen
from sgms_observer.discrepancy.structure import excess, frequencies
from sgms_observer.discrepancy.tolerance import Deviation
from sgms_observer.discrepancy.twins import Calibration
from sgms_observer.effects.catalogue import effect

Floats = NDArray[np.float64]

ALARM = 20.0
"""Standardised gain that counts as an alarm, if the twins' own largest is below."""
STRUCTURAL_ALARM = {
    "nonlinear_viscous": 62.0,
    "frictional_lag": 55.0,
    "dwell_breakaway": 40.0,
    "thermal_drift": 40.0,
    "presliding": 40.0,
    "backlash": 35.0,
    "stribeck": 35.0,
    "wear_step": 30.0,
    "eddy_current": 30.0,
    "quadratic_drag": 30.0,
}
"""The same for effects that look like what few elements and an encoder's grid leave behind, which no twin of the
nominal model has; half as much again as the largest seen on the tuning seeds with nothing hidden."""
COARSE_ALARM = 10.0
"""Alarms count from this many times the threshold where the encoder itself is coarser than told."""
ALARM_GAIN = 40.0
"""Squared residual, in units of the noise, that an effect has to take."""
CLOSES = 0.6
"""An effect is accepted when it takes this share of what is more than noise."""
NEXT_SHARE = 0.08
"""A further effect has to take this share of what the first one took: less is the first one's shape."""
LEAST = 0.15
"""Where the best candidate is refused, the next one counts if it takes this share of what the best one takes: a sharp
line stands out of the noise although it is the smaller part of the gap."""
KIN = 0.3
"""A further effect that alone would have taken this share of what the first one took is of its kind,"""
KIN_SHARE = 0.25
"""and has to take this share on top of it."""
PLAIN = 0.2
"""An effect that leaves this share of what exceeds the noise is no misfit of few elements."""
LOUD = 1.2
"""What exceeds the noise band by band is an alarm where the held-out gap, too, is this many times its floor."""
WIDE = 2.5
"""A held-out gap this many times its floor is no accident where an alarm was refused."""


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
    return max(STRUCTURAL_ALARM.get(name, ALARM), float(calibration.largest.max()))


def judge(
    screen: Screen,
    scores: dict[str, float],
    listed: Sequence[Candidate],
    now: Floats,
    current: Refit,
    rounds: Sequence[Round],
    is_strong: bool,
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
        is_plain = float(after.sum()) < PLAIN * float(now.sum())
        is_structural = best.name in STRUCTURAL_ALARM and not is_plain
        passes = gate.passes(current.model, best.refit.model, not rounds, is_structural)
        if is_strong and passes and _is_acceptable(best, after, rounds):
            order = [best, *(item for item in listed if item is not best)]
            others = alternatives(order[place:] if place else order, float(after.sum()))
            return Round(screen, scores, tuple(order), now, after, True, others, closure)
    after = excess(listed[0].refit.residual, frequencies(screen.judged))
    closure = gate.closure(current.model, listed[0].refit.model)
    return Round(screen, scores, tuple(order), now, after, False, (), closure)


def _is_acceptable(best: Candidate, after: Floats, rounds: Sequence[Round]) -> bool:
    """Return whether a candidate explains enough, and more than the shape of the effects before it."""
    if best.taken <= ALARM_GAIN or best.at_bound:
        return False
    if not rounds:
        share = best.taken / (best.taken + float(after.sum()))
        return share > CLOSES or (best.taken > 4.0 * ALARM_GAIN and share > 0.3)
    first = {item.name: item.taken for item in rounds[0].listed}
    largest = rounds[0].listed[0].taken
    is_kin = first.get(best.name, 0.0) > KIN * largest or best.name in effect(rounds[0].listed[0].name).confusable_with
    return best.taken > (KIN_SHARE if is_kin else NEXT_SHARE) * largest


def verdict_of(
    rounds: Sequence[Round],
    current: Refit,
    deviation: Deviation | None,
    resolution: float | None,
    is_poor: bool,
    gate: Gate,
    found: Refit,
) -> str:
    """Return the verdict of the whole run."""
    if is_poor:
        return "cannot_tell"
    accepted = [item for item in rounds if item.accepted]
    if accepted:
        total = sum(item.listed[0].taken for item in accepted)
        left = float(rounds[-1].excess_before.sum()) if rounds[0].excess_before.sum() > 0.0 else 0.0
        if total / (total + left) < CLOSES:
            return "unknown_effect"
        # the refit after an effect is found weighs anew, and its elements may lose on held-out data what it had closed
        reached = min((current.model, accepted[-1].listed[0].refit.model), key=gate.gap)
        closure = gate.closure(found.model, reached)
        if closure is not None and closure <= (WHOLE if len(accepted) == 1 else SEVERAL):
            return "unknown_effect"
        return "ambiguous" if any(item.alternatives for item in accepted) else "effect_found"
    is_wide = gate.gap(current.model) > WIDE * gate.floor and any(
        score > ALARM for item in rounds for name, score in item.scores.items() if name not in STRUCTURAL_ALARM
    )
    if any(item.listed and (is_wide or item.excess_before.sum() > 0.0) for item in rounds):
        return "unknown_effect"
    if deviation is not None:
        return "ambiguous" if deviation.alternatives else "effect_found"
    if resolution is not None:
        return "effect_found"
    return "no_effect"
