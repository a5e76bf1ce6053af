"""What a killed process leaves in shared memory does not keep the next one from starting."""

from __future__ import annotations

import fcntl
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from program import PATIENCE, ROOT
from ros_graph import ONE_AXIS

from sgms_observer.nodes.transport import remove_half_made_ports, remove_left_segments

MADE, BEING_MADE = b"\x02\x00\x00\x00" + bytes(60), b"\x01\x00\x00\x00" + bytes(60)
PORT = "fastrtps_port7412"
_ENVIRONMENT = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])}


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
    remove_left_segments(tmp_path / "missing")


def test_only_segments_of_ended_processes_are_removed(tmp_path: Path) -> None:
    left, used, new = ("fastrtps_" + digit * 16 for digit in "0a3")
    for name in (left, used, new):
        for path in (tmp_path / name, tmp_path / f"{name}_el"):
            path.write_bytes(b"")
            os.utime(path, (0.0, time.time() - (0.0 if name == new else 60.0)))
    (tmp_path / PORT).write_bytes(MADE)
    (tmp_path / f"{PORT}_el").write_bytes(b"")
    with (tmp_path / f"{used}_el").open() as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        remove_left_segments(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {used, f"{used}_el", new, f"{new}_el", PORT, f"{PORT}_el"}


_LEAVING = """
import importlib, sys
from contextlib import suppress
from pathlib import Path
from sgms_observer.nodes import spin
leave = spin.leave_graph
def leave_and_show(executor, node):
    leave(executor, node)
    names = []
    for path in Path("/proc/self/task").glob("*/comm"):
        with suppress(OSError):  # a thread that ends meanwhile
            names.append(path.read_text().strip())
    print("left:", *names)
spin.leave_graph = leave_and_show
sys.exit(importlib.import_module(f"sgms_observer.nodes.{sys.argv[1]}").main(sys.argv[2:]))
"""


@pytest.mark.parametrize("name", ["stage_node", "observer_node"])
def test_a_node_that_ends_takes_the_middleware_with_it(name: str, tmp_path: Path) -> None:
    """Threads of a participant that outlives its node run into the end of Python: once in some thousand, it crashed."""
    pytest.importorskip("rclpy", reason="ROS is not installed")
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    if os.environ.get("RMW_IMPLEMENTATION", "rmw_fastrtps_cpp") != "rmw_fastrtps_cpp":
        pytest.skip("the threads are those of Fast DDS")
    command = [sys.executable, "-c", _LEAVING, name, "--config", str(tmp_path / "axis.yaml")]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=_ENVIRONMENT, text=True
    ) as process:
        assert process.stderr is not None and any("active: axes" in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    threads = output.partition("left:")[2].split()
    assert "dds.shm.wdog" in threads  # the process's, whatever nodes it has
    assert [thread for thread in threads if thread.startswith("dds.")] == ["dds.shm.wdog"]


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
    command = [sys.executable, "-c", _TALKER]
    with subprocess.Popen(command, stdout=subprocess.PIPE, env=_ENVIRONMENT, text=True) as talker:
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
