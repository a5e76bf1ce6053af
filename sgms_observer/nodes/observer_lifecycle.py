"""The lifecycle node around the engine: subscriptions, publishers, services, diagnostics and the watchdog."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import Executor
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.application.kernels import OF_OBSERVER
from sgms_observer.bags.diagnostics_cdr import encode_diagnostics, parameter_entry
from sgms_observer.errors import SgmsError
from sgms_observer.nodes.engine import Engine, Processed, save_learnt
from sgms_observer.nodes.lifecycle import ManagedNode
from sgms_observer.nodes.neighbours import Neighbours, without_compensation
from sgms_observer.nodes.report import Report, scale_sentences
from sgms_observer.nodes.statistics import Sentences
from sgms_observer.nodes.topics import HORIZON_QOS, Outlets, subscribe
from sgms_observer.nodes.watchdog import MIN_PERIOD, Watchdog
from sgms_observer.observer.outgoing import (
    PARAMETERS,
    REFERENCE_HORIZON,
    OutgoingBlock,
)
from sgms_observer.settings.node_parameters import NodeArguments

_REPORT_PERIOD = 1.0  # s
_LONGEST_END = 1.0  # s in which the compensation goes to zero within its slew limit when the node stops
_IDLE_SHARE = 0.25  # share of a sample period without an event, after which no event is expected to wait
_OWN_CLOCK_NS = 10_000_000_000  # a stamp that is older than this on the node's clock belongs to another clock
_SHORTEST_REPORT = 0.8  # s


class ObserverNode(ManagedNode):
    """Observes every axis of its parameters.

    Messages are decoded on arrival. A complete sample that arrives while the node is idle is estimated at once. A
    sample that arrives sooner posts a task after all waiting events. The task estimates over all samples that are
    complete by then, so blocks grow when the computer is late.
    The compensation of a sample is published first, then command and horizon, then its other messages. Then the next
    sample is prepared.
    Samples that arrive faster than ``gather_time`` are gathered: after each block the node sleeps that long while
    messages arrive. A block of four samples costs as much as a single one, and the thread wakes up once for all.

    Args:
        name: name of the node.
        executor: the executor that will spin it.
        given: the settings and parameters that it starts with.

    Raises:
        SgmsError: the node cannot start; the sentences give the reasons.
    """

    parts = OF_OBSERVER

    def __init__(self, name: str, executor: Executor, given: NodeArguments) -> None:
        super().__init__(name, executor, given)
        self._engine: Engine | None = None
        self._outlets: Outlets | None = None
        self._subscriptions_of_inputs: list[Subscription] = []
        self._is_scheduled = False
        self._is_late = False
        self._idle_since = 0.0
        self._surely_idle = math.inf
        self._oldest_ns = 0
        self._pause = 0.0
        self._task = self.guarded(self._process)
        self._reported_at = time.monotonic()
        self._sentences = Sentences()
        self._diagnosed = Report()
        self._neighbours = Neighbours(self)
        self._watchdog: Watchdog | None = None
        self._watch_timer: Timer | None = None
        self._diagnostics: Publisher = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._parameter_topic: Publisher = self.create_publisher(DiagnosticArray, PARAMETERS, 100)
        self.create_service(Trigger, "~/reset", self._reset)
        self.create_service(Trigger, "~/save_parameters", self._save_parameters)
        self.create_timer(_REPORT_PERIOD, self.guarded(self._report), clock=self.steady_clock)

    def warm_up(self) -> None:
        """Make the engine and run its kernels once."""
        self._engine = Engine(self.settings)
        self._engine.warm_up()

    def set_up(self) -> None:
        """Make publishers and subscriptions."""
        self._outlets = Outlets(self, self.settings)
        is_one_topic = self.resolve_topic_name("position") == self.resolve_topic_name("control_effort")
        inputs = (
            {"position": self._on_both}
            if is_one_topic
            else {"position": self._on_position, "control_effort": self._on_effort}
        )
        inputs["reference"] = self._on_reference
        self._subscriptions_of_inputs = [
            subscribe(self, topic, self.guarded(callback)) for topic, callback in inputs.items()
        ]
        self._subscriptions_of_inputs.append(
            subscribe(self, REFERENCE_HORIZON, self.guarded(self._on_reference_horizon), JointTrajectory, HORIZON_QOS)
        )
        self._watch_by(Watchdog(self.settings.axes, time.monotonic()))

    def begin(self) -> None:
        """Start without earlier samples."""
        settings = self.settings
        self._pause = settings.gather_time if settings.sample_period < settings.gather_time else 0.0
        self._surely_idle = math.inf if self._pause > 0.0 else _IDLE_SHARE * settings.sample_period
        self._working_engine().reset()
        self._reported_at = time.monotonic()
        self._watch_by(Watchdog(self.settings.axes, time.monotonic()))
        self._neighbours.judge_rivals()
        self.on_tuned()
        for number in range(len(self.settings.axes)):
            self._working_engine().continue_compensation(number, 0.0)

    def end(self) -> None:
        """Take the compensation to zero within the slew limit, and at once after a second."""
        watchdog, begun = self._watchdog, time.monotonic()
        if self.context.ok() and self._engine is not None and self._outlets is not None:
            self._outlets.give_horizons(self._engine.horizons.released(self.get_clock().now().nanoseconds))
        while self.context.ok() and watchdog is not None and any(watchdog.outputs):
            now = time.monotonic()
            forces = watchdog.silent(now, is_ending=True)
            if now - begun > _LONGEST_END:
                forces = dict.fromkeys(forces, 0.0)
                for number in forces:
                    watchdog.feed(number, 0.0, now)
            self._publish_compensation(forces)
            if any(watchdog.outputs):
                time.sleep(MIN_PERIOD)
            elif self._outlets is not None:
                self._outlets.wait_acknowledged()
        self._watchdog = None

    def tear_down(self) -> None:
        """Remove publishers and subscriptions."""
        for subscription in self._subscriptions_of_inputs:
            self.destroy_subscription(subscription)
        self._subscriptions_of_inputs = []
        if self._watch_timer is not None:
            self.destroy_timer(self._watch_timer)
        if self._outlets is not None:
            self._outlets.destroy()
        self._watch_timer = self._watchdog = self._outlets = self._engine = None

    def on_tuned(self) -> None:
        """Apply new settings of the compensation; it stays at zero while another observer publishes it."""
        settings = self.settings if not self._neighbours.rivals else without_compensation(self.settings)
        self._working_engine().tune_compensation(settings)
        if self._outlets is not None:
            self._outlets.commands.settings = settings
        compensations = [axis.compensation for axis in settings.axes]
        self._oldest_ns = round(1e9 * max(found.look_ahead + found.timeout for found in compensations))
        if self._watchdog is not None:
            self._watchdog.configure(settings.axes)
            self._watch_by(self._watchdog)

    def _watch_by(self, watchdog: Watchdog) -> None:
        """Set the period of the watchdog."""
        self._watchdog = watchdog
        if self._watch_timer is not None:
            self.destroy_timer(self._watch_timer)
        self._watch_timer = self.create_timer(watchdog.period, self.guarded(self._watch), clock=self.steady_clock)

    def _working_engine(self) -> Engine:
        if self._engine is None:
            raise SgmsError("the node is not configured; configure it first")
        return self._engine

    def _on_position(self, message: bytes) -> None:
        if self.is_active and self._engine is not None:
            self._schedule(self._engine.intake.position(message))

    def _on_effort(self, message: bytes) -> None:
        if self.is_active and self._engine is not None:
            self._schedule(self._engine.intake.effort(message))

    def _on_both(self, message: bytes) -> None:
        if self.is_active and self._engine is not None:
            self._schedule(self._engine.intake.position_and_effort(message))

    def _on_reference(self, message: bytes) -> None:
        if self.is_active and self._engine is not None:
            self._schedule(self._engine.intake.reference(message))

    def _on_reference_horizon(self, message: bytes) -> None:
        if self.is_active:
            engine = self._working_engine()
            engine.intake.counts.messages += 1
            if not engine.horizons.take_reference(message, self.get_clock().now().nanoseconds):
                engine.intake.counts.malformed += 1

    def _schedule(self, has_samples: bool) -> None:
        """Process complete samples: at once, or after the waiting events where there may be some."""
        if self._is_scheduled or not has_samples:
            return
        if time.monotonic() - self._idle_since > self._surely_idle:
            self._process()
        else:
            self._is_scheduled = True
            self.own_executor.create_task(self._task)

    def _process(self) -> None:
        self._is_scheduled = False
        engine = self._engine
        if not self.is_active or self._outlets is None or self._watchdog is None or engine is None:
            return
        processed = engine.process(self._send_compensation, self._outlets.are_others_read)
        self._feed_watchdog(processed)
        if processed.observed:
            self._outlets.commands.publish(self._watchdog.outputs, self._is_late)
        self._outlets.give_horizons(engine.horizons.give(processed.observed))
        for block in processed.blocks:  # no controller waits for these; after a stall they are thousands
            self._outlets.topics.publish(block)
        for report in processed.reports:
            self._parameter_topic.publish(encode_diagnostics(report.stamp_ns, [parameter_entry(report)]))
        if processed.blocks:  # the time that publishing them took is no silence of the inputs
            self._feed_watchdog(processed)
        engine.prepare(self._send_one)
        if self._pause > 0.0:
            time.sleep(self._pause)
        self._idle_since = time.monotonic()

    def _feed_watchdog(self, processed: Processed) -> None:
        """Give the watchdog the latest compensation of each observed axis."""
        now = time.monotonic()
        if self._watchdog is not None:
            for number, observed in processed.observed.items():
                self._watchdog.feed(number, float(observed.compensation[-1]), now)

    def _send_one(self, stamp_ns: int, forces: Sequence[float]) -> None:
        """Publish the compensation of one sample of all axes [N], and count it where it is too late."""
        if self._outlets is not None:
            self._outlets.send_forces(stamp_ns, forces)
        age = time.time_ns() - stamp_ns
        self._is_late = self._oldest_ns < age < _OWN_CLOCK_NS
        if self._is_late:
            self._working_engine().intake.counts.too_late += 1

    def _send_compensation(self, block: OutgoingBlock) -> None:
        """Publish compensations, and count those that come too late to be applied.

        A stamp that is far from this node's clock belongs to another clock, so its age is unknown.
        """
        now, stamps = time.time_ns(), block.stamp_ns  # twenty times faster than the clock of the node
        if self._outlets is not None:
            self._outlets.topics.publish(block, is_read=True)
        self._is_late = self._oldest_ns < now - int(stamps[-1]) < _OWN_CLOCK_NS
        if now - int(stamps[0]) > self._oldest_ns:
            late = np.count_nonzero((now - stamps > self._oldest_ns) & (now - stamps < _OWN_CLOCK_NS))
            self._working_engine().intake.counts.too_late += int(late)

    def _watch(self) -> None:
        """Take the compensation of each axis without samples to zero."""
        if not self.is_active or self._watchdog is None:
            return
        forces = self._watchdog.silent(time.monotonic())
        if forces:
            for number, force in forces.items():
                self._working_engine().continue_compensation(number, force)
            self._publish_compensation(forces)

    def _publish_compensation(self, forces: dict[int, float]) -> None:
        """Publish forces without samples [N], by the number of the axis."""
        if self._outlets is not None:
            outputs = self._watchdog.outputs if self._watchdog is not None else [0.0] * len(self.settings.axes)
            named = {self.settings.axes[number].name: force for number, force in forces.items()}
            self._outlets.give_forces(named, outputs)

    def _report(self) -> None:
        """Publish diagnostics and log the new sentences in them."""
        now = time.monotonic()
        seconds = now - self._reported_at
        engine = self._engine
        if engine is None or not self.is_active or seconds < _SHORTEST_REPORT:
            return
        self._reported_at = now
        name = self.get_fully_qualified_name().lstrip("/")
        faults, readers = self._judge_rivals(), self._neighbours.judge_readers()
        entries, sentences = self._diagnosed.take(name, engine, seconds, faults, readers)
        self._diagnostics.publish(encode_diagnostics(self.get_clock().now().nanoseconds, entries))
        for sentence in self._sentences.new([*sentences, *scale_sentences(self.settings.axes)]):
            if sentence in faults:
                self.get_logger().error(sentence)
            else:
                self.get_logger().warning(sentence)

    def _judge_rivals(self) -> list[str]:
        """Keep the compensation at zero while another node publishes it too; return a sentence about that."""
        had_rivals = bool(self._neighbours.rivals)
        sentences = self._neighbours.judge_rivals()
        if bool(sentences) != had_rivals:
            self.on_tuned()
            if had_rivals:
                self.get_logger().info("no other node publishes the compensation any more; its settings apply again")
        return sentences

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Answer ``~/reset``: drop all samples and estimates."""
        if self._engine is None:
            response.success, response.message = False, "the node is not configured; configure it first"
            return response
        self._engine.reset()
        response.success, response.message = True, "the observer restarts with the next sample"
        self.get_logger().info("reset on request")
        return response

    def _save_parameters(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Answer ``~/save_parameters``: write the parameter file with the estimated values."""
        try:
            response.message = save_learnt(self.settings, self._working_engine(), self.get_name())
            response.success = True
        except Exception as error:  # the answer carries the sentence
            response.success, response.message = False, str(error)
        return response
