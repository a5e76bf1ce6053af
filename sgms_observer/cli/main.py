"""The command line ``sgms``: finds the command, runs it, and turns every error into one sentence."""

from __future__ import annotations

import argparse
import contextlib
import importlib
import json
import os
import signal
import sys
from collections.abc import Sequence
from typing import Protocol, cast

from sgms_observer import __version__
from sgms_observer.cli.progress import Progress
from sgms_observer.errors import SgmsError
from sgms_observer.interrupts import noted_interrupts
from sgms_observer.outcome import (
    EXIT_BROKEN_PIPE,
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    EXIT_TERMINATED,
    SHOW_TRACEBACK,
    Outcome,
    SentenceParser,
    json_value,
)

# In the order of their first use.
COMMANDS = (
    "demo", "simulate", "replay", "play", "record", "convert", "info", "check", "init", "identify", "diagnose",
    "paper", "excite", "commission", "export", "bench", "completion", "compile",
)  # fmt: skip


class Command(Protocol):
    """The names that each command module defines."""

    HELP: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Declare the command's arguments."""

    def run(self, args: argparse.Namespace) -> int | Outcome:
        """Do the job.

        Returns:
            The exit code, 0 only on success, alone or with the result that ``--json`` prints.
        """


def load_command(name: str) -> Command:
    """Return the module of one command.

    Args:
        name: one of ``COMMANDS``.
    """
    return cast(Command, importlib.import_module(f"sgms_observer.cli.{name}"))


class _CommandList(argparse.HelpFormatter):
    """Help whose column of commands is as wide as the longest of them."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog)
        self._action_max_length = max(map(len, COMMANDS)) + 2 * self._indent_increment


def build_parser(wanted: str | None) -> SentenceParser:
    """Return the parser of the whole command line.

    Args:
        wanted: the command that will run, which alone is then declared; None for all.
    """
    parser = SentenceParser(
        prog="sgms",
        description="Friction observer on the (Smoothed) Generalized Maxwell-Slip model.",
        formatter_class=_CommandList,
    )
    parser.add_argument("--version", action="version", version=f"sgms {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        if wanted is not None and name != wanted:
            continue
        command = load_command(name)
        subparser = commands.add_parser(name, help=command.HELP, description=command.HELP)
        command.add_arguments(subparser)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Args:
        arguments: the words after ``sgms``; by default those of the process.

    Returns:
        The exit code: 0 only on success.
    """
    with noted_interrupts() as interrupts:
        code = _run(list(sys.argv[1:] if arguments is None else arguments), interrupts)
    return code


def _run(given: list[str], interrupts: Sequence[int]) -> int:
    """Find the command, run it, and return the exit code."""
    wanted = given[0] if given and given[0] in COMMANDS else None
    try:
        args = build_parser(wanted).parse_args(given)
        return _finish(load_command(args.command), args)
    except KeyboardInterrupt:
        return _interrupted(interrupts)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_BROKEN_PIPE
    except Exception as error:
        if interrupts:  # an interrupted import raises an error of its own
            return _interrupted(interrupts)
        if isinstance(error, SgmsError):
            return _fail(str(error))
        if isinstance(error, OSError):
            return _fail(f"{error.filename or wanted}: {error.strerror or error}")
        if os.environ.get(SHOW_TRACEBACK):
            raise
        return _fail(
            f"Internal error in sgms {wanted}, {type(error).__name__}: {error};"
            f" set {SHOW_TRACEBACK}=1 to see where, and report it"
        )


def _finish(command: Command, args: argparse.Namespace) -> int:
    """Run the command; drop its prints with --quiet or --json, and print its result with --json."""
    has_json = getattr(args, "json", False) is True
    is_silent = has_json or getattr(args, "quiet", False)
    with contextlib.ExitStack() as stack:
        if is_silent:
            stack.enter_context(
                contextlib.redirect_stdout(stack.enter_context(open(os.devnull, "w", encoding="utf-8")))
            )
            Progress.is_quiet = True
            stack.callback(setattr, Progress, "is_quiet", False)
        outcome = command.run(args)
    outcome = outcome if isinstance(outcome, Outcome) else Outcome(outcome)
    if has_json:
        print(json.dumps(json_value(outcome.result), indent=2))
    sys.stdout.flush()
    return outcome.code


def _interrupted(interrupts: Sequence[int]) -> int:
    """Return the exit code that shells expect after the first of these signals."""
    return EXIT_TERMINATED if signal.SIGTERM in interrupts[:1] else EXIT_INTERRUPTED


def _fail(sentences: str) -> int:
    print(sentences, file=sys.stderr)
    return EXIT_FAILED


if __name__ == "__main__":
    sys.exit(main())
