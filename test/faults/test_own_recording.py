"""Results never take the place of the recording that they are made from, and a file is never taken for a folder."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from pathlib import Path

import pytest

from sgms_observer.cli.main import main
from sgms_observer.interrupts import noted_interrupts

_CONFIG = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x: {mass: 10.0, estimator: {kind: ekf}}
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a parameter file and a recording."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "axis.yaml").write_text(_CONFIG)
    arguments = ["simulate", "--config", str(folder / "axis.yaml"), "--out", str(folder / "bag"), "--duration", "0.2"]
    assert main(arguments) == 0
    return folder


@pytest.fixture
def folder(source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a copy of it, in which the command runs."""
    shutil.copytree(source, tmp_path, dirs_exist_ok=True)
    (tmp_path / "link").symlink_to("bag")
    (tmp_path / "notes.txt").write_text("mine\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _content(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


@pytest.mark.parametrize(
    "arguments",
    [
        ("replay", "bag", "--out", "bag", "--overwrite"),
        ("replay", "bag/bag_0.mcap", "--out", "bag", "--overwrite"),
        ("replay", "link", "--out", "./bag/../bag", "--overwrite"),
        ("replay", "bag", "link", "--out", ".", "--overwrite"),
        ("diagnose", "bag", "--out", "bag", "--overwrite"),
        ("diagnose", "bag", "--out", "other", "--holdout", "bag", "--overwrite"),
    ],
    ids=" ".join,
)
def test_a_recording_stays_as_it_is(
    arguments: tuple[str, ...], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = _content(folder / "bag")
    assert main([*arguments, "--config", "axis.yaml"]) == 1
    assert _content(folder / "bag") == before
    if "other" not in arguments:
        assert "is the recording" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ("diagnose", "bag", "--out", "notes.txt"),
        ("diagnose", "bag", "--out", "notes.txt/below"),
        ("identify", "bag", "--out", "notes.txt/below.yaml"),
        ("excite", "--out", "notes.txt/below.csv"),
    ],
    ids=" ".join,
)
def test_a_file_where_a_folder_must_be_is_told_before_any_work(
    arguments: tuple[str, ...], folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*arguments, "--config", "axis.yaml"]) == 1
    output, errors = capsys.readouterr()
    assert "cannot be written: it is a file, or lies in one, where a folder must be" in errors
    assert errors.count("\n") == 1
    assert output == ""
    assert (folder / "notes.txt").read_text() == "mine\n"


def test_the_demo_refuses_a_file_and_a_report_that_is_there(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rclpy", reason="ROS 2 is not installed")
    assert main(["demo", "--out", "notes.txt"]) == 1
    assert "where a folder must be" in capsys.readouterr().err
    (folder / "out").mkdir()
    (folder / "out" / "report.html").write_text("mine\n")
    assert main(["demo", "--out", "out"]) == 1
    assert "report.html exists already" in capsys.readouterr().err


def test_an_interrupt_that_a_destructor_swallows_comes_again_without_a_word(
    capfd: pytest.CaptureFixture[str],
) -> None:
    class Interrupted:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(1000):
                pass

    hook = sys.unraisablehook
    with noted_interrupts() as noted, pytest.raises(KeyboardInterrupt):
        Interrupted()
        signal.sigtimedwait([], 4.0)  # shorter than the time after which any interrupt comes again
    assert len(noted) == 2 and capfd.readouterr().err == ""
    assert sys.unraisablehook is hook
