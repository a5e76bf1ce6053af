"""Rough mass, friction, offset and gravity of an axis: least squares on its force balance at low frequencies.

The values are good enough for the start of an identification, for the sign of the effort, and for a check of a
recording.
``effort = mass a + viscous v + Coulomb h(x) + offset + A sin q + B cos q``; position and effort are filtered alike.
``h`` is the direction of the motion. After a reversal it changes its sign over twice the slip deflection: presliding. A
fit without presliding would count the late friction of a short motion as a force against the acceleration.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.motion import play_operator
from sgms_observer.identification.confidence import least_squares_covariance
from sgms_observer.offline.band import choose_band
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

MIN_Z_SCORE = 3.0
"""Smallest z-score of a value whose sign is used."""
_MAX_UNEXPLAINED = 0.9
"""Largest unexplained share of the effort about its mean for which its sign is used."""
_MAX_CORNER = 20.0
"""Highest corner [Hz]: friction and mass of a moving axis act below it, resonances above."""
_ROWS_PER_CORNER = 4.0  # rows per second over the corner frequency
_MIN_TURN = 0.1
"""Smallest range [rad] over which sin q and cos q differ from a constant and a slope."""
_MAX_CONDITION = 1.0e4
"""Largest condition number of the scaled columns; above it the recording does not separate them."""
_DEFLECTIONS = tuple(0.25 * 2.0 ** (-0.5 * k) for k in range(17))
"""Candidates of the slip deflection, as shares of half the range: from a quarter to a thousandth."""
_COARSE = 4
"""Step in the candidates where models are compared that differ in gravity."""
_MIN_DEFLECTION_STEPS = 2.0
"""Smallest slip deflection in encoder steps and in standard deviations of the position noise."""
_MAX_GRAVITY = 2.0
"""Largest ratio of gravity and offset to the largest effort; above it they cancel each other over a short arc."""


@dataclass(frozen=True)
class ForceBalance:
    """Rough values of an axis.

    Attributes:
        corner: frequencies below it were used [Hz].
        names: fitted values: mass, viscous_coefficient, coulomb_force, offset, and gravity_sin, gravity_cos.
        values: SI units, shape (k,).
        covariance: squared SI units, shape (k, k).
        unexplained: rms residual over rms effort about its mean [-]: a constant load explains nothing.
        residual: rms of the effort that is unexplained [N or N m].
        dissipation: mean power that viscous and Coulomb friction dissipate [W].
        dissipation_error: its standard error [W].
        slip_deflection: travel after a reversal over which half the friction reverses [m or rad]; 0 where none is
            found.
        is_mass_negative: the mass is significantly negative, also if a stiffness is fitted with it (a stiffness looks
            like a negative mass where the motion has one frequency only).
    """

    corner: float
    names: tuple[str, ...]
    values: Floats
    covariance: Floats
    unexplained: float
    residual: float
    dissipation: float
    dissipation_error: float
    slip_deflection: float
    is_mass_negative: bool

    def value(self, name: str) -> float:
        """Return one value [SI unit], 0 if it was not fitted."""
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0

    def std_error(self, name: str) -> float:
        """Return the standard error of one value [SI unit], 0 if it was not fitted."""
        if name not in self.names:
            return 0.0
        i = self.names.index(name)
        return math.sqrt(max(float(self.covariance[i, i]), 0.0))

    def is_significant(self, name: str) -> bool:
        """Return whether a value differs significantly from zero."""
        return abs(self.value(name)) > MIN_Z_SCORE * self.std_error(name)

    @property
    def sign(self) -> int:
        """Return 1 if the effort moves the axis, -1 if it is reversed, 0 if neither is significant.

        Friction dissipates power and the mass is positive; both are tested.
        """
        if self.unexplained > _MAX_UNEXPLAINED or abs(self.dissipation) <= MIN_Z_SCORE * self.dissipation_error:
            return 0
        is_reversed = self.dissipation < 0.0
        if is_reversed and self.is_significant("mass") and self.value("mass") > 0.0:
            return 0
        return -1 if is_reversed else 1

    def as_json(self) -> dict[str, object]:
        """Return the values with their errors for ``--json``."""
        return {
            "corner_hz": self.corner,
            "unexplained": self.unexplained,
            "slip_deflection": self.slip_deflection,
            **{name: {"value": self.value(name), "std_error": self.std_error(name)} for name in self.names},
        }


def fit_force_balance(recordings: Sequence[Recording], axis: AxisSettings, has_gravity: bool) -> ForceBalance | None:
    """Fit the force balance.

    Args:
        recordings: evenly sampled pieces of one axis.
        axis: its settings, for the choice of the band.
        has_gravity: fit ``sin q`` and ``cos q`` as well.

    Returns:
        The rough values, or None if the recordings do not move.
    """
    rate = min(1.0 / recording.period for recording in recordings)
    corner = min(_MAX_CORNER, choose_band(recordings, axis).corner, 0.2 * rate)
    low = [_LowPassed(recording, corner) for recording in recordings]
    turn = max(float(np.ptp(recording.position)) for recording in recordings)
    names: tuple[str, ...] = ("mass", "viscous_coefficient", "coulomb_force", "offset")
    if has_gravity and turn > _MIN_TURN:
        names += ("gravity_sin", "gravity_cos")
    effort = np.concatenate([one.effort for one in low])
    deflection, values = _slip_deflection(low, len(names), effort)
    if len(names) > 4 and (values is None or _cancels(values, effort)):
        names = names[:4]
        deflection, values = _slip_deflection(low, len(names), effort)
    if values is None:
        return None
    width = len(names)
    columns = [one.columns(deflection)[:, :width] for one in low]
    residuals = [one.effort - part @ values for one, part in zip(low, columns, strict=True)]
    # The data chose the slip deflection too, which adds to the uncertainty of the other values.
    nearby = deflection * 2.0**0.25 if deflection > 0.0 else max(_smallest_deflection(one) for one in low)
    changes = [values[2] * (one.columns(nearby)[:, 2] - part[:, 2]) for one, part in zip(low, columns, strict=True)]
    with_deflection = [np.column_stack([part, change]) for part, change in zip(columns, changes, strict=True)]
    covariance = least_squares_covariance(with_deflection, residuals)[:width, :width]
    variation = float(np.linalg.norm(effort - np.mean(effort)))
    unexplained = float(np.linalg.norm(np.concatenate(residuals))) / variation if variation > 0.0 else 1.0
    matrix = np.concatenate(columns)
    velocity = matrix[:, 1]
    weights = np.zeros(width)
    weights[1:3] = float(np.mean(velocity**2)), float(np.mean(matrix[:, 2] * velocity))
    is_observable = np.isfinite(np.diag(covariance))
    variance = float(weights[is_observable] @ covariance[np.ix_(is_observable, is_observable)] @ weights[is_observable])
    error = math.sqrt(max(variance, 0.0)) if np.all(is_observable[1:3]) else math.inf
    with_stiffness = [np.column_stack([part, one.position]) for one, part in zip(low, columns, strict=True)]
    residual = float(np.sqrt(np.mean(np.square(np.concatenate(residuals)))))
    is_negative = bool(values[0] < 0.0 and _is_mass_negative(with_stiffness, [one.effort for one in low]))
    return ForceBalance(corner, names, values, covariance, unexplained, residual, float(weights @ values), error,
                        deflection, is_negative)  # fmt: skip


def _slip_deflection(low: Sequence[_LowPassed], width: int, effort: Floats) -> tuple[float, Floats | None]:
    """Return the slip deflection that explains most of the effort (0 for none), and the other values for it."""
    largest = max(0.5 * float(np.ptp(one.path)) for one in low)
    smallest = max(_smallest_deflection(one) for one in low)
    tried = [0.0, *(share * largest for share in _DEFLECTIONS if share * largest >= smallest)]
    best: tuple[float, float, Floats | None] = (math.inf, 0.0, None)
    for deflection in tried:
        matrix = np.concatenate([one.columns(deflection)[:, :width] for one in low])
        values = _solve(matrix, effort)
        if values is not None:
            error = float(np.linalg.norm(effort - matrix @ values))
            best = min(best, (error, deflection, values), key=lambda found: found[0])
    return best[1], best[2]


def _smallest_deflection(one: _LowPassed) -> float:
    """Return the smallest slip deflection that a recording can show [m or rad]."""
    recording = one.recording
    shown = _MIN_DEFLECTION_STEPS * max(recording.encoder_step, recording.position_noise)
    return float(max(shown, _DEFLECTIONS[-1] * 0.5 * float(np.ptp(one.path))))


def _is_mass_negative(columns: Sequence[Floats], efforts: Sequence[Floats]) -> bool:
    """Return whether the first value, the mass, is significantly negative."""
    values = _solve(np.concatenate(columns), np.concatenate(efforts))
    if values is None:
        return False
    residuals = [effort - part @ values for effort, part in zip(efforts, columns, strict=True)]
    variance = float(least_squares_covariance(columns, residuals)[0, 0])
    return bool(values[0] < -MIN_Z_SCORE * math.sqrt(max(variance, 0.0)))


def _solve(matrix: Floats, effort: Floats) -> Floats | None:
    """Return the least-squares values, shape (k,), or None where the motion does not separate the columns."""
    scale = np.linalg.norm(matrix, axis=0)
    if not np.all(scale > 0.0) or len(matrix) < 4 * len(scale) or not np.any(effort):
        return None
    if not np.linalg.cond(matrix / scale) < _MAX_CONDITION:
        return None
    return np.asarray(np.linalg.lstsq(matrix / scale, effort, rcond=None)[0] / scale)


def _cancels(values: Floats, effort: Floats) -> bool:
    """Return whether offset and gravity are larger than any effort, so that the motion shows their difference only."""
    largest = _MAX_GRAVITY * float(np.max(np.abs(effort)))
    return max(abs(float(values[3])), math.hypot(values[4], values[5])) > largest


def rigid_rows(recordings: Sequence[Recording], balance: ForceBalance) -> tuple[list[Floats], Floats, Floats]:
    """Return the rows of a force balance without gravity: columns for several slip deflections, position and effort.

    Args:
        recordings: the pieces that the balance was fitted to.
        balance: gives the band and one of the slip deflections.

    Returns:
        Acceleration, velocity, direction and 1 for each slip deflection, shape (n, 4); position [m or rad] and effort
        [N or N m], shape (n,).
    """
    low = [_LowPassed(recording, balance.corner) for recording in recordings]
    largest = max(0.5 * float(np.ptp(one.path)) for one in low)
    tried = (0.0, balance.slip_deflection, *(share * largest for share in _DEFLECTIONS[::_COARSE]))
    columns = [np.concatenate([one.columns(deflection)[:, :4] for one in low]) for deflection in tried]
    return columns, np.concatenate([one.angle for one in low]), np.concatenate([one.effort for one in low])


class _LowPassed:
    """One piece after the low-pass: its effort and the columns of the force balance, decimated.

    Args:
        recording: the piece.
        corner: of the low-pass [Hz].
    """

    def __init__(self, recording: Recording, corner: float) -> None:
        self.recording = recording
        rate = 1.0 / recording.period
        self._sections = signal.butter(4, 2.0 * corner / rate, output="sos")
        count = len(recording.position)
        border = min(int(rate / corner), count // 10)  # the filters settle here
        self._rows = slice(border, count - border, max(1, int(rate / (_ROWS_PER_CORNER * corner))))
        self.path = self._low(recording.position)
        velocity = np.gradient(self.path, recording.period)
        noise = 2.0 * math.pi * corner * recording.position_noise  # of the velocity: below it the direction is unknown
        columns = [np.gradient(velocity, recording.period), velocity,
                   self._low(velocity / np.sqrt(velocity**2 + noise**2 + 1e-300)), np.ones(count),
                   np.sin(self.path), np.cos(self.path)]  # fmt: skip
        self._columns = np.column_stack(columns)[self._rows]
        self.angle = self.path[self._rows]
        self.position = self.angle - float(np.mean(self.path))
        self.effort = self._low(recording.effort)[self._rows]

    def columns(self, slip_deflection: float) -> Floats:
        """Return acceleration, velocity, direction, 1, sine and cosine of the position, shape (n, 6).

        Args:
            slip_deflection: travel over which half the direction reverses after a reversal [m or rad]; 0 for none.
        """
        if not slip_deflection > 0.0:
            return self._columns
        stretched = self.path - play_operator(self.path, slip_deflection)
        columns = self._columns.copy()
        columns[:, 2] = self._low(stretched / slip_deflection)[self._rows]
        return columns

    def _low(self, values: Floats) -> Floats:
        pad = min(3 * len(self._sections) * 2, len(values) - 1)
        return np.ascontiguousarray(signal.sosfiltfilt(self._sections, values, padlen=pad))
