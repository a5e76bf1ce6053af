"""The final page: what was done, what was found, and the tracking error before and after."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.application.commission.learn import MAX_RATIO_OF_BETTER, WITHOUT_OFFSET, Found
from sgms_observer.application.commission.ledger import (
    AFTER_BAG,
    BEFORE_BAG,
    IDENTIFIED,
    LIGHTS,
    OWN_MOTION_GAP,
    REPORT,
    Ledger,
)
from sgms_observer.application.commission.session import Session
from sgms_observer.application.commission.tracking import Tracking, recorded_tracking
from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.source import BagReader
from sgms_observer.diagnosis.questions import BELIEVABILITY
from sgms_observer.diagnosis.report_pictures import effects_over_position
from sgms_observer.diagnosis.report_tables import prefixed_unit
from sgms_observer.diagnosis.residual_log import RESIDUAL_LOG
from sgms_observer.effects.catalogue import effect as entry_of
from sgms_observer.effects.effect import EffectSettings
from sgms_observer.report.demonstration import change
from sgms_observer.report.drawing import ESTIMATE, MEASURED, Line, Panel, sheet, time_plot
from sgms_observer.report.gap_picture import gap_picture
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Link, Page, Picture, Plot, Section, Table, write_page
from sgms_observer.report.run_pictures import draw_line
from sgms_observer.settings.units import Units

_NOT_FITTED = "quantisation"  # is measured: it closes no part of the gap


def write_report(session: Session) -> Found:
    """Write report.html from the ledger and the recordings."""
    ledger, axis = session.ledger, session.axis
    lead, sections = _tracking_of(session) if ledger.tracking else ([], [])
    gap = _gap_of(ledger)
    lead += [gap] if gap else []
    sections.append(_found_section(session))
    rows = [(step.name, step.state, f"{step.seconds:.0f} s", step.sentence) for step in ledger.steps.values()]
    sections.append(Section("Steps", tables=(Table(("step", "state", "time", "what it found"), rows),)))
    shortfall = [f"Warning: the result must not be used as it is: {ledger.reason}."] if ledger.reason else []
    warnings = [*shortfall, *ledger.warnings]
    provenance = f"From {session.plan.request.config}; recordings are in recordings/."
    title = f"Commissioning of axis {axis.name}"
    page = Page(
        title, headline(session), sections, provenance, warnings, _lights(session), lead, _links(session.ledger)
    )
    return f"wrote {write_page(page, ledger.folder).name}", [REPORT]


def _links(ledger: Ledger) -> list[Link]:
    """Return links to the reports of the diagnosis that counts and of the identification, as far as there are some."""
    reports = [("Report of the diagnosis", f"{ledger.facts.get('diagnosis', 'diagnosis')}/report.html")]
    reports.append(("Report of the identification", f"{Path(IDENTIFIED).parent}/report.html"))
    return [Link(text, path) for text, path in reports if (ledger.folder / path).exists()]


def _lights(session: Session) -> tuple[Light, ...]:
    """Return the questions that a user has, with their answers; first those about the tracking error."""
    found = _diagnosis_lights(session)
    return (
        *_tracking_lights(session),
        *(light for light in found if light.topic != BELIEVABILITY),
        *_gap_lights(session),
        *(light for light in found if light.topic == BELIEVABILITY),
    )


def _tracking_lights(session: Session) -> list[Light]:
    """Ask whether compensation made the tracking error smaller."""
    tracking, readable = session.ledger.tracking, session.axis.units.readable
    if not tracking:
        return []
    lights = []
    for key, word in (("rms", "rms"), ("peak", "largest")):
        before, after = (tracking[f"{key}_{when}"] for when in ("before", "after"))
        answer = f"{readable(before)} without compensation, {readable(after, largest=before)} with it."
        state = GOOD if after < before else BAD
        lights.append(Light("Tracking", f"Is the {word} tracking error smaller?", state, answer))
    return lights


def _diagnosis_lights(session: Session) -> list[Light]:
    """Return the questions of the diagnosis."""
    return [Light(**entry) for entry in session.ledger.facts.get(LIGHTS, ())]


def _gap_lights(session: Session) -> list[Light]:
    """Ask whether the model predicts the own motion better than the user's file, as far as that is known."""
    ledger = session.ledger
    gap, files = ledger.facts.get("gap"), ledger.facts.get(OWN_MOTION_GAP)
    if not gap:
        return []
    steps = [("your file", files["file"]), ("the identified values", files["identified"])] if files else []
    steps += [
        (f"{_start_of_diagnosis(ledger)}, refitted for the diagnosis,", gap["before"]),
        ("the model with all that was found", gap["after"]),
    ]
    (first, size), *others = steps
    answer = (
        f"The gap of {first} is {size:.3g} % of the rms {session.axis.units.effort_word}; of"
        f" {'; of '.join(f'{name} {rest:.3g} %' for name, rest in others)}. No recorded signal predicts the last"
        f" {gap['floor']:.3g} %."
    )
    question = f"Does the model predict your own motion better than {'your file' if files else 'before the diagnosis'}?"
    return [Light(BELIEVABILITY, question, GOOD if gap["after"] < MAX_RATIO_OF_BETTER * size else UNSURE, answer)]


