"""No input whatever makes the last stage exceed its limits."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from sgms_observer.compensation.safety import SafetyStage, safe_output
from sgms_observer.settings.observer import CompensationSettings

anything = st.floats(allow_nan=True, allow_infinity=True)
limits = st.floats(min_value=0.0, max_value=1e6)
slews = st.floats(min_value=1e-3, max_value=1e9)


@given(previous=anything, target=anything, period=anything, limit=anything, slew=anything)
def test_output_is_finite_and_within_the_limit_for_any_input(
    previous: float, target: float, period: float, limit: float, slew: float
) -> None:
    output = safe_output(previous, target, period, limit, slew)
    assert math.isfinite(output)
    assert abs(output) <= (limit if limit > 0.0 else 0.0)


@given(targets=st.lists(st.tuples(anything, st.floats(0.0, 0.1)), max_size=40), limit=limits, slew=slews)
def test_output_never_changes_faster_than_the_slew_limit(
    targets: list[tuple[float, float]], limit: float, slew: float
) -> None:
    output = 0.0
    for target, period in targets:
        following = safe_output(output, target, period, limit, slew)
        assert abs(following - output) <= slew * period * (1.0 + 1e-9) + 1e-9 * limit
        output = following


@given(data=st.lists(st.tuples(anything, anything, anything), max_size=40), enabled=st.booleans())
def test_the_stage_of_a_shell_is_safe_for_any_input(data: list[tuple[float, float, float]], enabled: bool) -> None:
    settings = CompensationSettings(enabled=enabled, limit=7.0)
    stage = SafetyStage(settings)
    for target, age, period in data:
        output = stage.step(target, age, period)
        assert math.isfinite(output)
        assert abs(output) <= 7.0
        assert enabled or output == 0.0


def test_silence_ends_at_zero() -> None:
    settings = CompensationSettings(enabled=True, limit=10.0, slew_limit=1000.0, timeout=0.05)
    stage = SafetyStage(settings)
    for _ in range(10):
        stage.step(5.0, age=0.0, period=1e-3)
    assert stage.output == 5.0
    for _ in range(10):
        stage.step(5.0, age=0.06, period=1e-3)
    assert stage.output == 0.0
