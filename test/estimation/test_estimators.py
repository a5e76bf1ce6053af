"""EKF and MHE: agreement where they must agree, convergence, recovery, bounds, honesty about failure."""

from __future__ import annotations

import numpy as np
import pytest
from scenario import MASS, PERIOD, Scenario, estimator, sine

from sgms_observer.estimators import block
from sgms_observer.estimators.estimator import Estimator
from sgms_observer.estimators.memory import COUNT
from sgms_observer.filters.motion import Motion, known_motion
from sgms_observer.settings.axis import FrictionSettings
from sgms_observer.status import Status

NOISE = 0.1


def converged_by_casadi(mhe: Estimator) -> np.ndarray:
    """Return the window's converged solution of the formulas themselves."""
    pytest.importorskip("casadi", reason="CasADi is not installed")
    from sgms_observer.estimators.reference import WindowProgramme

    return WindowProgramme(mhe).solve()


def noisy(scenario: Scenario, seed: int, std: float = NOISE) -> np.ndarray:
    return scenario.effort + np.random.default_rng(seed).normal(0.0, std, len(scenario.effort))


def test_status_codes_are_the_sentences() -> None:
    codes = (
        block.RUNNING, block.STARTING, block.PREDICTING, block.SAMPLE_REJECTED,
        block.NOT_CONVERGED, block.WAS_NOT_FINITE, block.DEADLINE, block.RESTARTED,
        block.JUMPED, block.TOO_DENSE,
    )  # fmt: skip
    assert codes == tuple(Status)
    assert all(status.sentence for status in Status)


@pytest.mark.parametrize("estimate_kappa", [False, True])
@pytest.mark.parametrize("horizon", [1, 4, 9])
def test_kf_ekf_and_mhe_agree_on_a_linear_problem(estimate_kappa: bool, horizon: int) -> None:
    """In pure sticking the model is linear in force and stiffness."""
    scenario = sine(amplitude=5e-9)
    effort = noisy(scenario, 3, 0.01)
    settings = {"parameters": ("kappa",) if estimate_kappa else (), "measurement_std": 0.01, "parameter_maximum": 50.0}
    settings |= {"initial_std": 0.05, "process_std": 0.01, "parameter_minimum": 1e-3, "state_bound": 100.0}
    settings |= {"parameter_initial_std": 0.05}
    kalman = estimator("ekf", 1.2, **settings)
    moving = estimator("mhe", 1.2, horizon=horizon, **settings)
    mine = scenario.run(kalman, effort).element_force[19::20]
    theirs = scenario.run(moving, effort).element_force[19::20]
    scale = np.abs(mine).max()
    assert np.abs(mine - theirs).max() <= 1e-8 * scale
    model = estimator("ekf", 1.2, **settings)
    textbook = dense_with(model, scenario, effort)
    assert np.abs(mine - textbook[:, :4]).max() <= 1e-8 * scale
    if estimate_kappa:
        assert np.abs(kalman.memory.x_hat[4] - textbook[-1, 4]) <= 1e-8


def dense_with(model, scenario: Scenario, effort: np.ndarray) -> np.ndarray:
    """The textbook filter with a given estimator's tuning."""
    n, d = 4, 4 + model.sizes.n_p
    x, p = np.concatenate([np.zeros(n), np.ones(d - n)]), np.diag(model.initial)
    stiffness = model.model.elements[0]
    h = np.concatenate([np.ones(n), np.zeros(d - n)])
    states = []
    for k in range(20, len(effort) + 1, 20):
        travel = np.sum(scenario.motion.velocity[k - 20 : k]) * PERIOD
        transition = np.eye(d)
        drive = np.zeros(d)
        if d > n:
            transition[:n, n] = stiffness * travel
        else:
            drive[:n] = stiffness * travel
        x = transition @ x + drive
        p = transition @ p @ transition.T
        p[:n, :n] += np.diag(model.process)
        known = 20.0 * scenario.motion.velocity[k - 1] + MASS * scenario.motion.acceleration[k - 1]
        gain = p @ h / (h @ p @ h + model.tuning.variance)
        x = x + gain * (effort[k - 1] - known - h @ x)
        p = p - np.outer(gain, h @ p)
        states.append(x.copy())
    return np.array(states)


