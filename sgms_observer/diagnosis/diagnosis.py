"""What a diagnosis works on and what it has decided: recordings, the fit, the passes, the whole."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.coordinates import is_contact_law_effect
from sgms_observer.diagnosis.criteria import Criteria, Test
from sgms_observer.diagnosis.decision import Decision, strength_of
from sgms_observer.diagnosis.effort_lag import fitted_effort_lag
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.fit import Refit, RefitSetup, data_with_noise_of, data_with_own_noise
from sgms_observer.diagnosis.gap import noise_floors, residuals, rms, weighted
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.diagnosis.screen import Screening
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

FIT_STEPS = 6
"""Steps of a fit from a point that was not fitted to these recordings,"""
REFIT_STEPS = 4
"""and of one after the noise was fitted anew."""


@dataclass(frozen=True)
class Options:
    """How to run.

    Attributes:
        tolerance: largest relative error of the file's values that its owner expects.
        seed: of all chance.
        workers: threads.
        band: residuals are judged below this frequency [Hz]; 0 chooses it from rate and encoder.
        criteria: thresholds of every test.
        excluded: hypotheses that are not tried.
    """

    tolerance: float = 0.05
    seed: int = 1
    workers: int = 2
    band: float = 0.0
    criteria: Criteria = field(default_factory=Criteria)
    excluded: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Recordings:
    """Recordings as they are read now.

    Attributes:
        records: to learn from.
        holdouts: to judge on; may be empty.
        stated_lag: how late the settings say the effort arrives, in samples.
        lag: how late it is taken to arrive, in samples.
        band: residuals are judged below this frequency [Hz].
    """

    records: tuple[Recording, ...]
    holdouts: tuple[Recording, ...]
    stated_lag: float
    lag: float
    band: float

    def motions(self) -> tuple[Motion, ...]:
        """Return the recordings to learn from, filtered."""
        return tuple(motion_of(record, self.lag, self.band) for record in self.records)

    def held_out(self) -> tuple[Motion, ...]:
        """Return the recordings to judge on, filtered."""
        return tuple(motion_of(record, self.lag, self.band) for record in self.holdouts)


@dataclass(frozen=True)
class FitState:
    """Estimate of an axis and its recordings.

    Attributes:
        recordings: as they are read now.
        learn: recordings to learn from, filtered.
        held: held-out recordings, filtered.
        refits: how the model is fitted: noise, freedom, effects of the file that keep their values.
        current: the fit.
    """

    recordings: Recordings
    fit_motions: tuple[Motion, ...]
    held_out_motions: tuple[Motion, ...]
    setup: RefitSetup
    current: Refit

    def refitted(self, start: Refit, steps: int) -> FitState:
        """Return the state fitted on from ``start``, with the noise that this one leaves."""
        setup = replace(self.setup, data=data_with_own_noise(self.fit_motions, start.model))
        return replace(self, setup=setup, current=setup.fit(start.effects, start.logs, steps))

    def timed(self) -> FitState:
        """Return the state with the effort at the time that the recordings show."""
        state = self
        for _ in range(2):
            lag = fitted_effort_lag(state.setup.data, state.current, state.recordings.lag, state.recordings.stated_lag)
            if lag == state.recordings.lag:
                break
            recordings = replace(state.recordings, lag=lag)
            state = replace(
                state, recordings=recordings, fit_motions=recordings.motions(), held_out_motions=recordings.held_out()
            )
            state = state.refitted(state.current, REFIT_STEPS)
        return state

    def evaluation(self, options: Options, first: Model | None = None) -> EvaluationData:
        """Return the recordings that evidence is taken from.

        Args:
            options: how to run.
            first: model of the file refitted within its tolerance; the current one if None.
        """
        data = self.setup.data
        judge = self.held_out_motions or self.fit_motions
        held = data_with_noise_of(self.held_out_motions, data, self.current.model)
        own = held if self.held_out_motions else data
        weightings = own.weights, own.gap_weights
        floor, reported_floor = noise_floors(judge, self.current.model, data.noise, options.seed, *weightings)
        left = residuals(first or self.current.model, judge)
        gap, reported_first_gap = (rms(weighted(left, weights)) for weights in weightings)
        return EvaluationData(
            self.fit_motions,
            judge,
            data,
            held,
            floor,
            gap,
            reported_floor,
            reported_first_gap,
            options.criteria,
            options.seed,
        )


@dataclass(frozen=True)
class Round:
    """One pass through the loop.

    Attributes:
        looks: first look at every effect.
        decisions: hypotheses that were fitted to the end, the best predicting first.
        accepted: the one that was added, or None.
        alternatives: names that the data do not tell from it.
    """

    screenings: dict[str, Screening]
    decisions: tuple[Decision, ...]
    accepted: Decision | None
    alternatives: tuple[str, ...]

    def tested(self, test: Test) -> Round:
        """Return the pass with a further test of what it added, which goes if it fails."""
        assert self.accepted is not None
        decision = replace(self.accepted, tests=(*self.accepted.tests, test))
        listed = tuple(decision if one.candidate is decision.candidate else one for one in self.decisions)
        return replace(self, accepted=decision if test.passed else None, decisions=listed)


@dataclass(frozen=True)
class WrittenFits:
    """The model with the owner's own elements, as it is written and reported.

    Attributes:
        before: refitted within its tolerance.
        after: with everything that was accepted.
        refits: how the latter was fitted.
        errors: standard error of each of its free effect parameters, by effect and number.
    """

    before: Refit
    after: Refit
    setup: RefitSetup
    errors: Mapping[tuple[int, int], float]

    def strength(self, name: str) -> float:
        """Return how far an effect is from none, over its standard error."""
        place = [item.name for item in self.after.effects].index(name)
        return strength_of(self.after.effects[place], {j: e for (i, j), e in self.errors.items() if i == place})


@dataclass(frozen=True)
class Diagnosis:
    """Everything the run decided.

    Attributes:
        nominal: the given model without its effects.
        own: the effects it was given with.
        found: state after the refit within the tolerance.
        state: state with everything that was accepted.
        written: the fits with its own elements, without and with what was accepted.
        rounds: passes through the loop.
        court: recordings that evidence was taken from, with the noise that is left in the end.
        resolution: coarser encoder step than the settings say [its unit], or None.
        notes: sentences about the recordings.
        warnings: what must not be overlooked.
        is_poor: whether the recordings cannot show anything.
        tests: tests of the whole model.
        explains_all: whether what was accepted leaves no share of the gap that would count as predictable.
    """

    nominal: Model
    file_effects: tuple[EffectSettings, ...]
    file_state: FitState
    final_state: FitState
    written: WrittenFits
    rounds: tuple[Round, ...]
    evaluation: EvaluationData
    resolution: float | None
    notes: tuple[str, ...] = field(default=())
    warnings: tuple[str, ...] = field(default=())
    is_poor: bool = False
    tests: tuple[Test, ...] = field(default=())
    is_gap_explained: bool = True

    @property
    def accepted(self) -> list[Round]:
        """Return the rounds that added an effect that is named.

        One that describes nothing but another contact law is a name only where all is explained with it; else it is a
        changed value of the file.
        """
        added = [(item, item.accepted.candidate) for item in self.rounds if item.accepted]
        return [
            item for item, one in added if one.settings is not None and one.name not in self.unnamed_contact_effects
        ]

    @property
    def changes(self) -> frozenset[str]:
        """Return the hypotheses on values of the file that were added."""
        added = [item.accepted.candidate for item in self.rounds if item.accepted]
        return frozenset(one.name for one in added if one.settings is None)

    @property
    def unnamed_contact_effects(self) -> frozenset[str]:
        """Return the effects that were added and are not named."""
        added = {item.accepted.candidate.name for item in self.rounds if item.accepted}
        return frozenset(name for name in added if is_contact_law_effect(name) and not self.is_gap_explained)
