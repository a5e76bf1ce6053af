"""Access of ``sgms commission`` to the live graph: plays and records motions, and runs the observer."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np
import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from sgms_observer.application.commission.motion import SETTLING_SHARE, Motion, approach
from sgms_observer.application.commission.table import LEAD, Heard, HeldUp, Topics, Watch
from sgms_observer.errors import DataError
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.interrupts import DeferredSignals
from sgms_observer.nodes.axis_listener import COMPENSATION, EFFORT, POSITION, REFERENCE, AxisListener
from sgms_observer.nodes.conductor import Conductor, RepeatedRequest
from sgms_observer.nodes.set_points import Playing, SetPoints
from sgms_observer.nodes.spin import leave_graph, make_executor
from sgms_observer.nodes.topics import remaps
from sgms_observer.nodes.transport import prepare_transport
from sgms_observer.settings.axis import AxisSettings

OBSERVER = "observer_node"
SILENCE = 0.5
"""Time without a new stamp of position or effort after which the topic counts as lost [s]."""

_TURN = 4.0e-3  # s from one reading of the clock to the next
_COMES_BACK = 2.0  # s in which a silent topic may return
_PATIENCE = 10.0  # s for an answer of the graph
_ACTIVE = "active: axes"  # text of the diagnostics of an active node
_ASK_AGAIN = 2.0  # s after which a request is sent again
_LOOK = 0.1  # s in which waiting messages are processed
_LAST_SAMPLES = 0.2  # s for the last messages of a recording to arrive, on all topics


class _Silence(DataError):
    """A topic that stopped arriving."""


class TableLink:
    """One axis of a table on the ROS graph, as ``application.commission.table.Table`` describes it.

    Args:
        axis: its name and scales are those of the messages.
        limits: stroke, speed and acceleration that the machine may use.
        folder: folder of the logs of the processes.
        topics: names of topics on the graph where they differ, by their usual names.

    Attributes:
        has_observer: whether an observer of this commissioning runs.
        set_point: the present set-point [m]; NaN before the first motion.
        lead: how long before its stamp a set-point is sent [s].
    """

    def __init__(self, axis: AxisSettings, limits: ExcitationLimits, folder: Path, topics: Mapping[str, str]) -> None:
        self._axis, self._limits, self._remaps = axis, limits, remaps(topics)
        self._conductor = Conductor(folder)
        self._never: Future = Future()
        self._listener = AxisListener(axis)
        self._signals = DeferredSignals()
        self.has_observer = False
        self.set_point = math.nan
        self.lead = LEAD

    def __enter__(self) -> TableLink:
        """Join the graph."""
        prepare_transport()
        rclpy.init(args=self._remaps, signal_handler_options=SignalHandlerOptions.NO)
        self._conductor.__enter__()
        self._node = rclpy.create_node("sgms_commission")
        self._executor = make_executor()
        self._executor.add_node(self._node)
        self._set_points = SetPoints(self._node, self._axis)
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
        """Return the messages within a time; see ``Table.listen``.

        Args:
            seconds: how long to listen [s].
        """
        end = time.monotonic() + _PATIENCE
        with self._signals.deferred():
            while (
                not (self._listener.positions and self._listener.effort_count)
                and time.monotonic() < end
                and not self._signals.first
            ):
                self._spin(0.05)
            self._listener.forget()
            begun = time.monotonic()
            while time.monotonic() < begun + seconds and not self._signals.first:
                self._spin(_TURN)
        node, count = self._node, self._node.count_publishers
        samples = self._listener.samples(self._listener.between_efforts(_LAST_SAMPLES))
        return Topics(
            names=dict(self._listener.names),
            samples=samples,
            efforts=self._listener.effort_count,
            seconds=time.monotonic() - begun,
            reference_readers=self._set_points.reader_count,
            reference_senders=count(node.resolve_topic_name(REFERENCE)) - 1,
            compensation_senders=count(node.resolve_topic_name(COMPENSATION)),
        )

    def play(self, motion: Motion, origin: float, watch: Watch, bag: Path | None = None) -> None:
        """Play a motion and watch it; see ``Table.play``.

        Args:
            motion: relative to the origin.
            origin: position of its zero [m].
            watch: called with the samples as they arrive.
            bag: where to record it; None to record nothing.
        """
        with self._signals.deferred():
            self._catch_up()
            self._listener.forget()
            self._await(
                lambda: len(self._listener.positions) > 2, f"no message of {POSITION} arrives; start the machine"
            )
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
                    with self._listener.recording(bag):
                        self._run(motion.after(way), origin, first, watch, slides)
            except _Silence as error:
                if self._comes_back():
                    raise HeldUp(str(error)) from None
                raise

    def start_observer(self, config: Path) -> None:
        """Start an observer; see ``Table.start_observer``.

        Args:
            config: parameter file.
        """
        with self._signals.deferred():
            arguments = ["--config", str(config), *self._remaps]
            self._conductor.start(OBSERVER, "sgms_observer.nodes.observer_node", arguments)
            self.has_observer = True
            self._conductor.wait(lambda: _ACTIVE in self._conductor.output_of(OBSERVER), f"{OBSERVER} to become active")
            self._await(self._parameters.service_is_ready, f"{OBSERVER} offers no service; see its log")
            self._await(lambda: bool(self._listener.ages), f"{OBSERVER} publishes no {COMPENSATION}; see its log")

    def stop_observer(self) -> None:
        """Stop the observer; see ``Table.stop_observer``."""
        self.has_observer = False
        self._conductor.stop(OBSERVER)

    def compensate(self, gain: float) -> None:
        """Set the gain of the compensation; see ``Table.compensate``.

        Args:
            gain: share of the predicted friction [-]; 0 switches it off.
        """
        with self._signals.deferred():
            results = self._answered(gain).results
        refused = [result.reason for result in results if not result.successful]
        if refused:
            raise DataError(f"{OBSERVER} refused the gain {gain:g}: {refused[0]}")

    def release(self) -> None:
        """Switch the compensation off at once, without waiting for the answer; see ``Table.release``."""
        if self._parameters.service_is_ready():
            self._parameters.call_async(self._gain_request(0.0))

    def delays(self) -> tuple[float, float]:
        """Return the age of the compensations since the start of the last motion; see ``Table.delays``."""
        if not self._listener.ages:
            return math.nan, math.nan
        return float(np.median(self._listener.ages)), float(np.percentile(self._listener.ages, 99.0))

    def _run(self, motion: Motion, origin: float, first: int, watch: Watch, recorded: int = 0) -> None:
        """Publish the set-points; the motion begins with sample ``first``, its recording with ``recorded``."""
        self._await(
            lambda: self._set_points.reader_count > 0,
            f"no node subscribes to {REFERENCE}; start the machine, or name its topic with --topic",
        )
        while not self._set_points.has_met_all() and not self._signals.first:
            self._conductor.watch()
            self._spin(0.02)
        playing = Playing(self._set_points, self._listener, motion, origin, self.lead)
        self._listener.span = playing.begin_ns + recorded * round(motion.period * 1e9), playing.end_ns
        self._listener.forget()
        checked, is_resting = 0, False
        try:
            while not self._listener.positions or self._listener.positions[-1][0] < playing.end_ns:
                playing.send_due()
                self._spin(_TURN)
                if self._signals.first:
                    raise KeyboardInterrupt
                self._raise_silence()
                ready = self._listener.ready(checked)
                if ready > checked:
                    self._show(self._listener.positions[checked:ready], playing, motion.period, first, watch)
                    checked = ready
            else:
                is_resting = True
                self._spin_for(_LAST_SAMPLES if self._listener.is_recording else 0.0)
        finally:
            if not is_resting:
                self.release()
            if playing.sent and is_resting:
                self.set_point = playing.last_set_point
            elif playing.sent:
                self.set_point = playing.brake(self._limits.acceleration, lambda: self._spin(_TURN))
            self._set_points.wait_acknowledged()

    def _show(
        self, rows: Sequence[tuple[int, float]], playing: Playing, period: float, first: int, watch: Watch
    ) -> None:
        """Call the watch with the newest samples."""
        index, *reference = playing.at(np.array([stamp for stamp, _ in rows], dtype=np.int64))
        watch(Heard(self._listener.samples(rows, (reference[0], reference[1])), (index - first) * period))

    def _comes_back(self) -> bool:
        """Return whether a silent topic returns within a while; then a busy computer was the reason."""
        self._listener.forget()
        end = time.monotonic() + _COMES_BACK
        while time.monotonic() < end and not self._signals.first:
            self._spin(_TURN)
            if len(self._listener.positions) > 1 and self._listener.effort_count > 1:  # one stamp may be the old one
                return True
        return False

    def _raise_silence(self) -> None:
        self._conductor.watch()
        for topic in (POSITION, EFFORT):
            silence = time.monotonic() - self._listener.heard_at[topic]
            if silence <= SILENCE:
                continue
            if self._listener.repeats_stamp(topic):
                raise _Silence(
                    f"{topic} of axis {self._axis.name} came without a new stamp for {silence:.1f} s during the motion;"
                    " the motion was stopped; check the drive and the clock of its node, then start again"
                )
            raise _Silence(
                f"{topic} of axis {self._axis.name} stopped arriving for {silence:.1f} s during the motion; the"
                " motion was stopped; check the drive and its node, then start again"
            )

    def _answered(self, gain: float) -> SetParameters.Response:
        """Return the observer's answer to a request for a gain."""
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
        """Process the messages that waited during a long computation, because the latest stamp is the table's time."""
        end = time.monotonic() + _PATIENCE
        while time.monotonic() < end and not self._signals.first:
            begun, heard = time.monotonic(), self._listener.positions
            before = heard[-1][0] if heard else 0
            self._spin_for(_LOOK)
            after = heard[-1][0] if heard else 0
            if after - before < 1.5e9 * (time.monotonic() - begun):
                return

    def _await(self, condition: Callable[[], bool], sentence: str) -> None:
        """Wait for a condition; raise the sentence after a time-out."""
        end = time.monotonic() + _PATIENCE
        while not condition() and not self._signals.first:
            if time.monotonic() > end:
                raise DataError(sentence)
            self._conductor.watch()
            self._spin(0.02)
