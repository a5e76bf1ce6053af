"""A process that stores arrival time and content of each message of some topics, until a stop signal.

It prints a line for the first message of each topic, so that another process can wait for it.
"""

from __future__ import annotations

import argparse
import sys
import time
from array import array
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rclpy

from sgms_observer.arrays import Ints
from sgms_observer.nodes.spin import spin_until_interrupted
from sgms_observer.nodes.topics import subscribe
from sgms_observer.nodes.transport import prepare_transport

_STAMP = slice(4, 12)  # seconds and nanoseconds in a message that begins with a header
_LAST = slice(-8, None)  # the last number of the message: the effort of the last axis


class _Heard:
    """The messages of one topic, as they came.

    Args:
        topic: its name.
    """

    def __init__(self, topic: str) -> None:
        self._topic = topic
        self._records = bytearray()
        self._arrivals = array("q")

    def taking(self) -> Callable[[bytes], None]:
        """Return what takes the topic's messages."""
        records, add, add_arrival, now = self._records, self._records.extend, self._arrivals.append, time.time_ns

        def take(message: bytes) -> None:
            add_arrival(now())
            if not records:
                print(first_message(self._topic), flush=True)
            add(message[_STAMP])
            add(message[_LAST])

        return take

    def table(self) -> Ints:
        """Return stamp [ns], arrival [ns] and the bits of the last axis's effort [N], shape (3, n)."""
        parts = np.frombuffer(bytes(self._records), "<i4,<u4,<i8")
        stamps = parts["f0"].astype(np.int64) * 1_000_000_000 + parts["f1"]
        return np.stack([stamps, np.array(self._arrivals, np.int64), parts["f2"]])


def first_message(topic: str) -> str:
    """Return the line that the listener prints for the first message of a topic.

    Args:
        topic: its name.
    """
    return f"the first message of {topic} arrived"


def listen(topics: list[str], out: Path) -> None:
    """Take in the messages of topics and write them to a file, one table of integers for each topic."""
    prepare_transport()
    rclpy.init(args=[])
    node = rclpy.create_node("bench_listener")
    heard = {topic: _Heard(topic) for topic in topics}
    for topic, messages in heard.items():
        subscribe(node, topic, messages.taking())
    spin_until_interrupted(node)
    np.savez(out, **{topic: messages.table() for topic, messages in heard.items()})  # type: ignore[arg-type]


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("topics", nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    listen(args.topics, args.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