@pytest.mark.parametrize(
    ("kappa", "parameters"), [(0.8, ("kappa",)), (1.2, ("kappa", "coulomb_force", "mass", "viscous_coefficient"))]
)
def test_real_time_iterations_reach_the_converged_solution(kappa: float, parameters: tuple[str, ...]) -> None:
    """Against ipopt on the symbolic model, at instants spread over reversals and sliding."""
    scenario = sine(seconds=0.35)
    effort = noisy(scenario, 1)
    errors = {1: [], 2: [], 0: []}
    for iterations in errors:
        mhe = estimator("mhe", kappa, parameters=parameters, converge=iterations == 0, iterations=max(iterations, 1))
        for at in range(0, len(effort), 20):
            part = slice(at, at + 20)
            mhe.step(Motion(scenario.motion.table[part], 0), effort[part], np.ones(20))
            if at > 1000 and at % 460 == 0:
                exact = converged_by_casadi(mhe)
                assert exact.is_converged
                errors[iterations].append(mhe.memory.forces[4].sum() - exact.forces[-1].sum())
    rms = {key: np.sqrt(np.mean(np.square(values))) for key, values in errors.items()}
    assert rms[1] <= 5e-3
    assert rms[2] <= 1e-4
    assert rms[0] <= 1e-7


@pytest.mark.parametrize("kind", ["ekf", "mhe"])
@pytest.mark.parametrize("model", ["gms", "sgms"])
def test_any_split_into_blocks_gives_the_same_bits(kind: str, model: str) -> None:
    scenario = sine(seconds=0.25)
    effort = noisy(scenario, 2)
    effort[700:760] = np.nan
    make = lambda: estimator(kind, 0.8, {"model": model}, parameters=("kappa",))  # noqa: E731
    whole = scenario.run(make(), effort).table
    for size in (1, 7, 64):
        np.testing.assert_array_equal(scenario.run(make(), effort, size).table, whole)


@pytest.mark.parametrize("model", ["gms", "sgms"])
@pytest.mark.parametrize("kappa", [0.8, 1.2])
def test_stiffness_is_recovered(model: str, kappa: float) -> None:
    """With the true model, from 20 % off, over six periods of noisy data."""
    truth = FrictionSettings(model=model)
    scenario = sine(seconds=1.2, truth=truth)
    mhe = estimator("mhe", kappa, {"model": model}, parameters=("kappa",))
    results = scenario.run(mhe, noisy(scenario, 4))
    assert abs(kappa * results.parameters[-1, 0] - 1.0) < 0.05
    assert results.parameter_std[-1, 0] < results.parameter_std[0, 0]


def test_friction_is_estimated_better_than_measured() -> None:
    scenario = sine(seconds=0.8)
    for kind in ("ekf", "mhe"):
        results = scenario.run(estimator(kind), noisy(scenario, 5))
        error = (results.friction - scenario.friction)[2000:]
        assert np.sqrt(np.mean(error**2)) < NOISE


def test_innovations_are_consistent_when_the_model_is_right() -> None:
    """NIS averaged over seeds inside its 95 % interval (chi-squared, normal approximation)."""
    truth = FrictionSettings(model="sgms")
    scenario = sine(seconds=0.4, truth=truth)
    seeds = 40
    values = []
    for seed in range(seeds):
        ekf = estimator("ekf", process_std=1e-4, initial_std=1e-3)
        results = scenario.run(ekf, noisy(scenario, seed))
        taken = ~np.isnan(results.innovation)
        values.append(np.mean((results.innovation[taken] / results.innovation_std[taken]) ** 2))
    count = seeds * int(taken.sum())
    assert abs(np.mean(values) - 1.0) < 1.96 * np.sqrt(2.0 / count)


