"""Encoder step and white noise of recorded positions."""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Floats

_MIN_DIFFERENCES = 30
"""Fewer small differences than this do not show a grid."""
_MAX_STEPS = 20.5
"""Differences of more steps than this do not enter: their rounding adds up."""
_MIN_COHERENCE = 0.75
"""Mean cosine of the differences' phase on the grid; a log that rounds to a fifth of the step reaches 0.87."""
_MIN_FAR_COHERENCE = 0.5
"""The same of differences of up to three times as many steps: half way between chance and a grid. A log that repeats a
motion exactly has few different small differences, which follow some grid by chance."""
_SMALLEST = (1.0e-3, 1.0e-4, 0.0)
"""Quantiles that may be the smallest difference: single differences may come from a glitch or a re-homed encoder."""
_CANDIDATES = 1200
_ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
_MEDIAN_OF_NORMAL = 0.6745
"""Median magnitude of a standard normal number."""
_THIRD_DIFFERENCE = math.sqrt(20.0)
"""Standard deviation of the third difference of white noise of 1."""
_BLOCK = 200
"""Samples of a block in which noise is read."""
_ROUNDED_SHARE = 2.0**-6
"""Unit to which signals are rounded, over their noise: rounding adds 0.002 % to the noise's variance."""


def encoder_step(position: Floats) -> float:
    """Return the step of the grid that recorded positions lie on, or 0 where they lie on none.

    The differences of consecutive samples are multiples of the step, plus what the log rounds away. The largest step
    near the smallest difference whose grid the differences follow is returned, so that an encoder step of 88 um is
    found in a log of 10 um.

    Args:
        position: recorded positions, in order of time, shape (n,).
    """
    moved = np.abs(np.diff(position))
    moved = moved[moved > _ROUNDING * max(float(np.max(np.abs(position), initial=0.0)), 1e-300)]
    if len(moved) < _MIN_DIFFERENCES:
        return 0.0
    for share in _SMALLEST:
        smallest = float(np.quantile(moved, share))
        small = moved[moved < _MAX_STEPS * smallest]
        if len(small) < _MIN_DIFFERENCES:
            continue
        step, coherence = _best_grid(small, smallest)
        far = moved[(moved >= _MAX_STEPS * smallest) & (moved < 3.0 * _MAX_STEPS * smallest)]
        is_grid_by_chance = len(far) >= _MIN_DIFFERENCES and _coherence(far, step) < _MIN_FAR_COHERENCE
        if coherence > _MIN_COHERENCE and not is_grid_by_chance:
            return step
    return 0.0


def _best_grid(differences: Floats, smallest: float) -> tuple[float, float]:
    """Return the step near the smallest difference that the differences follow best, and their mean cosine on it."""
    values, counts = np.unique(np.round(differences / smallest, 6), return_counts=True)
    candidates = np.linspace(0.6, 1.6, _CANDIDATES)
    weights = counts / counts.sum()
    coherence = np.array([float(weights @ np.cos(2.0 * np.pi * values / one)) for one in candidates])
    best = float(candidates[int(np.argmax(coherence))])
    whole = np.maximum(np.round(values / best), 1.0)
    exact = float((weights * whole) @ values / ((weights * whole) @ whole))  # least squares of value = step * whole
    return exact * smallest, float(weights @ np.cos(2.0 * np.pi * values / exact))


def _coherence(differences: Floats, step: float) -> float:
    """Return the mean cosine of the differences' phase on a grid."""
    return float(np.mean(np.cos(2.0 * np.pi * differences / step)))


def position_noise(position: Floats, step: float | None = None) -> float:
    """Return the standard deviation of the white part of recorded positions: noise and the encoder's steps.

    Args:
        position: recorded positions, in order of time, shape (n,) [m or rad].
        step: of the encoder [m or rad]; None finds it.
    """
    step = encoder_step(position) if step is None else step
    return max(white_noise(position), step / math.sqrt(12.0))


def without_unit_rounding(values: Floats, noise: float) -> Floats:
    """Return a signal rounded to a small share of its noise, so that the unit of its log cannot alter a result.

    The same positions logged in degrees and in radians differ in their last bits, and a fit may amplify that. The unit
    of rounding is a power of two, the same for both.

    Args:
        values: in SI units, shape (n,).
        noise: standard deviation of their white part, in the same unit; 0 leaves the values as they are.
    """
    if noise <= 0.0:
        return values
    unit = _ROUNDED_SHARE * 2.0 ** math.floor(math.log2(noise))
    return np.asarray(np.round(values / unit) * unit)


def white_noise(values: Floats) -> float:
    """Return the standard deviation of the white part of a signal.

    Third differences of a smooth signal are small. They are read in blocks, and the lower quartile over the blocks
    counts, so that jerks do not count as noise.

    Args:
        values: evenly sampled, shape (n,).
    """
    third = np.abs(np.diff(values, 3))
    if len(third) == 0:
        return 0.0
    medians = [float(np.median(block)) for block in np.array_split(third, max(1, len(third) // _BLOCK))]
    return float(np.quantile(medians, 0.25)) / _MEDIAN_OF_NORMAL / _THIRD_DIFFERENCE
