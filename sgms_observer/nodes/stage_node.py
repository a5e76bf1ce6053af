"""The node ``stage_node``: a simulated stage with the topics of a real one."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from sgms_observer.interrupts import silent_interrupts

NAME = "stage_node"
HELP = "Simulate positioning axes with friction and publish what a real stage would."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``stage_node``.

    Args:
        arguments: the arguments without the program's name; by default those of the process.

    Returns:
        The exit code: 0 only on success.
    """
    with silent_interrupts():
        from sgms_observer.nodes.command_line import start
    return start(NAME, HELP, "stage_lifecycle.StageNode", arguments)


if __name__ == "__main__":
    sys.exit(main())
