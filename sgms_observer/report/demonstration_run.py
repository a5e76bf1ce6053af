"""A demonstration's recording: signals of each axis, errors, replay; and the page and result.json about them."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.reader import BagSamples
from sgms_observer.errors import DataError
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.report.demonstration import (
    MIN_RECORDED_SHARE,
    Half,
    axis_result,
    change,
    headline,
    late_warnings,
    missing_warnings,
    on_the_way,
    readable_errors,
    result_of,
)
from sgms_observer.report.drawing import Line, Panel, time_plot
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Page, Picture, Plot, Section, Table, write_page
from sgms_observer.report.recorded import SETTLE, Lateness, recorded_lateness, signal_of
from sgms_observer.report.run_pictures import Run, Tracking, largest_prefixed, run_pictures, tracking_picture
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.whole_file import write_text

RESULT = "result.json"


@dataclass(frozen=True)
class Presentation:
    """Result of a demonstration.

    Attributes:
        lines: for the terminal.
        warnings: sentences that start with ``Warning:``.
        page: the report.
        result: content of result.json.
    """

    lines: list[str]
    warnings: list[str]
    page: Path
    result: dict[str, Any]


def present(bag: Path, settings: Settings, switched_ns: int, answered_ns: int, out: Path) -> Presentation:
    """Evaluate the recording and write the report and result.json.

    Args:
        bag: the recording of both nodes.
        settings: what they ran with.
        switched_ns: when the observer was told to compensate; the half without compensation ends [ns].
        answered_ns: when it had answered; the half with compensation begins [ns].
        out: folder of the report.

    Raises:
        RecordingError: the bag lacks a topic.
        DataError: a half of the run holds no samples.
    """
    lines: list[str] = []
    evaluated: list[Evaluated] = []
    verdicts: list[str] = []
    warnings: list[str] = []
    results: dict[str, dict[str, Any]] = {}
    for axis in settings.axes:
        run, stamps = _run_of(bag, axis)
        switched = (switched_ns - int(stamps[0])) * 1e-9
        tracking, samples = _tracking_of(bag, axis, int(stamps[0]))
        way = recorded_lateness(bag, axis, samples, settings.sample_period)
        without = _half(run, tracking, way, SETTLE, switched)
        answered = (answered_ns - int(stamps[0])) * 1e-9
        with_it = _half(run, tracking, way, answered + SETTLE, float(run.time[-1]))
        same, compared = _replayed(bag, settings, axis.name)
        lines += _lines(axis, without, with_it, same, compared)
        positions, _ = signal_of(bag, "position", axis.name)
        expected = 1.0 + (positions[-1] - stamps[0]) * 1e-9 / (settings.publish_every * settings.sample_period)
        share = len(run.time) / expected
        warnings += missing_warnings(axis.name, share)
        warnings += late_warnings(axis.name, without, with_it, axis.units)
        verdicts.append(headline(axis.name, without, with_it, axis.units))
        results[axis.name] = axis_result(without, with_it, same, compared)
        gap = axis.filter.maximum_gap
        shown = run.with_breaks(gap), tracking.with_breaks(gap)
        evaluated.append(Evaluated(axis, *shown, switched, without, with_it, share, same, compared))
    page = demonstration_page(evaluated, ". ".join(verdict[0].upper() + verdict[1:] for verdict in verdicts) + ".",
                              warnings, bag.name)  # fmt: skip
    result = result_of(results)
    write_text(json.dumps(result, indent=1) + "\n", out / RESULT)
    return Presentation([*verdicts, *lines], warnings, write_page(page, out), result)


def _run_of(bag: Path, axis: AxisSettings) -> tuple[Run, Ints]:
    """Return one axis's signals on the stamps of its estimates, in SI, and those stamps [ns]."""
    stamps, estimate = signal_of(bag, "friction_estimate", axis.name)
    truth = _on_stamps(stamps, *signal_of(bag, "friction_true", axis.name))
    reference = _on_stamps(stamps, *signal_of(bag, "reference", axis.name))
    run = Run(
        time=(stamps - stamps[0]) * 1e-9,
        position=truth["position"],
        velocity=estimate["velocity"],
        reference=axis.position_scale * reference["position"],
        friction=estimate["effort"],
        friction_std=_on_stamps(stamps, *signal_of(bag, "friction_std", axis.name))["effort"],
        truth=truth["effort"],
        compensation=_on_stamps(stamps, *signal_of(bag, "friction_compensation", axis.name))["effort"],
        units=axis.units,
    )
    return run, stamps


