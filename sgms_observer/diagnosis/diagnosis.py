"""Options, recordings, fits and rounds of a diagnosis, and the diagnosis itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.candidates import Candidate
from sgms_observer.diagnosis.criteria import Criteria, Test
from sgms_observer.diagnosis.decision import Decision
from sgms_observer.diagnosis.effort_lag import changes_of_lag, fitted_effort_lags, with_real_changes
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.fit import Freedom, Refit, RefitSetup
from sgms_observer.diagnosis.gap import WeightedResidual, noise_floor, residuals, rms, weighted_rms
from sgms_observer.diagnosis.model import HALF_A_REVERSAL, Model
from sgms_observer.diagnosis.motion import EffortLag, Motion, motion_of
from sgms_observer.diagnosis.screen import Screening
from sgms_observer.diagnosis.uncertainty import RecordingEstimates
from sgms_observer.diagnosis.whitened import WhitenedData, data_with_noise_of, data_with_own_noise
from sgms_observer.effects.catalogue import effect
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings

MAX_REFITS, MIN_DECREASE = 8, 0.01
"""Largest number of fits with a new noise each, and the decrease of the rms residual below which they end."""


@dataclass(frozen=True)
class Options:
    """Options of a diagnosis.

    Attributes:
        tolerance: largest expected relative error of the file's values.
        seed: seed of all random numbers.
        workers: number of threads.
        band: residuals are judged below this frequency [Hz]; 0 chooses it from rate and encoder.
        criteria: thresholds of every test.
        excluded: hypotheses that are not tested.
    """

    tolerance: float = 0.05
    seed: int = 1
    workers: int = 2
    band: float = 0.0
    criteria: Criteria = field(default_factory=Criteria)
    excluded: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Recordings:
    """Recordings and the lag of their effort.

    Attributes:
        records: recordings to learn from.
        holdouts: held-out recordings; may be empty.
        stated_lag: lag of the effort that follows from the settings, in samples.
        band: residuals are judged below this frequency [Hz].
    """

    records: tuple[Recording, ...]
    holdouts: tuple[Recording, ...]
    stated_lag: float
    band: float

    def motions(self, lags: Sequence[EffortLag] | None = None) -> tuple[Motion, ...]:
        """Return the recordings to learn from, filtered.

        Args:
            lags: lag of the effort of each recording; the stated lag if None.
        """
        return self._filtered(self.records, lags)

    def held_out(self, lags: Sequence[EffortLag] | None = None) -> tuple[Motion, ...]:
        """Return the held-out recordings, filtered; argument as above."""
        return self._filtered(self.holdouts, lags)

    @property
    def references(self) -> tuple[Floats | None, ...]:
        """Return the set-points of each held-out recording [m], of the others without any; None where none is known."""
        return tuple(record.whole_reference for record in self.holdouts or self.records)

    def _filtered(self, records: Sequence[Recording], lags: Sequence[EffortLag] | None) -> tuple[Motion, ...]:
        """Return recordings with these lags of their effort, filtered."""
        used = [EffortLag((self.stated_lag,))] * len(records) if lags is None else lags
        return tuple(motion_of(record, lag, self.band) for record, lag in zip(records, used, strict=True))


@dataclass(frozen=True)
class FitState:
    """Fit of an axis and its recordings.

    Attributes:
        recordings: the recordings and the lag of their effort.
        fit_motions: recordings to learn from, filtered.
        held_out_motions: held-out recordings, filtered.
        setup: setup of the fit: noise, freedom, fixed effects.
        current: the fit.
        least: smallest rms residual that a fitted hypothesis left on the evaluated recordings, with the weights of the
            gap [N].
        hidden_by_encoder: friction of the file that reverses within one encoder step, over the static force.
    """

    recordings: Recordings
    fit_motions: tuple[Motion, ...]
    held_out_motions: tuple[Motion, ...]
    setup: RefitSetup
    current: Refit
    least: float = np.inf
    hidden_by_encoder: float = 0.0

    def refitted(self, start: Refit) -> FitState:
        """Return the state refitted from ``start``, with the noise of the residual of ``start``."""
        setup = replace(self.setup, data=data_with_own_noise(self.fit_motions, start.model))
        return replace(self, setup=setup, current=setup.fit(start.effects, start.logs))

    def with_freedom(self, freedom: Freedom) -> FitState:
        """Return the state refitted with another freedom of the file's values, until nothing changes any more."""
        state = replace(self, setup=replace(self.setup, freedom=freedom))
        return state.refitted(state.current).converged()

    def without(self, name: str) -> FitState:
        """Return the state fitted without an effect; one of the file has the file's values again."""
        setup, effects = self.setup.without(name, self.current.effects)
        return replace(self, setup=setup, current=setup.fit(effects, self.current.logs))

    def converged(self) -> FitState:
        """Return the state refitted until neither its noise nor its residual changes any more.

        The noise is fitted to the residual of the model before. From a file with wrong values it is too large at first.
        """
        state = self
        for _ in range(MAX_REFITS):
            before = state._rms
            state = state.refitted(state.current)
            if state._rms > (1.0 - MIN_DECREASE) * before:
                break
        return state

    @property
    def _rms(self) -> float:
        """Rms residual of the recordings to learn from, with the weights of the gap [N]."""
        return self._rest(self.setup.data).rms

    def with_fitted_lags(self) -> FitState:
        """Return the state with the lag of the effort that fits each recording, held-out ones included.

        A lag is judged against the noise, and the noise contains what a wrong lag leaves: both are fitted in turn. A
        delay of the model is a lag of all recordings: beside one they stay as they are.
        """
        if any(item.name == "actuator_delay" for item in self.current.effects):
            return self
        state = self
        for _ in range(MAX_REFITS):
            lags = fitted_effort_lags(state.setup.data, state.current, state.recordings.stated_lag)
            if lags == state.lags:
                break
            state = state._with_lags(lags).converged()
        real = with_real_changes(state.lags)
        if real != state.lags:
            state = state._with_lags(real)
        return state._with_held_out_lags(with_real_changes(state._fitted_held_out_lags()))

    @property
    def lags(self) -> tuple[EffortLag, ...]:
        """Return the lag of the effort of each recording to learn from."""
        return tuple(motion.lag for motion in self.fit_motions)

    def _with_lags(self, lags: Sequence[EffortLag]) -> FitState:
        """Return the state refitted with these lags of the recordings to learn from."""
        return replace(self, fit_motions=self.recordings.motions(lags)).refitted(self.current)

    def _with_held_out_lags(self, lags: Sequence[EffortLag]) -> FitState:
        """Return the state with these lags of the held-out recordings."""
        return replace(self, held_out_motions=self.recordings.held_out(lags))

    def _held_out_data(self) -> WhitenedData:
        """Return the held-out recordings with the noise of those to learn from."""
        return data_with_noise_of(self.held_out_motions, self.setup.data, self.current.model)

    def _fitted_held_out_lags(self) -> tuple[EffortLag, ...]:
        """Return the lag of the effort that fits each held-out recording."""
        if not self.held_out_motions:
            return ()
        data = self._held_out_data()
        found = replace(self.setup, data=data).fit(self.current.effects, self.current.logs, evaluations=1)
        return fitted_effort_lags(data, found, self.recordings.stated_lag)

    def with_changes_of_lag(self, criteria: Criteria) -> FitState:
        """Return the state with fitted lags of the effort, which change in a recording where that surely fits.

        A wrong lag moves the parameters, and moved parameters move the changes of the lag: both are fitted in turn.

        Args:
            criteria: thresholds.
        """
        state, before = self, None
        for _ in range(MAX_REFITS):
            changes = state._changes_of_lag(criteria)
            if changes == before:
                break
            state, before = state._with_changes(changes).with_fitted_lags(), changes
        return state

    def _changes_of_lag(self, criteria: Criteria) -> tuple[tuple[float, ...], ...]:
        """Return the times at which the lag of the effort changes in each recording, held-out ones last [s]."""
        return tuple(
            changes_of_lag(rest, place, self.recordings.stated_lag, criteria)
            for rest in (self._rest(self.setup.data), self._rest(self._held_out_data()))
            for place in range(len(rest.motions))
        )

    def _with_changes(self, changes: Sequence[tuple[float, ...]]) -> FitState:
        """Return the state refitted with a lag that may change at these times in each recording [s]."""
        motions = (*self.fit_motions, *self.held_out_motions)
        lags = [motion.lag.divided(one) for motion, one in zip(motions, changes, strict=True)]
        learnt = len(self.fit_motions)
        return self._with_lags(lags[:learnt])._with_held_out_lags(lags[learnt:])

    def _rest(self, data: WhitenedData) -> WeightedResidual:
        """Return what the fit leaves of recordings."""
        return WeightedResidual(data.motions, residuals(self.current.model, data.motions), data.weights)

    def with_least_of(self, decisions: Sequence[Decision], evaluation: EvaluationData) -> FitState:
        """Return the state with the smallest residual of hypotheses as a bound of the noise.

        Args:
            decisions: on the hypotheses.
            evaluation: the recordings of their evidence.
        """
        left = [rms(item.evidence.force) / rms(evaluation.weights) for item in decisions]
        return replace(self, least=min([self.least, *left]))

    def evaluation(self, options: Options) -> EvaluationData:
        """Return the evaluation data.

        The noise is fitted to the residual, so it contains what the model misses. What any fitted hypothesis leaves on
        the evaluated recordings bounds it.

        Args:
            options: options of the diagnosis.
        """
        data = self.setup.data
        motions = self.held_out_motions or self.fit_motions
        held_out_data = self._held_out_data()
        data_of_motions = held_out_data if self.held_out_motions else data
        weights = data_of_motions.weights
        floor = noise_floor(motions, self.current.model, data.noise, options.seed, weights)
        gap = weighted_rms(residuals(self.current.model, motions), weights)
        found = EvaluationData(
            self.fit_motions, motions, data, held_out_data, floor, gap, options.criteria, options.seed,
            self.hidden_by_encoder, self.recordings.references,
        )  # fmt: skip
        return self.bounded(found)

    def bounded(self, evaluation: EvaluationData) -> EvaluationData:
        """Return evaluation data whose noise is at most what the hypotheses so far leave."""
        return replace(evaluation, floor=min(evaluation.floor, self.least))


