"""The observers of all axes of a file: one by one, or together where the motion of one axis acts on another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.compensation.horizon import Horizon, KnownMotion
from sgms_observer.observer.axis_observer import AxisObserver, FilteredBlock, OtherMotion
from sgms_observer.observer.block_arrays import Observed
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import AxisSettings, coupled_number

COUPLING = "cross_axis_coupling"
MAX_AGE_NS = 50_000_000
"""Largest age of the last motion of an axis; an older motion counts as zero."""


class _Track:
    """The motion of one axis in the last two blocks, by stamp."""

    def __init__(self) -> None:
        self._stamps: Ints = np.empty(0, dtype=np.int64)
        self._rows: Floats = np.empty((0, 4))
        self._latest_start = 0

    def add(self, stamp_ns: Ints, motion: OtherMotion) -> None:
        """Add the next block."""
        if not len(stamp_ns):
            return
        rows = np.column_stack([motion.velocity, motion.acceleration, motion.velocity_ahead, motion.acceleration_ahead])
        before = (
            slice(self._latest_start, None) if len(self._stamps) and stamp_ns[0] > self._stamps[-1] else slice(0, 0)
        )
        stamps = np.concatenate([self._stamps[before], stamp_ns])
        self._latest_start = len(stamps) - len(stamp_ns)
        self._stamps, self._rows = np.maximum.accumulate(stamps), np.concatenate([self._rows[before], rows])

    def at(self, stamp_ns: Ints) -> OtherMotion:
        """Return the latest motion up to each stamp; zero if it is unknown or older than ``MAX_AGE_NS``."""
        found = np.zeros((len(stamp_ns), 4))
        if len(self._stamps):
            place = np.searchsorted(self._stamps, stamp_ns, side="right") - 1
            near = np.maximum(place, 0)
            is_known = (place >= 0) & (stamp_ns - self._stamps[near] <= MAX_AGE_NS)
            rows = self._rows[near]
            found = np.where(is_known[:, None] & np.isfinite(rows), rows, 0.0)
        velocity, acceleration, velocity_ahead, acceleration_ahead = np.ascontiguousarray(found.T)
        return OtherMotion(velocity, acceleration, velocity_ahead, acceleration_ahead)


class AllAxes:
    """One observer per axis. An axis with the effect ``cross_axis_coupling`` gets the motion of its other axis.

    The motion at the same stamp is used, so axes in the same messages give the same bits for any split into blocks. If
    the other axis is late, its latest motion is used, up to an age of ``MAX_AGE_NS``.

    Args:
        axes: checked settings of every axis.
        sample_period: nominal time between two samples [s].

    Raises:
        ConfigurationError: if the settings of an axis do not fit the sample period.
    """

    def __init__(self, axes: Sequence[AxisSettings], sample_period: float) -> None:
        self.observers = tuple(AxisObserver(axis, sample_period) for axis in axes)
        self._other: dict[int, int] = {}
        for number, observer in enumerate(self.observers):
            other = coupled_number(axes, number)
            if COUPLING in observer.effects.names and other is not None:
                self._other[number] = other
        self._tracks = {other: _Track() for other in self._other.values()}

    @property
    def is_coupled(self) -> bool:
        """Return whether an axis needs the motion of another one."""
        return bool(self._other)

    def reset(self) -> None:
        """Forget every sample and all estimates."""
        for observer in self.observers:
            observer.reset()
        self._tracks = {other: _Track() for other in self._tracks}

    def step(self, blocks: Mapping[int, Samples]) -> dict[int, Estimates]:
        """Process one block of each axis that has one, and return the number of each axis with its estimates.

        Args:
            blocks: number of the axis to its samples.
        """
        return {number: observed.estimates() for number, observed in self.observe(blocks).items()}

    def observe(self, blocks: Mapping[int, Samples]) -> dict[int, Observed]:
        """Do ``step`` without sorting the estimates by name, so that a caller can send the compensation first.

        Args:
            blocks: number of the axis to its samples.
        """
        if not self._other:
            return {number: self.observers[number].observe(samples) for number, samples in blocks.items()}
        filtered: dict[int, FilteredBlock] = {}
        for number, samples in blocks.items():
            filtered[number] = self.observers[number].filter(samples)
            if number in self._tracks:
                self._tracks[number].add(samples.stamp_ns, filtered[number].as_other())
        observed = {}
        for number, block in filtered.items():
            other = self._other.get(number)
            motion = None if other is None else self._tracks[other].at(block.samples.stamp_ns)
            observed[number] = self.observers[number].estimate(block, motion)
        return observed

    def horizons(
        self,
        latest: Mapping[int, Estimates],
        wanted: Iterable[int],
        known: Mapping[int, KnownMotion],
        duration: Mapping[int, float],
    ) -> dict[int, Horizon]:
        """Return the future compensation of axes whose reference is known ahead; does not change the state.

        Args:
            latest: number of the axis to the estimates of its latest step.
            wanted: numbers of the axes.
            known: number of the axis to its reference ahead.
            duration: number of the axis to the largest time from its latest sample to the end of the horizon [s].
        """
        found = {}
        for number in wanted:
            motion = known[number]
            if number in latest and duration[number] > 0.0:
                other = known.get(self._other[number]) if number in self._other else None
                horizon = self.observers[number].horizon(latest[number], motion, duration[number], other)
                if horizon is not None:
                    found[number] = horizon
        return found
