"""The commands of ``sgms``, each a module of this package that is imported only when it is asked for.

A command module offers ``HELP`` (one line), ``add_arguments(parser)`` and ``run(args)``, and imports
nothing heavy at its top: ``sgms --help`` reads them all.
"""

from __future__ import annotations

import argparse
import importlib
from typing import Protocol, cast

from sgms_observer.outcome import Outcome

# In the order in which a user meets them.
COMMANDS = (
    "demo", "simulate", "replay", "play", "record", "convert", "info", "check", "init", "identify", "diagnose",
    "paper", "excite", "commission", "export", "bench", "completion", "compile",
)  # fmt: skip


class Command(Protocol):
    """What a command module offers."""

    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's arguments."""

    def run(self, args: argparse.Namespace) -> int | Outcome:
        """Do the job.

        Returns:
            The exit code, 0 only on success, alone or with the result that ``--json`` prints.
        """


def load(name: str) -> Command:
    """Return the module of one command.

    Args:
        name: one of ``COMMANDS``.
    """
    return cast(Command, importlib.import_module(f"sgms_observer.cli.{name}"))
