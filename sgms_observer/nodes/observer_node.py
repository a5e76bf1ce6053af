"""The node ``observer_node``: position and effort in, friction out. A shell: it converts, calls ``step``, publishes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from sgms_observer.interrupts import silent_interrupts

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from sgms_observer.nodes.lifecycle import ManagedNode

NAME = "observer_node"


def make_node(executor: Executor) -> ManagedNode:
    """Return the node; ROS is imported only here, so that ``--help`` needs none.

    Args:
        executor: the executor that will spin it.
    """
    from sgms_observer.nodes.observing import ObserverNode

    return ObserverNode(NAME, executor)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``observer_node``.

    Args:
        arguments: what follows the program's name; by default the process's own.

    Returns:
        The exit code: 0 only on success.
    """
    with silent_interrupts():
        from sgms_observer.nodes.command_line import start
    return start(
        NAME, "Observe the friction of positioning axes from position and control effort.", make_node, arguments
    )


if __name__ == "__main__":
    sys.exit(main())
