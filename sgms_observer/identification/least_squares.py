"""The inverse dynamic model by least squares: mass, viscous and Coulomb friction, offset.

The model is linear in its parameters. The position is filtered forwards and backwards (no
delay) and differentiated centrally; regressors and effort are decimated by the same zero-phase filter.
Source: Gautier, Janot, Vandanjon, IEEE Trans. Control Syst. Technol. 21 (2013), section II.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from sgms_observer.arrays import Floats
from sgms_observer.errors import DataError
from sgms_observer.identification.confidence import least_squares_covariance
from sgms_observer.offline.recording import Recording

SYMMETRIC = ("mass", "viscous_coefficient", "coulomb_force", "offset")
GRAVITY = ("gravity_sine", "gravity_cosine")
"""Torque per sine and cosine of the angle of a revolute joint."""
ASYMMETRIC = ("mass", "viscous_forward", "viscous_backward", "coulomb_forward", "coulomb_backward")

_FILTER_ORDER = 4
_BORDER = 49  # samples at the start, where the filters settle
_ROWS_PER_CUTOFF = 1.0  # rows per second of the regression over the filter's corner frequency


@dataclass(frozen=True)
class InverseModelFit:
    """Result of the regression.

    Attributes:
        names: parameter of each entry.
        values: estimates, SI units.
        covariance: covariance of the estimates [squared SI units], valid for autocorrelated residuals.
        relative_error: norm of the force residual over the norm of the force, over all recordings [-].
        variation_error: the same over the norm of the force about its mean [-].
        condition: condition number of the column-scaled regressor [-].
        cutoff: corner of the zero-phase filter on the position [Hz].
    """

    names: tuple[str, ...]
    values: Floats
    covariance: Floats
    relative_error: float
    variation_error: float
    condition: float
    cutoff: float

    @property
    def std_error(self) -> Floats:
        """Standard deviation of each estimate."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))

    def value(self, name: str) -> float:
        """Return one estimate [SI unit].

        Args:
            name: the parameter.
        """
        return float(self.values[self.names.index(name)])


@dataclass(frozen=True)
class Regression:
    """One recording as rows ``regressor @ parameters = effort``.

    Attributes:
        regressor: a column per parameter [N per its SI unit], shape (n, p).
        effort: effort of the actuator [N], shape (n,).
        time: of each row since the recording's first sample [s], shape (n,).
    """

    regressor: Floats
    effort: Floats
    time: Floats


def _zero_phase_motion(position: Floats, period: float, cutoff: float) -> tuple[Floats, Floats, Floats]:
    """Return position [m], velocity [m/s] and acceleration [m/s^2], low-passed forth and back and so without delay."""
    b, a = signal.butter(_FILTER_ORDER, 2.0 * cutoff * period)
    smooth = signal.filtfilt(b, a, position, padlen=min(3 * _FILTER_ORDER, len(position) - 1))
    velocity = np.gradient(smooth) / period
    return smooth, velocity, np.gradient(velocity) / period


def decimate_from_end(signals: Floats, factor: int) -> Floats:
    """Low-pass without delay and keep every ``factor``-th row, counted so that the last row is kept.

    Args:
        signals: k signals [any unit], shape (n, k).
        factor: rows in per row out.

    Returns:
        Shape (ceil(n / factor), k).
    """
    if factor <= 1:
        return signals
    sections = signal.cheby1(8, 0.05, 0.8 / factor, output="sos" if factor > 12 else "ba")
    if factor > 12:
        low = signal.sosfiltfilt(sections, signals, axis=0)
    else:
        low = signal.filtfilt(*sections, signals, axis=0, padlen=min(24, len(signals) - 1))
    return np.asarray(low[(len(signals) - 1) % factor :: factor])


