"""Every fault on the real graph, one after the other on the same node; and processes that die and come back."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable

from fault_streams import FAULTS, PERIOD, RATE, SECOND, Fault, Row, Sent, clean, rows
from ros_graph import ONE_AXIS, Graph, NodeProcess, Start, decode_joint_state, wait_until
from rosgraph_msgs.msg import Clock

from sgms_observer.bags.diagnostics_cdr import decode_diagnostics

LIMIT, SLEW = 3.0, 200.0
COMPENSATED = ONE_AXIS + f"      compensation: {{enabled: true, limit: {LIMIT}, slew_limit: {SLEW}, timeout: 0.05}}\n"
BEFORE, DURING, AFTER = 700, 300, 500

Publish = dict[str, Callable[[bytes], None]]


def compensations(graph: Graph, first: int) -> list[tuple[int, float]]:
    """Return stamp [ns] and force [N] of every compensation from the ``first`` on."""
    decoded = [decode_joint_state(message) for message in graph.messages["friction_compensation"][first:]]
    return [(message[0], message[4][0]) for message in decoded]


def send(publish: Publish, messages: list[Sent], seconds: float = 0.0) -> None:
    """Publish messages, spread over a time if one is given [s]."""
    start = time.monotonic()
    for i, (topic, data) in enumerate(messages):
        publish[topic](data)
        if i % 50 == 49:
            time.sleep(max(0.0, start + seconds * i / len(messages) - time.monotonic()))
    time.sleep(max(0.0, start + seconds - time.monotonic()))


def wait_stamp(graph: Graph, stamp: int, what: str) -> None:
    """Wait until the compensation for a sample came."""

    def has_come() -> bool:
        latest = graph.messages["friction_compensation"][-20:]
        return any(decode_joint_state(message)[0] == stamp for message in latest)

    wait_until(has_come, what)


def check_forces(fault: Fault, forces: list[tuple[int, float]], sent: set[int], before: float) -> None:
    """Check that every force is finite, within the limit, and no further from the one before than the slew limit."""
    previous, previous_stamp, was_sample = before, 0, True
    for stamp, force in forces:
        assert math.isfinite(force) and abs(force) <= LIMIT, fault.name
        is_sample = stamp in sent
        seconds = (stamp - previous_stamp) * 1e-9
        if not is_sample:  # the watchdog's, by its own clock
            assert abs(force) <= abs(previous) and force * previous >= 0.0, fault.name
        else:
            allowed = seconds if was_sample and 0.0 < seconds <= 0.02 else (PERIOD if was_sample else 0.02)
            assert abs(force - previous) <= SLEW * allowed * (1.0 + 1e-6), fault.name
        previous, previous_stamp, was_sample = force, stamp, is_sample


def stamps_of(messages: list[Sent]) -> set[int]:
    """Return the stamps of all messages that are positions."""
    found = set()
    for topic, data in messages:
        if topic == "position":
            try:
                found.add(decode_joint_state(data)[0])
            except Exception:
                continue  # noise
    return found


def test_every_fault_in_turn(graph: Graph, start: Start) -> None:
    graph.listen("friction_compensation", "/diagnostics")
    node = start("observer_node", COMPENSATED)
    publish = {topic: graph.publisher(topic) for topic in ("position", "control_effort", "reference")}
    graph.meet("observer_node")
    base = int(time.time()) * SECOND
    for number, fault in enumerate(FAULTS):
        during = DURING * fault.factor
        samples: list[Row] = rows(base + number * 60 * SECOND, 0, BEFORE + during + AFTER)
        parts = (
            clean(samples[:BEFORE]),
            fault.make(samples[BEFORE : BEFORE + during]),
            clean(samples[BEFORE + during :]),
        )
        seen = len(graph.messages["friction_compensation"])
        force = compensations(graph, seen - 1)[0][1] if seen else 0.0
        send(publish, parts[0])
        wait_stamp(graph, samples[BEFORE - 1].stamp, f"good samples before: {fault.name}")
        send(publish, parts[1], during / RATE if fault.is_slow else 0.0)
        if fault.is_slow and fault.ends_trust:
            wait_until(lambda: compensations(graph, -1)[0][1] == 0.0, f"no compensation while {fault.name}")
        send(publish, parts[2])
        wait_stamp(graph, samples[-1].stamp, f"good samples after: {fault.name}")
        forces = compensations(graph, seen)
        check_forces(fault, forces, set().union(*map(stamps_of, parts)), force)
        assert max(abs(force) for _, force in forces[:BEFORE]) == LIMIT, fault.name
        assert max(abs(force) for _, force in forces[-AFTER // 2 :]) > 1.0, f"no recovery after: {fault.name}"
        assert node.process.poll() is None, node.text()
    wait_until(lambda: graph.axis_diagnostics("x")["message"].startswith("no samples arrive"), "the last report")
    check_told(graph, node)
    assert node.stop() == 0
    assert "Traceback" not in node.text() and "Error" not in node.text()


def check_told(graph: Graph, node: NodeProcess) -> None:
    """Check that diagnostics counted every fault, and that a sentence told of it."""
    entries = [entry for message in graph.messages["/diagnostics"] for entry in decode_diagnostics(message)[1]]
    told = node.text() + "\n".join(entry.message for entry in entries)
    axis, whole = {}, {}
    for entry in entries:
        (axis if entry.hardware_id == "x" else whole).update(dict(entry.values))
    for fault in FAULTS:
        assert fault.sentence in told, fault.name
        values = whole if fault.counter.startswith("node:") else axis
        counter = fault.counter.removeprefix("node:")
        if counter:
            assert int(values[counter]) > 0, fault.name


def test_a_publisher_that_is_killed_and_comes_back(graph: Graph, start: Start) -> None:
    graph.listen("friction_compensation", "friction_estimate", "/diagnostics")
    observer = start("observer_node", COMPENSATED)
    for _ in range(2):
        count, seen = len(graph.messages["friction_estimate"]), len(graph.messages["friction_compensation"])
        stage = start("stage_node", ONE_AXIS)
        wait_until(
            lambda first=seen: any(abs(force) > 1.0 for _, force in compensations(graph, first)), "a compensation"
        )
        graph.wait_messages("friction_estimate", count + 300)
        stage.process.send_signal(signal.SIGKILL)
        stage.process.wait()
        wait_until(lambda: compensations(graph, -1)[0][1] == 0.0, "no compensation without samples")
    assert all(abs(force) <= LIMIT for _, force in compensations(graph, 0))
    assert observer.stop() == 0, observer.text()
    assert "Traceback" not in observer.text()


def test_a_simulated_clock_that_starts_again(graph: Graph, start: Start) -> None:
    """With use_sim_time stage and observer live by ``/clock``; both go on after it was set back."""
    graph.listen("friction_compensation", "friction_estimate", "/diagnostics")
    simulated = ("--ros-args", "-p", "use_sim_time:=true")
    patient = COMPENSATED.replace("timeout: 0.05", "timeout: 0.5")  # samples come in bursts, whenever this test turns
    processes = start("observer_node", patient, *simulated), start("stage_node", ONE_AXIS, *simulated)
    clock = graph.node.create_publisher(Clock, "/clock", 10)
    wait_until(lambda: clock.get_subscription_count() == 2, "both nodes to hear the clock")
    for origin in (1000, 5):
        latest = origin * SECOND

        def has_run(first: int = latest) -> bool:
            nonlocal latest
            latest += SECOND // 200
            message = Clock()
            message.clock.sec, message.clock.nanosec = divmod(latest, SECOND)
            clock.publish(message)
            stamps = [decode_joint_state(data)[0] for data in graph.messages["friction_estimate"][-1:]]
            if not stamps or not first + SECOND < stamps[0] < first + 500 * SECOND:
                return False
            return any(stamp > first and abs(force) > 1.0 for stamp, force in compensations(graph, -200))

        wait_until(has_run, f"a second of samples and a compensation after the clock read {origin} s")
    forces = compensations(graph, 0)
    assert all(math.isfinite(force) and abs(force) <= LIMIT for _, force in forces)
    told = wait_until(lambda: int(graph.axis_diagnostics("x").get("clock resets", "0")), "the count of resets")
    assert told == 1
    wait_until(lambda: "jumped back by more than a second" in processes[0].text(), "the sentence about the clock")
    for process in processes:
        assert process.stop() == 0 and "Traceback" not in process.text()