def _start_of_diagnosis(ledger: Ledger) -> str:
    """Return the values that the diagnosis starts from, in words."""
    if not ledger.facts.get("model"):
        return "your file"
    return f"the identified values{' without the offset' if ledger.facts['model'] == WITHOUT_OFFSET else ''}"


def headline(session: Session) -> str:
    """Return the result in one sentence."""
    tracking, axis = session.ledger.tracking, session.axis
    names = ", ".join(effect["name"] for effect in session.ledger.effects) or "no further effect"
    if not tracking:
        found = f"{names} found" if "gap" in session.ledger.facts else "not diagnosed yet"
        return f"Axis {axis.name}: {found}; tracking without and with compensation is not compared yet."
    units, verdict = axis.units, "may" if session.ledger.is_usable else "must not"
    changes = [
        f"{word} {change(before, after)} ({units.readable(before)} to {units.readable(after, largest=before)})"
        for word in ("rms", "peak")
        for before, after in [(tracking[f"{word}_before"], tracking[f"{word}_after"])]
    ]
    return (
        f"Axis {axis.name}: {names} found. Tracking error with compensation: {', '.join(changes)}."
        f" {session.ledger.yaml} {verdict} be used as it is."
    )


def _found_section(session: Session) -> Section:
    """Return what the diagnosis found."""
    ledger = session.ledger
    rows = []
    for effect in ledger.effects:
        values = ", ".join(
            f"{one.name} {_with_error(effect['parameters'][one.name], error, one.unit, session.axis.units)}"
            for one in entry_of(effect["name"]).parameters
            if (error := effect["std_error"].get(one.name, 0.0)) > 0.0
        )
        others = ", ".join(effect["alternatives"]) or "none"
        rows.append((effect["name"], values, f"{effect['confidence']:.2f}", others))
    table = Table(("effect", "parameters", "confidence", "may also be"), rows, "Values with their standard errors.")
    nothing = "The diagnosis found no further effect." if "gap" in ledger.facts else "There is no diagnosis yet."
    picture = _effects_of(ledger, session.axis.units)
    pictures = (picture,) if picture else ()
    return Section("What was found", () if rows else (nothing,), (table,) if rows else (), pictures)


def _with_error(value: float, error: float, unit: str, units: Units) -> str:
    """Return a value and its standard error with one prefixed unit."""
    factor, name = prefixed_unit(max(abs(value), error), unit, units) if unit != "-" else (1.0, "")
    digits = max(0, 1 - math.floor(math.log10(factor * error)))  # two of the error
    return f"{factor * value:.{digits}f} +- {factor * error:.{digits}f} {name}".strip()


