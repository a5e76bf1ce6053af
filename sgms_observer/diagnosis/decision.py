"""Decisions: the tests that a hypothesis has to pass, each with its value and threshold."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.candidates import MAX_COMPARED, Candidate, finish_fit, with_effect, with_free_effect
from sgms_observer.diagnosis.changed_contact import CHANGED_CONTACT_LAW, can_be_freed, changed_candidate
from sgms_observer.diagnosis.coordinates import free_form_coordinates, is_confusable_with_contact
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least, at_most
from sgms_observer.diagnosis.effort_lag import MAX_STAMP_ERROR
from sgms_observer.diagnosis.evaluation import EvaluationData, Evidence, evidence_of
from sgms_observer.diagnosis.evidence import Improvement, improvement, preference
from sgms_observer.diagnosis.fit import Refit, RefitSetup, limits
from sgms_observer.diagnosis.free_form import ALL, FreeForm, free_form
from sgms_observer.diagnosis.gap import WeightedResidual, residuals
from sgms_observer.diagnosis.instruments import delay_in_response, is_shown, or_in_response
from sgms_observer.diagnosis.map_fit import effect_and_map, maps_over
from sgms_observer.diagnosis.model import HALF_A_REVERSAL, STRIBECK_VELOCITY, VISCOUS, Model
from sgms_observer.diagnosis.motion import HELD_LAG, lowest_rate
from sgms_observer.diagnosis.noise import largest_noise
from sgms_observer.diagnosis.ranges import plausible_range
from sgms_observer.diagnosis.sliding import improvement_in_fast_sliding, in_fast_sliding, sliding_shares
from sgms_observer.diagnosis.whitened import data_with_noise_of, data_with_own_noise
from sgms_observer.effects.catalogue import effect, is_inertial
from sgms_observer.effects.effect import Place
from sgms_observer.settings.axis import EffectSettings

MAX_LAG_WITHOUT_DELAY = HELD_LAG + MAX_STAMP_ERROR
"""Largest lag of the effort without a delay, in samples: the effort is held, and its stamps are inexact."""
HELD_OUT_GAP = "held-out gap: z-score"
"""Test that the gap of held-out recordings shrinks."""
GAP_WHILE_OTHERS_ARE_MISSING = "held-out gap while other effects are missing: z-score"
"""Test that it does not grow significantly."""
CLOSED_SHARE = "share of the closable squared gap"
"""Test that a hypothesis closes enough of the gap."""
FORM = "share that is surely predicted better by a free-form term"
"""Beginning of the title of the test that the shape of an effect is right."""
SIZE_BEYOND_TOLERANCE = "size beyond the tolerance of the file over its standard error"
"""Test that an effect on values of the file makes them differ by more than their tolerance."""
RANGE_END_TOLERANCE = 1.0e-6
"""Largest relative distance at which a parameter counts as at the end of its range."""


@dataclass(frozen=True)
class Decision:
    """One hypothesis with its tests.

    Attributes:
        candidate: the hypothesis.
        evidence: evidence of its fit.
        improvement: improvement over the model without it, whitened, on all data that was not fitted to.
        gap: the same of the weighted residual on the evaluated recordings [N^2].
        tests: every test. The first one tests whether the prediction is significantly better.
    """

    candidate: Candidate
    evidence: Evidence
    improvement: Improvement
    gap: Improvement
    tests: tuple[Test, ...]

    @property
    def share(self) -> float:
        """Return the share of the closable squared gap that the hypothesis closes."""
        return next((test.value for test in self.tests if test.name.startswith("share of the closable")), 0.0)

    def significant_share(self, criteria: Criteria) -> float:
        """Return the share of the squared gap that the hypothesis predicts; 0 if not significant."""
        is_significant = self.tests[0].passed and self.gap.z_score >= criteria.min_z_score
        return self.gap.share if is_significant else 0.0

    @property
    def may_be_within_tolerance(self) -> bool:
        """Return whether the values of the file may not differ by more than their tolerance."""
        return any(test.name == SIZE_BEYOND_TOLERANCE and not test.passed for test in self.tests)

    def with_test(self, test: Test | None) -> Decision:
        """Return the decision with one more test, if any."""
        return self if test is None else replace(self, tests=(*self.tests, test))

    def while_others_are_missing(self) -> Decision:
        """Return the decision on an effect beside which others are missing.

        What they leave hides what it closes of the held-out gap. So this gap only must not grow by more than its 90 %
        interval. It is tested again beside the others, see ``without_insignificant_effects``.
        """
        failed = [test for test in self.tests if not test.passed]
        if self.candidate.settings is None or [test.name for test in failed] != [HELD_OUT_GAP]:
            return self
        [gap] = failed
        weaker = at_least(gap.of, GAP_WHILE_OTHERS_ARE_MISSING, gap.value, -gap.threshold)
        return replace(self, tests=tuple(weaker if test is gap else test for test in self.tests))

    @property
    def passed(self) -> bool:
        """Return whether every test was passed."""
        return all(test.passed for test in self.tests)

    def is_possible_beside(self, best: Decision) -> bool:
        """Return whether no test contradicts the hypothesis as another explanation than an accepted one.

        A shape that is not right does not speak for an effect that predicts worse and was not asked for its shape over
        the same coordinates: what this shape leaves over them, that effect may leave too.

        Args:
            best: the accepted decision.
        """
        against = [test for test in self.tests if contradicts(test)]
        if not against or best.candidate.settings is None:
            return not against
        ours, theirs = (set(free_form_coordinates(item.candidate.name)) for item in (self, best))
        is_excused = self.improvement.decrease >= best.improvement.decrease and not ours <= theirs
        return is_excused and all(test.name.startswith(FORM) for test in against)


def contradicts(test: Test) -> bool:
    """Return whether a test contradicts its hypothesis.

    A failed test does, with two exceptions: that of the held-out gap where the gap does not grow by more than its 90 %
    interval, and that of the size of an effect that may lie within the tolerance of the file.
    """
    is_size = test.name == SIZE_BEYOND_TOLERANCE
    return not (test.passed or is_size or (test.name == HELD_OUT_GAP and test.value > -test.threshold))


def decide(
    item: Candidate, before: Refit, earlier: Evidence, evaluation: EvaluationData, is_rival: bool = False
) -> Decision:
    """Test one hypothesis against the model without it.

    Where an effect predicts significantly better and the gap does not show it, the effect is fitted again with the
    noise of what it leaves.

    Args:
        item: the hypothesis.
        before: fit without it.
        earlier: evidence of that fit.
        evaluation: the recordings.
        is_rival: whether it was compared with the effect that was added in its round.
    """
    first = _decided(item, before, earlier, evaluation, is_rival)
    failed = [test.name for test in first.tests if not test.passed]
    if item.settings is not None and failed and {*failed} <= {HELD_OUT_GAP, CLOSED_SHARE}:
        again = _decided_with_noise_it_leaves(item, before, earlier, evaluation, is_rival)
        if again is not None and again.passed:
            return again
    return first


def _decided_with_noise_it_leaves(
    item: Candidate, before: Refit, earlier: Evidence, evaluation: EvaluationData, is_rival: bool
) -> Decision | None:
    """Return the decision on an effect that is fitted again with the noise of what it leaves.

    The noise of the model without it contains what it explains. Where that is large and brief, such a noise hides from
    the fit what the values of the file have to be. The model without it may be fitted with the smaller noise too,
    and the one that predicts better counts: the values of the file alone must not close the gap.

    Args:
        item, before, earlier, evaluation, is_rival: as of ``decide``.

    Returns:
        None where the noise is not smaller.
    """
    data = data_with_own_noise(evaluation.fit_motions, item.refit.model)
    if evaluation.criteria.is_noise(largest_noise(evaluation.fit_data.noise).rms, largest_noise(data.noise).rms):
        return None

    def fitted(setup: RefitSetup, one: Refit) -> Refit:
        found = replace(setup, data=data).fit(one.effects, one.logs)
        return setup.fit(found.effects, found.logs, evaluations=1)  # whitened as all others are

    without, _ = item.setup.without(item.name, before.effects)
    again = fitted(without, before)
    if evaluation.rms(again.model) < evaluation.rms(before.model):
        before, earlier = again, evidence_of(again, evaluation)
    return _decided(replace(item, refit=fitted(item.setup, item.refit)), before, earlier, evaluation, is_rival)


def _decided(item: Candidate, before: Refit, earlier: Evidence, evaluation: EvaluationData, is_rival: bool) -> Decision:
    """Return the decision on a fit of one hypothesis; arguments as above."""
    criteria = evaluation.criteria
    later = evidence_of(item.refit, evaluation)
    gain = improvement(earlier.all, later.all)
    tests = [_prediction_test(item, gain, earlier, later, evaluation)]
    gap = improvement(earlier.force, later.force)
    if evaluation.has_held_out:
        tests.append(at_least(item.name, HELD_OUT_GAP, gap.z_score, criteria.interval_z_score))
    share = evaluation.closed_share(gap)
    tests.append(at_least(item.name, CLOSED_SHARE, share, criteria.min_closed_share))
    in_response = delay_in_response(item.refit.model, item.name, evaluation) if item.settings else None
    tests += range_tests(item, is_shown(in_response, criteria))
    if item.settings is None or needs_visible_contact(item.name):
        title = "friction that reverses within one encoder step, over the static force"
        tests.append(at_most(item.name, title, evaluation.hidden_by_encoder, HALF_A_REVERSAL))
    if item.settings is not None:
        found = strength(item)
        if found < criteria.min_z_score:
            found = max(found, strength_beyond_tolerance(item, before))
        tests += physical_tests(item, found, evaluation)
        if is_rival and not is_confusable_with_contact(item.name):
            tests.append(_test_while_sliding(item, before, earlier, later, evaluation))
        if not any(map(contradicts, tests)):  # the regression takes longer than all the other tests together
            free = [
                or_in_response(test, in_response, criteria) for test in free_form_tests(item, before, gap, evaluation)
            ]
            shown = [] if all(test.passed for test in free) else _shown_in_fast_sliding(item, before, evaluation)
            tests += shown or free
            tests += hidden_contact_tests(item, before, evaluation)
    candidate = replace(item, refit=item.refit.without_jacobian())
    return Decision(candidate, later, gain, gap, tuple(tests))


def _prediction_test(
    item: Candidate, gain: Improvement, earlier: Evidence, later: Evidence, evaluation: EvaluationData
) -> Test:
    """Return the test that the hypothesis predicts significantly better.

    The held-out recordings were not screened, so their threshold counts the compared candidates only. All recordings
    together were screened, so their threshold counts every tried shape. One of the two tests is enough, because a
    held-out recording may excite the effect less.
    """
    criteria = evaluation.criteria
    title = "z-score on data not fitted to"
    if evaluation.has_held_out:
        held_out = improvement(earlier.held_out, later.held_out)
        alone = at_least(
            item.name, f"{title}, held-out recordings", held_out.z_score, criteria.z_score_of(MAX_COMPARED)
        )
        if alone.passed:
            return alone
        title = "z-score over all recordings"
    return at_least(item.name, title, gain.z_score, criteria.z_score_of(item.trials))


def _test_while_sliding(
    item: Candidate, before: Refit, earlier: Evidence, later: Evidence, evaluation: EvaluationData
) -> Test:
    """Return the test that an effect adds to its rival where the two are compared: while the contact slides.

    What it adds elsewhere may be a part of the contact law: an offset and an asymmetry that cancel each other while the
    contact slides leave a force at rest and at breakaway.
    """
    shares = sliding_shares(before.model, evaluation)
    gain = improvement(earlier.weighted(shares).all, later.weighted(shares).all)
    title = "z-score beside its rival, while the contact slides"
    return at_least(item.name, title, gain.z_score, evaluation.criteria.min_z_score)


def needs_visible_contact(name: str) -> bool:
    """Return whether an effect looks like a contact whose reversals the encoder does not show.

    These are the effects that another contact law can imitate, and those on the way of the effort: they change the
    effort at rest and at breakaway, which is what the contact makes of it.

    Args:
        name: the effect.
    """
    return is_confusable_with_contact(name) or effect(name).place is Place.EFFORT_PATH


def range_tests(item: Candidate, is_shown_elsewhere: bool = False) -> list[Test]:
    """Return the test that no parameter of an effect is at the end of its range; arguments as of ``within_range``."""
    return [] if item.settings is None else [within_range(item.settings, item.refit, item.setup, is_shown_elsewhere)]


def within_range(settings: EffectSettings, fit: Refit, setup: RefitSetup, is_shown_elsewhere: bool) -> Test:
    """Return the test that no parameter of an effect is at the end of its physical or plausible range.

    An effect that another contact law can imitate shares its coordinates with the friction of the file. Where a freed
    friction value lies at the end of its range, the fit would take more of it in exchange for the effect, so these
    values count too, unless something that no contact makes shows the effect.

    Args:
        settings: the effect.
        fit: fit with the effect.
        setup: setup of this fit.
        is_shown_elsewhere: whether the response to the reference shows it, which no contact makes.
    """
    at_end = 0
    for parameter, value in zip(effect(settings.name).parameters, settings.values, strict=True):
        if parameter.may_end or parameter.unit == "rad" or value == parameter.default:
            continue
        limits_of_value = plausible_range(settings.name, parameter.name, setup.data.motions, setup.nominal)
        ends = [end for end in (parameter.minimum, parameter.maximum, *limits_of_value) if math.isfinite(end)]
        at_end += any(abs(value - end) <= RANGE_END_TOLERANCE * abs(end) for end in ends)
    if is_confusable_with_contact(settings.name) and not is_shown_elsewhere:
        freed = {k for k, name in enumerate(setup.nominal.parameter_names()) if name in setup.freedom.friction}
        at_end += len(values_at_end(fit, setup) & freed & {*range(VISCOUS, STRIBECK_VELOCITY + 1)})
    return at_most(settings.name, "parameters at the end of their range", at_end, 0.0)


def physical_tests(item: Candidate, ratio: float, evaluation: EvaluationData) -> list[Test]:
    """Return tests that the recordings can show the effect: strength, frequency, delay and limit.

    Args:
        item: the hypothesis.
        ratio: its strength over its standard error.
        evaluation: the recordings.
    """
    settings = item.settings
    assert settings is not None
    least = evaluation.criteria.min_z_score
    tests = [at_least(item.name, "strength over its standard error", ratio, least)]
    values = dict(zip((p.name for p in effect(settings.name).parameters), settings.values, strict=True))
    rate = lowest_rate(evaluation.fit_motions)
    if "frequency" in values:
        tests.append(
            at_most(
                item.name, "frequency over sample rate", values["frequency"] / rate, evaluation.criteria.max_rate_share
            )
        )
    if settings.name == "actuator_delay":
        shortest = values["delay"] * (1.0 - least / max(ratio, least))
        lag = shortest_lag(evaluation) + shortest * rate
        tests.append(
            at_least(item.name, "shortest likely lag of the effort over sample period", lag, MAX_LAG_WITHOUT_DELAY)
        )
    if settings.name == "actuator_saturation":
        effort = np.abs(np.concatenate([motion.effort for motion in evaluation.fit_motions]))
        tests.append(
            at_most(
                item.name, "share of samples beyond the limit", float(np.mean(effort > values["limit"])),
                evaluation.criteria.max_unexplained,
            )
        )  # fmt: skip
    return tests


def shortest_lag(evaluation: EvaluationData) -> float:
    """Return the shortest lag that the effort of the fitted recordings is read with [samples]."""
    return min(min(motion.lag.values) for motion in evaluation.fit_motions)


def strength(item: Candidate, held: Set[int] = frozenset()) -> float:
    """Return the strength of a hypothesis over its standard error with the shape as it was fitted.

    A free shape is not determined where the effect is absent (Davies 1987, Biometrika 74(1)).

    Args:
        item: the hypothesis, an effect.
        held: nominal parameters that count as known.
    """
    assert item.settings is not None
    found = item.refit
    place = [one.name for one in found.effects].index(item.settings.name)
    parameters = effect(item.settings.name).parameters
    shape = {(i, j) for i, j in found.free if i == place and not parameters[j].is_strength}
    errors = found.standard_errors(shape, held)
    of_effect = {j: error for (i, j), error in errors.items() if i == place}
    return strength_over_error(item.settings, of_effect, item.setup.null_values(item.settings.name))


def strength_beyond_tolerance(item: Candidate, before: Refit) -> float:
    """Return the strength over its standard error of what an effect adds to values at the end of their tolerance.

    The tolerance of the file is a hard bound. A value that lies at its end without the effect cannot be what makes the
    rest: a mass error beyond the tolerance is sure, although the mass within the tolerance is not known.

    Args:
        item: the hypothesis, an effect.
        before: fit without it.

    Returns:
        0 if no value lies at the end of its tolerance.
    """
    at_end = values_at_end(before, item.setup)
    if not at_end:
        return 0.0
    refitted = item.setup.fit(item.refit.effects, before.logs, is_nominal_held=True)
    return strength(replace(item, refit=refitted), at_end)


def values_at_end(fit: Refit, setup: RefitSetup) -> frozenset[int]:
    """Return the numbers of the file's values that a fit moved to the end of their tolerance or freedom."""
    bound = limits(setup.nominal, setup.tolerance, setup.freedom)
    return frozenset(np.flatnonzero(np.abs(fit.logs) >= (1.0 - RANGE_END_TOLERANCE) * bound).tolist())


