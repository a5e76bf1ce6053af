"""The page of a demonstration: tracking without and with compensation, questions with their answers, all over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sgms_observer.report.demonstration import MIN_RECORDED_SHARE, Half, on_the_way, readable_errors
from sgms_observer.report.drawing import Line, Panel, time_plot
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Page, Picture, Plot, Section, Table
from sgms_observer.report.recorded import SETTLE
from sgms_observer.report.run_pictures import Run, largest_prefixed, run_pictures, tracking_picture
from sgms_observer.settings.axis import AxisSettings

MIN_COVERAGE = 0.9
"""Share of the samples whose true friction lies within two standard deviations; 0.954 where the errors are normal."""
_SHOWN = 0.4  # s in the pictures


@dataclass(frozen=True)
class Evaluated:
    """One axis of a demonstration.

    Attributes:
        axis: its settings.
        run: its signals.
        switched: when the half without compensation ends [s].
        without: errors of the half without compensation.
        with_it: errors of the half with it.
        share: of the samples that have an estimate [-].
        same: live estimates that the replay gave again to the last bit.
        compared: live estimates.
    """

    axis: AxisSettings
    run: Run
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
            f"{one.same} of {one.compared} live estimates come again to the last bit.",
        ),
    )


def _lead(one: Evaluated) -> Picture:
    """Draw the tracking error without and with compensation."""
    end = float(one.run.time[-1])
    windows = ((one.switched - _SHOWN, one.switched), (end - _SHOWN, end))
    return tracking_picture(one.run, *windows, f"{one.axis.name}_tracking")


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
        Panel(
            f"friction [{unit}]",
            [Line("true", run.truth, "ink"), Line("estimated", run.friction, "estimate")],
        ),
        Panel(f"compensation [{unit}]", [Line("compensation", run.compensation, "accent")]),
    ]
    caption = (
        f"Motion, tracking error, friction and compensation of {one.axis.name}; compensation is switched on at"
        f" {one.switched:.3g} s."
    )
    return time_plot(f"{one.axis.name}_run", caption, run.time, panels)
