"""Fits: where they end does not hang on where they start, and bounds are reached."""

from dataclasses import replace

import numpy as np
import pytest
from workflow_case import AXIS, record

from sgms_observer.diagnosis.fit import RefitSetup, limits
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.settings.axis import EffectSettings

MODEL = Model.of(AXIS)
TOLERANCE = 0.05
COGGING = EffectSettings("cogging", (0.8, 0.004, 1.0, 0.0, 0.0))
PHASE = [(0, 2), (0, 3), (0, 4)]


def setup_for(*effects: EffectSettings, mass: float = 5.0) -> RefitSetup:
    """Return the setup of a fit to a stage with these effects and this mass."""
    motion = motion_of(record(effects, mass=mass))
    return RefitSetup(data_with_own_noise((motion,), MODEL), MODEL, TOLERANCE)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_fit_ends_at_the_same_cost_wherever_it_starts(seed: int) -> None:
    setup = setup_for(COGGING)
    rng = np.random.default_rng(seed)
    start = 0.5 * limits(MODEL, TOLERANCE) * rng.uniform(-1.0, 1.0, len(MODEL.parameter_names()))
    weak = replace(COGGING, values=(0.4, 0.00402, 1.0, 0.0, 0.0))
    one, other = setup.fit((COGGING,), None, PHASE), setup.fit((weak,), start, PHASE)
    assert one.is_converged and other.is_converged
    assert other.cost == pytest.approx(one.cost, rel=1.0e-3)
    assert other.effects[0].values == pytest.approx(one.effects[0].values, rel=0.01)


def test_what_lies_beyond_its_tolerance_ends_exactly_at_it() -> None:
    found = setup_for(mass=5.5).fit(())
    assert found.is_converged
    assert found.logs[0] == np.log1p(TOLERANCE)


def test_one_evaluation_gives_derivatives_and_moves_nothing() -> None:
    setup = setup_for(COGGING)
    start = 0.01 * np.ones(len(MODEL.parameter_names()))
    found = setup.fit((COGGING,), start, PHASE, evaluations=1)
    assert np.array_equal(found.logs, start) and found.effects == (COGGING,)
    assert np.all(np.any(found.jacobian != 0.0, axis=0))


def test_held_values_stay_and_have_derivatives() -> None:
    setup = setup_for(COGGING)
    weak = replace(COGGING, values=(0.4, 0.004, 1.0, 0.0, 0.0))
    found = setup.fit((weak,), None, PHASE, is_nominal_held=True)
    assert not found.logs.any()
    assert found.effects[0].values[0] == pytest.approx(0.8, rel=0.02)
    assert np.all(np.any(found.jacobian != 0.0, axis=0))


@pytest.mark.parametrize(
    ("amplitude", "phase", "ends_at"),
    [(0.77, 1.03, (0.8, 1.0)), (0.7, 0.9, (0.735, 0.95))],
    ids=["within the tolerance", "at its end"],
)
def test_strengths_and_angles_of_the_file_follow_the_recording_within_the_tolerance(
    amplitude: float, phase: float, ends_at: tuple[float, float]
) -> None:
    given = EffectSettings("cogging", (amplitude, 0.004, phase, 0.0, 0.0))
    setup = replace(setup_for(COGGING), file_effects=(given,), held_effects=frozenset({"cogging"}))
    found = setup.fit((given,)).effects[0].values
    assert found[0] == pytest.approx(ends_at[0], abs=0.015) and found[2] == pytest.approx(ends_at[1], abs=0.015)
    assert found[1] == 0.004 and found[3:] == (0.0, 0.0)


def test_without_an_effect_of_the_file_it_stays_within_its_tolerance() -> None:
    """A changed value that does not last goes back to the file's; an added effect goes away."""
    given, changed = EffectSettings("offset", (0.5,)), EffectSettings("offset", (0.8,))
    setup = replace(setup_for(COGGING), file_effects=(given,))
    alone, effects = setup.without("offset", (changed, COGGING))
    assert effects == (given, COGGING) and alone.held_effects == {"offset"}
    assert alone.fit(effects, None, [(1, 2), (1, 3), (1, 4)]).effects[0].values == pytest.approx((0.475,))
    alone, effects = setup.without("cogging", (changed, COGGING))
    assert effects == (changed,) and alone is setup


@pytest.mark.parametrize(
    ("of_file", "found_values"),
    [
        (None, (0.8, 0.004, 1.0, 0.0, 0.0)),
        ((-0.8, 0.004, 1.0 - np.pi, 0.0, 0.0), (-0.8, 0.004, 1.0 - np.pi, 0.0, 0.0)),
        ((0.8, 0.004, 6.0, 0.0, 0.0), (0.8, 0.004, 1.0, 0.0, 0.0)),  # 1 + 2 pi lies beyond the range of the angle
    ],
)
def test_a_sine_is_written_as_the_file_writes_it_or_with_a_positive_amplitude(
    of_file: tuple[float, ...] | None, found_values: tuple[float, ...]
) -> None:
    listed = () if of_file is None else (replace(COGGING, values=of_file),)
    setup = replace(setup_for(COGGING), file_effects=listed)
    start = replace(COGGING, values=(-0.7, 0.004, 1.1 + np.pi, 0.0, 0.0))
    fixed = [(0, 3), (0, 4)]
    found = setup.fit((start,), None, fixed)
    assert found.effects[0].values == pytest.approx(found_values, rel=0.02, abs=0.02)
    assert found.model.effects == found.effects
    again = setup.fit(found.effects, found.logs, fixed, evaluations=1)
    assert again.cost == pytest.approx(found.cost, rel=1.0e-9)
    assert again.jacobian == pytest.approx(found.jacobian, rel=1.0e-3, abs=1.0e-3 * np.abs(found.jacobian).max())
