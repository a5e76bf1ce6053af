"""The live graph as ``sgms commission`` uses it: plays motions and watches them, records, runs the observer."""

from __future__ import annotations

import math
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.duration import Duration
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from sgms_observer.application.commission.motion import SETTLING_SHARE, Motion, approach
from sgms_observer.application.commission.table import LEAD, Heard, HeldUp, Topics, Watch
from sgms_observer.application.kernels import compile_ahead
from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import DataError
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.nodes.axis_listener import COMPENSATION, EFFORT, POSITION, REFERENCE, AxisListener
from sgms_observer.nodes.conductor import Conductor, RepeatedRequest
from sgms_observer.nodes.horizons import EVERY, encode_motion_ahead
from sgms_observer.nodes.reference_player import braking
from sgms_observer.nodes.spin import leave_graph, make_executor
from sgms_observer.nodes.topics import HORIZON_QOS, SAMPLE_QOS
from sgms_observer.nodes.transport import prepare_transport
from sgms_observer.observer.outgoing import REFERENCE_HORIZON
from sgms_observer.settings.axis import AxisSettings

OBSERVER = "observer_node"

_TURN = 4.0e-3  # s from one look at the clock to the next
_LATEST = 0.05  # s that a set-point may be sent behind its stamp; then the motion is stopped rather than caught up
_SILENCE = 0.5  # s without a position or an effort after which the topic counts as lost
_COMES_BACK = 2.0  # s for a topic that was silent to speak again
_START = 0.2  # s from the first message to the first set-point's stamp, beyond the lead
_PATIENCE = 10.0  # s for the graph to answer
_ACTIVE = "active: axes"  # how a node says that it is
_ASK_AGAIN = 2.0  # s after which a service is asked once more
_ACK_TIME = 2.0  # s for the last set-points to arrive
_LOOK = 0.1  # s in which stamps that waited pass by faster than time does
_LAST_SAMPLES = 0.2  # s for the last messages of a recording to arrive


class _Silence(DataError):
    """A topic that stopped arriving."""


