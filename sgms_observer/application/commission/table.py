"""Interface to the table, and the guard that stops a motion at a limit, a stall or a wrong sign. Imports no ROS."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from sgms_observer.application.commission.motion import Motion
from sgms_observer.arrays import Floats, Ints
from sgms_observer.errors import DataError
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings

LEAD = 0.2
"""How long before its stamp a set-point is sent [s], to a table that follows set-points at their stamps."""


STROKE_MARGIN = 0.05
"""How far beyond the stroke a position may be, as a share of it: overshoot, not more."""
SPEED_MARGIN = 1.5
"""Largest speed of an axis as a multiple of the allowed one: room for the ripple of a controller."""
SPEED_WINDOW = 0.02
"""Time over which the speed is averaged [s]: longer than the time between two encoder steps."""
LARGEST_LAG = 0.05
"""Largest following error, as a share of the stroke."""
STALL_SHARE = 0.1
"""An axis stalls where it moves less than this share of the distance of its set-point."""
STALL_WAY = 0.01
"""Distance of the set-point over which a stall is detected, as a share of the stroke."""
MAX_GAP = 0.1
"""Longest time between two stamps of the position [s]: after a longer one the set-point has jumped."""
WRONG_SIGN = -0.2
"""Correlation of effort and velocity below which the sign of the effort is wrong: friction dissipates power."""


class HeldUp(DataError):
    """A motion that was stopped because a computer was busy: it may be played again."""


@dataclass(frozen=True)
class Topics:
    """Messages and nodes on the graph within a time.

    Attributes:
        names: the axes that each topic named.
        samples: positions with the efforts of their stamps [SI units].
        efforts: messages of the effort.
        seconds: duration of the listening [s].
        reference_readers: nodes that subscribe to the reference.
        reference_senders: other nodes that publish it.
        compensation_senders: nodes that publish the compensation.
    """

    names: Mapping[str, tuple[str, ...]]
    samples: Samples
    efforts: int
    seconds: float
    reference_readers: int
    reference_senders: int
    compensation_senders: int


@dataclass(frozen=True)
class Heard:
    """The newest samples during a motion.

    Attributes:
        samples: in SI, with the set-point of each stamp.
        time: since the motion began, negative on the way to its start [s], shape (n,).
    """

    samples: Samples
    time: Floats


Watch = Callable[[Heard], None]
"""Gets the newest samples of a motion; an exception stops the motion and takes the compensation to zero."""


class Table(Protocol):
    """One axis of a table.

    Attributes:
        lead: how long before its stamp a set-point is sent [s].
    """

    lead: float

    def listen(self, seconds: float) -> Topics:
        """Return the messages within some seconds, counted from the first position and effort."""
        ...

    def play(self, motion: Motion, origin: float, watch: Watch, bag: Path | None = None) -> None:
        """Play a motion, after a gentle move to its start, and return when the table rests at its end.

        Whatever stops it early, an exception of ``watch``, Ctrl-C or a silent topic, first takes the compensation to
        zero and brings the set-point to rest within the allowed acceleration.

        Args:
            motion: relative to the origin.
            origin: position of its zero [m].
            watch: called with the samples as they arrive.
            bag: where to record the motion, from the first sliding on; None to record nothing.

        Raises:
            DataError: a topic is silent, no node subscribes to it, or this computer is too busy.
        """
        ...

    @property
    def has_observer(self) -> bool:
        """Return whether an observer of this commissioning's own runs."""
        ...

    def start_observer(self, config: Path) -> None:
        """Start an observer of this commissioning's own with a parameter file, and return when it publishes."""
        ...

    def stop_observer(self) -> None:
        """Stop the observer; it takes its compensation to zero first."""
        ...

    def compensate(self, gain: float) -> None:
        """Set the gain of the axis's compensation, a share of the predicted friction; 0 switches it off."""
        ...

    def release(self) -> None:
        """Switch the compensation off at once, in the middle of a motion."""
        ...

    def delays(self) -> tuple[float, float]:
        """Return the median and the 99th percentile of the time from a sample to its compensation [s]."""
        ...


def stall(axis: AxisSettings, way: float, gone: float) -> DataError:
    """Return the error about an axis that does not follow its reference.

    Args:
        axis: the axis.
        way: distance of the reference [m].
        gone: distance of the axis [m].
    """
    readable = axis.units.readable
    return DataError(
        f"axis {axis.name} stalls: the reference went {readable(way)} and the axis {readable(gone)}; the motion was"
        " stopped; check that the drive is enabled, follows reference and has enough force"
    )


