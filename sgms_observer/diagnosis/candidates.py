"""Candidates: hypotheses that pass the screening, each fitted together with the effects that the model already has.

A hypothesis is an effect of the catalogue, an effect of the file with changed values, or changed values of the file
itself (friction, elements, contact law).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.fit import REFERENCE_PARAMETERS, Refit, RefitSetup, reference_parameters
from sgms_observer.diagnosis.model import STRIBECK_VELOCITY
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.diagnosis.sliding_force import PARTS_OF_SLIDING_FORCE, start_logs
from sgms_observer.effects.catalogue import effect, is_contact_law
from sgms_observer.settings.axis import EffectSettings

FIRST_EVALUATIONS = 8
"""Evaluated models of a first fit, which uses the derivatives of the screening."""
MAX_FITTED = 9
"""Largest number of effects with a first fit in one round."""
MAX_COMPARED = 5
"""Largest number of effects with a final fit in one round."""
MIN_REDUCTION_SHARE = 0.1
"""Smallest chi2_reduction in the screening, as a share of the largest one, for which an effect is fitted."""
ABSORBED_BY_NOMINAL = ("mass_error", "actuator_gain", "actuator_dead_zone")
"""Effects that the parameters of the file absorb up to their tolerance, so that the screening cannot exclude them: the
first looks like another mass, the second like another mass and friction, the third like another Coulomb force."""
WEAK_START_SHARE = 0.1
"""Share of the strength for a second start, if the fit from the full strength does not reduce the cost."""
FIXED_SHAPES = {"cogging": (3, 4), **REFERENCE_PARAMETERS}
"""Parameters that are fixed in a first fit: (effect, indices)."""
MIN_SECOND_HARMONIC_REDUCTION = 15.0
"""Smallest decrease of the cost for which a second harmonic is kept: five standard errors."""


@dataclass(frozen=True)
class Candidate:
    """One fitted hypothesis.

    Attributes:
        name: the effect, or one of ``CHANGE_HYPOTHESES``.
        setup: setup of the fit.
        refit: fit with the nominal parameters, the effects so far and this one.
        trials: number of shapes that the screening tried.
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
    def is_contact_law(self) -> bool:
        """Return whether it is an effect that only describes another contact law."""
        return self.settings is not None and is_contact_law(self.name)

    @property
    def parameter_count(self) -> int:
        """Return the number of fitted parameters."""
        return len(self.refit.logs) + len(self.refit.free) if self.settings is None else len(self.refit.free)


def with_effect(effects: Sequence[EffectSettings], start: EffectSettings) -> tuple[EffectSettings, ...]:
    """Return the effects with one more, or with new values if it is one of them."""
    if any(item.name == start.name for item in effects):
        return tuple(start if item.name == start.name else item for item in effects)
    return (*effects, start)


def with_free_effect(setup: RefitSetup, name: str) -> RefitSetup:
    """Return the setup in which an effect of the file is free."""
    return replace(setup, held_effects=setup.held_effects - {name})


def first_fit(setup: RefitSetup, before: Refit, start: EffectSettings, columns: Floats) -> Refit:
    """Return a first fit of one effect together with the effects of an earlier fit.

    Args:
        setup: setup of the fit, with the effect free.
        before: fit without the effect.
        start: the effect with its start values.
        columns: derivatives with respect to the nominal parameters.
    """
    nominal = setup.nominal
    effects = with_effect(before.effects, start)
    place = [item.name for item in effects].index(start.name)
    fixed = [(place, j) for j in FIXED_SHAPES.get(start.name, ())] + reference_parameters(before.effects)
    found = setup.fit(effects, start_logs(before.logs, nominal, start), fixed, columns, evaluations=FIRST_EVALUATIONS)
    if found.cost > before.cost:  # the start is too strong: start again from a weak effect
        weak = tuple(
            WEAK_START_SHARE * value if parameter.is_strength else value
            for parameter, value in zip(effect(start.name).parameters, start.values, strict=True)
        )
        again = setup.fit(
            with_effect(before.effects, replace(start, values=weak)),
            before.logs,
            fixed,
            columns,
            evaluations=FIRST_EVALUATIONS,
        )
        found = again if again.cost < found.cost else found
    if start.name in PARTS_OF_SLIDING_FORCE:  # the elements may have absorbed it: start from those of the file
        file_logs = before.logs.copy()
        file_logs[STRIBECK_VELOCITY + 1 :] = 0.0
        again = setup.fit(effects, start_logs(file_logs, nominal, start), fixed)
        found = again if again.cost < found.cost else found
    if start.name == "cogging":
        found = _with_second_harmonic(setup, found, place, columns)
    return found


