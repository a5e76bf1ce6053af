"""The report of an identification: measured beside modelled effort, friction over velocity and position, the fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.identification.answer import Answer, Row
from sgms_observer.identification.trace import Trace, Traces, unexplained_share
from sgms_observer.report.drawing import ESTIMATE, MEASURED, REFERENCE, sheet
from sgms_observer.report.page import Picture, Section, Table, render_page
from sgms_observer.settings.units import Units
from sgms_observer.whole_file import write_text

Floats = NDArray[np.float64]

_BINS = 14  # of the velocity, in each direction
_SLOWEST = 1.0e-3  # of the largest velocity: the slowest bin
_FEWEST = 5  # rows of a bin that is drawn
_MOST_DOTS = 20_000  # of a picture


@dataclass(frozen=True)
class Part:
    """What the report shows of one axis.

    Attributes:
        units: of the axis.
        name: the axis.
        answer: table, sentences, warnings.
        traces: model beside measurement.
        band_hz: upper corner of the judging band [Hz].
        unexplained: rms residual over rms effort on chunks that did not teach; None for least squares.
    """

    units: Units
    name: str
    answer: Answer
    traces: Traces
    band_hz: float
    unexplained: float | None


def report_path(yaml: str | Path, is_overwriting: bool) -> Path:
    """Return where the report goes: ``report.html`` beside its YAML, ``NAME_report.html`` where another one is there.

    Args:
        yaml: the parameter file, ``NAME.yaml``.
        is_overwriting: what is there may be replaced.
    """
    path = Path(yaml)
    plain, own = path.with_name("report.html"), path.with_name(f"{path.stem}_report.html")
    return own if own.exists() or (plain.exists() and not is_overwriting) else plain


def write_report(
    parts: Sequence[Part], path: Path, yaml: str, learnt: Sequence[str], held_out: Sequence[str]
) -> None:
    """Write the report as one page.

    Args:
        parts: one for each axis.
        path: the page.
        yaml: the parameter file that was written.
        learnt: recordings that taught.
        held_out: recordings that did not.
    """
    sections = [section for part in parts for section in _sections(part, len(parts) > 1)]
    source = f"{Path(yaml).name} from {_listed(learnt)}"
    if held_out:
        source += f", judged on {_listed(held_out)}"
    verdict = " ".join(_verdict(part) for part in parts)
    title = f"Identification of {'axis' if len(parts) == 1 else 'axes'} {', '.join(part.name for part in parts)}"
    write_text(render_page(title, verdict, sections, f"{source}."), path)


def _listed(names: Sequence[str]) -> str:
    """Return the names of recordings."""
    return ", ".join(Path(name).name for name in names)


def _percent(share: float) -> str:
    """Return the fit in % that belongs to an unexplained share."""
    return f"{100.0 * (1.0 - share):.1f} %"


def _verdict(part: Part) -> str:
    """Return the fit of one axis in one sentence."""
    fits = [f"{_percent(unexplained_share(part.traces.learnt))} on what taught"]
    if part.unexplained is not None:
        fits.append(f"{_percent(part.unexplained)} on chunks left out of it")
    if part.traces.held_out:
        fits.append(f"{_percent(unexplained_share(part.traces.held_out))} on held-out recordings")
    usable = "" if part.answer.is_usable else " The model must not be used as it is."
    return f"{part.name}: fit {', '.join(fits)}.{usable}"


def _sections(part: Part, has_several: bool) -> list[Section]:
    """Return the sections of one axis."""
    word = part.units.effort_word
    of_axis = f" of {part.name}" if has_several else ""
    sections = []
    if part.answer.warnings:
        sections.append(Section(f"Warnings{of_axis}", part.answer.warnings))
    definition = (
        f"Fit: 100 % minus the rms residual in % of the rms {word}, both below {part.band_hz:.4g} Hz. The residual is"
        f" the measured minus the modelled {word}."
    )
    pictures = [_over_time(part, part.traces.learnt, "learnt", "on what taught")]
    if part.traces.held_out:
        pictures.append(_over_time(part, part.traces.held_out, "held_out", "on held-out recordings"))
    sections.append(Section(f"Fit{of_axis}", [definition], [_fits(part)], pictures))
    sliding = (
        f"Friction: measured {word} minus what mass, offset and effects of the model take of it. Dots: rows where the"
        " axis has moved so far one way that every element slips, and no reversal is near, at which the low-pass rings."
        " Points: their mean in each range of velocity, with the standard deviation. Line: the model."
    )
    loops = f"The same friction, of all rows: measured and modelled {word} behind the same low-pass."
    sections.append(Section(f"Friction over velocity{of_axis}", [sliding], [], [_over_velocity(part)]))
    sections.append(Section(f"Friction over position{of_axis}", [loops], [], [_over_position(part)]))
    header = ("parameter", "value", "95 % interval", "unit", "shown by the recording")
    table = Table(header, [_row(row) for row in part.answer.rows])
    sections.append(Section(f"Parameters{of_axis}", part.answer.summary, [table]))
    return sections


def _row(row: Row) -> tuple[str, str, str, str, str]:
    """Return one parameter as a row of the table."""
    interval = f"+- {row.half_width:.2g}" if math.isfinite(row.half_width) else "none"
    shown = "yes" if row.is_shown else f"no{f': {row.note}' if row.note else ''}"
    return row.name, f"{row.value:.6g}", interval, row.unit, shown


def _fits(part: Part) -> Table:
    """Return the fit of each piece."""
    unit = part.units.effort
    rows = []
    for use, traces in (("taught", part.traces.learnt), ("held out", part.traces.held_out)):
        for trace in traces:
            rms = float(np.sqrt(np.mean(trace.residual**2)))
            seconds = f"{trace.time[-1] - trace.time[0]:.4g}"
            rows.append((trace.name, use, seconds, f"{rms:.4g}", _percent(unexplained_share([trace]))))
    return Table(("recording", "use", "seconds", f"rms residual [{unit}]", "fit"), rows)


def _over_time(part: Part, traces: Sequence[Trace], name: str, where: str) -> Picture:
    """Draw measured and modelled effort and the residual over time, one piece after the other."""
    units = part.units
    caption = f"Measured and modelled {units.effort_word} of {part.name}, and the residual, {where}."
    with sheet(f"{part.name}_{name}", caption, rows=2, height=2.5, sharex=True) as drawn:
        start = 0.0
        for number, trace in enumerate(traces):
            time = start + trace.time - trace.time[0]
            measured, modelled = ("measured", "modelled") if number == 0 else (None, None)
            drawn.axes[0].plot(time, trace.effort, color=MEASURED, lw=1.0, label=measured)
            drawn.axes[0].plot(time, trace.modelled, color=ESTIMATE, lw=0.8, label=modelled)
            drawn.axes[1].plot(time, trace.residual, color=REFERENCE, lw=0.8)
            start = float(time[-1])
        drawn.axes[0].set_ylabel(f"{units.effort_word} [{units.effort}]")
        drawn.axes[0].legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
        drawn.axes[1].set_ylabel(f"residual [{units.effort}]")
        drawn.axes[1].set_xlabel("time [s]")
    assert drawn.picture is not None
    return drawn.picture


def _thinned(values: Floats) -> Floats:
    """Return so few values that a picture can hold them."""
    return values[:: max(1, len(values) // _MOST_DOTS)]


def sliding_rows(traces: Traces) -> tuple[Floats, Floats]:
    """Return velocity and measured friction of the rows that taught and where the axis slides.

    Args:
        traces: of the axis.
    """
    velocity = np.concatenate([trace.velocity[trace.is_sliding] for trace in traces.learnt])
    return velocity, np.concatenate([trace.friction[trace.is_sliding] for trace in traces.learnt])


def stribeck_points(velocity: Floats, friction: Floats) -> tuple[Floats, Floats, Floats]:
    """Return mean velocity, mean friction and its standard deviation in each range of velocity, slow ones narrower.

    Args:
        velocity: of rows where the axis slides.
        friction: of the same rows.
    """
    top = float(np.max(np.abs(velocity), initial=0.0))
    points = []
    if top > 0.0:
        edges = np.concatenate(([0.0], top * np.geomspace(_SLOWEST, 1.0 + 1e-9, _BINS)))
        for low, high in pairwise(edges):
            for sign in (-1.0, 1.0):
                inside = (sign * velocity > low) & (sign * velocity <= high)
                if np.sum(inside) >= _FEWEST:
                    points.append((velocity[inside].mean(), friction[inside].mean(), friction[inside].std()))
    ordered = np.array(sorted(points)).reshape(-1, 3)
    return ordered[:, 0], ordered[:, 1], ordered[:, 2]


def _over_velocity(part: Part) -> Picture:
    """Draw friction over velocity: rows, their means and the model's curve."""
    units = part.units
    velocity, friction = sliding_rows(part.traces)
    top = max(float(np.max(np.abs(trace.velocity))) for trace in part.traces.learnt)
    none = "" if len(velocity) else " It never slides so far and so long one way that a row counts."
    caption = f"Friction of {part.name} over velocity while sliding, on what taught.{none}"
    with sheet(f"{part.name}_stribeck", caption) as drawn:
        axes = drawn.axes[0]
        axes.plot(_thinned(velocity), _thinned(friction), ".", color=REFERENCE, ms=1.5, alpha=0.4, label="rows")
        centre, mean, spread = stribeck_points(velocity, friction)
        axes.errorbar(centre, mean, spread, fmt="o", color=MEASURED, ms=4, lw=1.0, label="measured, mean")
        for sign in (-1.0, 1.0):
            line = sign * top * np.geomspace(_SLOWEST, 1.0, 200)
            axes.plot(line, part.traces.curve(line), color=ESTIMATE, label="model" if sign > 0.0 else None)
        axes.set_xlabel(f"velocity [{units.velocity}]")
        axes.set_ylabel(f"friction [{units.effort}]")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    assert drawn.picture is not None
    return drawn.picture


def _over_position(part: Part) -> Picture:
    """Draw the hysteresis: measured and modelled friction over position."""
    units, traces = part.units, part.traces.learnt
    caption = f"Friction of {part.name} over position, on what taught: the loops that it draws."
    with sheet(f"{part.name}_hysteresis", caption) as drawn:
        axes = drawn.axes[0]
        for number, trace in enumerate(traces):
            measured, modelled = ("measured", "modelled") if number == 0 else (None, None)
            axes.plot(trace.position, trace.friction, color=MEASURED, lw=0.7, label=measured)
            axes.plot(trace.position, trace.modelled_friction, color=ESTIMATE, lw=0.7, label=modelled)
        axes.set_xlabel(f"position [{units.position}]")
        axes.set_ylabel(f"friction [{units.effort}]")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    assert drawn.picture is not None
    return drawn.picture
