"""What a killed process leaves in shared memory does not keep the next one from starting."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from sgms_observer.nodes.transport import remove_half_made_ports

MADE, BEING_MADE = b"\x02\x00\x00\x00" + bytes(60), b"\x01\x00\x00\x00" + bytes(60)
PORT = "fastrtps_port7412"


@pytest.mark.parametrize("content", [b"", b"\x00", BEING_MADE])
def test_an_old_half_made_port_is_removed(content: bytes, tmp_path: Path) -> None:
    names = (PORT, "fastrtps_port7411", f"{PORT}_el", "fastrtps_0123456789abcdef", "sem.fastrtps_port7412_mutex")
    for name in names:
        (tmp_path / name).write_bytes(MADE if name == "fastrtps_port7411" else content)
    os.utime(tmp_path / PORT, (0.0, time.time() - 60.0))
    remove_half_made_ports(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(names) - {PORT}


def test_a_port_that_is_being_made_is_waited_for(tmp_path: Path) -> None:
    port = tmp_path / PORT
    port.write_bytes(BEING_MADE)
    begun = time.monotonic()
    remove_half_made_ports(tmp_path)
    assert not port.exists() and time.monotonic() - begun > 4.0


def test_no_shared_memory_is_no_fault(tmp_path: Path) -> None:
    remove_half_made_ports(tmp_path / "missing")


_TALKER = """
import rclpy
from sgms_observer.nodes.transport import prepare_transport
from std_msgs.msg import Empty
prepare_transport()
rclpy.init()
node = rclpy.create_node("to_be_killed")
publisher = node.create_publisher(Empty, "last_words", 1)
print("up", flush=True)
rclpy.spin(node)
"""


def test_a_killed_node_is_forgotten_long_before_the_middleware_would() -> None:
    """Fast DDS keeps a dead participant for 20 s; whoever has our profile promises to be heard of within 5 s."""
    rclpy = pytest.importorskip("rclpy", reason="ROS is not installed")
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(root), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-c", _TALKER]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as talker:
        context = rclpy.context.Context()
        rclpy.init(context=context)
        try:
            node = rclpy.create_node("watcher", context=context)
            assert talker.stdout is not None and talker.stdout.readline() == "up\n"
            assert _becomes(1, node, 30.0)
            talker.kill()
            assert _becomes(0, node, 15.0)
            node.destroy_node()
        finally:
            talker.kill()
            rclpy.try_shutdown(context=context)


def _becomes(count: int, node: Any, most: float) -> bool:
    """Return whether that many publish before the time [s] is over."""
    end = time.monotonic() + most
    while node.count_publishers("last_words") != count and time.monotonic() < end:
        time.sleep(0.1)
    return bool(node.count_publishers("last_words") == count)
