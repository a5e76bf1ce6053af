"""A recording as the workflow sees it: one evenly sampled piece of one axis, with the other axis where there is one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.reader import BagSamples
from sgms_observer.errors import DataError
from sgms_observer.identification.recording import recordings_from_samples
from sgms_observer.observer.samples import Samples

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
    wanted = [axis] if other is None else [axis, other]
    blocks: dict[str, list[Samples]] = {name: [] for name in wanted}
    for name, samples in BagSamples(path, wanted):
        blocks[name].append(samples)
    label = Path(path).name
    pieces = recordings_from_samples(_joined(blocks[axis], label), label)
    second = None
    if other is not None and blocks[other]:
        second = _joined(blocks[other], label)
    records = []
    for piece in pieces:
        mate = None
        if second is not None:
            seconds = piece.start + piece.period * np.arange(len(piece))
            good = np.isfinite(second.position)
            mate = np.interp(seconds, second.stamp_ns[good] * 1e-9, second.position[good])
        records.append(Record(piece.name, piece.period, piece.position, piece.effort, mate))
    return tuple(records)


def _joined(blocks: Sequence[Samples], label: str) -> Samples:
    """Return one block of all samples."""
    if not blocks:
        raise DataError(f"{label} holds no samples of this axis; check its topics position and control_effort")
    return Samples(
        *(np.concatenate([getattr(block, name) for block in blocks]) for name in Samples.__dataclass_fields__)
    )
