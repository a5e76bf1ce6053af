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
from functools import cached_property

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
"""Smallest weight of all other recordings beside that of the most accurate one, as a share of the weight of their mean,
for which a variance between recordings is computed."""


@dataclass(frozen=True)
class RecordingEstimates:
    """Estimates of the free effect parameters of a fit: of the fit itself, and of each other recording alone.

    Attributes:
        free: index (effect, parameter) of each of them.
        values: shape (1 + number of other recordings, number of parameters), SI units; the fit first.
        covariances: of the estimates of each parameter, shape (number of parameters, rows of ``values``, rows of
            ``values``). A wrong value of the file is the same in all recordings of one machine, so the errors
            correlate. Rows and columns are zero where a recording does not determine the parameter.
    """

    free: tuple[tuple[int, int], ...]
    values: Floats
    covariances: Floats

    @classmethod
    def none(cls, count: int = 1) -> RecordingEstimates:
        """Return the estimates of ``count`` fits without free effect parameters."""
        return cls((), np.zeros((count, 0)), np.zeros((0, count, count)))

    @cached_property
    def errors(self) -> Floats:
        """Return the standard error of each value; 0 if a recording does not determine the parameter."""
        return np.sqrt(np.diagonal(self.covariances, axis1=1, axis2=2)).T

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
        scatters = [Scatter.of(*pair) for pair in zip(self.values.T, self.covariances, strict=True)]
        between = [one.deviation if one.is_significant(z_score) else 0.0 for one in scatters]
        return np.asarray(np.hypot(self.errors[0], between), dtype=np.float64)

    def linear(self, effects: Sequence[EffectSettings]) -> RecordingEstimates:
        """Return the estimates of values that small effects are proportional to, see ``EffectParameter.linear``.

        A recording determines the logarithm of a rate. Its reciprocal has the error that it would have at the value of
        the fit: at values of their own, the smallest reciprocal would have the smallest error and the largest weight.

        Args:
            effects: of the fit.
        """
        parameters = [effect(effects[i].name).parameters[j] for i, j in self.free]
        values, covariances = self.values.copy(), self.covariances.copy()
        for column, parameter in enumerate(parameters):
            values[:, column] = parameter.linear(self.values[:, column])
            slopes = parameter.linear_error(self.values[:, column], np.ones(len(values)))
            if parameter.vanishes_at_infinity:
                slopes = slopes * values[0, column] / values[:, column]
            covariances[column] *= np.outer(slopes, slopes)
        return RecordingEstimates(self.free, values, covariances)

    def smaller_z_score(self, column: int, null: float, least: float) -> float:
        """Return the strength over its standard error, the smaller of that of the fit and that of the other recordings.

        The mean of the others counts, positive with the sign of the fit. The size there may differ from that of the
        fit, because the model of the contact is not exact. A recording that would not surely show the effect does not
        count.

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
        error = math.sqrt(float(weights @ self.covariances[column][np.ix_(shows, shows)] @ weights))
        return min(z_score_of_fit, float(np.sign(strengths[0]) * (weights @ strengths[shows])) / error)

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
        values, errors, covariance = self.values[:, column], self.errors[:, column], self.covariances[column]
        if errors[0] <= 0.0:
            return math.inf
        if not math.isfinite(errors[0]):
            return 0.0
        counts = _is_informative(values, errors)
        counts[0] = True
        weights = 1.0 / errors[counts] ** 2
        weights /= weights.sum()
        mean = np.sign(values[0] - null) * float(weights @ (values[counts] - null))
        variance = float(weights @ covariance[np.ix_(counts, counts)] @ weights)
        return max(0.0, float(mean)) / math.sqrt(variance + Scatter.of(values, covariance).variance)

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


@dataclass(frozen=True)
class Accuracy:
    """How accurately a fit determines its free effect parameters.

    Attributes:
        errors: standard error of each free effect parameter, SI units: the larger of the error from the noise and the
            error from the jackknife over blocks; 0 where the residual hardly depends on the parameter, as on a gap
            that lies between two steps of the encoder.
        by_prior: change of each coordinate with the error of each prior row, shape (prior rows, coordinates). The
            coordinates are those of the fit, or the free effect parameters alone if the nominal parameters are held.
        of_coordinates: covariance of these coordinates, from the noise and from the jackknife.

    Source: Efron and Stein 1981, Annals of Statistics 9(3); Bell and McCaffrey 2002, Survey Methodology 28(2), for few
    blocks, whose plain scatter (White 1980, Econometrica 48(4)) is too small, because each block was fitted.
    """

    errors: Floats
    by_prior: Floats
    of_coordinates: tuple[Floats, Floats]

    @classmethod
    def of(cls, found: Refit, data: WhitenedData, is_nominal_held: bool) -> Accuracy:
        """Return the accuracy of a fit with at least one free effect parameter.

        Args:
            found: fit with derivatives at its solution.
            data: recordings that it was fitted to.
            is_nominal_held: whether the nominal parameters count as known.
        """
        count, rows = len(found.free), len(found.residual)
        jacobian = found.jacobian[:, found.jacobian.shape[1] - count :] if is_nominal_held else found.jacobian
        normal = jacobian.T @ jacobian
        inverse = np.asarray(np.linalg.pinv(normal), dtype=np.float64)
        parts: list[Floats] = []
        columns = np.column_stack([jacobian[:rows], found.residual])
        for motion, series in zip(data.motions, as_time_series(columns, data), strict=True):
            blocks = max(2, int(len(motion.time) * motion.period / BLOCK_LENGTH))
            parts += np.array_split(series, blocks)
        moved, by_prior = leave_one_out_shifts(parts, normal), jacobian[rows:] @ inverse
        scatter = (1.0 - 1.0 / len(parts)) * moved.T @ moved + by_prior.T @ by_prior
        variance = np.maximum(np.diag(scatter), np.diag(inverse))[-count:]
        is_determined = np.diag(normal)[-count:] > MIN_INFORMATION * np.max(np.diag(normal))
        errors = np.where(is_determined, np.sqrt(np.maximum(variance, 0.0)), 0.0) * found.scales
        for k, (i, j) in enumerate(found.free):
            if errors[k] > 0.0 and effect(found.effects[i].name).parameters[j].name in DELAY_PARAMETERS:
                errors[k] = np.hypot(errors[k], STAMP_ERROR * data.motions[0].period / data.motions[0].step)
        return cls(errors, by_prior, (inverse, np.asarray(scatter, dtype=np.float64)))


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
        has_common_values: whether the other recordings have the nominal parameters of the fit, or their own.
    """
    if not found.free:
        return RecordingEstimates.none(1 + len(others))
    free = set(found.free)
    fixed = [(i, j) for i, e in enumerate(found.effects) for j in range(len(e.values)) if (i, j) not in free]
    fits, data = [found], [setup.data]
    for motion in others:
        data.append(data_with_own_noise((motion,), found.model))
        alone = replace(setup, data=data[-1])
        fits.append(alone.fit(found.effects, found.logs, fixed, is_nominal_held=has_common_values))
    values = np.array([[fit.effects[i].values[j] for i, j in fit.free] for fit in fits])
    is_held = [False, *(has_common_values for _ in others)]
    accuracies = [Accuracy.of(*item) for item in zip(fits, data, is_held, strict=True)]
    covariances = (
        covariances_with_common_values(fits, accuracies) if has_common_values else _covariances(fits, accuracies)
    )
    is_determined = np.array([one.errors > 0.0 for one in accuracies]).T
    return RecordingEstimates(found.free, values, covariances * is_determined[:, :, None] * is_determined[:, None, :])


