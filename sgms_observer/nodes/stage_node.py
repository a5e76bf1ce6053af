"""The node ``stage_node``: a simulated stage on the graph, in the place of a real one."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sgms_observer.interrupts import silent_interrupts

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from sgms_observer.nodes.lifecycle import ManagedNode

NAME = "stage_node"


def make_node(executor: Executor) -> ManagedNode:
    """Return the node; ROS is imported only here, so that ``--help`` needs none.

    Args:
        executor: the executor that will spin it.
    """
    from sgms_observer.nodes.moving import StageNode

    return StageNode(NAME, executor)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``stage_node``.

    Args:
        arguments: what follows the program's name; by default the process's own.

    Returns:
        The exit code: 0 only on success.
    """
    with silent_interrupts():
        from sgms_observer.nodes.command_line import start
    return start(
        NAME, "Simulate positioning axes with friction and publish what a real stage would.", make_node, arguments
    )


if __name__ == "__main__":
    sys.exit(main())
