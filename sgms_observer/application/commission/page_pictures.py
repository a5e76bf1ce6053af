"""Pictures of the final page: the tracking error before and after, the gap, and what was found over the position."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.application.commission.learn import WITHOUT_OFFSET
from sgms_observer.application.commission.ledger import OWN_MOTION_GAP, Ledger
from sgms_observer.application.commission.tracking import Tracking
from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.source import BagReader
from sgms_observer.diagnosis.report_pictures import effects_over_position
from sgms_observer.diagnosis.residual_log import RESIDUAL_LOG
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.effect import EffectSettings
from sgms_observer.report.drawing import ESTIMATE, MEASURED, Line, Panel, sheet, time_plot
from sgms_observer.report.gap_picture import gap_picture
from sgms_observer.report.page import Picture, Plot
from sgms_observer.report.run_pictures import draw_line
from sgms_observer.settings.units import Units

_MEASURED = "quantisation"  # is measured and not fitted: it closes no part of the gap


def tracking_plot(before: Tracking, after: Tracking, units: Units) -> Plot:
    """Return the tracking error without and with compensation over time, as a plot that zooms.

    Args:
        before: without compensation.
        after: with compensation, along the same motion.
        units: of the axis.
    """
    error, error_unit = units.prefixed(before.peak)
    place, place_unit = units.prefixed(float(np.max(np.abs(before.position))))
    rows = _nearest(after.time, before.time)
    panels = [
        Panel(
            f"tracking error [{error_unit}]",
            [
                Line("without compensation", error * before.error, "measured"),
                Line("with compensation", error * after.error[rows], "estimate"),
            ],
        ),
        Panel(f"set-point [{place_unit}]", [Line("set-point", place * (before.position - before.error), "reference")]),
    ]
    caption = "Tracking error of your own motion without and with compensation, over the time since it began."
    return time_plot("tracking", caption, before.time, panels)


def _nearest(times: Floats, wanted: Floats) -> Ints:
    """Return the row of the nearest of some times for each wanted one; both rise."""
    later = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    return np.asarray(later - (wanted - times[later - 1] < times[later] - wanted), dtype=np.int64)


def tracking_over_position(before: Tracking, after: Tracking, units: Units) -> Picture:
    """Draw the tracking error without and with compensation over the position.

    Args:
        before: without compensation.
        after: with compensation.
        units: of the axis.
    """
    error, error_unit = units.prefixed(before.peak)
    place, place_unit = units.prefixed(float(np.max(np.abs(before.position))))
    caption = "Tracking error over position, without and with compensation."
    with sheet("tracking_position", caption) as drawn:
        axes = drawn.axes[0]
        for one, colour, word in ((before, MEASURED, "without"), (after, ESTIMATE, "with")):
            draw_line(axes, place * one.position, error * one.error, colour, f"{word} compensation")
        axes.set(xlabel=f"position [{place_unit}]", ylabel=f"tracking error [{error_unit}]")
    return drawn.picture


def gap_of(ledger: Ledger) -> Picture | None:
    """Draw the gap of the user's file, of the identified values, and after each effect; None without a diagnosis.

    Args:
        ledger: the ledger.
    """
    gap = ledger.facts.get("gap")
    if not gap:
        return None
    files = ledger.facts.get(OWN_MOTION_GAP)
    steps = [("your file", files["file"]), ("identified", files["identified"])] if files else []
    is_without_offset = ledger.facts.get("model") == WITHOUT_OFFSET
    steps.append(("no offset, refitted" if is_without_offset else "refitted", gap["before"]))
    named = [item for item in ledger.effects if item["name"] != _MEASURED]
    steps += [(f"with {item['name'].replace('_', ' ')}", item["gap_after"]) for item in named]
    if not named and gap["after"] < gap["before"]:
        steps.append(("with changed values", gap["after"]))
    learnt = result_of(ledger).get("learnt", [])
    steps += [("with learnt map", learnt[-1]["gap_after"])] if learnt else []
    return gap_picture(steps, gap["floor"])


def result_of(ledger: Ledger) -> dict[str, Any]:
    """Return result.json of the diagnosis that counts; empty where there is none.

    Args:
        ledger: the ledger.
    """
    path = ledger.folder / ledger.facts.get("diagnosis", "") / "result.json"
    result: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return result


@dataclass(frozen=True)
class _Residual:
    """What residual.mcap holds of one axis; shapes (n,).

    Attributes:
        position, velocity: motion [SI units].
        residual: of the whole model [N].
        effects: effort of each effect [N].
    """

    position: Floats
    velocity: Floats
    residual: Floats
    effects: Mapping[str, Floats]


def effects_of(ledger: Ledger, units: Units) -> Picture | None:
    """Draw the residual of the model without the found effects over the position, with these effects.

    Args:
        ledger: the ledger.
        units: of the axis.

    Returns:
        The picture; None where the diagnosis left no residual.mcap, or found nothing that acts on the effort.
    """
    path = ledger.folder / ledger.facts.get("diagnosis", "") / RESIDUAL_LOG
    if not path.exists():
        return None
    found = [item["name"] for item in (*ledger.effects, *result_of(ledger).get("learnt", []))]
    log = _read(path)
    effects = {name: log.effects[name] for name in found if name in log.effects}
    if not effects:
        return None
    settings = [
        EffectSettings(item["name"], tuple(item["parameters"][one.name] for one in effect(item["name"]).parameters))
        for item in ledger.effects
    ]
    return effects_over_position(log.position, log.velocity, log.residual, effects, settings, units)


def _read(path: Path) -> _Residual:
    """Return what a residual.mcap holds, one recording after the other."""
    with BagReader(path) as bag:
        above = sorted(topic.removesuffix("/measured") for topic in bag.topics if topic.endswith("/measured"))
    motions = [read_joint_states(path, f"{name}/measured") for name in above]
    residuals = [read_joint_states(path, f"{name}/residual") for name in above]
    efforts = [read_joint_states(path, f"{name}/effects") for name in above if f"{name}/effects" in bag.topics]
    names: Sequence[str] = efforts[0].names if efforts else ()
    return _Residual(
        np.concatenate([one.position[:, 0] for one in motions]),
        np.concatenate([one.velocity[:, 0] for one in motions]),
        np.concatenate([one.effort[:, 0] for one in residuals]),
        {name: np.concatenate([one.effort[:, one.names.index(name)] for one in efforts]) for name in names},
    )
