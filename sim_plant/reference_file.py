"""Reads and writes references as CSV files of times, positions and velocities."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import ConfigurationError
from sgms_observer.whole_file import write_text

_JERK_SIGNS = np.array([1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0])


@dataclass(frozen=True)
class PiecewiseCubic:
    """Position over time as cubic pieces that repeat after the last knot.

    Attributes:
        knots: start of each piece and, last, the end of the period [s], increasing from 0, shape (n + 1,).
        coefficients: position, velocity, acceleration and jerk at the start of each piece
            [m, m/s, m/s^2, m/s^3], shape (n, 4).
    """

    knots: Floats
    coefficients: Floats

    @property
    def period(self) -> float:
        """Return the time after which the motion repeats [s]."""
        return float(self.knots[-1])

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion.

        Args:
            time: times [s], from 0 on, shape (n,).

        Returns:
            Position [m], velocity [m/s] and acceleration [m/s^2], each of shape (n,).
        """
        phase = np.mod(time, self.period)
        piece = np.clip(np.searchsorted(self.knots, phase, side="right") - 1, 0, len(self.coefficients) - 1)
        since = phase - self.knots[piece]
        start, rate, curvature, jerk = self.coefficients[piece].T
        position = start + since * (rate + since * (curvature / 2.0 + since * jerk / 6.0))
        velocity = rate + since * (curvature + since * jerk / 2.0)
        return position, velocity, curvature + since * jerk


def _from_jerks(start: float, durations: Floats, jerks: Floats) -> tuple[Floats, float]:
    """Integrate constant jerks from rest; return the coefficients of ``PiecewiseCubic`` and the last position [m]."""
    rows = np.zeros((len(durations), 4))
    position, velocity, acceleration = start, 0.0, 0.0
    for i, (duration, jerk) in enumerate(zip(durations, jerks, strict=True)):
        rows[i] = position, velocity, acceleration, jerk
        position += duration * (velocity + duration * (acceleration / 2.0 + duration * jerk / 6.0))
        velocity += duration * (acceleration + duration * jerk / 2.0)
        acceleration += duration * jerk
    return rows, position


def _s_curve_durations(stroke: float, velocity: float, acceleration: float, jerk: float) -> Floats:
    """Return the lengths of the seven pieces of the fastest jerk-limited move [s]: jerk +, 0, -, 0, -, 0, +.

    Pieces that do not fit into a short move are 0.

    Source: the double-S profile; L. Biagiotti and C. Melchiorri, Trajectory Planning for Automatic Machines and
        Robots, Springer 2008, section 3.4, for equal limits in both directions and rest at both ends.
    """
    reaches_acceleration = velocity * jerk >= acceleration**2
    ramp = acceleration / jerk if reaches_acceleration else np.sqrt(velocity / jerk)
    rise = velocity / acceleration + ramp if reaches_acceleration else 2.0 * ramp
    cruise = stroke / velocity - rise
    if cruise < 0.0:
        cruise = 0.0
        if reaches_acceleration and stroke >= 2.0 * acceleration**3 / jerk**2:
            rise = ramp / 2.0 + np.sqrt((ramp / 2.0) ** 2 + stroke / acceleration)
        else:
            ramp = np.cbrt(stroke / (2.0 * jerk))
            rise = 2.0 * ramp
    hold = max(rise - 2.0 * ramp, 0.0)
    return np.array([ramp, hold, ramp, cruise, ramp, hold, ramp])


def _s_curve(start: float, stroke: float, velocity: float, acceleration: float, jerk: float) -> tuple[Floats, Floats]:
    """Return a move from rest to rest: durations of its seven pieces [s] and coefficients as in ``PiecewiseCubic``."""
    durations = _s_curve_durations(abs(stroke), velocity, acceleration, jerk)
    coefficients, _ = _from_jerks(start, durations, np.copysign(jerk, stroke) * _JERK_SIGNS)
    return durations, coefficients