def _by_file(fits: Sequence[Refit], accuracies: Sequence[Accuracy]) -> Floats:
    """Return the change of each free effect parameter of each fit with the error of each prior row, SI units.

    Returns:
        Shape (fits, prior rows, parameters).
    """
    count = len(fits[0].free)
    pairs = zip(fits, accuracies, strict=True)
    return np.array([one.by_prior[:, -count:] * fit.scales for fit, one in pairs])


def _covariances(fits: Sequence[Refit], accuracies: Sequence[Accuracy]) -> Floats:
    """Return the covariances of estimates that each have nominal parameters of their own.

    Args:
        fits: the reported one first.
        accuracies: of these fits.

    Returns:
        Shape (number of parameters, number of fits, number of fits), SI units.
    """
    by_file = _by_file(fits, accuracies)
    covariances = np.einsum("krp,lrp->pkl", by_file, by_file)
    for k, one in enumerate(accuracies):
        covariances[:, k, k] = one.errors**2
    return np.asarray(covariances, dtype=np.float64)


def covariances_with_common_values(fits: Sequence[Refit], accuracies: Sequence[Accuracy]) -> Floats:
    """Return the covariances of estimates that all have the nominal parameters of one fit.

    The errors of these parameters and of the effect parameters of that fit are correlated. If the nominal parameters
    change by d, the estimate of another recording changes by -J_e^+ J_n d, with its derivatives J_e with respect to the
    effect parameters and J_n with respect to the nominal ones. That neglects that a parameter at the end of its
    range stays there. Prior rows that depend on effect parameters are the same in all fits.

    Args:
        fits: the fit itself, then those of the other recordings, with derivatives at their solutions.
        accuracies: of these fits.

    Returns:
        Shape (number of parameters, number of fits, number of fits), SI units.
    """
    count, by_file, by_prior = len(fits[0].free), _by_file(fits, accuracies), accuracies[0].by_prior
    rows, coordinates = by_prior.shape
    of_fit = np.zeros((count, coordinates + rows))
    of_fit[:, coordinates - count : coordinates] = np.diag(fits[0].scales)
    derivatives = [of_fit]
    for fit, one, of_file in zip(fits[1:], accuracies[1:], by_file[1:], strict=True):
        of_effects, of_nominal = fit.jacobian[:, -count:], fit.jacobian[:, :-count]
        by_nominal = one.of_coordinates[0] @ of_effects.T @ of_nominal
        derivatives.append(np.hstack([-fit.scales[:, None] * by_nominal, np.zeros((count, count)), of_file.T]))
    slopes = np.array(derivatives)
    by_noise, by_blocks = (
        np.einsum("kpi,ij,lpj->pkl", slopes, np.block([[one, by_prior.T], [by_prior, np.eye(rows)]]), slopes)
        for one in accuracies[0].of_coordinates
    )
    is_larger = by_blocks[:, 0, 0] > by_noise[:, 0, 0]
    covariances = np.where(is_larger[:, None, None], by_blocks, by_noise)
    covariances[:, 0, 0] = accuracies[0].errors ** 2
    for k, one in enumerate(accuracies[1:], start=1):
        covariances[:, k, k] += np.maximum(one.errors**2 - np.sum(by_file[k] ** 2, axis=0), 0.0)
    return np.asarray(covariances, dtype=np.float64)


