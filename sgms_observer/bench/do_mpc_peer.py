"""do-mpc's moving horizon estimator on the same recording, as it comes: discrete model, IPOPT, its own arrival cost."""

from __future__ import annotations

import logging
import warnings
from time import perf_counter
from typing import Any

import numpy as np

from sgms_observer.bench.problem import PER_INTERVAL, PERIOD, Problem
from sgms_observer.bench.programme import StepFormulas
from sgms_observer.estimators.estimator import Estimator
from sgms_observer.estimators.layout import NU

_MAX_ITERATIONS = 300  # of ipopt; now and then a window takes all of the default 3000, seconds long


def time_do_mpc(problem: Problem, estimator: Estimator) -> tuple[list[float], list[float]]:
    """Run do-mpc over the recording.

    Args:
        problem: the problem.
        estimator: an estimator of it, for weights and bounds.

    Returns:
        Seconds of each call ``make_step`` with a full window, and the force at each of its newest nodes [N].

    Raises:
        ImportError: do-mpc is not installed.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about features of do-mpc that need other packages
        import do_mpc

        logging.getLogger("do_mpc").setLevel(logging.ERROR)
        return _run(_make(do_mpc, problem, estimator), problem, estimator)


def _make(do_mpc: Any, problem: Problem, estimator: Estimator) -> Any:
    """Return do-mpc's estimator, ready to run."""
    formulas = StepFormulas(problem)
    unit = estimator.model.elements[NU] * problem.friction.coulomb_force
    model = do_mpc.model.Model("discrete")
    shares = model.set_variable("_x", "shares", shape=(len(unit), 1))
    kappa = model.set_variable("_p", "kappa")
    velocity = model.set_variable("_tvp", "velocity", shape=(PER_INTERVAL, 1))
    here = model.set_variable("_tvp", "here", shape=(2, 1))  # velocity and acceleration at the interval's end
    model.set_meas("effort", formulas.effort(shares, here[0], here[1]), meas_noise=True)
    model.set_rhs("shares", formulas.interval(shares, kappa, velocity), process_noise=True)
    model.setup()
    mhe = do_mpc.estimator.MHE(model, ["kappa"])
    mhe.settings.n_horizon = problem.horizon
    mhe.settings.t_step = PER_INTERVAL * PERIOD
    mhe.settings.meas_from_data = True
    mhe.settings.supress_ipopt_output()
    mhe.settings.nlpsol_opts["ipopt.max_iter"] = _MAX_ITERATIONS
    initial = estimator.initial / np.append(unit, 1.0) ** 2
    mhe.set_default_objective(
        P_x=np.diag(1.0 / initial[:-1]),
        P_v=np.eye(1) / estimator.tuning.variance,
        P_p=np.eye(1) / initial[-1:],
        P_w=np.diag(unit**2 / estimator.process),
    )
    bound = estimator.tuning.beta * problem.friction.static_force / problem.friction.coulomb_force
    mhe.bounds["lower", "_x", "shares"], mhe.bounds["upper", "_x", "shares"] = -bound, bound
    mhe.bounds["lower", "_p_est", "kappa"] = estimator.parameters.lower
    mhe.bounds["upper", "_p_est", "kappa"] = estimator.parameters.upper
    _set_motion(mhe, problem)
    mhe.setup()
    mhe.x0, mhe.p_est0 = np.zeros(len(unit)), np.ones(1)
    mhe.set_initial_guess()
    return mhe


def _set_motion(mhe: Any, problem: Problem) -> None:
    """Let do-mpc read the motion of its window."""
    template = mhe.get_tvp_template()
    steps = problem.velocity[: problem.intervals * PER_INTERVAL].reshape(-1, PER_INTERVAL)
    nodes = np.stack([problem.velocity, problem.acceleration], axis=1)[PER_INTERVAL - 1 :: PER_INTERVAL]

    def motion(now: Any) -> Any:
        newest = round(float(np.ravel(now)[0]) / (PER_INTERVAL * PERIOD))
        for k in range(problem.horizon + 1):
            at = np.clip(newest - problem.horizon + 1 + k, 0, len(steps) - 1)
            template["_tvp", k, "velocity"] = steps[at]
            template["_tvp", k, "here"] = nodes[at]
        return template

    mhe.set_tvp_fun(motion)


def _run(mhe: Any, problem: Problem, estimator: Estimator) -> tuple[list[float], list[float]]:
    """Give do-mpc every measurement."""
    unit = estimator.model.elements[NU] * problem.friction.coulomb_force
    seconds, forces = [], []
    efforts = problem.effort[PER_INTERVAL - 1 :: PER_INTERVAL]
    for k in range(problem.intervals):
        measured = efforts[k : k + 1]
        start = perf_counter()
        shares = mhe.make_step(measured)
        if k >= problem.run_in:
            seconds.append(perf_counter() - start)
            forces.append(float(np.ravel(shares) @ unit))
    return seconds, forces
