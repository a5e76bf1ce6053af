"""Options that mean the same in every command. Imports nothing heavy: ``sgms --help`` reads this."""

from __future__ import annotations

import argparse
import importlib.util
import re
from collections.abc import Sequence

from sgms_observer.errors import ConfigurationError, DataError

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
    also = " (and what --json prints)" if has_result else ""
    parser.add_argument("--quiet", action="store_true", help=f"print warnings and errors only{also}")


def add_overwrite_option(parser: argparse.ArgumentParser) -> None:
    """Declare that the command may replace what it wrote before."""
    parser.add_argument("--overwrite", action="store_true", help="replace the output if it exists")


def add_storage_option(parser: argparse.ArgumentParser, of: str = "the bag") -> None:
    """Declare how the bag that the command writes is stored."""
    parser.add_argument(
        "--storage", choices=("mcap", "sqlite3"), default="mcap", help=f"storage of {of} (default: mcap)"
    )


def add_bag_options(parser: argparse.ArgumentParser, axes: str) -> None:
    """Declare which part of a bag is meant.

    Args:
        parser: the command's own parser.
        axes: which axes the command takes if none is named, for the help text.
    """
    add_axis_option(parser, axes)
    add_topic_option(parser)


def add_live_topic_option(parser: argparse.ArgumentParser, keys: Sequence[str]) -> None:
    """Declare where topics of the live graph are.

    Args:
        parser: the command's own parser.
        keys: the topics.
    """
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="KEY=NAME",
        help=f"name of a topic on the graph where it differs: KEY is {', '.join(keys[:-1])} or {keys[-1]}, such as"
        " position=/joint_states; may be repeated",
    )


def add_topic_option(parser: argparse.ArgumentParser) -> None:
    """Declare where the topics of a bag are."""
    parser.add_argument(
        "--topic",
        action="append",
        default=[],
        metavar="KEY=NAME",
        help="name of a topic in the bag where it differs: KEY is position, control_effort or reference, such as"
        " position=/joint_states; may be repeated",
    )


def add_holdout_option(parser: argparse.ArgumentParser, meaning: str) -> None:
    """Declare the recordings that a model is evaluated on.

    Args:
        parser: the command's own parser.
        meaning: what is done with them, for the help text.
    """
    parser.add_argument(
        "--holdout",
        nargs="+",
        action="extend",
        default=[],
        metavar="BAG",
        help=f"{meaning}; several after one --holdout, or --holdout repeated",
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


def add_limit_options(parser: argparse.ArgumentParser) -> None:
    """Declare what the axis may do while it is excited; without them ``CAUTIOUS_LIMITS`` of its joint type hold."""
    parser.add_argument(
        "--stroke", type=float, metavar="WIDTH", help="full width of the motion (default: 0.02 m; 0.5 rad)"
    )
    parser.add_argument("--speed", type=float, metavar="V", help="largest speed (default: 0.05 m/s; 0.5 rad/s)")
    parser.add_argument(
        "--acceleration", type=float, metavar="A", help="largest acceleration (default: 1 m/s^2; 2 rad/s^2)"
    )


def live_topics_from(arguments: Sequence[str], keys: Sequence[str]) -> dict[str, str]:
    """Return the topics of the live graph that the user named, by their key.

    Args:
        arguments: ``KEY=NAME`` each.
        keys: the keys there are.

    Raises:
        ConfigurationError: one of them is malformed, has an unknown key, or is no name of ROS.
    """
    found = topics_from(arguments, keys)
    for key, name in found.items():
        refuse_other_names(name, f"--topic {key}={name}")
    return found


def refuse_other_names(name: str, shown: str) -> None:
    """Raise the sentence about a name that no topic of ROS can have.

    Args:
        name: the name.
        shown: how the user gave it.

    Raises:
        ConfigurationError: it has other signs, or begins with a digit.
    """
    if not re.fullmatch(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", name, re.ASCII):
        raise ConfigurationError(
            [f"{shown} is no topic name of ROS; give letters, digits and _, such as /joint_states"]
        )


def topics_from(arguments: Sequence[str], keys: Sequence[str] = ()) -> dict[str, str]:
    """Return the topics the user named, by their key.

    Args:
        arguments: ``KEY=NAME`` each.
        keys: the keys there are; by default the inputs of the observer.

    Raises:
        ConfigurationError: one of them is malformed or has an unknown key.
    """
    found: dict[str, str] = {}
    if not arguments:  # spare commands that read no bag the import of what reads bags
        return found
    from sgms_observer.bags.source import INPUTS

    known = keys or INPUTS
    for argument in arguments:
        key, equals, name = argument.partition("=")
        if not (key and equals and name):
            raise ConfigurationError([f"--topic {argument} must read KEY=NAME, such as position=/joint_states"])
        if key not in known:
            raise ConfigurationError([f"--topic {argument}: {key} is none of {', '.join(known)}; use one of these"])
        if key in found:
            raise ConfigurationError([f"--topic gives {key} twice; give it once"])
        found[key] = name
    return found


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


def require_ros() -> None:
    """Raise the sentence about a missing ROS 2.

    Raises:
        DataError: it is not importable.
    """
    if importlib.util.find_spec("rclpy") is None:
        from sgms_observer.nodes.spin import MISSING_ROS

        raise DataError(MISSING_ROS)
