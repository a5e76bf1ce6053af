"""The command line: quick help, one sentence per error, exit code 0 only on success."""

from __future__ import annotations

import argparse
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path

import pytest

import sgms_observer
from sgms_observer.cli import main as command_line
from sgms_observer.cli.main import COMMANDS
from sgms_observer.errors import ConfigurationError
from sgms_observer.outcome import SHOW_TRACEBACK

HEAVY = ("numba", "casadi", "rclpy", "matplotlib", "scipy", "rosbags")


def _sgms(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "sgms_observer", *arguments], capture_output=True, text=True)


def _run_command(monkeypatch: pytest.MonkeyPatch, action: Callable[[argparse.Namespace], int]) -> int:
    """Run ``sgms demo`` with ``action`` in the place of its job."""
    module = types.SimpleNamespace(HELP="test", add_arguments=lambda parser: None, run=action)
    monkeypatch.setattr(command_line, "load_command", lambda name: module)
    return command_line.main(["demo"])


def _raise(error: BaseException) -> Callable[[argparse.Namespace], int]:
    def run(args: argparse.Namespace) -> int:
        raise error

    return run


def test_version() -> None:
    result = _sgms("--version")
    assert (result.returncode, result.stdout) == (0, f"sgms {sgms_observer.__version__}\n")


def test_help_names_every_command_and_imports_nothing_heavy() -> None:
    code = (
        "import sys\nfrom sgms_observer.cli.main import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit as end:\n    assert end.code == 0\n"
        f"print('heavy:', [name for name in {HEAVY} if name in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.endswith("heavy: []\n")
    assert all(f"    {name} " in result.stdout for name in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str) -> None:
    result = _sgms(name, "--help")
    assert (result.returncode, result.stderr) == (0, "")
    assert result.stdout.startswith(f"usage: sgms {name}")


@pytest.mark.parametrize(
    "arguments", [[], ["no_such_command"], ["--no-such-option"], *[[name, "--no-such"] for name in COMMANDS]]
)
def test_a_wrong_command_line_is_one_sentence(arguments: list[str]) -> None:
    result = _sgms(*arguments)
    assert result.returncode == 2
    assert len(result.stderr.splitlines()) == 1
    assert "--help" in result.stderr


def test_faults_of_the_input_are_sentences_without_traceback(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    sentences = ["x.mass = -1 kg must be > 0; give the moving mass", "x.frobnicate is no parameter; remove it"]
    assert _run_command(monkeypatch, _raise(ConfigurationError(sentences))) == 1
    assert capsys.readouterr().err.splitlines() == sentences


def test_a_missing_file_is_a_sentence(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    assert _run_command(monkeypatch, lambda args: len(Path("/no/such/file").read_text())) == 1
    assert capsys.readouterr().err == "/no/such/file: No such file or directory\n"


def test_a_fault_of_our_own_is_a_sentence_that_names_it(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    monkeypatch.delenv(SHOW_TRACEBACK, raising=False)
    assert _run_command(monkeypatch, _raise(ZeroDivisionError("boom"))) == 1
    error = capsys.readouterr().err
    assert "ZeroDivisionError: boom" in error and "Traceback" not in error
    monkeypatch.setenv(SHOW_TRACEBACK, "1")
    with pytest.raises(ZeroDivisionError):
        _run_command(monkeypatch, _raise(ZeroDivisionError("boom")))


def test_an_interrupt_is_quiet(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    assert _run_command(monkeypatch, _raise(KeyboardInterrupt())) == 130
    assert capsys.readouterr().err == ""
