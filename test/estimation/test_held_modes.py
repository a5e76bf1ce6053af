"""GMS modes by the paper's a-priori rules: decided at each sample, and no variables of the MHE."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.bench.problem import MASS, PERIOD, make_problem
from sgms_observer.estimators.estimator import Estimator, Results
from sgms_observer.filters.motion import known_motion
from sgms_observer.friction.gms import SLIPS, STICKS, gms_branch, gms_step, gms_step_in_branch
from sgms_observer.settings.axis import EstimatorSettings, FrictionSettings

STIFFNESS, FRACTION, LEVEL, RATE = 0.71e6, 0.3, 4.0, 50.0
LIMIT = FRACTION * LEVEL


@pytest.mark.parametrize("velocity", [1e-3, -1e-3])
def test_the_branch_follows_from_state_mode_and_velocity(velocity: float) -> None:
    sign = 1 if velocity > 0.0 else -1
    assert gms_branch(0.0, 0, velocity, FRACTION, LEVEL) == STICKS
    assert gms_branch(sign * LIMIT, 0, velocity, FRACTION, LEVEL) == SLIPS
    assert gms_branch(-sign * LIMIT, -sign, velocity, FRACTION, LEVEL) == STICKS  # the velocity went through zero
    assert gms_branch(0.5 * sign * LIMIT, sign, velocity, FRACTION, LEVEL) == SLIPS  # a slipping element remembers
    assert gms_branch(sign * LIMIT, sign, 0.0, FRACTION, LEVEL) == STICKS


def test_without_an_event_both_rules_step_alike() -> None:
    for force, mode, branch in ((0.1, 0, STICKS), (1.3, 1, SLIPS), (0.9, 1, SLIPS)):
        exact = gms_step(force, mode, 1e-4, PERIOD, STIFFNESS, FRACTION, LEVEL, RATE)
        assert gms_branch(force, mode, 1e-4, FRACTION, LEVEL) == branch
        held = gms_step_in_branch(force, branch, 1e-4, PERIOD, STIFFNESS, FRACTION, LEVEL, RATE)
        assert held[:2] == exact


def test_an_element_that_arrives_within_a_step_goes_beyond_its_limit() -> None:
    """What the a-priori rules cost: our own step stops at the limit."""
    force = LIMIT - 0.01
    assert gms_step(force, 0, 1e-3, PERIOD, STIFFNESS, FRACTION, LEVEL, RATE)[0] == pytest.approx(LIMIT)
    after, mode, *_ = gms_step_in_branch(force, STICKS, 1e-3, PERIOD, STIFFNESS, FRACTION, LEVEL, RATE)
    assert after == pytest.approx(LIMIT - 0.01 + STIFFNESS * 1e-3 * PERIOD)
    assert after > LIMIT and mode == 0


def _run(gms_modes: str, **changes: object) -> Results:
    problem = make_problem(windows=60)
    settings = EstimatorSettings(kind="mhe", gms_modes=gms_modes, **changes)  # type: ignore[arg-type]
    ones = np.ones(len(problem.velocity))
    motion = known_motion(PERIOD * ones, problem.velocity, problem.acceleration)
    return Estimator(settings, FrictionSettings(model="gms"), MASS).step(motion, problem.effort, ones)


def test_with_held_modes_the_window_is_linear() -> None:
    """No mode is a variable: without parameters one iteration is the converged solution."""
    once, converged = _run("predicted"), _run("predicted", converge=True)
    np.testing.assert_allclose(once.friction, converged.friction, atol=1e-8)
    own = _run("simulated", converge=True)
    assert np.max(np.abs(own.friction - converged.friction)) > 1e-3  # the rules do matter


def test_held_modes_mean_nothing_to_a_smooth_model() -> None:
    problem = make_problem(windows=10)
    ones = np.ones(len(problem.velocity))
    motion = known_motion(PERIOD * ones, problem.velocity, problem.acceleration)
    tables = [
        Estimator(EstimatorSettings(kind="mhe", gms_modes=modes), FrictionSettings(), MASS)
        .step(motion, problem.effort, ones)
        .table
        for modes in ("simulated", "predicted")
    ]
    np.testing.assert_array_equal(tables[0], tables[1])
