"""The path into ros2_control: one joint_states topic in, commands of a forward effort controller out."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message
from ros_graph import Graph, Sender, Start, wait_until
from std_msgs.msg import Float64MultiArray

from sgms_observer.nodes.topics import encode_commands
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "config" / "ros2_control.yaml"
LAUNCH = ROOT / "launch" / "ros2_control.launch.py"
CONTROLLER = "friction_controller"
BROADCASTER = "joint_state_broadcaster"


def default_of(argument: str) -> str:
    """Return the default value of an argument of the launch file, which launch is not needed for."""
    found = re.search(rf'"{argument}", default_value="([^"]*)"', LAUNCH.read_text())
    assert found is not None
    return found[1]


STATES, COMMANDS = default_of("joint_states"), default_of("command_topic")


def test_the_bytes_are_the_messages_that_ros_makes() -> None:
    for data in ([0.0], [1.5, -2.25, math.pi]):
        ours, theirs = encode_commands(data), serialize_message(Float64MultiArray(data=data))
        assert ours[:16] == theirs[:16]
        assert ours[20:] == theirs[20:]  # four bytes of padding before the first double are anything
        assert deserialize_message(ours, Float64MultiArray).data.tolist() == data


def test_the_example_names_what_belongs_together() -> None:
    document = yaml.safe_load(FILE.read_text())
    settings = load_settings(FILE)
    joints = document[f"/**/{CONTROLLER}"]["ros__parameters"]["joints"]
    manager = document["/**/controller_manager"]["ros__parameters"]
    assert [axis.name for axis in settings.axes] == joints
    assert manager["update_rate"] * settings.sample_period == 1.0
    assert CONTROLLER in manager
    assert f"{CONTROLLER}/commands" == COMMANDS  # the ~/commands of the controller
    assert "ros2_control.yaml" in LAUNCH.read_text()


@pytest.mark.parametrize("namespace", ["/", "/left", "/cell/left"])
def test_every_section_counts_in_any_namespace(namespace: str, ros: None) -> None:
    """What rcl gives each node of the file, and what the spawner of Jazzy looks for in it."""
    document = yaml.safe_load(FILE.read_text())
    for name in ("controller_manager", BROADCASTER, CONTROLLER):
        node = Node(
            name, namespace=namespace, cli_args=["--ros-args", "--params-file", str(FILE)], use_global_arguments=False,
            automatically_declare_parameters_from_overrides=True, enable_rosout=False, start_parameter_services=False,
        )  # fmt: skip
        given = {key: value.value for key, value in node.get_parameters_by_prefix("").items()}
        node.destroy_node()
        if name == "controller_manager":
            assert given["update_rate"] == 1000
        else:
            assert given["type"] == document[f"/**/{name}"]["ros__parameters"]["type"]


@pytest.mark.parametrize("namespace", ["", "/left"])
def test_joint_states_in_commands_out_and_zero_when_they_stop(namespace: str, graph: Graph, start: Start) -> None:
    text = FILE.read_text().replace("enabled: false ", "enabled: true\n        timeout: 2.0 ")  # busy machines
    assert "timeout: 2.0" in text
    received: list[float] = []
    graph.node.create_subscription(
        Float64MultiArray, f"{namespace}/{COMMANDS}", lambda message: received.append(message.data[0]), 1000
    )
    names = {"position": STATES, "control_effort": STATES, "~/commands": COMMANDS, "__ns": namespace or "/"}
    remap = [word for name, other in names.items() for word in ("-r", f"{name}:={other}")]
    start("observer_node", text, "--ros-args", *remap)
    sender = Sender(graph, ["x"], single=f"{namespace}/joint_states", node=f"{namespace}/observer_node".lstrip("/"))
    speed, period = 0.01, 1.0e-3
    seconds = period * np.arange(2000)
    positions = [[value] for value in speed * seconds]
    efforts = [[4.0 + 20.0 * speed]] * len(seconds)
    stamps = [1_000_000_000 + round(value * 1e9) for value in seconds]
    sender.send_paced(1.0 / period, stamps, positions, efforts)
    wait_until(lambda: received and max(received) > 3.0, "a compensation of sliding friction")
    assert max(received) < 6.0
    wait_until(lambda: received[-1] == 0.0, "zero after the samples stopped")
