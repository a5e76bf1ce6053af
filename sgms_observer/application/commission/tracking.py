"""Tracking error: measured position minus set-point, over a motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.application.commission.motion import Motion
from sgms_observer.application.commission.table import Heard
from sgms_observer.arrays import Floats
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.errors import DataError
from sgms_observer.settings.axis import AxisSettings

MAX_DELAY = 0.3
"""Largest delay of the motion after the stamp of its set-point in the search [s]."""


@dataclass(frozen=True)
class Tracking:
    """A tracking error over time.

    Attributes:
        time: since the motion began [s], shape (n,).
        error: position minus set-point [m], shape (n,).
        position: [m], shape (n,).
    """

    time: Floats
    error: Floats
    position: Floats

    @property
    def rms(self) -> float:
        """Return the rms of the error [m]."""
        return float(np.sqrt(np.mean(self.error**2)))

    @property
    def peak(self) -> float:
        """Return the largest magnitude of the error [m]."""
        return float(np.max(np.abs(self.error)))


class Tracker:
    """Collects the samples of a motion for its tracking error.

    Args:
        motion: the motion.
        origin: position of its zero [m].
        delay: how long after its stamp the table follows a set-point [s].
    """

    def __init__(self, motion: Motion, origin: float, delay: float = 0.0) -> None:
        self._motion, self._origin, self._delay = motion, origin, delay
        self._grid = motion.period * np.arange(len(motion.position))
        self._time: list[Floats] = []
        self._position: list[Floats] = []

    def __call__(self, heard: Heard) -> None:
        """Add the newest samples."""
        inside = (heard.time >= 0.0) & (heard.time <= self._grid[-1])
        self._time.append(heard.time[inside])
        self._position.append(heard.samples.position[inside])

    def tracking(self, delay: float | None = None) -> Tracking:
        """Return the tracking error of the samples so far.

        Args:
            delay: another delay than the table's [s].

        Raises:
            DataError: there are no samples.
        """
        time, position = (np.concatenate(parts) if parts else np.zeros(0) for parts in (self._time, self._position))
        if not len(time):
            raise DataError("no sample of the motion arrived; check the position's topic and start again")
        shift = self._delay if delay is None else delay
        meant = self._origin + np.interp(time - shift, self._grid, self._motion.position)
        return Tracking(time, position - meant, position)

    def best_delay(self) -> float:
        """Return the delay with the smallest tracking error [s], on the grid of the motion's period."""
        period = self._motion.period
        count = round(MAX_DELAY / period)
        coarse = max(1, count // 60)
        tried = {k: self.tracking(k * period).rms for k in range(-count, count + 1, coarse)}
        centre = min(tried, key=lambda k: tried[k])
        tried.update({k: self.tracking(k * period).rms for k in range(centre - coarse, centre + coarse + 1)})
        return min(tried, key=lambda k: tried[k]) * period


def recorded_tracking(bag: Path, axis: AxisSettings, delay: float) -> Tracking:
    """Return the tracking error of a recording, where the reference and its positions have the same stamps.

    Args:
        bag: the recording.
        axis: the axis.
        delay: how long after its stamp the table follows a set-point [s].
    """
    columns = []
    for topic in ("position", "reference"):
        states = read_joint_states(bag, topic)
        if axis.name not in states.names or not states.stamp_ns.size:
            raise DataError(f"{topic} in {bag} holds nothing of axis {axis.name}; record again")
        stamps, rows = np.unique(states.stamp_ns, return_index=True)
        columns.append((stamps, axis.position_scale * states.position[rows, states.names.index(axis.name)]))
    (stamps, position), (given, points) = columns
    time = (stamps - given[0]) * 1e-9
    reference_time = (given - given[0]) * 1e-9
    inside = (time >= 0.0) & (time <= reference_time[-1])
    meant = np.interp(time[inside] - delay, reference_time, points)
    return Tracking(time[inside], position[inside] - meant, position[inside])
