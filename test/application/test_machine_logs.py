"""Raw files of real machines: each goes through convert, info, init and check with what its owner knows."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import pytest
from machines import machine_file, needs_machines

from sgms_observer.cli.main import main
from sgms_observer.settings.load import load_settings

PAN = "roll_motor_r.joints_state_samples"


@dataclass(frozen=True)
class Machine:
    """A raw file and what must come of it."""

    file: str
    columns: tuple[str, ...]
    joint_type: str
    samples: int
    rate: float
    step: float | None  # m or rad; None where the log shows none
    uses: frozenset[str]
    mass: tuple[float, float] | None = None
    coulomb: tuple[float, float] | None = None
    viscous: tuple[float, float] | None = None


MACHINES = {
    # published: viscous 20.22 N m s/rad, Coulomb 13.27 N m
    "ur10e": Machine(
        "ur10e/joint_2.csv", ("time=1", "position=3", "control_effort=15*10.6956"), "revolute", 6030, 93.7, 1e-4,
        frozenset(("identify", "diagnose", "replay")), (5.0, 40.0), (10.0, 17.0), (16.0, 24.0),
    ),
    "kr300": Machine(
        "kr300/trajectory_A.mat",
        (
            "time=rec.time_cont", "position=rec.act_pos_mot_deg[2]*pi/180",
            "control_effort=rec.act_torque_abs_nm[2]*para.u[2]",
        ),
        "revolute", 2501, 250.0, None, frozenset(("identify", "replay")),
    ),
    # published: mass 6.28 kg, encoder 88 um
    "cart": Machine(
        "cart/rail_0m40.csv", ("time=1", "position=3", "control_effort=2*0.0934/0.028"), "prismatic", 3094, 149.9,
        88e-6,
        frozenset(("identify", "diagnose", "replay")), (5.6, 6.9),
    ),
    "electric_cylinder": Machine(
        "electric_cylinder/pp-sine-sweep.txt", ("time=1*0.001", "position=4*0.001", "control_effort=6*0.001"),
        "prismatic", 3001, 100.0, 1e-5, frozenset(("identify", "diagnose", "replay")),
    ),
    "pan_tilt": Machine(
        "pan_tilt/roll_torque.mat", (f"time={PAN}.time", f"position={PAN}.position", f"control_effort={PAN}.effort"),
        "revolute", 61584, 331.0, 24e-6, frozenset(("replay",)),
    ),
}  # fmt: skip


def run(capsys: pytest.CaptureFixture[str], *arguments: str) -> dict:
    """Run a command with ``--json`` and return its result."""
    assert main([*arguments, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@needs_machines
@pytest.mark.parametrize("name", MACHINES)
def test_from_raw_file_to_parameter_file(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    machine = MACHINES[name]
    bag, yaml = str(tmp_path / "bag"), str(tmp_path / "start.yaml")
    converted = run(
        capsys, "convert", machine_file(machine.file), "--out", bag, "--map", *machine.columns, "--axis", "q"
    )
    assert converted["bags"][0]["samples"] == pytest.approx(machine.samples, rel=0.01)
    info = run(capsys, "info", bag, "--joint-type", machine.joint_type)
    axis = info["axes"][0]
    assert axis["rate_hz"] == pytest.approx(machine.rate, rel=0.01)
    if machine.step is None:
        assert axis["position"]["step"] is None
    else:
        assert axis["position"]["step"] == pytest.approx(machine.step, rel=0.01)
    assert {use["for"] for use in axis["uses"] if use["possible"]} == machine.uses
    assert all(use["reason"] for use in axis["uses"] if not use["possible"])
    assert axis["sign"] == (None if name == "pan_tilt" else "as the motion")
    made = run(capsys, "init", bag, "--out", yaml, "--joint-type", machine.joint_type)["axes"][0]
    for key, bounds in (
        ("mass", machine.mass),
        ("coulomb_force", machine.coulomb),
        ("viscous_coefficient", machine.viscous),
    ):
        if bounds is not None:
            assert bounds[0] < made[key] < bounds[1], key
    if name == "ur10e":
        assert made["effects"]["gravity"]["amplitude"] == pytest.approx(112.0, rel=0.05)
    elif machine.joint_type == "prismatic":
        assert "gravity" not in made["effects"]
    assert load_settings(yaml).axes[0].joint_type == machine.joint_type
    checked = run(capsys, "check", yaml, bag)
    assert checked["fits"] and checked["faults"] == []


@needs_machines
def test_the_same_joint_in_degrees_and_against_the_motion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Scales give the same file as SI, and init sees that the effort is counted against the motion."""
    made = {}
    for name, columns in {
        "si": ("position=3", "control_effort=15*10.6956"),
        "odd": ("position=3*180/pi", "control_effort=15*-10695.6"),
    }.items():
        bag, yaml = str(tmp_path / name), str(tmp_path / f"{name}.yaml")
        run(capsys, "convert", machine_file("ur10e/joint_2.csv"), "--out", bag, "--map", "time=1", *columns)
        scales = ("--position-scale", "0.017453292519943295", "--effort-scale", "0.001") if name == "odd" else ()
        made[name] = run(capsys, "init", bag, "--out", yaml, "--joint-type", "revolute", *scales)
        assert run(capsys, "check", yaml, bag)["fits"]
    si, odd = made["si"]["axes"][0], made["odd"]["axes"][0]
    assert odd["effort_scale"] == -0.001
    assert any("reversed relative to position" in warning for warning in made["odd"]["warnings"])
    for key in ("mass", "coulomb_force", "viscous_coefficient"):
        assert odd[key] == pytest.approx(si[key], rel=1e-3)
    assert odd["effects"]["gravity"]["angle"] == pytest.approx(si["effects"]["gravity"]["angle"], abs=1e-3)
