"""What the simulated stage says of a block of samples: the signals a real stage publishes, and the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from sgms_observer.observer.samples import Samples

Floats = NDArray[np.float64]


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
        effort_applied: effort that reaches the mass just after the sample, without disturbances [N], shape (n,).
        reference_position: set-point [m], shape (n,).
        reference_velocity: velocity of the set-point [m/s], shape (n,).
        reference_acceleration: acceleration of the set-point [m/s^2], shape (n,).
        friction: true friction of eq. 3 [N], shape (n,).
        element_force: true force of each element [N], shape (n, n_z).
        effect_force: true added force of the effects [N], shape (n,).
        compensation: feedforward that went into the effort [N], shape (n,).
    """

    stamp_ns: NDArray[np.int64]
    time: Floats
    position: Floats
    velocity: Floats
    acceleration: Floats
    measured_position: Floats
    control_effort: Floats
    effort_applied: Floats
    reference_position: Floats
    reference_velocity: Floats
    reference_acceleration: Floats
    friction: Floats
    element_force: Floats
    effect_force: Floats
    compensation: Floats

    def __len__(self) -> int:
        """Return the number of samples n."""
        return len(self.stamp_ns)

    @property
    def samples(self) -> Samples:
        """Return what an observer gets to see of this block."""
        return Samples(
            stamp_ns=self.stamp_ns,
            position=self.measured_position,
            effort=self.control_effort,
            reference_position=self.reference_position,
            reference_velocity=self.reference_velocity,
        )


def join_records(records: Sequence[StageRecord]) -> StageRecord:
    """Return consecutive blocks as one.

    Args:
        records: at least one block, in the order of time.
    """
    if len(records) == 1:
        return records[0]
    names = [field.name for field in fields(StageRecord)]
    return StageRecord(**{name: np.concatenate([getattr(record, name) for record in records]) for name in names})
