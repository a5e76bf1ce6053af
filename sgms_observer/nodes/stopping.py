"""SIGINT and SIGTERM are noted, not obeyed at once: the node is still whole when it takes leave of its listeners.

rclpy's own handlers end the context first. Nothing can be published after that, and whoever holds the last force of a
compensation would hold it for ever.
"""

from __future__ import annotations

import signal

_noted: list[int] = []


def note_signals() -> None:
    """Note every SIGINT and SIGTERM from now on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: _noted.append(number))


def ignore_signals() -> None:
    """Hear no further signals: the process is about to end."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def is_told() -> bool:
    """Return whether the process was told to stop."""
    return bool(_noted)
