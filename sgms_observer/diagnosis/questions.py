"""Questions of the report with their answers: data, convergence, credibility."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgms_observer.diagnosis.answer import Answer
from sgms_observer.diagnosis.audit import MIN_REVERSALS, reversals_of, travel_of
from sgms_observer.diagnosis.compensation_check import CompensationCheck
from sgms_observer.diagnosis.criteria import Test
from sgms_observer.diagnosis.decision import RANGE_END_TOLERANCE
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.final_model import UNEXPLAINED_WHILE_SLIDING
from sgms_observer.diagnosis.fit import Refit, limits
from sgms_observer.diagnosis.named import NINETY, Named
from sgms_observer.diagnosis.tracking import PredictedTracking, TrackingError
from sgms_observer.effects.catalogue import effect
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light
from sgms_observer.settings.units import Units

DATA, CONVERGENCE, BELIEVABILITY = "Data", "Convergence", "Believability"
MIN_TRACKING_CHANGE = 0.05
"""Smallest change of the predicted rms tracking error that counts, as a share of that with the file as given."""


def questions_of(
    answer: Answer,
    checks: Sequence[CompensationCheck],
    tracking: PredictedTracking | None,
    options: Options,
    units: Units,
) -> tuple[Light, ...]:
    """Return the questions with their answers.

    Args:
        answer: answer of the diagnosis.
        checks: errors of observer and compensation before and after.
        tracking: tracking error predicted in closed loop; None if the simulation diverges.
        options: options of the diagnosis.
        units: units of the axis.
    """
    return (
        _motion(answer, units),
        _held_out(answer),
        _fits(answer),
        _tolerance(answer, options),
        _explained(answer),
        *(_effect(item, answer, units) for item in answer.effects),
        *_changed(answer, units),
        _rest(answer, units),
        _feedforward(answer, checks, units),
        _tracking(tracking, units),
    )


def _test(answer: Answer, name: str) -> Test | None:
    """Return a test of the whole model, or None if it was not made."""
    return next((test for test in answer.tests if test.of == "model" and test.name.startswith(name)), None)


def _motion(answer: Answer, units: Units) -> Light:
    """Ask whether the recordings show friction."""
    diagnosis = answer.diagnosis
    motions = diagnosis.final_state.fit_motions
    seconds = sum(float(motion.time[-1]) for motion in motions)
    travel = units.readable(sum(map(travel_of, motions)))
    reversals = sum(map(reversals_of, motions))
    facts = f"{seconds:.3g} s with {travel} of travel and {reversals} reversals (at least {MIN_REVERSALS} are needed)."
    if diagnosis.is_poor:
        facts += "".join(f" {sentence[0].upper()}{sentence[1:]}." for sentence in diagnosis.warnings)
    return Light(DATA, "Do the recordings show the friction?", BAD if diagnosis.is_poor else GOOD, facts)


def _held_out(answer: Answer) -> Light:
    """Ask whether there are held-out recordings."""
    question = "Was the model judged on recordings that it was not fitted to?"
    if answer.diagnosis.final_state.held_out_motions:
        count = len(answer.diagnosis.final_state.held_out_motions)
        return Light(DATA, question, GOOD, f"{count} held-out recording{'s' if count > 1 else ''}.")
    return Light(DATA, question, UNSURE, "Cross-validated on halves. Give a separate recording with --holdout.")


def _fits(answer: Answer) -> Light:
    """Ask whether the fits converged."""
    written = answer.diagnosis.written
    fits = (("the file", written.before), ("the augmented model", written.after))
    open_ends = [name for name, fit in fits if not fit.is_converged]
    question = "Did the fits converge?"
    if not open_ends:
        return Light(CONVERGENCE, question, GOOD, "The last steps hardly reduced the squared residual.")
    ends = " and ".join(dict.fromkeys(open_ends))
    return Light(CONVERGENCE, question, UNSURE, f"The last step still reduced the squared residual of {ends}.")


def _tolerance(answer: Answer, options: Options) -> Light:
    """Ask whether the values of the file stayed inside their tolerance."""
    diagnosis = answer.diagnosis
    names = at_limit(diagnosis.written.before, options.tolerance)
    question = "Are the values of the file right within their tolerance?"
    inside = f"The refit before any effect stayed inside {100 * options.tolerance:.3g} %."
    if not names:
        return Light(CONVERGENCE, question, GOOD, inside)
    which, limit = (", ".join(names), "limits of their") if len(names) > 1 else (names[0], "limit of its")
    ends = f"{which} reached the {limit} {100 * options.tolerance:.3g} % tolerance before any effect was added."
    return Light(CONVERGENCE, question, UNSURE, ends)


def at_limit(fit: Refit, tolerance: float) -> list[str]:
    """Return the values of the file that a refit moved to the end of their tolerance, except elements.

    Args:
        fit: of the file, within its tolerance.
        tolerance: of its values.
    """
    names = fit.model.parameter_names()
    bound = limits(fit.model, tolerance)
    held = np.abs(fit.logs) >= bound * (1.0 - RANGE_END_TOLERANCE)
    return [name for name, is_held in zip(names, held, strict=True) if is_held and not name.startswith("element")]


def _explained(answer: Answer) -> Light:
    """Ask whether the model explains the effort."""
    test = _test(answer, "share of the effort that is unexplained")
    share = f"{answer.gap.unweighted_after:.3g} % of the rms effort is unexplained"
    if test is None:
        return Light(BELIEVABILITY, "Does the model explain the effort?", UNSURE, f"{share}.")
    state = GOOD if test.passed else BAD
    limit = f"{share} on {answer.gap.held_out} data; the limit is {100 * test.threshold:.3g} %."
    while_sliding = next((one for one in answer.tests if one.name == UNEXPLAINED_WHILE_SLIDING), None)
    if state == BAD and while_sliding is not None and while_sliding.passed:
        limit += f" With the weights of the gap, which hardly count a resting stage, {100 * while_sliding.value:.2g} %."
    return Light(BELIEVABILITY, "Does the model explain the effort?", state, limit)


def _effect(item: Named, answer: Answer, units: Units) -> Light:
    """Ask whether a named effect exists in the machine."""
    entry = effect(item.settings.name)
    values = {
        parameter.name: with_unit(value, parameter.unit, units)
        for parameter, value in zip(entry.parameters, item.settings.values, strict=False)
        if parameter.name not in item.undetermined
    }
    facts = [f"Confidence {item.confidence:.2f}."]
    if item.undetermined:
        facts.append(f"These recordings do not determine its {' and '.join(item.undetermined).replace('_', ' ')}.")
    score = next((test for test in accepted_tests(answer, entry.name) if test.name.startswith("z-score")), None)
    if score is not None:
        facts.append(
            f"With it the model predicts better by {score.value:.3g} standard errors, {score.threshold:.3g} are needed."
        )
    if np.isfinite(item.gap_after):
        facts.append(f"The gap falls from {item.gap_before:.3g} to {item.gap_after:.3g} %.")
    if item.alternatives:
        names = " or ".join(name.replace("_", " ") for name in item.alternatives)
        facts.insert(0, f"It could also be {names}.")
    return Light(BELIEVABILITY, entry.asked(values), UNSURE if item.alternatives else GOOD, " ".join(facts))


def accepted_tests(answer: Answer, name: str) -> tuple[Test, ...]:
    """Return the tests that an effect passed when it was added.

    Args:
        answer: answer of the diagnosis.
        name: of the effect.
    """
    for item in answer.diagnosis.rounds:
        if item.accepted is not None and item.accepted.candidate.name == name:
            return item.accepted.tests
    return ()


def with_unit(value: float, unit: str, units: Units) -> str:
    """Return a value with three digits and a prefixed unit: ``12.0 mm``.

    Args:
        value: in the unit without a prefix.
        unit: what it has on a prismatic axis; ``-`` for none.
        units: of the axis.
    """
    factor, name = units.prefixed(value, unit) if unit != "-" else (1.0, "")
    number = f"{value * factor:#.3g}" if 0.01 <= abs(value * factor) < 1000.0 else f"{value * factor:.3g}"
    return f"{number.rstrip('.')} {name}".strip()


def _changed(answer: Answer, units: Units) -> list[Light]:
    """Ask whether values of the file changed, if some did."""
    if not answer.changed:
        return []
    listed = []
    for item in answer.changed:
        if isinstance(item.before, str) or isinstance(item.after, str):
            listed.append(f"{item.name} from {item.before} to {item.after}")
            continue
        interval = f" (90 %: +- {NINETY * item.std_error:.2g})" if item.std_error > 0.0 else ""
        listed.append(
            f"{item.name} from {item.before:.3g} to {item.after:.3g} {units.of(item.unit)}".strip() + interval
        )
    return [Light(BELIEVABILITY, "Did values of the file change?", GOOD, f"{'; '.join(listed)}.")]


def _rest(answer: Answer, units: Units) -> Light:
    """Ask whether anything that was tried predicts the residual."""
    question = "Is the rest unpredictable?"
    rest, near = _test(answer, "surely predictable share of the residual"), _test(answer, "gap over noise")
    if rest is None or near is None:
        return Light(BELIEVABILITY, question, UNSURE, "It was not tested.")
    share, limit = f"{100 * max(rest.value, 0.0):.2g} %", f"limit {100 * rest.threshold:.3g} %"
    facts = (
        f"The best of the tried regressions predicts {share} of the squared residual ({limit})."
        if rest.value > 0.0
        else f"No tried regression predicts a significant part of the squared residual (0 %, {limit})."
    )
    facts += f" The rms of the residual is {near.value:.2g} times the noise (limit {near.threshold:.3g})."
    if not rest.passed:
        learnt = " A learnt map of it was added." if answer.learnt else " It has no name in the catalogue."
        return Light(BELIEVABILITY, question, UNSURE if answer.learnt else BAD, facts + learnt)
    if answer.disturbance is not None:
        return Light(BELIEVABILITY, question, BAD, f"{facts} But {answer.disturbance.sentence(units)}.")
    return Light(BELIEVABILITY, question, GOOD if near.passed else UNSURE, facts)


def _feedforward(answer: Answer, checks: Sequence[CompensationCheck], units: Units) -> Light:
    """Ask whether the feedforward leaves less friction with the new model."""
    before, after = (item.friction_not_cancelled for item in checks)
    facts = (
        f"Friction not cancelled by the feedforward along {checks[1].along}: {before:.3g} before,"
        f" {after:.3g} {units.effort} rms after, counted while it follows the motion"
        f" ({100.0 * checks[1].share:.0f} % of the time)."
    )
    question = "Does the feedforward leave less friction with the new model?"
    test = _test(answer, "friction not cancelled by the feedforward")
    if test is None:
        return Light(BELIEVABILITY, question, UNSURE, facts)
    if not test.passed:
        refused = " Effects that were found would leave more friction; they were not added."
        return Light(BELIEVABILITY, question, BAD, facts + refused)
    if after > before:
        return Light(BELIEVABILITY, question, UNSURE, f"{facts} That it leaves more may be chance.")
    is_significant = test.value <= -test.threshold
    limit = f"{-test.value:.3g} standard errors, and {test.threshold:.3g} are needed"
    chance = "" if is_significant else f" The decrease may be chance: it is {limit}."
    return Light(BELIEVABILITY, question, GOOD if is_significant else UNSURE, facts + chance)


def _tracking(tracking: PredictedTracking | None, units: Units) -> Light:
    """Ask whether compensation with the new model will improve tracking, against the file as it was given."""
    question = "Will compensation with the new model improve tracking?"
    if tracking is None:
        return Light(BELIEVABILITY, question, UNSURE, "The simulated loop does not stay finite.")
    without, given, augmented = tracking.without, tracking.given, tracking.augmented
    facts = (
        f"{_in_words(given, units)} with the file as given, {_in_words(augmented, units)} with augmented.yaml"
        f" ({_in_words(without, units)} without compensation)."
    )
    if augmented.rms > without.rms:
        return Light(BELIEVABILITY, question, BAD, f"Worse than without compensation: {facts}")
    if abs(augmented.rms - given.rms) <= MIN_TRACKING_CHANGE * given.rms:
        return Light(BELIEVABILITY, question, UNSURE, f"No change: {facts}")
    if augmented.rms > given.rms:
        return Light(BELIEVABILITY, question, BAD, f"Worse: {facts}")
    facts = f"Better: {facts}"
    if augmented.peak > without.peak:
        return Light(BELIEVABILITY, question, UNSURE, f"{facts} The peak is larger than without compensation.")
    if tracking.caution(units):
        return Light(BELIEVABILITY, question, UNSURE, f"{facts} The file's stage.controller may be another one.")
    return Light(BELIEVABILITY, question, GOOD, facts)


def _in_words(error: TrackingError, units: Units) -> str:
    """Return a predicted tracking error in words: ``7.12 um rms and 30 um peak``."""
    return f"{units.readable(error.rms)} rms and {units.readable(error.peak)} peak"
