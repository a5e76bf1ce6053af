"""docs/diagnosis.md states the criteria of the code, and docs/glossary.md explains every key of result.json."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sgms_observer.diagnosis.changed import Changed
from sgms_observer.diagnosis.compensation_check import CompensationCheck
from sgms_observer.diagnosis.criteria import Criteria, at_least
from sgms_observer.diagnosis.evidence import Improvement
from sgms_observer.diagnosis.gap import Gap
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.map_fit import FittedMap
from sgms_observer.diagnosis.named import Named
from sgms_observer.diagnosis.recorded_controller import RecordedController
from sgms_observer.diagnosis.result import result_of
from sgms_observer.diagnosis.tracking import PredictedTracking, TrackingError
from sgms_observer.effects.learnt_map import LearntMap
from sgms_observer.settings.axis import ControllerSettings, EffectSettings
from sgms_observer.settings.units import Units

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "diagnosis.md").read_text(encoding="utf-8")
GLOSSARY = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
PATHS = [*(ROOT / "sgms_observer" / "diagnosis").glob("*.py"), ROOT / "sgms_observer" / "application" / "diagnose.py"]
SOURCE = "\n".join(path.read_text(encoding="utf-8") for path in PATHS)
ROWS = re.findall(r"^\| ([^|]+) \| [^|]+ \| (`\w+`|-) \| ([\d.]+) \|$", PAGE, re.MULTILINE)
NATURAL = {
    "shortest likely lag of the effort over sample period": 0.62,
    "parameters at the end of their range": 0.0,
    "other parts of another contact law": 0.0,
    "z-score of a better prediction than logarithmic friction, where the contact slides fast": 0.0,
    "residual predictable over the coordinates of a contact / closed residual": 1.0,
    "90 % interval of a pitch, place or width over the stroke": 1.0,
    "friction that reverses within one encoder step, over the static force": 1.0,
    "friction not cancelled by the feedforward: z-score of its growth": 3.0,
}
"""Thresholds that nobody could choose otherwise."""
TITLES = (
    "HELD_OUT_GAP", "CLOSED_SHARE", "UNEXPLAINED_WHILE_SLIDING", "UNEXPLAINED", "OVER_NOISE", "ADDED_BY_REFIT",
    "BEHIND_ENCODER", "DIFFERS_BY_DIRECTION", "SIZE_BEYOND_TOLERANCE", "FORM",
)  # fmt: skip
"""Constants that hold the name of a test."""
BY_PARAMETER = {"effects.parameters", "effects.std_error", "detectable"}
"""Keys whose own keys are names of the catalogue."""


def full_answer() -> Any:
    """Return an answer with one of everything."""
    none = np.zeros(1)
    gap = Gap(5.0, 4.0, 2.0, 1.0, 0.5, 4.0, 2.0, (3.9, 4.1), (1.9, 2.1), "held-out", 100.0, 1.1)
    named = Named(EffectSettings("offset", (0.6,)), (0.01,), 0.9, ("cogging",), 4.0, 2.0)
    table = LearntMap(("position",), ((0.0, 1.0),), (0.0, 1.0))
    learnt = FittedMap(table, ("position",), Improvement(1.0, 4.0, 2.0), 0.5, "a force", np.ones(len(table.values)))
    return SimpleNamespace(
        verdict="effect_found", usable=True, warnings=(), gap=gap, effects=(named,), learnt=(learnt,),
        changed=(Changed("friction.coulomb_force", 4.0, 5.0, 0.1, 0.5),), remainder="none",
        tests=(at_least("offset", "any", 1.0, 0.0),),
        located=(Located("position", "m", none, none, none, 0.5, 0.01, 0.0, 1.0),), detectable={"offset": 0.1},
        next_experiment=None, gap_with_learnt=1.5, diagnosis=SimpleNamespace(notes=()),
    )  # fmt: skip


def keys_of(tree: Any, above: str = "") -> set[str]:
    """Return the dotted keys of a result."""
    if isinstance(tree, list):
        return {key for item in tree for key in keys_of(item, above)}
    if not isinstance(tree, dict) or above.rstrip(".") in BY_PARAMETER:
        return set()
    below = {key for name, item in tree.items() for key in keys_of(item, f"{above}{name}.")}
    return below | {above + key for key in tree}


def test_every_key_of_result_json_is_in_the_glossary_and_no_other() -> None:
    section = GLOSSARY.partition("## Keys of result.json")[2]
    explained = re.findall(r"^\| `([\w.]+)` \| \S.*\. \| .+ \|$", section, re.MULTILINE)
    assert len(explained) == len(set(explained))
    error = TrackingError(1.0e-6, 2.0e-6)
    controller = RecordedController(ControllerSettings(), np.zeros(0))
    tracking = PredictedTracking(error, error, error, error, 10.0, controller=controller)
    result = result_of(full_answer(), (CompensationCheck(1.0, 2.0), CompensationCheck(0.5, 1.0)), tracking, Units())
    assert set(explained) == keys_of(result)


@pytest.mark.parametrize(
    "term",
    ["NRMSE", "two sigma", "round (of a search)", "contact law", "fast sliding", "`friction_std`", "hysteresis",
     "Stribeck curve", "Stribeck velocity", "baseline"],
)  # fmt: skip
def test_terms_of_reports_and_pages_are_in_the_glossary(term: str) -> None:
    row = re.findall(rf"^\| {re.escape(term)} \| ([^|]+) \| [^|]+ \|$", GLOSSARY, re.MULTILINE)
    assert len(row) == 1 and row[0].count(". ") == 0 and row[0].endswith(".")


def test_both_pages_print_the_same_of_the_worked_example() -> None:
    printed = [
        re.findall(r"```text\n(note: band .*?)```", (ROOT / "docs" / page).read_text(encoding="utf-8"), re.DOTALL)
        for page in ("diagnose.md", "worked_example.md")
    ]
    assert printed[0] == printed[1] and len(printed[0]) == 1
    for line in ("verdict: ", "predicted tracking error along ", "wrote "):
        assert f"\n{line}" in printed[0][0]


@pytest.mark.parametrize("field", [field.name for field in fields(Criteria)])
def test_every_criterion_is_on_the_page(field: str) -> None:
    assert f"`{field}`" in PAGE


def test_thresholds_are_those_of_the_code() -> None:
    criteria = Criteria()
    assert len(ROWS) >= 10
    for name, field, value in ROWS:
        expected = NATURAL[name.strip()] if field == "-" else getattr(criteria, field.strip("`"))
        assert float(value) == pytest.approx(expected, abs=5e-4)
    for field in ("block", "min_gap_over_floor", "max_effects"):
        said = re.search(rf"`{field}`, ([\d.]+)", PAGE)
        assert said is not None and float(said.group(1)) == getattr(criteria, field)


def test_every_test_of_the_code_is_on_the_page_and_no_other() -> None:
    named = set(re.findall(r"\bat_(?:least|most)\(\s*[\w.\"]+,\s*\"([^\"]+)\"", SOURCE))
    named |= {re.split(r"(?: over)? {", title)[0] for title in re.findall(r"title = f?\"([^\"]+)\"", SOURCE)}
    named |= set(re.findall(rf"^(?:{'|'.join(TITLES)}) = \"([^\"]+)\"", SOURCE, re.MULTILINE))
    assert named and {row[0].strip() for row in ROWS} == named
