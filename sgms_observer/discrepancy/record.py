"""A recording as the workflow sees it: one evenly sampled piece of one axis, with the other axis where there is one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.offline.recording import read_recordings

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Record:
    """One piece of a recording without pauses.

    Attributes:
        name: where it comes from, for people.
        period: time between two samples [s].
        position: measured position [m], shape (n,).
        effort: effort [N], shape (n,).
        other_position: position of the other axis [m], shape (n,), or None.
    """

    name: str
    period: float
    position: Floats
    effort: Floats
    other_position: Floats | None = None

    @property
    def duration(self) -> float:
        """Length [s]."""
        return self.period * len(self.position)


def read_records(path: str | Path, axis: str, other: str | None = None) -> tuple[Record, ...]:
    """Read the pieces of a bag.

    Args:
        path: the bag.
        axis: the axis that is diagnosed.
        other: another axis of the same recording, or None.

    Raises:
        RecordingError: the bag cannot be read.
        DataError: it holds nothing to learn from.
    """
    return tuple(
        Record(piece.name, piece.period, piece.position, piece.effort, piece.other_position)
        for piece in read_recordings(path, axis, other)
    )
