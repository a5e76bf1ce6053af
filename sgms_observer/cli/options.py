"""Options that mean the same in every command. Imports nothing heavy: ``sgms --help`` reads this."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from sgms_observer.errors import ConfigurationError

ONE_AXIS = "the first of the file"
"""Default of a command that takes one axis."""


def add_output_options(parser: argparse.ArgumentParser, *, has_result: bool = True) -> None:
    """Declare how the command prints its result.

    Args:
        parser: the command's own parser.
        has_result: the command has a result that ``--json`` can print.
    """
    if has_result:
        parser.add_argument(
            "--json", action="store_true", help="print the result as one JSON object on stdout, and nothing else there"
        )
    parser.add_argument("--quiet", action="store_true", help="print warnings and errors only (and what --json prints)")


def add_overwrite_option(parser: argparse.ArgumentParser) -> None:
    """Declare that the command may replace what it wrote before.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument("--overwrite", action="store_true", help="replace the output if it exists")


def add_bag_options(parser: argparse.ArgumentParser, axes: str) -> None:
    """Declare which part of a bag is meant.

    Args:
        parser: the command's own parser.
        axes: which axes the command takes if none is named, for the help text.
    """
    add_axis_option(parser, axes)
    add_topic_option(parser)


def add_topic_option(parser: argparse.ArgumentParser) -> None:
    """Declare where the topics of a bag are.

    Args:
        parser: the command's own parser.
    """
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="KEY=NAME",
        help="name of a topic in the bag where it differs: KEY is position, control_effort or reference, such as"
        " position=/joint_states; may be repeated",
    )


def add_axis_option(parser: argparse.ArgumentParser, axes: str) -> None:
    """Declare which axes the command takes.

    Args:
        parser: the command's own parser.
        axes: which axes it takes if none is named, for the help text.
    """
    repeated = "" if axes.startswith(ONE_AXIS) else "; may be repeated"
    parser.add_argument(
        "--axis", action="append", metavar="NAME", help=f"use this axis only{repeated} (default: {axes})"
    )


def topics_from(arguments: Sequence[str]) -> dict[str, str]:
    """Return the topics the user named, by their key.

    Args:
        arguments: ``KEY=NAME`` each.

    Raises:
        ConfigurationError: one of them is malformed or has an unknown key.
    """
    from sgms_observer.bags.reader import INPUTS

    found: dict[str, str] = {}
    for argument in arguments:
        key, equals, name = argument.partition("=")
        if not (key and equals and name):
            raise ConfigurationError([f"--topic {argument} must read KEY=NAME, such as position=/joint_states"])
        if key not in INPUTS:
            raise ConfigurationError([f"--topic {argument}: {key} is none of {', '.join(INPUTS)}; use one of these"])
        if key in found:
            raise ConfigurationError([f"--topic gives {key} twice; give it once"])
        found[key] = name
    return found


def axes_from(arguments: Sequence[str] | None, known: Sequence[str], source: str) -> list[str]:
    """Return the axes the user named, in their order, or all of them.

    Args:
        arguments: the names, or None.
        known: the names that there are.
        source: the file that they come from, for messages.

    Raises:
        ConfigurationError: an axis is not there.
    """
    wanted = list(dict.fromkeys(arguments or known))
    strange = [name for name in wanted if name not in known]
    if strange:
        raise ConfigurationError([f"--axis {strange[0]} is not in {source}; it has {', '.join(known)}"])
    return wanted


def axis_from(arguments: Sequence[str] | None, command: str) -> str | None:
    """Return the one axis that the user named, or None.

    Args:
        arguments: the names, or None.
        command: the command's name, for messages.

    Raises:
        ConfigurationError: several axes are named.
    """
    wanted = list(dict.fromkeys(arguments or ()))
    if len(wanted) > 1:
        raise ConfigurationError([f"sgms {command} takes one axis at a time; --axis names {', '.join(wanted)}"])
    return wanted[0] if wanted else None
