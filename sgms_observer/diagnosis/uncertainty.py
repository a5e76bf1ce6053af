"""Standard errors of effect parameters that include model errors.

The errors of least squares are right if the whitened residual is white. The residual of an effect with a slightly
wrong shape is not white: it repeats in every block of the same motion. The jackknife over blocks accounts for this:
each block of time is left out once, and the scatter of the solutions gives the error. A wrong shape also gives
different parameters in recordings of another motion. The scatter between recordings beyond their errors is therefore
added, with a factor of Student's distribution because there are few recordings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.diagnosis.fit import Refit, RefitSetup
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.noise import spectrum_of
from sgms_observer.diagnosis.whitened import WhitenedData, data_with_own_noise
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

BLOCK_LENGTH = 1.0
"""Length of a block [s]; longer than the memory of a contact or a filter."""
STAMP_ERROR = 0.01
"""Standard error between the stamps of position and effort, in samples: the lower limit for that of a delay."""
DELAY_PARAMETERS = ("delay",)
"""Parameters that depend on the difference of the two stamps."""
SINGULAR_SHARE = 1.0e-10
"""Relative singular value below which a direction of the normal matrix counts as determined by the block alone."""
MIN_INFORMATION = 1.0e-15
"""Smallest information on a determined parameter, as a share of the largest: what the inverse takes for zero."""
MIN_OTHER_WEIGHT = 1.0e-9
"""Smallest share of the weight of all other recordings for which a variance between recordings is computed."""


@dataclass(frozen=True)
class RecordingEstimates:
    """Estimates of the free effect parameters of a fit: of the fit itself, and of each other recording alone.

    Attributes:
        free: index (effect, parameter) of each of them.
        values: shape (1 + number of other recordings, number of parameters), SI units; the fit first.
        errors: standard error of each value; 0 if a recording does not determine the parameter.
        from_file: the part of each error that comes from the tolerance of the file. A value of the file is wrong by the
            same amount in all recordings of one machine, so that more recordings do not make this part smaller.
    """

    free: tuple[tuple[int, int], ...]
    values: Floats
    errors: Floats
    from_file: Floats

    @classmethod
    def none(cls) -> RecordingEstimates:
        """Return the estimates of a fit without free effect parameters."""
        return cls((), np.zeros((1, 0)), np.zeros((1, 0)), np.zeros((1, 0)))

    @property
    def std_errors(self) -> Floats:
        """Return the standard error of each parameter of the fit, with the scatter between recordings, SI units.

        Source: DerSimonian and Laird 1986, Controlled Clinical Trials 7(3): variance between studies from their
        scatter.
        """
        return self.errors_with_significant_scatter(0.0)

    def errors_with_significant_scatter(self, z_score: float) -> Floats:
        """Return the standard error of each parameter of the fit, with the scatter between recordings where it is
        significant, SI units.

        A recording that hardly determines a parameter differs by much without telling anything.

        Args:
            z_score: above which a difference of two recordings is significant.

        Source: Cochran 1954, Biometrics 10(1): the weighted sum of squares as a test of homogeneity.
        """
        pairs = list(zip(self.values.T, self.errors.T, strict=True))
        between = [between_deviation(*pair) if _has_scatter(*pair, z_score) else 0.0 for pair in pairs]
        return np.asarray(np.hypot(self.errors[0], between), dtype=np.float64)

    def linear(self, effects: Sequence[EffectSettings]) -> RecordingEstimates:
        """Return the estimates of values that small effects are proportional to, see ``EffectParameter.linear``.

        A recording determines the logarithm of a rate. Its reciprocal has the error that it would have at the value of
        the fit: at values of their own, the smallest reciprocal would have the smallest error and the largest weight.

        Args:
            effects: of the fit.
        """
        parameters = [effect(effects[i].name).parameters[j] for i, j in self.free]
        values, errors, from_file = self.values.copy(), self.errors.copy(), self.from_file.copy()
        for column, parameter in enumerate(parameters):
            values[:, column] = parameter.linear(self.values[:, column])
            for part in (errors, from_file):
                part[:, column] = parameter.linear_error(self.values[:, column], part[:, column])
                if parameter.vanishes_at_infinity:
                    part[:, column] *= values[0, column] / values[:, column]
        return RecordingEstimates(self.free, values, errors, from_file)

    def smaller_z_score(self, column: int, null: float, least: float) -> float:
        """Return the strength over its standard error, the smaller of that of the fit and that of the other recordings.

        The others count together, positive with the sign of the fit. The size there may differ from that of the fit,
        because the model of the contact is not exact. A recording that would not surely show the effect does not count.

        Args:
            column: of the parameter.
            null: its value that is no finding.
            least: smallest strength over its standard error at which a recording would surely show the effect.

        Returns:
            Infinite if the fit has no error of the parameter.
        """
        strengths, errors = self.values[:, column] - null, self.errors[:, column]
        if errors[0] <= 0.0:
            return math.inf
        z_score_of_fit = abs(float(strengths[0])) / float(errors[0])
        shows = np.isfinite(errors) & (errors > 0.0) & (abs(strengths[0]) >= least * errors)
        shows[0] = False
        if not shows.any():
            return z_score_of_fit
        weights = 1.0 / errors[shows] ** 2
        return min(z_score_of_fit, float(np.sign(strengths[0]) * (weights @ strengths[shows]) / np.sqrt(weights.sum())))

    def strength_over_scatter(self, column: int, null: float) -> float:
        """Return the mean strength of the recordings over its standard error and its deviation between them.

        One recording need not determine a size that all of them together determine well. The fit counts, and each
        recording whose standard error is smaller than the value of the fit. The mean is positive where it has the sign
        of the fit.

        Args:
            column: of the parameter.
            null: its value that is no finding.

        Returns:
            0 if the mean has the other sign or the error of the fit is infinite; infinite if the fit has no error.
        """
        values, errors, from_file = self.values[:, column], self.errors[:, column], self.from_file[:, column]
        if errors[0] <= 0.0:
            return math.inf
        if not math.isfinite(errors[0]):
            return 0.0
        counts = _is_informative(values, errors)
        counts[0] = True
        weights = 1.0 / errors[counts] ** 2
        weights /= weights.sum()
        mean = np.sign(values[0] - null) * float(weights @ (values[counts] - null))
        from_data = np.maximum(errors[counts] ** 2 - from_file[counts] ** 2, 0.0)
        variance = float(weights**2 @ from_data) + float(weights @ from_file[counts]) ** 2
        return max(0.0, float(mean)) / math.sqrt(variance + between_variance(values, errors))

    def size_over(self, column: int, null: float, deviation: float) -> float:
        """Return the strength of the fit over a deviation; infinite if the fit has no error of the parameter.

        Args:
            column: of the parameter.
            null: its value that is no finding.
            deviation: in the unit of the parameter.
        """
        size = abs(float(self.values[0, column]) - null)
        return size / deviation if self.errors[0, column] > 0.0 else math.inf


def as_time_series(whitened: Floats, data: WhitenedData) -> list[Floats]:
    """Return whitened columns as time series, one per recording, with unchanged sums of squares.

    Args:
        whitened: shape (n, k), see ``Noise.whitened``.
        data: the recordings.
    """
    series, start = [], 0
    for motion, noise in zip(data.motions, data.noise, strict=True):
        length = noise.length(len(motion.thinned(motion.time)))
        spectrum = spectrum_of(whitened[start : start + length])
        start += length
        spectrum[1:] /= np.sqrt(2.0)
        series.append(np.asarray(np.fft.irfft(spectrum * np.sqrt(length), length, axis=0), dtype=np.float64))
    return series


def standard_errors(found: Refit, data: WhitenedData) -> Floats:
    """Return the standard error of each free effect parameter, SI units; see ``_standard_errors``."""
    return _standard_errors(found, data, False)[0]


def _standard_errors(found: Refit, data: WhitenedData, is_nominal_held: bool) -> tuple[Floats, Floats]:
    """Return the standard error of each free effect parameter, and its part from the tolerance of the file, SI units.

    Args:
        found: fit with derivatives at its solution.
        data: recordings that it was fitted to.
        is_nominal_held: whether the nominal parameters count as known.

    Returns:
        The larger of the error from the noise and the error from the jackknife over blocks; 0 where the residual hardly
        depends on the parameter, as on a gap that lies between two steps of the encoder. Then the part that the prior
        of the file's values makes of it.

    Source: Efron and Stein 1981, Annals of Statistics 9(3); Bell and McCaffrey 2002, Survey Methodology 28(2), for few
    blocks, whose plain scatter (White 1980, Econometrica 48(4)) is too small, because each block was fitted.
    """
    count = len(found.free)
    if count == 0:
        return np.zeros(0), np.zeros(0)
    rows = len(found.residual)
    jacobian = found.jacobian[:, found.jacobian.shape[1] - count :] if is_nominal_held else found.jacobian
    prior = jacobian[rows:]
    normal = jacobian.T @ jacobian
    inverse = np.linalg.pinv(normal)
    parts: list[Floats] = []
    columns = np.column_stack([jacobian[:rows], found.residual])
    for motion, series in zip(data.motions, as_time_series(columns, data), strict=True):
        blocks = max(2, int(len(motion.time) * motion.period / BLOCK_LENGTH))
        parts += np.array_split(series, blocks)
    moved, by_prior = leave_one_out_shifts(parts, normal), prior @ inverse
    scatter = (1.0 - 1.0 / len(parts)) * moved.T @ moved + by_prior.T @ by_prior
    variance = np.maximum(np.diag(scatter), np.diag(inverse))[-count:]
    is_determined = np.diag(normal)[-count:] > MIN_INFORMATION * np.max(np.diag(normal))
    errors = np.where(is_determined, np.sqrt(np.maximum(variance, 0.0)), 0.0) * found.scales
    for k, (i, j) in enumerate(found.free):
        if effect(found.effects[i].name).parameters[j].name in DELAY_PARAMETERS:
            errors[k] = np.hypot(errors[k], STAMP_ERROR * data.motions[0].period / data.motions[0].step)
    from_file = np.linalg.norm(by_prior, axis=0)[-count:] * found.scales
    return np.asarray(errors, dtype=np.float64), np.asarray(from_file, dtype=np.float64)


def leave_one_out_shifts(parts: Sequence[Floats], normal: Floats) -> Floats:
    """Return the change of a linear least-squares solution when each part is left out, shape (parts, k).

    Args:
        parts: columns and residual side by side, each of shape (n, k + 1).
        normal: normal matrix of all parts, including a prior, shape (k, k).
    """
    moved = []
    for part in parts:
        columns, residual = part[:, :-1], part[:, -1]
        rest = np.linalg.pinv(normal - columns.T @ columns, SINGULAR_SHARE, hermitian=True)
        moved.append(rest @ (columns.T @ residual))
    return np.array(moved)


def recording_estimates(
    setup: RefitSetup, found: Refit, others: Sequence[Motion], has_common_values: bool = False
) -> RecordingEstimates:
    """Return the estimates of a fit and of each other recording alone.

    Args:
        setup: setup of the fit.
        found: the fit, with derivatives at its solution.
        others: other recordings.
        has_common_values: whether the other recordings have the nominal parameters of the fit, which then count as
            known, or their own.
    """
    values = [[found.effects[i].values[j] for i, j in found.free]]
    errors = [_standard_errors(found, setup.data, False)]
    free = set(found.free)
    fixed = [(i, j) for i, e in enumerate(found.effects) for j in range(len(e.values)) if (i, j) not in free]
    for motion in others if free else ():
        alone = replace(setup, data=data_with_own_noise((motion,), found.model))
        fit = alone.fit(found.effects, found.logs, fixed, is_nominal_held=has_common_values)
        values.append([fit.effects[i].values[j] for i, j in fit.free])
        errors.append(_standard_errors(fit, alone.data, has_common_values))
    whole, from_file = map(np.array, zip(*errors, strict=True))
    return RecordingEstimates(found.free, np.array(values), whole, from_file)


def between_deviation(values: Floats, errors: Floats) -> float:
    """Return the standard deviation of one parameter between recordings, beyond its standard errors.

    Args:
        values: estimate from each recording, the reported one first.
        errors: standard error of each; 0 if a recording does not determine the parameter.

    Returns:
        The deviation times a factor that turns the normal 90 % interval into that of Student's distribution.

    Source: Hartung and Knapp 2001, Statistics in Medicine 20(24).
    """
    degrees = int(np.sum(_is_informative(values, errors))) - 1
    if degrees < 1:
        return 0.0
    return float(np.sqrt(between_variance(values, errors)) * stats.t.ppf(0.95, degrees) / stats.norm.ppf(0.95))


def _is_informative(values: Floats, errors: Floats) -> Booleans:
    """Return whether each recording determines the parameter."""
    return np.asarray((errors > 0.0) & np.isfinite(errors) & (errors < max(abs(float(values[0])), 1e-300)))


def between_variance(values: Floats, errors: Floats) -> float:
    """Return the variance of one parameter between recordings, beyond its standard errors.

    Args:
        values: estimate from each recording, the reported one first.
        errors: standard error of each; 0 if a recording does not determine the parameter.
    """
    is_informative = _is_informative(values, errors)
    weights = 1.0 / errors[is_informative] ** 2
    if len(weights) < 2:
        return 0.0
    total = float(weights.sum())
    second = total - float(weights @ weights) / total
    if second <= MIN_OTHER_WEIGHT * total:
        return 0.0
    return max(0.0, (_scatter(values, errors) - (len(weights) - 1)) / second)


def _has_scatter(values: Floats, errors: Floats, z_score: float) -> bool:
    """Return whether one parameter differs between recordings by significantly more than its standard errors.

    Args:
        values: estimate from each recording, the reported one first.
        errors: standard error of each; 0 if a recording does not determine the parameter.
        z_score: above which a difference of two recordings is significant.
    """
    degrees = int(np.sum(_is_informative(values, errors))) - 1
    return degrees > 0 and bool(stats.chi2.sf(_scatter(values, errors), degrees) < stats.chi2.sf(z_score**2, 1))


def _scatter(values: Floats, errors: Floats) -> float:
    """Return the weighted sum of squares of one parameter around its mean over the recordings that determine it."""
    is_informative = _is_informative(values, errors)
    values, weights = values[is_informative], 1.0 / errors[is_informative] ** 2
    return float(weights @ (values - float(weights @ values) / float(weights.sum())) ** 2)
