"""Standard errors that hold where the residual is not the noise it was taken for.

The errors of least squares are right where the whitened residual is white. What a catalogue's shape leaves of the
machine's own shape is not: it comes back in every block of the same motion. So each block of time is left out once, and
what the solution moves by takes the place of the noise (the jackknife over blocks). And a wrong shape gives other
parameters in another kind of motion: what recordings differ by, beyond their errors, belongs to the error; so few of
them tell it that Student's distribution has to be allowed for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from sgms_observer.diagnosis.fit import Refit, RefitSetup, WhitenedData, data_with_own_noise
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.effects.catalogue import effect

Floats = NDArray[np.float64]

BLOCK = 1.0
"""Length of a block [s]; longer than what a contact or a filter remembers."""
STAMP_ERROR = 0.01
"""How well the stamps of position and effort agree, in samples: a delay is known no better."""
DELAY_PARAMETERS = ("delay",)
"""Parameters that compare the two stamps."""
SINGLE_RECORDING_STEPS = 6
"""Steps of the fit to another recording; it starts at the solution."""
SINGULAR_SHARE = 1.0e-10
"""What a block alone tells, below this share of the best known direction, is not left out."""
MIN_OTHER_WEIGHT = 1.0e-9
"""Where all other recordings hold no more than this share of the weight, they say nothing beside the one."""


def as_time_series(whitened: Floats, data: WhitenedData) -> list[Floats]:
    """Return whitened columns as series in time, one per recording, their squared sums unchanged.

    Args:
        whitened: shape (n, k), see ``Noise.whitened``.
        judged: recordings they belong to.
    """
    series, start = [], 0
    for motion, noise in zip(data.motions, data.noise, strict=True):
        frequency = np.fft.rfftfreq(len(motion.thinned(motion.time)), noise.period)
        count = int(np.sum(frequency <= noise.band))
        spectrum = whitened[start : start + count].astype(np.complex128)
        spectrum[1:] += 1j * whitened[start + count : start + 2 * count - 1]
        start += 2 * count - 1
        length = 2 * count - 1
        spectrum[1:] /= np.sqrt(2.0)
        series.append(np.asarray(np.fft.irfft(spectrum * np.sqrt(length), length, axis=0), dtype=np.float64))
    return series


def standard_errors(found: Refit, data: WhitenedData) -> Floats:
    """Return the standard deviation of each free effect parameter, SI units.

    Args:
        found: a fit with derivatives at its solution.
        judged: the recordings it was fitted to.

    Returns:
        The larger one of what the noise alone and the blocks give.

    Source: Efron and Stein 1981, Annals of Statistics 9(3); Bell and McCaffrey 2002, Survey Methodology 28(2), for few
    blocks, whose plain scatter (White 1980, Econometrica 48(4)) is too small: the fit has followed each of them.
    """
    count = len(found.free)
    if count == 0:
        return np.zeros(0)
    rows = len(found.residual)
    prior = found.jacobian[rows:]
    normal = found.jacobian.T @ found.jacobian
    inverse = np.linalg.pinv(normal)
    parts: list[Floats] = []
    columns = np.column_stack([found.jacobian[:rows], found.residual])
    for motion, series in zip(data.motions, as_time_series(columns, data), strict=True):
        blocks = max(2, int(len(motion.time) * motion.period / BLOCK))
        parts += np.array_split(series, blocks)
    moved = leave_one_out_shifts(parts, normal)
    scatter = (1.0 - 1.0 / len(parts)) * moved.T @ moved + inverse @ prior.T @ prior @ inverse
    variance = np.maximum(np.diag(scatter), np.diag(inverse))[-count:]
    errors = np.sqrt(np.maximum(variance, 0.0)) * found.scales
    for k, (i, j) in enumerate(found.free):
        if effect(found.effects[i].name).parameters[j].name in DELAY_PARAMETERS:
            errors[k] = np.hypot(errors[k], STAMP_ERROR * data.motions[0].period / data.motions[0].step)
    return np.asarray(errors, dtype=np.float64)


def leave_one_out_shifts(parts: Sequence[Floats], normal: Floats) -> Floats:
    """Return what the solution of a linear least-squares problem moves by without each of its parts, shape (parts, k).

    Args:
        parts: columns and residual side by side, each of shape (n, k + 1).
        normal: normal matrix of the whole, with its prior if any, shape (k, k).
    """
    moved = []
    for part in parts:
        columns, residual = part[:, :-1], part[:, -1]
        rest = np.linalg.pinv(normal - columns.T @ columns, SINGULAR_SHARE, hermitian=True)
        moved.append(rest @ (columns.T @ residual))
    return np.array(moved)


def with_between_recording_error(setup: RefitSetup, found: Refit, others: Sequence[Motion]) -> Floats:
    """Return the standard deviation of each free effect parameter with what recordings differ by, SI units.

    Args:
        refits: to the recordings to learn from.
        found: one of them, with derivatives at its solution.
        others: recordings of another kind.

    Source: DerSimonian and Laird 1986, Controlled Clinical Trials 7(3): variance between studies from their scatter.
    """
    own = standard_errors(found, setup.data)
    if not others or not found.free:
        return own
    free = set(found.free)
    fixed = [(i, j) for i, e in enumerate(found.effects) for j in range(len(e.values)) if (i, j) not in free]
    values = [[found.effects[i].values[j] for i, j in found.free]]
    errors = [own]
    for motion in others:
        alone = replace(setup, data=data_with_own_noise((motion,), found.model))
        fit = alone.fit(found.effects, found.logs, SINGLE_RECORDING_STEPS, fixed)
        values.append([fit.effects[i].values[j] for i, j in fit.free])
        errors.append(standard_errors(fit, alone.data))
    between = [between_deviation(*pair) for pair in zip(np.array(values).T, np.array(errors).T, strict=True)]
    return np.asarray(np.hypot(own, between), dtype=np.float64)


def between_deviation(values: Floats, errors: Floats) -> float:
    """Return the standard deviation between recordings of one parameter beyond its errors.

    Args:
        values: estimate from each recording, the first one the one that is reported.
        errors: standard deviation of each; 0 where a recording says nothing about the parameter.

    Returns:
        As large as makes the normal distribution's 90 % interval that of Student's, for as few recordings as there are.

    Source: Hartung and Knapp 2001, Statistics in Medicine 20(24).
    """
    degrees = int(np.sum(_is_informative(values, errors))) - 1
    if degrees < 1:
        return 0.0
    return float(np.sqrt(between_variance(values, errors)) * stats.t.ppf(0.95, degrees) / stats.norm.ppf(0.95))


def _is_informative(values: Floats, errors: Floats) -> NDArray[np.bool_]:
    """Return which recordings tell anything about a parameter."""
    return np.asarray((errors > 0.0) & np.isfinite(errors) & (errors < max(abs(float(values[0])), 1e-300)))


def between_variance(values: Floats, errors: Floats) -> float:
    """Return the variance between recordings of one parameter beyond its errors.

    Args:
        values: estimate from each recording, the first one the one that is reported.
        errors: standard deviation of each; 0 where a recording says nothing about the parameter.
    """
    tells = _is_informative(values, errors)
    values, weights = values[tells], 1.0 / errors[tells] ** 2
    if len(values) < 2:
        return 0.0
    total = float(weights.sum())
    scatter = float(weights @ (values - float(weights @ values) / total) ** 2)
    second = total - float(weights @ weights) / total
    if second <= MIN_OTHER_WEIGHT * total:
        return 0.0
    return max(0.0, (scatter - (len(values) - 1)) / second)