def _tracking_of(session: Session) -> tuple[list[Picture], list[Section]]:
    """Return the comparison without and with compensation: the pictures, and the section with plot and numbers."""
    tracking, units = session.ledger.tracking, session.axis.units
    rows = [
        (
            word,
            *(
                units.readable(tracking[f"{key}_{when}"], largest=tracking["peak_before"])
                for when in ("before", "after")
            ),
            f"{tracking[f'{key}_before'] / tracking[f'{key}_after']:.1f}",
        )
        for word, key in (("rms", "rms"), ("largest", "peak"))
    ]
    table = Table(
        ("tracking error", "without compensation", "with it", "times smaller"), rows, "Your own motion, played twice."
    )
    before, after = (
        recorded_tracking(session.path(bag), session.axis, session.delay) for bag in (BEFORE_BAG, AFTER_BAG)
    )
    plot = _tracking_plot(before, after, units)
    lead = [_tracking_over_position(before, after, units)]
    return lead, [Section("Tracking before and after", tables=(table,), plots=(plot,))]


def _tracking_plot(before: Tracking, after: Tracking, units: Units) -> Plot:
    """Return the tracking error without and with compensation over time, as a plot that zooms."""
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


def _tracking_over_position(before: Tracking, after: Tracking, units: Units) -> Picture:
    """Draw the tracking error without and with compensation over the position."""
    error, error_unit = units.prefixed(before.peak)
    place, place_unit = units.prefixed(float(np.max(np.abs(before.position))))
    caption = "Tracking error over position, without and with compensation."
    with sheet("tracking_position", caption) as drawn:
        axes = drawn.axes[0]
        for one, colour, word in ((before, MEASURED, "without"), (after, ESTIMATE, "with")):
            draw_line(axes, place * one.position, error * one.error, colour, f"{word} compensation")
        axes.set(xlabel=f"position [{place_unit}]", ylabel=f"tracking error [{error_unit}]")
    return drawn.picture


def _gap_of(ledger: Ledger) -> Picture | None:
    """Draw the gap of the user's file, of the identified values, and after each effect; None without a diagnosis."""
    gap = ledger.facts.get("gap")
    if not gap:
        return None
    files = ledger.facts.get(OWN_MOTION_GAP)
    steps = [("your file", files["file"]), ("identified", files["identified"])] if files else []
    is_without_offset = ledger.facts.get("model") == WITHOUT_OFFSET
    steps.append(("no offset, refitted" if is_without_offset else "refitted", gap["before"]))
    named = [item for item in ledger.effects if item["name"] != _NOT_FITTED]
    steps += [(f"with {item['name'].replace('_', ' ')}", item["gap_after"]) for item in named]
    if not named and gap["after"] < gap["before"]:
        steps.append(("with changed values", gap["after"]))
    learnt = _result_of(ledger).get("learnt", [])
    steps += [("with learnt map", learnt[-1]["gap_after"])] if learnt else []
    return gap_picture(steps, gap["floor"])


def _result_of(ledger: Ledger) -> dict[str, Any]:
    """Return result.json of the diagnosis that counts; empty where there is none."""
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


def _effects_of(ledger: Ledger, units: Units) -> Picture | None:
    """Draw the found effects over the position, with the residual without them; None if there is nothing to show."""
    path = ledger.folder / ledger.facts.get("diagnosis", "") / RESIDUAL_LOG
    if not path.exists():
        return None
    found = [item["name"] for item in (*ledger.effects, *_result_of(ledger).get("learnt", []))]
    log = _read(path)
    effects = {name: log.effects[name] for name in found if name in log.effects}
    if not effects:
        return None
    settings = [
        EffectSettings(item["name"], tuple(item["parameters"][one.name] for one in entry_of(item["name"]).parameters))
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
