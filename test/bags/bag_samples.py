"""Small bags for the tests, written by rosbags, the independent implementation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sgms_observer.bags.cdr import JointStateEncoder

JOINT_STATE = "sensor_msgs/msg/JointState"
STEP = 1_000_000
START = 1_700_000_000_000_000_000


def recorded_messages(count: int) -> list[tuple[str, int, bytes]]:
    """Return topic, time and bytes of ``count`` samples of axis x, with the tail that Fast DDS leaves."""
    position, effort = JointStateEncoder(("x",), ("position",)), JointStateEncoder(("x",), ("effort",))
    messages = []
    for i in range(count):
        stamp = START + i * STEP
        messages.append(("/position", stamp + 100_000, position.encode(stamp, (i * 1e-6,)) + b"\xa5" * 8))
        messages.append(
            ("/control_effort", stamp + 200_000, effort.encode(stamp, (float(i),)) + b"\x5a" * (8 * (i % 2)))
        )
    return messages


def write_with_rosbags(
    path: Path,
    messages: list[tuple[str, int, bytes]],
    storage: str = "mcap",
    compression: str = "none",
    kind: str = JOINT_STATE,
) -> Path:
    """Write a bag with rosbags."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage.upper()])
    writer.set_compression(rosbag2.CompressionMode[compression.upper()], rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic: writer.add_connection(topic, kind, typestore=store)
            for topic in dict.fromkeys(m[0] for m in messages)
        }
        for topic, log_ns, data in messages:
            writer.write(connections[topic], log_ns, data)
    return path


def read_with_rosbags(path: Path) -> list[tuple[str, int, bytes]]:
    """Read a bag with rosbags."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    with rosbag2.Reader(path) as reader:
        return [(connection.topic, log_ns, bytes(data)) for connection, log_ns, data in reader.messages()]


def positions(count: int) -> np.ndarray:
    """Return the positions that ``recorded_messages`` holds."""
    return np.arange(count) * 1e-6