def back_and_forth(stroke: float, velocity: float, acceleration: float, jerk: float, dwell: float) -> PiecewiseCubic:
    """Return rest, a move by ``stroke``, rest, the move back, and so on.

    Args:
        stroke: signed distance [m].
        velocity: largest velocity [m/s].
        acceleration: largest acceleration [m/s^2].
        jerk: largest jerk [m/s^3].
        dwell: rest at each end [s].
    """
    durations, out = _s_curve(0.0, stroke, velocity, acceleration, jerk)
    _, back = _s_curve(stroke, -stroke, velocity, acceleration, jerk)
    rest = np.zeros((1, 4))
    rest_there = np.array([[stroke, 0.0, 0.0, 0.0]])
    lengths = np.concatenate([[dwell], durations, [dwell], durations])
    return _join(lengths, np.concatenate([rest, out, rest_there, back]))


def _join(durations: Floats, coefficients: Floats) -> PiecewiseCubic:
    """Chain pieces into a periodic motion, leaving out those without length."""
    has_length = durations > 0.0
    knots = np.concatenate([[0.0], np.cumsum(durations[has_length])])
    return PiecewiseCubic(knots, coefficients[has_length])


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

    If the last position differs from the first, a jerk-limited move back to the first position is added. A cubic
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
        ConfigurationError: if the file is missing or not such a table, or its times do not increase.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(
            [
                f"stage.reference.file = {path} cannot be read ({error}); check the path, which starts at the folder of"
                " the parameter file; sgms excite writes such a file"
            ]
        ) from error
    time, position = points_from(text, path)
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
        from scipy.interpolate import CubicSpline  # takes longer to load than all the rest of a stage

        spline = CubicSpline(time, position, bc_type="clamped" if gap else "periodic")
        pieces = (spline.c[::-1] * np.array([[1.0], [1.0], [2.0], [6.0]])).T
    if gap:
        durations, back = _s_curve(position[-1], gap, velocity, acceleration, jerk)
        has_length = durations > 0.0
        time = np.concatenate([time, time[-1] + np.cumsum(durations[has_length])])
        pieces = np.concatenate([pieces, back[has_length]])
    return PiecewiseCubic(time, np.ascontiguousarray(pieces))


def points_from(text: str, path: Path) -> tuple[Floats, Floats]:
    """Return the times [s] and positions [m] of a CSV, at least two of each; the times increase.

    Args:
        text: content of the file, as ``read_reference_file`` describes it.
        path: the file, for the sentence.

    Raises:
        ConfigurationError: it is not such a table, or its times do not increase.
    """
    rows: list[tuple[float, float]] = []
    titles_allowed = True
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells = [cell.strip() for cell in line.replace(";", ",").split(",")[:2]]
        row = [value for value in map(_number, cells) if value is not None]
        if len(row) < 2 and titles_allowed:
            titles_allowed = False
            continue
        titles_allowed = False
        if len(row) < 2:
            wrong = [cell[:60] for cell in cells if _number(cell) is None]
            raise ConfigurationError(
                [
                    f"{path}, line {number}: {wrong[0]!r} is not a number; correct or remove the line"
                    if wrong
                    else f"{path}, line {number}: the position is missing; write time [s] and position with a comma"
                    " between them"
                ]
            )
        if ";" in line and "," in line:
            raise ConfigurationError(
                [f"{path}, line {number}: {line[:60]!r} has semicolons and commas; write numbers with a decimal point"]
            )
        if not np.isfinite(row).all():
            raise ConfigurationError(
                [f"{path}, line {number}: {line[:60]!r} is not finite; correct or remove the line"]
            )
        time, position = row
        if rows and time <= rows[-1][0]:
            raise ConfigurationError(
                [f"{path}, line {number}: time {time} s does not come after {rows[-1][0]} s; sort the lines by time"]
            )
        rows.append((time, position))
    if len(rows) < 2:
        raise ConfigurationError(
            [f"{path} has {len(rows)} lines of time and position, and a reference needs at least two; add lines"]
        )
    table = np.array(rows)
    return table[:, 0], table[:, 1]


def _number(cell: str) -> float | None:
    """Return a cell as a number, None where it is not one."""
    try:
        return float(cell)
    except ValueError:
        return None
