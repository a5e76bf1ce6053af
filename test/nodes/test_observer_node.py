"""The observer node on the graph: what it publishes, counts and answers."""

from __future__ import annotations

import itertools
import math
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message
from ros_graph import DEACTIVATE, ONE_AXIS, TWO_AXES, Graph, NodeProcess, Sender, Start, decode_joint_state, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from sgms_observer.bags.diagnostics_cdr import decode_diagnostics
from sgms_observer.nodes.engine import Engine
from sgms_observer.settings.load import load_settings

SECOND = 1_000_000_000
START_NS = 1_700_000_000 * SECOND
OUTPUTS = ("friction_estimate", "friction_std", "friction_compensation", "friction_elements")


def motion(count: int, period: float = 1.0e-3, axes: int = 1) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Return stamps, positions and efforts of axes that move to and fro, shapes (n,), (n, axes), (n, axes)."""
    seconds = np.arange(count) * period
    phase = np.outer(seconds * 2.0 * math.pi * 2.0, np.ones(axes)) + np.arange(axes)
    position = 1.0e-3 * np.sin(phase)
    effort = 4.0 * np.tanh(np.cos(phase) / 0.05) - 3.0 * (4.0 * math.pi) ** 2 * position
    stamps = [START_NS + round(second * SECOND) for second in seconds.tolist()]
    return stamps, position, effort


def test_every_topic_of_the_interface(graph: Graph, start: Start) -> None:
    graph.listen(*OUTPUTS, "friction_parameters", "/diagnostics")
    start("observer_node", ONE_AXIS)
    sender = Sender(graph, ["other", "x"])
    stamps, position, effort = motion(1500)
    for i, stamp in enumerate(stamps):
        sender.send(stamp, [9.9, position[i, 0]], [0.0, effort[i, 0]])
    for topic in OUTPUTS:
        messages = [deserialize_message(data, JointState) for data in graph.wait_messages(topic, 1500)]
        assert [m.header.stamp.sec * SECOND + m.header.stamp.nanosec for m in messages] == stamps
        names = [f"x/{i}" for i in range(1, 5)] if topic == "friction_elements" else ["x"]
        assert all(list(m.name) == names for m in messages)
        filled = {"friction_estimate": (1, 1, 1), "friction_elements": (4, 0, 4)}.get(topic, (0, 0, 1))
        assert all((len(m.position), len(m.velocity), len(m.effort)) == filled for m in messages)
        assert all(math.isfinite(value) for m in messages for value in [*m.position, *m.velocity, *m.effort])
    estimates = [decode_joint_state(data) for data in graph.messages["friction_estimate"]]
    assert abs(estimates[-1][2][0] - position[-1, 0]) < 1.0e-5
    stamp, entries = decode_diagnostics(graph.wait_messages("friction_parameters", 10)[-1])
    assert stamp in stamps
    assert [key for key, _ in entries[0].values] == ["kappa", "kappa_std"]
    values = wait_until(lambda: graph.axis_diagnostics("x"), "diagnostics")
    assert {"state", "rate [Hz]", "dropped", "rejected", "NIS"} <= set(values)


def test_two_axes_share_their_messages(graph: Graph, start: Start) -> None:
    graph.listen(*OUTPUTS)
    start("observer_node", TWO_AXES)
    sender = Sender(graph, ["y", "x"])
    stamps, position, effort = motion(500, axes=2)
    for i, stamp in enumerate(stamps):
        sender.send(stamp, position[i].tolist(), effort[i].tolist())
    for data in graph.wait_messages("friction_estimate", 500):
        assert decode_joint_state(data)[1] == ("x", "y")
    x, y = decode_joint_state(graph.messages["friction_estimate"][-1])[2]
    assert abs(y - position[-1, 0]) < 1.0e-4 and abs(x - position[-1, 1]) < 1.0e-4
    assert len(decode_joint_state(graph.wait_messages("friction_elements", 500)[0])[1]) == 8


def test_position_and_effort_on_one_topic(graph: Graph, start: Start) -> None:
    graph.listen("friction_estimate")
    remap = ("--ros-args", "-r", "position:=joint_states", "-r", "control_effort:=joint_states")
    start("observer_node", ONE_AXIS, *remap)
    sender = Sender(graph, ["x"], single="joint_states")
    stamps, position, effort = motion(500)
    for i, stamp in enumerate(stamps):
        sender.send(stamp, position[i].tolist(), effort[i].tolist())
    single = graph.wait_messages("friction_estimate", 500)
    assert [decode_joint_state(data)[0] for data in single] == stamps


@pytest.mark.parametrize("gather_time", ["0.0", "5.0e-2"])
def test_the_node_gives_the_bits_that_the_engine_gives(
    gather_time: str, graph: Graph, start: Start, tmp_path: Path
) -> None:
    """Whatever blocks ``gather_time`` and the machine's load make of the samples, the numbers are the same."""
    graph.listen(*OUTPUTS, "/diagnostics")
    start("observer_node", ONE_AXIS.replace("    x:\n", f"    gather_time: {gather_time}\n    x:\n"))
    sender = Sender(graph, ["x"])
    stamps, position, effort = motion(3000)
    generator = np.random.default_rng(4)
    for i, stamp in enumerate(stamps):
        sender.send(stamp, position[i].tolist(), effort[i].tolist())
        if generator.random() < 0.05:
            time.sleep(generator.random() * 0.01)
    for topic in OUTPUTS:
        graph.wait_messages(topic, 3000)
    engine = Engine(load_settings(tmp_path / "observer_node.yaml"))
    for pairing in engine.intake.pairings:
        for i, stamp in enumerate(stamps):
            pairing.push_position(stamp, float(position[i, 0]))
            pairing.push_effort(stamp, float(effort[i, 0]))
    blocks = {block.topic: block for block in engine.process().blocks}
    for topic in OUTPUTS:
        live = [decode_joint_state(data) for data in graph.messages[topic]]
        fields = {"position": 2, "velocity": 3, "effort": 4}
        for name, values in blocks[topic].values.items():
            assert np.array_equal(np.array([message[fields[name]] for message in live]), values), (topic, name)
    if float(gather_time):  # 20 blocks a second at most: many samples each, whatever the load

        def are_many_at_once() -> bool:
            entries = [entry for data in graph.messages["/diagnostics"] for entry in decode_diagnostics(data)[1]]
            steps = [dict(entry.values).get("samples per step", "nan") for entry in entries]
            return any(float(number) > 10.0 for number in steps if number not in ("nan", "unknown"))

        wait_until(are_many_at_once, "diagnostics of the seconds in which the samples came")