def _tracking_of(bag: Path, axis: AxisSettings, start_ns: int) -> tuple[Tracking, Ints]:
    """Return the tracking error of every sample of the stage from a stamp on, and the samples' stamps [ns]."""
    stamps, truth = signal_of(bag, "friction_true", axis.name)
    reference = _on_stamps(stamps, *signal_of(bag, "reference", axis.name))
    rows = stamps >= start_ns
    error = truth["position"] - axis.position_scale * reference["position"]
    time = np.asarray((stamps[rows] - start_ns) * 1e-9, dtype=np.float64)
    return Tracking(time, error[rows], axis.units), stamps[rows]


def _on_stamps(wanted: Ints, stamps: Ints, fields: dict[str, Floats]) -> dict[str, Floats]:
    """Return the fields of a topic at the wanted stamps [ns], NaN where it has no message."""
    place = np.minimum(np.searchsorted(stamps, wanted), max(0, len(stamps) - 1))
    is_there = stamps[place] == wanted
    return {name: np.where(is_there, values[place], np.nan) for name, values in fields.items()}


def _half(run: Run, tracking: Tracking, way: Lateness, start: float, end: float) -> Half:
    """Return the errors between two times [s]; ``way`` has a row for each of ``tracking``."""
    part, rows = run.between(start, end), tracking.rows(start, end)
    error = part.friction - part.truth
    known = np.isfinite(error)
    tracked = np.isfinite(tracking.error[rows])
    if not known.any() or not tracked.any():
        raise DataError(f"there is nothing to compare between {start:g} s and {end:g} s of the run; let it run longer")
    rms = float(np.sqrt(np.mean(error[known] ** 2)))
    deviation = tracking.error[rows][tracked]
    clear = tracking.error[rows][tracked & way.is_clear[rows]]
    return Half(
        samples=int(np.count_nonzero(known)),
        friction_rms=rms,
        friction_share=rms / float(np.ptp(part.truth[known])),
        coverage=float(np.mean(np.abs(error[known]) <= 2.0 * part.friction_std[known])),
        tracking_rms=float(np.sqrt(np.mean(deviation**2))),
        tracking_peak=float(np.max(np.abs(deviation))),
        late_share=float(np.mean(way.is_late[rows])) if way.is_known else math.nan,
        clear_rms=float(np.sqrt(np.mean(clear**2))) if clear.size else math.nan,
        clear_peak=float(np.max(np.abs(clear))) if clear.size else math.nan,
    )


def _replayed(bag: Path, settings: Settings, axis: str) -> tuple[int, int]:
    """Return how many live estimates a replay of the bag reproduces exactly, and how many there are."""
    chosen = next(entry for entry in settings.axes if entry.name == axis)
    observer = AxisObserver(chosen, settings.sample_period)
    replayed: dict[int, float] = {}
    for _, samples in BagSamples(bag, {axis: chosen.scales}, settings.sample_period):
        estimates = observer.step(samples)
        replayed.update(zip(estimates.stamp_ns.tolist(), estimates.friction.tolist(), strict=True))
    stamps, fields = signal_of(bag, "friction_estimate", axis)
    live = zip(stamps.tolist(), fields["effort"].tolist(), strict=True)
    return sum(replayed.get(stamp) == friction for stamp, friction in live), len(stamps)


