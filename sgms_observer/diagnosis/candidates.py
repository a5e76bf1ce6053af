"""Candidates: every hypothesis that the first look does not exclude, fitted fully beside what is in the model already.

A hypothesis is an effect of the catalogue, an effect of the owner's file whose values moved, or values of the file
itself that no longer hold (friction, elements, contact law).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.fit import REFERENCE_PARAMETERS, Refit, RefitSetup, reference_parameters
from sgms_observer.diagnosis.model import STRIBECK_VELOCITY
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.diagnosis.sliding_force import PARTS_OF_SLIDING_FORCE, start_logs
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

FIRST_STEPS = 8
"""Steps of a first fit, with the derivatives of the first look,"""
LAST_STEPS = 12
"""and of the fit that is compared, with derivatives of its own."""
MAX_FITTED = 9
"""Effects that are fitted fully in one round,"""
MAX_COMPARED = 5
"""and that are fitted to the end."""
MIN_GAIN_SHARE = 0.1
"""An effect is fitted when the first look gives it this share of the largest gain."""
ABSORBED_BY_NOMINAL = ("mass_error", "actuator_gain")
"""Effects that the nominal parameters can take in whole: only their tolerance tells, which the first look cannot."""
WEAK_START_SHARE = 0.1
"""Share of its strength at which an effect starts again whose full strength leads nowhere."""
FIXED_SHAPES = {"cogging": (3, 4), **REFERENCE_PARAMETERS}
"""Parameters that are not free in a first fit: (effect, indices)."""
SECOND_HARMONIC_GAIN = 15.0
"""Fall of the cost that a second harmonic's two parameters have to bring: five standard errors."""


@dataclass(frozen=True)
class Candidate:
    """One hypothesis, fitted.

    Attributes:
        name: the effect, or which values of the file changed (``changed friction`` and the like).
        refits: how it was fitted: with which freedom of the nominal parameters.
        refit: nominal model, effects so far and this one.
        trials: shapes that were tried before this one was found.
    """

    name: str
    setup: RefitSetup
    refit: Refit
    trials: int

    @property
    def settings(self) -> EffectSettings | None:
        """Return the effect with its fitted values, or None where values of the file changed."""
        return next((item for item in self.refit.effects if item.name == self.name), None)

    @property
    def parameter_count(self) -> int:
        """Return how many parameters the fit moves."""
        return len(self.refit.logs) + len(self.refit.free) if self.settings is None else len(self.refit.free)


def with_effect(effects: Sequence[EffectSettings], start: EffectSettings) -> tuple[EffectSettings, ...]:
    """Return the effects with one more, or with new values of one that is there already."""
    if any(item.name == start.name for item in effects):
        return tuple(start if item.name == start.name else item for item in effects)
    return (*effects, start)


def with_free_effect(setup: RefitSetup, name: str) -> RefitSetup:
    """Return refits in which an effect of the owner's file may move."""
    return replace(setup, fixed_effects=setup.fixed_effects - {name})


def first_fit(setup: RefitSetup, before: Refit, start: EffectSettings, columns: Floats) -> Refit:
    """Return a first fit of one effect next to those already there.

    Args:
        refits: to the recordings to learn from; the effect itself is free in them.
        before: fit without the effect.
        start: the effect at its start.
        columns: derivatives by the nominal parameters.
    """
    nominal = setup.nominal
    effects = with_effect(before.effects, start)
    place = [item.name for item in effects].index(start.name)
    fixed = [(place, j) for j in FIXED_SHAPES.get(start.name, ())] + reference_parameters(before.effects)
    found = setup.fit(effects, start_logs(before.logs, nominal, start), FIRST_STEPS, fixed, columns)
    if found.cost > before.cost:  # a column reaches only so far: start again near nothing
        weak = tuple(
            WEAK_START_SHARE * value if parameter.is_strength else value
            for parameter, value in zip(effect(start.name).parameters, start.values, strict=True)
        )
        again = setup.fit(
            with_effect(before.effects, replace(start, values=weak)), before.logs, FIRST_STEPS, fixed, columns
        )
        found = again if again.cost < found.cost else found
    if start.name in PARTS_OF_SLIDING_FORCE:  # the elements may have bent to stand in for it: start from the owner's
        home = before.logs.copy()
        home[STRIBECK_VELOCITY + 1 :] = 0.0
        again = setup.fit(effects, start_logs(home, nominal, start), LAST_STEPS, fixed)
        found = again if again.cost < found.cost else found
    if start.name == "cogging":
        found = _with_second_harmonic(setup, found, place, columns)
    return found


def finish_fit(setup: RefitSetup, found: Refit) -> Refit:
    """Return a fit continued with derivatives of its own, which evidence and intervals need."""
    again = setup.fit(found.effects, found.logs, LAST_STEPS)
    return again if again.cost <= found.cost else setup.fit(found.effects, found.logs, 1)


def _with_second_harmonic(setup: RefitSetup, found: Refit, place: int, columns: Floats) -> Refit:
    """Return the fit of a cogging with its second harmonic, if that is worth its two parameters."""
    for phase in (0.0, 2.1, -2.1):
        last = found.effects[place]
        start = replace(last, values=(*last.values[:3], 0.1 * abs(last.values[0]), phase))
        effects = with_effect(found.effects, start)
        other = setup.fit(effects, found.logs, 4, reference_parameters(effects), columns)
        if other.cost < found.cost - SECOND_HARMONIC_GAIN:
            return other
    return found


def effect_candidates(setup: RefitSetup, screen: Screen, before: Refit, workers: int, most: int) -> list[Candidate]:
    """Fit the effects that the first look does not exclude.

    Args:
        refits: to the recordings to learn from.
        screen: first look at the residual of ``before``.
        before: fit without the effect.
        workers: threads.
        most: of them that are fitted to the end.

    Returns:
        Candidates with derivatives of their own, the lowest cost first.
    """
    screenings = screen.screenings
    largest = max((screening.gain for screening in screenings.values()), default=0.0)
    ranked = sorted(screenings, key=lambda name: -screenings[name].gain)
    promising = [name for name in ranked if screenings[name].gain > max(MIN_GAIN_SHARE * largest, 1.0)][:MAX_FITTED]
    promising += [name for name in ABSORBED_BY_NOMINAL if name in screenings and name not in promising]
    jobs = [start for name in promising for start in screen.starts(name)]
    alone = replace(setup, workers=1)  # one thread a candidate

    def first(start: EffectSettings) -> Refit:
        return first_fit(with_free_effect(alone, start.name), before, start, screen.nominal_columns)

    with ThreadPoolExecutor(max_workers=workers) as pool:
        done = list(pool.map(first, jobs))
    best: dict[str, Refit] = {}
    for start, found in zip(jobs, done, strict=True):
        if found.cost < before.cost and (start.name not in best or found.cost < best[start.name].cost):
            best[start.name] = found
    ranked = sorted(best, key=lambda name: best[name].cost)
    names = ranked[:most] + [name for name in ranked[most:] if name in ABSORBED_BY_NOMINAL]

    def last(name: str) -> Candidate:
        free = with_free_effect(alone, name)
        return Candidate(name, free, finish_fit(free, best[name]), screenings[name].trials)

    with ThreadPoolExecutor(max_workers=workers) as pool:
        return sorted(pool.map(last, names), key=lambda item: item.refit.cost)
