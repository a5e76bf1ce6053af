"""The velocity that noise alone gives to an axis that rests."""

from __future__ import annotations

from sgms_observer.compensation.trust import MIN_Z_SCORE
from sgms_observer.filters.differentiator import velocity_noise_gain
from sgms_observer.settings.observer import FilterSettings


def standstill_velocity(settings: FilterSettings, sample_period: float) -> float:
    """Return the speed up to which an estimated velocity may be that of an axis at rest [m/s].

    It is ``3 sigma_q sqrt(sum w_i^2)``: ``sigma_q`` the noise of a measured position, the encoder's steps included,
    ``w_i`` the filter's weights from positions to the present velocity. Noise exceeds it at 3 samples in 1000.

    Args:
        settings: filter with the position's noise.
        sample_period: nominal time between two samples [s].
    """
    return MIN_Z_SCORE * settings.position_noise * velocity_noise_gain(settings, sample_period)
