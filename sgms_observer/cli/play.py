"""``sgms play``: publish the messages of a bag at the pace of the recording."""

from __future__ import annotations

import argparse
import queue
import threading
import time
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import TYPE_CHECKING, Any

from sgms_observer.cli.options import add_output_options, add_topic_option, require_ros, topics_from
from sgms_observer.cli.warn import warn
from sgms_observer.outcome import Outcome

if TYPE_CHECKING:
    from rclpy.node import Node

    from sgms_observer.bags.source import BagReader
    from sgms_observer.cli.progress import Progress

HELP = "play a bag into the live graph where `ros2 bag` is not installed; moves a machine that follows reference"

_DEPTH = 10_000  # messages, a second at 10 kHz
_ACK_TIME = 2.0  # s for the last messages to arrive
_SETTLING = 0.5  # s without a new subscriber; discovery finds the other topics of a node within this time
_SHORT = 0.002  # s; before a message, a pause as short as this one sleeps to its end
_LONGEST = 0.05  # s without a look whether the command is stopped

Due = tuple[list[float], list[int], list[bytes]]

_BLOCKS_AHEAD = 4


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``main.Command``."""
    parser.add_argument("bag", metavar="BAG", help="the recording")
    parser.add_argument("--rate", type=float, default=1.0, metavar="R", help="times faster than recorded (default: 1)")
    parser.add_argument(
        "--topics",
        nargs="+",
        metavar="TOPIC",
        help="play only these topics; topics that the bag lacks are ignored (default: all)",
    )
    parser.add_argument(
        "--wait", type=float, default=5.0, metavar="S", help="wait at most this long for a subscriber [s] (default: 5)"
    )
    add_topic_option(parser)
    add_output_options(parser)
    parser.epilog = (
        "With --topic position=/joint_states what the bag has as /joint_states is played as /position. Messages are"
        " played as they are, with all joints in them, so there is no --axis: the nodes take the axes of their"
        " parameter file."
    )


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``main.Command``."""
    require_ros()
    import rclpy
    from rclpy.duration import Duration
    from rclpy.signals import SignalHandlerOptions

    from sgms_observer.bags.source import BagReader
    from sgms_observer.cli.progress import Progress
    from sgms_observer.errors import RecordingError
    from sgms_observer.interrupts import listed_signals
    from sgms_observer.nodes.transport import prepare_transport

    if not 0.0 < args.rate < float("inf"):
        raise RecordingError(f"--rate {args.rate:g} must be a positive number; 1 plays in real time")
    stop = listed_signals()
    renamed = {_absolute(name): _absolute(key) for key, name in topics_from(args.topic).items()}
    with BagReader(args.bag) as bag:
        topics = _choose(bag, args.topics, renamed)
        prepare_transport()
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        node = None
        try:
            node = rclpy.create_node("sgms_play")
            publishers = _advertise(node, bag.topics, topics, renamed)
            _await_subscriber(publishers, args.wait, stop)
            first, last = bag.span_ns
            with (
                Schedule(bag, topics, args.rate) as schedule,
                Progress("play", (last - first) * 1e-9 / args.rate) as bar,
            ):
                sent, latest = _publish(schedule, publishers, stop, bar)
            for publisher in publishers:
                publisher.wait_for_all_acked(Duration(seconds=_ACK_TIME))
        finally:
            if node is not None:
                node.destroy_node()
            rclpy.try_shutdown()
        warn(bag.warnings)
    print(f"{'stopped after' if stop else 'played'} {sent} messages, the latest {latest * 1e3:.1f} ms late")
    return Outcome(result={"schema": 1, "bag": args.bag, "messages": sent, "stopped": bool(stop), "latest_s": latest})


def _absolute(name: str) -> str:
    """Return a topic's name as bags have it."""
    return name if name.startswith("/") else "/" + name


