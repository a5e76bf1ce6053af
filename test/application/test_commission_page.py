"""The final page of a commissioning says what became of the user's own file, and shows what the run has on disk."""

from __future__ import annotations

import base64
import json
import re
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from browser import Browser
from looks import check_report
from start_file import start_file

from sgms_observer.application.commission import learn
from sgms_observer.application.commission.ledger import (
    AFTER_BAG,
    BEFORE_BAG,
    DIAGNOSED,
    DONE,
    IDENTIFIED,
    LIGHTS,
    OWN_MOTION_GAP,
    REPORT,
    Ledger,
)
from sgms_observer.application.commission.page import write_report
from sgms_observer.application.commission.session import Plan, Request, Session
from sgms_observer.bags.writer import BagWriter
from sgms_observer.diagnosis.residual_log import write_residual_log
from sgms_observer.diagnosis.traces import Trace
from sgms_observer.report.page import GOOD, UNSURE, Light

PITCH = 0.00502
TIME = 1e-3 * np.arange(4000)
PLACE = 0.008 * np.sin(1.7 * TIME)
COGGING = {
    "name": "cogging",
    "parameters": {"amplitude": 0.8, "pitch": PITCH, "phase": 0.3, "second_amplitude": 0.0, "second_phase": 0.0},
    "std_error": {"amplitude": 0.01, "pitch": 1e-5, "phase": 0.01, "second_amplitude": 0.0, "second_phase": 0.0},
    "confidence": 1.0, "alternatives": [], "gap_before": 10.8, "gap_after": 1.72,
}  # fmt: skip
RESOLUTION = {
    "name": "quantisation", "parameters": {"resolution": 1e-8}, "std_error": {"resolution": 1e-10}, "confidence": 0.99,
    "alternatives": [], "gap_before": 10.8, "gap_after": 1.72,
}  # fmt: skip
QUESTIONS = (
    Light("Data", "Do the recordings show the friction?", GOOD, "18 s with 187 mm of travel."),
    Light("Convergence", "Did the fits converge?", UNSURE, "The last step still reduced the squared residual."),
    Light("Believability", "Is there a 5.02 mm pitch?", GOOD, "Confidence 1.00."),
)


def write_bag(bag: Path, error: float, first: float) -> None:
    """Write a recording that follows its set-points with an error; its stamps begin somewhere."""
    stamps = np.rint((first + TIME) * 1e9).astype(np.int64)
    with BagWriter(bag) as written:
        written.write_joint_states("position", stamps, ["x"], position=PLACE + error * np.cos(40.0 * TIME))
        written.write_joint_states("reference", stamps, ["x"], position=PLACE)


def session_of(folder: Path) -> Session:
    """Return the session of a folder with nothing in it."""
    (folder / "start.yaml").write_text(start_file(""))
    request = Request(str(folder / "start.yaml"), folder / "out")
    (folder / "out").mkdir()
    ledger = Ledger(folder / "out", request.as_json())
    return Session(Plan.of(request), ledger, None, lambda _: True, print, lambda *_: None)  # type: ignore[arg-type]


@pytest.fixture
def session(tmp_path: Path) -> Session:
    """Return the session of a finished commissioning, in which a cogging was found."""
    made = session_of(tmp_path)
    folder, ledger = made.ledger.folder, made.ledger
    write_bag(folder / BEFORE_BAG, 7e-6, 1.0)
    write_bag(folder / AFTER_BAG, 8e-7, 9.0)
    for name in ("diagnosis", "identification"):
        (folder / name).mkdir()
        (folder / name / "report.html").write_text("<p>a report</p>")
    (folder / "diagnosis" / "result.json").write_text('{"learnt": []}')
    ripple = 0.8 * np.sin(2.0 * np.pi * PLACE / PITCH + 0.3)
    noise, zero = 0.05 * np.random.default_rng(1).normal(size=TIME.size), np.zeros(TIME.size)
    trace = Trace(
        "own", 0.0, TIME, PLACE, np.gradient(PLACE, TIME), ripple + noise, zero, ripple, {"cogging": ripple}, zero,
        zero > 1.0, zero, zero,
    )  # fmt: skip
    write_residual_log([trace], "x", folder / "diagnosis")
    ledger.facts |= {
        "origin": 0.0, "model": learn.WITHOUT_OFFSET, "diagnosis": "diagnosis",
        "gap": {"given": 10.5, "before": 10.8, "after": 1.72, "floor": 1.7},
        OWN_MOTION_GAP: {"file": 27.0, "identified": 5.3}, LIGHTS: [asdict(light) for light in QUESTIONS],
    }  # fmt: skip
    ledger.effects = [COGGING, RESOLUTION]
    ledger.tracking = {"rms_before": 5e-6, "rms_after": 6e-7, "peak_before": 7e-6, "peak_after": 8e-7, "unit": "m"}
    ledger.is_usable = True
    ledger.note("check", DONE, 1.0, "checked", [], ["Warning: look at the cable."])
    return made


def page_of(session: Session) -> str:
    """Write the page and return it."""
    write_report(session)
    return (session.ledger.folder / REPORT).read_text(encoding="utf-8")


def texts_of(page: str) -> list[str]:
    """Return the texts in the drawings of a page."""
    return re.findall(r"<text[^>]*>([^<]+)</text>", page)


