"""The gap: its three parts, its closure, and that no effect on the way of the effort can erase it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from workflow_case import AXIS, record

from sgms_observer.diagnosis.gap import Gap, effort_rms, residuals, rms
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.settings.axis import EffectSettings

MODEL = Model.of(AXIS)
RATE = 250.0


def gap_of(before: float, after: float, floor: float) -> Gap:
    """Return a gap with these figures."""
    intervals = ((0.9 * before, 1.1 * before), (0.9 * after, 1.1 * after))
    return Gap(before, before, after, floor, floor, before, after, *intervals, "held-out", 25.0, 1.1)


@settings(derandomize=True, max_examples=50)
@given(st.floats(0.0, 50.0), st.floats(0.0, 50.0), st.floats(1e-3, 50.0))
def test_the_squares_of_the_three_parts_add_up(named: float, predictable: float, floor: float) -> None:
    after = float(np.hypot(predictable, floor))
    gap = gap_of(float(np.hypot(named, after)), after, floor)
    total = gap.named**2 + gap.predictable**2 + gap.floor**2
    assert total == pytest.approx(gap.before**2, rel=1e-9)
    assert gap.named == pytest.approx(named, abs=1e-4) and gap.predictable == pytest.approx(predictable, abs=1e-4)


def test_closure_is_null_where_there_is_nothing_to_close() -> None:
    assert gap_of(1.1, 1.0, 1.0).closure is None
    assert gap_of(4.0, 1.0, 1.0).closure == pytest.approx(1.0)
    assert gap_of(4.0, 4.0, 1.0).closure == pytest.approx(0.0)
    worse = gap_of(4.0, 7.0, 1.0)
    assert worse.closure is not None and worse.closure < 0.0 and worse.named == 0.0


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("actuator_dead_zone", (1.0e6,)),
        ("actuator_dead_zone", (100.0,)),
        ("actuator_saturation", (1.0e-6,)),
        ("actuator_saturation", (0.5,)),
        ("actuator_gain", (0.1,)),
        ("actuator_gain", (10.0,)),
        ("actuator_delay", (0.02,)),
    ],
)
@pytest.mark.parametrize("mass", [5.0, 3.0])
def test_an_effect_that_erases_the_measurement_closes_nothing(
    name: str, values: tuple[float, ...], mass: float
) -> None:
    motion = motion_of(record(duration=8.0, period=1.0 / RATE), band=25.0)
    model = Model(mass, MODEL.friction)
    plain = rms(residuals(model, [motion]))
    assert plain < effort_rms([motion], [np.ones(len(motion.thinned(motion.time)))])
    assert rms(residuals(model.with_effects([EffectSettings(name, values)]), [motion])) > plain