def strength_over_error(settings: EffectSettings, errors: Mapping[int, float], null: Sequence[float]) -> float:
    """Return the largest strength parameter of an effect over its standard error.

    Args:
        settings: the effect.
        errors: standard error of each free parameter, by its index.
        null: values of its parameters that are no finding.

    Returns:
        Infinite if the effect has no free strength parameter.
    """
    parameters = effect(settings.name).parameters
    found = []
    for j, error in errors.items():
        parameter, value = parameters[j], settings.values[j]
        if parameter.is_strength and error > 0.0:
            size = abs(parameter.linear(value) - parameter.linear(null[j]))
            found.append(size / parameter.linear_error(value, error))
    return max(found, default=math.inf)


def free_form_tests(item: Candidate, before: Refit, closed: Improvement, evaluation: EvaluationData) -> list[Test]:
    """Return the test that a free-form regression over the same coordinates predicts hardly better than the effect.

    The residual may contain other effects, and a recording correlates coordinates: a stage that repeats one move has
    the same velocity at the same position. Both sides may therefore also use all other coordinates. What the regression
    surely predicts better is a share of what it and the effect close. It may also be another force over the same
    coordinates: beside an effect that no contact can imitate a map over them may take it, if the effect adds to it.

    Args:
        item: the hypothesis.
        before: fit without it.
        closed: improvement of the weighted residual by the hypothesis [N^2].
        evaluation: the recordings.
    """
    names = free_form_coordinates(item.name)
    if not names:
        return []
    others = tuple(name for name in ALL if name not in names)
    without_effect = min((_rest(before.model, one, evaluation) for one in (names, ALL)), key=lambda rest: rest.rms)
    criteria = evaluation.criteria
    form = f"{FORM} over {', '.join(names)}"

    def against(left: Sequence[Floats]) -> Test:
        better = improvement(left, without_effect.blocks(criteria.block))
        share = better.decrease / (max(closed.decrease, 0.0) + better.decrease) if better.decrease > 0.0 else 0.0
        is_significant = better.z_score > criteria.min_z_score
        return at_most(item.name, form, share if is_significant else 0.0, criteria.min_predictable_share)

    for one in ((), others):  # the second regression takes time and is needed only if the effect alone does not match
        test = against(_rest(item.refit.model, one, evaluation).blocks(criteria.block))
        if test.passed:
            return [test]
    over = [] if is_confusable_with_contact(item.name) else maps_over(set(names))
    if not over:
        return [test]
    without, with_it = (_fitted_and_evaluated(model, evaluation) for model in (before.model, item.refit.model))
    both = effect_and_map(item.name, without, with_it, over, criteria)
    return [against(both.left), both.added] if both and both.added.passed else [test]


