"""A log that shows no effort beyond a limit is told from a signal that turns there."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.offline.effort_range import NO_LIMITS, effort_limits

COUNT = 20_000
TIME = np.arange(COUNT) / 1000.0
SINE = 10.0 * np.sin(2.0 * np.pi * 1.3 * TIME)
NOISE = 0.05 * np.random.default_rng(1).standard_normal(COUNT)
STEP = 0.2
PULSES = np.where(TIME % 1.0 < 0.2, 10.0, np.where(TIME % 1.0 < 0.4, -10.0, 0.0))


@pytest.mark.parametrize(
    "effort",
    [
        SINE, SINE + NOISE, np.round(SINE / STEP) * STEP, np.round((SINE + 4.0 * NOISE) / STEP) * STEP,
        np.repeat((SINE + NOISE)[::10], 10), np.repeat(SINE[::10], 10), PULSES, PULSES + NOISE,
        np.round((PULSES + NOISE) / STEP) * STEP, np.zeros(COUNT), np.zeros(0), np.where(TIME < 2.0, 0.0, 20.0 + SINE),
    ],
    ids=["smooth", "noise", "coarse", "coarse and noise", "held", "held and smooth", "pulses", "pulses and noise",
         "coarse pulses", "constant", "empty", "one sign behind a rest"],
)  # fmt: skip
def test_a_signal_that_turns_at_its_largest_value_has_no_limit(effort: np.ndarray) -> None:
    assert effort_limits(effort) == NO_LIMITS


@pytest.mark.parametrize("hold", [1, 10])
def test_a_signal_that_is_cut_off_has_the_limit_where_it_is(hold: int) -> None:
    effort = np.repeat((SINE + NOISE)[::hold], hold)
    assert effort_limits(np.clip(effort, -8.0, 8.0)) == (-8.0, 8.0)
    assert effort_limits(np.minimum(effort, 8.0)) == (-np.inf, 8.0)
    assert effort_limits(np.maximum(effort, -8.0)) == (-8.0, np.inf)
    coarse = np.round((np.clip(effort, -8.0, 8.0)) / 0.05) * 0.05
    assert effort_limits(coarse) == pytest.approx((-8.0, 8.0))
