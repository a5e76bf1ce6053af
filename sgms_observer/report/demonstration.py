"""Report of a demonstration: estimation error against the truth, tracking with and without compensation."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.reader import BagSamples
from sgms_observer.errors import DataError
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.report.page import Page, Section, Table, write_page
from sgms_observer.report.recorded import RECOVERY, SETTLE, Lateness, recorded_lateness, signal_of
from sgms_observer.report.run_pictures import Run, run_pictures, tracking_picture
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.units import Units
from sgms_observer.whole_file import write_text

SCHEMA = 1
MIN_RECORDED_SHARE = 0.95
"""Share of the samples that have an estimate, below which the figures do not stand for the whole run."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RESULT = "result.json"
_SHOWN = 0.4  # s in the pictures


@dataclass(frozen=True)
class Half:
    """Errors over one half of the run.

    Attributes:
        samples: how many there are.
        friction_rms: rms of estimated minus true friction [N].
        friction_share: the same as a share of the true friction's range.
        coverage: share of the samples whose truth lies within two standard deviations.
        tracking_rms: rms of true position minus set-point [m].
        tracking_peak: the largest of it [m].
        late_share: share of the samples whose compensation came after the time it was made for; NaN if not known.
        clear_rms: rms of the tracking error apart from those, and from what followed them [m].
        clear_peak: the largest of it [m].
    """

    samples: int
    friction_rms: float
    friction_share: float
    coverage: float
    tracking_rms: float
    tracking_peak: float
    late_share: float
    clear_rms: float
    clear_peak: float


def axis_result(without: Half, with_it: Half, same: int, compared: int) -> dict[str, Any]:
    """Return one axis of result.json: friction errors without compensation, tracking errors in SI units.

    Args:
        without: errors of the half without compensation.
        with_it: errors of the half with it.
        same: live estimates that the replay gave again to the last bit.
        compared: live estimates.
    """
    return {
        "friction_rms": without.friction_rms,
        "friction_nrmse": without.friction_share,
        "tracking": {
            "rms_before": without.tracking_rms,
            "rms_after": with_it.tracking_rms,
            "peak_before": without.tracking_peak,
            "peak_after": with_it.tracking_peak,
        },
        "late_share": None if math.isnan(with_it.late_share) else with_it.late_share,
        "replay_equal": same,
        "replay_total": compared,
    }


