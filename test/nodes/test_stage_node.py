"""The simulated stage on the graph, alone and with the observer."""

from __future__ import annotations

import time

import numpy as np
import pytest
from ros_graph import ONE_AXIS, TWO_AXES, Graph, Start, decode_joint_state, wait_until
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.trajectory_cdr import encode_trajectory
from sgms_observer.nodes.pace import MAX_CATCH_UP
from sgms_observer.nodes.topics import HORIZON_QOS, SAMPLE_QOS
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.settings.yaml_text import parse
from sim_plant.table import SimulatedTable

MILLISECOND = 1_000_000


@pytest.mark.parametrize("gather_time", [0.0, 5.0e-2])
def test_samples_are_the_simulation_whatever_the_timer_does(gather_time: float, graph: Graph, start: Start) -> None:
    topics = ("position", "control_effort", "reference", "friction_true")
    graph.listen(*topics)
    arrivals: list[float] = []
    graph.node.create_subscription(
        JointState, "position", lambda _: arrivals.append(time.monotonic()), SAMPLE_QOS, raw=True
    )
    start("stage_node", TWO_AXES.replace("    x: ", f"    gather_time: {gather_time}\n    x: ", 1))
    decoded = {topic: [decode_joint_state(data) for data in list(graph.wait_messages(topic, 1000))] for topic in topics}
    stamps = [message[0] for message in decoded["position"]]
    steps = np.diff(stamps)
    assert steps[steps != MILLISECOND].min(initial=MAX_CATCH_UP * 1e9) >= MAX_CATCH_UP * 1e9
    assert all(message[1] == ("x", "y") for messages in decoded.values() for message in messages)
    truth = SimulatedTable(settings_from_tree(parse(TWO_AXES, "the test")))
    records = truth.step(20_000)
    measured = np.stack([record.measured_position for record in records], axis=1)
    position = np.array([message[2] for message in decoded["position"]])
    candidates = np.flatnonzero((measured == position[0]).all(axis=1))  # a sine comes by the same place again
    places = [int(at) for at in candidates if np.array_equal(position, measured[at : at + len(position)])]
    assert len(places) == 1
    first = places[0]
    efforts = {message[0]: message[4] for message in decoded["control_effort"]}
    row = stamps[500]
    assert efforts[row] == tuple(record.control_effort[first + 500] for record in records)
    if gather_time:  # fifty come at once, then none for a while
        pauses = np.count_nonzero(np.diff(arrivals[:1000]) > 0.3 * gather_time)
        assert pauses > 0.5 * (arrivals[999] - arrivals[0]) / gather_time


def test_compensation_is_taken_in_and_times_out(graph: Graph, start: Start) -> None:
    graph.listen("friction_true", "control_effort")
    still = "reference: {kind: sine, amplitude: 0.0}, controller: {bandwidth: 0.01}"
    start("stage_node", ONE_AXIS.replace("friction: {model: gms}", f"friction: {{model: gms}}, {still}"))
    publish = graph.publisher("friction_compensation")
    encoder = JointStateEncoder(["x"], ("effort",))

    def effort() -> float:
        return float(np.mean([decode_joint_state(data)[4][0] for data in graph.messages["control_effort"][-20:]]))

    graph.wait_messages("control_effort", 100)
    assert abs(effort()) < 0.1
    wait_until(lambda: publish(encoder.encode(1, [2.0])) or effort() > 1.0, "the compensation in the effort")
    wait_until(lambda: abs(effort()) < 0.1, "the compensation to time out")


def test_a_horizon_is_applied_while_messages_are_late(graph: Graph, start: Start) -> None:
    """The observer's values of the time to come bridge what single values, each later than the timeout, do not."""
    graph.listen("control_effort")
    still = "reference: {kind: sine, amplitude: 0.0}, controller: {bandwidth: 0.01}"
    start("stage_node", ONE_AXIS.replace("friction: {model: gms}", f"friction: {{model: gms}}, {still}"))
    single = graph.publisher("friction_compensation")
    ahead = graph.publisher("compensation_horizon", JointTrajectory, HORIZON_QOS)
    graph.meet("stage_node")
    encoder = JointStateEncoder(["x"], ("effort",))
    efforts: dict[int, float] = {}

    def latest() -> int:
        for data in graph.messages["control_effort"][len(efforts) :]:
            stamp, *_, effort = decode_joint_state(data)
            efforts[stamp] = effort[0]
        return max(efforts)

    graph.wait_messages("control_effort", 100)
    begin = latest() + 300 * MILLISECOND
    times = begin + MILLISECOND * np.arange(0, 1001, 5)
    forces = np.linspace(1.0, 2.0, len(times))
    ahead(encode_trajectory(int(times[0]), ("x",), times, {"effort": forces[:, None]}))

    def is_over() -> bool:
        single(encoder.encode(latest() - 500 * MILLISECOND, [-3.0]))
        return latest() > times[-1] + 300 * MILLISECOND

    wait_until(is_over, "the end of the horizon")
    inside = np.array([stamp for stamp in efforts if times[0] <= stamp < times[-1] - 2 * MILLISECOND])
    found = np.array([efforts[stamp] for stamp in inside.tolist()])
    assert len(inside) > 500
    assert np.abs(found - np.interp(inside, times, forces)).max() < 0.1
    assert all(abs(effort) < 0.1 for stamp, effort in efforts.items() if stamp > times[-1] + 50 * MILLISECOND)


def test_stage_and_observer_together(graph: Graph, start: Start) -> None:
    graph.listen("friction_true", "friction_estimate")
    start("observer_node", ONE_AXIS)
    start("stage_node", ONE_AXIS)
    graph.wait_messages("friction_estimate", 3000)
    pairs = wait_until(lambda: (found := _settled_pairs(graph)) and len(found) > 1500 and found, "settled estimates")
    estimate, truth = np.array(pairs).T
    assert np.sqrt(np.mean((estimate - truth) ** 2)) < 0.1 * np.ptp(truth)


def _settled_pairs(graph: Graph) -> list[tuple[float, float]]:
    """Return estimated and true friction [N] of the samples that have a thousand others in one piece before them.

    A machine that is kept waiting for long leaves samples out; the observer then starts anew.
    """
    truth = {stamp: effort[0] for stamp, *_, effort in map(decode_joint_state, list(graph.messages["friction_true"]))}
    estimates = [decode_joint_state(data) for data in list(graph.messages["friction_estimate"])]
    gaps = np.diff([estimate[0] for estimate in estimates]) > 2 * MILLISECOND
    settling = {k for i in [0, *np.flatnonzero(gaps) + 1] for k in range(i, i + 1000)}
    return [
        (effort[0], truth[stamp])
        for k, (stamp, *_, effort) in enumerate(estimates)
        if stamp in truth and k not in settling
    ]
