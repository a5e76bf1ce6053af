"""Starts, spins and ends the process of a node, in the same way for all nodes, also after SIGINT and SIGTERM."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from sgms_observer.errors import SgmsError
from sgms_observer.interrupts import ignore_signals, is_told, note_signals, silent_interrupts
from sgms_observer.nodes.transport import prepare_transport
from sgms_observer.outcome import EXIT_FAILED, SHOW_TRACEBACK

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node

    from sgms_observer.nodes.lifecycle import ManagedNode

#: ``EventsExecutor`` hangs after one event when it spins without an end; with a time-out it works [s]. Signals are seen
#: in between.
_SPIN_AT_ONCE = 0.1
_LONG = 3600.0  # s

MISSING_ROS = (
    "ROS 2 is not importable (no module rclpy): source your ROS 2 installation, "
    "or install its wheels with: pip install 'sgms_observer[ros]'"
)


def make_executor() -> Executor:
    """Return the executor that is fast enough for 10 kHz; on an rclpy without it the default one."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        from rclpy.executors import SingleThreadedExecutor

        print("this rclpy has no EventsExecutor: above 2 kHz samples will be lost; update ROS 2", file=sys.stderr)
        return SingleThreadedExecutor()
    return EventsExecutor()


def run_node(make_node: Callable[[Executor], ManagedNode], argv: Sequence[str]) -> int:
    """Run a node until a signal or a shutdown.

    Args:
        make_node: makes the node; the executor is the one that will spin it.
        argv: arguments of the process for rclpy.

    Returns:
        The exit code: 0 after SIGINT, SIGTERM or a shutdown of ROS; 1 after an error, which is printed.
    """
    with silent_interrupts():
        import rclpy
        from rclpy.executors import ExternalShutdownException
        from rclpy.signals import SignalHandlerOptions
        from rclpy.task import Future

    executor = node = None
    try:
        prepare_transport()
        note_signals()
        rclpy.init(args=list(argv), signal_handler_options=SignalHandlerOptions.NO)
        if is_told():
            return 0
        executor = make_executor()
        node = make_node(executor)
        executor.add_node(node)
        never: Future = Future()
        is_started = False
        while rclpy.ok() and not is_told() and node.fault is None:
            if not is_started and node.prepare():
                is_started = True
                node.start_by_itself()
            executor.spin_until_future_complete(never, timeout_sec=_SPIN_AT_ONCE)
    except ExternalShutdownException:
        pass
    except Exception as error:
        if executor is not None and (is_told() or not rclpy.ok()):
            return 0  # stopped during its start: no error
        if isinstance(error, SgmsError):
            return fail(str(error))
        if os.environ.get(SHOW_TRACEBACK):
            raise
        return fail(_own_fault(error))
    finally:
        ignore_signals()
        leave_graph(executor, node)
    return 0 if node is None or node.fault is None else fail(_own_fault(node.fault))


def spin_until_interrupted(node: Node) -> None:
    """Spin a node that works in its callbacks only, until SIGINT, SIGTERM or a shutdown of ROS; then destroy it.

    Args:
        node: any node.
    """
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.task import Future

    executor = make_executor()
    executor.add_node(node)
    never: Future = Future()
    try:
        while rclpy.ok():
            executor.spin_until_future_complete(never, timeout_sec=_LONG)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        leave_graph(executor, node)


def leave_graph(executor: Executor | None, node: Node | None) -> None:
    """End a node and this process's ROS.

    The node is removed from the executor first. Otherwise messages that arrive while its subscriptions are destroyed
    would call a destroyed object.

    Args:
        executor: of the node; None if it was not made yet.
        node: None if it was not made yet.
    """
    import rclpy

    if executor is not None:
        if node is not None:
            executor.remove_node(node)
        executor.shutdown()
    if node is not None:
        node.destroy_node()
    rclpy.try_shutdown()


def fail(sentences: str) -> int:
    """Print what is wrong and return the exit code for it.

    Args:
        sentences: what is wrong.
    """
    print(sentences, file=sys.stderr)
    return EXIT_FAILED


def _own_fault(error: Exception) -> str:
    """Return the sentence about an error that the input did not cause."""
    text = " ".join(str(error).split())
    if "rcl" in type(error).__name__.lower() or "arguments" in type(error).__name__.lower():
        return f"ROS 2 refused to start the node: {text}"
    return f"Internal error in the node, {type(error).__name__}: {text}; set {SHOW_TRACEBACK}=1 to see where"
