"""Ctrl-C: silent while modules load, never lost, never told as somebody else's error."""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import subprocess
import sys
import time
import types

import pytest
from program import PATIENCE

from sgms_observer import interrupts
from sgms_observer.cli import main as command_line
from sgms_observer.cli.main import main
from sgms_observer.interrupts import noted_interrupts, silent_interrupts
from sgms_observer.outcome import EXIT_INTERRUPTED, EXIT_TERMINATED


def interrupt_lost() -> None:
    """Interrupt this process where the interrupt is swallowed, as in a compiler's callback."""
    with contextlib.suppress(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1.0)


BUSY = """
from sgms_observer.interrupts import ignore_signals, listed_signals
listed = listed_signals()
print("ready", flush=True)
while len(listed) < 1000:
    pass
ignore_signals()
"""


def test_many_signals_at_once_do_not_wait_for_each_other() -> None:
    """A recorder hung for ever after a second Ctrl-C that came within the handling of the first."""
    with subprocess.Popen([sys.executable, "-c", BUSY], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        end = time.monotonic() + PATIENCE
        while process.poll() is None and time.monotonic() < end:
            process.send_signal(signal.SIGINT)
        process.kill()
    assert process.returncode == 0


def test_an_interrupt_that_was_lost_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_LOST_AFTER", 1.0)
    with noted_interrupts() as noted, pytest.raises(KeyboardInterrupt):
        interrupt_lost()
        time.sleep(60.0)
    assert len(noted) == 2
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_an_interrupt_that_a_module_in_c_prints_comes_again_without_a_word(capfd: pytest.CaptureFixture[str]) -> None:
    hook = sys.excepthook
    with noted_interrupts() as noted, pytest.raises(KeyboardInterrupt):
        ctypes.pythonapi.PyRun_SimpleString(b"import signal\nsignal.raise_signal(signal.SIGINT)")
        time.sleep(4.0)  # shorter than the time after which any interrupt comes again
    assert len(noted) == 2 and capfd.readouterr().err == ""
    assert sys.excepthook is hook


def test_an_error_that_an_interrupt_turned_into_is_none(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(_: object) -> int:
        interrupt_lost()
        raise ImportError("initialization failed")

    command = types.SimpleNamespace(HELP="", add_arguments=lambda parser: None, run=run)
    monkeypatch.setattr(command_line, "load_command", lambda name: command)
    assert main(["bench"]) == EXIT_INTERRUPTED
    assert capsys.readouterr().err == ""


def test_silence_lasts_as_long_as_the_imports() -> None:
    with silent_interrupts():
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_command_that_is_terminated_clears_up(monkeypatch: pytest.MonkeyPatch) -> None:
    cleared: list[bool] = []

    def run(_: object) -> int:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(60.0)
        finally:
            cleared.append(True)
        return 0

    command = types.SimpleNamespace(HELP="", add_arguments=lambda parser: None, run=run)
    monkeypatch.setattr(command_line, "load_command", lambda name: command)
    assert main(["bench"]) == EXIT_TERMINATED
    assert cleared and signal.getsignal(signal.SIGTERM) is signal.SIG_DFL