def _shown_in_fast_sliding(item: Candidate, before: Refit, evaluation: EvaluationData) -> list[Test]:
    """Return the test that an effect with the force of a mass shows in fast sliding; none if it does not surely.

    A regression over the coordinates of a contact predicts what another contact law leaves better than any mass does.
    While the contact slides fast, contact laws hardly differ.

    Args:
        item: the hypothesis.
        before: fit without it.
        evaluation: the recordings.
    """
    if not is_inertial(item.name):
        return []
    others, left = (_evaluated(one.model, evaluation) for one in (before, item.refit))
    gain = improvement_in_fast_sliding(item.refit.model, others, left, evaluation.criteria)
    test = in_fast_sliding(item.name, gain.share, evaluation.criteria)
    return [test] if test.passed and gain.z_score > evaluation.criteria.min_z_score else []


def hidden_contact_tests(item: Candidate, before: Refit, evaluation: EvaluationData) -> list[Test]:
    """Return the test that an effect predicts better beside another contact law, where the encoder hides the contact.

    There no change of the contact is added, because the recordings do not show it. It may be in the residual all the
    same, where any effect would stand in for it. The noise is fitted to what the model with both leaves.

    Args:
        item: the hypothesis, an effect that a contact cannot imitate.
        before: fit without it.
        evaluation: the recordings.
    """
    if evaluation.hidden_by_encoder <= HALF_A_REVERSAL or not can_be_freed(item.setup, CHANGED_CONTACT_LAW):
        return []
    assert item.settings is not None
    without, _ = item.setup.without(item.name, before.effects)
    changed = changed_candidate(without, before, CHANGED_CONTACT_LAW)
    setup = with_free_effect(changed.setup, item.name)
    both = setup.fit(with_effect(changed.refit.effects, item.settings), changed.refit.logs)
    data = data_with_own_noise(evaluation.fit_motions, both.model)
    held_out = data_with_noise_of(evaluation.held_out_data.motions, data, both.model)
    evaluation = replace(evaluation, fit_data=data, held_out_data=held_out)
    fits = (changed.setup, changed.refit), (setup, both)
    gain = improvement(*(evidence_of(finish_fit(replace(one, data=data), fit), evaluation).all for one, fit in fits))
    title = "z-score beside another contact law, where the encoder hides the contact"
    return [at_least(item.name, title, gain.z_score, evaluation.criteria.min_z_score)]