def _is_informative(values: Floats, errors: Floats) -> Booleans:
    """Return whether each recording determines the parameter."""
    return np.asarray((errors > 0.0) & np.isfinite(errors) & (errors < max(abs(float(values[0])), 1e-300)))


@dataclass(frozen=True)
class Scatter:
    """How much one parameter differs between the recordings that determine it.

    Attributes:
        squares: weighted sum of squares around the mean.
        degrees: of freedom of this sum.
        growth: increase of the expected sum per unit of variance between recordings.
        weight: of the mean.
    """

    squares: float
    degrees: int
    growth: float
    weight: float

    @classmethod
    def of(cls, values: Floats, covariance: Floats) -> Scatter:
        """Return the scatter of one parameter.

        Args:
            values: estimate from each recording, the reported one first.
            covariance: of the estimates; 0 if a recording does not determine the parameter.
        """
        errors = np.sqrt(np.diag(covariance))
        at = np.flatnonzero(_is_informative(values, errors))
        if len(at) < 2:
            return cls(0.0, 0, 0.0, 0.0)
        values, products = values[at], np.outer(errors[at], errors[at])
        sizes, directions = np.linalg.eigh(covariance[np.ix_(at, at)] / products)
        is_known = sizes > len(at) * np.finfo(np.float64).eps  # estimates with one error in common do not differ by it
        weights = (directions[:, is_known] / sizes[is_known]) @ directions[:, is_known].T / products
        of_mean = weights.sum(axis=0)
        around = values - float(of_mean @ values) / float(of_mean.sum())
        growth = float(np.trace(weights - np.outer(of_mean, of_mean) / of_mean.sum()))
        return cls(float(around @ weights @ around), int(np.sum(is_known)) - 1, growth, float(of_mean.sum()))

    @property
    def variance(self) -> float:
        """Return the variance between recordings, beyond the covariance of the estimates."""
        if self.degrees < 1 or self.growth <= MIN_OTHER_WEIGHT * self.weight:
            return 0.0
        return max(0.0, (self.squares - self.degrees) / self.growth)

    @property
    def deviation(self) -> float:
        """Return the deviation between recordings, beyond the covariance of the estimates.

        It is multiplied by a factor that turns the normal 90 % interval into that of Student's distribution.

        Source: Hartung and Knapp 2001, Statistics in Medicine 20(24).
        """
        if self.degrees < 1:
            return 0.0
        return math.sqrt(self.variance) * float(stats.t.ppf(0.95, self.degrees) / stats.norm.ppf(0.95))

    def is_significant(self, z_score: float) -> bool:
        """Return whether the recordings differ by significantly more than their standard errors.

        Args:
            z_score: above which a difference of two recordings is significant.
        """
        return self.degrees > 0 and bool(stats.chi2.sf(self.squares, self.degrees) < stats.chi2.sf(z_score**2, 1))
