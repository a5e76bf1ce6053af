"""The final page: what was done, what was found, and the tracking error before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sgms_observer.application.commission.learn import CLEARLY_BETTER, Found
from sgms_observer.application.commission.ledger import AFTER_BAG, BEFORE_BAG, REPORT
from sgms_observer.application.commission.session import Session
from sgms_observer.application.commission.tracking import Tracking, recorded_tracking
from sgms_observer.effects.catalogue import effect as entry_of
from sgms_observer.report.demonstration import change
from sgms_observer.report.drawing import ESTIMATE, MEASURED, sheet
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Page, Picture, Section, Table, write_page
from sgms_observer.report.run_pictures import draw_line
from sgms_observer.settings.units import Units


def write_report(session: Session) -> Found:
    """Write report.html from the ledger and the recordings."""
    ledger, axis = session.ledger, session.axis
    lead, sections = _tracking_of(session) if ledger.tracking else ((), [])
    sections.append(_found_section(session))
    rows = [(step.name, step.state, f"{step.seconds:.0f} s", step.sentence) for step in ledger.steps.values()]
    sections.append(Section("Steps", tables=(Table(("step", "state", "time", "what it found"), rows),)))
    shortfall = [f"Warning: the result must not be used as it is: {ledger.reason}."] if ledger.reason else []
    warnings = [*shortfall, *ledger.warnings]
    provenance = f"From {session.plan.request.config}; recordings are in recordings/."
    if "diagnosis" in ledger.facts:
        provenance += f" The diagnosis is in {ledger.facts['diagnosis']}/report.html."
    title = f"Commissioning of axis {axis.name}"
    page = Page(title, headline(session), sections, provenance, warnings, _lights(session), lead)
    return f"wrote {write_page(page, ledger.folder).name}", [REPORT]


def _lights(session: Session) -> tuple[Light, ...]:
    """Return the questions that a user has, with their answers."""
    ledger, readable = session.ledger, session.axis.units.readable
    lights = []
    gap = ledger.facts.get("gap")
    if gap:
        state = GOOD if gap["after"] < CLEARLY_BETTER * gap["before"] else UNSURE
        answer = (
            f"The file leaves {gap['before']:.3g} % of the rms {session.axis.units.effort_word} unexplained, the new"
            f" model {gap['after']:.3g} %; no model explains the last {gap['floor']:.3g} %."
        )
        lights.append(Light("Model", "Does the model predict your own motion better than the file?", state, answer))
    for effect in ledger.effects:
        others = ", ".join(effect["alternatives"])
        answer = (
            f"It may also be {others}."
            if others
            else f"Confidence {effect['confidence']:.2f}; no other effect explains the recordings as well."
        )
        lights.append(Light("Model", f"Is it {effect['name'].replace('_', ' ')}?", UNSURE if others else GOOD, answer))
    tracking = ledger.tracking
    if tracking:
        for key, word in (("rms", "rms"), ("peak", "largest")):
            before, after = (tracking[f"{key}_{when}"] for when in ("before", "after"))
            answer = f"{readable(before)} without compensation, {readable(after, largest=before)} with it."
            state = GOOD if after < before else BAD
            lights.append(Light("Tracking", f"Is the {word} tracking error smaller?", state, answer))
    return tuple(lights)


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
    return Section("What was found", () if rows else (nothing,), (table,) if rows else ())


def _with_error(value: float, error: float, unit: str, units: Units) -> str:
    """Return a value and its standard error with one prefixed unit."""
    factor, name = (1.0, "") if unit == "-" else units.prefixed(value, unit)
    digits = max(0, 1 - math.floor(math.log10(factor * error)))  # two of the error
    return f"{factor * value:.{digits}f} +- {factor * error:.{digits}f} {name}".strip()


def _tracking_of(session: Session) -> tuple[Sequence[Picture], list[Section]]:
    """Return the comparison without and with compensation: the pictures, and the section with the numbers."""
    tracking, readable = session.ledger.tracking, session.axis.units.readable
    rows = [
        (word, *(readable(tracking[f"{key}_{when}"], largest=tracking["peak_before"]) for when in ("before", "after")),
         f"{tracking[f'{key}_before'] / tracking[f'{key}_after']:.1f}")
        for word, key in (("rms", "rms"), ("largest", "peak"))
    ]  # fmt: skip
    table = Table(
        ("tracking error", "without compensation", "with it", "times smaller"), rows, "Your own motion, played twice."
    )
    before, after = (
        recorded_tracking(session.path(bag), session.axis, session.delay) for bag in (BEFORE_BAG, AFTER_BAG)
    )
    return _pictures(session, before, after), [Section("Tracking before and after", tables=(table,))]


def _pictures(session: Session, before: Tracking, after: Tracking) -> tuple[Picture, ...]:
    """Return the tracking errors over time and over position."""
    units = session.axis.units
    factor, name = units.prefixed(before.peak, "m")
    place, place_name = units.prefixed(session.plan.limits.stroke, "m")
    pictures = []
    for key, scale, label in (("time", 1.0, "time [s]"), ("position", place, f"position [{place_name}]")):
        with sheet(f"tracking_{key}", f"Tracking error over {key}, without and with compensation.") as drawn:
            axes = drawn.axes[0]
            for one, colour, word in ((before, MEASURED, "without"), (after, ESTIMATE, "with")):
                draw_line(axes, scale * getattr(one, key), factor * one.error, colour, f"{word} compensation")
            axes.set(xlabel=label, ylabel=f"tracking error [{name}]")
        pictures.append(drawn.picture)
    return tuple(pictures)