def _rest(model: Model, names: Sequence[str], evaluation: EvaluationData) -> WeightedResidual:
    """Return the residual of a model and a free-form regression on the evaluated recordings.

    Args:
        model: the model.
        names: coordinates of the regression; empty for none.
        evaluation: the recordings.
    """
    rest = _evaluated(model, evaluation)
    return rest.minus(free_form_prediction(names, model, evaluation).predicted) if names else rest


def free_form_prediction(names: Sequence[str], model: Model, evaluation: EvaluationData) -> FreeForm:
    """Return the free-form prediction of a residual on the evaluated recordings, from memory if it was made before."""
    key = (tuple(names), model)
    if key not in evaluation.predictions:
        pair = _fitted_and_evaluated(model, evaluation)
        evaluation.predictions[key] = free_form(names, *pair, evaluation.criteria, evaluation.seed)
    return evaluation.predictions[key]


def _fitted_and_evaluated(model: Model, evaluation: EvaluationData) -> tuple[WeightedResidual, WeightedResidual]:
    """Return the residual of a model on the fitted and on the evaluated recordings; one object if they are the same."""
    left = residuals(model, evaluation.fit_motions)
    fitted = WeightedResidual(evaluation.fit_motions, left, evaluation.fit_data.weights)
    return (fitted, _evaluated(model, evaluation)) if evaluation.has_held_out else (fitted, fitted)