def result_of(axes: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return the content of result.json.

    Args:
        axes: name to ``axis_result``.
    """
    return {"schema": SCHEMA, "axes": axes}


def change(before: float, after: float) -> str:
    """Return how an error changed, in words."""
    if before > 0.0 and round(after / before, 1) == 1.0:
        return "about the same"
    if after <= before:
        return f"{before / after:.1f}x smaller" if after > 0.0 else "gone"
    return f"{after / before:.1f}x larger" if before > 0.0 else "new"


def headline(axis: str, without: Half, with_it: Half, units: Units) -> str:
    """Return the outcome in one sentence: friction error, rms and peak of the tracking error, and late messages.

    Args:
        axis: its name.
        without: errors of the half without compensation.
        with_it: errors of the half with it.
        units: of the axis.
    """
    largest = max(without.tracking_peak, with_it.tracking_peak)
    sizes = [
        f"{word} {change(before, after)}"
        f" ({units.readable(before, largest=largest)} to {units.readable(after, largest=largest)})"
        for word, before, after in (
            ("rms", without.tracking_rms, with_it.tracking_rms),
            ("peak", without.tracking_peak, with_it.tracking_peak),
        )
    ]
    if math.isnan(with_it.late_share):
        late = "the recording does not tell which messages came late"
    else:
        late = f"{100.0 * with_it.late_share:.3g} % of the compensation messages came late"
    return (
        f"axis {axis}: friction estimated to {100.0 * without.friction_share:.2f} % of its range; tracking error with"
        f" compensation: {', '.join(sizes)}; {late}"
    )


def missing_warnings(axis: str, share: float) -> list[str]:
    """Return a warning where many samples have no estimate: nothing is known of what happened then.

    Args:
        axis: its name.
        share: of the samples of the run that have an estimate [-].
    """
    if share >= MIN_RECORDED_SHARE:
        return []
    return [
        f"Warning: axis {axis}: only {100.0 * share:.0f} % of the samples have an estimate; the figures are about those"
        " alone. End other programs and run the demonstration again."
    ]


def late_warnings(axis: str, without: Half, with_it: Half, units: Units) -> list[str]:
    """Return a warning where compensations that came late decide how large the tracking error gets.

    Args:
        axis: its name.
        without: errors of the half without compensation.
        with_it: errors of the half with it.
        units: of the axis.
    """
    if not with_it.late_share > 0.0 or with_it.clear_peak >= with_it.tracking_peak:
        return []
    peak = units.readable(with_it.tracking_peak, largest=max(without.tracking_peak, with_it.tracking_peak))
    return [
        f"Warning: axis {axis}: the largest tracking error with compensation, {peak}, follows a compensation that came"
        " late. End other programs and run the demonstration again."
    ]


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
    sections: list[Section] = []
    verdicts: list[str] = []
    warnings: list[str] = []
    results: dict[str, dict[str, Any]] = {}
    for axis in settings.axes:
        run, stamps = _run_of(bag, axis)
        switched = (switched_ns - int(stamps[0])) * 1e-9
        way = recorded_lateness(bag, axis, stamps, settings.sample_period)
        without = _half(run, way, SETTLE, switched)
        answered = (answered_ns - int(stamps[0])) * 1e-9
        with_it = _half(run, way, answered + SETTLE, float(run.time[-1]))
        same, compared = _replayed(bag, settings, axis.name)
        lines += _lines(axis, without, with_it, same, compared)
        expected = 1.0 + run.time[-1] / (settings.publish_every * settings.sample_period)
        warnings += missing_warnings(axis.name, len(run.time) / expected)
        warnings += late_warnings(axis.name, without, with_it, axis.units)
        verdicts.append(headline(axis.name, without, with_it, axis.units))
        results[axis.name] = axis_result(without, with_it, same, compared)
        sections += _sections(axis, run, switched, without, with_it, same, compared)
    page = Page(
        "Friction observer on a simulated stage",
        ". ".join(verdict[0].upper() + verdict[1:] for verdict in verdicts) + ".",
        sections,
        f"From {bag.name}, recorded from stage_node and observer_node on the ROS graph.",
        warnings,
    )
    result = result_of(results)
    write_text(json.dumps(result, indent=1) + "\n", out / RESULT)
    return Presentation([*verdicts, *lines], warnings, write_page(page, out), result)


def _run_of(bag: Path, axis: AxisSettings) -> tuple[Run, Ints]:
    """Return one axis's signals on the stamps of its estimates, in SI, and those stamps [ns]."""
    stamps, estimate = signal_of(bag, "friction_estimate", axis.name)

    def on_stamps(topic: str) -> dict[str, Floats]:
        stamps_of_topic, fields = signal_of(bag, topic, axis.name)
        place = np.minimum(np.searchsorted(stamps_of_topic, stamps), max(0, len(stamps_of_topic) - 1))
        is_there = stamps_of_topic[place] == stamps
        return {name: np.where(is_there, values[place], np.nan) for name, values in fields.items()}

    truth = on_stamps("friction_true")
    run = Run(
        time=(stamps - stamps[0]) * 1e-9,
        position=truth["position"],
        velocity=estimate["velocity"],
        reference=axis.position_scale * on_stamps("reference")["position"],
        friction=estimate["effort"],
        friction_std=on_stamps("friction_std")["effort"],
        truth=truth["effort"],
        compensation=on_stamps("friction_compensation")["effort"],
        units=axis.units,
    )
    return run, stamps


def _half(run: Run, way: Lateness, start: float, end: float) -> Half:
    """Return the errors between two times [s]."""
    part = run.between(start, end)
    rows = slice(*np.searchsorted(run.time, [start, end]))
    error = part.friction - part.truth
    known = np.isfinite(error)
    tracking = part.position - part.reference
    tracked = np.isfinite(tracking)
    if not known.any() or not tracked.any():
        raise DataError(f"there is nothing to compare between {start:g} s and {end:g} s of the run; let it run longer")
    rms = float(np.sqrt(np.mean(error[known] ** 2)))
    clear = tracking[tracked & way.is_clear[rows]]
    return Half(
        samples=int(np.count_nonzero(known)),
        friction_rms=rms,
        friction_share=rms / float(np.ptp(part.truth[known])),
        coverage=float(np.mean(np.abs(error[known]) <= 2.0 * part.friction_std[known])),
        tracking_rms=float(np.sqrt(np.mean(tracking[tracked] ** 2))),
        tracking_peak=float(np.max(np.abs(tracking[tracked]))),
        late_share=float(np.mean(way.is_late[rows])) if way.is_known else math.nan,
        clear_rms=float(np.sqrt(np.mean(clear**2))) if clear.size else math.nan,
        clear_peak=float(np.max(np.abs(clear))) if clear.size else math.nan,
    )


def _replayed(bag: Path, settings: Settings, axis: str) -> tuple[int, int]:
    """Return how many live estimates a replay of the bag gives again to the last bit, and how many there are."""
    chosen = next(entry for entry in settings.axes if entry.name == axis)
    observer = AxisObserver(chosen, settings.sample_period)
    replayed: dict[int, float] = {}
    for _, samples in BagSamples(bag, {axis: chosen.scales}, settings.sample_period):
        estimates = observer.step(samples)
        replayed.update(zip(estimates.stamp_ns.tolist(), estimates.friction.tolist(), strict=True))
    stamps, fields = signal_of(bag, "friction_estimate", axis)
    live = zip(stamps.tolist(), fields["effort"].tolist(), strict=True)
    return sum(replayed.get(stamp) == friction for stamp, friction in live), len(stamps)


def _on_the_way(without: Half, with_it: Half, units: Units) -> str:
    """Return a sentence about late compensations, if the recording shows them."""
    readable = _readable(without, with_it, units)
    if math.isnan(with_it.late_share):
        return "the recording does not tell which compensations came in time"
    if with_it.late_share == 0.0:
        return "every compensation came in time"
    late = f"{100 * with_it.late_share:.3g} % of the samples got a compensation late"
    if math.isnan(with_it.clear_rms):
        return f"{late}, and never for {RECOVERY:g} s none: this machine is too busy for this rate"
    return (
        f"{late}; apart from these and {1e3 * RECOVERY:.0f} ms after each: {readable(with_it.clear_rms)} rms,"
        f" {readable(with_it.clear_peak)} peak: rms {change(without.tracking_rms, with_it.clear_rms)},"
        f" peak {change(without.tracking_peak, with_it.clear_peak)}"
    )


def _readable(without: Half, with_it: Half, units: Units) -> Callable[[float], str]:
    """Return a function that formats tracking errors with one prefix."""
    return partial(units.readable, largest=max(without.tracking_peak, with_it.tracking_peak))


def _lines(axis: AxisSettings, without: Half, with_it: Half, same: int, compared: int) -> list[str]:
    """Return the lines of the terminal for one axis."""
    readable = _readable(without, with_it, axis.units)
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
        f"  replay of the bag   {same} of {compared} live estimates again to the last bit",
        f"  on the way          {_on_the_way(without, with_it, axis.units)}",
    ]