def finish_fit(setup: RefitSetup, found: Refit) -> Refit:
    """Return the fit continued to convergence, with its own derivatives, which evidence and intervals need."""
    return setup.fit(found.effects, found.logs)


def _with_second_harmonic(setup: RefitSetup, found: Refit, place: int, columns: Floats) -> Refit:
    """Return the fit of cogging, with the second harmonic if that reduces the cost enough."""
    for phase in (0.0, 2.1, -2.1):
        last = found.effects[place]
        start = replace(last, values=(*last.values[:3], 0.1 * abs(last.values[0]), phase))
        effects = with_effect(found.effects, start)
        other = setup.fit(effects, found.logs, reference_parameters(effects), columns, evaluations=FIRST_EVALUATIONS)
        if other.cost < found.cost - MIN_SECOND_HARMONIC_REDUCTION:
            return other
    return found


def fitted_candidates(
    setup: RefitSetup, screen: Screen, before: Refit, workers: int, others: Sequence[Callable[[], Candidate]]
) -> list[Candidate]:
    """Fit the effects that pass the screening, and other hypotheses beside them.

    Effects of the file within the tolerance are always fitted: another value of one of them explains most simply.

    Args:
        setup: setup of the fits, each of them in one thread.
        screen: screening of the residual of ``before``.
        before: fit without the hypotheses.
        workers: number of threads.
        others: functions that fit one other hypothesis each.

    Returns:
        Candidates with their own derivatives: effects, the lowest cost first, then the others.
    """
    screenings = screen.screenings
    largest = max((screening.chi2_reduction for screening in screenings.values()), default=0.0)
    ranked = sorted(screenings, key=lambda name: -screenings[name].chi2_reduction)
    promising = [name for name in ranked if screenings[name].chi2_reduction > max(MIN_REDUCTION_SHARE * largest, 1.0)][
        :MAX_FITTED
    ]
    always = (*ABSORBED_BY_NOMINAL, *sorted(setup.held_effects))
    promising += [name for name in always if name in screenings and name not in promising]
    jobs = [start for name in promising for start in screen.starts(name, has_trial=name in ABSORBED_BY_NOMINAL)]

    def first(start: EffectSettings) -> Refit:
        return first_fit(with_free_effect(setup, start.name), before, start, screen.nominal_columns)

    def last(name: str) -> Candidate:
        free = with_free_effect(setup, name)
        return Candidate(name, free, finish_fit(free, best[name]), screenings[name].trials)

    with ThreadPoolExecutor(max_workers=workers) as pool:
        first_fits = [pool.submit(first, start) for start in jobs]
        other_fits = [pool.submit(fit) for fit in others]
        best: dict[str, Refit] = {}
        for start, job in zip(jobs, first_fits, strict=True):
            found = job.result()
            if found.cost < before.cost and (start.name not in best or found.cost < best[start.name].cost):
                best[start.name] = found
        ranked = sorted(best, key=lambda name: best[name].cost)
        names = ranked[:MAX_COMPARED] + [name for name in ranked[MAX_COMPARED:] if name in always]
        effects = sorted(pool.map(last, names), key=lambda item: item.refit.cost)
        return [*effects, *(job.result() for job in other_fits)]
