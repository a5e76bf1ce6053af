"""The observer node with an internal error: its engine raises once a compensation has gone out."""

from __future__ import annotations

import sys
from collections.abc import Callable

from sgms_observer.nodes import observer_node
from sgms_observer.nodes.engine import Engine, Processed
from sgms_observer.observer.outgoing import OutgoingBlock


class FailingEngine(Engine):
    """Raises behind the first samples taken together that leave a compensation above 0.1 N as the command."""

    has_acted = False

    def process(
        self, send: Callable[[OutgoingBlock], None] | None = None, are_others_read: Callable[[], bool] = lambda: True
    ) -> Processed:
        """Do as ever, but not for long."""
        if self.has_acted:
            raise ZeroDivisionError("a fault made for a test")
        processed = super().process(send, are_others_read)
        self.has_acted = any(abs(block.compensation[-1]) > 0.1 for block in processed.observed.values())
        return processed


if __name__ == "__main__":
    from sgms_observer.nodes import observer_lifecycle

    observer_lifecycle.Engine = FailingEngine  # type: ignore[misc]
    sys.exit(observer_node.main())
