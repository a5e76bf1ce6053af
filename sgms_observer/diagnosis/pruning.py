"""What becomes of accepted effects beside the later ones: some are redundant, some not significant, some renamed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.candidates import finish_fit, with_effect, with_free_effect
from sgms_observer.diagnosis.closed_gap import Closed, ClosedGap
from sgms_observer.diagnosis.coordinates import is_confusable_with_contact
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least, at_most
from sgms_observer.diagnosis.decision import (
    MAX_LAG_WITHOUT_DELAY,
    SIZE_BEYOND_TOLERANCE,
    Decision,
    compare,
    needs_visible_contact,
    preferred,
    shortest_lag,
    within_range,
    z_score_between,
)
from sgms_observer.diagnosis.diagnosis import (
    FitState,
    Options,
    Round,
    WrittenFits,
    accepted_candidates,
)
from sgms_observer.diagnosis.evaluation import EvaluationData, evidence_of
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import WRITTEN_EVALUATIONS, Freedom, Refit, RefitSetup
from sgms_observer.diagnosis.gap import residuals, weighted_rms
from sgms_observer.diagnosis.instruments import Share, delay_in_response, is_shown, or_in_response
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import lowest_rate
from sgms_observer.diagnosis.sliding import in_fast_sliding, slides_fast, sliding_shares
from sgms_observer.diagnosis.sliding_force import total_force_logs
from sgms_observer.diagnosis.uncertainty import RecordingEstimates, recording_estimates
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.effects.catalogue import effect, is_contact_law, is_inertial

MASS_ERROR, ACTUATOR_GAIN = "mass_error", "actuator_gain"
"""Effects on values of the file."""
PLACING = ("pitch", "center", "width")
"""Parameters that place an effect along the stroke. A rest position does not: it is an offset over a stiffness."""


def without_redundant_effects(
    state: FitState, rounds: Sequence[Round], options: Options
) -> tuple[FitState, tuple[Round, ...]]:
    """Remove each effect without which the model does not predict significantly worse.

    Args:
        state: state with everything that was accepted.
        rounds: rounds so far.
        options: options of the diagnosis.
    """
    for item in _with_effects(rounds)[:-1]:
        assert item.accepted is not None
        name = item.accepted.candidate.name
        evaluation = state.evaluation(options)
        full = evidence_of(finish_fit(state.setup, state.current), evaluation)
        without = state.without(name)
        gain = improvement(evidence_of(without.current, evaluation).all, full.all)
        test = at_least(name, "z-score beside the other effects", gain.z_score, options.criteria.min_z_score)
        rounds = _with_test(rounds, test)
        if not test.passed:
            state = without.refitted(without.current)
    return state, tuple(rounds)


def with_friction_of_file(state: FitState, rounds: Sequence[Round], evaluation: EvaluationData) -> FitState:
    """Return the state in which friction values that the effects explain stay within the tolerance of the file.

    A change of the contact may have freed all of them before an effect was found that moved them. Beside the effect
    some are back within the tolerance, and without it they could imitate a part of it. Nothing changes where no effect
    was added, or if the state with free values predicts significantly better.

    Args:
        state: state with everything that was accepted.
        rounds: rounds so far.
        evaluation: evaluation data of the state.
    """
    if not state.setup.freedom.friction or not _with_effects(rounds):
        return state
    setup, found = state.setup, state.current
    while (freedom := _without_unmoved(setup, found)) != setup.freedom:
        setup = replace(setup, freedom=freedom)
        found = setup.fit(found.effects, found.logs)
    if setup is state.setup:
        return state
    pairs = (setup, found), (state.setup, state.current)
    held, free = (evidence_of(finish_fit(*pair), evaluation) for pair in pairs)
    is_needed = improvement(held.all, free.all).z_score > evaluation.criteria.min_z_score
    return state if is_needed else replace(state, setup=setup).refitted(found)


def _without_unmoved(setup: RefitSetup, found: Refit) -> Freedom:
    """Return the freedom of a setup without the friction values that a fit leaves within the tolerance of the file."""
    logs = total_force_logs(found.logs, setup.nominal, found.effects).tolist()
    named = zip(setup.nominal.parameter_names(), logs, strict=True)
    moved = {name for name, log in named if abs(log) > math.log1p(setup.tolerance)}
    return replace(setup.freedom, friction=setup.freedom.friction & moved)


def compared_again(
    state: FitState, rounds: Sequence[Round], listed: Sequence[str], options: Options
) -> tuple[FitState, tuple[Round, ...]]:
    """Compare each effect with its rivals again, beside everything that was accepted later.

    In its own round the later effects were still in the residual, where they hide differences and make others. Nothing
    was accepted after the last one: it is compared again only where a rival predicted better. Now among equals the
    better prediction decides, see ``compared``.

    Args:
        state: state with everything that was accepted.
        rounds: rounds so far.
        listed: effects of the file.
        options: options of the diagnosis.
    """
    found = list(rounds)
    places = [place for place, item in enumerate(found) if item.accepted]
    for place in places:
        is_settled = all(test.value >= 0.0 for test in found[place].comparisons.values())
        if place != places[-1] or not is_settled:
            state, found[place] = compared(state, found[place], listed, options, has_place=False)
    return state, tuple(found)


def compared(
    state: FitState, item: Round, listed: Sequence[str], options: Options, has_place: bool = True
) -> tuple[FitState, Round]:
    """Compare an accepted effect with its rivals in the noise of the residual that it leaves.

    Before it was accepted, the fitted noise still contained it. A rival that now predicts significantly better takes
    its place; among equals the rules of the first choice decide. Effects that a contact law cannot imitate are compared
    while the contact slides. A change of the file has no place that an effect could take. Where the model leaves more
    than noise, what is missing may make a small difference between two effects: it has to be larger than that.
    Otherwise an effect of the file keeps its place even if a rival predicts significantly better. An effect of the file
    that stays within its tolerance may be a rival, too: its value may be what is wrong.

    Args:
        state: state with everything that was accepted.
        item: the round in which the effect was accepted.
        listed: effects of the file.
        options: options of the diagnosis.
        has_place: whether the accepted effect keeps its place among equals, as long as effects may be missing. Without
            it the better prediction decides. A rival that predicted significantly worse when the effect was accepted
            then takes no place among equals: what was accepted later may imitate the difference.

    Returns:
        The state and the round, with the comparisons of the effect that has the place.
    """
    assert item.accepted is not None
    if item.accepted.candidate.settings is None:
        return state, item
    name, most = item.accepted.candidate.name, options.criteria.min_z_score
    known = {one.name for one in state.current.effects} - state.setup.held_effects
    rivals = {one.candidate.name: one for one in item.decisions if one.candidate.name in item.comparisons}
    rivals = {rival: one for rival, one in rivals.items() if rival not in known}
    if not rivals:
        return state, replace(item, comparisons={})
    state = state.refitted(state.current)
    states = {name: replace(state, current=finish_fit(state.setup, state.current))}
    states |= {rival: _with_rival(state, name, one) for rival, one in rivals.items()}
    decisions = {name: item.accepted, **rivals}
    evaluation = state.evaluation(options)
    shares = sliding_shares(state.current.model, evaluation)
    evidence = {key: evidence_of(one.current, evaluation) for key, one in states.items()}

    def z_score(one: str, other: str) -> float:
        pair = evidence[one], evidence[other]
        if not (is_confusable_with_contact(one) or is_confusable_with_contact(other)):
            pair = pair[0].weighted(shares), pair[1].weighted(shares)
        return z_score_between(*pair, options.criteria)

    models = {key: one.current.model for key, one in states.items()}

    def comparison(one: str, other: str) -> Test:
        value, least = z_score(one, other), options.criteria.min_imitable_share
        if abs(value) > most and not evaluation.is_gap_closed(models[one]):
            better, worse = (one, other) if value > 0.0 else (other, one)
            share = _share_beyond_rest(better, worse, models, evaluation)
            if share < least:
                title = f"squared difference / (difference + residual above noise) from {other}"
                return at_least(one, title, share, least)
        return compare(one, other, value, options.criteria)

    was_worse = frozenset() if has_place else item.worse
    may_replace = [
        rival for rival, one in rivals.items()
        if one.passed and (rival not in was_worse or comparison(rival, name).passed)
    ]  # fmt: skip
    best = name
    for rival in may_replace:
        best = rival if z_score(rival, best) > 0.0 else best

    def is_equal(key: str) -> bool:
        return z_score(best, key) <= most or (key in listed and not comparison(best, key).passed)

    equal = {key: decisions[key] for key in (name, *may_replace) if decisions[key].passed and is_equal(key)}
    start = equal.get(name, decisions[best]) if has_place else decisions[best]
    first = preferred(start, list(equal.values()), listed)
    best = first.candidate.name
    tests = {key: comparison(best, key) for key in decisions if key != best}
    if best != name:
        state = states[best].refitted(states[best].current)
    if has_place or best != name:
        item = replace(item, worse=frozenset(key for key, test in tests.items() if test.passed))
    return state, replace(item, accepted=first, comparisons=tests)


def _share_beyond_rest(better: str, other: str, models: Mapping[str, Model], evaluation: EvaluationData) -> float:
    """Return the squared difference of two effects over its sum with what the better one leaves above the noise.

    Args:
        better: the effect that predicts better.
        other: the other one.
        models: model with each of them.
        evaluation: the recordings.
    """
    motions, weights = evaluation.motions, evaluation.weights
    if not (is_confusable_with_contact(better) or is_confusable_with_contact(other)):
        weights = tuple(fast.astype(np.float64) for fast in slides_fast(models[better], motions))
    if not any(np.any(part) for part in weights):
        return 0.0
    ours, theirs = (weighted_rms(residuals(models[key], motions), weights) ** 2 for key in (better, other))
    difference = max(theirs - ours, 0.0)
    left = max(evaluation.rms(models[better]) ** 2 - evaluation.floor**2, 0.0)
    return difference / max(difference + left, 1.0e-300)


def _with_rival(state: FitState, name: str, rival: Decision) -> FitState:
    """Return the state with another effect in the place of one."""
    start = rival.candidate.settings
    assert start is not None
    setup, effects = state.setup.without(name, state.current.effects)
    setup = with_free_effect(setup, start.name)
    found = setup.fit(with_effect(effects, start), state.current.logs)
    return replace(state, setup=setup, current=finish_fit(setup, found))


def without_insignificant_effects(
    found: FitState, state: FitState, rounds: Sequence[Round], nominal: Model, options: Options
) -> tuple[FitState, tuple[Round, ...], WrittenFits]:
    """Remove each effect that held-out recordings do not show or that hardly closes the gap, weakest first.

    An effect of the machine appears in all recordings: estimated from the held-out ones alone, its strength has the
    same sign and differs significantly from zero. A fit at an end of its range is no estimate: where everything else
    holds, an effect that ends there is removed too. Friction values that the effects explain stay within the tolerance
    of the file meanwhile, see ``with_friction_of_file``; in the returned state they are as free as before.

    Args:
        found: state after the refit within the tolerance.
        state: state with everything that was accepted.
        rounds: rounds so far.
        nominal: the given model.
        options: options of the diagnosis.
    """
    without = _written_without(found, nominal)
    while True:
        evaluation = state.evaluation(options)
        written = _as_written(without, found, with_friction_of_file(state, rounds, evaluation), nominal)
        names = [one.name for one in accepted_candidates(_with_effects(rounds))]
        file_contact = replace(written.setup, nominal=nominal, freedom=found.setup.freedom)
        closed_gap = ClosedGap(names, written, file_contact, evaluation)
        closed = {name: closed_gap.closed_by(name) for name in names}
        tests = _reported_tests(closed_gap, closed)
        failed = min(_failed(tests), key=lambda test: test.value / test.threshold, default=None)
        if failed is None:
            for item in [one for one in written.after.effects if one.name in names]:
                in_response = delay_in_response(written.after.model, item.name, evaluation)
                shown = is_shown(in_response, options.criteria)
                tests.append(within_range(item, written.after, written.setup, shown))
            failed = max(_failed(tests), key=lambda test: test.value, default=None)
        if failed is None:
            for test in tests:
                rounds = _with_test(rounds, test)
            shares = {name: one.share_above_floor for name, one in closed.items()}
            return state, tuple(rounds), replace(written, shares_above_noise=shares)
        rounds = _with_test(rounds, failed)
        if any(item.accepted for item in rounds):
            state = state.without(failed.of)
            state = state.refitted(state.current)
        else:
            state = found


def _failed(tests: Sequence[Test]) -> list[Test]:
    """Return the tests that failed."""
    return [test for test in tests if not test.passed]


def _reported_tests(closed_gap: ClosedGap, closed_by: Mapping[str, Closed]) -> list[Test]:
    """Return the tests of effects as they are reported: the strength of each, and what it closes.

    An effect that another contact law can imitate is also judged in the place of all that stands for one: what it
    leaves may be another contact law, and what it closes a part of it. Its size may not differ between recordings as
    that of an offset may.

    Args:
        closed_gap: the effects, beside everything that was accepted.
        closed_by: what each of them closes beside everything else.
    """
    criteria, written = closed_gap.evaluation.criteria, closed_gap.written
    tests = []
    for name, closed in closed_by.items():
        describes_contact = is_contact_law(name)
        tests += [
            at_least(
                name, "strength over its scatter between recordings",
                written.strength_over_scatter(name, has_fixed_shape=describes_contact),
                criteria.interval_z_score if describes_contact else criteria.min_z_score,
            ),
            at_least(
                name, "strength over its standard error, in held-out recordings too",
                written.strength_elsewhere(name, criteria.min_z_score), criteria.interval_z_score,
            ),
            at_least(
                name, "share of the closable squared gap beside the others", closed.share, criteria.min_closed_share
            ),
            at_least(name, "gap beside the others: z-score", closed.z_score, criteria.interval_z_score),
        ]  # fmt: skip
        errors = _errors_of_places(name, written)
        if errors:
            stroke = float(np.ptp(np.concatenate([motion.position for motion in closed_gap.evaluation.fit_motions])))
            title = "90 % interval of a pitch, place or width over the stroke"
            tests.append(at_most(name, title, 2.0 * criteria.interval_z_score * max(errors) / stroke, 1.0))
        if name in (MASS_ERROR, ACTUATOR_GAIN):
            beyond = _size_beyond_tolerance(name, closed_gap)
            tests.append(at_least(name, SIZE_BEYOND_TOLERANCE, beyond, criteria.interval_z_score))
        in_response = delay_in_response(written.after.model, name, closed_gap.evaluation)
        if in_response is not None:
            title = "share of the delay in the response to the reference"
            least = max(criteria.min_imitable_share, _share_beyond_lag(name, written.after, closed_gap.evaluation))
            tests.append(at_least(name, title, in_response.counted(criteria), least))
        if needs_visible_contact(name):
            title = "strength over its error with any significant scatter between recordings"
            strength = written.strength_over_error(name, criteria.interval_z_score)
            test = at_least(name, title, strength, criteria.interval_z_score)
            tests.append(or_in_response(test, in_response, criteria))
        if needs_visible_contact(name) and not describes_contact:
            if closed_gap.has_other_contact_law:
                closed = closed_gap.closed_by_instead_of_contact_law(name)
            tests.append(_test_in_place_of_contact_law(name, closed, in_response, criteria))
    return tests


def _errors_of_places(name: str, written: WrittenFits) -> list[float]:
    """Return the standard error of each fitted parameter that places an effect along the stroke [m].

    A shape that the stroke does not determine is none: a slope or a constant does as well.

    Args:
        name: the effect.
        written: fits with it.
    """
    place = [item.name for item in written.after.effects].index(name)
    parameters = effect(name).parameters
    placing = {(place, j) for j, one in enumerate(parameters) if one.name in PLACING and one.acts_on == "position"}
    errors = zip(written.estimates.free, written.estimates.errors[0].tolist(), strict=True)
    return [error for index, error in errors if index in placing]


def _share_beyond_lag(name: str, fit: Refit, evaluation: EvaluationData) -> float:
    """Return the share of a delay from which the effort lags by more than a held effort and inexact stamps make.

    Args:
        name: the delay.
        fit: fit with it.
        evaluation: the recordings.
    """
    (delay,) = next(item.values for item in fit.effects if item.name == name)
    rate = lowest_rate(evaluation.fit_motions)
    return (MAX_LAG_WITHOUT_DELAY - shortest_lag(evaluation)) / max(delay * rate, 1.0e-300)


def _test_in_place_of_contact_law(name: str, closed: Closed, in_response: Share | None, criteria: Criteria) -> Test:
    """Return the test that an effect closes more than it leaves where another contact law could imitate it.

    An inertia and a delay also show while the contact slides fast, where contact laws hardly differ: a mass error or a
    flexible mode as a force beside the contact, a delay in the response to the reference. One of the two is enough:
    noise may hide it there, and another contact law everywhere else.

    Args:
        name: the effect.
        closed: what it closes in the place of another contact law.
        in_response: share of a delay that the response to the reference shows, or None.
        criteria: thresholds.
    """
    title = "share of the squared gap above the noise in the place of another contact law"
    test = at_least(name, title, closed.share_above_floor, criteria.min_imitable_share)
    if test.passed:
        return test
    if is_inertial(name):
        return in_fast_sliding(name, closed.share_in_fast_sliding, criteria)
    return or_in_response(test, in_response, criteria)


def _size_beyond_tolerance(name: str, closed_gap: ClosedGap) -> float:
    """Return by how much a value of the file would exceed its tolerance without an effect, over its standard error.

    The error holds the scatter between recordings where that is significant. Within the tolerance nothing is missing.
    A wrong mass is one value of the file; a wrong gain scales all values, so the smaller one of mass and Coulomb force
    counts.

    Args:
        name: one of ``MASS_ERROR`` and ``ACTUATOR_GAIN``.
        closed_gap: the effects, beside everything that was accepted.
    """
    written, file, criteria = closed_gap.written, closed_gap.setup.nominal, closed_gap.evaluation.criteria
    fitted = written.after.model
    place = [item.name for item in written.after.effects].index(name)
    value, error = written.after.effects[place].values[0], written.error_of_value(place, criteria.interval_z_score)
    if name == MASS_ERROR:
        sizes, error = [(fitted.mass + value) / file.mass - 1.0], error / file.mass
    else:
        ratios = fitted.mass / file.mass, fitted.friction.coulomb_force / file.friction.coulomb_force
        sizes, error = [ratio / value - 1.0 for ratio in ratios], error / value
    size = min(abs(one) for one in sizes)
    return (size - closed_gap.setup.tolerance) / error if error > 0.0 else math.inf


def _with_effects(rounds: Sequence[Round]) -> list[Round]:
    """Return the rounds that added an effect."""
    return [item for item in rounds if item.accepted and item.accepted.candidate.settings is not None]


def _with_test(rounds: Sequence[Round], test: Test) -> tuple[Round, ...]:
    """Return the rounds with one more test of an accepted effect, which is rejected if the test fails."""
    return tuple(
        item.with_test(test) if item.accepted and item.accepted.candidate.name == test.of else item for item in rounds
    )


def _written_without(found: FitState, nominal: Model) -> WrittenFits:
    """Return the fits with the elements of the file, both without anything that was accepted.

    Args:
        found: state after the refit within the tolerance.
        nominal: the given model.
    """
    setup = replace(found.setup, nominal=nominal, data=data_with_own_noise(found.fit_motions, found.current.model))
    fit = setup.fit(found.current.effects, evaluations=WRITTEN_EVALUATIONS)
    none = RecordingEstimates.none()
    return WrittenFits(fit, fit, setup, none, none, none)


def _as_written(without: WrittenFits, found: FitState, state: FitState, nominal: Model) -> WrittenFits:
    """Return the fits with the elements of the file, without and with everything that was accepted.

    Args:
        without: fits without it.
        found: state after the refit within the tolerance.
        state: state with everything that was accepted.
        nominal: the given model.
    """
    if state is found:
        return without
    before = without.before
    fine = state.setup.nominal
    later = replace(nominal, is_unsmoothed=fine.is_unsmoothed, relaxation=fine.relaxation)
    if state.setup.freedom.elements:
        later = fine
    last = replace(state.setup, nominal=later)
    starts: list[Floats | None] = [None]
    if later.parameter_names() == nominal.parameter_names():
        starts.append(before.logs)
    if later.parameter_names() == fine.parameter_names():
        starts.append(state.current.logs)
    tried = [last.fit(state.current.effects, start, evaluations=WRITTEN_EVALUATIONS) for start in starts]
    after = min(tried, key=lambda fit: fit.cost)
    fresh, of_strengths = (_with_derivatives(last, after, only_strengths) for only_strengths in (False, True))
    estimates = strengths = recording_estimates(last, fresh, state.held_out_motions)
    if of_strengths.free != fresh.free:
        strengths = recording_estimates(last, of_strengths, state.held_out_motions)
    common = estimates
    if any(needs_visible_contact(item.name) for item in after.effects):
        common = recording_estimates(last, fresh, state.held_out_motions, has_common_values=True)
    return WrittenFits(before, after, last, estimates, strengths, common)


def _with_derivatives(setup: RefitSetup, found: Refit, only_strengths: bool) -> Refit:
    """Return a fit with its own derivatives, with respect to the effect parameters that are free in it.

    Args:
        setup: setup of the fit.
        found: the fit.
        only_strengths: whether effects keep their shapes. A free shape is not determined where an effect is absent, and
            then its strength over its error is not normally distributed (Davies 1987, Biometrika 74(1)).
    """
    parameters = [effect(item.name).parameters for item in found.effects]
    free = {(i, j) for i, j in found.free if parameters[i][j].is_strength or not only_strengths}
    fixed = [(i, j) for i, e in enumerate(found.effects) for j in range(len(e.values)) if (i, j) not in free]
    return setup.fit(found.effects, found.logs, fixed, evaluations=1)