def _evaluated(model: Model, evaluation: EvaluationData) -> WeightedResidual:
    """Return the residual of a model on the evaluated recordings."""
    return WeightedResidual(evaluation.motions, residuals(model, evaluation.motions), evaluation.weights)


def z_score_between(one: Evidence, other: Evidence, criteria: Criteria) -> float:
    """Return the z-score by which one hypothesis predicts better than another.

    It is computed over all recordings. If the held-out recordings alone contradict it, their z-score counts.

    Args:
        one, other: evidence of their fits, from the same evaluation data.
        criteria: thresholds.
    """
    z_score = preference(one.all, other.all)
    if one.held_out:
        held_out = preference(one.held_out, other.held_out)
        if held_out * z_score < 0.0 and abs(held_out) > criteria.interval_z_score:
            return held_out
    return z_score


def preferred(best: Decision, equal: Sequence[Decision], listed: Sequence[str]) -> Decision:
    """Return the effect to prefer among those that the data do not distinguish from the best predicting one.

    An effect of the file comes first: a changed value of a known effect is the simplest explanation. If the file lists
    none of them, the effect with the fewest parameters is returned.

    Args:
        best: the effect that predicts best.
        equal: the best effect and all hypotheses that the data do not distinguish from it.
        listed: effects of the file.
    """
    for item in equal:
        if item.candidate.name in listed:
            return item
    is_confusable = is_confusable_with_contact(best.candidate.name)
    others = [
        item for item in equal
        if item.candidate.settings is not None
        and (is_confusable or not is_confusable_with_contact(item.candidate.name))
    ]  # fmt: skip
    return min((best, *others), key=lambda item: item.candidate.parameter_count)


