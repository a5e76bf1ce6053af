"""The report of an identification: questions with their answers, the fit, and friction over velocity and position."""

from __future__ import annotations

import math
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.identification.answer import Answer
from sgms_observer.identification.identify import MAX_UNEXPLAINED
from sgms_observer.identification.table import Row
from sgms_observer.identification.trace import Trace, Traces, unexplained_share, unexplained_variation
from sgms_observer.report.drawing import Line, Panel, one_after_another, time_plot, with_holes
from sgms_observer.report.friction_pictures import (
    SLOWEST,
    hysteresis,
    measured_against_modelled,
    over_velocity,
    residual_over_position,
)
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Page, Picture, Plot, Section, Table
from sgms_observer.report.reversal_picture import presliding_distance, reversal_picture
from sgms_observer.settings.units import Units

DATA, CONVERGENCE, BELIEVABILITY = "Data", "Convergence", "Believability"


@dataclass(frozen=True)
class IdentifiedAxis:
    """What was found for one axis.

    Attributes:
        name: the axis.
        units: of the axis.
        answer: changes, table, sentences, warnings.
        traces: model beside measurement.
        band_hz: upper corner of the band [Hz].
        unexplained: rms residual over rms effort on validation chunks [-]; None for least squares.
        unexplained_variation: rms residual over rms effort about its mean there [-]; None for least squares.
        is_converged: whether the search converged; None for least squares, which needs none.
        notes: sentences about the recordings.
    """

    name: str
    units: Units
    answer: Answer
    traces: Traces
    band_hz: float
    unexplained: float | None
    unexplained_variation: float | None
    is_converged: bool | None
    notes: tuple[str, ...]

    @property
    def held_out(self) -> float | None:
        """Return the rms residual over the rms effort on held-out recordings [-]; None without any."""
        return unexplained_share(self.traces.held_out) if self.traces.held_out else None


def report_path(yaml: str | Path, is_overwriting: bool) -> Path:
    """Return the path of the report: ``report.html`` beside its YAML, or ``NAME_report.html`` if that exists.

    Args:
        yaml: the parameter file, ``NAME.yaml``.
        is_overwriting: whether an existing report may be replaced.
    """
    path = Path(yaml)
    plain, named = path.with_name("report.html"), path.with_name(f"{path.stem}_report.html")
    return named if named.exists() or (plain.exists() and not is_overwriting) else plain


def identification_page(
    parts: Sequence[IdentifiedAxis],
    yaml: str,
    learnt: Sequence[str],
    held_out: Sequence[str],
    has_other_axes: bool = False,
) -> Page:
    """Return the report.

    Args:
        parts: the identified axes.
        yaml: the written parameter file.
        learnt: fitted recordings.
        held_out: held-out recordings.
        has_other_axes: whether the file has axes that were not identified.
    """
    source = f"{Path(yaml).name} from {_listed(learnt)}"
    if held_out:
        source += f", judged on {_listed(held_out)}"
    of_axis = {part.name: f" of {part.name}" if len(parts) > 1 else "" for part in parts}
    return Page(
        f"Identification of {'axis' if len(parts) == 1 else 'axes'} {', '.join(part.name for part in parts)}",
        " ".join(_verdict(part) for part in parts),
        [
            Section("What to do next", _next_steps(parts, yaml, learnt, held_out, has_other_axes)),
            *(section for part in parts for section in _sections(part, of_axis[part.name])),
        ],
        f"{source}.",
        [f"{warning}." for part in parts for warning in part.answer.warnings],
        [light for part in parts for light in _questions(part, of_axis[part.name])],
        [picture for part in parts for picture in _lead(part)],
    )


def _next_steps(
    parts: Sequence[IdentifiedAxis], yaml: str, learnt: Sequence[str], held_out: Sequence[str], has_other_axes: bool
) -> list[str]:
    """Return the next step and its commands, one for each axis; arguments as for ``identification_page``."""
    usable = [part.name for part in parts if part.answer.is_usable]
    text = [
        f"Do not use the model of {part.name}: follow the warnings, and identify it again."
        for part in parts
        if not part.answer.is_usable
    ]
    if not usable:
        return text
    text.append("Find out which effects the model misses, with a recording of another motion for --holdout:")
    for name in usable:
        words = ["sgms", "diagnose", *learnt, "--config", yaml, "--holdout", *(held_out or ["OTHER"])]
        is_named = has_other_axes or len(parts) > 1
        words += ["--axis", name] if is_named else []
        text.append(shlex.join([*words, "--out", f"diagnosis_{name}" if is_named else "diagnosis"]))
    return text


def _listed(names: Sequence[str]) -> str:
    """Return the names of recordings."""
    return ", ".join(Path(name).name for name in names)


def _percent(share: float) -> str:
    """Return the fit in % for an unexplained share."""
    return f"{100.0 * (1.0 - share):.1f} %"


