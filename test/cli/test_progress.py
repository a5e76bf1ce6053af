"""Progress: a bar on a terminal, quiet lines in a pipe."""

from __future__ import annotations

import io

from sgms_observer.cli import progress
from sgms_observer.cli.progress import Progress


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_terminal_shows_a_bar_and_clears_it() -> None:
    terminal = Terminal()
    with Progress("simulate", 200.0, terminal) as bar:
        bar.show(100.0)
    shown = terminal.getvalue()
    assert "\rsimulate [###############               ]  50 %" in shown
    assert shown.endswith("\r\x1b[K")


def test_pipe_stays_quiet_unless_it_takes_long() -> None:
    pipe = io.StringIO()
    with Progress("simulate", 10.0, pipe) as bar:
        bar.show(5.0)
        assert pipe.getvalue() == ""
        bar._due -= 2.0 * progress._PIPE_PERIOD
        bar.show(6.0)
    assert pipe.getvalue().startswith("simulate: 60 %")
    assert pipe.getvalue().count("\n") == 1
