"""The answer of a diagnosis: gap, named effects with their tests, learnt maps, changed values and verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sgms_observer.diagnosis.advice import Named, detectable, next_experiment
from sgms_observer.diagnosis.changed import Changed, changed_values
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least, at_most
from sgms_observer.diagnosis.decision import Decision, rivals, within_range, z_score_between
from sgms_observer.diagnosis.diagnosis import Diagnosis, Options, Round
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import Refit, RefitSetup, data_with_noise_of, data_with_own_noise
from sgms_observer.diagnosis.free_form import ALL, FreeForm, free_form
from sgms_observer.diagnosis.gap import (
    Gap,
    WeightedResidual,
    effort_rms,
    halves,
    interval,
    noise_floors,
    residuals,
)
from sgms_observer.diagnosis.homing import homing_warnings
from sgms_observer.diagnosis.locate import Located, locate
from sgms_observer.diagnosis.map_fit import MAP_NAMES, FittedMap, fit_map, with_map
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.settings.axis import AxisSettings, EffectSettings

Floats = NDArray[np.float64]

NAMING = ("effect_found", "ambiguous")
"""Verdicts that name an effect."""
CROSS_STEPS = 4
"""Steps of the fit to one half of the recordings. The fit starts at the fit to the whole."""
MAX_LOCATED = 4
"""Largest number of reported coordinates."""
LOCATED_P_VALUE = 0.02
"""Largest p-value of a coordinate that is reported."""
ONE_RECORDING_CONFIDENCE = 0.9
"""Largest confidence without a held-out recording: nothing shows that the effect appears again."""


@dataclass(frozen=True)
class Answer:
    """The whole answer.

    Attributes:
        verdict: see docs/diagnosis.md.
        gap: given, before, after and floor.
        effects: the named effects.
        learnt: maps of a predictable force that no named effect explains.
        changed: values of the file that the fit moved beyond their tolerance.
        remainder: predictable residual that has no name: ``none``, ``learnt`` (by a map) or ``unknown``.
        located: significant coordinates over which the residual of the refitted file varies.
        all_located: every coordinate.
        located_after: the coordinates of ``located`` for the residual of the final model.
        detectable: smallest detectable size of each effect, as a share of the Coulomb force.
        next_experiment: one sentence, or None.
        tests: every test of every hypothesis and of the model.
        usable: whether the model may be used as it is.
        warnings: sentences for the user.
        model: the model that augmented.yaml holds.
        diagnosis: the diagnosis that the answer is made from.
        motions: recordings that the gap is computed on.
        residual_before, residual_after: residuals of these recordings [N].
        gap_with_learnt: gap of the model with effects and learnt maps [%].
    """

    verdict: str
    gap: Gap
    effects: tuple[Named, ...]
    learnt: tuple[FittedMap, ...]
    changed: tuple[Changed, ...]
    remainder: str
    located: tuple[Located, ...]
    all_located: tuple[Located, ...]
    located_after: tuple[Located, ...]
    detectable: dict[str, float]
    next_experiment: str | None
    tests: tuple[Test, ...]
    usable: bool
    warnings: tuple[str, ...]
    model: Model
    diagnosis: Diagnosis
    motions: tuple[Motion, ...]
    residual_before: tuple[Floats, ...]
    residual_after: tuple[Floats, ...]
    gap_with_learnt: float


@dataclass(frozen=True)
class _GapRecordings:
    """The recordings that the gap is computed on.

    Attributes:
        motions: held-out recordings, or halves of the recordings to learn from.
        diagnosis: the diagnosis.
        has_held_out: whether ``motions`` are held-out recordings.
    """

    motions: tuple[Motion, ...]
    diagnosis: Diagnosis
    has_held_out: bool

    def residuals(self, model: Model, setup: RefitSetup, effects: Sequence[EffectSettings]) -> tuple[Floats, ...]:
        """Return the residual of each motion. Halves are predicted with parameters fitted to the other halves."""
        if self.has_held_out:
            return residuals(model, self.motions)
        parts: list[Floats] = [np.zeros(0)] * len(self.motions)
        for side in (0, 1):
            learn_from = tuple(self.motions[i] for i in range(len(self.motions)) if i % 2 == side)
            again = replace(setup, data=data_with_own_noise(learn_from, model)).fit(effects, None, CROSS_STEPS)
            for i in range(len(self.motions)):
                if i % 2 != side:
                    parts[i] = residuals(again.model, (self.motions[i],))[0]
        return tuple(parts)


def answer_of(diagnosis: Diagnosis, axis: AxisSettings, options: Options, contradiction: Test | None = None) -> Answer:
    """Return the answer of a diagnosis, computed on data that nothing was fitted to.

    Args:
        diagnosis: the diagnosis.
        axis: the given settings.
        options: options of the diagnosis.
        contradiction: failed test of the final model. With it, the answer names no effect and learns no map.
    """
    criteria = options.criteria
    has_held_out = bool(diagnosis.final_state.held_out_motions)
    motions = (
        diagnosis.final_state.held_out_motions
        if has_held_out
        else tuple(h for motion in diagnosis.final_state.fit_motions for h in halves(motion))
    )
    recordings = _GapRecordings(motions, diagnosis, has_held_out)
    accepted = list(diagnosis.accepted)
    before_setup = replace(diagnosis.file_state.setup, nominal=diagnosis.nominal)
    given = residuals(replace(Model.of(axis), effects=diagnosis.file_effects), motions)
    before = recordings.residuals(diagnosis.written.before.model, before_setup, diagnosis.written.before.effects)
    model, fit = diagnosis.written.after.model, diagnosis.written.after
    after = (
        before if fit is diagnosis.written.before else recordings.residuals(model, diagnosis.written.setup, fit.effects)
    )
    tests = [test for item in diagnosis.rounds for decision in item.decisions for test in decision.tests]
    data = data_with_noise_of(motions, diagnosis.evaluation.fit_data, diagnosis.written.before.model)

    def left_by(parts: Sequence[Floats]) -> WeightedResidual:
        return WeightedResidual(motions, parts, data.gap_weights)

    def gap_of(parts: Sequence[Floats]) -> float:
        return left_by(parts).rms

    effort = effort_rms(motions, data.gap_weights)
    reduction = improvement(
        *(WeightedResidual(motions, parts, data.weights).blocks(criteria.block) for parts in (before, after))
    )
    whole_motions = diagnosis.final_state.held_out_motions or diagnosis.final_state.fit_motions
    (noise,) = noise_floors(
        whole_motions, diagnosis.final_state.current.model, diagnosis.final_state.setup.data.noise, options.seed,
        data.gap_weights if has_held_out else diagnosis.evaluation.fit_data.gap_weights,
    )  # fmt: skip

    noise = min(noise, gap_of(before), gap_of(after))  # a residual on data that nothing was fitted to bounds the noise

    def over_noise(parts: Sequence[Floats]) -> float:
        return gap_of(parts) / noise if noise > 0.0 else math.inf

    if fit is not diagnosis.written.before:
        names = ", ".join(item.accepted.candidate.name for item in diagnosis.rounds if item.accepted)
        test = at_least(names, "gap as reported: z-score", reduction.z_score, criteria.interval_z_score)
        part = at_most(names, "gap as reported, as a share of the effort", gap_of(after) / effort, 1.0)
        grown = at_most(names, "gap as reported, over the gap before", gap_of(after) / max(gap_of(before), 1e-300), 1.0)
        named = {item.accepted.candidate.name for item in accepted if item.accepted}
        inside = [
            within_range(item, diagnosis.final_state.fit_motions, diagnosis.nominal)
            for item in fit.effects
            if item.name in named
        ]
        explained = at_most(
            names, "share of the effort that is unexplained", gap_of(after) / effort, criteria.max_unexplained
        )
        stands_out_of_noise = at_least(names, "gap before over noise", over_noise(before), criteria.min_gap_over_floor)
        written = [test, part, grown, stands_out_of_noise, explained, *inside]
        tests += written
        is_confirmed = all(item.passed for item in written) and contradiction is None
        if not is_confirmed:  # the written model does not confirm the names
            accepted, model, fit, after = [], diagnosis.written.before.model, diagnosis.written.before, before
    rest_to_judge = left_by(after)

    def predict_rest(rest: WeightedResidual, mapped: Model) -> tuple[FreeForm, float]:
        """Return a free-form prediction of a residual and the share of its square that it significantly predicts."""
        free = _free_form_rest(diagnosis, mapped, rest, options)
        return free, free.improvement.share if free.improvement.z_score > criteria.min_z_score else 0.0

    free, predictable_share = predict_rest(rest_to_judge, model)
    stands_out = over_noise(after) >= criteria.min_gap_over_floor
    predictable_share = predictable_share if stands_out else 0.0
    learnt: list[FittedMap] = []
    final, total, share = model, after, predictable_share
    free_names = [] if diagnosis.is_poor or contradiction is not None else _free_names(fit.effects)
    while free_names and share > criteria.min_predictable_share:
        known = _fit_residual(diagnosis, final)
        evaluated = left_by(total) if has_held_out else known  # cross-validated by parts, not by halves
        another = fit_map(known, evaluated, free_names[0], axis.units, criteria)
        if another is None:
            break
        learnt = with_map(learnt, another, axis.units)
        free_names = _free_names([*fit.effects, *(item.settings for item in learnt)])
        final = model.with_effects([item.settings for item in learnt])
        total = residuals(final, motions)
        share = predict_rest(left_by(total), final)[1] if free_names else 0.0
    unnamed = _best_unnamed(diagnosis, criteria) if has_held_out and stands_out else None
    floor = _floor(
        noise, [gap_of(before), gap_of(after), gap_of(total)], rest_to_judge, free, predictable_share, unnamed
    )
    predictable_share = max(predictable_share, unnamed.significant_share(criteria) if unnamed else 0.0)
    percent = 100.0 / effort
    named_after = gap_of(after) * percent
    gap = Gap(
        gap_of(given) * percent, gap_of(before) * percent, named_after, min(floor * percent, named_after),
        noise * percent,
        interval(left_by(before), criteria, options.seed), interval(left_by(after), criteria, options.seed),
        "held-out" if has_held_out else "cross-validated", diagnosis.final_state.fit_motions[0].band,
        criteria.min_gap_over_floor,
    )  # fmt: skip
    whole = at_most("model", "share of the effort that is unexplained", 0.01 * gap.after, criteria.max_unexplained)
    rest = at_most("model", "surely predictable share of the rest", predictable_share, criteria.min_predictable_share)
    gap_over_noise = over_noise(after)
    near_noise = at_most(
        "model", "gap over noise, where nothing predicts it", gap_over_noise, criteria.max_gap_over_noise
    )
    added = _share_added_by_refit(left_by(before), given, criteria)
    added_by_refit = at_most(
        "model", "share of the squared gap that the refit adds", added, criteria.min_predictable_share
    )
    tests += [whole, rest, near_noise, added_by_refit, *([] if contradiction is None else [contradiction])]
    warnings = list(diagnosis.warnings)
    models = [decision.candidate.refit.model for item in diagnosis.rounds for decision in item.decisions]
    warnings += homing_warnings(models, diagnosis.evaluation, axis.units)
    if not whole.passed:
        warnings.append(
            f"unusable model: {gap.after:.0f} % of the effort is unexplained; identify the axis first, or record more"
            " motion"
        )
    effects = _named(diagnosis, accepted, fit, gap, lambda one: percent * gap_of(residuals(one, motions)))
    effects += _measured_quantisation(diagnosis)
    changed = changed_values(diagnosis, fit, options) if fit is not diagnosis.written.before else ()
    verdict = _verdict(diagnosis, effects, rest, bool(learnt), whole, (near_noise, added_by_refit))
    if verdict == "cannot_tell" and whole.passed and not diagnosis.is_poor:
        warnings.append(
            f"the gap is {gap_over_noise:.0f} times the noise, and the recordings to learn from do not show why: learn"
            " from recordings with the motion that is judged"
        )
    remainder = "none" if rest.passed else "learnt" if learnt else "unknown"
    everywhere = locate(before, motions, options.seed)
    is_alarm = verdict not in ("no_effect", "cannot_tell")
    significant = [item for item in everywhere if item.p_value < LOCATED_P_VALUE][:MAX_LOCATED] if is_alarm else []
    afterwards = {item.coordinate: item for item in locate(total, motions, options.seed)}
    return Answer(
        verdict, gap, tuple(effects), tuple(learnt), tuple(changed), remainder, tuple(significant), tuple(everywhere),
        tuple(afterwards[item.coordinate] for item in significant if item.coordinate in afterwards),
        detectable(diagnosis, axis, options), next_experiment(verdict, effects, significant, diagnosis, axis.units),
        tuple(tests), whole.passed and not diagnosis.is_poor, tuple(warnings), final, diagnosis, motions, before, total,
        percent * gap_of(total),
    )  # fmt: skip


def _fit_residual(diagnosis: Diagnosis, model: Model) -> WeightedResidual:
    """Return the residual of a model on the recordings to learn from."""
    return WeightedResidual(
        diagnosis.final_state.fit_motions,
        residuals(model, diagnosis.final_state.fit_motions),
        diagnosis.evaluation.fit_data.gap_weights,
    )


def _free_form_rest(diagnosis: Diagnosis, model: Model, rest: WeightedResidual, options: Options) -> FreeForm:
    """Return what a free-form regression over all coordinates predicts of the remaining residual."""
    known = _fit_residual(diagnosis, model) if diagnosis.final_state.held_out_motions else rest
    return free_form(ALL, known, rest, options.criteria, options.seed)


def _floor(
    noise: float,
    left: Sequence[float],
    rest: WeightedResidual,
    free: FreeForm,
    predictable_share: float,
    unnamed: Decision | None,
) -> float:
    """Return the rms residual that no predictor removes [N]: the larger of noise and smallest residual of a predictor.

    Args:
        noise: rms residual of a perfect model, from noise and encoder [N].
        left: rms residual of each model [N].
        rest: residual of the model with the named effects.
        free: what a free-form regression predicts of ``rest``.
        predictable_share: share of the squared ``rest`` that the regression significantly predicts.
        unnamed: effect without a name that predicts the largest significant share of ``rest``, or None.
    """
    gaps = list(left)
    if predictable_share > 0.0:
        gaps.append(rest.minus(free.predicted).rms)
    if unnamed is not None:
        gaps.append(rest.rms * math.sqrt(max(0.0, 1.0 - unnamed.reported.share)))
    return max(noise, min(gaps))


def _best_unnamed(diagnosis: Diagnosis, criteria: Criteria) -> Decision | None:
    """Return the rejected effect that predicts the largest significant share of the rest, or None."""
    last = diagnosis.rounds[-1].decisions if diagnosis.rounds and diagnosis.rounds[-1].accepted is None else ()
    sure = [item for item in last if item.candidate.settings is not None and item.significant_share(criteria) > 0.0]
    return max(sure, key=lambda item: item.significant_share(criteria), default=None)


def _free_names(effects: Sequence[EffectSettings]) -> list[str]:
    """Return the names of learnt maps that the model does not use yet."""
    used = {item.name for item in effects}
    return [name for name in MAP_NAMES if name not in used]


def _share_added_by_refit(before: WeightedResidual, given: Sequence[Floats], criteria: Criteria) -> float:
    """Return the share of the squared gap that the refit adds to the gap of the given file; 0 if not significant.

    Args:
        before: residual of the file refitted within its tolerance.
        given: residual of the given file [N].
        criteria: thresholds.
    """
    back = improvement(before.blocks(criteria.block), replace(before, residual=given).blocks(criteria.block))
    return back.share if back.z_score > criteria.min_z_score else 0.0


def _verdict(
    diagnosis: Diagnosis, effects: Sequence[Named], rest: Test, is_learnt: bool, whole: Test, trust: Sequence[Test]
) -> str:
    """Return the verdict.

    Args:
        diagnosis: the diagnosis.
        effects: named effects.
        rest: test of the predictable share of the remaining residual.
        is_learnt: whether a learnt map predicts a part of it.
        whole: test of the share of the effort that the final model leaves unexplained.
        trust: tests that ``no_effect`` needs as well.
    """
    if diagnosis.is_poor:
        return "cannot_tell"
    if effects:
        return "ambiguous" if any(item.alternatives for item in effects) else "effect_found"
    if not whole.passed and not is_learnt:
        return "cannot_tell"
    if not rest.passed:
        return "unknown_effect"
    return "no_effect" if all(test.passed for test in trust) else "cannot_tell"


def _named(
    diagnosis: Diagnosis,
    accepted: Sequence[Round],
    fit: Refit,
    gap: Gap,
    gap_with: Callable[[Model], float],
) -> list[Named]:
    """Return the accepted effects in the order in which they reduce the gap most, each beside those before it.

    Args:
        diagnosis: the diagnosis.
        accepted: rounds that named an effect.
        fit: model with all of them.
        gap: gap before and after.
        gap_with: function that returns the gap of a model on the same recordings [%].
    """
    rounds = {item.accepted.candidate.name: item for item in accepted if item.accepted}
    left, listed, last = list(rounds), list[Named](), gap.before
    while left:
        gaps = {left[0]: gap.after}
        if len(left) > 1:
            others = [[one for one in left if one != name] for name in left]
            gaps = {
                name: gap_with(replace(fit.model, effects=tuple(e for e in fit.model.effects if e.name not in later)))
                for name, later in zip(left, others, strict=True)
            }
        name = min(gaps, key=lambda one: gaps[one])
        listed.append(_as_named(diagnosis, fit, rounds, name, last, gaps[name]))
        last = gaps[name]
        left.remove(name)
    return listed


def _as_named(
    diagnosis: Diagnosis, fit: Refit, rounds: Mapping[str, Round], name: str, before: float, after: float
) -> Named:
    """Return one accepted effect.

    Args:
        diagnosis: the diagnosis.
        fit: model with all accepted effects.
        rounds: round that accepted each effect.
        name: the effect.
        before, after: gap without and with it [%].
    """
    item = rounds[name]
    assert item.accepted is not None
    index = [one.name for one in fit.effects].index(name)
    settings = fit.effects[index]
    std = tuple(diagnosis.written.errors.get((index, j), 0.0) for j in range(len(settings.values)))
    others = [
        z_score_between(item.accepted, other)
        for other in rivals(item.accepted, item.decisions)
        if other.candidate.name not in rounds
    ]
    confidence = float(np.prod([stats.norm.cdf(z) for z in others])) if others else 1.0
    confidence = min(confidence, float(stats.norm.cdf(item.accepted.improvement.z_score)))
    if not diagnosis.final_state.held_out_motions:
        confidence = min(confidence, ONE_RECORDING_CONFIDENCE)
    alternatives = tuple(one for one in item.alternatives if one not in rounds)
    return Named(settings, std, confidence, alternatives, before, after)


def _measured_quantisation(diagnosis: Diagnosis) -> list[Named]:
    """Return the quantisation effect if the positions lie on a coarser grid than the settings say."""
    if diagnosis.resolution is None or diagnosis.is_poor:
        return []
    settings = EffectSettings("quantisation", (diagnosis.resolution,))
    return [Named(settings, (0.005 * diagnosis.resolution,), 0.99, (), math.nan, math.nan)]
