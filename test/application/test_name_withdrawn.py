"""A name has to explain what its own coordinates predict; otherwise what they predict is learnt."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from start_file import WINDOW, start_file

from sgms_observer.application.commission.motion import representative_motion
from sgms_observer.application.diagnose import DiagnoseRequest, diagnose_bags
from sgms_observer.application.simulate import Simulation, simulate
from sgms_observer.diagnosis import workflow
from sgms_observer.excitation.limits import limits_of
from sgms_observer.settings.load import load_settings

STAGE = """      stage:
        reference: {kind: file, file: FILE}
        encoder: {resolution: 1.0e-8, noise: 2.0e-8}
        force_noise: 0.05
"""
PLACES = np.linspace(-0.01, 0.01, 9)
SLOPE = 0.6 * PLACES / PLACES[-1]
UNEVEN = np.array([0.0, 0.25, -0.2, 0.1, 0.3, -0.3, 0.15, -0.2, 0.2])


@pytest.mark.parametrize(("bumps", "name"), [(0.0, "spring"), (1.0, None)])
def test_a_force_along_the_stroke(
    bumps: float, name: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A straight one is a spring. An uneven one is none, although a spring predicts most of it."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("spring", "offset", "asymmetric_coulomb"))
    force = [round(float(value), 4) for value in SLOPE + bumps * UNEVEN]
    places = [round(float(value), 5) for value in PLACES]
    hidden = (
        "      effects: {names: [learnt_map], learnt_map: {coordinates: [position], reversal_distance: 1.0e-6,"
        f" position: {places}, values: {force}}}}}\n"
    )
    motion = representative_motion(limits_of("prismatic", None, None, None), 1.0e-3)
    motion.write(tmp_path / "reference.csv")
    start, table = tmp_path / "start.yaml", tmp_path / "table.yaml"
    start.write_text(start_file(WINDOW))
    table.write_text(start_file(WINDOW) + hidden + STAGE.replace("FILE", str(tmp_path / "reference.csv")))
    for seed in (1, 2):
        stage = Simulation(load_settings(table), motion.duration, seed, False)
        simulate(stage, str(tmp_path / f"bag{seed}"), "mcap", True, lambda _: None)
    diagnose_bags(
        DiagnoseRequest([str(tmp_path / "bag1")], str(start), str(tmp_path / "out"), [str(tmp_path / "bag2")])
    )
    result: dict[str, Any] = json.loads((tmp_path / "out" / "result.json").read_text())
    assert [one["name"] for one in result["effects"]] == ([name] if name else [])
    (asked,) = [one for one in result["tests"] if "its coordinates predict" in one["name"]]
    assert asked["of"] == "spring" and asked["passed"] == (name is not None)
    assert bool(result["learnt"]) == (name is None)
