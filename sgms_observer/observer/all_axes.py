"""The observers of all axes of a file: one by one, or together where the motion of one axis acts on another."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sgms_observer.compensation.horizon import Horizon, KnownMotion
from sgms_observer.observer.axis_observer import AxisObserver, FilteredBlock, Observed, OtherMotion
from sgms_observer.observer.samples import Estimates, Floats, Samples
from sgms_observer.settings.axis import AxisSettings, coupled_number

COUPLING = "cross_axis_coupling"
LONGEST_AGE_NS = 50_000_000
"""Age from which the last motion of a silent axis counts as none: a force must not stay on after its cause."""


class _Track:
    """The latest motion of one axis by its stamps: of the block that came last, and of the one before it."""

    def __init__(self) -> None:
        self._stamps: NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._rows: Floats = np.empty((0, 4))
        self._kept = 0

    def add(self, stamp_ns: NDArray[np.int64], motion: OtherMotion) -> None:
        """Take in the next block."""
        if not len(stamp_ns):
            return
        rows = np.column_stack([motion.velocity, motion.acceleration, motion.velocity_ahead, motion.acceleration_ahead])
        before = slice(self._kept, None) if len(self._stamps) and stamp_ns[0] > self._stamps[-1] else slice(0, 0)
        stamps = np.concatenate([self._stamps[before], stamp_ns])
        self._kept = len(stamps) - len(stamp_ns)
        self._stamps, self._rows = np.maximum.accumulate(stamps), np.concatenate([self._rows[before], rows])

    def at(self, stamp_ns: NDArray[np.int64]) -> OtherMotion:
        """Return the motion at these stamps, or just before; zero where it is not known."""
        found = np.zeros((len(stamp_ns), 4))
        if len(self._stamps):
            place = np.searchsorted(self._stamps, stamp_ns, side="right") - 1
            near = np.maximum(place, 0)
            is_known = (place >= 0) & (stamp_ns - self._stamps[near] <= LONGEST_AGE_NS)
            rows = self._rows[near]
            found = np.where(is_known[:, None] & np.isfinite(rows), rows, 0.0)
        velocity, acceleration, velocity_ahead, acceleration_ahead = np.ascontiguousarray(found.T)
        return OtherMotion(velocity, acceleration, velocity_ahead, acceleration_ahead)


class AllAxes:
    """One observer per axis; an axis with the effect ``cross_axis_coupling`` is given the motion of its other axis.

    The motion is that at the same stamp, so axes that come in the same messages give the same bits for any split into
    blocks. Of an axis that is late its latest motion counts, up to ``LONGEST_AGE_NS``.

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
        """Forget every sample and everything learnt."""
        for observer in self.observers:
            observer.reset()
        self._tracks = {other: _Track() for other in self._tracks}

    def step(self, blocks: Mapping[int, Samples]) -> dict[int, Estimates]:
        """Take in one block of each axis that has one, and return each axis's number with its estimates.

        Args:
            blocks: number of the axis to its samples.
        """
        return {number: observed.estimates() for number, observed in self.observe(blocks).items()}

    def observe(self, blocks: Mapping[int, Samples]) -> dict[int, Observed]:
        """Do all of ``step`` but the estimates' arrangement by name, for whoever sends the compensation first.

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
        reach: Mapping[int, float],
    ) -> dict[int, Horizon]:
        """Return the compensation of the time to come of axes whose reference is known ahead; changes nothing.

        Args:
            latest: number of the axis to what its latest step returned.
            wanted: numbers of the axes to do that for.
            known: number of the axis to its reference ahead.
            reach: number of the axis to how far to go from its latest sample at most [s].
        """
        found = {}
        for number in wanted:
            motion = known[number]
            if number in latest and reach[number] > 0.0:
                other = known.get(self._other[number]) if number in self._other else None
                horizon = self.observers[number].horizon(latest[number], motion, reach[number], other)
                if horizon is not None:
                    found[number] = horizon
        return found
