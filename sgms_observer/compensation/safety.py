"""Output stage of the compensation: the output is finite, bounded and limited in its rate of change.

The stage does not rely on its input. For any input, the magnitude of the output stays within the limit and its change
within the slew limit times the elapsed time. An input that is not a number counts as zero.
"""

from __future__ import annotations

import math

from sgms_observer.jit import njit
from sgms_observer.settings.axis import CompensationSettings


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
            age: age of its sample [s]; beyond ``timeout`` (or not a number) the target is zero.
            period: time since the last call [s].

        Returns:
            Output [N], safe for any arguments.
        """
        fresh = self._settings.enabled and 0.0 <= age <= self._settings.timeout
        wanted = target if fresh else 0.0
        self.output = safe_output(self.output, wanted, period, self._settings.limit, self._settings.slew_limit)
        return self.output
