"""No input whatever makes the last stage exceed its limits, and it never stays behind what is allowed."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgms_observer.compensation.safety import SafetyStage, safe_output
from sgms_observer.settings.axis import CompensationSettings

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


forces = st.floats(min_value=-50.0, max_value=50.0)


@given(previous=forces, target=forces, reach=st.floats(0.0, 20.0), limit=st.floats(0.0, 40.0))
def test_output_is_the_nearest_that_is_allowed(previous: float, target: float, reach: float, limit: float) -> None:
    """Safe alone would also be an output that never moves."""
    output = safe_output(previous, target, 0.5, limit, 2.0 * reach)
    slewed = sorted((previous - reach, target, previous + reach))[1]
    assert output == pytest.approx(sorted((-limit, slewed, limit))[1], abs=1e-12)


@pytest.mark.parametrize(
    ("previous", "target", "period", "slew", "output"),
    [
        (2.0, 9.0, 0.0, 1000.0, 2.0),  # no time, no motion
        (2.0, 9.0, -1e-3, 1000.0, 2.0),
        (2.0, 9.0, math.nan, 1000.0, 2.0),
        (2.0, 9.0, 1e-3, 0.0, 2.0),
        (2.0, 9.0, 1e-3, -1000.0, 2.0),
        (2.0, 9.0, 1e-3, -0.5, 2.0),
        (2.0, 9.0, 1e-3, math.nan, 2.0),
        (2.0, math.nan, 1e-3, 500.0, 1.5),  # what is no number counts as zero, and zero is approached like any other
        (2.0, math.nan, 1.0, 500.0, 0.0),
        (2.0, math.inf, 1e-3, 500.0, 1.5),
        (2.0, -math.inf, 1e-3, 500.0, 1.5),
        (math.nan, 9.0, 1e-3, 500.0, 0.5),
        (math.inf, 9.0, 1e-3, 500.0, 0.5),
        (2.0, 9.0, math.inf, 1000.0, 9.0),
        (2.0, 9.0, 1.0, 0.5, 2.5),
        (30.0, 30.0, 1e-3, 1000.0, 10.0),  # the limit comes first
        (-30.0, -30.0, 1e-3, 1000.0, -10.0),
    ],
)
def test_what_is_no_number_and_what_is_not_positive(
    previous: float, target: float, period: float, slew: float, output: float
) -> None:
    assert safe_output(previous, target, period, 10.0, slew) == output


@pytest.mark.parametrize("limit", [0.0, -10.0, math.nan])
def test_a_limit_that_is_not_positive_allows_nothing(limit: float) -> None:
    assert safe_output(2.0, 9.0, 1.0, limit, 1000.0) == 0.0


@pytest.mark.parametrize("limit", [1e-3, 0.5, 1.0])
def test_a_small_limit_is_used_up(limit: float) -> None:
    assert safe_output(0.0, 9.0, 1.0, limit, 1000.0) == limit


def test_without_a_limit_the_largest_numbers_stay_finite() -> None:
    assert safe_output(0.0, 9.0, 1.0, math.inf, 1000.0) == 9.0
    assert safe_output(-1.7e308, 1.7e308, math.inf, math.inf, math.inf) == 1.0e300


@pytest.mark.parametrize(
    ("age", "is_fresh"),
    [(0.0, True), (0.05, True), (math.nextafter(0.05, 1.0), False), (-1e-9, False), (math.nan, False)],
)
def test_a_sample_is_fresh_from_its_time_to_the_timeout(age: float, is_fresh: bool) -> None:
    """One from the future is not: somebody's clock is wrong."""
    stage = SafetyStage(CompensationSettings(enabled=True, limit=10.0, slew_limit=1000.0, timeout=0.05))
    assert stage.output == 0.0
    assert stage.step(5.0, age, 1e-3) == stage.output == (1.0 if is_fresh else 0.0)
