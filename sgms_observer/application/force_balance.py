"""Rough mass, friction, offset and gravity of an axis: least squares on its force balance at low frequencies.

Good enough to start an identification from, to tell a reversed sign, and to see whether a recording shows anything.
``effort = mass a + viscous v + Coulomb sign(v) + offset + A sin q + B cos q``; position and effort are filtered alike.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from sgms_observer.identification.confidence import least_squares_covariance
from sgms_observer.offline.band import choose_band
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

Floats = NDArray[np.float64]

MIN_Z_SCORE = 3.0
"""Standard errors that a sign must differ from zero by."""
_MAX_UNEXPLAINED = 0.9
"""Share of the effort above which its sign is chance: the balance explains less than a tenth."""
_MAX_CORNER = 20.0
"""Highest corner [Hz]: friction and mass of a moving axis show below it, and resonances lie above."""
_ROWS_PER_CORNER = 4.0  # rows per second over the corner frequency
_MIN_TURN = 0.1
"""Smallest range [rad] over which sin q and cos q differ from a constant and a slope."""
_MAX_CONDITION = 1.0e4
"""Of the scaled columns; above it they are one column to this recording."""
_MAX_GRAVITY = 2.0
"""Gravity and offset over the largest effort: beyond it they cancel each other over a short arc."""


@dataclass(frozen=True)
class ForceBalance:
    """Rough values of an axis.

    Attributes:
        corner: frequencies below it were used [Hz].
        names: what was fitted: mass, viscous_coefficient, coulomb_force, offset, and gravity_sin, gravity_cos.
        values: SI units, shape (k,).
        covariance: squared SI units, shape (k, k).
        unexplained: rms residual over rms effort [-].
        dissipation: power that viscous and Coulomb friction take away, on average [W].
        dissipation_error: its standard error [W].
    """

    corner: float
    names: tuple[str, ...]
    values: Floats
    covariance: Floats
    unexplained: float
    dissipation: float
    dissipation_error: float

    def value(self, name: str) -> float:
        """Return one value [SI unit], 0 if it was not fitted.

        Args:
            name: an entry of ``names``.
        """
        return float(self.values[self.names.index(name)]) if name in self.names else 0.0

    def std_error(self, name: str) -> float:
        """Return the standard error of one value [SI unit], 0 if it was not fitted.

        Args:
            name: an entry of ``names``.
        """
        if name not in self.names:
            return 0.0
        i = self.names.index(name)
        return math.sqrt(max(float(self.covariance[i, i]), 0.0))

    def is_significant(self, name: str) -> bool:
        """Return whether a value differs surely from zero.

        Args:
            name: an entry of ``names``.
        """
        return abs(self.value(name)) > MIN_Z_SCORE * self.std_error(name)

    @property
    def sign(self) -> int:
        """Return 1 if the effort moves the axis, -1 if it is counted against the motion, 0 if that cannot be told.

        Friction takes power away from a machine, and its mass is positive: both decide.
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
    parts = [_columns(recording, corner) for recording in recordings]
    turn = max(float(np.ptp(recording.position)) for recording in recordings)
    names: tuple[str, ...] = ("mass", "viscous_coefficient", "coulomb_force", "offset")
    if has_gravity and turn > _MIN_TURN:
        names += ("gravity_sin", "gravity_cos")
    effort = np.concatenate([values for _, values in parts])
    values = _solve(np.concatenate([columns for columns, _ in parts])[:, : len(names)], effort)
    if len(names) > 4 and (values is None or _cancels(values, effort)):
        names = names[:4]
        values = _solve(np.concatenate([columns for columns, _ in parts])[:, : len(names)], effort)
    if values is None:
        return None
    width = len(names)
    matrix = np.concatenate([columns[:, :width] for columns, _ in parts])
    residuals = [part - columns[:, :width] @ values for columns, part in parts]
    covariance = least_squares_covariance([columns[:, :width] for columns, _ in parts], residuals)
    unexplained = float(np.linalg.norm(np.concatenate(residuals)) / np.linalg.norm(effort))
    velocity = matrix[:, 1]
    weights = np.zeros(width)
    weights[1:3] = float(np.mean(velocity**2)), float(np.mean(matrix[:, 2] * velocity))
    seen = np.isfinite(np.diag(covariance))
    variance = float(weights[seen] @ covariance[np.ix_(seen, seen)] @ weights[seen])
    error = math.sqrt(max(variance, 0.0)) if np.all(seen[1:3]) else math.inf
    return ForceBalance(corner, names, values, covariance, unexplained, float(weights @ values), error)


def _solve(matrix: Floats, effort: Floats) -> Floats | None:
    """Return the least-squares values, shape (k,), or None where the motion does not tell the columns apart."""
    scale = np.linalg.norm(matrix, axis=0)
    if not np.all(scale > 0.0) or len(matrix) < 4 * len(scale) or not np.any(effort):
        return None
    if not np.linalg.cond(matrix / scale) < _MAX_CONDITION:
        return None
    return np.asarray(np.linalg.lstsq(matrix / scale, effort, rcond=None)[0] / scale)


def _cancels(values: Floats, effort: Floats) -> bool:
    """Return whether offset and gravity are larger than any effort: the motion shows their difference only."""
    largest = _MAX_GRAVITY * float(np.max(np.abs(effort)))
    return max(abs(float(values[3])), math.hypot(values[4], values[5])) > largest


def _columns(recording: Recording, corner: float) -> tuple[Floats, Floats]:
    """Return the columns of the force balance and the effort of one piece, filtered alike and thinned out."""
    rate = 1.0 / recording.period
    sections = signal.butter(4, 2.0 * corner / rate, output="sos")

    def low(values: Floats) -> Floats:
        return np.asarray(signal.sosfiltfilt(sections, values, padlen=min(3 * len(sections) * 2, len(values) - 1)))

    position = low(recording.position)
    velocity = np.gradient(position, recording.period)
    noise = 2.0 * math.pi * corner * recording.position_noise  # of the velocity: below it the direction is not known
    direction = low(velocity / np.sqrt(velocity**2 + noise**2 + 1e-300))
    columns = [np.gradient(velocity, recording.period), velocity, direction, np.ones(len(position))]
    columns += [np.sin(position), np.cos(position)]
    border = min(int(rate / corner), len(position) // 10)  # where the filters settle
    rows = slice(border, len(position) - border, max(1, int(rate / (_ROWS_PER_CORNER * corner))))
    return np.column_stack(columns)[rows], low(recording.effort)[rows]
