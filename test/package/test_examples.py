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

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"
PAGE = (EXAMPLES / "README.md").read_text(encoding="utf-8")
DATA = "recordings.py"
MEASURED = "emps.py"
LONGEST = 60  # lines of a script; emps.py is a study, not an example of one job


def _run(name: str, *arguments: str) -> str:
    """Return what an example prints."""
    result = subprocess.run(
        [sys.executable, str(EXAMPLES / f"{name}.py"), *arguments],
        cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
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
    said = _run("process_many_recordings", "--out", str(tmp_path), "--seconds", "5")
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
    from sgms_observer.settings.load import load_settings

    said = _run("add_an_effect", "--out", str(tmp_path))
    assert load_settings(tmp_path / "mine.yaml").axes[0].effects[0].name == "end_stop_rubber"
    low, high = (float(value) for value in re.findall(r"rubber: (\S+) to (\S+) N", said)[0])
    expected = 2.0 * math.tanh(200.0e-6 / 1.0e-4)  # at the ends of the default sine of 200 um
    assert (low, high) == pytest.approx((-expected, expected), rel=0.02)


def test_c_is_exported_and_equal(tmp_path: Path) -> None:
    if shutil.which("cc") is None or shutil.which("make") is None:
        pytest.skip("no C compiler and make on this machine")
    assert "equal to Python" in _run("export_c", "--out", str(tmp_path))
