"""Handling of SIGINT and SIGTERM: silent during imports, never lost in a command, noted in a node.

Signals of a node are noted, so that it can publish its last messages. The handlers of rclpy end the context first.
Nothing can be published after that, and a receiver would hold the last force of a compensation for ever.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType, TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sys import UnraisableHookArgs

_LOST_AFTER = 5.0  # s after which an interrupt without effect is raised again
_SOON = 0.01  # s after which an interrupt that is known to have had no effect is raised again


@contextmanager
def silent_interrupts() -> Iterator[None]:
    """Let SIGINT end the process silently while the block runs; for the first lines of a program."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # ignored, or handled elsewhere
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def noted_interrupts() -> Iterator[list[int]]:
    """Note every SIGINT and SIGTERM: they raise ``KeyboardInterrupt``, and are not lost.

    SIGTERM alone would end the process at once, with incomplete files and running children. An interrupted import may
    convert the exception to another error, and a callback of a compiler may drop it. So it is raised again where the
    block still runs some seconds later. Signals that are ignored or handled elsewhere are not changed.

    Yields:
        The numbers of the signals that came so far.
    """
    noted: list[int] = []
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
    ours = {number: handler for number, handler in usual.items() if signal.getsignal(number) is handler}
    if not ours or threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(number: int, frame: FrameType | None) -> None:
        noted.append(number)
        signal.setitimer(signal.ITIMER_REAL, _LOST_AFTER)
        signal.default_int_handler(number, frame)

    def unraisable(lost: UnraisableHookArgs) -> None:
        if isinstance(lost.exc_value, KeyboardInterrupt):  # raised in a destructor, which drops it
            signal.setitimer(signal.ITIMER_REAL, _SOON)
        else:
            usual_unraisable(lost)

    def printed(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        if issubclass(kind, KeyboardInterrupt):  # raised in an import by a C module, which prints it and continues
            signal.setitimer(signal.ITIMER_REAL, _SOON)
        else:
            usual_excepthook(kind, error, trace)

    usual_unraisable, sys.unraisablehook = sys.unraisablehook, unraisable
    usual_excepthook, sys.excepthook = sys.excepthook, printed
    alarm = signal.signal(signal.SIGALRM, note)
    for number in ours:
        signal.signal(number, note)
    try:
        yield noted
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        sys.unraisablehook, sys.excepthook = usual_unraisable, usual_excepthook
        signal.signal(signal.SIGALRM, alarm)
        for number, handler in ours.items():
            if signal.getsignal(number) is note:
                signal.signal(number, handler)


def obey_interrupt() -> None:
    """Confirm an interrupt: it is not raised again while the work is ended."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)


_noted: list[int] = []


def listed_signals() -> list[int]:
    """Return a list that gets the number of every SIGINT and SIGTERM from now on.

    An event would not do: a second signal may come while the first one holds the event's lock, and waits for ever.
    """
    listed: list[int] = []
    _list_signals_in(listed)
    return listed


def note_signals() -> None:
    """Note every SIGINT and SIGTERM from now on."""
    _list_signals_in(_noted)


def _list_signals_in(listed: list[int]) -> None:
    """Append the number of every SIGINT and SIGTERM to a list from now on."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _frame: listed.append(number))


def ignore_signals() -> None:
    """Ignore further signals: the process is about to end."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def is_told() -> bool:
    """Return whether a stop signal arrived."""
    return bool(_noted)


class DeferredSignals:
    """Notes SIGINT and SIGTERM while a block runs, and raises them at its end.

    Attributes:
        first: number of the first signal that came in the block; 0 for none.
    """

    def __init__(self) -> None:
        self.first = 0

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Note the signals while the block runs.

        Raises:
            KeyboardInterrupt: at the end of the block, if a signal came and its handler does not end the process.
        """
        numbers = (signal.SIGINT, signal.SIGTERM)
        before = [signal.getsignal(number) for number in numbers]

        def note(number: int, _frame: FrameType | None) -> None:
            self.first = self.first or number

        for number in numbers:
            signal.signal(number, note)
        try:
            yield
        finally:
            for number, handler in zip(numbers, before, strict=True):
                signal.signal(number, handler)
            first, self.first = self.first, 0
            if first:
                signal.raise_signal(first)
                raise KeyboardInterrupt