@pytest.mark.parametrize("rate", [1.0e3, 1.0e4])
def test_nothing_is_lost(rate: float, graph: Graph, start: Start) -> None:
    count = int(2.0 * rate)
    graph.listen("friction_compensation")
    period = 1.0 / rate
    yaml = ONE_AXIS.replace("1.0e-3", f"{period:.1e}").replace("8.0e-3", f"{8.0 * period:.1e}")
    start("observer_node", yaml)
    sender = Sender(graph, ["x"])
    stamps, position, effort = motion(count, period)
    answers = graph.messages["friction_compensation"]
    sender.send_paced(rate, stamps, position.tolist(), effort.tolist(), answers)
    received = [decode_joint_state(data)[0] for data in graph.wait_messages("friction_compensation", count)]
    assert received == stamps


def test_bad_messages_are_counted_and_told(graph: Graph, start: Start) -> None:
    graph.listen("friction_estimate", "/diagnostics")
    process = start("observer_node", ONE_AXIS)
    sender = Sender(graph, ["x"])
    stamps, position, effort = motion(400)
    for i, stamp in enumerate(stamps):
        value = math.nan if i == 100 else position[i, 0]
        sender.send(stamp, [value], effort[i].tolist())
        if i == 200:
            sender.send(stamp, [value], effort[i].tolist())
            sender.send(stamps[150], [value], effort[150].tolist())
    graph.wait_messages("friction_estimate", 399)
    values = wait_until(lambda: (v := graph.axis_diagnostics("x")).get("samples") == "399" and v, "the counts")
    assert values["dropped"] == "5"
    assert values["unmatched efforts"] == "1"
    wait_until(lambda: "NaN" in process.text(), "the sentence about NaN")
    assert "check for two publishers" in process.text()


