"""The command line of a node: ``--help``, ``--config``, and the ROS arguments, checked before ROS reads them."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sgms_observer import __version__
from sgms_observer.errors import SgmsError
from sgms_observer.interrupts import silent_interrupts
from sgms_observer.nodes.spin import MISSING_ROS, fail, run_node
from sgms_observer.outcome import EXIT_INTERRUPTED, SentenceParser, leave_if_working

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from sgms_observer.nodes.lifecycle import ManagedNode

_EPILOG = (
    "ROS arguments follow --ros-args: --params-file FILE, -p NAME:=VALUE, -r FROM:=TO, and what else ROS 2 knows. "
    "Parameters: docs/parameters.md."
)


def start(name: str, description: str, kind: str, arguments: Sequence[str] | None = None) -> int:
    """Read the command line, check the parameters in it, and run the node.

    Args:
        name: name of node and executable.
        description: one sentence for ``--help``.
        kind: module of this folder and class of the node; imported only here, so that ``--help`` needs no ROS.
        arguments: the arguments without the program's name; by default those of the process.

    Returns:
        The exit code.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        other_arguments, ros = _split(given)
        parser = SentenceParser(prog=name, description=description, epilog=_EPILOG)
        add = parser.add_argument
        add("--version", action="version", version=f"{name} {__version__}")
        add("--config", metavar="FILE", help="parameter file; the same as --ros-args --params-file FILE")
        options = parser.parse_args(other_arguments)
        if options.config:
            ros = ["--ros-args", "--params-file", options.config, "--", *ros]
        if importlib.util.find_spec("rclpy") is None:
            return fail(MISSING_ROS)
        return leave_if_working(_run_checked(name, kind, ros))
    except KeyboardInterrupt:  # before ROS installed its signal handlers
        return EXIT_INTERRUPTED


def _run_checked(name: str, kind: str, ros: Sequence[str]) -> int:
    """Check the parameters in the ROS arguments and run the node with them."""
    with silent_interrupts():
        from sgms_observer.settings.node_parameters import read_arguments, refuse_incomplete

    try:
        given = read_arguments([name, *ros], name)
        refuse_incomplete(given, name)
    except SgmsError as error:
        return fail(str(error))

    def make(executor: Executor) -> ManagedNode:
        module, _, of_class = kind.partition(".")
        loaded = importlib.import_module(f"sgms_observer.nodes.{module}")
        node: ManagedNode = getattr(loaded, of_class)(name, executor, given)
        return node

    return run_node(make, given.argv)


def _split(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the arguments of the node and those of ROS, which stand between ``--ros-args`` and ``--`` or the end."""
    other_arguments: list[str] = []
    ros: list[str] = []
    is_ros = False
    for argument in arguments:
        is_ros = is_ros or argument == "--ros-args"
        (ros if is_ros else other_arguments).append(argument)
        is_ros = is_ros and argument != "--"
    return other_arguments, ros
