"""Bounds of the compensation: the output is finite, limited in size and rate; trust in data and motion fades it."""

from __future__ import annotations

import math

from sgms_observer.filters.differentiator import velocity_noise_gain
from sgms_observer.jit import njit
from sgms_observer.settings.axis import CompensationSettings, FilterSettings


@njit
def safe_output(previous: float, target: float, period: float, limit: float, slew_limit: float) -> float:
    """Return the safe output nearest to ``target``.

    Args:
        previous: last output [N].
        target: wanted output [N].
        period: time since the last output [s]; no motion is allowed for a period that is not positive.
        limit: largest magnitude [N].
        slew_limit: fastest change [N/s].

    Returns:
        Output [N]: finite, at most ``limit`` in magnitude, and at most ``slew_limit * period`` from ``previous``
        unless the limit itself asks for more.
    """
    bound = limit if limit > 0.0 else 0.0
    if math.isinf(bound):
        bound = 1.0e300
    start = previous if math.isfinite(previous) else 0.0
    finite_target = target if math.isfinite(target) else 0.0
    max_change = slew_limit * period if period > 0.0 and slew_limit > 0.0 else 0.0
    if math.isnan(max_change):
        max_change = 0.0
    change = finite_target - start
    if change > max_change:
        change = max_change
    elif change < -max_change:
        change = -max_change
    return min(max(start + change, -bound), bound)


class SafetyStage:
    """Output stage for a caller that publishes periodically: the output goes to zero without input or if disabled.

    Args:
        settings: limit, slew limit and timeout.
    """

    def __init__(self, settings: CompensationSettings) -> None:
        self._settings = settings
        self.output = 0.0

    def step(self, target: float, age: float, period: float) -> float:
        """Return the next output.

        Args:
            target: compensation from the observer [N].
            age: how old the sample behind it is [s]; beyond ``timeout`` (or not a number) the target is zero.
            period: time since the last call [s].

        Returns:
            Output [N], safe whatever the arguments were.
        """
        fresh = self._settings.enabled and 0.0 <= age <= self._settings.timeout
        wanted = target if fresh else 0.0
        self.output = safe_output(self.output, wanted, period, self._settings.limit, self._settings.slew_limit)
        return self.output


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
