"""Converts ``reference_horizon`` messages to motions, and future compensations to messages. Imports no ROS."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from sgms_observer.bags.cdr import Buffer
from sgms_observer.bags.trajectory_cdr import decode_trajectory, encode_trajectory
from sgms_observer.compensation.horizon import EVERY, MIN_STEP, Horizon, KnownMotion
from sgms_observer.errors import DataError
from sgms_observer.observer.all_axes import AllAxes
from sgms_observer.observer.block_arrays import Observed
from sgms_observer.settings.axis import AxisSettings, Settings

BEFORE = 0.05
"""The published reference starts this long before now [s], for an observer that still processes older samples."""

AHEAD = 0.5
"""The reference is published this far ahead [s]: a ``compensation_horizon`` of the default length, and pauses."""


def encode_reference(
    axes: Sequence[AxisSettings], now_ns: int, time_ns: np.ndarray, motions: Mapping[str, np.ndarray]
) -> bytes:
    """Return ``reference_horizon`` in topic units.

    Args:
        axes: in the order of the motions.
        now_ns: the present [ns].
        time_ns: time of each point [ns], shape (n,).
        motions: name of the axis to its position and velocity [SI units], shape (2, n) each.
    """
    scales = np.array([axis.position_scale for axis in axes if axis.name in motions])
    positions, velocities = (np.stack([motion[row] for motion in motions.values()], axis=1) / scales for row in (0, 1))
    return encode_trajectory(now_ns, tuple(motions), time_ns, {"positions": positions, "velocities": velocities})


def encode_motion_ahead(
    axis: AxisSettings, period: float, begin_ns: int, now_ns: int, position: np.ndarray, velocity: np.ndarray
) -> bytes:
    """Return the future part of a motion as ``reference_horizon``; the axis rests before and after the motion.

    Args:
        axis: the one that moves.
        period: time between two samples of the motion [s].
        begin_ns: time of its first sample [ns].
        now_ns: the present, on the same clock [ns].
        position: of each sample [m], shape (n,).
        velocity: of each sample [m/s], shape (n,).
    """
    period_ns, every = round(period * 1e9), max(1, round(MIN_STEP / period))
    first = (now_ns - begin_ns) // period_ns - math.ceil(BEFORE / period)
    number = np.arange(first, first + math.ceil((BEFORE + AHEAD) / period), every)
    at = np.clip(number, 0, len(position) - 1)
    time_ns = begin_ns + number * period_ns
    motion = np.stack([position[at], np.where(at == number, velocity[at], 0.0)])
    return encode_reference((axis,), int(time_ns[0]), time_ns, {axis.name: motion})


def decode_horizons(message: Buffer) -> dict[str, Horizon]:
    """Return the future compensation of each axis that a message names; empty where it is no horizon.

    Args:
        message: of ``compensation_horizon``.
    """
    try:
        found = decode_trajectory(message)
    except DataError:
        return {}
    effort = found.values["effort"]
    if effort.shape[1] == 0:
        return {}
    return {name: Horizon(found.time_ns, effort[:, place].copy()) for place, name in enumerate(found.names)}


class HorizonExchange:
    """Keeps the future reference of each axis, and computes the future compensation from it.

    Args:
        settings: all axes.
        all_axes: their observers.
    """

    def __init__(self, settings: Settings, all_axes: AllAxes) -> None:
        self._all_axes = all_axes
        self._numbers = {axis.name: number for number, axis in enumerate(settings.axes)}
        self._known: dict[int, KnownMotion] = {}
        self._given_ns: dict[int, int] = {}
        self._given: dict[int, Horizon] = {}
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Apply new settings of the compensation; the next horizons are due at once.

        Args:
            settings: of the same axes.
        """
        self._axes = settings.axes
        self._reach = {number: axis.compensation.horizon for number, axis in enumerate(settings.axes)}
        self._given_ns.clear()

    def reset(self) -> None:
        """Drop all references."""
        self._known.clear()

    def take_reference(self, message: Buffer, now_ns: int) -> bool:
        """Read a message of ``reference_horizon``; return whether it is valid.

        Args:
            message: a serialized JointTrajectory in topic units; a stamp of zero stands for the present.
            now_ns: the clock [ns].
        """
        try:
            found = decode_trajectory(message)
        except DataError:
            return False
        position, velocity = found.values["positions"], found.values["velocities"]
        if position.shape[1] == 0:
            return False
        time_ns = found.time_ns if found.stamp_ns else found.time_ns + now_ns
        for place, name in enumerate(found.names):
            number = self._numbers.get(name)
            if number is None:
                continue
            scale = self._axes[number].position_scale
            speed = velocity[:, place] * scale if velocity.shape[1] else None
            motion = KnownMotion.of(time_ns, position[:, place] * scale, speed)
            if motion is not None:
                self._known[number] = motion
        return True

    def give(self, observed: Mapping[int, Observed]) -> Iterator[bytes]:
        """Yield the messages of ``compensation_horizon`` that are due, one for each axis.

        Args:
            observed: number of the axis to the observation of its latest samples.
        """
        due = [n for n in self._known if n in observed and self._is_due(n, int(observed[n].stamp_ns[-1]))]
        latest = {number: observed[number].estimates() for number in due}
        for number, horizon in self._all_axes.horizons(latest, due, self._known, self._reach).items():
            stamp = int(latest[number].stamp_ns[-1])
            self._given_ns[number] = stamp
            had_force = number in self._given and self._given[number].effort.any()
            if self._axes[number].compensation.enabled or had_force:
                yield self._message(number, stamp, horizon)

    def released(self, now_ns: int) -> Iterator[bytes]:
        """Yield messages that take the published compensation to zero from now on, within the slew limit of each axis.

        Args:
            now_ns: the clock of the stamps [ns].
        """
        for number, given in list(self._given.items()):
            begin = max(now_ns, int(given.time_ns[0]) + 1)
            since = (given.time_ns - begin) * 1e-9
            force = float(np.interp(0.0, since, given.effort, right=0.0))
            if not given.effort.any() or since[-1] < 0.0:
                continue
            end = begin + 1 + round(1e9 * abs(force) / self._axes[number].compensation.slew_limit)
            yield self._message(number, now_ns, Horizon(np.array([begin, end]), np.array([force, 0.0])))
        self._given.clear()

    def _is_due(self, number: int, stamp: int) -> bool:
        given = self._given_ns.get(number)
        return given is None or not given <= stamp < given + round(EVERY * 1e9)

    def _message(self, number: int, stamp: int, horizon: Horizon) -> bytes:
        self._given[number] = horizon
        return encode_trajectory(
            stamp, (self._axes[number].name,), horizon.time_ns, {"effort": horizon.effort[:, np.newaxis]}
        )
