"""The end of a process of this package: exit code, result for ``--json``, one sentence about a wrong call."""

from __future__ import annotations

import argparse
import math
import os
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NoReturn

EXIT_DONE = 0
EXIT_FAILED = 1
"""The input cannot be read, understood or used."""
EXIT_USAGE = 2
EXIT_NOT_USABLE = 3
"""The work is done, but its result must not be used as it is; a warning says why."""
EXIT_INTERRUPTED = 130
EXIT_BROKEN_PIPE = 141
EXIT_TERMINATED = 143

SHOW_TRACEBACK = "SGMS_OBSERVER_TRACEBACK"
"""Environment variable that shows the traceback of an internal error."""
LONG_WORK = "long work"
"""Name of a thread that may still compile when the process stops."""


class SentenceParser(argparse.ArgumentParser):
    """An argument parser that answers a wrong command line with one sentence."""

    def error(self, message: str) -> NoReturn:
        """Print the error and the command with the help, and exit with code 2."""
        self.exit(EXIT_USAGE, f"{self.prog}: {message}; see '{self.prog} --help'\n")


@dataclass(frozen=True)
class Outcome:
    """The end of a command.

    Attributes:
        code: the exit code.
        result: what ``--json`` prints.
    """

    code: int = EXIT_DONE
    result: Mapping[str, Any] = field(default_factory=dict)


def json_value(value: Any) -> Any:
    """Return a value for JSON: a number that is not finite becomes null, numpy's numbers and arrays become plain."""
    if isinstance(value, Mapping):
        return {str(key): json_value(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [json_value(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def leave_if_working(code: int) -> int:
    """End the process at once where a thread is still compiling, which cannot be stopped otherwise.

    Returns:
        The same code, if there is no such thread.
    """
    if any(thread.name == LONG_WORK for thread in threading.enumerate()):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code
