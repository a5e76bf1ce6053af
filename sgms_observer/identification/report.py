"""The report of an identification: the fit, measured beside modelled effort, friction over velocity and position."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.identification.answer import Row
from sgms_observer.identification.questions import Part, questions_of
from sgms_observer.identification.trace import Trace, Traces, unexplained_share
from sgms_observer.report.friction_pictures import (
    SLOWEST,
    hysteresis,
    measured_against_modelled,
    over_velocity,
    residual_over_position,
)
from sgms_observer.report.page import Page, Picture, Plot, Section, Table
from sgms_observer.report.time_plot import Line, Panel, one_after_another, time_plot, with_holes

Floats = NDArray[np.float64]


def report_path(yaml: str | Path, is_overwriting: bool) -> Path:
    """Return the path of the report: ``report.html`` beside its YAML, or ``NAME_report.html`` if that exists.

    Args:
        yaml: the parameter file, ``NAME.yaml``.
        is_overwriting: whether an existing report may be replaced.
    """
    path = Path(yaml)
    plain, named = path.with_name("report.html"), path.with_name(f"{path.stem}_report.html")
    return named if named.exists() or (plain.exists() and not is_overwriting) else plain


def identification_page(parts: Sequence[Part], yaml: str, learnt: Sequence[str], held_out: Sequence[str]) -> Page:
    """Return the report.

    Args:
        parts: one for each axis.
        yaml: the parameter file that was written.
        learnt: recordings that the model was fitted to.
        held_out: held-out recordings.
    """
    source = f"{Path(yaml).name} from {_listed(learnt)}"
    if held_out:
        source += f", judged on {_listed(held_out)}"
    of_axis = {part.name: f" of {part.name}" if len(parts) > 1 else "" for part in parts}
    return Page(
        f"Identification of {'axis' if len(parts) == 1 else 'axes'} {', '.join(part.name for part in parts)}",
        " ".join(_verdict(part) for part in parts),
        [section for part in parts for section in _sections(part, of_axis[part.name])],
        f"{source}.",
        [f"{warning}." for part in parts for warning in part.answer.warnings],
        [light for part in parts for light in questions_of(part, of_axis[part.name])],
    )


def _listed(names: Sequence[str]) -> str:
    """Return the names of recordings."""
    return ", ".join(Path(name).name for name in names)


def _percent(share: float) -> str:
    """Return the fit in % for an unexplained share."""
    return f"{100.0 * (1.0 - share):.1f} %"


def _verdict(part: Part) -> str:
    """Return the fit of one axis in one sentence."""
    word = part.units.effort_word
    fits = [f"{_percent(unexplained_share(part.traces.learnt))} of the {word} on the fitted recordings"]
    if part.unexplained is not None:
        fits.append(f"{_percent(part.unexplained)} on chunks left out of the fit")
    if part.traces.held_out:
        fits.append(f"{_percent(unexplained_share(part.traces.held_out))} on held-out recordings")
    usable = "" if part.answer.is_usable else " The model must not be used as it is."
    return f"The model of {part.name} explains {', '.join(fits)}.{usable}"


def _sections(part: Part, of_axis: str) -> list[Section]:
    """Return the sections of one axis."""
    word = part.units.effort_word
    definition = (
        f"Fit: 100 % minus the rms residual in % of the rms {word}, both below {part.band_hz:.4g} Hz. The residual is"
        f" the measured minus the modelled {word}."
    )
    plots = [_over_time(part, part.traces.learnt, "learnt", "on the fitted recordings")]
    pictures = [_beside_each_other(part, part.traces.learnt, "learnt", "on the fitted recordings")]
    if part.traces.held_out:
        plots.append(_over_time(part, part.traces.held_out, "held_out", "on held-out recordings"))
        pictures.append(_beside_each_other(part, part.traces.held_out, "held_out", "on held-out recordings"))
    sliding = (
        f"Friction: measured {word} minus what mass, offset and effects of the model take of it. Dots: rows where the"
        " axis has moved so far one way that every element slips, and no reversal is near, at which the low-pass rings."
        " Points: their mean in each range of velocity, with the standard deviation. Line: the model. Over position:"
        f" the same friction of all rows, measured and modelled {word} behind the same low-pass."
    )
    header = ("parameter", "value", "95 % interval", "unit", "shown by the recording")
    table = Table(header, [_row(row) for row in part.answer.rows])
    return [
        Section(f"Fit{of_axis}", [definition], [_fits(part)], pictures, plots),
        Section(f"Friction over velocity and position{of_axis}", [sliding], pictures=_friction(part)),
        Section(f"Parameters{of_axis}", part.answer.summary, [table]),
    ]


def _row(row: Row) -> tuple[str, str, str, str, str]:
    """Return one parameter as a row of the table."""
    interval = f"+- {row.half_width:.2g}" if math.isfinite(row.half_width) else "none"
    shown = "yes" if row.is_identifiable else f"no{f': {row.note}' if row.note else ''}"
    return row.name, f"{row.value:.6g}", interval, row.unit, shown


def _fits(part: Part) -> Table:
    """Return the fit of each piece."""
    unit = part.units.effort
    rows = []
    for use, traces in (("fitted", part.traces.learnt), ("held out", part.traces.held_out)):
        for trace in traces:
            rms = float(np.sqrt(np.mean(trace.residual**2)))
            seconds = f"{trace.time[-1] - trace.time[0]:.4g}"
            rows.append((trace.name, use, seconds, f"{rms:.4g}", _percent(unexplained_share([trace]))))
    return Table(("recording", "use", "seconds", f"rms residual [{unit}]", "fit"), rows)


def _over_time(part: Part, traces: Sequence[Trace], name: str, where: str) -> Plot:
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


def _beside_each_other(part: Part, traces: Sequence[Trace], name: str, where: str) -> Picture:
    """Draw measured over modelled effort."""
    caption = f"Measured over modelled {part.units.effort_word} of {part.name}, {where}."
    fit = 100.0 * (1.0 - unexplained_share(traces))
    return measured_against_modelled(
        f"{part.name}_{name}_fit", caption, _all(traces, "effort"), _all(traces, "modelled"), fit, part.units
    )


def sliding_rows(traces: Traces) -> tuple[Floats, Floats]:
    """Return velocity and measured friction of the fitted rows where the axis slides.

    Args:
        traces: of the axis.
    """
    velocity = np.concatenate([trace.velocity[trace.is_sliding] for trace in traces.learnt])
    return velocity, np.concatenate([trace.friction[trace.is_sliding] for trace in traces.learnt])


def _friction(part: Part) -> list[Picture]:
    """Draw friction over velocity and over position, and the residual over position."""
    units, traces = part.units, part.traces.learnt
    top = max(float(np.max(np.abs(trace.velocity))) for trace in traces)
    lines = [sign * top * np.geomspace(SLOWEST, 1.0, 200) for sign in (-1.0, 1.0)]
    curves = [(line, part.traces.curve(line)) for line in lines]
    sliding = f"Friction of {part.name} over velocity while sliding, on the fitted recordings."
    loops = f"Friction of {part.name} over position, on the fitted recordings."
    residual = f"Residual of {part.name} in even bins of the position, with its standard error, by direction."
    looped = [
        with_holes([getattr(one, key) for one in traces]) for key in ("position", "friction", "modelled_friction")
    ]
    binned = [_all(traces, key) for key in ("position", "velocity", "residual")]
    return [
        over_velocity(f"{part.name}_stribeck", sliding, *sliding_rows(part.traces), curves, units),
        hysteresis(f"{part.name}_hysteresis", loops, looped[0], looped[1], looped[2], units),
        residual_over_position(f"{part.name}_residual", residual, binned[0], binned[1], binned[2], units),
    ]


def _all(traces: Sequence[Trace], key: str) -> Floats:
    """Return a signal of all pieces."""
    return np.concatenate([getattr(trace, key) for trace in traces])
