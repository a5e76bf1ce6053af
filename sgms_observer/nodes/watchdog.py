"""Brings the compensation of an axis to zero when its samples stop. No ROS in here: time comes as an argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sgms_observer.compensation.safety import SafetyStage
from sgms_observer.settings.axis import AxisSettings

MIN_PERIOD = 0.005
"""The watchdog looks no more often than this [s]."""


@dataclass
class _Watched:
    """One axis: its last stage, when its latest sample was processed and when its latest force was set [s]."""

    stage: SafetyStage
    timeout: float
    fed_at: float
    set_at: float


class Watchdog:
    """Knows the force that went out last for each axis, and lets go of it by the clock when no sample follows.

    Args:
        axes: settings of all axes.
        now: a clock that never goes back [s].
    """

    def __init__(self, axes: Sequence[AxisSettings], now: float) -> None:
        self._watched = [_watched(axis, 0.0, now) for axis in axes]

    @property
    def outputs(self) -> list[float]:
        """Return the force that went out last for each axis [N]."""
        return [watched.stage.output for watched in self._watched]

    @property
    def period(self) -> float:
        """Return how often ``silent`` is to be called [s]."""
        return max(min(watched.timeout for watched in self._watched) / 2.0, MIN_PERIOD)

    def configure(self, axes: Sequence[AxisSettings]) -> None:
        """Take other settings over; the forces stay where they are.

        Args:
            axes: settings of the same axes.
        """
        self._watched = [
            _watched(axis, watched.stage.output, watched.fed_at, watched.set_at)
            for axis, watched in zip(axes, self._watched, strict=True)
        ]

    def feed(self, number: int, output: float, now: float) -> None:
        """Note that samples of an axis were processed.

        Args:
            number: of the axis.
            output: the force that went out with the latest of them [N].
            now: the clock [s].
        """
        watched = self._watched[number]
        watched.stage.output = output
        watched.fed_at = watched.set_at = now

    def silent(self, now: float, is_ending: bool = False) -> dict[int, float]:
        """Return the next forces of the axes without samples whose force is not zero yet, on their way to zero.

        Args:
            now: the clock [s].
            is_ending: let go of every axis, however new its samples are.

        Returns:
            Number of the axis to its force [N].
        """
        forces = {}
        for number, watched in enumerate(self._watched):
            if watched.stage.output != 0.0 and (is_ending or now - watched.fed_at > watched.timeout):
                forces[number] = watched.stage.step(0.0, math.inf, now - watched.set_at)
                watched.set_at = now
        return forces


def _watched(axis: AxisSettings, output: float, fed_at: float, set_at: float | None = None) -> _Watched:
    """Return an axis with the force that went out last [N]."""
    stage = SafetyStage(axis.compensation)
    stage.output = output
    return _Watched(stage, axis.compensation.timeout, fed_at, fed_at if set_at is None else set_at)