class Guard:
    """Checks every sample of a motion.

    Args:
        axis: the axis.
        limits: stroke, speed and acceleration that the machine may use.
        origin: middle of the stroke [m].
        delay: how long after its stamp the table follows a set-point [s].
        slack: additional following error that is allowed while the delay is not known yet [m].
    """

    def __init__(
        self, axis: AxisSettings, limits: ExcitationLimits, origin: float, delay: float, slack: float = 0.0
    ) -> None:
        self._axis, self._limits, self._origin, self._delay = axis, limits, origin, delay
        self._stall_way = STALL_WAY * limits.stroke + slack
        self._largest_lag = LARGEST_LAG * limits.stroke + slack
        self._kept = np.zeros((3, 0))  # stamp [s], position, set-point
        self._first_ns: int | None = None
        self._latest_ns: int | None = None
        self._way_from: tuple[float, float] | None = None
        self._power = np.zeros(3)  # sums of effort times velocity, effort squared, velocity squared

    @property
    def sign(self) -> float:
        """Return the correlation of effort and velocity of the set-point so far [-]."""
        product, effort, speed = self._power
        return float(product / math.sqrt(effort * speed)) if effort > 0.0 and speed > 0.0 else 0.0

    def __call__(self, heard: Heard) -> None:
        """Check the newest samples.

        Raises:
            DataError: the motion must stop; one sentence.
        """
        samples = heard.samples
        if not len(samples.stamp_ns):
            return
        self._judge_gap(samples.stamp_ns)
        self._judge_place(samples.position)
        self._judge_following(samples.stamp_ns, samples.position, samples.reference_position)
        known = np.isfinite(samples.effort)
        effort, velocity = samples.effort[known], samples.reference_velocity[known]
        self._power += effort @ velocity, effort @ effort, velocity @ velocity

    def _judge_gap(self, stamp_ns: Ints) -> None:
        before = stamp_ns[0] if self._latest_ns is None else self._latest_ns
        gap = 1e-9 * float(np.max(np.diff(stamp_ns, prepend=before)))
        self._latest_ns = int(stamp_ns[-1])
        if gap > MAX_GAP:
            raise HeldUp(
                f"position of axis {self._axis.name} has a gap of {gap:.2f} s during the motion, which was stopped;"
                " start again when the machine's computer is less busy"
            )

    def _judge_place(self, position: Floats) -> None:
        readable, stroke = self._axis.units.readable, self._limits.stroke
        farthest = float(position[np.argmax(np.abs(position - self._origin))])
        if abs(farthest - self._origin) > (0.5 + STROKE_MARGIN) * stroke:
            raise DataError(
                f"axis {self._axis.name} is at {readable(farthest)}, outside the {readable(stroke)} allowed around"
                f" {readable(self._origin)}; the motion was stopped; check position_scale and the controller, or give a"
                " larger --stroke"
            )

    def _judge_following(self, stamp_ns: Ints, position: Floats, set_point: Floats) -> None:
        if self._first_ns is None:
            self._first_ns = int(stamp_ns[0])
        fresh = np.stack([(stamp_ns - self._first_ns) * 1e-9, position, set_point])
        self._kept = np.concatenate([self._kept, fresh], axis=1)
        time, places, points = self._kept
        since = float(time[-1]) - max(SPEED_WINDOW, abs(self._delay)) - 2.0 * SPEED_WINDOW - MAX_GAP
        self._kept = self._kept[:, np.searchsorted(time, since) :]
        time, places, points = self._kept
        readable, name = self._axis.units.readable, self._axis.name
        first = int(np.searchsorted(time, time[-1] - SPEED_WINDOW))
        span = float(time[-1] - time[first])
        if span > 0.5 * SPEED_WINDOW:
            speed = abs(float(places[-1] - places[first])) / span
            if speed > SPEED_MARGIN * self._limits.speed:
                raise DataError(
                    f"axis {name} moves at {readable(speed, 'm/s')}, more than {SPEED_MARGIN:g} times the"
                    f" {readable(self._limits.speed, 'm/s')} allowed; the motion was stopped; check the controller, or"
                    " give a larger --speed"
                )
        meant = float(np.interp(time[-1] - self._delay, time, points))
        here = float(places[-1])
        if self._way_from is None:
            self._way_from = (meant, here)
        way, gone = meant - self._way_from[0], here - self._way_from[1]
        recent = points[time >= time[-1] - self._delay - MAX_GAP] - self._way_from[0]
        is_late = bool(np.min(recent) <= gone <= np.max(recent))  # it follows its reference with a delay
        if abs(way) > self._stall_way and not is_late:
            if gone * math.copysign(1.0, way) < -STALL_SHARE * abs(way):
                raise DataError(
                    f"axis {name} moves against its reference; the motion was stopped; reverse the sign of"
                    " position_scale, or correct the drive's"
                )
            if abs(gone) < STALL_SHARE * abs(way):
                raise stall(self._axis, abs(way), abs(gone))
            self._way_from = (meant, here)
        if abs(meant - here) > self._largest_lag:
            if abs(gone) < STALL_SHARE * abs(way):
                raise stall(self._axis, abs(way), abs(gone))
            raise DataError(
                f"axis {name} is {readable(abs(meant - here))} away from its reference; the motion was stopped; check"
                " that the drive follows reference, or move slower with --speed and --acceleration"
            )