@dataclass(frozen=True)
class Round:
    """One round of the search.

    Attributes:
        screenings: screening of each effect.
        decisions: decisions on the hypotheses with a final fit, the best predicting first.
        accepted: the accepted decision, or None.
        comparisons: test that it predicts better than each rival, by the rival's name.
        worse: rivals that predicted significantly worse when it got the place.
    """

    screenings: dict[str, Screening]
    decisions: tuple[Decision, ...]
    accepted: Decision | None
    comparisons: Mapping[str, Test]
    worse: frozenset[str] = frozenset()

    @property
    def alternatives(self) -> tuple[str, ...]:
        """Return the effects that the data do not distinguish from the accepted one."""
        return tuple(name for name, test in self.comparisons.items() if not test.passed)

    @property
    def tests(self) -> tuple[Test, ...]:
        """Return every test of the round, the comparisons of what was added behind its own tests."""
        return tuple(test for item in self.decisions for test in self.tests_of(item))

    def tests_of(self, item: Decision) -> tuple[Test, ...]:
        """Return every test of a decision of the round."""
        is_added = self.accepted is not None and item.candidate is self.accepted.candidate
        return (*item.tests, *(self.comparisons.values() if is_added else ()))

    def with_test(self, test: Test) -> Round:
        """Return the round with one more test of the accepted hypothesis, which is rejected if the test fails."""
        assert self.accepted is not None
        decision = self.accepted.with_test(test)
        listed = tuple(decision if one.candidate is decision.candidate else one for one in self.decisions)
        return replace(self, accepted=decision if test.passed else None, decisions=listed)