def _verdict(part: IdentifiedAxis) -> str:
    """Return the fit of one axis in one sentence."""
    word = part.units.effort_word
    fits = [f"{_percent(unexplained_share(part.traces.learnt))} of the {word} on the fitted recordings"]
    if part.unexplained is not None:
        fits.append(f"{_percent(part.unexplained)} on chunks left out of the fit")
    if part.traces.held_out:
        fits.append(f"{_percent(unexplained_share(part.traces.held_out))} on held-out recordings")
    usable = "" if part.answer.is_usable else " The model must not be used as it is."
    return f"The model of {part.name} explains {', '.join(fits)}.{usable}"


def _lead(part: IdentifiedAxis) -> list[Picture]:
    """Return the pictures that show the fit of one axis at a glance."""
    return [_beside_each_other(part, part.traces.learnt, "learnt", "on the fitted recordings"), _over_velocity(part)]


def _sections(part: IdentifiedAxis, of_axis: str) -> list[Section]:
    """Return the sections of one axis."""
    word = part.units.effort_word
    definition = (
        f"Fit: 100 % minus the rms residual in % of the rms {word}, both below {part.band_hz:.4g} Hz. The residual is"
        f" the measured minus the modelled {word}."
    )
    plots = [_over_time(part, part.traces.learnt, "learnt", "on the fitted recordings")]
    pictures = []
    if part.traces.held_out:
        plots.append(_over_time(part, part.traces.held_out, "held_out", "on held-out recordings"))
        pictures.append(_beside_each_other(part, part.traces.held_out, "held_out", "on held-out recordings"))
    sliding = (
        f"Friction: measured {word} minus what mass, offset and effects of the model take of it. Dots: rows where the"
        " axis has moved so far one way that every element slips, and no reversal is near, where the low-pass filter"
        " rings. Points: their mean in each range of velocity, with the standard deviation. Line: the model. Over"
        f" position: the same friction of all rows, measured and modelled {word} after the same low-pass filter."
    )
    header = ("parameter", "value", "95 % interval", "unit", "interval within 5 %?")
    table = Table(header, [_row(row) for row in part.answer.rows])
    return [
        Section(f"Fit{of_axis}", [definition], [_fits(part)], pictures, plots),
        Section(f"Friction over velocity and position{of_axis}", [sliding], pictures=_friction(part)),
        Section(f"Parameters{of_axis}", part.answer.summary, [table]),
    ]


def _row(row: Row) -> tuple[str, str, str, str, str]:
    """Return one parameter as a row of the table."""
    interval = f"+- {row.half_width:.2g}" if math.isfinite(row.half_width) else "none"
    shown = "not identifiable" if row.keeps_start_value else "no"
    shown = "yes" if row.is_identifiable else f"{shown}{f': {row.note}' if row.note else ''}"
    return row.name, f"{row.value:.6g}", interval, row.unit, shown


def _fits(part: IdentifiedAxis) -> Table:
    """Return the fit of each piece."""
    unit = part.units.effort
    rows = []
    for use, traces in (("fitted", part.traces.learnt), ("held out", part.traces.held_out)):
        for trace in traces:
            rms = float(np.sqrt(np.mean(trace.residual**2)))
            seconds = f"{trace.time[-1] - trace.time[0]:.4g}"
            rows.append((trace.name, use, seconds, f"{rms:.4g}", _percent(unexplained_share([trace]))))
    return Table(("recording", "use", "seconds", f"rms residual [{unit}]", "fit"), rows)


def _over_time(part: IdentifiedAxis, traces: Sequence[Trace], name: str, where: str) -> Plot:
    """Return measured and modelled effort, residual and velocity over time, one piece after the other."""
    units = part.units

    def line(label: str, values: Callable[[Trace], Floats], colour: str, factor: float = 1.0) -> Line:
        return Line(label, factor * with_holes([values(one) for one in traces]), colour)

    speed, unit = units.prefixed(max(float(np.max(np.abs(one.velocity))) for one in traces), "m/s")
    panels = [
        Panel(
            f"{units.effort_word} [{units.effort}]",
            [
                line("measured", lambda one: one.effort, "measured"),
                line("modelled", lambda one: one.modelled, "estimate"),
            ],
        ),
        Panel(f"residual [{units.effort}]", [line("residual", lambda one: one.residual, "reference")]),
        Panel(f"velocity [{unit}]", [line("velocity", lambda one: one.velocity, "ink", speed)]),
    ]
    caption = f"Measured and modelled {units.effort_word} of {part.name}, and the residual, {where}."
    return time_plot(f"{part.name}_{name}", caption, one_after_another([one.time for one in traces]), panels)


def _beside_each_other(part: IdentifiedAxis, traces: Sequence[Trace], name: str, where: str) -> Picture:
    """Draw measured over modelled effort."""
    caption = f"Measured over modelled {part.units.effort_word} of {part.name}, {where}."
    fit = 100.0 * (1.0 - unexplained_share(traces))
    return measured_against_modelled(
        f"{part.name}_{name}_fit", caption, _all(traces, "effort"), _all(traces, "modelled"), fit, part.units
    )


