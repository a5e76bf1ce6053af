"""Ctrl-C while modules load: the process ends without a word, not with an error of somebody's import."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_LOST_AFTER = 5.0  # s after which an interrupt that had no effect comes again


@contextmanager
def silent_interrupts() -> Iterator[None]:
    """Let SIGINT end the process without a word while the block runs; for the first lines of a program."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # ignored, or somebody's own: theirs to decide
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def noted_interrupts() -> Iterator[list[int]]:
    """Note every SIGINT, which raises ``KeyboardInterrupt`` as ever, and see to it that it is not lost.

    An import that is interrupted may turn it into an error of its own, and a compiler's callback may swallow it: it is
    raised again where the block still runs some seconds later.

    Yields:
        The numbers of the signals that came so far.
    """
    noted: list[int] = []
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(number: int, frame: FrameType | None) -> None:
        noted.append(number)
        signal.setitimer(signal.ITIMER_REAL, _LOST_AFTER)
        signal.default_int_handler(number, frame)

    alarm = signal.signal(signal.SIGALRM, note)
    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, alarm)
        if signal.getsignal(signal.SIGINT) is note:
            signal.signal(signal.SIGINT, before)
