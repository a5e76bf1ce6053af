"""References in a CSV file of times, positions and velocities: written here, read here."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from sgms_observer.errors import ConfigurationError
from sgms_observer.whole_file import write_text
from sim_plant.piecewise_motion import PiecewiseCubic, s_curve

Floats = NDArray[np.float64]


def write_reference_file(path: str | Path, time: Floats, position: Floats, velocity: Floats) -> None:
    """Write a reference as CSV; the simulated stage reads it as ``reference.kind: file``.

    Args:
        path: the file.
        time: of the samples [s], shape (n,).
        position: set-point [m; rad], shape (n,).
        velocity: of the set-point [m/s; rad/s], shape (n,).

    Raises:
        RecordingError: the file cannot be written.
    """
    rows = zip(time, position, velocity, strict=True)
    lines = [f"{at:.9g},{place:.12f},{speed:.9g}" for at, place, speed in rows]
    write_text("\n".join(["time,position,velocity", *lines]) + "\n", path)


def read_reference_file(
    path: Path, interpolation: str, *, velocity: float, acceleration: float, jerk: float
) -> PiecewiseCubic:
    """Read a reference from a CSV file; it repeats when it ends.

    A file that ends elsewhere than it began is followed by a jerk-limited move back to its first position. A cubic
    interpolation starts and ends at rest, or continues smoothly where the file ends as it began.

    Args:
        path: CSV with the columns time [s] and position [m], in this order; one line of titles and lines that start
            with # are allowed.
        interpolation: ``linear`` or ``cubic`` between the points.
        velocity: largest velocity of the move back [m/s].
        acceleration: largest acceleration of the move back [m/s^2].
        jerk: largest jerk of the move back [m/s^3].

    Returns:
        The motion, its time counted from the file's first row.

    Raises:
        ConfigurationError: if the file is missing, is no such table, or its times do not increase.
    """
    time, position = _read_columns(path)
    return through_points(time, position, interpolation, velocity=velocity, acceleration=acceleration, jerk=jerk)


def through_points(
    time: Floats, position: Floats, interpolation: str, *, velocity: float, acceleration: float, jerk: float
) -> PiecewiseCubic:
    """Return a motion through points, which repeats when it ends; see ``read_reference_file``.

    Args:
        time: of the points, increasing [s], shape (n,).
        position: at these times [m], shape (n,).
        interpolation: ``linear`` or ``cubic`` between the points.
        velocity, acceleration, jerk: largest ones of the move back [m/s, m/s^2, m/s^3].
    """
    time = time - time[0]
    gap = position[0] - position[-1]
    if interpolation == "linear":
        pieces = np.zeros((len(time) - 1, 4))
        pieces[:, 0] = position[:-1]
        pieces[:, 1] = np.diff(position) / np.diff(time)
    else:
        spline = CubicSpline(time, position, bc_type="clamped" if gap else "periodic")
        pieces = (spline.c[::-1] * np.array([[1.0], [1.0], [2.0], [6.0]])).T
    if gap:
        durations, back = s_curve(position[-1], gap, velocity, acceleration, jerk)
        kept = durations > 0.0
        time = np.concatenate([time, time[-1] + np.cumsum(durations[kept])])
        pieces = np.concatenate([pieces, back[kept]])
    return PiecewiseCubic(time, np.ascontiguousarray(pieces))


def _read_columns(path: Path) -> tuple[Floats, Floats]:
    """Return the times and positions of a file with at least two good rows."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(
            [
                f"stage.reference.file: {path} cannot be read ({error}); sgms excite writes such a file, and a relative"
                " path starts at the folder of the parameter file"
            ]
        ) from error
    rows: list[tuple[float, float]] = []
    titles_allowed = True
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells = line.replace(";", ",").split(",")
        try:
            row = float(cells[0]), float(cells[1])
        except (ValueError, IndexError):
            if titles_allowed:
                titles_allowed = False
                continue
            raise ConfigurationError(
                [f"{path}, line {number}: expected time [s] and position separated by a comma, got {line[:60]!r}"]
            ) from None
        titles_allowed = False
        if not np.isfinite(row).all():
            raise ConfigurationError([f"{path}, line {number}: {line[:60]!r} is not finite; remove the row"])
        if rows and row[0] <= rows[-1][0]:
            raise ConfigurationError(
                [f"{path}, line {number}: time {row[0]} s does not come after {rows[-1][0]} s; sort the rows by time"]
            )
        rows.append(row)
    if len(rows) < 2:
        raise ConfigurationError([f"{path} has {len(rows)} rows of time and position; a reference needs at least two"])
    table = np.array(rows)
    return table[:, 0], table[:, 1]
