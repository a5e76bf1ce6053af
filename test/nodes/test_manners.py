"""What a ROS user expects of any node: no start on example numbers, one publisher of a force, names, ranges, levels."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import rclpy
from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters
from rclpy.parameter import Parameter
from ros_graph import ONE_AXIS, TWO_AXES, Graph, NodeProcess, Start, wait_until
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from test_observer_node import motion

from sgms_observer.bags.cdr import JointStateDecoder, JointStateEncoder
from sgms_observer.bags.diagnostics_cdr import DiagnosticStatus, decode_diagnostics
from sgms_observer.settings.load import load_settings

COMPENSATED = ONE_AXIS + "      compensation: {enabled: true, timeout: 5.0}\n"
OK, WARN, ERROR, STALE = range(4)
LARGEST = 1.0e13


def entries(graph: Graph) -> list[DiagnosticStatus]:
    """Return every entry of /diagnostics so far, the latest first."""
    return [entry for data in reversed(graph.messages["/diagnostics"]) for entry in decode_diagnostics(data)[1]]


@pytest.mark.parametrize("name", ["observer_node", "stage_node"])
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "was started without parameters"),
        (["--config", "/no/such/file.yaml"], "/no/such/file.yaml cannot be read"),
        (["--ros-args", "--params-file", "/no/such/file.yaml"], "/no/such/file.yaml cannot be read"),
        (["--config", "no_axes.yaml"], "axes must be given"),
        (["--config", "no_mass.yaml"], "x.mass must be given"),
        (["--ros-args", "-p", "use_sim_time:=true"], "axes must be given"),
    ],
)
def test_a_node_does_not_start_on_example_numbers(
    name: str, arguments: list[str], sentence: str, tmp_path: Path
) -> None:
    (tmp_path / "no_axes.yaml").write_text("/**: {ros__parameters: {x: {mass: 3.0}}}")
    (tmp_path / "no_mass.yaml").write_text("/**: {ros__parameters: {axes: [x], x: {friction: {static_force: 5.0}}}}")
    process = NodeProcess(name, tmp_path, *arguments)
    assert process.wait_end() == 1
    (said,) = process.text().splitlines()
    assert sentence in said


def test_two_observers_in_one_namespace_give_no_force(graph: Graph, start: Start) -> None:
    graph.listen("friction_compensation", "/diagnostics")
    first = start("observer_node", COMPENSATED)
    position, effort = graph.publisher("position"), graph.publisher("control_effort")
    reference = graph.publisher("reference")
    graph.meet("observer_node")
    stamps, positions, efforts = motion(4000)
    decoder, sent = JointStateDecoder(), iter(range(len(stamps)))

    def send(count: int) -> float:
        """Send some samples and return the largest compensation of the second half of them."""
        before = len(graph.messages["friction_compensation"])
        for _ in range(count):
            i = next(sent)
            position(JointStateEncoder(["x"], ("position",)).encode(stamps[i], positions[i]))
            effort(JointStateEncoder(["x"], ("effort",)).encode(stamps[i], efforts[i]))
            velocity = (positions[i + 1] - positions[i]) / 1.0e-3
            reference(JointStateEncoder(["x"], ("position", "velocity")).encode(stamps[i], positions[i], velocity))
        found = graph.wait_messages("friction_compensation", before + count)[before:]
        return max(abs(decoder.decode(data)[4][0]) for data in found[len(found) // 2 :])

    assert send(1500) > 0.5
    second = start("observer_node", COMPENSATED, "--ros-args", "-r", "__node:=other_observer")
    told = "/friction_compensation is published by another node as well"
    wait_until(lambda: told in first.text() and told in second.text(), "both observers to tell")
    wait_until(
        lambda: any(e.name == "observer_node" and e.level == ERROR and told in e.message for e in entries(graph)),
        "the diagnostics to tell",
    )
    assert send(600) == 0.0
    assert second.stop() == 0
    wait_until(lambda: "no other node publishes" in first.text(), "the observer to be alone again")
    assert send(1500) > 0.5


def test_every_range_is_finite_and_one_notch_of_a_slider_is_small(graph: Graph, start: Start) -> None:
    start("observer_node", COMPENSATED)
    names = graph.call(ListParameters, "/observer_node/list_parameters", ListParameters.Request()).result.names
    request = DescribeParameters.Request(names=names)
    answer = graph.call(DescribeParameters, "/observer_node/describe_parameters", request)
    found = {d.name: r for d in answer.descriptors for r in [*d.floating_point_range, *d.integer_range]}
    assert {"x.mass", "x.compensation.limit", "x.friction.static_force", "publish_every"} <= set(found)
    for name, bounds in found.items():
        for value in (bounds.from_value, bounds.to_value):
            assert math.isfinite(value) and (value == 0.0 or 1.0e-15 <= abs(value) <= LARGEST), name
    assert found["x.compensation.limit"].to_value == 100.0  # ten times what it started with


def test_the_observer_declares_nothing_of_the_stage_and_saves_it(graph: Graph, start: Start, tmp_path: Path) -> None:
    """The file is the user's: what is saved still simulates the same stage; it lies beside the file it came from."""
    start("observer_node", ONE_AXIS)
    names = graph.call(ListParameters, "/observer_node/list_parameters", ListParameters.Request()).result.names
    assert "x.mass" in names and not [name for name in names if ".stage." in name]
    before = load_settings(tmp_path / "observer_node.yaml").axes[0]
    for gain in (before.compensation.gain, 0.5):
        change = SetParameters.Request(parameters=[Parameter("x.compensation.gain", value=gain).to_parameter_msg()])
        assert graph.call(SetParameters, "/observer_node/set_parameters", change).results[0].successful
        answer = graph.call(Trigger, "/observer_node/save_parameters", Trigger.Request())
        assert answer.success, answer.message
        after = load_settings(tmp_path / "learnt.yaml").axes[0]
        assert (after.stage, after.stage_friction) == (before.stage, before.stage_friction)
        assert after.compensation.gain == gain


def test_diagnostics_carry_the_namespace_and_levels_by_convention(graph: Graph, start: Start) -> None:
    graph.listen("/diagnostics")
    start("observer_node", TWO_AXES, "--ros-args", "-r", "__ns:=/left")
    expected = {"left/observer_node", "left/observer_node: axis x", "left/observer_node: axis y"}
    wait_until(lambda: {entry.name for entry in entries(graph)} >= expected, "the diagnostics")
    assert {entry.name for entry in entries(graph)} == expected
    by_name = {entry.name: entry for entry in entries(graph)}
    assert by_name["left/observer_node"].level == OK
    axis = by_name["left/observer_node: axis x"]
    assert axis.level == WARN and dict(axis.values)["state"] == "starting"  # no sample came yet
    assert STALE not in {entry.level for entry in entries(graph)}


def test_joint_names_may_have_a_slash(graph: Graph, start: Start) -> None:
    graph.listen("/diagnostics")
    start("observer_node", ONE_AXIS.replace("[x]", "[left/x]").replace("    x:", "    left/x:"))
    wait_until(lambda: [e for e in entries(graph) if e.name == "observer_node: axis left/x"], "the diagnostics")


def test_a_command_line_tool_on_a_fast_topic_is_told(graph: Graph, start: Start) -> None:
    tool = rclpy.create_node("_ros2cli_4711")
    tool.create_subscription(JointState, "friction_estimate", lambda message: None, 10)
    node = start("observer_node", ONE_AXIS)
    told = "/friction_estimate is read by a command-line tool (_ros2cli_4711)"
    wait_until(lambda: told in node.text(), "the warning")
    tool.destroy_node()
