"""The final page: what was done, what was found, and the tracking error before and after."""

from __future__ import annotations

import math
from pathlib import Path

from sgms_observer.application.commission.learn import CLEARLY_BETTER, WITHOUT_OFFSET, Found
from sgms_observer.application.commission.ledger import (
    AFTER_BAG,
    BEFORE_BAG,
    IDENTIFIED,
    LIGHTS,
    OWN_MOTION_GAP,
    REPORT,
    Ledger,
)
from sgms_observer.application.commission.page_pictures import (
    effects_of,
    gap_of,
    tracking_over_position,
    tracking_plot,
)
from sgms_observer.application.commission.session import Session
from sgms_observer.application.commission.tracking import recorded_tracking
from sgms_observer.diagnosis.questions import BELIEVABILITY
from sgms_observer.diagnosis.report_tables import prefixed_unit
from sgms_observer.effects.catalogue import effect as entry_of
from sgms_observer.report.demonstration import change
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Link, Page, Picture, Section, Table, write_page
from sgms_observer.settings.units import Units


def write_report(session: Session) -> Found:
    """Write report.html from the ledger and the recordings."""
    ledger, axis = session.ledger, session.axis
    lead, sections = _tracking_of(session) if ledger.tracking else ([], [])
    gap = gap_of(ledger)
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
        f"{first[0].upper()}{first[1:]} leaves {size:.3g} % of the rms {session.axis.units.effort_word} unexplained;"
        f" {'; '.join(f'{name} {rest:.3g} %' for name, rest in others)}. No recorded signal predicts the last"
        f" {gap['floor']:.3g} %."
    )
    question = f"Does the model predict your own motion better than {'your file' if files else 'before the diagnosis'}?"
    return [Light(BELIEVABILITY, question, GOOD if gap["after"] < CLEARLY_BETTER * size else UNSURE, answer)]


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
    picture = effects_of(ledger, session.axis.units)
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
    plot = tracking_plot(before, after, units)
    lead = [tracking_over_position(before, after, units)]
    return lead, [Section("Tracking before and after", tables=(table,), plots=(plot,))]
