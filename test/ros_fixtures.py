"""Fixtures of tests on the ROS graph: ROS once per run, processes that end with their test."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="ROS 2 is not installed")

import rclpy
from ros_graph import Graph, NodeProcess, Start

from sgms_observer.nodes.transport import prepare_transport


@pytest.fixture(scope="session")
def ros() -> Iterator[None]:
    """Have ROS run in this process."""
    if not rclpy.ok():  # each folder that imports this fixture has one of its own
        prepare_transport()
        rclpy.init(signal_handler_options=rclpy.signals.SignalHandlerOptions.NO)
    yield
    rclpy.try_shutdown()


@pytest.fixture
def graph(ros: None) -> Iterator[Graph]:
    """Return a node of the test's own."""
    own = Graph()
    yield own
    own.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Return a function that starts a node on a parameter file's text; it is ended after the test."""
    started: list[NodeProcess] = []

    def start_node(name: str, yaml: str, *arguments: str, wait: bool = True) -> NodeProcess:
        file = tmp_path / f"{name}.yaml"
        file.write_text(yaml)
        process = NodeProcess(name, tmp_path, "--config", str(file), *arguments)
        started.append(process)
        if wait:
            process.wait_active()
        return process

    yield start_node
    for process in started:
        process.stop()
