"""A name has to explain what its own coordinates predict; otherwise what they predict is learnt."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from start_file import WINDOW, start_file

from sgms_observer.application.commission.motion import representative_motion
from sgms_observer.application.diagnose import DiagnoseRequest, diagnose_bags
from sgms_observer.application.simulate import Simulation, simulate
from sgms_observer.diagnosis import pruning, workflow
from sgms_observer.diagnosis.criteria import Test
from sgms_observer.excitation.limits import limits_of
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import load_settings

STAGE = """      stage:
        reference: {kind: file, file: FILE}
        encoder: {resolution: 1.0e-8, noise: 2.0e-8}
        force_noise: 0.05
"""
PLACES = np.linspace(-0.01, 0.01, 9)
SLOPE = 0.6 * PLACES / PLACES[-1]
UNEVEN = np.array([0.0, 0.25, -0.2, 0.1, 0.3, -0.3, 0.15, -0.2, 0.2])


def record(hidden: str, folder: Path) -> None:
    """Write the file of an axis, and two recordings of a stage with effects that the file lacks."""
    motion = representative_motion(limits_of("prismatic", None, None, None), 1.0e-3)
    motion.write(folder / "reference.csv")
    start, table = folder / "start.yaml", folder / "table.yaml"
    start.write_text(start_file(WINDOW))
    stage = STAGE.replace("FILE", str(folder / "reference.csv"))
    table.write_text(f"{start_file(WINDOW)}      effects: {hidden}\n{stage}")
    for seed in (1, 2):
        run = Simulation(load_settings(table), motion.duration, seed, False)
        simulate(run, str(folder / f"bag{seed}"), "mcap", True, lambda _: None)


def diagnosed(folder: Path, out: str = "out") -> dict[str, Any]:
    """Return what the diagnosis of the two recordings finds."""
    bags = [[str(folder / f"bag{seed}")] for seed in (1, 2)]
    diagnose_bags(DiagnoseRequest(bags[0], str(folder / "start.yaml"), str(folder / out), bags[1]))
    result: dict[str, Any] = json.loads((folder / out / "result.json").read_text())
    return result


@pytest.mark.parametrize(("bumps", "name"), [(0.0, "spring"), (1.0, None)])
def test_a_force_along_the_stroke(
    bumps: float, name: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A straight one is a spring. An uneven one is none, although a spring predicts most of it."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("spring", "offset", "asymmetric_coulomb"))
    force = [round(float(value), 4) for value in SLOPE + bumps * UNEVEN]
    places = [round(float(value), 5) for value in PLACES]
    record(
        "{names: [learnt_map], learnt_map: {coordinates: [position], reversal_distance: 1.0e-6,"
        f" position: {places}, values: {force}}}}}",
        tmp_path,
    )
    result = diagnosed(tmp_path)
    assert [one["name"] for one in result["effects"]] == ([name] if name else [])
    (asked,) = [one for one in result["tests"] if "over its coordinates" in one["name"]]
    assert asked["of"] == "spring" and asked["passed"] == (name is not None)
    assert bool(result["learnt"]) == (name is None)


def test_an_effect_that_ends_at_its_range_takes_no_other_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The final fit may move one effect to an end of its range: it is left out, the others stay."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("spring", "periodic_disturbance"))
    within_range = pruning.within_range

    def with_an_end(settings: EffectSettings, *others: Any) -> Test:
        test = within_range(settings, *others)
        return replace(test, value=1.0, passed=False) if settings.name == "periodic_disturbance" else test

    hidden = (
        "{names: [spring, periodic_disturbance], spring: {stiffness: 80.0},"
        " periodic_disturbance: {amplitude: 0.2, frequency: 7.0}}"
    )
    record(hidden, tmp_path)
    assert {one["name"] for one in diagnosed(tmp_path)["effects"]} == {"spring", "periodic_disturbance"}
    monkeypatch.setattr(pruning, "within_range", with_an_end)
    result = diagnosed(tmp_path, "again")
    assert [one["name"] for one in result["effects"]] == ["spring"]
    (asked,) = [one for one in result["tests"] if one["of"] == "periodic_disturbance" and one["value"] == 1.0]
    assert asked["name"] == "parameters at the end of their range" and not asked["passed"]
