"""Each script of examples/ runs with short recordings and prints what its job is about; the page lists every one."""

from __future__ import annotations

import math
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from sgms_observer.application.commission.run import STEPS
from sgms_observer.outcome import EXIT_NOT_USABLE
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
PAGE = (EXAMPLES / "README.md").read_text(encoding="utf-8")
DATA = "recordings.py"
MEASURED = "emps.py"
LONGEST = 60  # lines of a script; emps.py is a study, not an example of one job


def _run(name: str, *arguments: str, code: int = 0) -> str:
    """Return what an example prints; it ends with an exit code."""
    result = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
    )  # fmt: skip
    assert result.returncode == code, result.stderr
    return result.stdout


def test_page_lists_every_script() -> None:
    scripts = {path.name for path in EXAMPLES.glob("*.py")} - {DATA}
    listed = re.findall(r"^\| [^|]+ \| `(\w+\.py)` \| `python examples/(\w+\.py)[^`]*` \|$", PAGE, re.MULTILINE)
    assert {script for script, _ in listed} == scripts
    assert all(script == command for script, command in listed)


def test_scripts_are_short() -> None:
    for path in EXAMPLES.glob("*.py"):
        if path.name not in (DATA, MEASURED):
            assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST, path.name


def test_a_log_becomes_a_bag_in_si_units(tmp_path: Path) -> None:
    said = _run("convert_a_log", "--out", str(tmp_path), "--seconds", "6")
    assert "6000 samples of axis x, 5.999 s at 1000 Hz" in said
    assert "position -10 mm to 10 mm" in said and "usable for: identify, diagnose, replay" in said
    mass = float(re.findall(r"mass (\S+) \+-", said)[0])
    assert mass == pytest.approx(10.0, rel=0.1)


def test_a_first_parameter_file_fits_its_bag(tmp_path: Path) -> None:
    said = _run("start_a_parameter_file", "--out", str(tmp_path), "--seconds", "6")
    assert f"{tmp_path / 'first.yaml'} is right and fits {tmp_path / 'learn'}" in said


def test_many_recordings_are_diagnosed_each_by_itself(tmp_path: Path) -> None:
    said = _run("process_many_recordings", "--out", str(tmp_path), "--seconds", "4")
    assert "2 of 2 recordings gave a result" in said
    assert re.search(r"^learn: \w+, found .*cogging", said, re.MULTILINE)
    assert (tmp_path / "diagnosed" / "report.html").exists()


def test_identification_finds_the_mass(tmp_path: Path) -> None:
    said = _run("identify_from_a_bag", "--out", str(tmp_path), "--seconds", "8")
    mass = float(re.findall(r"mass (\S+) kg", said)[-1])
    assert mass == pytest.approx(10.0, rel=0.02)


def test_diagnosis_finds_cogging_and_its_result_is_read(tmp_path: Path) -> None:
    said = _run("diagnose_a_bag", "--out", str(tmp_path), "--seconds", "5")
    assert "found: cogging" in said
    said = _run("read_a_result", str(tmp_path / "diagnosis" / "result.json"))
    pitch = float(re.findall(r"pitch = (\S+) \+-", said)[0])
    assert pitch == pytest.approx(2.0e-3, rel=0.01)


def test_observer_runs_over_a_bag(tmp_path: Path) -> None:
    said = _run("replay_a_bag", "--out", str(tmp_path), "--seconds", "3")
    assert "3000 samples" in said and "the estimator runs on good samples" in said


def test_compensation_improves_tracking_with_the_gain(tmp_path: Path) -> None:
    said = _run("compensate_in_the_loop", "--out", str(tmp_path), "--seconds", "2")
    errors = [float(value) for value in re.findall(r"tracking error (\S+) um rms", said)]
    assert errors == sorted(errors, reverse=True) and errors[-1] < 0.2 * errors[0]


def test_excitation_is_written_inside_the_stroke(tmp_path: Path) -> None:
    _run("design_an_excitation", "--out", str(tmp_path), "--seconds", "15")
    rows = [line.split(",") for line in (tmp_path / "excite.csv").read_text(encoding="utf-8").splitlines()[1:]]
    assert len(rows) > 1000 and max(abs(float(row[1])) for row in rows) <= 0.01


def test_own_effect_acts(tmp_path: Path) -> None:
    said = _run("add_an_effect", "--out", str(tmp_path))
    assert load_settings(tmp_path / "mine.yaml").axes[0].effects[0].name == "end_stop_rubber"
    low, high = (float(value) for value in re.findall(r"rubber: (\S+) to (\S+) N", said)[0])
    expected = 2.0 * math.tanh(200.0e-6 / 1.0e-4)  # at the ends of the default sine of 200 um
    assert (low, high) == pytest.approx((-expected, expected), rel=0.02)


def test_c_is_exported_and_equal(tmp_path: Path) -> None:
    if shutil.which("cc") is None or shutil.which("make") is None:
        pytest.skip("no C compiler and make on this machine")
    assert "equal to Python" in _run("export_c", "--out", str(tmp_path))


def test_a_controller_is_exported(tmp_path: Path) -> None:
    said = _run("export_a_ros2_controller", "--out", str(tmp_path))
    assert "type: sgms_friction_compensation/FrictionCompensation" in said and "update_rate: 1000" in said
    assert (tmp_path / "src" / "sgms_friction_compensation" / "package.xml").is_file()


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler on this machine")
def test_an_fmu_is_exported_and_runs(tmp_path: Path) -> None:
    """Below the static force the contact yields by micrometres; above it the stage slides."""
    said = _run("export_an_fmu", "--out", str(tmp_path))
    assert (tmp_path / "stage.fmu").is_file()
    pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
    stuck, slid = (float(value) for value in re.findall(r"moves by (\S+) um", said))
    assert 0.0 < stuck < 10.0 and slid > 100.0


@pytest.mark.live
def test_commissioning_begins_with_the_stage_as_machine_and_keeps_to_its_time(tmp_path: Path) -> None:
    """The whole way is `test_commission.py`'s; here no motion fits into the time, so every step says so."""
    pytest.importorskip("rclpy", reason="there is no ROS here")
    said = _run("commission_a_simulated_table", "--out", str(tmp_path), "--time", "2", code=EXIT_NOT_USABLE)
    steps = re.findall(r"^(\w+): (done|skipped) in", said, re.MULTILINE)
    assert steps[1:] == [(step.name, "skipped") for step in STEPS[1:-1]] + [("report", "done")]
    machine, mine = (load_settings(tmp_path / f"{name}.yaml").axes[0] for name in ("machine", "mine"))
    assert [effect.name for effect in machine.effects] == ["cogging"] and mine.effects == ()
    assert machine.stage.reference.kind == "topic"
    assert (tmp_path / "commissioning" / "report.html").is_file()
