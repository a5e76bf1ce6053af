"""A call of a service that is repeated until an answer comes."""

from __future__ import annotations

import time
from typing import Any

from rclpy.client import Client
from rclpy.task import Future


class Question:
    """A request that may be repeated.

    rmw_fastrtps drops an answer where the asked node has not met the asker's reader within 0.1 s.

    Args:
        client: of the service; somebody else spins its node.
        request: what is asked; asked twice, the service must do no harm.
        again: time after which it is asked once more [s].
    """

    def __init__(self, client: Client, request: Any, again: float) -> None:
        self._client = client
        self._request = request
        self._futures: list[Future] = []
        self._again = again
        self._ask_at = 0.0

    def answer(self) -> Any | None:
        """Ask if it is time to; return the answer, or None while there is none."""
        if time.monotonic() >= self._ask_at:
            self._futures.append(self._client.call_async(self._request))
            self._ask_at = time.monotonic() + self._again
        return next((future.result() for future in self._futures if future.done()), None)