def accepted_candidates(rounds: Sequence[Round]) -> list[Candidate]:
    """Return what these rounds added."""
    return [item.accepted.candidate for item in rounds if item.accepted]


@dataclass(frozen=True)
class WrittenFits:
    """Fits with the elements of the file, as they are written and reported.

    Attributes:
        before: fit of the file within its tolerance.
        after: fit with everything that was accepted.
        setup: setup of ``after``.
        estimates: of the free effect parameters of ``after``.
        strengths: of those among them that are strengths, where all effects keep the shapes of ``after``.
        with_common_values: as ``estimates``, where all recordings have the values of the file of ``after``.
        shares_above_noise: share of the squared gap above the noise that each effect closes beside the others.
    """

    before: Refit
    after: Refit
    setup: RefitSetup
    estimates: RecordingEstimates
    strengths: RecordingEstimates
    with_common_values: RecordingEstimates
    shares_above_noise: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def errors(self) -> Mapping[tuple[int, int], float]:
        """Return the standard error of each free effect parameter, with the scatter between recordings, SI units."""
        return dict(zip(self.estimates.free, self.estimates.std_errors.tolist(), strict=True))

    def without(self, names: Iterable[str]) -> tuple[RefitSetup, Refit]:
        """Return setup and fit without some effects, which compare with ``after``.

        Effects of the file have the file's values again.
        """
        setup, effects = self.setup.without_all(names, self.after.effects)
        return setup, setup.fit(effects, self.after.logs)

    def strength_elsewhere(self, name: str, least: float) -> float:
        """Return the strength of an effect over its standard error, in held-out recordings too.

        Args:
            name: the effect.
            least: smallest strength over its standard error at which a recording would surely show the effect.

        Returns:
            Infinite if the effect has no free strength parameter.
        """
        found = self.strengths.linear(self.after.effects)
        return self._largest(name, found, lambda column, null: found.smaller_z_score(column, null, least))

    def strength_over_scatter(self, name: str, has_fixed_shape: bool) -> float:
        """Return the mean strength of an effect over its deviation; infinite without a free strength.

        The deviation has the standard error of the mean and the scatter between recordings.

        Args:
            name: the effect.
            has_fixed_shape: whether the effect has the shape of ``after`` in every recording, or a shape of its own.
        """
        found = (self.strengths if has_fixed_shape else self.estimates).linear(self.after.effects)
        return self._largest(name, found, found.strength_over_scatter)

    def strength_over_error(self, name: str, z_score: float) -> float:
        """Return the strength of an effect over its standard error, with any significant scatter between recordings.

        A machine has one value of each friction parameter. Recordings with values of their own would differ in these
        too, and an effect that resembles them would seem to differ.

        Args:
            name: the effect.
            z_score: above which a difference of two recordings is significant.

        Returns:
            Infinite if the effect has no free strength parameter.
        """
        found = self.with_common_values.linear(self.after.effects)
        errors = found.errors_with_significant_scatter(z_score)
        return self._largest(name, found, lambda column, null: found.size_over(column, null, float(errors[column])))

    def error_of_value(self, place: int, z_score: float) -> float:
        """Return the standard error of the first value of an effect, with any significant scatter between recordings.

        Args:
            place: of the effect in ``after``.
            z_score: above which a difference of two recordings is significant.

        Returns:
            Zero if the value is not free.
        """
        found = self.with_common_values
        errors = found.errors_with_significant_scatter(z_score)
        return next((float(errors[column]) for column, at in enumerate(found.free) if at == (place, 0)), 0.0)

    def _largest(self, name: str, found: RecordingEstimates, value: Callable[[int, float], float]) -> float:
        """Return the largest ``value`` of the strength parameters of an effect, from their columns and null values."""
        place = [item.name for item in self.after.effects].index(name)
        parameters, null = effect(name).parameters, self.setup.null_values(name)
        return max(
            (
                value(column, parameters[j].linear(null[j]))
                for column, (i, j) in enumerate(found.free)
                if i == place and parameters[j].is_strength
            ),
            default=math.inf,
        )


