"""Nodes of the package that print their names and parameters: run by test_real_rcl.py in a process of their own.

Each argument is a command line of one node, as JSON. They live one after the other, each with a ROS of its own.
"""

from __future__ import annotations

import json
import sys
from types import FrameType

import rclpy
from rclpy.executors import SingleThreadedExecutor

from sgms_observer.errors import ConfigurationError
from sgms_observer.nodes.lifecycle import ManagedNode
from sgms_observer.settings.load import checked_axis
from sgms_observer.settings.node_parameters import read_arguments

checked: list[str] = []
temporary_files: list[str] = []


class ParameterNode(ManagedNode):
    """A node that declares the parameters of both nodes and does nothing."""

    has_stage = True


def note(frame: FrameType, event: str, _: object) -> None:
    """Remember the axes that are checked."""
    if event == "call" and frame.f_code is checked_axis.__code__:
        checked.append(frame.f_locals["name"])


def watch(event: str, arguments: tuple[object, ...]) -> None:
    """Remember the temporary files and folders that are made."""
    if event in ("tempfile.mkstemp", "tempfile.mkdtemp"):
        temporary_files.append(str(arguments[0]))


def main() -> int:
    """Have one node after the other live; return the worst of their exit codes."""
    sys.addaudithook(watch)
    return max(live([sys.argv[0], *json.loads(arguments)]) for arguments in sys.argv[1:])


def live(argv: list[str]) -> int:
    """Print one JSON object with what became of the arguments, or the sentences on stderr."""
    checked.clear()
    temporary_files.clear()
    sys.setprofile(note)
    try:
        given = read_arguments(argv)
    except ConfigurationError as error:
        print(*error.sentences, sep="\n", file=sys.stderr)
        return 1
    rclpy.init(args=given.argv)
    node = ParameterNode("observer_node", SingleThreadedExecutor(), given)
    sys.setprofile(None)
    names = (*node.parameters.names, "use_sim_time")
    values = {name: node.get_parameter_or(name).value for name in names}
    values = {name: list(value) if hasattr(value, "tolist") else value for name, value in values.items()}
    found = {"name": node.get_fully_qualified_name(), "parameters": values}
    print(json.dumps({**found, "checked": checked, "temporary_files": temporary_files}))
    node.destroy_node()
    rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