def test_silence_is_told(graph: Graph, start: Start) -> None:
    graph.listen("/diagnostics")
    process = start("observer_node", ONE_AXIS)
    wait_until(lambda: "no samples arrive" in process.text(), "the sentence about silence")
    assert "no samples arrive" in wait_until(lambda: graph.axis_diagnostics("x"), "diagnostics")["message"]


def test_reset_starts_anew(graph: Graph, start: Start) -> None:
    graph.listen("friction_estimate", "/diagnostics")
    start("observer_node", ONE_AXIS)
    sender = Sender(graph, ["x"])
    stamps, position, effort = motion(500)
    for round_number in (1, 2):
        for i, stamp in enumerate(stamps):
            sender.send(stamp, position[i].tolist(), effort[i].tolist())
        graph.wait_messages("friction_estimate", 500 * round_number)
        answer = graph.call(Trigger, "/observer_node/reset", Trigger.Request())
        assert answer.success
    first, second = graph.messages["friction_estimate"][:500], graph.messages["friction_estimate"][500:]
    assert [decode_joint_state(data) for data in first] == [decode_joint_state(data) for data in second]


def test_save_parameters_writes_what_was_learnt(graph: Graph, start: Start, tmp_path: Path) -> None:
    graph.listen("friction_parameters", "friction_estimate")
    start("observer_node", ONE_AXIS)
    sender = Sender(graph, ["x"])
    stamps, position, effort = motion(2000)
    for i, stamp in enumerate(stamps):
        sender.send(stamp, position[i].tolist(), effort[i].tolist())
    graph.wait_messages("friction_estimate", 2000)
    answer = graph.call(Trigger, "/observer_node/save_parameters", Trigger.Request())
    assert answer.success, answer.message
    learnt, before = load_settings(tmp_path / "learnt.yaml"), load_settings(tmp_path / "observer_node.yaml")
    kappa = np.array(learnt.axes[0].friction.element_stiffness) / before.axes[0].friction.element_stiffness
    reported = [
        float(dict(decode_diagnostics(data)[1][0].values)["kappa"]) for data in graph.messages["friction_parameters"]
    ]
    assert np.ptp(kappa) < 1e-12 and kappa[0] != 1.0
    assert min(reported) * 0.9 <= kappa[0] <= max(reported) * 1.1
    assert learnt.axes[0].mass == before.axes[0].mass


def test_a_file_that_cannot_be_written_is_an_answer(graph: Graph, start: Start) -> None:
    start("observer_node", ONE_AXIS, "--ros-args", "-p", "save_file:=/proc/learnt.yaml")
    answer = graph.call(Trigger, "/observer_node/save_parameters", Trigger.Request())
    assert not answer.success and "/proc" in answer.message


def _last_compensation(graph: Graph) -> float:
    messages = graph.messages["friction_compensation"]
    return decode_joint_state(messages[-1])[4][0] if messages else 0.0


def _set(graph: Graph, name: str, value: Any) -> None:
    request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
    assert graph.call(SetParameters, "/observer_node/set_parameters", request).results[0].successful


def test_compensation_follows_its_parameter_and_ends_with_the_data(graph: Graph, start: Start) -> None:
    graph.listen("friction_compensation")
    start("observer_node", ONE_AXIS + "      compensation: {timeout: 2.0}\n")  # longer than a busy machine holds us up
    sender = Sender(graph, ["x"])
    stamps, position, effort = motion(4000)

    def send(first: int, last: int) -> None:
        sender.send_paced(1.0e3, stamps[first:last], position[first:last].tolist(), effort[first:last].tolist())
        graph.wait_messages("friction_compensation", last)

    send(0, 500)
    assert all(decode_joint_state(data)[4] == (0.0,) for data in graph.messages["friction_compensation"])
    _set(graph, "x.compensation.enabled", True)
    send(500, 1550)  # the last of these lies at full speed
    forces = [decode_joint_state(data)[4][0] for data in graph.messages["friction_compensation"]]
    assert 1.0 < max(map(abs, forces)) <= 10.0
    wait_until(lambda: _last_compensation(graph) == 0.0, "zero after the data ended")