@dataclass(frozen=True)
class Diagnosis:
    """Result of a diagnosis.

    Attributes:
        nominal: the given model without its effects.
        file_effects: effects of the file.
        file_state: state after the refit within the tolerance.
        final_state: state with everything that was accepted.
        written: the fits with the elements of the file, without and with everything that was accepted.
        rounds: rounds of the search.
        evaluation: evaluation data with the noise of the final model.
        resolution: measured encoder step if it is coarser than the configured one [its unit], or None.
        notes: sentences about the recordings.
        warnings: sentences for the user.
        is_poor: whether the excitation is too poor for any result.
        tests: tests of the whole model.
        refused_contact_effects: failed test of contact law effects, which then have no name; None if they may have.
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
    refused_contact_effects: Test | None = None

    @property
    def is_contact_hidden(self) -> bool:
        """Return whether the encoder does not show how the contact reverses."""
        return self.file_state.hidden_by_encoder > HALF_A_REVERSAL

    @property
    def accepted(self) -> list[Round]:
        """Return the rounds that added a named effect.

        An effect that only describes another contact law is named if it closes more of the gap than it leaves, if
        little of the rest is predictable, and if nothing else describes a part of that law. Otherwise it counts as a
        changed value of the file.
        """
        added = [(item, item.accepted.candidate) for item in self.rounds if item.accepted]
        return [
            item for item, one in added if one.settings is not None and one.name not in self.unnamed_contact_effects
        ]

    @property
    def changes(self) -> frozenset[str]:
        """Return the accepted hypotheses that values of the file changed."""
        return frozenset(one.name for one in accepted_candidates(self.rounds) if one.settings is None)

    @property
    def unnamed_contact_effects(self) -> frozenset[str]:
        """Return the contact law effects that were accepted and are not named.

        Beside another one of them, they describe a part of the same contact law.
        """
        found = [one.name for one in accepted_candidates(self.rounds) if one.is_contact_law]
        return frozenset(found[1:] if self.refused_contact_effects is None else found)
