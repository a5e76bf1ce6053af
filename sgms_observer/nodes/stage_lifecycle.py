"""The lifecycle node of the simulated stage: a thread advances it by the elapsed time and adds the compensation."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence

import numpy as np
from rclpy.clock import ROSClock
from rclpy.executors import Executor
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.application.kernels import OF_STAGE
from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.cdr import JointStateDecoder
from sgms_observer.compensation.horizon import EVERY
from sgms_observer.errors import DataError, SgmsError
from sgms_observer.nodes.horizons import BEFORE, decode_horizons, encode_reference
from sgms_observer.nodes.lifecycle import ManagedNode
from sgms_observer.nodes.pace import AGE_SENTENCE, MAX_CATCH_UP, MAX_LAG_OF_FOLLOWER, DueForces, Pace, due_forces
from sgms_observer.nodes.topics import HORIZON_QOS, JointStateTopics, subscribe
from sgms_observer.observer.outgoing import COMPENSATION, HORIZON, REFERENCE_HORIZON, OutgoingBlock
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.node_parameters import NodeArguments
from sim_plant.record import StageRecord
from sim_plant.table import SimulatedTable

POSITION, EFFORT, REFERENCE, TRUTH = "position", "control_effort", "reference", "friction_true"

_SHORTEST_TURN = 5.0e-4
"""Time from one turn of the stepping thread to the next [s]; a longer sample period or ``gather_time`` replaces it."""

_LONGEST_TURN = 2.0e-3
"""The stage catches up in short steps after a turn longer than this [s], so that the observer can answer each step."""

_HURRY = 2.0
"""Speed of the stage while it catches up after a late turn, as a multiple of real time."""

_REFERENCE_STEP = 1.0e-3
"""Time between two points of the published reference horizon [s]."""

_BEYOND = 2.0 * EVERY
"""The published reference extends this much beyond the horizon [s], because it is published only every EVERY s."""

_MOST_AGES = 1_000_000

_LARGEST_BLOCK = 20
"""Samples published topic by topic; a late thread publishes several blocks, so that no topic runs far ahead."""


class StageNode(ManagedNode):
    """Simulates every axis of its parameters.

    A thread with absolute deadlines advances the stage by the elapsed real or simulated time, and publishes each sample
    with its own stamp. A process that had to wait for the processor advances its stage at twice real time, not at once,
    so that the observer is not late because of the simulation. A compensation is added to the effort ``look_ahead``
    after its stamp, or on arrival when it comes later, as described in ``DueForces``. Where ``compensation_horizon``
    covers the time of the sample, its value is added instead; for that the stage publishes its reference ahead. The
    effort of ``reference`` is the added compensation. An axis whose ``stage.reference.kind`` is ``topic`` follows the
    set-points of ``reference``, as a machine does, and this node publishes no reference for it. ``position``,
    ``control_effort`` and ``reference`` are in topic units (``position_scale``, ``effort_scale``);
    compensations and the truth are in SI.

    Args:
        name: name of the node.
        executor: the executor that will spin it.
        given: the settings and parameters that it starts with.

    Raises:
        SgmsError: the node cannot start; the sentences give the reasons.
    """

    parts = OF_STAGE
    has_stage = True

    def __init__(self, name: str, executor: Executor, given: NodeArguments) -> None:
        super().__init__(name, executor, given)
        self._table: SimulatedTable | None = None
        self._topics: JointStateTopics | None = None
        self._inputs: list[Subscription] = []
        self._reference_ahead: Publisher | None = None
        self._published_ns = 0
        self._decoder, self._reference_decoder = JointStateDecoder(), JointStateDecoder()
        self._thread: threading.Thread | None = None
        self._must_stop = threading.Event()
        self._due: list[DueForces] = []
        self._ages: list[int] = []
        self._latest_ns = 0
        self._directions: list[int] = []

    def warm_up(self) -> None:
        """Make the stage and run its kernels once."""
        SimulatedTable(self.settings).step(2)
        self._table = SimulatedTable(self.settings)

    def set_up(self) -> None:
        """Make publishers and the subscription."""
        period = self.settings.sample_period
        self._due = [due_forces(axis, period) for axis in self.settings.axes]
        self._directions = [0] * len(self._due)
        followed = [stage.followed is not None for stage in self._working_table().stages]
        topics = (POSITION, EFFORT, TRUTH) if all(followed) else (POSITION, EFFORT, REFERENCE, TRUTH)
        self._topics = JointStateTopics(self, topics)
        if not all(followed):
            self._reference_ahead = self.create_publisher(JointTrajectory, REFERENCE_HORIZON, HORIZON_QOS)
        self._published_ns = 0
        self._inputs = [
            subscribe(self, COMPENSATION, self.guarded(self._on_compensation)),
            subscribe(self, HORIZON, self.guarded(self._on_horizon), JointTrajectory, HORIZON_QOS),
        ]
        if any(followed):
            self._inputs.append(subscribe(self, REFERENCE, self.guarded(self._on_reference)))

    def begin(self) -> None:
        """Start the stepping thread."""
        self._must_stop.clear()
        self._thread = threading.Thread(target=self.guarded(self._run), name="stage", daemon=True)
        self._thread.start()

    def end(self) -> None:
        """Stop the stepping thread and wait for its end."""
        self._must_stop.set()
        if self._thread is not None:
            self._thread.join()
        self._thread = None
        if self._ages and self.context.ok():
            median, late, latest = np.percentile(self._ages, (50.0, 99.0, 100.0)) * 1e-6
            self.get_logger().info(
                f"{AGE_SENTENCE} {median:.1f} ms after its sample in the median, within {late:.1f} ms in 99 % of the"
                f" cases, after {latest:.1f} ms at the latest"
            )
        self._ages.clear()

    def tear_down(self) -> None:
        """Remove publishers and the subscription."""
        if self._topics is not None:
            self._topics.destroy()
        for subscription in self._inputs:
            self.destroy_subscription(subscription)
        self._inputs = []
        if self._reference_ahead is not None:
            self.destroy_publisher(self._reference_ahead)
        self._topics = self._reference_ahead = self._table = None

    def _working_table(self) -> SimulatedTable:
        if self._table is None:
            raise SgmsError("the node is not configured; configure it first")
        return self._table

    def _on_compensation(self, message: bytes) -> None:
        """Store a compensation for the axes that the message names."""
        try:
            stamp_ns, names, _, _, effort = self._decoder.decode(message)
        except DataError:
            return
        now_ns = self.get_clock().now().nanoseconds
        if len(self._ages) < _MOST_AGES:
            self._ages.append(max(0, self._latest_ns - stamp_ns))
        for axis, due in zip(self.settings.axes, self._due, strict=True):
            if axis.name in names and (place := names.index(axis.name)) < len(effort):
                due.put(stamp_ns, effort[place], now_ns)

    def _on_reference(self, message: bytes) -> None:
        """Store a set-point for the axes that the message names and that follow the topic."""
        if self._table is None:
            return
        try:
            stamp_ns, names, position, velocity, _ = self._reference_decoder.decode(message)
        except DataError:
            return
        now_ns = self._latest_ns or self.get_clock().now().nanoseconds
        for axis, stage in zip(self.settings.axes, self._table.stages, strict=True):
            if stage.followed is not None and axis.name in names and (place := names.index(axis.name)) < len(position):
                speed = velocity[place] if place < len(velocity) else math.nan
                factor = axis.position_scale
                stage.followed.put(stamp_ns, factor * position[place], factor * speed, now_ns)

    def _on_horizon(self, message: bytes) -> None:
        """Store the future compensation for the axes that the message names."""
        horizons = decode_horizons(message)
        for axis, due in zip(self.settings.axes, self._due, strict=True):
            if axis.name in horizons:
                due.put_horizon(horizons[axis.name])

    def _tell_reference(self, next_ns: int) -> None:
        """Publish the future reference, where it is due and a node subscribes to it.

        Args:
            next_ns: stamp of the next sample [ns].
        """
        horizon = max(axis.compensation.horizon for axis in self.settings.axes)
        if self._table is None or self._reference_ahead is None or horizon == 0.0:
            return
        is_due = not self._published_ns <= next_ns < self._published_ns + round(EVERY * 1e9)
        if not is_due or not self._reference_ahead.get_subscription_count():
            return
        self._published_ns = next_ns
        time_ahead = np.arange(-BEFORE, horizon + _BEYOND, _REFERENCE_STEP)
        motions = {
            axis.name: np.stack(stage.reference_ahead(time_ahead))
            for axis, stage in zip(self.settings.axes, self._table.stages, strict=True)
            if stage.followed is None
        }
        time_ns = next_ns + np.rint(time_ahead * 1e9).astype(np.int64)
        self._reference_ahead.publish(encode_reference(self.settings.axes, int(time_ns[0]), time_ns, motions))

    def _run(self) -> None:
        """Step and publish until the node stops."""
        turn = max(self.settings.sample_period, self.settings.gather_time, _SHORTEST_TURN)
        clock = self.get_clock()
        has_follower = any(stage.followed is not None for stage in self._working_table().stages)
        longest = MAX_LAG_OF_FOLLOWER if has_follower else MAX_CATCH_UP
        pace: Pace | None = None
        deadline = before = time.monotonic()
        while not self._must_stop.is_set() and self.context.ok():
            now_ns = clock.now().nanoseconds
            if pace is None and now_ns > 0:  # simulated time stays at zero until a node publishes it
                pace = Pace(self.settings.sample_period, now_ns, longest)
            if pace is not None:
                elapsed, before = time.monotonic() - before, time.monotonic()
                made_up = _HURRY * min(max(elapsed, turn), max(turn, _LONGEST_TURN))
                is_simulated = isinstance(clock, ROSClock) and clock.ros_time_is_active
                most = None if is_simulated else math.ceil(made_up / self.settings.sample_period)
                count = pace.due(now_ns, most)
                for first in range(pace.done - count, pace.done, _LARGEST_BLOCK):
                    last = min(first + _LARGEST_BLOCK, pace.done)
                    self._give(np.array([pace.stamp_ns(i) for i in range(first, last)], dtype=np.int64))
                self._tell_reference(pace.stamp_ns(pace.done))
            deadline = max(deadline + turn, time.monotonic() - turn)
            self._must_stop.wait(max(0.0, deadline - time.monotonic()))

    def _give(self, stamps: Ints) -> None:
        """Step the stage by as many samples as there are stamps and publish them."""
        if self._table is None or self._topics is None:
            return
        forces = [due.at(stamps, direction) for due, direction in zip(self._due, self._directions, strict=True)]
        for stage in self._table.stages:
            if stage.followed is not None:
                stage.followed.anchor(int(stamps[0]), stage.samples_done * self.settings.sample_period)
        records = self._table.step(len(stamps), forces)
        self._directions = [int(np.sign(record.reference_velocity[-1])) for record in records]
        self._latest_ns = int(stamps[-1])
        axes = self.settings.axes
        names = tuple(axis.name for axis in axes)
        unfollowed = [i for i, stage in enumerate(self._table.stages) if stage.followed is None]
        measured = [record.samples.in_topic_units(axis.scales) for record, axis in zip(records, axes, strict=True)]
        given = [measured[i] for i in unfollowed]
        fields_of = ("position", "velocity") if unfollowed else ()
        reference = {field: _columns(given, f"reference_{field}") for field in fields_of}
        truth = {"position": "position", "velocity": "velocity", "effort": "friction"}
        if unfollowed:
            effort = np.array([forces[i] for i in unfollowed]).T
            own_names = tuple(names[i] for i in unfollowed)
            self._topics.publish(OutgoingBlock(REFERENCE, own_names, stamps, {**reference, "effort": effort}))
        for topic, values in (
            (POSITION, {"position": _columns(measured, "position")}),
            (EFFORT, {"effort": _columns(measured, "effort")}),
            (TRUTH, {field: _columns(records, name) for field, name in truth.items()}),
        ):
            self._topics.publish(OutgoingBlock(topic, names, stamps, values))


def _columns(blocks: Sequence[Samples | StageRecord], field: str) -> Floats:
    """Return one field of all axes side by side, shape (n, axes)."""
    return np.array([getattr(block, field) for block in blocks]).T