#: Trust grows slowly, to about 0.15 N with the samples below, and the watchdog stays away.
PATIENT = ONE_AXIS + "      compensation: {enabled: true, timeout: 30.0}\n"


class Listener:
    """Hears both topics of the compensation while samples make it act.

    Args:
        graph: where.
    """

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self.commands: list[float] = []
        graph.listen("friction_compensation")
        graph.node.create_subscription(
            Float64MultiArray, "/observer_node/commands", lambda message: self.commands.append(message.data[0]), 1000
        )

    def send_samples(self) -> int:
        """Send samples until the compensation acts; return their number, which is that of the forces."""
        sender = Sender(self._graph, ["x"])
        self._rest = samples = zip(*motion(20_000), strict=True)
        for stamp, position, effort in itertools.islice(samples, 1550):
            sender.send(stamp, position.tolist(), effort.tolist())
        self._sender = sender
        return 1550

    def send_one(self) -> None:
        """Send one sample more."""
        stamp, position, effort = next(self._rest)
        self._sender.send(stamp, position.tolist(), effort.tolist())

    def check_end(self, samples: int) -> None:
        """Check that the last word is zero on both topics, and that it came in steps that the slew limit allows."""
        wait_until(lambda: _last_compensation(self._graph) == 0.0, "zero at the end")
        wait_until(lambda: self.commands and self.commands[-1] == 0.0, "zero at the end of the commands")
        received = [decode_joint_state(data)[4][0] for data in self._graph.messages["friction_compensation"]]
        sizes = [abs(force) for force in received[samples - 1 :]]
        assert sizes[0] > 0.1 and sizes == sorted(sizes, reverse=True)
        assert len(sizes) > 5, "half a second's way was made at once"


def test_deactivation_leaves_no_compensation(graph: Graph, start: Start) -> None:
    listener = Listener(graph)
    start("observer_node", PATIENT)
    count = listener.send_samples()
    graph.wait_messages("friction_compensation", count)
    _set(graph, "x.compensation.slew_limit", 0.2)
    assert graph.change("observer_node", DEACTIVATE)
    listener.check_end(count)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_no_compensation(number: int, graph: Graph, start: Start) -> None:
    """Who holds the last command, as the controllers of ros2_control do, must not hold a force."""
    listener = Listener(graph)
    node = start("observer_node", PATIENT)
    count = listener.send_samples()
    graph.wait_messages("friction_compensation", count)
    _set(graph, "x.compensation.slew_limit", 0.2)
    assert node.stop(number) == 0
    listener.check_end(count)
    assert "Traceback" not in node.text()


def test_a_fault_of_the_node_leaves_no_compensation(graph: Graph, tmp_path: Path) -> None:
    listener = Listener(graph)
    (tmp_path / "axis.yaml").write_text(PATIENT)
    node = NodeProcess("observer_node", tmp_path, "--config", str(tmp_path / "axis.yaml"), module="failing_node")
    try:
        node.wait_active()
        listener.send_samples()
        wait_until(lambda: node.process.poll() is not None or listener.send_one(), "the end of the node")
        assert node.wait_end() == 1
    finally:
        node.process.kill()
        node.process.wait()
    wait_until(lambda: _last_compensation(graph) == 0.0, "zero at the end")
    wait_until(lambda: listener.commands[-1] == 0.0, "zero at the end of the commands")
    assert max(abs(command) for command in listener.commands) > 0.1
    (said,) = [line for line in node.text().splitlines() if "Internal error" in line]
    assert "ZeroDivisionError: a fault made for a test" in said and "Traceback" not in node.text()