def test_the_gap_of_the_file_is_that_of_the_users_own_file(session: Session) -> None:
    page = page_of(session)
    assert (
        "The gap of your file is 27 % of the rms force; of the identified values 5.3 %; of the identified values"
        " without the offset, refitted for the diagnosis, 10.8 %; of the model with all that was found 1.72 %. No"
        " recorded signal predicts the last 1.7 %." in page
    )
    assert "The file leaves 10.8 %" not in page
    bars = [text for text in texts_of(page) if text.endswith(" %")]
    assert bars[:4][::-1] == ["27 %", "5.3 %", "10.8 %", "1.72 %"] and "not predictable, 1.7 %" in bars
    names = ("with cogging", "no offset, refitted", "identified", "your file")
    assert [text for text in texts_of(page) if text in names] == list(names)


@pytest.mark.parametrize(
    ("model", "file_gap", "start", "state"),
    [(IDENTIFIED, 27.0, "the identified values", GOOD), (None, 2.0, "your file", UNSURE)],
)
def test_the_light_compares_with_the_users_file_and_names_the_start(
    session: Session, model: str | None, file_gap: float, start: str, state: str
) -> None:
    """A model that is far better than the start of the diagnosis may be no better than the file."""
    session.ledger.facts |= {"model": model, OWN_MOTION_GAP: {"file": file_gap, "identified": 5.3}}
    page = page_of(session)
    assert f"; of {start}, refitted for the diagnosis, 10.8 %;" in page
    light = re.search(r'<li class="(\w+)">(?:(?!</li>).)*predict your own motion better than your file', page)
    assert light is not None and light[1] == state


def test_the_tracking_error_zooms_and_both_motions_begin_at_zero(session: Session) -> None:
    page = page_of(session)
    found = re.findall(r'<script type="application/json">(.*?)</script>', page)
    panels = json.loads(found[0])["panels"]
    assert len(found) == 1 and panels[0]["label"] == "tracking error [um]" and panels[1]["label"] == "set-point [mm]"
    assert [line["label"] for line in panels[0]["lines"]] == ["without compensation", "with compensation"]
    before, after = (np.frombuffer(base64.b64decode(line["values"]), "<f4") for line in panels[0]["lines"])
    assert np.max(np.abs(before)) == pytest.approx(7.0, rel=1e-3)
    assert after == pytest.approx(before * 8.0 / 70.0, abs=0.01)


def test_questions_of_the_diagnosis_and_links_to_its_report_are_on_the_page(session: Session) -> None:
    page = page_of(session)
    topics = re.findall(r"<h3>(\w+)</h3>", page)
    assert topics == ["Tracking", "Data", "Convergence", "Believability"]
    for light in QUESTIONS:
        assert light.question in page and light.answer in page
    assert re.findall(r'<a href="([^"]+)">', page) == ["diagnosis/report.html", "identification/report.html"]
    places = [page.index(text) for text in ('class="warnings"', 'class="links"', "<svg", 'class="lights"')]
    assert places == sorted(places)
    (session.ledger.folder / "identification" / "report.html").unlink()
    session.ledger.facts["diagnosis"] = "diagnosis_1"
    assert "<a href" not in page_of(session)


def test_what_was_found_is_drawn_over_the_position(session: Session) -> None:
    page = page_of(session)
    texts = texts_of(page)
    assert "Residual of the model without cogging" in page
    assert "effect, forward" in texts and "position [mm]" in texts
    (session.ledger.folder / "diagnosis" / "residual.mcap").unlink()
    assert "Residual of the model" not in page_of(session)


def test_the_page_reads_well_and_is_small(session: Session, browser: Browser) -> None:
    page_of(session)
    check_report(browser, session.ledger.folder / REPORT, 3)


@pytest.mark.parametrize(("shares", "has_model"), [((0.27, 0.053), True), ((0.27, 0.26), False)])
def test_identify_keeps_what_the_file_and_the_identified_values_leave(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, shares: tuple[float, float], has_model: bool
) -> None:
    session = session_of(tmp_path)
    monkeypatch.setattr(learn, "identify_bags", lambda *_: SimpleNamespace(path=tmp_path / "start.yaml"))
    monkeypatch.setattr(learn, "unexplained", lambda *_: shares)
    monkeypatch.setattr(learn, "_without_new_offset", lambda *_: IDENTIFIED)
    learn.identify(session)
    facts = session.ledger.facts
    assert facts[OWN_MOTION_GAP] == pytest.approx({"file": 100.0 * shares[0], "identified": 100.0 * shares[1]})
    assert bool(facts["model"]) == has_model
    session.ledger.note("identify", DONE, 1.0, "identified", [])
    session.ledger.begin("identify")
    assert OWN_MOTION_GAP not in facts


def test_a_diagnosis_keeps_its_questions_with_what_goes_back_to_the_one_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = session_of(tmp_path)
    result = {"effects": [], "gap": {"before": 3.0, "after": 2.0, "floor": 1.0}, "verdict": "no_effect"}
    (session.ledger.folder / "diagnosis").mkdir()
    session.path("diagnosis/result.json").write_text(json.dumps(result))
    done: Any = SimpleNamespace(answer=SimpleNamespace(warnings=()), checks=(), tracking=None, units=session.axis.units)
    monkeypatch.setattr(learn, "diagnose_bags", lambda *_: done)
    monkeypatch.setattr(learn, "_titled", lambda _: lambda title: nullcontext())
    monkeypatch.setattr(learn, "questions_of", lambda *_: QUESTIONS)
    learn.diagnose_bags_of(session, ["recordings/learn"], "diagnosis")
    assert [Light(**entry) for entry in session.ledger.facts[LIGHTS]] == list(QUESTIONS)
    assert LIGHTS in DIAGNOSED