def _sections(
    axis: AxisSettings, run: Run, switched: float, without: Half, with_it: Half, same: int, compared: int
) -> Sequence[Section]:
    """Return the report's sections about one axis."""
    name, unit, readable = axis.name, axis.units.effort, _readable(without, with_it, axis.units)
    table = Table(
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
        f"Axis {name}: errors against the simulated truth, the first {SETTLE:g} s of each half left out.",
    )
    text = (
        "The stage and the observer ran as two processes and spoke over ROS topics only; the observer saw the measured"
        " position, the control effort and the reference, and never the truth.",
        f"On the way from observer to stage: {_on_the_way(without, with_it, axis.units)}.",
        f"Replaying the recording gives {same} of {compared} live estimates again to the last bit.",
    )
    end = float(run.time[-1])
    lead = tracking_picture(run, (switched - _SHOWN, switched), (end - _SHOWN, end), f"{name}_tracking")
    before = run_pictures(run, (max(0.0, switched - _SHOWN), switched), f"{name}_without_")
    after = run_pictures(run, (max(switched, end - _SHOWN), end), f"{name}_with_")
    return (
        Section(f"Axis {name}: tracking without and with compensation", (), (table,), (lead,)),
        Section(f"Axis {name}: without compensation", pictures=before),
        Section(f"Axis {name}: with compensation", pictures=after),
        Section(f"Axis {name}: how this was measured", text),
    )