def rivals(best: Decision, others: Sequence[Decision]) -> list[Decision]:
    """Return the other effects that are possible beside the best one, as another explanation.

    With the best one the gap of held-out recordings shrinks. With a rival it need not shrink significantly, because the
    comparison of the two decides. An effect that contains the best one as a special case is no other explanation.

    Args:
        best: the accepted decision.
        others: all decisions of the same round.
    """
    general = effect(best.candidate.name).special_case_of if best.candidate.settings else ""
    return [
        item for item in others
        if item.candidate.settings is not None and item.is_possible_beside(best)
        and item.candidate.name not in (best.candidate.name, general)
    ]  # fmt: skip


def is_special_case_enough(general: Decision, special: Decision, criteria: Criteria) -> bool:
    """Return whether another effect is a special case of an effect and closes nearly as much.

    What it adds to its special case is an effect like any other: of the closable gap it has to close as much as
    deserves a name.

    Args:
        general: decision on the effect.
        special: decision on the other one.
        criteria: thresholds.
    """
    settings = special.candidate.settings
    is_contained = settings is not None and effect(settings.name).special_case_of == general.candidate.name
    return is_contained and min(general.share, 1.0) - special.share < criteria.min_closed_share


def compare(best: str, rival: str, z_score: float, criteria: Criteria) -> Test:
    """Return the test that an effect predicts significantly better than a rival; one that fails is an alternative."""
    title = f"z-score of a better prediction than {rival}"
    return at_least(best, title, z_score, criteria.min_z_score)


def comparisons(best: Decision, others: Sequence[Decision], criteria: Criteria) -> dict[str, Test]:
    """Return the comparison of the best effect with each rival, by the rival's name.

    Args:
        best: the accepted decision.
        others: all decisions of the same round.
        criteria: thresholds.
    """
    name = best.candidate.name
    return {
        item.candidate.name: compare(
            name, item.candidate.name, z_score_between(best.evidence, item.evidence, criteria), criteria
        )
        for item in rivals(best, others)
    }
