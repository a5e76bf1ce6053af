"""Questions of the report of an identification with their answers."""

from __future__ import annotations

from dataclasses import dataclass

from sgms_observer.identification.answer import Answer
from sgms_observer.identification.identify import MAX_UNEXPLAINED
from sgms_observer.identification.trace import Traces, unexplained_share
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light
from sgms_observer.settings.units import Units

DATA, CONVERGENCE, BELIEVABILITY = "Data", "Convergence", "Believability"


@dataclass(frozen=True)
class Part:
    """Content of the report for one axis.

    Attributes:
        units: of the axis.
        name: the axis.
        answer: table, sentences, warnings.
        traces: model beside measurement.
        band_hz: upper corner of the judging band [Hz].
        unexplained: rms residual over rms effort on validation chunks; None for least squares.
        is_converged: whether the search converged; None for least squares.
    """

    units: Units
    name: str
    answer: Answer
    traces: Traces
    band_hz: float
    unexplained: float | None
    is_converged: bool | None


def questions_of(part: Part, of_axis: str) -> tuple[Light, ...]:
    """Return the questions about one axis with their answers.

    Args:
        part: the axis.
        of_axis: its name as the questions say it, `` of x``; empty where the report is about one axis.
    """
    return (_shown(part, of_axis), _held_out(part, of_axis), _converged(part, of_axis), *_explained(part, of_axis))


def _shown(part: Part, of_axis: str) -> Light:
    """Ask whether the parameters are identifiable."""
    missing = [row.name for row in part.answer.rows if not row.is_identifiable]
    count = len(part.answer.rows)
    question = f"Do the recordings show all parameters{of_axis}?"
    if not missing:
        return Light(DATA, question, GOOD, f"All {count} are known to 5 %.")
    return Light(DATA, question, UNSURE, f"{len(missing)} of {count} are not known to 5 %: {', '.join(missing)}.")


def _held_out(part: Part, of_axis: str) -> Light:
    """Ask whether there is a held-out recording."""
    question = f"Was the model{of_axis} judged on recordings that it did not learn from?"
    if part.traces.held_out:
        share = 100.0 * unexplained_share(part.traces.held_out)
        return Light(DATA, question, GOOD, f"{share:.3g} % of the rms {part.units.effort_word} is unexplained there.")
    return Light(DATA, question, UNSURE, "Name a recording of another motion with --holdout.")


def _converged(part: Part, of_axis: str) -> Light:
    """Ask whether the search converged."""
    question = f"Did the fit{of_axis} converge?"
    if part.is_converged is None:
        return Light(CONVERGENCE, question, GOOD, "Least squares needs no search.")
    if part.is_converged:
        return Light(CONVERGENCE, question, GOOD, "The last step was small against the parameters' intervals.")
    return Light(CONVERGENCE, question, BAD, "Rerun from the file that was written, or record longer.")


def _explained(part: Part, of_axis: str) -> list[Light]:
    """Ask whether the model explains the effort, and whether it may be used."""
    share, where = unexplained_share(part.traces.learnt), "on the fitted recordings"
    if part.traces.held_out:
        share, where = unexplained_share(part.traces.held_out), "on held-out recordings"
    elif part.unexplained is not None:
        share, where = part.unexplained, "on chunks left out of the fit"
    facts = (
        f"{100.0 * share:.3g} % of the rms {part.units.effort_word} is unexplained {where}; the limit is"
        f" {100.0 * MAX_UNEXPLAINED:.3g} %."
    )
    state = GOOD if share <= MAX_UNEXPLAINED else BAD
    reasons = "See the warnings." if part.answer.warnings else "Load it into the nodes."
    return [
        Light(BELIEVABILITY, f"Does the model{of_axis} explain the {part.units.effort_word}?", state, facts),
        Light(
            BELIEVABILITY,
            f"May the model{of_axis} be used as it is?",
            GOOD if part.answer.is_usable else BAD,
            "" if part.answer.is_usable and not part.answer.warnings else reasons,
        ),
    ]
