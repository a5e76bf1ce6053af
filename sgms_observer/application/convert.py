"""Converts a log to one or two bags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.bags.bag_folder import refuse_existing_bag
from sgms_observer.bags.conversion import Table, choose_window, parse_map, read_table, split_table, write_table
from sgms_observer.errors import RecordingError
from sgms_observer.observer.samples import Samples
from sgms_observer.offline.jumps import without_jumps

REST = "_rest"
"""End of the name of the second bag."""


@dataclass(frozen=True)
class ConvertOptions:
    """Options of a conversion.

    Attributes:
        rate: samples per second of a log without times [Hz]; None if it has times.
        start: samples before are left out, in seconds from the log's first [s]; None for none.
        end: samples from here on are left out, likewise [s]; None for none.
        split: share of the time that goes into the first bag; None for one bag.
        axis: entry of ``name``.
        storage: ``mcap`` or ``sqlite3``.
        is_overwriting: replace bags that are there.
    """

    rate: float | None = None
    start: float | None = None
    end: float | None = None
    split: float | None = None
    axis: str = "x"
    storage: str = "mcap"
    is_overwriting: bool = False


@dataclass(frozen=True)
class WrittenBag:
    """A bag that was written.

    Attributes:
        path: its folder.
        samples: number of its samples.
        duration: from the first sample to the last [s].
        rate: samples per second [Hz].
    """

    path: str
    samples: int
    duration: float
    rate: float


@dataclass(frozen=True)
class Converted:
    """Result of a conversion.

    Attributes:
        bags: the bags.
        topics: their topics.
        notices: sentences about changes and suspicious values; those that begin with ``Warning:`` are warnings.
    """

    bags: tuple[WrittenBag, ...]
    topics: tuple[str, ...]
    notices: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the result that ``--json`` prints."""
        bags = [
            {"path": bag.path, "samples": bag.samples, "duration_s": bag.duration, "rate_hz": bag.rate}
            for bag in self.bags
        ]
        return {"schema": 1, "bags": bags, "topics": list(self.topics), "notices": list(self.notices)}


def convert(path: Path, columns: Sequence[str], out: str, options: ConvertOptions) -> Converted:
    """Convert a log.

    Args:
        path: text or MAT file.
        columns: ``KEY=COLUMN[*FACTOR]`` each.
        out: folder of the bag; the second one of a split has ``_rest`` after this name.
        options: of the conversion.

    Raises:
        RecordingError: the log cannot be read, a bag would have no position, or a bag cannot be written.
    """
    targets = [out] if options.split is None else [out, f"{out.rstrip('/')}{REST}"]
    for target in targets:
        refuse_existing_bag(target, options.is_overwriting)
    table = read_table(path, parse_map(columns, options.rate is not None), options.rate)
    if options.start is not None or options.end is not None:
        end = float("inf") if options.end is None else options.end
        table = choose_window(table, options.start or 0.0, end)
    parts = (table,) if options.split is None else split_table(table, options.split)
    for part in parts:
        if not np.any(np.isfinite(part.position)):
            raise RecordingError(
                f"{path}: the positions of {part.stamp_ns.size} samples for one bag are all NaN or infinite; change"
                " --from, --to or --split"
            )
    for part, target in zip(parts, targets, strict=True):
        write_table(part, target, options.axis, options.storage, is_overwriting=options.is_overwriting)
    topics = ["position"]
    topics += ["control_effort"] if table.control_effort is not None else []
    topics += ["reference"] if table.reference is not None else []
    bags = tuple(_written(part, target) for part, target in zip(parts, targets, strict=True))
    return Converted(bags, tuple(topics), (*table.notices, *_jump_notices(table)))


def _jump_notices(table: Table) -> list[str]:
    """Return a sentence about jumps of the position, where there are any: the bag keeps them."""
    nothing = np.full(table.stamp_ns.size, np.nan)
    samples = Samples(table.stamp_ns, table.position, nothing, nothing, nothing)
    findings = without_jumps(samples, "", "m or rad").findings
    if not findings:
        return []
    return [
        f"{', and '.join(findings)}; the bag keeps the positions as they are: identify and diagnose unwrap them, leave"
        " out single ones, or cut the recording at a jump"
    ]


def _written(table: Table, path: str) -> WrittenBag:
    count = table.stamp_ns.size
    duration = float(table.stamp_ns[-1] - table.stamp_ns[0]) * 1e-9
    return WrittenBag(str(path), count, duration, (count - 1) / duration)
