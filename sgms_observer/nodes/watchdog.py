"""Takes the compensation of an axis to zero when its samples stop. Imports no ROS: time is an argument."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sgms_observer.compensation.safety import SafetyStage
from sgms_observer.settings.axis import AxisSettings

MIN_PERIOD = 0.005
"""Shortest period of the watchdog [s]."""


@dataclass
class _Watched:
    """One axis: its last stage, and the times of its latest sample and its latest force [s]."""

    stage: SafetyStage
    timeout: float
    fed_at: float
    set_at: float


class Watchdog:
    """Keeps the last published force of each axis, and takes it to zero when no sample follows.

    Args:
        axes: settings of all axes.
        now: a clock that never goes back [s].
    """

    def __init__(self, axes: Sequence[AxisSettings], now: float) -> None:
        self._watched = [_watched(axis, 0.0, now) for axis in axes]

    @property
    def outputs(self) -> list[float]:
        """Return the last published force of each axis [N]."""
        return [watched.stage.output for watched in self._watched]

    @property
    def period(self) -> float:
        """Return the period with which ``silent`` is to be called [s]."""
        return max(min(watched.timeout for watched in self._watched) / 2.0, MIN_PERIOD)

    def configure(self, axes: Sequence[AxisSettings]) -> None:
        """Apply new settings; the forces do not change.

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
            output: the published force of the latest of them [N].
            now: the clock [s].
        """
        watched = self._watched[number]
        watched.stage.output = output
        watched.fed_at = watched.set_at = now

    def silent(self, now: float, is_ending: bool = False) -> dict[int, float]:
        """Return the next forces towards zero, of axes without samples whose force is not zero yet.

        Args:
            now: the clock [s].
            is_ending: take every axis to zero, also those with new samples.

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
    """Return an axis with the last published force [N]."""
    stage = SafetyStage(axis.compensation)
    stage.output = output
    return _Watched(stage, axis.compensation.timeout, fed_at, fed_at if set_at is None else set_at)
