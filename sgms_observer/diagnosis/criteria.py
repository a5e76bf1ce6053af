"""Thresholds of every decision of the diagnosis, each a convention with its reason."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy import stats


@dataclass(frozen=True)
class Criteria:
    """Thresholds of the tests, the same for all effects and all machines.

    Attributes:
        min_z_score: smallest z-score of an improvement on data that was not fitted to; 3 standard errors, probability
            1/740 (Shewhart's limit). It is higher if many shapes were tried, so that the probability for all together
            stays the same (Bonferroni).
        interval_z_score: half width of reported intervals in standard errors; 90 %, two-sided.
        min_closed_share: smallest share of the closable squared gap that a named effect closes.
        min_imitable_share: the same for an effect that another contact law can imitate: half, because what it leaves
            may be that contact law, and what it closes a part of it.
        max_gap_over_noise: largest ratio of gap to noise for the verdict ``no_effect``, if nothing predicts the gap; an
            order of magnitude. Above it the verdict is ``cannot_tell``.
        max_sliding_over_noise: largest ratio of residual to noise while the contact slides fast. Above twice the noise
            more than three quarters of the square are something else.
        max_unexplained: largest unexplained share of the rms effort of a usable model: a third, as for identification.
        max_rate_share: highest frequency of an effect over the sample rate: below Nyquist with room for the filter.
        min_gap_over_floor: smallest ratio of gap to floor for which the gap is closable (closure is null below).
        min_predictable_share: smallest significantly predictable share of the squared gap that excludes ``no_effect``.
        block: length of a block of time that counts as independent of the next [s].
        max_effects: largest number of added effects.
    """

    min_z_score: float = 3.0
    interval_z_score: float = 1.645
    min_closed_share: float = 0.05
    min_imitable_share: float = 0.5
    max_gap_over_noise: float = 10.0
    max_sliding_over_noise: float = 2.0
    max_unexplained: float = 1.0 / 3.0
    max_rate_share: float = 0.4
    min_gap_over_floor: float = 1.1
    min_predictable_share: float = 0.1
    block: float = 0.5
    max_effects: int = 4

    def is_noise(self, residual: float, floor: float) -> bool:
        """Return whether an rms residual is not above the floor [both in the same unit]."""
        return residual <= self.min_gap_over_floor * floor

    def z_score_of(self, trials: int) -> float:
        """Return the z-score that the best of several trials needs.

        Args:
            trials: number of shapes that were tried. Correlated shapes make the threshold too high, never too low.
        """
        tail = stats.norm.sf(self.min_z_score) / max(1, trials)
        return float(stats.norm.isf(tail)) if tail > 0.0 else math.inf


@dataclass(frozen=True)
class Test:
    """One test of one hypothesis.

    Attributes:
        of: the hypothesis: an effect, a changed parameter, or ``model``.
        name: what is compared.
        value: its value.
        threshold: what it is compared with.
        passed: the outcome.
    """

    __test__ = False  # not a test of pytest

    of: str
    name: str
    value: float
    threshold: float
    passed: bool

    @property
    def excess(self) -> float:
        """Return how far the value lies from the threshold, in thresholds."""
        return abs(self.value - self.threshold) / abs(self.threshold) if self.threshold else math.inf


def at_least(of: str, name: str, value: float, threshold: float) -> Test:
    """Return the test that a value reaches a threshold."""
    return Test(of, name, float(value), float(threshold), bool(value >= threshold))


def at_most(of: str, name: str, value: float, threshold: float) -> Test:
    """Return the test that a value stays below a threshold."""
    return Test(of, name, float(value), float(threshold), bool(value <= threshold))
