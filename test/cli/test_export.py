"""``sgms export`` as a user meets it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from c_build import needs

from sgms_observer.cli.main import main

CONFIG = Path(__file__).resolve().parents[2] / "config"


@needs("gcc", "make")
def test_c_folder_tests_itself(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "drive"
    assert main(["export", str(CONFIG / "paper.yaml"), "--target", "c", "--out", str(folder)]) == 0
    said = capsys.readouterr()
    assert "Warning: x.estimator.kind is mhe" in said.err
    assert f"make -C {folder} test" in said.out
    done = subprocess.run(["make", "-s", "-C", str(folder), "test"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_nothing_is_overwritten_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["export", str(CONFIG / "paper.yaml"), "--target", "c", "--out", str(tmp_path / "drive"), "--quiet"]
    assert main(command) == 0
    capsys.readouterr()
    assert main(command) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert main([*command, "--overwrite"]) == 0
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").write_text("work of a year")
    assert main([*command[:-2], str(tmp_path / "mine"), "--overwrite"]) == 1
    assert "was not written by sgms export" in capsys.readouterr().err


def test_axes_and_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = str(CONFIG / "table.yaml")
    out = str(tmp_path / "y")
    assert main(["export", table, "--target", "c", "--out", out, "--axis", "y", "--real", "float", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["axes"] == ["y"]
    assert "sgms.h" in result["files"]
    assert "#define SGMS_FLOAT" in (tmp_path / "y" / "sgms.h").read_text(encoding="utf-8")
    assert main(["export", table, "--target", "c", "--out", str(tmp_path / "z"), "--axis", "z"]) == 1
    assert f"--axis z is not in {table}; it has x, y" in capsys.readouterr().err
    both = ["--target", "fmu", "--out", str(tmp_path / "b.fmu"), "--axis", "x", "--axis", "y"]
    assert main(["export", table, *both]) == 1
    assert "an FMU holds one axis" in capsys.readouterr().err


@needs("cc")
def test_without_a_compiler_an_fmu_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    command = ["export", str(CONFIG / "paper.yaml"), "--target", "fmu", "--out", str(tmp_path / "x.fmu")]
    assert main(command) == 1
    assert "there is no no-such-compiler" in capsys.readouterr().err
    monkeypatch.delenv("CC")
    assert main([*command, "--fmi", "2"]) == 0
    assert (tmp_path / "x.fmu").stat().st_size > 10_000