def test_bounds_hold_and_the_bounded_programme_is_solved() -> None:
    scenario = sine(seconds=0.3)
    effort = noisy(scenario, 6) * 1.6  # pushes the elements against beta times the curve
    mhe = estimator("mhe", 1.0, parameters=("kappa",), converge=True, state_bound=1.05, parameter_maximum=1.1)
    active = 0
    for at in range(0, len(effort), 20):
        part = slice(at, at + 20)
        mhe.step(Motion(scenario.motion.table[part], 0), effort[part], np.ones(20))
        memory = mhe.memory
        count = int(memory.flags[COUNT])
        level = 1.05 * np.array([memory.measurements[k, -1] for k in range(count + 1)])[:, None]
        share = np.abs(memory.forces[: count + 1]) / (level * mhe.model.elements[1])
        assert share.max() <= 1.0 + 1e-7
        assert memory.p[0] <= 1.1 + 1e-12
        active += int(np.any(memory.active))
        if at > 500 and at % 800 == 0 and count == 4:
            exact = converged_by_casadi(mhe)
            mine = memory.forces[4].sum()
            assert abs(mine - exact.forces[-1].sum()) < 1e-4
    assert active > 10


def test_missing_effort_is_predicted_through_and_said() -> None:
    scenario = sine(seconds=0.4)
    effort = noisy(scenario, 7)
    effort[2000:2400] = np.nan
    results = scenario.run(estimator("mhe", 0.9, parameters=("kappa",)), effort)
    assert set(results.status[2019:2400:20]) == {Status.PREDICTING}
    assert set(results.status[2500:]) == {Status.RUNNING}
    assert np.all(np.isfinite(results.friction))


def test_a_missed_deadline_falls_back_to_the_ekf_and_recovers() -> None:
    scenario = sine(seconds=0.3)
    effort = noisy(scenario, 8)
    mhe = estimator("mhe", 0.9)
    first = Scenario(Motion(scenario.motion.table[:1000], 0), scenario.friction, scenario.effort)
    first.run(mhe, effort[:1000])
    mhe.miss_deadline()
    rest = Scenario(Motion(scenario.motion.table[1000:], 0), scenario.friction, scenario.effort)
    results = rest.run(mhe, effort[1000:])
    assert results.status[19] == Status.FALLBACK_DEADLINE
    assert set(results.status[20:]) == {Status.RUNNING}


@pytest.mark.parametrize("kind", ["ekf", "mhe"])
def test_absurd_values_neither_raise_nor_stay(kind: str) -> None:
    scenario = sine(seconds=0.4)
    effort = noisy(scenario, 9)
    effort[1500:1540] = 1e200
    effort[1600] = np.inf
    table = scenario.motion.table.copy()
    table[1700, 2] = np.nan
    table[1800, 5] = 1e30
    broken = Scenario(Motion(table, 0), scenario.friction, scenario.effort)
    results = broken.run(estimator(kind, 0.9, parameters=("kappa",)), effort)
    assert np.all(np.isfinite(results.friction))
    assert results.status[1700] == Status.FALLBACK_NOT_FINITE
    error = (results.friction - scenario.friction)[3000:]
    assert np.sqrt(np.mean(error**2)) < 2 * NOISE


def test_outliers_are_rejected_when_asked() -> None:
    scenario = sine(seconds=0.4)
    effort = noisy(scenario, 10)
    effort[2019] += 5.0
    results = scenario.run(estimator("mhe", 1.0, outlier_nis=25.0), effort)
    assert results.status[2019] == Status.SAMPLE_REJECTED
    assert (results.status == Status.SAMPLE_REJECTED).sum() == 1


def test_a_gap_restarts_the_forces_but_keeps_what_was_learnt() -> None:
    scenario = sine(seconds=1.0)
    table = scenario.motion.table.copy()
    table[8000, 10] = 1.0
    mhe = estimator("mhe", 0.8, parameters=("kappa",))
    results = Scenario(Motion(table, 0), scenario.friction, scenario.effort).run(mhe, noisy(scenario, 11))
    assert results.status[8000] == Status.RESTARTED_AFTER_GAP
    assert results.parameters[8000, 0] == results.parameters[7999, 0] != 1.0


def test_known_motion_is_what_it_says() -> None:
    motion = known_motion(np.full(3, 0.1), np.array([1.0, 2.0, 3.0]), np.zeros(3))
    np.testing.assert_allclose(motion.position, [0.1, 0.3, 0.6])
    assert motion.is_ready.all() and not motion.is_restart.any()
