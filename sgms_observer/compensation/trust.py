"""Trust in data and motion: factors that increase with good samples and decrease without."""

from __future__ import annotations

import math

from sgms_observer.filters.differentiator import velocity_noise_gain
from sgms_observer.jit import njit
from sgms_observer.settings.axis import FilterSettings

MIN_Z_SCORE = 3.0
"""Smallest z-score at which the sign of an estimate counts as known."""
_FADE_START = 0.5  # share of fade_std up to which nothing is faded


@njit
def next_trust(trust: float, verdict: float, period: float, timeout: float) -> float:
    """Return the trust in the data: 1 after ``timeout`` of good samples, 0 after ``timeout`` without."""
    if verdict == 2 or not period > 0.0:
        return 0.0
    change = period / timeout
    return min(1.0, trust + change) if verdict == 0 else max(0.0, trust - change)


@njit
def next_steady(steady: float, velocity: float, period: float, standstill: float) -> float:
    """Return the time since the last change of the sign of the velocity [s], with that sign."""
    if not (abs(velocity) > standstill and period > 0.0):
        return 0.0
    direction = math.copysign(1.0, velocity)
    return steady + direction * period if steady * direction > 0.0 else direction * period


@njit
def contradicts(friction: float, friction_std: float, held: float) -> bool:
    """Return whether the estimated friction [N] significantly has the other sign than the held force [N]."""
    return friction * held < 0.0 and abs(friction) > MIN_Z_SCORE * friction_std


@njit
def fade(friction_std: float, fade_std: float) -> float:
    """Return the factor for this uncertainty: 1 up to half of ``fade_std``, 0 from ``fade_std`` on."""
    if not friction_std < fade_std:
        return 0.0
    return min(1.0, (1.0 - friction_std / fade_std) / (1.0 - _FADE_START))


def standstill_velocity(settings: FilterSettings, sample_period: float) -> float:
    """Return the speed up to which an estimated velocity may be that of an axis at rest [m/s].

    It is ``3 sigma_q sqrt(sum w_i^2)``: ``sigma_q`` the noise of a measured position, the encoder's steps included,
    ``w_i`` the filter's weights from positions to the present velocity. Noise exceeds it at 3 samples in 1000.

    Args:
        settings: filter with the position's noise.
        sample_period: nominal time between two samples [s].
    """
    return MIN_Z_SCORE * settings.position_noise * velocity_noise_gain(settings, sample_period)
