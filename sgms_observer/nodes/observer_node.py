"""The node ``observer_node``: subscribes to position and effort, publishes friction and compensation."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from sgms_observer.interrupts import silent_interrupts

NAME = "observer_node"
HELP = "Observe the friction of positioning axes from position and control effort."


def main(arguments: Sequence[str] | None = None) -> int:
    """Run ``observer_node``.

    Args:
        arguments: the arguments without the program's name; by default those of the process.

    Returns:
        The exit code: 0 only on success.
    """
    with silent_interrupts():
        from sgms_observer.nodes.command_line import start
    return start(NAME, HELP, "observer_lifecycle.ObserverNode", arguments)


if __name__ == "__main__":
    sys.exit(main())