class TableLink:
    """One axis of a table on the ROS graph, as ``application.commission.table.Table`` describes it.

    Args:
        axis: its name and scales are those of the messages.
        period: time between two samples [s].
        limits: what the table may do.
        folder: where the logs of the processes go.
    """

    def __init__(self, axis: AxisSettings, period: float, limits: ExcitationLimits, folder: Path) -> None:
        self._axis, self._period, self._limits = axis, period, limits
        self._conductor = Conductor(folder)
        self._never: Future = Future()
        self._encoder = JointStateEncoder((axis.name,), ("position", "velocity"))
        self._listener = AxisListener(axis)
        self._stopped_by = 0
        self._has_observer = False
        self.set_point = math.nan
        self.lead = LEAD

    def __enter__(self) -> TableLink:
        """Join the graph."""
        prepare_transport()
        compile_ahead()
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._conductor.__enter__()
        self._node = rclpy.create_node("sgms_commission")
        self._executor = make_executor()
        self._executor.add_node(self._node)
        self._publisher = self._node.create_publisher(JointState, REFERENCE, SAMPLE_QOS)
        self._ahead = self._node.create_publisher(JointTrajectory, REFERENCE_HORIZON, HORIZON_QOS)
        self._parameters = self._node.create_client(SetParameters, f"/{OBSERVER}/set_parameters")
        self._listener.subscribe(self._node)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes, the observer with a compensation of zero, and leave the graph."""
        self._conductor.__exit__(kind, error, trace)
        leave_graph(self._executor, self._node)

    def listen(self, seconds: float) -> Topics:
        """Return what comes on the graph within a time; see ``Table.listen``.

        Args:
            seconds: how long to listen [s].
        """
        end = time.monotonic() + _PATIENCE
        with self._deferred_signals():
            while (
                not (self._listener.positions and self._listener.effort_count)
                and time.monotonic() < end
                and not self._stopped_by
            ):
                self._spin(0.05)
            self._listener.forget()
            begun = time.monotonic()
            while time.monotonic() < begun + seconds and not self._stopped_by:
                self._spin(_TURN)
        node = self._node
        samples = self._listener.samples(self._listener.positions)
        return Topics(
            names=dict(self._listener.names),
            samples=samples,
            efforts=self._listener.effort_count,
            seconds=time.monotonic() - begun,
            reference_readers=self._publisher.get_subscription_count(),
            reference_senders=node.count_publishers(REFERENCE) - 1,
            compensation_senders=node.count_publishers(COMPENSATION),
        )

    def play(self, motion: Motion, origin: float, watch: Watch, bag: Path | None = None) -> None:
        """Play a motion and watch it; see ``Table.play``.

        Args:
            motion: relative to the origin.
            origin: position of its zero [m].
            watch: is shown the samples as they come.
            bag: where to record it; None to record nothing.
        """
        with self._deferred_signals():
            self._catch_up()
            self._listener.forget()
            self._await(lambda: len(self._listener.positions) > 2, f"no message of {POSITION} arrives; start the table")
            if math.isnan(self.set_point):
                self.set_point = self._listener.positions[-1][1]
            start = motion.position[0] + origin
            way = approach(self.set_point - origin, start - origin, self._limits, motion.period)
            first = len(way.position) - 1
            slides = first + motion.sliding_from(SETTLING_SHARE * self._limits.stroke)
            try:
                if bag is None:
                    self._run(motion.after(way), origin, first, watch)
                else:
                    with BagWriter(bag, is_overwriting=True) as self._listener.writer:
                        self._run(motion.after(way), origin, first, watch, slides)
            except _Silence as error:
                if self._comes_back():
                    raise HeldUp(str(error)) from None
                raise
            finally:
                self._listener.writer = None

    def start_observer(self, config: Path) -> None:
        """Start an observer; see ``Table.start_observer``.

        Args:
            config: parameter file.
        """
        with self._deferred_signals():
            self._conductor.start(OBSERVER, "sgms_observer.nodes.observer_node", ["--config", str(config)])
            self._has_observer = True
            self._conductor.wait(lambda: _ACTIVE in self._conductor.said(OBSERVER), f"{OBSERVER} to become active")
            self._await(self._parameters.service_is_ready, f"{OBSERVER} offers no service; see its log")
            self._await(lambda: bool(self._listener.ages), f"{OBSERVER} publishes no {COMPENSATION}; see its log")

    def stop_observer(self) -> None:
        """Stop the observer; see ``Table.stop_observer``."""
        self._has_observer = False
        self._conductor.stop(OBSERVER)

    def compensate(self, gain: float) -> None:
        """Set the gain of the compensation; see ``Table.compensate``.

        Args:
            gain: share of the predicted friction [-]; 0 switches it off.
        """
        with self._deferred_signals():
            results = self._answered(gain).results
        refused = [result.reason for result in results if not result.successful]
        if refused:
            raise DataError(f"{OBSERVER} refused the gain {gain:g}: {refused[0]}")

    def release(self) -> None:
        """Switch the compensation off at once, without waiting for the answer; see ``Table.release``."""
        if self._parameters.service_is_ready():
            self._parameters.call_async(self._gain_request(0.0))

    def delays(self) -> tuple[float, float]:
        """Return the age of the compensations heard since the last motion began; see ``Table.delays``."""
        if not self._listener.ages:
            return math.nan, math.nan
        return float(np.median(self._listener.ages)), float(np.percentile(self._listener.ages, 99.0))

    @property
    def has_observer(self) -> bool:
        """Return whether an observer of this commissioning's own runs."""
        return self._has_observer

    def _run(self, motion: Motion, origin: float, first: int, watch: Watch, recorded: int = 0) -> None:
        """Publish the set-points; the motion begins with sample ``first``, its recording with ``recorded``."""
        self._await(
            lambda: self._publisher.get_subscription_count() > 0,
            f"no node subscribes to {REFERENCE}; start the table, or remap its topic",
        )
        period_ns = round(motion.period * 1e9)
        position, velocity = motion.position, motion.velocity
        grid_ns = self._listener.positions[-1][
            0
        ]  # set-points with the stamps of samples: the observer pairs them by stamp
        ahead_ns = self._listener.now_ns() + (self.lead + _START) * 1e9 - grid_ns
        begin_ns = grid_ns + math.ceil(ahead_ns / period_ns) * period_ns
        end_ns = begin_ns + (len(position) - 1) * period_ns
        sent, seen, told_ns, is_resting = 0, 0, 0, False
        self._listener.span = begin_ns + recorded * period_ns, end_ns
        self._listener.forget()
        try:
            while not self._listener.positions or self._listener.positions[-1][0] < end_ns:
                now_ns = self._listener.now_ns() if self._listener.positions else grid_ns
                due = min(len(position), int((now_ns + self.lead * 1e9 - begin_ns) // period_ns) + 1)
                if sent < due and now_ns - (begin_ns + sent * period_ns) > _LATEST * 1e9:
                    raise HeldUp(
                        f"this machine was busy and sent the reference {_LATEST:g} s late; the motion was stopped;"
                        " start again on a machine with less load"
                    )
                self._send(position, velocity, origin, begin_ns, range(sent, due))
                sent = max(sent, due)
                if now_ns >= told_ns + round(EVERY * 1e9):
                    told_ns = now_ns
                    self._tell_ahead(position, velocity, origin, begin_ns, now_ns)
                self._spin(_TURN)
                if self._stopped_by:
                    raise KeyboardInterrupt
                self._raise_silence()
                ready = self._listener.ready(seen)
                if ready > seen:
                    rows = self._listener.positions[seen:ready]
                    seen = ready
                    self._watch(rows, motion, origin, begin_ns, first, watch)
            else:
                is_resting = True
                self._spin_for(_LAST_SAMPLES if self._listener.writer is not None else 0.0)
        finally:
            if not is_resting:
                self.release()
                self._brake(position, velocity, origin, begin_ns, sent)
            elif sent:
                self.set_point = origin + float(position[-1])
            self._publisher.wait_for_all_acked(Duration(seconds=_ACK_TIME))

    def _watch(
        self, rows: Sequence[tuple[int, float]], motion: Motion, origin: float, begin_ns: int, first: int, watch: Watch
    ) -> None:
        """Show the newest samples to the one who watches."""
        stamps = np.array([stamp for stamp, _ in rows], dtype=np.int64)
        index = np.asarray((stamps - begin_ns) * 1e-9 / motion.period, dtype=np.float64)
        grid = np.arange(len(motion.position))
        reference = (
            origin + np.interp(index, grid, motion.position),
            np.interp(index, grid, motion.velocity, left=0.0, right=0.0),
        )
        watch(Heard(self._listener.samples(rows, reference), (index - first) * motion.period))

    def _send(self, position: Any, velocity: Any, origin: float, begin_ns: int, numbers: range) -> None:
        """Publish set-points."""
        period_ns, scale = round(self._period * 1e9), self._axis.position_scale
        for i in numbers:
            at, speed = (origin + float(position[i])) / scale, float(velocity[i]) / scale
            message = self._encoder.encode(begin_ns + i * period_ns, [at], [speed])
            self._publisher.publish(message)
            self._listener.record(REFERENCE, begin_ns + i * period_ns, message)

    def _tell_ahead(self, position: Any, velocity: Any, origin: float, begin_ns: int, now_ns: int) -> None:
        """Publish the motion to come: then the network does not matter for the compensation."""
        if self._ahead.get_subscription_count() == 0:
            return
        motion = origin + position, velocity
        self._ahead.publish(encode_motion_ahead(self._axis, self._period, begin_ns, now_ns, *motion))

    def _brake(self, position: Any, velocity: Any, origin: float, begin_ns: int, sent: int) -> None:
        """Bring the axis to rest from where the set-point is now, within the allowed acceleration."""
        if not sent:
            return
        period_ns = round(self._period * 1e9)
        now_ns = (self._listener.now_ns() if self._listener.positions else begin_ns) + 10_000_000
        at = min(max(0, math.ceil((now_ns - begin_ns) / period_ns)), sent - 1)
        limit = self._limits.acceleration
        places, speeds = braking(float(position[at]), float(velocity[at]), limit, self._period)
        rest = np.full(round(2.0 * LEAD / self._period), places[-1])
        places, speeds = np.concatenate([places, rest]), np.concatenate([speeds, 0.0 * rest])
        start_ns = begin_ns + (at + 1) * period_ns
        done, begun = 0, time.monotonic()  # by this machine's clock: the table may say nothing any more
        while done < len(places):
            ahead = time.monotonic() - begun + 0.5 * self.lead
            due = min(len(places), int((now_ns + ahead * 1e9 - start_ns) // period_ns) + 1)
            self._send(places, speeds, origin, start_ns, range(done, due))
            done = max(done, due)
            self._spin(_TURN)
        self.set_point = origin + float(places[-1])

    def _comes_back(self) -> bool:
        """Return whether a silent topic speaks again within a while: then a busy computer was the reason."""
        self._listener.forget()
        end = time.monotonic() + _COMES_BACK
        while time.monotonic() < end and not self._stopped_by:
            self._spin(_TURN)
            if self._listener.positions and self._listener.effort_count:
                return True
        return False

    def _raise_silence(self) -> None:
        self._conductor.watch()
        for topic in (POSITION, EFFORT):
            silence = time.monotonic() - self._listener.heard_at[topic]
            if silence > _SILENCE:
                raise _Silence(
                    f"{topic} of axis {self._axis.name} stopped arriving for {silence:.1f} s during the motion; the"
                    " motion was stopped; check the drive and its node, then start again"
                )

    def _answered(self, gain: float) -> SetParameters.Response:
        """Return the observer's answer to a gain."""
        repeated = RepeatedRequest(self._parameters, self._gain_request(gain), _ASK_AGAIN)
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end:
            answer = repeated.answer()
            if answer is not None:
                return answer
            self._conductor.watch()
            self._spin(0.02)
        raise DataError(f"{OBSERVER} does not answer; see its log")

    def _gain_request(self, gain: float) -> SetParameters.Request:
        """Return the request for a gain of the axis's compensation; 0 switches it off."""
        name = f"{self._axis.name}.compensation"
        values = [Parameter(f"{name}.enabled", value=gain > 0.0), Parameter(f"{name}.gain", value=float(gain))]
        return SetParameters.Request(parameters=[value.to_parameter_msg() for value in values])

    def _spin(self, seconds: float) -> None:
        self._executor.spin_until_future_complete(self._never, timeout_sec=seconds)

    def _spin_for(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._spin(_TURN)

    def _catch_up(self) -> None:
        """Take in the messages that waited during a long computation: the table's time is that of the latest stamp."""
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end and not self._stopped_by:
            begun, heard = time.monotonic(), self._listener.positions
            before = heard[-1][0] if heard else 0
            self._spin_for(_LOOK)
            after = heard[-1][0] if heard else 0
            if after - before < 1.5e9 * (time.monotonic() - begun):
                return

    def _await(self, condition: Callable[[], bool], sentence: str) -> None:
        """Wait for a condition, or say the sentence."""
        end = time.monotonic() + _PATIENCE
        while not condition() and not self._stopped_by:
            if time.monotonic() > end:
                raise DataError(sentence)
            self._conductor.watch()
            self._spin(0.02)

    @contextmanager
    def _deferred_signals(self) -> Iterator[None]:
        """Note Ctrl-C and SIGTERM while the block runs, and obey them at its end, when the axis is at rest."""
        numbers = (signal.SIGINT, signal.SIGTERM)
        before = [signal.getsignal(number) for number in numbers]

        def note(number: int, _frame: Any) -> None:
            self._stopped_by = self._stopped_by or number

        for number in numbers:
            signal.signal(number, note)
        try:
            yield
        finally:
            for number, handler in zip(numbers, before, strict=True):
                signal.signal(number, handler)
            stopped_by, self._stopped_by = self._stopped_by, 0
            if stopped_by:
                signal.raise_signal(stopped_by)
                raise KeyboardInterrupt
