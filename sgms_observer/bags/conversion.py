"""Turns a log's columns into a recording: one axis's position, effort and reference at the log's times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.combination import Combination
from sgms_observer.bags.mat_log import MatLog
from sgms_observer.bags.text_log import TextLog
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import RecordingError

KEYS = ("time", "position", "control_effort", "reference")
_NEEDED = KEYS[:2]
_FIRST_STAMP = 1.0  # s; earlier times are moved here, for a stamp of 0 means "no stamp" in ROS
_ROWS_AT_ONCE = 16_384
_MOST_DUPLICATES = 0.5
"""Share of the samples that may repeat a stamp; above it the times are coarser than the samples."""


@dataclass(frozen=True)
class Table:
    """Samples of one axis.

    Attributes:
        stamp_ns: sample times [ns], shape (n,), increasing.
        position: [m] or [rad], shape (n,).
        control_effort: [N] or [N m], shape (n,), or None.
        reference: set-point [m] or [rad], shape (n,), or None.
        reference_velocity: derivative of the set-point [m/s] or [rad/s], shape (n,), or None.
        notices: sentences about changes and suspicious values; those that begin with ``Warning:`` are warnings.
    """

    stamp_ns: Ints
    position: Floats
    control_effort: Floats | None
    reference: Floats | None
    reference_velocity: Floats | None
    notices: tuple[str, ...]

    def rows(self, first: int, last: int) -> Table:
        """Return some of the samples.

        Args:
            first: number of the first one.
            last: number after the last one.
        """
        effort, reference, velocity = (
            None if values is None else values[first:last]
            for values in (self.control_effort, self.reference, self.reference_velocity)
        )
        return replace(
            self,
            stamp_ns=self.stamp_ns[first:last],
            position=self.position[first:last],
            control_effort=effort,
            reference=reference,
            reference_velocity=velocity,
        )


def open_log(path: Path) -> MatLog | TextLog:
    """Open a text or MAT file.

    Args:
        path: the file; everything that does not end in ``.mat`` is read as text.

    Raises:
        RecordingError: it cannot be read.
    """
    try:
        return MatLog(path) if path.suffix.lower() == ".mat" else TextLog(path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}; check the path") from None


def parse_map(items: Sequence[str], has_rate: bool = False) -> dict[str, str]:
    """Parse the assignment of columns.

    Args:
        items: ``KEY=COLUMN[*FACTOR]`` each, or a sum of such.
        has_rate: the sample rate is given, so that no time is needed.

    Returns:
        Key to the text after the sign.

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
    if has_rate and "time" in found:
        raise RecordingError("--rate and --map time=... are both given; give the rate only for a log without times")
    missing = [key for key in _NEEDED if key not in found and not (has_rate and key == "time")]
    if missing:
        no_time = ", or --rate HZ if the log has no times" if "time" in missing else ""
        raise RecordingError(f"--map lacks {' and '.join(missing)}; add {missing[0]}=COLUMN{no_time}")
    return found


def read_table(path: Path, columns: Mapping[str, str], rate: float | None = None) -> Table:
    """Read the mapped columns of a log.

    Args:
        path: text or MAT file.
        columns: key to a combination of columns, such as ``q1*10.69-q2*2``.
        rate: samples per second [Hz] of a log without times.

    Raises:
        RecordingError: a column is missing, has another length or no number, or the times step back.
    """
    log = open_log(path)
    wanted = {key: Combination(path, text, log.spellings, log.names) for key, text in columns.items()}
    held = log.columns(tuple(dict.fromkeys(name for one in wanted.values() for name in one.names)))
    values = {key: combination.value(held) for key, combination in wanted.items()}
    del held
    if "time" not in values:
        if rate is None or not 0.0 < rate < np.inf:
            raise RecordingError(f"--rate {rate} Hz must be above 0; give the samples per second of the log")
        values = {"time": np.arange(values["position"].size) / rate, **values}
    spelled = {"time": "--rate", **columns}
    for key, column in values.items():
        if column.size != values["time"].size:
            raise RecordingError(
                f"{path}: {key} ({spelled[key]}) has {column.size} entries, time ({spelled['time']})"
                f" {values['time'].size}; map columns of the same length"
            )
    if values["time"].size < 2:
        raise RecordingError(f"{path} has {values['time'].size} sample in {spelled['time']}; two are needed at least")
    values, notices = _ordered(path, spelled["time"], values)
    time = values["time"]
    for key in ("position", "control_effort", "reference"):
        bad = int(np.count_nonzero(~np.isfinite(values[key]))) if key in values else 0
        if bad == time.size:
            raise RecordingError(f"{path}: column {spelled[key]} holds no number; check --map {key}")
        if bad:
            notices.append(
                f"Warning: {bad} of {time.size} entries of {key} are NaN or infinite; the observer will leave them out"
            )
    shift = max(0.0, _FIRST_STAMP - float(time[0]))
    if shift:
        notices.append(f"{shift:.9g} s was added to all times, because ROS reads a stamp of 0 as 'no stamp'")
    steps = np.diff(time)
    period = float(np.median(steps))
    if not 1e-6 <= period <= 0.1:
        notices.append(
            f"the samples are {period:.3g} s apart; if the times are not in seconds, give time={spelled['time']}*FACTOR"
        )
    gaps = int(np.count_nonzero(steps > 1.5 * period))
    if gaps:
        notices.append(
            f"{gaps} steps of the time are longer than the usual {period:.6g} s, the longest {steps.max():.3g} s"
        )
    reference = values.get("reference")
    velocity = None if reference is None else np.gradient(reference, time)
    stamps = np.round((time + shift) * 1e9).astype(np.int64)
    return Table(stamps, values["position"], values.get("control_effort"), reference, velocity, tuple(notices))


