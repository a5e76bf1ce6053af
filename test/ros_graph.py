"""The real ROS graph for tests: node processes that are started and stopped, and a node of the test's own."""

from __future__ import annotations

import signal
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from program import PATIENCE, start_program
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.bags.cdr import JointStateDecoder, JointStateEncoder
from sgms_observer.bags.diagnostics_cdr import decode_diagnostics
from sgms_observer.nodes.conductor import RepeatedRequest
from sgms_observer.nodes.topics import SAMPLE_QOS

ONE_AXIS = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 3.0
      stage: {friction: {model: gms}, encoder: {noise: 1.0e-9}, force_noise: 0.01}
      filter: {window: 8.0e-3}
      estimator: {kind: mhe, correction_every: 2, parameters: [kappa]}
"""
TWO_AXES = """/**:
  ros__parameters:
    axes: [x, "y"]
    sample_period: 1.0e-3
    x: {mass: 3.0, estimator: {kind: ekf}}
    "y": {mass: 2.0, estimator: {kind: ekf}, friction: {coulomb_force: 3.0, static_force: 3.5}}
"""

SPARE = "use_sim_time"
"""A parameter of every node that takes any value at any time."""

CONFIGURE, ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
DEACTIVATE, CLEAN_UP = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP
GOALS = {CONFIGURE: "inactive", ACTIVATE: "active", DEACTIVATE: "inactive", CLEAN_UP: "unconfigured"}
ASK_AGAIN = 10.0  # s

decode_joint_state = JointStateDecoder().decode


def wait_until(condition: Callable[[], Any], what: str, patience: float = PATIENCE) -> Any:
    """Return what ``condition`` gives once it is true.

    Args:
        condition: asked again and again.
        what: for the failure.
        patience: how long to ask [s].
    """
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if value := condition():
            return value
        time.sleep(0.02)
    raise AssertionError(f"waited {patience:g} s for {what}")


class NodeProcess:
    """One of the package's nodes in a process of its own.

    Args:
        name: ``stage_node`` or ``observer_node``.
        folder: where its output goes.
        arguments: its command line.
        module: what is run, if not the node's own module.
    """

    def __init__(self, name: str, folder: Path, *arguments: str, module: str = "") -> None:
        self.name = name
        self.output = folder / f"{name}.{time.monotonic_ns()}.log"
        with self.output.open("w") as file:
            self.process = start_program(
                module or f"sgms_observer.nodes.{name}", arguments, folder, stdout=file, stderr=subprocess.STDOUT
            )

    def text(self) -> str:
        """Return everything the node said."""
        return self.output.read_text()

    def wait_active(self) -> None:
        """Wait until the node is active."""
        wait_until(
            lambda: "active: axes" in self.text() or self.process.poll() is not None, f"{self.name} to be active"
        )
        assert self.process.poll() is None, self.text()

    def wait_end(self) -> int:
        """Return the exit code once the process ended by itself."""
        return self.process.wait(PATIENCE)

    def stop(self, number: int = signal.SIGINT) -> int:
        """Send a signal and return the exit code."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        try:
            return self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise AssertionError(f"{self.name} did not end after signal {number}: {self.text()}") from None


Start = Callable[..., NodeProcess]


class Graph:
    """A node of the test's own: it listens, publishes and calls while a thread spins it."""

    def __init__(self) -> None:
        self.node: Node = rclpy.create_node("test_graph")
        self.messages: dict[str, list[bytes]] = {}
        self._executor = EventsExecutor()
        self._executor.add_node(self.node)
        self._must_stop = False
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        never: Future = Future()
        while not self._must_stop and rclpy.ok():
            self._executor.spin_until_future_complete(never, timeout_sec=0.05)

    def close(self) -> None:
        """Leave the graph."""
        self._must_stop = True
        self._thread.join()
        self.node.destroy_node()

    def listen(self, *topics: str) -> None:
        """Keep the bytes of every message of these topics, in ``messages``."""
        for topic in topics:
            kind: Any = DiagnosticArray if topic in ("/diagnostics", "friction_parameters") else JointState
            kind = JointTrajectory if topic.endswith("_horizon") else kind
            kept = self.messages.setdefault(topic, [])
            self.node.create_subscription(kind, topic, kept.append, SAMPLE_QOS, raw=True)

    def wait_messages(self, topic: str, count: int) -> list[bytes]:
        """Return a topic's messages once there are so many."""
        return wait_until(
            lambda: self.messages[topic] if len(self.messages[topic]) >= count else None, f"{count} messages of {topic}"
        )

    def publisher(self, topic: str, kind: type = JointState, qos: QoSProfile = SAMPLE_QOS) -> Callable[[bytes], None]:
        """Return a function that publishes bytes, once somebody subscribes."""
        publisher = self.node.create_publisher(kind, topic, qos)
        wait_until(lambda: publisher.get_subscription_count() > 0, f"a subscriber of {topic}")
        return publisher.publish

    def meet(self, node: str) -> None:
        """Wait until a node's publishers serve every topic that is listened to here.

        A node learns of our subscriptions one after the other, in the order in which they were made. So it knows all
        of them when it serves the one that is made last: it hears of the node's parameters, and one of these is set to
        what it is until that is heard.
        """
        heard: list[ParameterEvent] = []
        last = self.node.create_subscription(ParameterEvent, "/parameter_events", heard.append, 100)
        (value,) = self.call(GetParameters, f"/{node}/get_parameters", GetParameters.Request(names=[SPARE])).values
        same = SetParameters.Request(parameters=[ParameterMessage(name=SPARE, value=value)])

        def is_served() -> bool:
            assert self.call(SetParameters, f"/{node}/set_parameters", same).results[0].successful
            return any(event.node == f"/{node}" for event in heard)

        wait_until(is_served, f"{node} to serve what is listened to")
        self.node.destroy_subscription(last)

    def call(self, kind: Any, name: str, request: Any) -> Any:
        """Call a service and return its answer; ask again where none comes."""
        client = self.node.create_client(kind, name)
        wait_until(client.service_is_ready, f"the service {name}")
        answer = wait_until(RepeatedRequest(client, request, ASK_AGAIN).answer, f"the answer of {name}")
        self.node.destroy_client(client)
        return answer

    def state(self, node: str) -> str:
        """Return a lifecycle node's state."""
        return self.call(GetState, f"/{node}/get_state", GetState.Request()).current_state.label

    def change(self, node: str, transition: int) -> bool:
        """Ask for a transition; return whether it succeeded. Asked twice, a node refuses what it has done already."""
        request = ChangeState.Request(transition=Transition(id=transition))
        begun = time.monotonic()
        is_done = self.call(ChangeState, f"/{node}/change_state", request).success
        was_asked_again = time.monotonic() - begun > ASK_AGAIN
        return is_done or (was_asked_again and self.state(node) == GOALS[transition])

    def axis_diagnostics(self, axis: str) -> dict[str, str]:
        """Return the latest diagnostics of an axis: its values, and ``message``."""
        for message in reversed(self.messages["/diagnostics"]):
            for entry in decode_diagnostics(message)[1]:
                if entry.hardware_id == axis:
                    return {**dict(entry.values), "message": entry.message}
        return {}


class Sender:
    """Publishes samples of made-up axes to an observer.

    Args:
        graph: publishes them.
        axes: names.
        single: one topic for position and effort.
        node: the observer, with its namespace if it has one.
    """

    def __init__(self, graph: Graph, axes: Sequence[str], single: str = "", node: str = "observer_node") -> None:
        self._single = single
        if single:
            self._both = graph.publisher(single)
            self._both_encoder = JointStateEncoder(axes, ("position", "velocity", "effort"))
        else:
            self._position, self._effort = graph.publisher("position"), graph.publisher("control_effort")
            self._position_encoder = JointStateEncoder(axes, ("position",))
            self._effort_encoder = JointStateEncoder(axes, ("effort",))
        graph.meet(node)

    def send(self, stamp_ns: int, position: Sequence[float], effort: Sequence[float]) -> None:
        """Publish one sample of all axes."""
        if self._single:
            self._both(self._both_encoder.encode(stamp_ns, position, [0.0] * len(position), effort))
        else:
            self._position(self._position_encoder.encode(stamp_ns, position))
            self._effort(self._effort_encoder.encode(stamp_ns, effort))

    def send_paced(
        self,
        rate: float,
        stamps: Sequence[int],
        position: Sequence[Sequence[float]],
        effort: Sequence[Sequence[float]],
        answers: Sequence[bytes] | None = None,
    ) -> None:
        """Publish samples at a rate [Hz] by the clock; a late turn sends all that is due.

        With ``answers``, which grow by one for each sample, no more samples are on their way than half a queue holds: a
        machine that is too slow for the rate takes its time.
        """
        start = time.monotonic()
        sent = 0
        while sent < len(stamps):
            due = min(len(stamps), int((time.monotonic() - start) * rate) + 1)
            if answers is not None:
                due = max(sent, min(due, len(answers) + SAMPLE_QOS.depth // 2))
            for i in range(sent, due):
                self.send(stamps[i], position[i], effort[i])
            sent = due
            time.sleep(5.0e-4)
