"""The answer of a diagnosis: gap, named effects with their tests, learnt maps, changed values and verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.advice import next_experiment
from sgms_observer.diagnosis.changed import Changed, changed_values
from sgms_observer.diagnosis.coordinates import CONTACT, is_confusable_with_contact
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least, at_most
from sgms_observer.diagnosis.decision import Decision
from sgms_observer.diagnosis.detectable import detectable
from sgms_observer.diagnosis.diagnosis import Diagnosis, Options
from sgms_observer.diagnosis.disturbance import SlidingResidual, sliding_residual
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.final_model import (
    FinalModel,
    constant_force_tests,
    coordinate_tests,
    direction_tests,
    final_model,
    learnt_maps,
)
from sgms_observer.diagnosis.free_form import FreeForm
from sgms_observer.diagnosis.gap import Gap, WeightedResidual, interval, residuals, rms
from sgms_observer.diagnosis.gap_data import GapData, ratio_to_noise
from sgms_observer.diagnosis.load_change import other_load
from sgms_observer.diagnosis.locate import Located, locate
from sgms_observer.diagnosis.map_fit import FittedMap
from sgms_observer.diagnosis.model import PERIODIC_DISTURBANCE, Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.named import Named, measured_quantisation, named_effects
from sgms_observer.diagnosis.sliding import fast_sliding_residual, preference_over_logarithmic_friction
from sgms_observer.effects.catalogue import is_drag
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import Units

UNEXPLAINED = "share of the effort that is unexplained"
OVER_NOISE = "gap over noise, where nothing predicts it"
ADDED_BY_REFIT = "share of the squared gap that the refit adds"
BEHIND_ENCODER = "gap over noise, where the encoder hides the contact"
"""Tests of the whole model, whose failure may make the verdict ``cannot_tell``."""
MAX_LOCATED = 4
"""Largest number of reported coordinates."""
LOCATED_P_VALUE = 0.02
"""Largest p-value of a coordinate that is reported."""


@dataclass(frozen=True)
class Answer:
    """The whole answer.

    Attributes:
        verdict: see docs/diagnosis.md.
        gap: given, before, after and floor.
        effects: the named effects.
        learnt: maps of a predictable force that no named effect explains.
        changed: values of the file that the fit moved beyond their tolerance.
        remainder: residual that is not noise and has no name: ``none``, ``learnt`` (by a map) or ``unknown``.
        disturbance: a force that acts while the contact slides and does not repeat, or None.
        located: significant coordinates over which the residual of the refitted file varies.
        all_located: every coordinate.
        located_after: the coordinates of ``located`` for the residual of the final model.
        detectable: smallest detectable size of each effect, as a share of the Coulomb force.
        next_experiment: one sentence, or None.
        tests: every test of every hypothesis and of the model.
        doubtful: failed tests of named effects that leave what their own coordinates predict.
        usable: whether the model may be used as it is.
        warnings: sentences for the user.
        model: the model that augmented.yaml holds.
        diagnosis: the diagnosis that the answer is made from.
        motions: recordings that the gap is computed on.
        weights: weights of their residuals in the gap.
        residual_before, residual_after: residuals of these recordings [N].
        gap_with_learnt: gap of the model with effects and learnt maps [%].
    """

    verdict: str
    gap: Gap
    effects: tuple[Named, ...]
    learnt: tuple[FittedMap, ...]
    changed: tuple[Changed, ...]
    remainder: str
    disturbance: SlidingResidual | None
    located: tuple[Located, ...]
    all_located: tuple[Located, ...]
    located_after: tuple[Located, ...]
    detectable: dict[str, float]
    next_experiment: str | None
    tests: tuple[Test, ...]
    doubtful: tuple[Test, ...]
    usable: bool
    warnings: tuple[str, ...]
    model: Model
    diagnosis: Diagnosis
    motions: tuple[Motion, ...]
    weights: tuple[Floats, ...]
    residual_before: tuple[Floats, ...]
    residual_after: tuple[Floats, ...]
    gap_with_learnt: float


def answer_of(diagnosis: Diagnosis, axis: AxisSettings, options: Options, contradiction: Test | None = None) -> Answer:
    """Return the answer of a diagnosis, computed on data that nothing was fitted to.

    Args:
        diagnosis: the diagnosis.
        axis: the given settings.
        options: options of the diagnosis.
        contradiction: failed test of the final model. With it, the answer names no effect and learns no map.
    """
    criteria = options.criteria
    data = GapData.of(diagnosis, options)
    given = residuals(replace(Model.of(axis), effects=diagnosis.file_effects), data.motions)
    final = final_model(data, contradiction)
    rest = data.rest(final.after)
    learnt: list[FittedMap] = []
    free = data.predictable(rest, final.fit.model)
    by_coordinates = coordinate_tests(data, final, axis.units)
    unnamed = _best_unnamed(diagnosis, criteria)
    if not diagnosis.is_poor and contradiction is None:
        learnt = learnt_maps(data, final, axis.units)
        by_coordinates += constant_force_tests(data, final, learnt)
    model = final.fit.model.with_effects([item.settings for item in learnt])
    total = residuals(model, data.motions) if learnt else final.after
    floor = _left_by_predictors(data, final, total, free, unnamed)
    final = replace(final, noise=min(final.noise, floor))  # it was fitted to what these still predict
    over_noise = ratio_to_noise(rest.rms, final.noise)
    predictable_share = max(
        free.improvement.share if free else 0.0,
        unnamed.significant_share(criteria) if unnamed else 0.0,
        learnt[0].share if learnt else 0.0,
    )
    gap = _gap(data, given, final, floor)
    whole = at_most("model", UNEXPLAINED, 0.01 * gap.unweighted_after, criteria.max_unexplained)
    unnamed_rest = at_most(
        "model", "surely predictable share of the residual", predictable_share, criteria.min_predictable_share
    )
    noise_test = at_most("model", OVER_NOISE, over_noise, criteria.max_gap_over_noise)
    trust = [
        noise_test,
        at_most(
            "model", ADDED_BY_REFIT,
            _share_added_by_refit(data.rest(final.before), given, criteria), criteria.min_predictable_share,
        ),
    ]  # fmt: skip
    load = None if diagnosis.is_poor or contradiction is not None else other_load(data, final.fit)
    if load is not None:
        trust.append(load.test)
    if diagnosis.is_contact_hidden:
        trust.append(at_most("model", BEHIND_ENCODER, over_noise, criteria.min_gap_over_floor))
    percent, written = 100.0 / data.effort, diagnosis.written

    def gap_without(names: Sequence[str]) -> float:
        setup, found = written.without(names)
        return percent * data.rms(data.residuals(found, setup))

    changed = changed_values(diagnosis, final.fit, options)
    contact_tests = _contact_law_tests(data, final, predictable_share, learnt, changed)
    failed = [test for test in contact_tests if not test.passed]
    if failed:
        return answer_of(replace(diagnosis, refused_contact_effects=failed[0]), axis, options, contradiction)
    of_direction = direction_tests(data, final)
    effects = named_effects(diagnosis, final.accepted, final.fit, gap, gap_without)
    effects += measured_quantisation(diagnosis)
    is_learnt = any(item.is_beyond_contact(diagnosis.is_contact_hidden) for item in learnt)
    beyond_contact = []
    if not (unnamed_rest.passed or is_learnt or unnamed):
        beyond_contact = [_beyond_contact_test(data, rest, final.fit.model, free)]
    sliding, has_other_load = None, load is not None and not load.test.passed
    if whole.passed and not (diagnosis.is_poor or has_other_load):
        sliding = sliding_residual(data, model, total, None if learnt else free)
    disturbance = sliding if sliding and sliding.is_disturbance else None
    verdict = verdict_of(
        diagnosis, effects, unnamed_rest, is_learnt, whole, trust, beyond_contact, disturbance is not None
    )
    is_all_named = all(test.passed for test in (unnamed_rest, *of_direction)) and disturbance is None
    everywhere = locate(final.before, data.motions, options.seed)
    is_alarm = verdict not in ("no_effect", "cannot_tell")
    significant = [item for item in everywhere if item.p_value < LOCATED_P_VALUE][:MAX_LOCATED] if is_alarm else []
    afterwards = {item.coordinate: item for item in locate(total, data.motions, options.seed)}
    is_changed = final.fit is not diagnosis.written.before
    return Answer(
        verdict=verdict,
        gap=gap,
        effects=tuple(effects),
        learnt=tuple(learnt),
        changed=changed if is_changed else (),
        remainder="none" if is_all_named else "learnt" if learnt else "unknown",
        disturbance=disturbance,
        located=tuple(significant),
        all_located=tuple(everywhere),
        located_after=tuple(afterwards[item.coordinate] for item in significant if item.coordinate in afterwards),
        detectable=detectable(diagnosis, options),
        next_experiment=next_experiment(
            verdict, effects, significant, diagnosis, axis.units, whole.passed, disturbance is not None
        ),
        tests=(
            *(test for item in diagnosis.rounds for test in item.tests),
            *final.tests, *by_coordinates, *of_direction, *contact_tests, whole, unnamed_rest, *beyond_contact, *trust,
            *(sliding.tests if sliding else ()),
            *(test for test in (diagnosis.refused_contact_effects, contradiction) if test is not None),
        ),
        doubtful=tuple(test for test in by_coordinates if not test.passed),
        usable=whole.passed and not diagnosis.is_poor,
        warnings=(
            *((load.warning(axis.units),) if load is not None and has_other_load else ()),
            *_warnings(diagnosis, effects, gap, verdict, whole, unnamed_rest, noise_test, disturbance, axis.units),
        ),
        model=model,
        diagnosis=diagnosis,
        motions=data.motions,
        weights=data.whitened.weights,
        residual_before=tuple(final.before),
        residual_after=tuple(total),
        gap_with_learnt=percent * data.rms(total),
    )  # fmt: skip


def _contact_law_tests(
    data: GapData,
    final: FinalModel,
    predictable_share: float,
    learnt: Sequence[FittedMap],
    changed: Sequence[Changed],
) -> list[Test]:
    """Return the tests that named effects which another contact law can imitate explain most of what is left of it.

    Where they do not, they describe a part of the difference between the contact laws. The same holds where another
    effect, a learnt map or friction values beyond the tolerance of the file describe another part of it. Effects that
    close no less while the contact slides fast than elsewhere are judged there, where contact laws differ by a
    logarithmic friction at most. A drag acts there too, so it has to predict no worse than such a friction even if it
    closes more elsewhere. Beside a drag that is judged there, only those friction values count that act there.

    Args:
        data: recordings of the gap.
        final: models without and with the named effects.
        predictable_share: share of the squared residual that surely is predictable.
        learnt: learnt maps of the residual.
        changed: values of the file that left their tolerance.
    """
    named = [item.accepted for item in final.accepted if item.accepted and item.accepted.candidate.is_contact_law]
    if not named:
        return []
    names, criteria = {one.candidate.name for one in named}, data.options.criteria
    of, after = ", ".join(sorted(names)), data.rms(final.after) ** 2
    written = data.diagnosis.written
    setup, refitted = written.without(sorted(names))
    others = data.residuals(refitted, setup)
    parts = len(data.diagnosis.unnamed_contact_effects) + sum(item.is_of_contact for item in learnt)
    changed_friction = sum(item.is_friction for item in changed)
    closed = max(data.rms(others) ** 2 - after, 1.0e-300)
    left, predicted = max(after - final.noise**2, 0.0), predictable_share * after
    without, with_all = (
        fast_sliding_residual(data.rest(one), final.fit.model, criteria) for one in (others, final.after)
    )
    of_sliding = []
    if without is not None and with_all is not None:
        left_there = rms([with_all]) ** 2
        closed_there = rms([without]) ** 2 - left_there
        is_judged_there = closed_there >= closed
        if is_judged_there:
            closed, left, parts = closed_there, max(left_there - final.noise**2, 0.0), 0
            predicted = min(predicted, left)
            if all(is_drag(name) for name in names):
                changed_friction = sum(item.acts_in_fast_sliding for item in changed)
        if is_judged_there or any(is_drag(name) for name in names):
            title = "z-score of a better prediction than logarithmic friction, where the contact slides fast"
            z_score = preference_over_logarithmic_friction(
                final.fit.model, data.fitted(refitted.model), data.rest(final.after), data.rest(others), criteria
            )
            of_sliding.append(at_least(of, title, z_score, 0.0))
    return [
        *(
            at_least(
                one.candidate.name,
                "share of the squared gap above the noise beside the others, of another contact law",
                written.shares_above_noise[one.candidate.name], criteria.min_imitable_share,
            )
            for one in named
        ),
        at_most(
            of, "residual above noise / closed residual", left / closed, criteria.min_imitable_share
        ),
        at_most(
            of, "predictable residual / (predictable + closed residual)", predicted / (predicted + closed),
            criteria.min_predictable_share,
        ),
        at_most(of, "other parts of another contact law", parts + changed_friction, 0.0),
        *of_sliding,
    ]  # fmt: skip


def _left_by_predictors(
    data: GapData, final: FinalModel, total: Sequence[Floats], free: FreeForm | None, unnamed: Decision | None
) -> float:
    """Return the smallest rms residual that the model, a learnt map or another sure predictor leaves [N].

    Args:
        data: recordings of the gap.
        final: models without and with the named effects.
        total: residual with learnt maps too.
        free: significant free-form prediction of the residual with the named effects, or None.
        unnamed: effect without a name that predicts the largest significant share of that residual, or None.
    """
    rest = data.rest(final.after)
    gaps = [data.rms(final.before), rest.rms, data.rms(total)]
    if free is not None:
        gaps.append(rest.minus(free.predicted).rms)
    if unnamed is not None:
        gaps.append(rest.rms * math.sqrt(max(0.0, 1.0 - unnamed.gap.share)))
    return min(gaps)


def _gap(data: GapData, given: Sequence[Floats], final: FinalModel, floor: float) -> Gap:
    """Return the gap.

    Args:
        data: recordings of the gap.
        given: residual of the given file [N].
        final: models without and with the named effects.
        floor: rms residual that no predictor removes [N].
    """
    criteria, seed = data.options.criteria, data.options.seed
    before, after = data.rest(final.before), data.rest(final.after)
    percent = 100.0 / data.effort
    return Gap(
        given=percent * data.rms(given),
        before=percent * before.rms,
        after=percent * after.rms,
        floor=percent * floor,
        noise=percent * final.noise,
        unweighted_before=100.0 * data.unweighted(final.before),
        unweighted_after=100.0 * data.unweighted(final.after),
        interval_before=interval(before, criteria, seed),
        interval_after=interval(after, criteria, seed),
        held_out="held-out" if data.has_held_out else "cross-validated",
        band=data.diagnosis.final_state.fit_motions[0].band,
        min_over_floor=criteria.min_gap_over_floor,
    )


def _warnings(
    diagnosis: Diagnosis,
    effects: Sequence[Named],
    gap: Gap,
    verdict: str,
    whole: Test,
    rest: Test,
    over_noise: Test,
    disturbance: SlidingResidual | None,
    units: Units,
) -> tuple[str, ...]:
    """Return the sentences for the user."""
    warnings = list(diagnosis.warnings)
    if any(item.settings.name == PERIODIC_DISTURBANCE for item in effects):
        warnings.append(
            "the phase of periodic_disturbance is that of the first recording, and another in every run: leave the"
            " effect out of the file of the observer, unless the disturbance starts together with the observer"
        )
    if not whole.passed:
        warnings.append(
            f"unusable model: {gap.unweighted_after:.0f} % of the effort is unexplained; identify the axis first, or"
            " record more motion"
        )
    if disturbance is not None:
        warnings.append(
            "look for what moves the stage from outside (cables, compressed air, supply, floor), and at the log itself"
            f" (stamps, clipped values): {disturbance.sentence(units)}. The observer follows such a force"
        )
    is_judged = whole.passed and rest.passed and not (diagnosis.is_poor or diagnosis.is_contact_hidden)
    if verdict == "cannot_tell" and is_judged and not over_noise.passed:
        fit_what = (
            "Fit recordings with the same motion as the held-out ones"
            if gap.held_out == "held-out"
            else "Record the same motion several times: what repeats can be learnt"
        )
        warnings.append(
            f"the gap is {over_noise.value:.0f} times the noise, and the fitted recordings do not contain its cause."
            f" {fit_what}"
        )
    return tuple(warnings)


def _best_unnamed(diagnosis: Diagnosis, criteria: Criteria) -> Decision | None:
    """Return the rejected effect that predicts most of the held-out residual, or None if none surely does.

    Effects that another contact law can imitate do not count: the regression has the coordinates of a contact. Within
    the tolerance of the file nothing is missing.
    """
    if not diagnosis.final_state.held_out_motions:
        return None
    last = diagnosis.rounds[-1].decisions if diagnosis.rounds and diagnosis.rounds[-1].accepted is None else ()
    effects = [item for item in last if item.candidate.settings is not None]
    not_imitable = [item for item in effects if not is_confusable_with_contact(item.candidate.name)]
    missing = [item for item in not_imitable if not item.may_be_within_tolerance]
    sure = [item for item in missing if item.significant_share(criteria) > 0.0]
    return max(sure, key=lambda item: item.significant_share(criteria), default=None)


def _beyond_contact_test(data: GapData, rest: WeightedResidual, model: Model, free: FreeForm | None) -> Test:
    """Return the test that a regression over all coordinates predicts surely better than one over those of a contact.

    Where it does not, the remainder may be the difference between the contact law and that of the file. It predicts no
    better if it predicts nothing: then a map of what the contact holds at rest predicts all of the remainder.

    Args:
        data: recordings of the gap.
        rest: residual of ``model``.
        model: the model.
        free: significant regression over all coordinates, or None.
    """
    criteria, z_score = data.options.criteria, 0.0
    if free is not None:
        contact = data.free_form(CONTACT, rest, model)
        left = [rest.minus(one.predicted).blocks(criteria.block) for one in (contact, free)]
        z_score = improvement(*left).z_score
    title = "z-score of a better prediction than over the coordinates of a contact"
    return at_least("model", title, z_score, criteria.min_z_score)


def _share_added_by_refit(before: WeightedResidual, given: Sequence[Floats], criteria: Criteria) -> float:
    """Return the share of the squared gap that the refit adds to the gap of the given file; 0 if not significant.

    Args:
        before: residual of the file refitted within its tolerance.
        given: residual of the given file [N].
        criteria: thresholds.
    """
    back = improvement(before.blocks(criteria.block), replace(before, residual=given).blocks(criteria.block))
    return back.share if back.z_score > criteria.min_z_score else 0.0


def verdict_of(
    diagnosis: Diagnosis,
    effects: Sequence[Named],
    rest: Test,
    is_learnt: bool,
    whole: Test,
    trust: Sequence[Test],
    beyond_contact: Sequence[Test] = (),
    has_disturbance: bool = False,
) -> str:
    """Return the verdict.

    Args:
        diagnosis: the diagnosis.
        effects: named effects.
        rest: test of the predictable share of the remaining residual.
        is_learnt: whether a learnt map predicts a part of it that is not the contact's: neither what a resting stage
            holds, nor a function of the velocity alone, nor, behind an encoder that hides the contact, what its
            coordinates predict.
        whole: test of the share of the effort that the final model leaves unexplained.
        trust: tests that ``no_effect`` needs as well.
        beyond_contact: tests that ``unknown_effect`` needs as well, where nothing was learnt.
        has_disturbance: whether a force acts that does not repeat.
    """
    if diagnosis.is_poor:
        return "cannot_tell"
    if effects:
        return "ambiguous" if any(item.alternatives for item in effects) else "effect_found"
    if not whole.passed and not is_learnt:
        return "cannot_tell"
    if has_disturbance:
        return "unknown_effect"
    if not rest.passed:  # what an encoder hides of the contact is predictable too, as is another contact law
        may_be_contact = diagnosis.is_contact_hidden or not all(test.passed for test in beyond_contact)
        return "cannot_tell" if may_be_contact and not is_learnt else "unknown_effect"
    return "no_effect" if all(test.passed for test in trust) else "cannot_tell"
