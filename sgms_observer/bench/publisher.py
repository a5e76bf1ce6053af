"""A process that publishes position and effort of axes at a rate, and notes when each sample went out.

Between two samples it sleeps: it shall not take the core that is measured.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import signal
import sys
import time
from pathlib import Path

import numpy as np
import rclpy
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bench.problem import AMPLITUDE, FREQUENCY, PERIOD, make_problem
from sgms_observer.bench.process import axis_names
from sgms_observer.nodes.topics import SAMPLE_QOS
from sgms_observer.nodes.transport import prepare_transport

_LONGEST_STAY = 60.0  # s
_SETTLING = 2.0  # s of silence before the run, in which discovery ends
_PROBE_PERIOD = 0.1  # s from one probe sample to the next
_TIMER_SLACK = 1_000  # ns that Linux may wake this thread late to save power; 50 us unless asked
_SET_TIMER_SLACK = 29  # PR_SET_TIMERSLACK


def publish(count: int, rate: int, axes: int, listeners: int, out: Path, go: Path | None = None) -> None:
    """Publish so many samples and write their stamps and sending times [ns], shape (2, count), to a file.

    With ``go``, the publisher sends probe samples until another process has made this file. They are not counted. That
    process sees from them that samples and answers arrive.

    Args:
        count: number of samples.
        rate: samples per second [Hz].
        axes: how many there are in each message.
        listeners: how many nodes are waited for.
        out: the file (.npy).
        go: the file whose existence starts the run.
    """
    samples = round(1.0 / (FREQUENCY * PERIOD))  # one period of the motion, repeated
    effort = make_problem(windows=samples // 10).effort[samples : 2 * samples].tolist()
    position = (AMPLITUDE * np.sin(2.0 * np.pi * np.arange(samples) / samples)).tolist()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job is started to ignore it
    prepare_transport()
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("bench_publisher")
    publishers = [node.create_publisher(JointState, topic, SAMPLE_QOS) for topic in ("position", "control_effort")]
    send_position, send_effort = (publisher.publish for publisher in publishers)
    encode_position = JointStateEncoder(axis_names(axes), ("position",)).encode
    encode_effort = JointStateEncoder(axis_names(axes), ("effort",)).encode

    def send(stamp: int, place: int) -> None:
        send_position(encode_position(stamp, (position[place],) * axes))
        send_effort(encode_effort(stamp, (effort[place],) * axes))

    while go is not None and not go.exists():
        send(time.time_ns(), 0)
        time.sleep(_PROBE_PERIOD)
    while any(publisher.get_subscription_count() < listeners for publisher in publishers):
        time.sleep(0.05)
    time.sleep(_SETTLING)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_SET_TIMER_SLACK, _TIMER_SLACK, 0, 0, 0)
    period_ns, step = round(1e9 / rate), max(1, round(1.0 / (PERIOD * rate)))
    times = np.zeros((2, count), np.int64)
    start = time.time_ns() + 10 * period_ns
    for k in range(count):
        due = start + k * period_ns
        left = due - time.time_ns()
        if left > 0:
            time.sleep(1e-9 * left)
        place = k * step % samples
        times[0, k], times[1, k] = due, time.time_ns()
        send(due, place)
    np.save(out, times)
    with contextlib.suppress(KeyboardInterrupt):
        time.sleep(_LONGEST_STAY)  # what is on its way arrives; the end comes as SIGINT
    node.destroy_node()
    rclpy.try_shutdown()


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, required=True)
    parser.add_argument("--rate", type=int, required=True)
    parser.add_argument("--axes", type=int, default=1)
    parser.add_argument("--listeners", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--go", type=Path)
    args = parser.parse_args()
    publish(args.count, args.rate, args.axes, args.listeners, args.out, args.go)
    return 0


if __name__ == "__main__":
    sys.exit(main())
