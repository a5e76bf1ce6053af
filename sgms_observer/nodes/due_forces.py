"""Compensations that wait for the time they were made for: the network's jitter does not move them. No ROS in here."""

from __future__ import annotations

import math
import threading
from collections import deque

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class DueForces:
    """The compensation of one axis as the stage applies it.

    A message of sample time s predicts the friction at s + ``lead``; it holds from then until ``timeout`` later, and a
    message that comes later than that is not applied at all. When the set-point turns round and the messages for the
    time behind the turn are late, what is held pushes the wrong way: it is let go, and nothing is applied until one of
    them comes. A stamp from before the first sample, or from the future, belongs to another clock: such a message holds
    for ``timeout`` from when it comes.

    Args:
        lead: time from a message's stamp to its application [s].
        timeout: for how long a message holds [s].
    """

    def __init__(self, lead: float, timeout: float) -> None:
        self._lead_ns = round(lead * 1e9)
        self._timeout_ns = round(timeout * 1e9)
        self._waiting: deque[tuple[int, float]] = deque(maxlen=100_000)
        self._force = 0.0
        self._due_ns = -(2**62)
        self._direction = 0
        self._latest_ns = self._turned_ns = -(2**62)
        self._first_ns: int | None = None
        self._lock = threading.Lock()  # messages come in one thread, the stage steps in another

    def put(self, stamp_ns: int, force: float, now_ns: int) -> None:
        """Take in a message.

        Args:
            stamp_ns: its stamp [ns].
            force: compensation [N]; ignored unless finite.
            now_ns: the stage's clock [ns].
        """
        if not math.isfinite(force):
            return
        due = stamp_ns + self._lead_ns
        if self._first_ns is None or not self._first_ns <= stamp_ns <= now_ns + self._timeout_ns:
            due = now_ns
        with self._lock:
            while self._waiting and self._waiting[-1][0] > due:
                self._waiting.pop()  # an older clock's messages, or a node that was started anew
            self._waiting.append((due, force))

    def at(self, stamps: NDArray[np.int64], direction: int = 0) -> Floats:
        """Return the force at each sample [N].

        Args:
            stamps: sample times [ns], shape (n,), not before those of the last call.
            direction: sign of the set-point's velocity; 0 at rest or where it is not known.
        """
        if self._first_ns is None and len(stamps):
            self._first_ns = int(stamps[0])
        forces = np.zeros(len(stamps))
        if direction * self._direction < 0:
            self._turned_ns = self._latest_ns
        self._direction = direction or self._direction
        with self._lock:
            for k, stamp in enumerate(stamps.tolist()):
                while self._waiting and self._waiting[0][0] <= stamp:
                    self._due_ns, self._force = self._waiting.popleft()
                is_of_use = self._turned_ns <= self._due_ns and stamp <= self._due_ns + self._timeout_ns
                forces[k] = self._force if is_of_use else 0.0
                self._latest_ns = stamp
        return forces
