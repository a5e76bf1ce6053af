"""Progress of a long command: a bar on a terminal, a line every 15 s in a pipe."""

from __future__ import annotations

import sys
import time
from types import TracebackType
from typing import ClassVar, TextIO

_BAR = 30
_TERMINAL_PERIOD = 0.1  # s
_PIPE_PERIOD = 15.0  # s


class Progress:
    """Shows on stderr how much of a job is done, as a context manager; prints nothing while ``is_quiet``.

    Args:
        label: name of the job.
        total: the job's size, in any unit.
        stream: where to print; stderr by default.
    """

    is_quiet: ClassVar[bool] = False

    def __init__(self, label: str, total: float, stream: TextIO | None = None) -> None:
        self._label = label
        self._total = total
        self._stream = sys.stderr if stream is None else stream
        self._is_terminal = self._stream.isatty()
        self._start = time.monotonic()
        self._due = self._start + (0.0 if self._is_terminal else _PIPE_PERIOD)
        self._is_shown = False

    def show(self, done: float) -> None:
        """Show that ``done`` of ``total`` is done, unless the last line is younger than the period.

        Args:
            done: in the unit of ``total``.
        """
        now = time.monotonic()
        if now < self._due or Progress.is_quiet:
            return
        self._is_shown = True
        share = min(done / self._total, 1.0) if self._total > 0.0 else 1.0
        left = (now - self._start) * (1.0 - share) / share if share > 0.0 else float("inf")
        rest = f", {left:.0f} s left" if share < 1.0 and left < 1e6 else ""
        if self._is_terminal:
            bar = "#" * int(share * _BAR)
            self._stream.write(f"\r{self._label} [{bar:<{_BAR}}] {100.0 * share:3.0f} %{rest}\x1b[K")
        else:
            self._stream.write(f"{self._label}: {100.0 * share:.0f} %{rest}\n")
        self._stream.flush()
        self._due = now + (_TERMINAL_PERIOD if self._is_terminal else _PIPE_PERIOD)

    def __enter__(self) -> Progress:
        """Return the progress."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Clear the bar."""
        if self._is_terminal and self._is_shown:
            self._stream.write("\r\x1b[K")
            self._stream.flush()
