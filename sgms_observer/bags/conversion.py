"""Turns a log's columns into a recording: one axis's position, effort and reference at the log's times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.columns import Log, open_log
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import RecordingError

Floats = NDArray[np.float64]

KEYS = ("time", "position", "control_effort", "reference")
_NEEDED = KEYS[:2]
_FIRST_STAMP = 1.0  # s; earlier times are moved here, for a stamp of 0 means "no stamp" in ROS
_ROWS_AT_ONCE = 16_384


@dataclass(frozen=True)
class Table:
    """Samples of one axis.

    Attributes:
        stamp_ns: sample times [ns], shape (n,), increasing.
        position: [m] or [rad], shape (n,).
        control_effort: [N] or [N m], shape (n,), or None.
        reference: set-point [m] or [rad], shape (n,), or None.
        reference_velocity: derivative of the set-point [m/s], shape (n,), or None.
        notices: sentences about what was done or looks odd.
    """

    stamp_ns: NDArray[np.int64]
    position: Floats
    control_effort: Floats | None
    reference: Floats | None
    reference_velocity: Floats | None
    notices: tuple[str, ...]


def parse_map(items: Sequence[str]) -> dict[str, str]:
    """Parse what says which column is what.

    Args:
        items: ``KEY=COLUMN[*FACTOR]`` each.

    Returns:
        Key to ``COLUMN[*FACTOR]``.

    Raises:
        RecordingError: an item is malformed, unknown or repeated, or a needed one is missing.
    """
    found: dict[str, str] = {}
    for item in items:
        key, sign, column = item.partition("=")
        key, column = key.strip(), column.strip()
        if not sign or not column:
            raise RecordingError(f"--map {item} has no column; write KEY=COLUMN or KEY=COLUMN*FACTOR")
        if key not in KEYS:
            raise RecordingError(f"--map {item}: {key} is none of {', '.join(KEYS)}; use one of these")
        if key in found:
            raise RecordingError(f"--map gives {key} twice; give it once")
        found[key] = column
    missing = [key for key in _NEEDED if key not in found]
    if missing:
        raise RecordingError(f"--map lacks {' and '.join(missing)}; add {missing[0]}=COLUMN")
    return found


def read_table(path: Path, columns: Mapping[str, str]) -> Table:
    """Read the mapped columns of a log.

    Args:
        path: CSV or MAT file.
        columns: key to ``COLUMN[*FACTOR]``, a factor being a number or a single number in the file.

    Raises:
        RecordingError: a column is missing, has another length, or the times do not increase.
    """
    log = open_log(path)
    values = {key: _evaluate(path, log, column) for key, column in columns.items()}
    time = values["time"]
    for key, column in values.items():
        if column.size != time.size:
            raise RecordingError(
                f"{path}: {key} ({columns[key]}) has {column.size} entries, time ({columns['time']}) {time.size};"
                " map columns of the same length"
            )
    if time.size < 2:
        raise RecordingError(f"{path} has {time.size} sample in {columns['time']}; two are needed at least")
    _check_times(path, columns["time"], time)
    notices = []
    for key in ("position", "control_effort", "reference"):
        bad = int(np.count_nonzero(~np.isfinite(values[key]))) if key in values else 0
        if bad:
            notices.append(
                f"{bad} of {time.size} entries of {key} are NaN or infinite; the observer will leave them out"
            )
    if time[0] < _FIRST_STAMP:
        shift = _FIRST_STAMP - float(time[0])
        notices.append(
            f"the times were moved by {shift:.9g} s: the first stamp is {_FIRST_STAMP:g} s, for 0 means none"
        )
        time = time + shift
    if time[-1] >= 2**31:
        raise RecordingError(
            f"{path}: the last time is {time[-1]:.6g} s, beyond what a ROS stamp holds; give seconds with"
            f" time={columns['time']}*FACTOR"
        )
    steps = np.diff(time)
    period = float(np.median(steps))
    if not 1e-6 <= period <= 0.1:
        notices.append(
            f"the samples are {period:.3g} s apart; if the times are not in seconds, give time={columns['time']}*FACTOR"
        )
    gaps = int(np.count_nonzero(steps > 1.5 * period))
    if gaps:
        notices.append(
            f"{gaps} steps of the time are longer than the usual {period:.6g} s, the longest {steps.max():.3g} s"
        )
    stamps = np.round(time * 1e9).astype(np.int64)
    if np.any(np.diff(stamps) <= 0):
        raise RecordingError(f"{path}: times in {columns['time']} are closer than 1 ns; give seconds with *FACTOR")
    reference = values.get("reference")
    velocity = None if reference is None else np.gradient(reference, time)
    return Table(stamps, values["position"], values.get("control_effort"), reference, velocity, tuple(notices))


def write_table(table: Table, out: str | Path, axis: str, storage: str = "mcap") -> None:
    """Write samples as a bag with the topics ``position``, ``control_effort`` and ``reference``.

    Args:
        table: the samples.
        out: the bag's folder; must not exist.
        axis: entry of ``name``.
        storage: ``mcap`` or ``sqlite3``.

    Raises:
        RecordingError: the bag cannot be written.
    """
    with BagWriter(out, storage) as writer:
        for first in range(0, table.stamp_ns.size, _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            stamps = table.stamp_ns[rows]
            writer.write_joint_states("position", stamps, (axis,), position=table.position[rows])
            if table.control_effort is not None:
                writer.write_joint_states("control_effort", stamps, (axis,), effort=table.control_effort[rows])
            if table.reference is not None and table.reference_velocity is not None:
                position, velocity = table.reference[rows], table.reference_velocity[rows]
                writer.write_joint_states("reference", stamps, (axis,), position=position, velocity=velocity)


def _evaluate(path: Path, log: Log, expression: str) -> Floats:
    """Return a column times its factors."""
    parts = [part.strip() for part in expression.split("*")]
    # A name may hold a star itself: the longest name that is there is meant.
    used = next((n for n in range(len(parts), 0, -1) if "*".join(parts[:n]) in log.names), 0)
    if used == 0:
        held = ", ".join(log.names[:40]) or "none"
        raise RecordingError(f"{path} has no column {parts[0]}; it has {held}")
    values = log.column("*".join(parts[:used]))
    for factor in parts[used:]:
        values = values * _factor(path, log, factor)
    return values


def _factor(path: Path, log: Log, factor: str) -> float:
    try:
        number = float(factor)
    except ValueError:
        if factor not in log.names:
            raise RecordingError(
                f"{path} has no factor {factor}; give a number or a single number of the file"
            ) from None
        values = log.column(factor)
        if values.size != 1:
            raise RecordingError(
                f"{path}: the factor {factor} has {values.size} entries; only a single number can be one"
            ) from None
        number = float(values[0])
    if not np.isfinite(number) or number == 0.0:
        raise RecordingError(f"{path}: the factor {factor} is {number}; give a finite number other than zero")
    return number


def _check_times(path: Path, name: str, time: Floats) -> None:
    """Raise unless the times are finite and increase."""
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise RecordingError(f"{path}: time {name} is not finite in sample {bad[0] + 1}; remove that sample")
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        i = int(back[0])
        raise RecordingError(
            f"{path}: time {name} must increase, but sample {i + 2} ({time[i + 1]:.9g} s) does not follow sample"
            f" {i + 1} ({time[i]:.9g} s), {back.size} such steps in all; sort or clean the log"
        )
