"""The commands of ``sgms``, each a module of this package that is imported only when it is asked for.

A command module offers ``HELP`` (one line), ``add_arguments(parser)`` and ``run(args)``, and imports
nothing heavy at its top: ``sgms --help`` reads them all.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
from typing import Protocol, cast

from sgms_observer.cli.outcome import Outcome

# In the order in which a user meets them; the text says what brings a command that is not there yet.
COMMANDS = {
    "demo": "it comes with the nodes",
    "simulate": "it comes with recordings",
    "replay": "it comes with recordings",
    "play": "it comes with recordings",
    "record": "it comes with recordings",
    "convert": "it comes with recordings",
    "info": "it comes with recordings",
    "check": "it comes with recordings",
    "init": "it comes with recordings",
    "identify": "it comes with identification",
    "diagnose": "it comes with the diagnosis",
    "paper": "it comes with the reproduction of the paper",
    "excite": "it comes with identification",
    "commission": "it comes with the nodes",
    "export": "it comes with export",
    "bench": "it comes with the benchmarks",
    "completion": "it comes with the command line",
    "compile": "it comes with the kernels",
}


class Command(Protocol):
    """What a command module offers."""

    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's arguments.

        Args:
            parser: the command's own parser.
        """

    def run(self, args: argparse.Namespace) -> int | Outcome:
        """Do the job.

        Args:
            args: what the user gave.

        Returns:
            The exit code, 0 only on success, alone or with the result that ``--json`` prints.
        """


def load(name: str) -> Command | None:
    """Import the module of one command.

    Args:
        name: a key of ``COMMANDS``.

    Returns:
        The module, or None when this version does not have the command yet.
    """
    module_name = f"sgms_observer.cli.{name}"
    if importlib.util.find_spec(module_name) is None:
        return None
    return cast(Command, importlib.import_module(module_name))
