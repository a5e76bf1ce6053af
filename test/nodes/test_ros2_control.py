"""The path into ros2_control: one joint_states topic in, commands of a forward effort controller out."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import yaml
from rclpy.serialization import deserialize_message, serialize_message
from ros_graph import Graph, Sender, Start, wait_until
from std_msgs.msg import Float64MultiArray

from sgms_observer.nodes.topics import encode_commands
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "config" / "ros2_control.yaml"
COMMANDS = "/friction_controller/commands"


def test_the_bytes_are_the_messages_that_ros_makes() -> None:
    for data in ([0.0], [1.5, -2.25, math.pi]):
        ours, theirs = encode_commands(data), serialize_message(Float64MultiArray(data=data))
        assert ours[:16] == theirs[:16]
        assert ours[20:] == theirs[20:]  # four bytes of padding before the first double are anything
        assert deserialize_message(ours, Float64MultiArray).data.tolist() == data


def test_the_example_names_what_belongs_together() -> None:
    document = yaml.safe_load(FILE.read_text())
    settings = load_settings(FILE)
    joints = document["friction_controller"]["ros__parameters"]["joints"]
    manager = document["controller_manager"]["ros__parameters"]
    assert [axis.name for axis in settings.axes] == joints
    assert manager["update_rate"] * settings.sample_period == 1.0
    assert "friction_controller" in manager
    launch = (ROOT / "launch" / "ros2_control.launch.py").read_text()
    assert COMMANDS in launch
    assert "ros2_control.yaml" in launch


def test_joint_states_in_commands_out_and_zero_when_they_stop(graph: Graph, start: Start) -> None:
    text = FILE.read_text().replace("enabled: false ", "enabled: true\n        timeout: 2.0 ")  # busy machines
    assert "timeout: 2.0" in text
    received: list[float] = []
    graph.node.create_subscription(Float64MultiArray, COMMANDS, lambda message: received.append(message.data[0]), 1000)
    topics = ("position:=joint_states", "control_effort:=joint_states", f"~/commands:={COMMANDS}")
    remap = [word for topic in topics for word in ("-r", topic)]
    start("observer_node", text, "--ros-args", *remap)
    sender = Sender(graph, ["x"], single="joint_states")
    speed, period = 0.01, 1.0e-3
    seconds = period * np.arange(2000)
    positions = [[value] for value in speed * seconds]
    efforts = [[4.0 + 20.0 * speed]] * len(seconds)
    stamps = [1_000_000_000 + round(value * 1e9) for value in seconds]
    sender.send_paced(1.0 / period, stamps, positions, efforts)
    wait_until(lambda: received and max(received) > 3.0, "a compensation of sliding friction")
    assert max(received) < 6.0
    wait_until(lambda: received[-1] == 0.0, "zero after the samples stopped")
