"""Starting and ending the nodes: lifecycle, signals, wrong parameters."""

from __future__ import annotations

import signal
import time
from pathlib import Path

import pytest
from program import is_of_ours
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.parameter import Parameter
from ros_graph import (
    ACTIVATE,
    CLEAN_UP,
    CONFIGURE,
    DEACTIVATE,
    ONE_AXIS,
    Graph,
    NodeProcess,
    Start,
    wait_until,
)
from std_srvs.srv import Trigger

from sgms_observer.settings.load import load_settings

NODES = ("stage_node", "observer_node")


@pytest.mark.parametrize("name", NODES)
def test_a_node_activates_itself(name: str, graph: Graph, start: Start) -> None:
    start(name, ONE_AXIS)
    assert graph.state(name) == "active"


@pytest.mark.parametrize("name", NODES)
def test_every_transition_twice(name: str, graph: Graph, start: Start) -> None:
    start(name, ONE_AXIS, "--ros-args", "-p", "autostart:=false", wait=False)
    for _ in range(2):
        assert graph.state(name) == "unconfigured"
        for transition, state in ((CONFIGURE, "inactive"), (ACTIVATE, "active"), (DEACTIVATE, "inactive")):
            assert graph.change(name, transition)
            assert graph.state(name) == state
        assert graph.change(name, CLEAN_UP)


@pytest.mark.parametrize("name", NODES)
def test_a_transition_that_the_state_does_not_have_is_refused(name: str, graph: Graph, start: Start) -> None:
    """rclpy's own service raises into the executor, and the node would end."""
    node = start(name, ONE_AXIS)
    assert not graph.change(name, ACTIVATE)
    assert not graph.change(name, CONFIGURE)
    assert graph.state(name) == "active"
    assert node.stop() == 0, node.text()
    assert node.text().count("is not allowed in the present state") == 2


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("signals", [(signal.SIGINT,), (signal.SIGTERM,), (signal.SIGINT, signal.SIGINT)])
def test_signals_end_an_active_node_cleanly(name: str, signals: tuple[int, ...], start: Start) -> None:
    process = start(name, ONE_AXIS)
    for number in signals[:-1]:
        process.process.send_signal(number)
    assert process.stop(signals[-1]) == 0
    assert "Traceback" not in process.text() and "Exception" not in process.text()


@pytest.mark.parametrize("name", NODES)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("delay", [0.1, 0.5, 1.5])
def test_signals_end_a_starting_node(name: str, number: int, delay: float, start: Start) -> None:
    process = start(name, ONE_AXIS, wait=False)
    time.sleep(delay)
    code = process.stop(number)
    assert code in (0, 130, -number), process.text()
    assert not is_of_ours(process.text()), process.text()


@pytest.mark.parametrize("name", NODES)
def test_wrong_parameters_stop_the_start_with_every_sentence(name: str, start: Start) -> None:
    yaml = ONE_AXIS.replace("mass: 3.0", "mass: -3.0\n      frobnicate: 1")
    process = start(name, yaml, wait=False)
    assert process.wait_end() == 1
    lines = process.text().splitlines()
    assert len(lines) == 2
    assert any("x.mass = -3" in line for line in lines)
    assert any("frobnicate" in line for line in lines)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (("--ros-args", "-p", "x.mass:=heavy"), "x.mass"),
        (("--ros-args", "--params-file", "/no/such.yaml"), "/no/such.yaml"),
        (("--ros-args", "-r", "position"), "refused"),
        (("--frobnicate",), "--frobnicate"),
    ],
)
def test_a_wrong_command_line_is_sentences(arguments: tuple[str, ...], word: str, start: Start) -> None:
    process = start("observer_node", ONE_AXIS, *arguments, wait=False)
    assert process.wait_end() in (1, 2)
    assert word in process.text()
    assert "Traceback" not in process.text()


def test_what_a_user_means_is_taken(graph: Graph, start: Start) -> None:
    """rcl alone refuses lists that mix integers and floats, and integers for floats."""
    yaml = ONE_AXIS.replace("mass: 3.0", "mass: 3\n      friction: {element_stiffness: [12.0e6, 2, 3.0, 4]}")
    start("observer_node", yaml, "--ros-args", "-p", "x.mass:=4")
    assert graph.state("observer_node") == "active"


def test_parameters_have_types_ranges_and_meanings(graph: Graph, start: Start) -> None:
    start("observer_node", ONE_AXIS)
    names = ["x.mass", "x.estimator.horizon", "x.friction.model", "axes"]
    answer = graph.call(
        DescribeParameters, "/observer_node/describe_parameters", DescribeParameters.Request(names=names)
    )
    mass, horizon, model, axes = answer.descriptors
    assert mass.type == Parameter.Type.DOUBLE.value and 0.0 < mass.floating_point_range[0].from_value <= 1e-9
    assert horizon.type == Parameter.Type.INTEGER.value and horizon.integer_range[0].from_value == 1
    assert "sgms" in model.additional_constraints
    assert axes.read_only
    assert all(descriptor.description for descriptor in answer.descriptors)


def test_only_the_compensation_changes_at_run_time(graph: Graph, start: Start) -> None:
    start("observer_node", ONE_AXIS)

    def change(name: str, value: object) -> tuple[bool, str]:
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        result = graph.call(SetParameters, "/observer_node/set_parameters", request).results[0]
        return result.successful, result.reason

    assert change("x.compensation.gain", 0.5) == (True, "")
    assert change("x.compensation.gain", 1.5)[0] is False
    is_changed, reason = change("x.mass", 4.0)
    assert not is_changed and "configured" in reason


def test_a_node_that_cannot_be_configured_says_why_and_stays(graph: Graph, start: Start) -> None:
    """Parameters may change while the node is unconfigured; a combination that cannot work is refused there."""
    process = start("observer_node", ONE_AXIS, "--ros-args", "-p", "autostart:=false", wait=False)
    parameter = Parameter("x.friction.static_force", value=1.0).to_parameter_msg()
    request = SetParameters.Request(parameters=[parameter])
    result = graph.call(SetParameters, "/observer_node/set_parameters", request).results[0]
    assert not result.successful and "coulomb_force" in result.reason
    assert graph.change("observer_node", CONFIGURE)
    assert process.stop() == 0


def test_what_is_set_before_the_node_is_configured_counts(graph: Graph, start: Start, tmp_path: Path) -> None:
    start("observer_node", ONE_AXIS, "--ros-args", "-p", "autostart:=false", wait=False)
    results = []
    for name, value in (("x.mass", 4.0), ("x.friction.static_force", 1.0), ("x.friction.viscous_coefficient", 30.0)):
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        results.append(graph.call(SetParameters, "/observer_node/set_parameters", request).results[0].successful)
    assert results == [True, False, True]  # static_force below coulomb_force
    assert graph.change("observer_node", CONFIGURE)
    assert graph.call(Trigger, "/observer_node/save_parameters", Trigger.Request()).success
    axis, given = (load_settings(tmp_path / name).axes[0] for name in ("learnt.yaml", "observer_node.yaml"))
    assert (axis.mass, axis.friction.viscous_coefficient) == (4.0, 30.0)
    assert (axis.friction.static_force, axis.stage) == (given.friction.static_force, given.stage)


def test_help_needs_no_ros(tmp_path: Path) -> None:
    process = NodeProcess("observer_node", tmp_path, "--help")
    assert process.wait_end() == 0
    assert "--ros-args" in process.text()
    wait_until(lambda: process.text().endswith("\n"), "the end of the help")
