"""Runs the package's nodes as processes and controls them over the graph, for ``sgms demo``, ``sgms bench`` and
``sgms commission``."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import SetParameters
from rclpy.client import Client
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from rclpy.time import Time

from sgms_observer.child_process import child_command, child_environment
from sgms_observer.errors import DataError
from sgms_observer.nodes.transport import claim_domain, prepare_transport

_PATIENCE = 180.0  # s; a first start compiles every kernel
_NO_ROOM = 100_000  # bytes; with fewer, not even a log can be written
_END = 60.0  # s that a process has to end after a signal
_ASK_AGAIN = 5.0  # s
_GOALS = {
    Transition.TRANSITION_CONFIGURE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_ACTIVATE: State.PRIMARY_STATE_ACTIVE,
    Transition.TRANSITION_DEACTIVATE: State.PRIMARY_STATE_INACTIVE,
}
_LONGEST_PROCESSING = 60.0  # s
_SENT_AGAIN = 3.5  # s; Fast DDS looks for lost messages every 3 s where no others follow
_MATCHING = 2.0  # s from the discovery of a subscription until it gets messages


def prepare_graph() -> int:
    """Use this machine only and an unused domain, unless the user chose others. Before ROS starts.

    Returns:
        ROS_DOMAIN_ID.
    """
    if not any(name in os.environ for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_LOCALHOST_ONLY")):
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    if "ROS_DOMAIN_ID" not in os.environ:
        os.environ["ROS_DOMAIN_ID"] = str(claim_domain())
    prepare_transport()
    return int(os.environ["ROS_DOMAIN_ID"])


class RepeatedRequest:
    """A request that may be repeated.

    rmw_fastrtps drops an answer if the server has not discovered the reader of the client within 0.1 s.

    Args:
        client: of the service; its node is spun elsewhere.
        request: the request; the service must allow it twice.
        again: time after which the request is sent again [s].
    """

    def __init__(self, client: Client, request: Any, again: float) -> None:
        self._client = client
        self._request = request
        self._futures: list[Future] = []
        self._again = again
        self._ask_at = 0.0

    def answer(self) -> Any | None:
        """Send the request if it is due; return the answer, or None while there is none."""
        if time.monotonic() >= self._ask_at:
            self._futures.append(self._client.call_async(self._request))
            self._ask_at = time.monotonic() + self._again
        return next((future.result() for future in self._futures if future.done()), None)


class Conductor:
    """A context in which processes run; all of them end with it, or with this process if it is killed.

    Args:
        folder: folder of the output of the processes, one file each.

    Raises:
        DataError: a process ended or did not answer; one sentence with its last line.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._processes: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Conductor:
        """Join the graph."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._is_first = not rclpy.ok()
        if self._is_first:
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._node = rclpy.create_node("sgms_conductor")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End every process that still runs, and leave the graph."""
        for process in self._processes.values():
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        for process in self._processes.values():
            try:
                process.wait(_END)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._node.destroy_node()
        if self._is_first:
            rclpy.try_shutdown()

    def start(self, name: str, module: str, arguments: Sequence[str]) -> None:
        """Start a module of this package as a process.

        Args:
            name: name of the process here.
            module: full name, run with ``python -m``.
            arguments: its command line.
        """
        with (self._folder / f"{name}.log").open("wb") as log:
            self._processes[name] = subprocess.Popen(
                child_command(module, arguments),
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is sent to this process only, which then ends the others in order
                env=child_environment(),
            )

    def process_id(self, name: str) -> int:
        """Return a process's number.

        Args:
            name: as given to ``start``.
        """
        return self._processes[name].pid

    def output_of(self, name: str) -> str:
        """Return the output of a process.

        Args:
            name: as given to ``start``.
        """
        return (self._folder / f"{name}.log").read_text(errors="replace")

    def stop(self, name: str) -> None:
        """End a process with SIGINT; raise if its exit code is not 0.

        Args:
            name: as given to ``start``.
        """
        process = self._processes.pop(name)
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            code = process.wait(_END)
        except subprocess.TimeoutExpired:
            process.kill()
            raise DataError(f"{name} did not end within {_END:g} s of SIGINT; see {self._folder / name}.log") from None
        if code != 0:
            raise self._ended(name, code)

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Wait until a condition holds, while all processes run.

        Args:
            condition: evaluated again and again.
            what: name of the condition, for the sentence after a time-out.
        """
        end = time.monotonic() + _PATIENCE
        while not condition():
            self.watch()
            if time.monotonic() > end:
                raise DataError(f"waited {_PATIENCE:g} s for {what}; see the logs in {self._folder}")
            time.sleep(0.05)

    def watch(self) -> None:
        """Raise if a process ended."""
        for name, process in self._processes.items():
            code = process.poll()
            if code is not None:
                raise self._ended(name, code)

    def wait_subscribers(self, topics: Mapping[str, int]) -> None:
        """Wait until topics have subscribers.

        Args:
            topics: topic to the least number of subscribers.
        """
        for topic, count in topics.items():
            self.wait(lambda t=topic, n=count: self._node.count_subscribers(t) >= n, f"{count} subscribers of {topic}")  # type: ignore[misc]
        time.sleep(_MATCHING)

    def wait_active(self, node: str) -> None:
        """Wait until a lifecycle node is active.

        Args:
            node: its name.
        """
        self.wait(lambda: self._state(node) == State.PRIMARY_STATE_ACTIVE, f"{node} to become active")

    def activate(self, node: str) -> None:
        """Configure (if need be) and activate a lifecycle node.

        Args:
            node: its name.
        """
        if self._state(node) == State.PRIMARY_STATE_UNCONFIGURED:
            self._change(node, Transition.TRANSITION_CONFIGURE)
        self._change(node, Transition.TRANSITION_ACTIVATE)

    def configure(self, node: str) -> None:
        """Configure a lifecycle node.

        Args:
            node: its name.
        """
        self._change(node, Transition.TRANSITION_CONFIGURE)

    def deactivate(self, node: str) -> None:
        """Deactivate a lifecycle node.

        Args:
            node: its name.
        """
        self._change(node, Transition.TRANSITION_DEACTIVATE)

    def wait_processed(self, node: str) -> None:
        """Wait, after an observer's inputs have ended, until it has processed all their messages; 60 s at most.

        On a busy machine the observer may be seconds behind. It has processed all messages when the count of messages
        in its diagnostics stays the same for longer than the middleware takes to send a lost message again.

        Args:
            node: its name.
        """
        same: list[tuple[int, str]] = []  # times [ns] of the latest reports that count the same, and their count

        def take(report: DiagnosticArray) -> None:
            values = [value for status in report.status if status.name == node for value in status.values]
            count = next((value.value for value in values if value.key == "messages"), None)
            if count is None:
                return
            if same and count != same[0][1]:
                same.clear()
            same.append((Time.from_msg(report.header.stamp).nanoseconds, count))

        subscription = self._node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)
        end = time.monotonic() + _LONGEST_PROCESSING
        while time.monotonic() < end and (not same or same[-1][0] - same[0][0] < _SENT_AGAIN * 1e9):
            self.watch()
            rclpy.spin_once(self._node, timeout_sec=0.2)
        self._node.destroy_subscription(subscription)

    def set_parameter(self, node: str, name: str, value: Any) -> None:
        """Set a parameter of a running node.

        Args:
            node: its name.
            name: full name of the parameter.
            value: the new value.
        """
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        result = self._call(SetParameters, f"/{node}/set_parameters", request).results[0]
        if not result.successful:
            raise DataError(f"{node} refused {name} = {value}: {result.reason}")

    def _state(self, node: str) -> int:
        return int(self._call(GetState, f"/{node}/get_state", GetState.Request()).current_state.id)

    def _change(self, node: str, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        is_done = self._call(ChangeState, f"/{node}/change_state", request).success
        if not is_done and self._state(node) != _GOALS[transition]:  # a repeated request is refused
            raise DataError(f"{node} refused a transition; see {self._folder}/{node}.log")

    def _call(self, kind: Any, service: str, request: Any) -> Any:
        """Call a service, repeat the call if no answer comes, and return the answer."""
        client = self._node.create_client(kind, service)
        repeated = RepeatedRequest(client, request, _ASK_AGAIN)
        try:
            self.wait(client.service_is_ready, f"the service {service}")

            def is_answered() -> bool:
                is_there = repeated.answer() is not None
                if not is_there:
                    rclpy.spin_once(self._node, timeout_sec=0.2)
                return is_there

            self.wait(is_answered, f"the answer of {service}")
            return repeated.answer()
        finally:
            self._node.destroy_client(client)

    def _ended(self, name: str, code: int) -> DataError:
        """Return the sentence about a process that ended too early."""
        lines = [line for line in self.output_of(name).splitlines() if line.strip()]
        last = lines[-1] if lines else "it printed nothing"
        if not lines and shutil.disk_usage(self._folder).free < _NO_ROOM:
            last = f"the disk of {self._folder} is full; make room or choose another folder"
        return DataError(f"{name} ended with exit code {code}: {last}")