def choose_window(table: Table, start: float, end: float) -> Table:
    """Return the samples of a time window.

    Args:
        table: the samples.
        start: seconds from the first sample [s].
        end: seconds from the first sample [s]; infinite for the whole rest.

    Raises:
        RecordingError: a time is no number or negative, or fewer than two samples are in the window.
    """
    for name, value in (("from", start), ("to", end)):
        if not value >= 0.0:
            raise RecordingError(f"--{name} {value:g} s must not be negative; give seconds from the start of the log")
    seconds = (table.stamp_ns - table.stamp_ns[0]) * 1e-9
    first, last = np.searchsorted(seconds, [start, end], side="left")
    if last - first < 2:
        raise RecordingError(
            f"--from {start:g} s --to {end:g} s leaves {max(0, last - first)} samples of the log's {seconds[-1]:.6g} s;"
            " choose a window with at least two samples"
        )
    return table.rows(int(first), int(last))


def split_table(table: Table, share: float) -> tuple[Table, Table]:
    """Return the first part of the samples and the rest.

    Args:
        table: the samples.
        share: of the time that the first part takes, between 0 and 1 [-].

    Raises:
        RecordingError: a part would have fewer than two samples.
    """
    seconds = (table.stamp_ns - table.stamp_ns[0]) * 1e-9
    first = int(np.searchsorted(seconds, share * seconds[-1], side="left")) if 0.0 < share < 1.0 else 0
    if first < 2 or first > seconds.size - 2:
        raise RecordingError(
            f"--split {share:g} leaves a part with fewer than two of the {seconds.size} samples; give a share between"
            " 0 and 1, such as 0.6"
        )
    return table.rows(0, first), table.rows(first, seconds.size)


def write_table(
    table: Table, out: str | Path, axis: str, storage: str = "mcap", *, is_overwriting: bool = False
) -> None:
    """Write samples as a bag with the topics ``position``, ``control_effort`` and ``reference``.

    Args:
        table: the samples.
        out: the bag's folder.
        axis: entry of ``name``.
        storage: ``mcap`` or ``sqlite3``.
        is_overwriting: replace a bag that is there.

    Raises:
        RecordingError: the bag cannot be written.
    """
    with BagWriter(out, storage, is_overwriting=is_overwriting) as writer:
        for first in range(0, table.stamp_ns.size, _ROWS_AT_ONCE):
            rows = slice(first, first + _ROWS_AT_ONCE)
            stamps = table.stamp_ns[rows]
            # The reference first: a reader pairs position and effort as soon as it has both, and does not wait for the
            # first reference.
            if table.reference is not None and table.reference_velocity is not None:
                position, velocity = table.reference[rows], table.reference_velocity[rows]
                writer.write_joint_states("reference", stamps, (axis,), position=position, velocity=velocity)
            writer.write_joint_states("position", stamps, (axis,), position=table.position[rows])
            if table.control_effort is not None:
                writer.write_joint_states("control_effort", stamps, (axis,), effort=table.control_effort[rows])


def _ordered(path: Path, name: str, values: Mapping[str, Floats]) -> tuple[dict[str, Floats], list[str]]:
    """Return the values without repeated stamps, so that the times increase, and sentences about the changes.

    Raises:
        RecordingError: a time is not finite or beyond a ROS stamp, steps back, or is too coarse.
    """
    time = values["time"]
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise RecordingError(f"{path}: time {name} is not finite in sample {bad[0] + 1}; remove that sample")
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        i = int(back[0])
        raise RecordingError(
            f"{path}: time {name} must increase, but sample {i + 2} ({time[i + 1]:.9g} s) does not follow sample"
            f" {i + 1} ({time[i]:.9g} s), {back.size} such steps in all; sort or clean the log"
        )
    if time[-1] + max(0.0, _FIRST_STAMP - time[0]) >= 2**31:
        raise RecordingError(
            f"{path}: the last time is {time[-1]:.6g} s, beyond what a ROS stamp holds; give seconds with"
            f" time={name}*FACTOR"
        )
    stamps = np.round((time + max(0.0, _FIRST_STAMP - time[0])) * 1e9)
    is_new = np.concatenate(([True], np.diff(stamps) > 0.0))
    repeated = int(np.count_nonzero(~is_new))
    if not repeated:
        return dict(values), []
    if repeated > _MOST_DUPLICATES * time.size or repeated == time.size - 1:
        raise RecordingError(
            f"{path}: {repeated} of {time.size} samples repeat the time {name} of the sample before; give seconds with"
            f" time={name}*FACTOR, or --rate HZ instead of the time if it is coarser than the samples"
        )
    sentence = f"{repeated} of {time.size} samples repeat the stamp of the sample before; they were dropped"
    return {key: column[is_new] for key, column in values.items()}, [sentence]