def regression(recording: Recording, names: Sequence[str], cutoff: float) -> Regression:
    """Prepare one recording for least squares.

    Args:
        recording: evenly sampled position and effort.
        names: ``SYMMETRIC``, with ``GRAVITY`` behind it or not, or ``ASYMMETRIC``.
        cutoff: corner of the zero-phase filter on the position [Hz].

    Raises:
        DataError: if the recording is too short or too slowly sampled for this cutoff.
    """
    rate = 1.0 / recording.period
    if cutoff >= 0.45 * rate:
        raise DataError(
            f"{recording.name} is sampled at {rate:.4g} Hz; choose a cutoff below 0.45 times that, not {cutoff:.4g} Hz"
        )
    position, velocity, acceleration = _zero_phase_motion(recording.position, recording.period, cutoff)
    direction = np.sign(velocity)
    if tuple(names[: len(SYMMETRIC)]) == SYMMETRIC:
        columns = [acceleration, velocity, direction, np.ones_like(velocity)]
        if tuple(names[len(SYMMETRIC) :]) == GRAVITY:
            columns += [np.sin(position), np.cos(position)]
    else:
        forward = direction > 0.0
        columns = [acceleration, velocity * forward, velocity * ~forward, 1.0 * forward, -1.0 * (direction < 0.0)]
    rows = np.column_stack([*columns, recording.effort])[_BORDER:]
    factor = max(1, round(rate / (_ROWS_PER_CUTOFF * cutoff)))
    if len(rows) < 40 * factor:
        raise DataError(
            f"{recording.name} lasts {recording.duration:.3g} s; least squares at {cutoff:.4g} Hz needs more"
        )
    decimated = decimate_from_end(rows, factor)
    time = np.asarray(recording.period * np.arange(_BORDER, len(recording))[(len(rows) - 1) % factor :: factor])
    return Regression(decimated[:, :-1], decimated[:, -1], time)


def fit_inverse_model(
    recordings: Sequence[Recording], names: Sequence[str] = SYMMETRIC, cutoff: float = 100.0, is_revolute: bool = False
) -> InverseModelFit:
    """Fit the inverse dynamic model to one or several recordings.

    Args:
        recordings: evenly sampled position and effort.
        names: ``SYMMETRIC`` or ``ASYMMETRIC`` friction.
        cutoff: corner of the zero-phase filter on the position [Hz].
        is_revolute: whether to add gravity, which depends on the joint angle.

    Returns:
        Estimates with covariance and relative force error.

    Raises:
        DataError: if the motion does not excite every column.
    """
    names = (*names, *GRAVITY) if is_revolute else tuple(names)
    parts = [regression(recording, names, cutoff) for recording in recordings]
    regressor = np.concatenate([part.regressor for part in parts])
    effort = np.concatenate([part.effort for part in parts])
    scale = np.linalg.norm(regressor, axis=0)
    if not np.all(scale > 0.0):
        silent = [name for name, size in zip(names, scale, strict=True) if size <= 0.0]
        raise DataError(f"these recordings never excite {', '.join(silent)}; move the axis both ways")
    condition = float(np.linalg.cond(regressor / scale))
    if condition > 1e8:
        raise DataError(
            f"the motion cannot tell {', '.join(names)} apart (condition {condition:.1e}); vary speed and direction"
        )
    values = np.linalg.lstsq(regressor / scale, effort, rcond=None)[0] / scale
    residuals = [part.effort - part.regressor @ values for part in parts]
    covariance = least_squares_covariance([part.regressor for part in parts], residuals)
    error = float(np.linalg.norm(np.concatenate(residuals)))
    relative, of_variation = (
        error / float(np.linalg.norm(effort)),
        error / float(np.linalg.norm(effort - effort.mean())),
    )
    return InverseModelFit(tuple(names), values, covariance, relative, of_variation, condition, cutoff)


def is_reversed(fit: InverseModelFit) -> bool:
    """Return whether the effort has the opposite sign of the position: fitted friction and mass are negative.

    Args:
        fit: symmetric fit.
    """
    return all(fit.value(name) < 0.0 for name in ("mass", "coulomb_force"))
