"""The page of a replay: whether the model fits, friction and compensation over time, and the recorded outputs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Page, Plot, Section, Table
from sgms_observer.report.recorded import SETTLE
from sgms_observer.report.replay_view import (
    COMPENSATION,
    FRICTION,
    INNOVATION,
    POSITION,
    SET_POINT,
    STD,
    TIME,
    AxisView,
    Recorded,
)
from sgms_observer.report.run_pictures import hysteresis_picture, reversal_picture
from sgms_observer.report.time_plot import Line, Panel, time_plot
from sgms_observer.status import MAX_NIS, Status

Floats = NDArray[np.float64]


def replay_page(
    views: Sequence[AxisView],
    figures: Mapping[str, Mapping[str, float]],
    statuses: Mapping[str, Mapping[int, int]],
    recorded: Mapping[str, Recorded],
    notes: Sequence[str],
    source: str,
) -> Page:
    """Return the page.

    Args:
        views: one for each axis.
        figures: name of each axis to its figures, as ``sgms replay --json`` prints them.
        statuses: name of each axis to the number of its samples in each status.
        recorded: name of each axis to its recorded outputs.
        notes: sentences about the recording.
        source: what was replayed with what, for the footer.
    """
    names = [view.axis.name for view in views]
    of_axis = {name: f" of {name}" if len(names) > 1 else "" for name in names}
    verdicts: list[str] = []
    lights: list[Light] = []
    sections: list[Section] = []
    for view, name in zip(views, names, strict=True):
        verdicts.append(_verdict(view, figures[name], recorded[name]))
        lights += _lights(of_axis[name], figures[name], statuses[name], recorded[name])
        sections.append(_section(view, of_axis[name], figures[name], recorded[name], notes))
    title = f"Replay of {'axis' if len(names) == 1 else 'axes'} {', '.join(names)}"
    return Page(title, " ".join(verdicts), sections, source, lights=lights)


def _verdict(view: AxisView, figures: Mapping[str, float], recorded: Recorded) -> str:
    """Return the outcome of one axis in a sentence or two."""
    unit, size = view.axis.units.effort, max(abs(view.lowest), abs(view.highest))
    word = "fits" if figures["nis"] <= MAX_NIS else "does not fit"
    share = f" ({100.0 * figures['innovation'] / size:.3g} % of the largest friction)" if 0.0 < size < math.inf else ""
    innovation = f"{figures['innovation']:.3g} {unit} rms{share}"
    verdict = f"The model of {view.axis.name} {word} the recording: it predicts the friction to {innovation}."
    if math.isfinite(recorded.error):
        verdict += f" The estimated friction is {recorded.error:.3g} {unit} rms from the simulated truth."
    return verdict


def _lights(
    of_axis: str, figures: Mapping[str, float], statuses: Mapping[int, int], recorded: Recorded
) -> Sequence[Light]:
    """Return the questions about one axis."""
    fits = figures["nis"] <= MAX_NIS
    answer = f"NIS is {figures['nis']:.3g}; it is near 1 where the observer knows its own uncertainty."
    if not fits:
        answer += f" Above {MAX_NIS:g} the model lacks something (run sgms diagnose) or a parameter is wrong."
    found = [Light("Model", f"Does the model{of_axis} fit this recording?", GOOD if fits else BAD, answer)]
    trouble = {code: n for code, n in statuses.items() if code not in (Status.RUNNING, Status.STARTING)}
    sentences = "; ".join(f"{n} samples: {Status(code).sentence}" for code, n in sorted(trouble.items()))
    state = UNSURE if trouble else GOOD
    answer = f"{sentences}." if trouble else f"All {figures['samples']:.0f} samples were used."
    found.append(Light("Samples", f"Did the observer{of_axis} run on good samples throughout?", state, answer))
    if recorded.compared:
        is_same = recorded.same == recorded.compared
        answer = f"{recorded.same} of {recorded.compared} recorded estimates come again to the last bit."
        if not is_same:
            answer += " The live observer had other parameters, began earlier, or received other samples."
        state = GOOD if is_same else UNSURE
        found.append(Light("Live run", f"Does the replay{of_axis} give what the live observer gave?", state, answer))
    if math.isfinite(recorded.late_share):
        answer = f"{100.0 * recorded.late_share:.3g} % of the samples got their compensation late."
        state = UNSURE if recorded.late_share else GOOD
        found.append(Light("Live run", f"Did every compensation{of_axis} come in time?", state, answer))
    return found


def _section(
    view: AxisView, of_axis: str, figures: Mapping[str, float], recorded: Recorded, notes: Sequence[str]
) -> Section:
    """Return the section of one axis."""
    name, last = view.axis.name, view.recent(recorded.truth)
    text = [
        "The observer ran over the recording as the live node does. The innovation is the measured minus the predicted"
        f" {view.axis.units.effort_word} of friction, at each correction.",
        *(f"Note: {note}." for note in notes),
    ]
    pictures = (hysteresis_picture(last, f"{name}_"), reversal_picture(last, f"{name}_"))
    tables, plots = [_table(view, figures, recorded)], [_over_time(view, recorded)]
    return Section(f"Friction and compensation{of_axis}", text, tables, pictures, plots)


def _table(view: AxisView, figures: Mapping[str, float], recorded: Recorded) -> Table:
    """Return the figures of one axis."""
    units, compensation = view.axis.units, view.axis.compensation
    unit = units.effort
    limit = f"limit {compensation.limit:g} {unit}" if compensation.enabled else "switched off in the file"
    rows = [
        ("friction", f"{view.lowest:.4g} to {view.highest:.4g} {unit}"),
        ("innovation, rms", f"{figures['innovation']:.4g} {unit}"),
        ("NIS", f"{figures['nis']:.3g}"),
        ("largest compensation", f"{view.largest_compensation:.4g} {unit} ({limit})"),
    ]
    if math.isfinite(view.tracking_rms):
        peak = view.tracking_peak
        sizes = [units.readable(size, largest=peak) for size in (view.tracking_rms, peak)]
        rows.append(("tracking error in the recording", f"{sizes[0]} rms, {sizes[1]} peak"))
    if math.isfinite(recorded.error):
        rows.append((f"estimated minus true friction after {SETTLE:g} s, rms", f"{recorded.error:.4g} {unit}"))
    if recorded.compared:
        rows.append(("replayed minus recorded friction, rms", f"{recorded.difference:.4g} {unit}"))
    if math.isfinite(recorded.late_share):
        rows.append(("samples with a late compensation", f"{100.0 * recorded.late_share:.3g} %"))
    rows.append(("samples, corrections", f"{figures['samples']:.0f}, {figures['corrections']:.0f}"))
    return Table(("figure", "value"), rows)


def _over_time(view: AxisView, recorded: Recorded) -> Plot:
    """Return the signals of one axis over time."""
    rows, units = view.rows, view.axis.units
    unit = units.effort
    band = 2.0 * rows[:, STD]
    friction = [
        Line("+2 sigma", rows[:, FRICTION] + band, "reference"),
        Line("-2 sigma", rows[:, FRICTION] - band, "soft"),
        *([] if recorded.truth is None else [Line("true", view.truth_at_rows(recorded.truth), "ink")]),
        Line("estimated", rows[:, FRICTION], "estimate"),
    ]
    panels = [
        Panel(f"friction [{unit}]", friction),
        Panel(f"innovation [{unit}]", [Line("measured - predicted", _held(rows[:, INNOVATION]), "measured")]),
    ]
    if view.largest_compensation > 0.0:
        panels.append(Panel(f"compensation [{unit}]", [Line("compensation", rows[:, COMPENSATION], "accent")]))
    factor, name = units.prefixed(float(np.nanmax(np.abs(rows[:, POSITION]), initial=0.0)))
    position = [Line("measured", factor * rows[:, POSITION], "measured")]
    if math.isfinite(view.tracking_rms):
        position.append(Line("set-point", factor * rows[:, SET_POINT], "reference"))
        error_factor, error_name = units.prefixed(view.tracking_peak)
        error = error_factor * (rows[:, POSITION] - rows[:, SET_POINT])
        panels.append(Panel(f"error [{error_name}]", [Line("position - set-point", error, "measured")]))
    panels.insert(0, Panel(f"position [{name}]", position))
    caption = "Measured motion, estimated friction with two standard deviations, and the error of its prediction."
    return time_plot(f"{view.axis.name}_replay", caption, rows[:, TIME], panels)


def _held(values: Floats) -> Floats:
    """Return values with those between two corrections held, so that a line can be drawn."""
    place = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return values[place]
