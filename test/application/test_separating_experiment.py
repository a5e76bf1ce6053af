"""The experiment of a commissioning on the simulated stage, without a graph: diagnosed, designed, played, diagnosed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from start_file import WINDOW, start_file

from sgms_observer.application.commission.motion import Motion, learning_motion, representative_motion
from sgms_observer.application.commission.next_experiment import (
    EXPERIMENT_SECONDS,
    MAX_EXPERIMENTS,
    separating,
    with_noise_of,
)
from sgms_observer.application.diagnose import DiagnoseRequest, diagnose_bags
from sgms_observer.application.simulate import Simulation, simulate
from sgms_observer.diagnosis import workflow
from sgms_observer.excitation.limits import limits_of
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import load_settings

START = start_file(WINDOW)
HIDDEN = """      effects: {names: [asymmetric_coulomb], asymmetric_coulomb: {share: 0.1}}
      stage:
        reference: {kind: file, file: FILE}
        encoder: {resolution: 1.0e-8, noise: 2.0e-8}
        force_noise: 0.6
"""
PERIOD = 1.0e-3
SEARCHED = ("asymmetric_coulomb", "offset", "spring", "cogging", "quadratic_drag", "actuator_gain")
"""Effects that are looked for here: the pair, and some of other kinds."""


def test_the_designed_motions_separate_what_the_first_recording_does_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At a constant sliding force, one that depends on the direction is an offset; around the Stribeck velocity not.

    In this much force noise the first recording leaves the pair ambiguous.
    The evidence of one experiment scatters; as the command does, another one follows while the pair is ambiguous.
    """
    monkeypatch.setattr(workflow, "catalogue_names", lambda: SEARCHED)
    start = tmp_path / "start.yaml"
    start.write_text(START)
    (axis,) = load_settings(start).axes
    limits = limits_of(axis.joint_type, None, None, None)

    def played(motion: Motion, name: str, seed: int) -> str:
        motion.write(tmp_path / f"{name}.csv")
        table = tmp_path / f"{name}.yaml"
        table.write_text(START + HIDDEN.replace("FILE", str(tmp_path / f"{name}.csv")))
        stage = Simulation(load_settings(table), motion.duration, seed, False)
        simulate(stage, str(tmp_path / name), "mcap", True, lambda _: None)
        return str(tmp_path / name)

    def named(bags: list[str], out: str) -> list[dict[str, Any]]:
        diagnose_bags(DiagnoseRequest(bags, str(start), str(tmp_path / out), [own], axis.name))
        effects: list[dict[str, Any]] = json.loads((tmp_path / out / "result.json").read_text())["effects"]
        return effects

    own = played(representative_motion(limits, PERIOD), "own", 1)
    friction = axis.friction
    deflections = np.array(friction.element_fraction) * friction.static_force / np.array(friction.element_stiffness)
    first_motion = learning_motion(limits, PERIOD, 2.0 * float(deflections.max()), friction.stribeck_velocity, 25.0)
    learn = played(first_motion, "learn", 5)
    bags, latest = [learn], "diagnosis"
    answers = [named(bags, latest)]
    assert [(one["name"], one["alternatives"]) for one in answers[0]] == [("asymmetric_coulomb", ["offset"])]
    while answers[-1][0]["alternatives"] and len(answers) <= MAX_EXPERIMENTS:
        (model,) = load_settings(tmp_path / latest / "augmented.yaml").axes
        found = separating([("asymmetric_coulomb", "offset")], with_noise_of(learn, model), limits, 0.0, PERIOD)
        assert found is not None
        number = len(answers)
        bags, latest = [*bags, played(found.motion, f"experiment_{number}", 5 + number)], f"diagnosis_{number}"
        answers.append(named(bags, latest))
    assert [(one["name"], one["alternatives"]) for one in answers[-1]] == [("asymmetric_coulomb", [])]


def test_what_is_too_weak_for_the_time_is_not_tried(tmp_path: Path) -> None:
    """The design expects the evidence that a diagnosis will see: that of the size that was found."""
    start = tmp_path / "start.yaml"
    start.write_text(START)
    (axis,) = load_settings(start).axes
    limits = limits_of(axis.joint_type, None, None, None)
    durations = []
    for share in (0.1, 0.02, 0.004):
        model = replace(axis, effects=(EffectSettings("asymmetric_coulomb", (share,)),))
        designed = separating([("asymmetric_coulomb", "offset")], model, limits, 0.0, PERIOD)
        durations.append(designed.motion.duration if designed else None)
    short, long, never = durations
    assert never is None and short is not None and long is not None
    assert short <= EXPERIMENT_SECONDS[0] < long <= EXPERIMENT_SECONDS[1]