def _lines(axis: AxisSettings, without: Half, with_it: Half, same: int, compared: int) -> list[str]:
    """Return the lines of the terminal for one axis."""
    readable = readable_errors(without, with_it, axis.units)
    return [
        f"axis {axis.name}",
        f"  friction estimate   {without.friction_rms:.4f} {axis.units.effort} rms,"
        f" {100 * without.friction_share:.2f} % of the true friction's range"
        f" ({without.samples} samples; truth inside two sigma {100 * without.coverage:.1f} %)",
        f"  tracking error      {readable(without.tracking_rms)} rms, {readable(without.tracking_peak)} peak"
        " without compensation",
        f"                      {readable(with_it.tracking_rms)} rms, {readable(with_it.tracking_peak)} peak"
        f" with it: rms {change(without.tracking_rms, with_it.tracking_rms)},"
        f" peak {change(without.tracking_peak, with_it.tracking_peak)}",
        f"  replay of the bag   reproduces {same} of {compared} live estimates exactly",
        f"  on the way          {on_the_way(without, with_it, axis.units)}",
    ]


MIN_COVERAGE = 0.9
"""Share of the samples whose true friction lies within two standard deviations; 0.954 where the errors are normal."""
_SHOWN = 0.4  # s in the pictures


@dataclass(frozen=True)
class Evaluated:
    """One axis of a demonstration.

    Attributes:
        axis: its settings.
        run: its signals on the stamps of the estimates, to draw: with a row of NaN where samples are missing.
        tracking: its tracking error on all samples of the stage, likewise.
        switched: when the half without compensation ends [s].
        without: errors of the half without compensation.
        with_it: errors of the half with it.
        share: of the samples that have an estimate [-].
        same: live estimates that the replay reproduces exactly.
        compared: live estimates.
    """

    axis: AxisSettings
    run: Run
    tracking: Tracking
    switched: float
    without: Half
    with_it: Half
    share: float
    same: int
    compared: int


def demonstration_page(axes: Sequence[Evaluated], verdict: str, warnings: Sequence[str], source: str) -> Page:
    """Return the page.

    Args:
        axes: one for each axis.
        verdict: the outcome.
        warnings: sentences that start with ``Warning:``.
        source: name of the recording.
    """
    of_axis = {one.axis.name: f" of {one.axis.name}" if len(axes) > 1 else "" for one in axes}
    return Page(
        "Friction observer on a simulated stage",
        verdict,
        [section for one in axes for section in _sections(one, of_axis[one.axis.name])],
        f"From {source}, recorded from stage_node and observer_node on the ROS graph.",
        warnings,
        [light for one in axes for light in _lights(one, of_axis[one.axis.name])],
        [_lead(one) for one in axes],
    )


def _lights(one: Evaluated, of_axis: str) -> Sequence[Light]:
    """Return the questions about one axis; ``of_axis`` is empty where there is one axis only."""
    without, with_it, unit = one.without, one.with_it, one.axis.units.effort
    covered = min(without.coverage, with_it.coverage)
    friction = (
        f"The rms error is {100.0 * without.friction_share:.2f} % of the friction's range ({without.friction_rms:.3g}"
        f" {unit}); the true friction lies within two standard deviations in {100.0 * covered:.1f} % of the samples."
    )
    readable = readable_errors(without, with_it, one.axis.units)
    smaller = (with_it.tracking_rms < without.tracking_rms, with_it.tracking_peak < without.tracking_peak)
    tracking = (
        f"Rms {readable(without.tracking_rms)} without and {readable(with_it.tracking_rms)} with it, peak"
        f" {readable(without.tracking_peak)} and {readable(with_it.tracking_peak)}."
    )
    way = on_the_way(without, with_it, one.axis.units)
    in_time = GOOD if with_it.late_share == 0.0 else UNSURE
    return (
        Light(
            "Friction",
            f"Is the estimated friction{of_axis} as accurate as the observer states?",
            GOOD if covered >= MIN_COVERAGE else BAD,
            friction,
        ),
        Light(
            "Tracking",
            f"Is the tracking error{of_axis} smaller with compensation?",
            GOOD if all(smaller) else UNSURE if any(smaller) else BAD,
            tracking,
        ),
        Light(
            "Live run",
            f"Does every sample{of_axis} have an estimate?",
            GOOD if one.share >= MIN_RECORDED_SHARE else BAD,
            f"{100.0 * min(one.share, 1.0):.3g} % of the samples have one.",
        ),
        Light("Live run", f"Did every compensation{of_axis} come in time?", in_time, f"{way[0].upper()}{way[1:]}."),
        Light(
            "Live run",
            f"Does the replay{of_axis} give what the live observer gave?",
            GOOD if one.same == one.compared else BAD,
            f"The replay reproduces {one.same} of {one.compared} live estimates exactly.",
        ),
    )


