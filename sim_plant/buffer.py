"""Room for a block of samples that the kernel fills, and its two faces: samples so far, and the whole record."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sgms_observer.observer.samples import Samples
from sim_plant import kernel
from sim_plant.record import StageRecord

Floats = NDArray[np.float64]


class RecordBuffer:
    """A block of samples in the making.

    Args:
        first: number of the block's first sample in the run.
        count: samples n in the block.
        elements: friction elements n_z.
        sample_period: time between two samples [s].
        start_ns: stamp of the run's first sample [ns].
    """

    def __init__(self, first: int, count: int, elements: int, sample_period: float, start_ns: int) -> None:
        index = np.arange(first, first + count)
        self.stamp_ns: NDArray[np.int64] = start_ns + np.rint(index * (sample_period * 1e9)).astype(np.int64)
        self.time: Floats = (index * sample_period).astype(np.float64)
        self.recorded: Floats = np.empty((count, kernel.RECORDED))
        self.element_force: Floats = np.empty((count, elements))
        self.compensation: Floats = np.zeros(count)

    def samples(self, k: int) -> Samples:
        """Return sample ``k`` of the block as an observer gets to see it, without copying."""
        row = slice(k, k + 1)
        return Samples(
            stamp_ns=self.stamp_ns[row],
            position=self.recorded[row, kernel.MEASURED],
            effort=self.recorded[row, kernel.CONTROL],
            reference_position=self.recorded[row, kernel.REFERENCE_POSITION],
            reference_velocity=self.recorded[row, kernel.REFERENCE_VELOCITY],
        )

    def record(self) -> StageRecord:
        """Return the whole block."""
        columns = np.ascontiguousarray(self.recorded.T)
        return StageRecord(
            stamp_ns=self.stamp_ns,
            time=self.time,
            position=columns[kernel.POSITION],
            velocity=columns[kernel.VELOCITY],
            acceleration=columns[kernel.ACCELERATION],
            measured_position=columns[kernel.MEASURED],
            control_effort=columns[kernel.CONTROL],
            effort_applied=columns[kernel.APPLIED],
            reference_position=columns[kernel.REFERENCE_POSITION],
            reference_velocity=columns[kernel.REFERENCE_VELOCITY],
            reference_acceleration=columns[kernel.REFERENCE_ACCELERATION],
            friction=columns[kernel.FRICTION],
            element_force=self.element_force,
            effect_force=columns[kernel.EFFECT],
            compensation=self.compensation,
        )
