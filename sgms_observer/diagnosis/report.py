"""The report of a diagnosis: one page, the answer first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from sgms_observer.diagnosis.answer import ADDED_BY_REFIT, BEHIND_ENCODER, OVER_NOISE, UNEXPLAINED, Answer
from sgms_observer.diagnosis.compensation_check import CompensationCheck
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.final_model import DIFFERS_BY_DIRECTION
from sgms_observer.diagnosis.named import Named
from sgms_observer.diagnosis.questions import questions_of
from sgms_observer.diagnosis.report_pictures import (
    effect_over_position,
    friction_pictures,
    gap_bar,
    located_pictures,
    map_picture,
    measured_over_modelled,
    over_time,
    tracking_plot,
)
from sgms_observer.diagnosis.report_tables import (
    changed_table,
    detectable_table,
    effect_tables,
    gap_table,
    located_table,
    refit_table,
    screening_table,
    test_tables,
)
from sgms_observer.diagnosis.traces import Trace
from sgms_observer.diagnosis.tracking import PredictedTracking
from sgms_observer.effects.catalogue import effect
from sgms_observer.report.page import Page, Section, Table
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import Units


@dataclass(frozen=True)
class Run:
    """Input and options of a diagnosis.

    Attributes:
        axis: settings with the given model.
        options: options of the diagnosis.
        names: names of the recordings.
        notes: sentences about how the recordings were read.
    """

    axis: AxisSettings
    options: Options
    names: Sequence[str]
    notes: Sequence[str]


def diagnosis_page(
    answer: Answer,
    traces: Sequence[Trace],
    checks: Sequence[CompensationCheck],
    tracking: PredictedTracking | None,
    run: Run,
) -> Page:
    """Return the report.

    Args:
        answer: answer of the diagnosis.
        traces: model and measurement of the recordings that the gap is computed on.
        checks: errors of observer and compensation before and after.
        tracking: tracking error predicted in closed loop; None if the simulation diverges.
        run: input and options.
    """
    units = run.axis.units
    source = f"From {', '.join(Path(name).name for name in run.names)}; seed {run.options.seed}."
    return Page(
        f"Diagnosis of axis {run.axis.name}",
        sentence(answer, units),
        [
            Section("What to do next", [next_step(answer)]),
            _answer(answer, units),
            _tracking(tracking, units),
            _fit(answer, traces, units),
            _where(answer, units),
            _not_shown(answer),
            _decisions(answer, run),
        ],
        source,
        [f"Warning: {text}." for text in answer.warnings],
        questions_of(answer, checks, tracking, run.options, units),
        [gap_bar(answer), effect_over_position(answer, traces, units)],
    )


def _tracking(tracking: PredictedTracking | None, units: Units) -> Section:
    """Return the section on the tracking error predicted in closed loop."""
    heading = "Tracking error predicted in closed loop"
    if tracking is None:
        return Section(heading, ["The simulated loop does not stay finite with stage.controller of the file."])
    rows = [
        (text, units.readable(error.rms), units.readable(error.peak))
        for text, error in (
            ("recorded", tracking.recorded),
            ("without compensation", tracking.without),
            ("with that of the file as given", tracking.given),
            ("with that of augmented.yaml", tracking.augmented),
        )
        if error is not None
    ]
    controller = tracking.of_controller or " with stage.controller of the file"
    text = [
        f"The stage that augmented.yaml describes follows {tracking.along} for {tracking.seconds:.3g} s{controller} and"
        " the compensation's gain and limit."
    ]
    plots = [tracking_plot(tracking, units)] if tracking.errors else []
    return Section(heading, text, [Table(("tracking error", "rms", "peak"), rows)], plots=plots)


def sentence(answer: Answer, units: Units) -> str:
    """Return the verdict in one sentence."""
    gap = answer.gap
    shrink = f"the gap on {gap.held_out} data falls from {gap.before:.3g} % to {gap.after:.3g} % of the rms effort"
    match answer.verdict:
        case "effect_found":
            with_it = "it" if len(answer.effects) == 1 else "them"
            if any(_is_of_file(item, answer) for item in answer.effects):
                with_it = "the new values"
            return f"{_found_in_words(answer)}: with {with_it}, {shrink}.{_remainder_in_words(answer)}"
        case "ambiguous":
            pairs = " and ".join(
                f"{item.settings.name} from {' or '.join(item.alternatives)}".replace("_", " ")
                for item in answer.effects
                if item.alternatives
            )
            return (
                f"{_found_in_words(answer, ' something like')}, but these recordings cannot tell {pairs}; {shrink}."
                f"{_remainder_in_words(answer)}"
            )
        case "unknown_effect":
            if answer.disturbance and not answer.learnt:
                outside = answer.disturbance.sentence(units)
                return f"The model misses something that no recorded signal predicts: {outside}."
            where = f", most visibly over {answer.located[0].coordinate}" if answer.located else ""
            return f"The model misses something that has no name in the catalogue{where}.{_learnt_in_words(answer)}"
        case "cannot_tell":
            if answer.usable and answer.remainder != "none" and not answer.diagnosis.is_contact_hidden:
                return (
                    "These recordings cannot show whether the model misses anything: what predicts the rest of the gap"
                    f" ({gap.after:.3g} % of the rms effort) may be another contact law than that of the file."
                    f"{_learnt_in_words(answer)}"
                )
            return f"These recordings cannot show whether the model misses anything{_reasons(answer)}."
        case _:
            if answer.changed:
                values = _listed([item.name for item in answer.changed])
                return (
                    "No effect is missing that these recordings could show, but the fit moves"
                    f" {values} beyond the tolerance of the file: {shrink}."
                )
            return (
                f"Nothing is missing that these recordings could show; the gap is {gap.after:.3g} % of the rms effort."
                f"{_beyond_noise_in_words(answer)}"
            )


def _is_of_file(item: Named, answer: Answer) -> bool:
    """Return whether the file lists a named effect, so that its value is wrong and nothing is missing."""
    return item.settings.name in {one.name for one in answer.diagnosis.file_effects}


def _found_in_words(answer: Answer, like: str = "") -> str:
    """Return what was found as the beginning of a sentence: missing effects, and effects of the file that are wrong.

    Args:
        answer: the answer.
        like: what is put in front of the missing effects.
    """
    wrong, missing = (
        [item.settings.name.replace("_", " ") for item in answer.effects if _is_of_file(item, answer) == is_of_file]
        for is_of_file in (True, False)
    )
    parts = [f"the model misses{like} {_listed(missing)}"] if missing else []
    parts += [f"the {_listed(wrong)} of the file {'is' if len(wrong) == 1 else 'are'} wrong"] if wrong else []
    text = " and ".join(parts)
    return f"{text[0].upper()}{text[1:]}"


def _beyond_noise_in_words(answer: Answer) -> str:
    """Return what the noise alone would leave as a sentence that follows another one; empty where that is the gap.

    Above twice the noise more than three quarters of the squared gap are something else.
    """
    gap, criteria = answer.gap, answer.diagnosis.evaluation.criteria
    if gap.after <= criteria.max_sliding_over_noise * gap.noise:
        return ""
    return (
        f" The noise alone would leave {gap.noise:.3g} %: the rest is a force that no recorded signal predicts, or"
        " another contact law than that of the file."
    )


def _reasons(answer: Answer) -> str:
    """Return why the verdict is ``cannot_tell``, as the end of a sentence; empty where a warning says it."""
    gap = answer.gap
    sentences = {
        UNEXPLAINED: f"the model leaves {gap.unweighted_after:.3g} % of the effort unexplained",
        OVER_NOISE: "the gap is far above the noise, and nothing predicts it",
        ADDED_BY_REFIT: (
            f"with the file refitted within its tolerance the gap is {gap.before:.3g} % of the rms effort, and"
            f" {gap.given:.3g} % with the file as given"
        ),
        BEHIND_ENCODER: "the encoder hides the contact",
    }
    failed = [test.name for test in answer.tests if not test.passed and test.name in sentences]
    if UNEXPLAINED in failed:
        failed = [UNEXPLAINED]
    elif answer.remainder != "none":
        failed = [name for name in failed if name != OVER_NOISE]
    return f": {'; '.join(sentences[name] for name in failed)}" if failed else ""


def _remainder_in_words(answer: Answer) -> str:
    """Return what is left beside the named effects as a sentence that follows another one; empty where nothing is."""
    if not answer.learnt:
        failed = [test.of for test in answer.tests if test.name == DIFFERS_BY_DIRECTION and not test.passed]
        names = _listed([name.replace("_", " ") for name in failed])
        return f" Beside {names}, the force along the position differs between the directions." if failed else ""
    maps = "a learnt map" if len(answer.learnt) == 1 else "learnt maps"
    left = f"with {maps} of it, {answer.gap_with_learnt:.3g} % is left"
    is_of_contact = all(item.is_of_contact for item in answer.learnt)
    law = ", which may be another contact law than that of the file" if is_of_contact else ""
    return f" Beside that, something without a name is missing{law}: {left}."


def _learnt_in_words(answer: Answer) -> str:
    """Return what was learnt as a sentence that follows another one; empty where nothing was."""
    if not answer.learnt:
        return ""
    sentences = "; and ".join(item.sentence for item in answer.learnt)
    maps = "a learnt map of it was" if len(answer.learnt) == 1 else "learnt maps of them were"
    return f" It looks like {sentences}; {maps} added."


def _listed(names: Sequence[str]) -> str:
    """Return names as a list in words."""
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def next_step(answer: Answer) -> str:
    """Return the next step for the user in one or two sentences."""
    nothing = "Load augmented.yaml into the nodes." if answer.usable else "Identify the axis first."
    return answer.next_experiment or nothing


def _answer(answer: Answer, units: Units) -> Section:
    """Return the section on the result: the gap, the effects, the learnt maps."""
    gap = answer.gap
    (low, high), (least, most) = gap.interval_before, gap.interval_after
    text = [
        f"Gap: measured minus modelled effort below {gap.band:.4g} Hz on {gap.held_out} data, rms, in % of the rms"
        f" measured effort. With the file refitted within its tolerance it is {gap.before:.3g} % (90 % interval"
        f" {low:.3g} to {high:.3g} %), with the effects and changed values {gap.after:.3g} % ({least:.3g} to"
        f" {most:.3g} %)" + (f", and with learnt maps {answer.gap_with_learnt:.3g} %." if answer.learnt else "."),
        "Samples at rest have a smaller weight where their residual scatters more than in motion. With equal weights"
        f" the gap is {gap.unweighted_before:.3g} % before and {gap.unweighted_after:.3g} % after.",
    ]
    for item in answer.effects:
        entry = effect(item.settings.name)
        text.append(f"{entry.name}: {entry.equation}. Place: {entry.place.value}. Shows as: {entry.signature}.")
    for learnt in answer.learnt:
        text.append(f"Learnt: {learnt.sentence}. It closes {100.0 * learnt.share:.0f} % of the squared residual.")
        if learnt.formula:
            text.append(f"A short formula predicts as well as this map: {learnt.formula.text}.")
    maps = [map_picture(learnt, units) for learnt in answer.learnt]
    return Section(
        "What the model misses",
        text,
        [*effect_tables(answer, units), *changed_table(answer, units), gap_table(answer)],
        maps,
    )


def _fit(answer: Answer, traces: Sequence[Trace], units: Units) -> Section:
    """Return the section on measured and modelled effort."""
    word = units.effort_word
    text = (
        f"Fit: 100 % minus the gap. The file as it was given fits {100.0 - answer.gap.given:.2f} %, refitted within its"
        f" tolerance {100.0 - answer.gap.before:.2f} %, with everything found {100.0 - answer.gap_with_learnt:.2f} %."
        f" The residual is the measured minus the modelled {word}. residual.mcap holds these signals for PlotJuggler"
        " and Foxglove."
    )
    pictures = [measured_over_modelled(answer, traces, units), *friction_pictures(traces, answer.model.friction, units)]
    return Section(f"Measured and modelled {word}", [text], (), pictures, [over_time(traces, units)])


def _where(answer: Answer, units: Units) -> Section:
    """Return the section on the coordinates that the residual depends on."""
    text = (
        "Residual of the refitted file over each coordinate, with the range that holds 95 % of it where it depends on"
        " nothing."
    )
    if not answer.located:
        text += " It depends on nothing beyond chance."
    tables = [located_table(answer, units)] if answer.located else []
    return Section(
        "Where the residual is", [text], tables, located_pictures(answer, units), is_folded=not answer.located
    )


def _not_shown(answer: Answer) -> Section:
    """Return the folded section on the smallest detectable effects."""
    text = (
        "Effects with a smaller peak than these would not have been seen: they pass for noise, for another contact law,"
        " or for values of the file that are slightly off."
    )
    return Section("What these recordings could not show", [text], [detectable_table(answer)], is_folded=True)


def _decisions(answer: Answer, run: Run) -> Section:
    """Return the folded section with notes, noise and every test."""
    diagnosis = answer.diagnosis
    noise = diagnosis.evaluation.fit_data.noise
    text = [*run.notes, *diagnosis.notes]
    unit = run.axis.units.effort
    text += [f"Noise below the band {item.rms:.3g} {unit} rms, corner {item.corner:.0f} Hz." for item in noise]
    tables = [*test_tables(answer), refit_table(answer, run.options), *screening_table(answer)]
    return Section("Everything the run decided", text, tables, is_folded=True)
