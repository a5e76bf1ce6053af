"""``sgms record``: topics of the live graph into a bag."""

from __future__ import annotations

import argparse
import os
import time
from contextlib import suppress
from typing import TYPE_CHECKING

from sgms_observer.cli.options import (
    add_output_options,
    add_overwrite_option,
    add_storage_option,
    refuse_other_names,
    require_ros,
)
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import Outcome

if TYPE_CHECKING:
    from rclpy.executors import Executor

    from sgms_observer.bags.writer import BagWriter
    from sgms_observer.nodes.recording import RecorderNode

HELP = "record topics of the live graph into a bag, where `ros2 bag` is not installed"

_SPIN_AT_ONCE = 0.1  # s; signals are seen in between
_LONGEST_DRAIN = 1.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument(
        "topics", metavar="TOPIC", nargs="*", help="topics to record (default: all inputs and outputs of the observer)"
    )
    parser.add_argument("--out", required=True, metavar="BAG", help="folder of the new bag; BAG.partial while it grows")
    parser.add_argument(
        "--duration", type=float, metavar="S", help="stop after this time [s] (default: at Ctrl-C or SIGTERM)"
    )
    add_storage_option(parser)
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    require_ros()
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.signals import SignalHandlerOptions

    from sgms_observer.bags.writer import BagWriter
    from sgms_observer.errors import RecordingError
    from sgms_observer.interrupts import ignore_signals, listed_signals
    from sgms_observer.nodes.recording import RecorderNode
    from sgms_observer.nodes.spin import leave_graph, make_executor
    from sgms_observer.nodes.transport import prepare_transport

    if args.duration is not None and not 0.0 < args.duration < float("inf"):
        raise RecordingError(
            f"--duration {args.duration:g} s must be a positive number; leave it out to record until Ctrl-C"
        )
    for topic in args.topics:
        refuse_other_names(topic, topic)
    writer = BagWriter(args.out, args.storage, keep_on_failure=True, is_overwriting=args.overwrite)
    executor = node = None
    stop = listed_signals()
    prepare_transport()
    _let_others_first()
    try:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        executor = make_executor()
        node = RecorderNode(writer, args.topics)
        executor.add_node(node)
        print(f"recording into {args.out}; stop with Ctrl-C", flush=True)
        end = time.monotonic() + (args.duration if args.duration is not None else float("inf"))
        while not stop and not node.done.done() and (left := end - time.monotonic()) > 0.0:
            executor.spin_until_future_complete(node.done, timeout_sec=min(left, _SPIN_AT_ONCE))
        _drain(executor, node, writer)
    except ExternalShutdownException:
        pass
    except BaseException:
        writer.abort()
        raise
    finally:
        ignore_signals()
        fault = node.fault if node is not None else None
        leave_graph(executor, node)
    if fault is not None:
        writer.abort()
        raise fault
    counts = writer.counts
    if not counts:
        writer.discard()
        raise RecordingError(
            "no message arrived, so no bag was written; check that the publishers run, the topics' names and"
            " ROS_DOMAIN_ID"
        )
    writer.close()
    warn(writer.warnings)
    for topic, count in counts.items():
        print(f"{topic}: {count} messages")
    return Outcome(
        result={"schema": 1, "bag": args.out, "messages": dict(counts), "warnings": [*map(str, writer.warnings)]}
    )


def _let_others_first() -> None:
    """Have this process interrupt no other one for a message that arrives, nor its threads, which start later.

    Its share of the processor stays the same. Messages wait until it is its turn and are taken together: one by one,
    each would cost the nodes on the same cores a change of process.
    """
    if hasattr(os, "SCHED_BATCH"):
        with suppress(OSError):
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def _drain(executor: Executor, node: RecorderNode, writer: BagWriter) -> None:
    """Write the messages that had arrived before the stop, for a second at most."""
    end = time.monotonic() + _LONGEST_DRAIN
    before, count = -1, sum(writer.counts.values())
    while count != before and not node.done.done() and time.monotonic() < end:
        executor.spin_until_future_complete(node.done, timeout_sec=_SPIN_AT_ONCE)
        before, count = count, sum(writer.counts.values())