def _lead(one: Evaluated) -> Picture:
    """Draw the tracking error without and with compensation."""
    end = float(one.run.time[-1])
    windows = ((one.switched - _SHOWN, one.switched), (end - _SHOWN, end))
    return tracking_picture(one.tracking, *windows, f"{one.axis.name}_tracking")


def _sections(one: Evaluated, of_axis: str) -> Sequence[Section]:
    """Return the sections of one axis."""
    run, switched = one.run, one.switched
    method = (
        "The stage and the observer ran as two processes and spoke over ROS topics only; the observer saw the measured"
        " position, the control effort and the reference, and never the truth."
    )
    name, end = one.axis.name, float(run.time[-1])
    before = run_pictures(run, (max(0.0, switched - _SHOWN), switched), f"{name}_without_")
    after = run_pictures(run, (max(switched, end - _SHOWN), end), f"{name}_with_")
    return (
        Section(f"Errors against the simulated truth{of_axis}", (method,), (_table(one),), plots=(_over_time(one),)),
        Section(f"Without compensation{of_axis}", pictures=before),
        Section(f"With compensation{of_axis}", pictures=after),
    )


def _table(one: Evaluated) -> Table:
    """Return the errors of both halves."""
    without, with_it, unit = one.without, one.with_it, one.axis.units.effort
    readable = readable_errors(without, with_it, one.axis.units)
    return Table(
        ("", "without compensation", "with compensation"),
        (
            ("friction error, rms", f"{without.friction_rms:.4f} {unit}", f"{with_it.friction_rms:.4f} {unit}"),
            (
                "the same, of the friction's range",
                f"{100 * without.friction_share:.2f} %",
                f"{100 * with_it.friction_share:.2f} %",
            ),
            ("truth inside two sigma", f"{100 * without.coverage:.1f} %", f"{100 * with_it.coverage:.1f} %"),
            ("tracking error, rms", readable(without.tracking_rms), readable(with_it.tracking_rms)),
            ("tracking error, peak", readable(without.tracking_peak), readable(with_it.tracking_peak)),
        ),
        f"Axis {one.axis.name}: errors against the simulated truth, the first {SETTLE:g} s of each half left out.",
    )


def _over_time(one: Evaluated) -> Plot:
    """Return the whole run over time."""
    run, unit = one.run, one.axis.units.effort
    error = run.position - run.reference
    factor, position = largest_prefixed(run.position, run.units)
    error_factor, error_unit = largest_prefixed(error, run.units)
    panels = [
        Panel(
            f"position [{position}]",
            [
                Line("set-point", factor * run.reference, "reference"),
                Line("true position", factor * run.position, "measured"),
            ],
        ),
        Panel(f"error [{error_unit}]", [Line("position - set-point", error_factor * error, "measured")]),
        Panel(f"friction [{unit}]", [Line("true", run.truth, "ink"), Line("estimated", run.friction, "estimate")]),
        Panel(f"compensation [{unit}]", [Line("compensation", run.compensation, "accent")]),
    ]
    caption = (
        f"Motion, tracking error, friction and compensation of {one.axis.name}; compensation is switched on at"
        f" {one.switched:.3g} s."
    )
    return time_plot(f"{one.axis.name}_run", caption, run.time, panels)
