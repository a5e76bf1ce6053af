"""A process that notes when each estimate arrives and what it says, until it is told to stop."""

from __future__ import annotations

import argparse
import sys
import time
from array import array
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.task import Future

from sgms_observer.nodes.spin import make_executor
from sgms_observer.nodes.topics import subscribe
from sgms_observer.nodes.transport import use_shipped_transport

_STAMP = slice(4, 12)  # seconds and nanoseconds in a message that begins with a header
_LAST = slice(-8, None)  # the last number of the message: the effort of the last axis


def listen(topic: str, out: Path) -> None:
    """Take in a topic's messages and write them to a file, shape (3, n).

    The rows are stamp [ns], arrival [ns], and the bits of the last axis's effort [N], all as integers.

    Args:
        topic: what to listen to.
        out: the file (.npy).
    """
    use_shipped_transport()
    rclpy.init(args=[])
    node = rclpy.create_node("bench_listener")
    kept = bytearray()
    arrivals = array("q")
    keep, keep_arrival, now = kept.extend, arrivals.append, time.time_ns

    def take(message: bytes) -> None:
        keep_arrival(now())
        keep(message[_STAMP])
        keep(message[_LAST])

    subscribe(node, topic, take)
    executor = make_executor()
    executor.add_node(node)
    never: Future = Future()
    try:
        while rclpy.ok():
            executor.spin_until_future_complete(never, timeout_sec=3600.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    parts = np.frombuffer(bytes(kept), "<i4,<u4,<i8")
    stamps = parts["f0"].astype(np.int64) * 1_000_000_000 + parts["f1"]
    np.save(out, np.stack([stamps, np.array(arrivals, np.int64), parts["f2"]]))
    node.destroy_node()
    rclpy.try_shutdown()


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--topic", required=True)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    listen(args.topic, args.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