def sliding_rows(traces: Traces) -> tuple[Floats, Floats]:
    """Return velocity and measured friction of the fitted rows where the axis slides."""
    velocity = np.concatenate([trace.velocity[trace.is_sliding] for trace in traces.learnt])
    return velocity, np.concatenate([trace.friction[trace.is_sliding] for trace in traces.learnt])


def _over_velocity(part: IdentifiedAxis) -> Picture:
    """Draw friction over velocity."""
    top = max(float(np.max(np.abs(trace.velocity))) for trace in part.traces.learnt)
    lines = [sign * top * np.geomspace(SLOWEST, 1.0, 200) for sign in (-1.0, 1.0)]
    curves = [(line, part.traces.curve(line)) for line in lines]
    sliding = f"Friction of {part.name} over velocity while sliding, on the fitted recordings."
    return over_velocity(f"{part.name}_stribeck", sliding, *sliding_rows(part.traces), curves, part.units)


def _friction(part: IdentifiedAxis) -> list[Picture]:
    """Draw friction and residual over position."""
    units, traces = part.units, part.traces.learnt
    loops = f"Friction of {part.name} over position, on the fitted recordings."
    residual = f"Residual of {part.name} in even bins of the position, with its standard error, by direction."
    looped = [
        with_holes([getattr(one, key) for one in traces]) for key in ("position", "friction", "modelled_friction")
    ]
    binned = [_all(traces, key) for key in ("position", "velocity", "residual")]
    reversal = _reversal(part)
    return [
        hysteresis(f"{part.name}_hysteresis", loops, looped[0], looped[1], looped[2], units),
        *([reversal] if reversal else []),
        residual_over_position(f"{part.name}_residual", residual, binned[0], binned[1], binned[2], units),
    ]


def _reversal(part: IdentifiedAxis) -> Picture | None:
    """Draw one reversal magnified; None for a model without elements, or where no reversal has enough rows."""
    values = {row.name: row.value for row in part.answer.rows}
    stiffness, share = (
        [value for name, value in values.items() if name.startswith(f"friction.element_{key}[")]
        for key in ("stiffness", "fraction")
    )
    if not stiffness:
        return None
    distance = presliding_distance(stiffness, [values["friction.static_force"] * one for one in share])
    pieces = [(one.position, one.friction, one.modelled_friction) for one in part.traces.learnt]
    return reversal_picture(f"{part.name}_reversal", pieces, distance, part.units)


def _all(traces: Sequence[Trace], key: str) -> Floats:
    """Return a signal of all pieces."""
    return np.concatenate([getattr(trace, key) for trace in traces])


def _questions(part: IdentifiedAxis, of_axis: str) -> tuple[Light, ...]:
    """Return the questions about one axis with their answers; ``of_axis`` is empty where the report is about one."""
    return (_shown(part, of_axis), _held_out(part, of_axis), _converged(part, of_axis), *_explained(part, of_axis))


def _shown(part: IdentifiedAxis, of_axis: str) -> Light:
    """Ask whether the parameters are identifiable."""
    missing = [row.name for row in part.answer.rows if not row.is_identifiable]
    count = len(part.answer.rows)
    question = f"Do the recordings show all parameters{of_axis}?"
    if not missing:
        return Light(DATA, question, GOOD, f"All {count} are known to 5 %.")
    names = dict.fromkeys(name.removeprefix("friction.").partition("[")[0] for name in missing)  # elements once
    return Light(DATA, question, UNSURE, f"{len(missing)} of {count} are not known to 5 %: {', '.join(names)}.")


def _held_out(part: IdentifiedAxis, of_axis: str) -> Light:
    """Ask whether there is a held-out recording."""
    question = f"Was the model{of_axis} judged on recordings that it was not fitted to?"
    if part.traces.held_out:
        count = len(part.traces.held_out)
        return Light(DATA, question, GOOD, f"{count} held-out recording{'s' if count > 1 else ''}.")
    return Light(DATA, question, UNSURE, "Name a recording of another motion with --holdout.")


def _converged(part: IdentifiedAxis, of_axis: str) -> Light:
    """Ask whether the search converged."""
    question = f"Did the fit{of_axis} converge?"
    if part.is_converged is None:
        return Light(CONVERGENCE, question, GOOD, "Least squares needs no search.")
    if part.is_converged:
        return Light(CONVERGENCE, question, GOOD, "The last step was small against the parameters' intervals.")
    return Light(CONVERGENCE, question, BAD, "Rerun from the file that was written, or record longer.")


def _explained(part: IdentifiedAxis, of_axis: str) -> list[Light]:
    """Ask whether the model explains the effort, and whether it may be used."""
    share, where = unexplained_variation(part.traces.learnt), "on the fitted recordings"
    if part.traces.held_out:
        share, where = unexplained_variation(part.traces.held_out), "on held-out recordings"
    elif part.unexplained_variation is not None:
        share, where = part.unexplained_variation, "on chunks left out of the fit"
    facts = (
        f"{100.0 * share:.3g} % of the rms {part.units.effort_word} about its mean is unexplained {where}; the limit is"
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