def _choose(bag: Any, names: list[str] | None, renamed: dict[str, str]) -> tuple[str, ...]:
    """Return the topics to play: of those that were asked for, the ones that the bag has.

    A topic whose name another one is played under is left out.
    """
    from sgms_observer.errors import RecordingError

    absent = [topic for topic in renamed if topic not in bag.topics]
    if absent:
        raise RecordingError(f"{bag.path} has no topic {absent[0]}; it holds {', '.join(sorted(bag.topics))}")
    replaced = {name for topic, name in renamed.items() if topic != name}
    wanted = [topic for topic, kind in bag.topics.items() if kind and (topic not in replaced or topic in renamed)]
    if names is not None:
        wanted = list(dict.fromkeys(_absolute(name) for name in names))
    topics = tuple(topic for topic in wanted if topic in bag.topics)
    missing = ", ".join(topic for topic in wanted if topic not in bag.topics)
    if not topics:
        held = ", ".join(sorted(bag.topics)) or "nothing"
        raise RecordingError(f"{bag.path} has no topic {missing or 'to play'}; it holds {held}")
    if missing:
        warn([f"{bag.path} has no topic {missing}; the other topics are played"])
    return topics


def _advertise(node: Node, kinds: dict[str, str], topics: tuple[str, ...], renamed: dict[str, str]) -> list[Any]:
    """Make a publisher for each topic, under another name where the user gave one."""
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    from sgms_observer.nodes.recording import load_type

    qos = QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )
    return [node.create_publisher(load_type(kinds[topic]), renamed.get(topic, topic), qos) for topic in topics]


def _await_subscriber(publishers: list[Any], seconds: float, stop: Sequence[int]) -> None:
    """Wait until subscribers were found and no further one appears, or until the time is over."""
    end = time.monotonic() + seconds
    counts: list[int] = []
    since = 0.0
    while (now := time.monotonic()) < end and not stop:
        before, counts = counts, [publisher.get_subscription_count() for publisher in publishers]
        if counts != before:
            since = now
        elif any(counts) and now - since >= _SETTLING:
            return
        time.sleep(0.02)
    if any(counts):
        return
    if seconds > 0.0 and not stop:
        warn([f"no node subscribed to the played topics within {seconds:g} s; the bag is played without subscribers"])


def _publish(schedule: Schedule, publishers: list[Any], stop: Sequence[int], bar: Progress) -> tuple[int, float]:
    """Publish every message when it is due; return their number and the largest delay [s]."""
    send = [publisher.publish for publisher in publishers]
    start: float | None = None
    sent = 0
    latest = 0.0
    for dues, numbers, messages in schedule:
        if start is None:
            start = time.monotonic()
        bar.show(dues[0])
        for due, number, message in zip(dues, numbers, messages, strict=True):
            while (pause := start + due - time.monotonic()) > 0.0:
                if pause < _SHORT:
                    time.sleep(pause)
                else:
                    bar.show(due)
                    time.sleep(min(pause, _LONGEST) - 0.5 * _SHORT)
                if stop:
                    return sent, latest
            send[number](message)
            sent += 1
            latest = max(latest, -pause)
        if stop:
            break
    return sent, latest


class Schedule:
    """Reads a recording in a thread of its own, as a context manager and iterator.

    Yields blocks of due times since the first message [s], numbers of topics, and messages.

    Args:
        bag: the recording, open.
        topics: names to read; a topic's number is its place here.
        rate: how much faster than recorded [-].
    """

    def __init__(self, bag: BagReader, topics: Sequence[str], rate: float) -> None:
        self._bag = bag
        self._topics = tuple(topics)
        self._rate = rate
        self._queue: queue.Queue[Due | BaseException | None] = queue.Queue(_BLOCKS_AHEAD)
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=self._read, name="reading ahead", daemon=True)

    def __enter__(self) -> Schedule:
        """Start to read."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop reading."""
        self._is_stopped.set()
        while self._thread.is_alive():
            try:
                self._queue.get(timeout=0.05)
            except queue.Empty:
                continue

    def __iter__(self) -> Iterator[Due]:
        """Yield blocks in order of time."""
        while (item := self._queue.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item

    def _read(self) -> None:
        try:
            start: int | None = None
            for block in self._bag.blocks(self._topics):
                if start is None:
                    start = int(block.log_ns[0])
                due = (block.log_ns - start) * (1e-9 / self._rate)
                content = block.data.tobytes()
                places = zip(block.start.tolist(), block.length.tolist(), strict=True)
                messages = [content[first : first + length] for first, length in places]
                self._queue.put((due.tolist(), block.topic.tolist(), messages))
                if self._is_stopped.is_set():
                    return
            self._queue.put(None)
        except BaseException as error:
            self._queue.put(error)
