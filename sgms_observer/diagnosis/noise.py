"""Noise of a residual: spectrum and time-dependent variance. They whiten residuals and derivatives alike.

The model of the force noise is first-order noise plus white noise. Its corner frequency is at least ``LOWEST_CORNER``
times the band: slower changes count as effects, not as noise. The spectrum is fitted to medians over frequency bands,
so that spectral lines and slow effects do not count as noise. Where the contact sticks, its stiffness turns encoder
noise into force noise, so residuals there have a lower weight. Where the encoder may hide reversals of the motion, the
motion does not determine the friction. The variance of the hidden force is at least that of one reversal within the
encoder resolution, by Masing's rule. Several add up, by how much depends on the contact law: it is measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import trapezoid
from scipy.optimize import least_squares

from sgms_observer.arrays import Booleans, Floats

LOWEST_CORNER = 0.08
"""Lowest corner frequency of the noise, as a share of the band."""
MAX_STICK_VARIANCE = 100.0
"""Largest extra variance where the contact sticks or creeps."""
_BANDS = 24
_STICK_SMOOTHING = 0.024  # s
_AVERAGING_TIME = 0.05  # s over which residuals are averaged; the hidden force does not average out
_MIN_AVERAGES = 10  # independent averages that tell a variance
_MEDIAN_OF_CHI2 = 0.6931  # median over mean of a periodogram's bins


@dataclass(frozen=True)
class UnknownFriction:
    """What the samples of a recording do not tell of the friction, at the rate of residuals.

    Attributes:
        stick_indicator: 0 where the contact slides, 1 where it sticks or creeps.
        square: mean square of the friction that the recording does not determine [N^2].
        most: the same if all reversals that the encoder may hide add up [N^2]; 0 where it hides none.
    """

    stick_indicator: Floats
    square: Floats
    most: Floats


@dataclass(frozen=True)
class Noise:
    """Noise of residuals at one rate.

    Attributes:
        period: time between residuals [s].
        low: spectral density of the first-order noise below the corner [N^2/Hz].
        corner: corner frequency [Hz].
        white: white density [N^2/Hz].
        stick_variance: extra variance where the contact sticks or creeps, over the variance elsewhere.
        band: upper frequency of the residuals [Hz].
        rest_variance: extra variance where the encoder may hide reversals, over the variance elsewhere, as measured.
    """

    period: float
    low: float
    corner: float
    white: float
    stick_variance: float
    band: float
    rest_variance: float = 0.0

    def density(self, frequency: Floats) -> Floats:
        """Return the two-sided spectral density [N^2/Hz]."""
        return np.asarray(self.low / (1.0 + (frequency / self.corner) ** 2) + self.white, dtype=np.float64)

    @property
    def rms(self) -> float:
        """Noise below the band [N]."""
        grid = np.linspace(0.0, self.band, 2000)
        return float(np.sqrt(2.0 * trapezoid(self.density(grid), grid)))

    def weights(self, unknown: UnknownFriction) -> Floats:
        """Return the weights of residuals, in the gap and before whitening.

        Args:
            unknown: what the samples do not tell.
        """
        sticking = self.stick_variance * unknown.stick_indicator**2
        return self._smoothed(np.maximum(sticking, self._hidden_variance(unknown)))

    def _hidden_variance(self, unknown: UnknownFriction) -> Floats:
        """Return the extra variance of what the motion does not determine, over the variance elsewhere.

        That is the computed mean square over that of the averaged noise, or what was measured, if it is larger and not
        more than all hidden reversals together can make.
        """
        over_noise = _AVERAGING_TIME / float(self.density(np.zeros(1))[0])
        measured = np.minimum(self.rest_variance, unknown.most * over_noise)
        return np.asarray(np.maximum(unknown.square * over_noise, measured), dtype=np.float64)

    def _smoothed(self, extra: Floats) -> Floats:
        """Return the weights for an extra variance, over the variance elsewhere."""
        width = max(1, int(_STICK_SMOOTHING / self.period))
        smooth = np.convolve(np.pad(extra, (width, width), mode="edge"), np.ones(width) / width, mode="same")
        return np.asarray(1.0 / np.sqrt(1.0 + smooth[width:-width]), dtype=np.float64)

    def whitened(self, values: Floats, weights: Floats) -> Floats:
        """Return whitened columns: real and imaginary parts of the spectrum below the band, unit variance each.

        Args:
            values: residuals or columns, shape (n,) or (n, k).
            weights: see ``weights``.
        """
        n = values.shape[0]
        scaled = values * (weights if values.ndim == 1 else weights[:, None])
        spectrum = np.fft.rfft(scaled, axis=0)
        gain = _unit_gain(self, n)
        spectrum = spectrum[: len(gain)] * (gain if values.ndim == 1 else gain[:, None])
        return np.concatenate([spectrum.real, spectrum.imag[1:]])

    def frequencies(self, count: int) -> Floats:
        """Return the frequencies below the band of the spectrum of ``count`` samples [Hz]."""
        grid = np.asarray(np.fft.rfftfreq(count, self.period), dtype=np.float64)
        return grid[grid <= self.band]

    def length(self, count: int) -> int:
        """Return the length of a whitened column of ``count`` samples: both parts of its spectrum below the band."""
        return 2 * len(self.frequencies(count)) - 1

    def adjoint(self, whitened: Floats, weights: Floats) -> Floats:
        """Return the series whose product with any residual is that of ``whitened`` with the whitened residual.

        Args:
            whitened: a whitened column.
            weights: see ``weights``.
        """
        n = len(weights)
        spectrum = _unit_gain(self, n) * spectrum_of(whitened)
        spectrum[1:] *= 0.5  # the inverse transform counts every bin but the first twice
        return np.asarray(n * np.fft.irfft(spectrum, n) * weights, dtype=np.float64)


def spectrum_of(whitened: Floats) -> NDArray[np.complex128]:
    """Return whitened columns, shape (n,) or (n, k), as spectra, whose first bin is real."""
    bins = (len(whitened) + 1) // 2
    spectrum = whitened[:bins].astype(np.complex128)
    spectrum[1:] += 1j * whitened[bins:]
    return spectrum


@lru_cache(maxsize=64)
def _unit_gain(noise: Noise, count: int) -> Floats:
    """Return the gain to unit variance of each bin below the band of the spectrum of ``count`` samples."""
    gain = np.sqrt(2.0 * noise.period / (count * noise.density(noise.frequencies(count))))
    gain[0] /= np.sqrt(2.0)
    return np.asarray(gain, dtype=np.float64)


def largest_noise(noise: Sequence[Noise]) -> Noise:
    """Return the noise with the largest rms."""
    return max(noise, key=lambda one: one.rms)


def with_extra_variance_of(residual: Floats, noise: Noise, unknown: UnknownFriction) -> Noise:
    """Return the noise of other recordings with the extra variances of a residual where they are larger.

    The extra variance where the contact sticks or the encoder hides reversals depends on the motion: it cannot be
    measured in recordings without rests.

    Args:
        residual: at the rate of residuals [N].
        noise: noise of the other recordings, at the same rate.
        unknown: what the samples of the residual do not tell.
    """
    slow = _Slow.of(residual, unknown.stick_indicator, noise.period)
    return replace(
        noise,
        stick_variance=max(noise.stick_variance, slow.stick_variance),
        rest_variance=max(noise.rest_variance, slow.variance_in(unknown.most > 0.0)),
    )


def fit_noise(residual: Floats, unknown: UnknownFriction, period: float, band: float, least: float = 0.0) -> Noise:
    """Fit the noise of a residual.

    Args:
        residual: at the rate of residuals [N].
        unknown: what its samples do not tell.
        period: time between residuals [s].
        band: upper frequency of the residuals [Hz].
        least: smallest rms noise of a measured force [N]; added as white noise.
    """
    slow = _Slow.of(residual, unknown.stick_indicator, period)
    hides = unknown.most > 0.0
    rest_variance = slow.variance_in(hides)
    start = Noise(period, 1.0, LOWEST_CORNER * band, 0.0, slow.stick_variance, band, rest_variance)
    nothing, no_limit = np.zeros(len(residual)), np.where(hides, np.inf, 0.0)
    found = _with_spectrum(start, residual, start.weights(replace(unknown, square=nothing, most=no_limit)))
    if np.any(unknown.square) or np.any(unknown.most):
        found = _with_spectrum(start, residual, found.weights(unknown))
    return replace(found, white=found.white + least**2 / (2.0 * band))


def _with_spectrum(start: Noise, residual: Floats, weights: Floats) -> Noise:
    """Return the noise with the spectrum of the weighted residual."""
    period, band, lowest = start.period, start.band, start.corner
    centred = residual - np.median(residual)
    spectrum = np.abs(np.fft.rfft(centred * weights)) ** 2 * period / max(float(np.sum(weights**2)), 1.0)
    frequency = np.fft.rfftfreq(len(residual), period)
    edges = np.geomspace(0.04 * band, 0.95 * band, _BANDS + 1)
    centre, density = [], []
    for low, high in pairwise(edges):
        rows = (frequency >= low) & (frequency < high)
        if rows.sum() >= 5:
            centre.append(float(np.sqrt(low * high)))
            density.append(float(np.median(spectrum[rows])) / _MEDIAN_OF_CHI2)
    if not centre:  # half a short recording: its spectrum has no shape, only a size
        inside = frequency < band
        return replace(start, low=0.0, white=float(np.mean(spectrum[inside])))
    x, y = np.array(centre), np.log(np.array(density) + 1e-300)
    top = float(np.exp(y.max()))

    def misfit(p: Floats) -> Floats:
        model = np.exp(p[0]) / (1.0 + (x / np.exp(p[1])) ** 2) + np.exp(p[2])
        return np.asarray(np.log(model) - y, dtype=np.float64)

    bounds = (np.log([top * 1e-6, lowest, top * 1e-8]), np.log([top * 10.0, 10.0 * band, top * 2.0]))
    starts = [np.log([top, corner * band, top * share]) for corner, share in ((0.12, 0.1), (0.4, 0.1), (0.6, 0.01))]
    best = min(
        (least_squares(misfit, one, bounds=bounds, loss="soft_l1", f_scale=0.3) for one in starts),
        key=lambda found: float(found.cost),
    )
    low, corner, white = np.exp(best.x)
    return replace(start, low=float(low), corner=float(corner), white=float(white))


@dataclass(frozen=True)
class _Slow:
    """Slow residuals: at rest the error of an encoder is constant and does not average out.

    Attributes:
        size: magnitude of the averaged residual [N].
        square: averaged square of the stick indicator.
        width: number of averaged samples.
    """

    size: Floats
    square: Floats
    width: int

    @classmethod
    def of(cls, residual: Floats, stick_indicator: Floats, period: float) -> _Slow:
        """Return the slow residuals; arguments as for ``fit_noise``."""
        width = max(3, int(_AVERAGING_TIME / period))
        return cls(np.abs(_averaged(residual, width)), _averaged(stick_indicator**2, width), width)

    @property
    def stick_variance(self) -> float:
        """Growth of the variance with the squared stick indicator."""
        tight = self.square >= np.quantile(self.square, 0.85)
        if self.square[tight].mean() <= 2.0 * self.square[self._is_loose].mean():
            return 0.0
        return float(min(MAX_STICK_VARIANCE, self._growth(tight) / self.square[tight].mean()))

    def variance_in(self, there: Booleans) -> float:
        """Return the growth of the variance in some samples, 0 where too few of their neighbours are of them, too."""
        inside = _averaged(there.astype(np.float64), self.width) > 0.999
        enough = np.count_nonzero(inside) >= _MIN_AVERAGES * self.width
        return min(MAX_STICK_VARIANCE, self._growth(inside)) if enough else 0.0

    @property
    def _is_loose(self) -> Booleans:
        """Whether the contact sticks least."""
        return np.asarray(self.square <= np.quantile(self.square, 0.3), dtype=np.bool_)

    def _growth(self, there: Booleans) -> float:
        """Return the variance of some samples over that where the contact sticks least, minus 1; at least 0."""
        free, stuck = np.median(self.size[self._is_loose]), np.median(self.size[there])
        return float(max(0.0, (stuck / max(free, 1e-300)) ** 2 - 1.0))


def _averaged(values: Floats, width: int) -> Floats:
    """Return moving averages."""
    return np.convolve(values, np.ones(width) / width, mode="same")
