"""Naming: every effect that the first look does not exclude is fitted fully, and the best ones are compared."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.fit import UNITS, Refit, Refits, units
from sgms_observer.diagnosis.level import PARTS_OF_THE_LEVEL, told, told_start
from sgms_observer.diagnosis.model import KNEE, STATIC, VISCOUS
from sgms_observer.diagnosis.ranges import believable
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

TRIED = 8
"""Effects that are fitted fully in one round."""
WORTH = 0.15
"""An effect is fitted when the first look gives it this share of the largest gain."""
CONTENDS = 0.7
"""Effects that take this share of what the best one takes in the first fit are fitted to the end and then compared,"""
CONTENDERS = 4
"""at most this many."""
BELIEVED = 2.5
"""An effect that needs a friction parameter this many tolerances off"""
DISBELIEF = 0.1
"""loses this share of what it takes: its owner knows better than that."""
POLISH = 12
"""Steps of that fit,"""
FIRST_STEPS = 8
"""and of the first one."""
AT_END = 1.0e-6
"""A parameter lies at the end of its range when it is this near, relative to the end."""
WEAK = 0.1
"""Share of its strength at which an effect starts whose full strength leads nowhere."""
CLOSE = 0.01
"""Effects are alternatives that take less than the best one by no more than this share of it,"""
CLOSE_KIN = 0.04
"""by this share where the catalogue calls them easily confused,"""
CLOSE_CHI2 = 10.0
"""plus this much in squared noise units,"""
CLOSE_LEFT = 0.3
"""plus this share of what the best one leaves beyond noise: then its shape is not right either."""
FIXED_SHAPES = {"cogging": (3, 4), **UNITS}
"""Parameters that are not free in a first fit: (effect, indices)."""
WHOLE_RANGE = ("motion_share", "attraction_rate", "stop")
"""Parameters that may well lie at an end of their range."""


@dataclass(frozen=True)
class Candidate:
    """One effect, fitted.

    Attributes:
        name: the effect.
        refit: nominal model, effects so far and this one.
        taken: twice the fall of the cost: squared residual, in units of the noise, that it takes.
        at_bound: names of its parameters that the fit drove to the end of their physical range.
    """

    name: str
    refit: Refit
    taken: float
    at_bound: tuple[str, ...]


def fitted(refits: Refits, before: Refit, start: EffectSettings, columns: Floats) -> Candidate:
    """Fit one effect next to those already there.

    Args:
        refits: to the recordings to learn from.
        before: fit without the effect.
        start: the effect at its start.
        columns: derivatives by the nominal parameters.
    """
    nominal = refits.nominal
    effects = (*before.effects, start)
    fixed = [(len(effects) - 1, j) for j in FIXED_SHAPES.get(start.name, ())] + units(before.effects)
    found = refits.of(effects, told_start(before.logs, nominal, start), FIRST_STEPS, fixed, columns)
    if found.cost > before.cost:  # a column reaches only so far: start again near nothing
        weak = tuple(
            WEAK * value if parameter.is_strength else value
            for parameter, value in zip(effect(start.name).parameters, start.values, strict=True)
        )
        effects = (*before.effects, replace(start, values=weak))
        again = refits.of(effects, before.logs, FIRST_STEPS, fixed, columns)
        found = again if again.cost < found.cost else found
    if start.name in PARTS_OF_THE_LEVEL:  # the elements may have bent to stand in for it: start from the owner's
        home = before.logs.copy()
        home[KNEE + 1 :] = 0.0
        at_home = told_start(home, nominal, start)
        again = refits.of((*before.effects, start), at_home, POLISH, fixed)
        found = again if again.cost < found.cost else found
    if start.name == "cogging":
        found = _with_second_harmonic(refits, found, columns)
    return candidate_of(refits, before, found)


def candidate_of(refits: Refits, before: Refit, found: Refit, place: int = -1) -> Candidate:
    """Return a fit of one more effect with what that takes.

    Args:
        refits: to the recordings to learn from.
        before: fit without the effect.
        found: fit with it.
        place: of the effect among the fit's.
    """
    added = found.effects[place]
    taken = 2.0 * (before.cost - found.cost) - math.log(len(found.residual)) * len(added.values)
    moved = told(found.logs, refits.nominal, found.effects)[VISCOUS : STATIC + 1]
    if taken > 0.0 and np.max(np.abs(moved)) > BELIEVED * refits.tolerance:
        taken *= 1.0 - DISBELIEF
    return Candidate(added.name, found, taken, _at_bound(added, refits))


def polished(refits: Refits, before: Refit, item: Candidate) -> Candidate:
    """Return a candidate fitted to the end, with derivatives of its own.

    The nominal parameters that had made up for the missing effect now go home; only then do two effects compare.

    Args:
        refits: to the recordings to learn from.
        before: fit without the effect.
        item: where it starts.
    """
    found = item.refit
    again = refits.of(found.effects, found.logs, POLISH)
    return candidate_of(refits, before, again) if again.cost < found.cost else item


def _with_second_harmonic(refits: Refits, found: Refit, columns: Floats) -> Refit:
    """Return the fit of a cogging with its second harmonic, if that is worth its two parameters."""
    best = found
    for phase in (0.0, 2.1, -2.1):
        last = found.effects[-1]
        values = (*last.values[:3], 0.1 * abs(last.values[0]), phase)
        effects = (*found.effects[:-1], replace(last, values=values))
        other = refits.of(effects, found.logs, 4, units(effects), columns)
        if other.cost < best.cost - 15.0:
            best = other
            break
    return best


def _at_bound(settings: EffectSettings, refits: Refits) -> tuple[str, ...]:
    """Return the names of parameters at the end of their physical or believable range."""
    found = []
    for parameter, value in zip(effect(settings.name).parameters, settings.values, strict=True):
        if parameter.name in WHOLE_RANGE or parameter.unit == "rad" or value == parameter.default:
            continue
        limits = believable(settings.name, parameter.name, refits.judged.motions, refits.nominal)
        ends = [end for end in (parameter.minimum, parameter.maximum, *limits) if math.isfinite(end)]
        if any(abs(value - end) <= AT_END * abs(end) for end in ends):
            found.append(parameter.name)
    return tuple(found)


def candidates(refits: Refits, screen: Screen, before: Refit, workers: int) -> list[Candidate]:
    """Fit the effects that the first look does not exclude.

    Args:
        refits: to the recordings to learn from.
        screen: first look at the residual of ``before``.
        before: fit without the effect.
        workers: threads.

    Returns:
        Candidates, the best first.
    """
    gains = screen.gains()
    left = screen.left_over()
    largest = max((gain for gain, _ in gains.values()), default=0.0)
    ranked = sorted(gains, key=lambda name: -gains[name][0])
    chosen = [name for name in ranked if gains[name][0] > WORTH * largest][:TRIED]
    jobs: list[EffectSettings] = []
    for name in chosen:
        column = gains[name][1]
        if column is not None:
            jobs.append(column.start(left))
            jobs += screen.other_starts(name, left)

    def one(start: EffectSettings) -> Candidate:
        return fitted(refits, before, start, screen.nominal_columns)

    with ThreadPoolExecutor(max_workers=workers) as pool:
        done = list(pool.map(one, jobs))
    best: dict[str, Candidate] = {}
    for item in done:
        if item.name not in best or item.taken > best[item.name].taken:
            best[item.name] = item
    listed = sorted(best.values(), key=lambda item: -item.taken)
    near = [item for item in listed if item.taken > CONTENDS * listed[0].taken][:CONTENDERS]

    def to_the_end(item: Candidate) -> Candidate:
        return polished(refits, before, item)

    with ThreadPoolExecutor(max_workers=workers) as pool:
        ended = list(pool.map(to_the_end, near))
    return sorted([*ended, *listed[len(near) :]], key=lambda item: -item.taken)


def alternatives(listed: Sequence[Candidate], left: float) -> tuple[str, ...]:
    """Return the names that the recordings cannot tell from the first one.

    Args:
        listed: candidates, the best first.
        left: squared residual beyond noise that the best one leaves.
    """
    best = listed[0].taken
    listed = [listed[0], *(item for item in listed[1:] if not item.at_bound)]
    kin = effect(listed[0].name).confusable_with
    found = []
    for item in listed[1:]:
        is_kin = item.name in kin or listed[0].name in effect(item.name).confusable_with
        nearest = best - CLOSE_CHI2 - (CLOSE_KIN if is_kin else CLOSE) * best - CLOSE_LEFT * min(left, 0.3 * best)
        if item.taken > max(nearest, 0.0):
            found.append(item.name)
    return tuple(found)
