"""Warnings go to stderr in every command, so that neither ``--quiet`` nor ``--json`` hides them."""

from __future__ import annotations

import ast
import json
import shutil
import types
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application import diagnose as diagnose_job
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.cli import warn as warnings
from sgms_observer.cli.main import main
from sgms_observer.diagnosis.changed import Changed
from sgms_observer.settings.units import Units

COMMANDS = Path(warnings.__file__).parent
CONFIG = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x: {mass: 3.0, filter: {window: 8.0e-3}, estimator: {kind: ekf, correction_every: 2}}
"""
CHANGED = (Changed("friction.element_stiffness (sum)", 1.295e6, 1.555e6, 1e4, 0.5),)
SWITCHES = ([], ["--quiet"], ["--json"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a bag whose effort has the wrong sign, a damaged copy of it, and settings."""
    made = tmp_path_factory.mktemp("warnings")
    time = 1e-3 * np.arange(20_000)
    position, speed = 1e-2 * np.sin(3.0 * time), 3e-2 * np.cos(3.0 * time)
    effort = -(4.0 * np.tanh(speed / 1e-3) + 20.0 * speed - 3.0 * 9e-2 * np.sin(3.0 * time))
    write_table(Table(10**9 + 1_000_000 * np.arange(20_000), position, effort, None, None, ()), made / "bag", "x")
    shutil.copytree(made / "bag", made / "damaged")
    (data,) = (made / "damaged").glob("*.mcap")
    content = bytearray(data.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 64] = bytes(64)
    data.write_bytes(content)
    (made / "axis.yaml").write_text(CONFIG)
    return made


@pytest.mark.parametrize("switch", SWITCHES)
def test_info_warns_on_stderr(folder: Path, capsys: pytest.CaptureFixture[str], switch: list[str]) -> None:
    assert main(["info", str(folder / "bag"), *switch]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith("Warning: x: the ") and "effort_scale: -1" in printed.err
    assert "Warning" not in printed.out
    if switch == ["--json"]:
        assert any("effort_scale: -1" in doubt for doubt in json.loads(printed.out)["axes"][0]["doubts"])


@pytest.mark.parametrize("switch", SWITCHES)
@pytest.mark.parametrize("bags", [1, 2])
def test_replay_warns_of_a_damaged_bag_on_stderr(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], switch: list[str], bags: int
) -> None:
    recordings = [str(folder / "damaged")] * bags
    arguments = ["--config", str(folder / "axis.yaml"), "--out", str(tmp_path / "out"), "--no-report", "--workers", "1"]
    assert main(["replay", *recordings, *arguments, *switch]) == 0
    printed = capsys.readouterr()
    lines = printed.err.splitlines()
    assert len([line for line in lines if line.startswith("Warning: ") and "damaged chunk" in line]) == bags
    assert "damaged chunk" not in printed.out or switch == ["--json"]


@pytest.mark.parametrize("switch", SWITCHES)
def test_diagnose_warns_on_stderr(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], switch: list[str]
) -> None:
    """The command's own words, about a result that is made here."""
    gap = types.SimpleNamespace(
        held_out="held-out", band=10.0, given=3.0, before=2.0, after=1.0, floor=0.5,
        unweighted_before=7.0, unweighted_after=6.0,
    )  # fmt: skip
    answer = types.SimpleNamespace(
        gap=gap, warnings=("the recording is short", "stage.controller differs"), verdict="cannot_tell", effects=(),
        learnt=(), changed=CHANGED, gap_with_learnt=1.0, next_experiment=None, usable=True, remainder="none", tests=(),
    )  # fmt: skip
    check = types.SimpleNamespace(innovation=1.0, friction_not_cancelled=1.0, along="the motion", share=0.5)
    done = types.SimpleNamespace(answer=answer, units=Units(), notes=("read",), checks=(check, check), tracking=None)
    monkeypatch.setattr(diagnose_job, "diagnose_bags", lambda request, show: done)
    (tmp_path / "result.json").write_text('{"schema": 2}')
    arguments = ["diagnose", str(folder / "bag"), "--config", str(folder / "axis.yaml"), "--out", str(tmp_path)]
    assert main([*arguments, "--overwrite", *switch]) == 0
    printed = capsys.readouterr()
    assert printed.err == "Warning: the recording is short.\nWarning: stage.controller differs.\n"
    assert "Warning" not in printed.out
    if not switch:
        alike = "  with equal weight for all samples, also at rest: 7 refitted, 6 with the effects and changed values\n"
        assert alike in printed.out
        assert "  changed: friction.element_stiffness (sum): 1.295e+06 -> 1.555e+06 N/m\n" in printed.out


def test_the_prefix_stands_once(capsys: pytest.CaptureFixture[str]) -> None:
    warnings.warn(["x is small", "Warning: y is large"])
    assert capsys.readouterr().err == "Warning: x is small\nWarning: y is large\n"


def test_a_command_that_runs_says_warnings_on_stderr(capsys: pytest.CaptureFixture[str]) -> None:
    for sentence in ("learn: done", "Warning: NIS is 3"):
        warnings.say(sentence)
    printed = capsys.readouterr()
    assert (printed.out, printed.err) == ("learn: done\n", "Warning: NIS is 3\n")


@pytest.mark.parametrize("switch", SWITCHES)
def test_excite_warns_on_stderr(folder: Path, capsys: pytest.CaptureFixture[str], switch: list[str]) -> None:
    """So small a motion does not tell an offset from asymmetric Coulomb friction."""
    question = ["--for", "asymmetric_coulomb,offset", "--stroke", "1e-4", "--speed", "1e-4", "--duration", "10"]
    made = [*question, "--out", str(folder / "excite.csv"), "--overwrite"]
    assert main(["excite", "--config", str(folder / "axis.yaml"), *made, *switch]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith("Warning: x: no motion within these limits separates ")
    assert "Warning" not in printed.out
    if switch == ["--json"]:
        assert [f"Warning: {sentence}\n" for sentence in json.loads(printed.out)["warnings"]] == [printed.err]


PRINTS_WARNINGS = "warn.py"
"""The one place that does."""


def _printed_by_hand(path: Path) -> Iterator[int]:
    """Yield the lines in which a command prints a warning in another way than ``warn``."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        is_print = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
        if is_print and "warning" in "".join(map(ast.unparse, node.args)).lower():
            yield node.lineno


@pytest.mark.parametrize("path", sorted(COMMANDS.glob("*.py")), ids=lambda path: path.name)
def test_no_command_prints_warnings_in_a_way_of_its_own(path: Path) -> None:
    assert path.name == PRINTS_WARNINGS or list(_printed_by_hand(path)) == []
