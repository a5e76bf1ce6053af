"""Block of samples of the simulated stage: the signals that a real stage publishes, and the truth.

The kernel fills a ``RecordBuffer``; a ``StageRecord`` is the whole block.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.observer.samples import Samples
from sim_plant import kernel


@dataclass(frozen=True)
class StageRecord:
    """A block of n samples of one simulated axis; row i belongs to ``stamp_ns[i]``.

    Attributes:
        stamp_ns: sample time [ns], int64, shape (n,).
        time: time since the first sample of the run [s], shape (n,).
        position: true position [m], shape (n,).
        velocity: true velocity [m/s], shape (n,).
        acceleration: true acceleration under ``effort_applied`` [m/s^2], shape (n,).
        measured_position: position as published: with noise, on the encoder's grid [m], shape (n,).
        control_effort: effort as published: commanded from this sample on, with force noise [N], shape (n,).
        effort_applied: effort on the mass just after the sample, without disturbances [N], shape (n,).
        reference_position: set-point [m], shape (n,).
        reference_velocity: velocity of the set-point [m/s], shape (n,).
        friction: true friction of eq. 3 [N], shape (n,).
        element_force: true force of each element [N], shape (n, n_z).
        effect_force: true added force of the effects [N], shape (n,).
        compensation: feedforward in the effort [N], shape (n,).
    """

    stamp_ns: Ints
    time: Floats
    position: Floats
    velocity: Floats
    acceleration: Floats
    measured_position: Floats
    control_effort: Floats
    effort_applied: Floats
    reference_position: Floats
    reference_velocity: Floats
    friction: Floats
    element_force: Floats
    effect_force: Floats
    compensation: Floats

    def __len__(self) -> int:
        """Return the number of samples n."""
        return len(self.stamp_ns)

    @property
    def samples(self) -> Samples:
        """Return the part of this block that an observer gets."""
        return Samples(
            stamp_ns=self.stamp_ns,
            position=self.measured_position,
            effort=self.control_effort,
            reference_position=self.reference_position,
            reference_velocity=self.reference_velocity,
        )


def join_records(records: Sequence[StageRecord]) -> StageRecord:
    """Return consecutive blocks, at least one, as one."""
    if len(records) == 1:
        return records[0]
    names = [field.name for field in fields(StageRecord)]
    return StageRecord(**{name: np.concatenate([getattr(record, name) for record in records]) for name in names})


class RecordBuffer:
    """A block of samples under construction.

    Args:
        first: number of the block's first sample in the run.
        count: samples n in the block.
        elements: friction elements n_z.
        sample_period: time between two samples [s].
        start_ns: stamp of the run's first sample [ns].
    """

    def __init__(self, first: int, count: int, elements: int, sample_period: float, start_ns: int) -> None:
        index = np.arange(first, first + count)
        self.stamp_ns: Ints = start_ns + np.rint(index * (sample_period * 1e9)).astype(np.int64)
        self.time: Floats = (index * sample_period).astype(np.float64)
        self.recorded: Floats = np.empty((count, kernel.RECORDED))
        self.element_force: Floats = np.empty((count, elements))
        self.compensation: Floats = np.zeros(count)

    def samples(self, k: int) -> Samples:
        """Return sample ``k`` of the block as an observer gets it, without copying."""
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
            friction=columns[kernel.FRICTION],
            element_force=self.element_force,
            effect_force=columns[kernel.EFFECT],
            compensation=self.compensation,
        )
