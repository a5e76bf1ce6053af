"""Other solvers on the very windows of the estimator, in the same run: CasADi's, built once, and do-mpc as it comes."""

from __future__ import annotations

import logging
import warnings
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import casadi
import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.bench.accuracy import converged, newest_force
from sgms_observer.bench.problem import MASS, PER_INTERVAL, PERIOD, Problem, improve
from sgms_observer.bench.timing import Timing, undisturbed
from sgms_observer.estimators.estimator import Estimator
from sgms_observer.estimators.layout import NU
from sgms_observer.estimators.memory import ACCELERATION, EFFORT, VELOCITY
from sgms_observer.formulas import symbolic

_NEWTON = 3

OPTIONS: dict[str, dict[str, Any]] = {
    "sqpmethod": {
        "max_iter": 1,
        "qpsol": "qrqp",
        "qpsol_options": {"print_iter": False, "print_header": False, "error_on_fail": False},
        "print_time": False,
        "print_header": False,
        "print_iteration": False,
        "print_status": False,
        "error_on_fail": False,
    },
    "ipopt": {
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.tol": 1e-8,
        "ipopt.mu_init": 1e-6,
        "ipopt.bound_push": 1e-8,
        "ipopt.bound_frac": 1e-8,
        "ipopt.warm_start_init_point": "yes",
        "ipopt.warm_start_bound_push": 1e-8,
        "ipopt.warm_start_mult_bound_push": 1e-8,
        "print_time": False,
        "error_on_fail": False,
    },
}

_MAX_ITERATIONS = 300  # of ipopt; now and then a window takes all of the default 3000, seconds long


class StepFormulas:
    """An interval and its measurement as expressions, for any front end over CasADi.

    Args:
        problem: the problem.
    """

    def __init__(self, problem: Problem) -> None:
        self._friction = problem.friction
        self._formulas = symbolic("friction")
        self._share_unit = [nu * problem.friction.coulomb_force for nu in problem.friction.element_fraction]
        u, u0, travel, gain = (casadi.SX.sym(name) for name in ("u", "u0", "travel", "gain"))
        residual = self._formulas.sgms_residual(u, u0, travel, *self._smoothing, gain)
        self._newton = casadi.Function("newton", [u, u0, travel, gain], [u - residual / casadi.jacobian(residual, u)])

    @property
    def _smoothing(self) -> tuple[float, float]:
        return self._friction.smoothing_lambda, self._friction.smoothing_zeta

    def level(self, velocity: Any) -> Any:
        """Return the Stribeck curve s(v) [N]."""
        f = self._friction
        return self._formulas.stribeck_level(velocity, f.static_force, f.coulomb_force, f.stribeck_velocity)

    def interval(self, shares: Any, kappa_share: Any, velocity: Any) -> Any:
        """Return the element forces after an interval.

        Args:
            shares: element forces over nu f_C, shape (n_z,).
            kappa_share: kappa over its nominal value.
            velocity: of each step [m/s], shape (PER_INTERVAL,).
        """
        f = self._friction
        forces = casadi.vertsplit(shares)
        for k in range(PER_INTERVAL):
            v = velocity[k]
            direction, unit = casadi.sign(v), f.coulomb_force / self.level(v)
            gain = self._formulas.reset_gain_paper(casadi.fabs(v), f.smoothing_gamma, f.stribeck_velocity)
            for i, (kappa, nu) in enumerate(zip(f.element_stiffness, f.element_fraction, strict=True)):
                before = direction * unit * forces[i]
                travel = kappa * kappa_share * casadi.fabs(v) * PERIOD * unit / (nu * f.coulomb_force)
                stick = before + travel
                slip = stick / (1.0 + travel)
                u = casadi.fmin(casadi.fmax(f.smoothing_zeta, casadi.fmin(stick, slip)), casadi.fmax(stick, slip))
                for _ in range(_NEWTON):
                    u = self._newton(u, before, travel, gain)
                forces[i] = direction * u / unit
        return casadi.vertcat(*forces)

    def effort(self, shares: Any, velocity: Any, acceleration: Any) -> Any:
        """Return the effort that the model expects [N]; the elements of the problem have no damping of their own."""
        force = casadi.dot(casadi.DM(self._share_unit), shares)
        return force + self._friction.viscous_coefficient * velocity + MASS * acceleration


class ParametricWindow:
    """Eq. 14 for every window of a problem, built once: arrival cost, velocities and efforts are its parameters.

    Args:
        problem: the problem.
        estimator: an estimator of it, for sizes and weights.
        solver: a key of ``OPTIONS``; both solvers get the Gauss-Newton Hessian.
    """

    def __init__(self, problem: Problem, estimator: Estimator, solver: str) -> None:
        formulas = StepFormulas(problem)
        n, d, count = estimator.sizes.n_z, estimator.sizes.augmented, problem.horizon
        self._unit = estimator.model.elements[NU] * problem.friction.coulomb_force
        self._unit_x = np.append(self._unit, 1.0)
        self._limits = estimator.parameters.lower, estimator.parameters.upper
        self._problem, self._beta = problem, estimator.tuning.beta
        kappa = casadi.SX.sym("kappa")
        nodes = [casadi.SX.sym(f"node{k}", n) for k in range(count + 1)]
        prior, factor = casadi.SX.sym("prior", d), casadi.SX.sym("factor", d, d)
        velocity, data = casadi.SX.sym("velocity", PER_INTERVAL, count), casadi.SX.sym("data", 3, count)
        terms = [factor @ (casadi.vertcat(nodes[0], kappa) - prior)]
        for k in range(count):
            end = formulas.interval(nodes[k], kappa, velocity[:, k])
            terms.append((nodes[k + 1] - end) * casadi.DM(self._unit / np.sqrt(estimator.process)))
            modelled = formulas.effort(nodes[k + 1], data[1, k], data[2, k])
            terms.append((data[0, k] - modelled) / float(np.sqrt(estimator.tuning.variance)))
        residuals, x = casadi.vertcat(*terms), casadi.vertcat(kappa, *nodes)
        p = casadi.vertcat(prior, casadi.vec(factor), casadi.vec(velocity), casadi.vec(data))
        slopes = casadi.jacobian(residuals, x)
        weight, none = casadi.SX.sym("lam_f"), casadi.SX.sym("lam_g", 0)
        square = 2.0 * weight * slopes.T @ slopes
        hessian = casadi.Function(
            "hessian", [x, p, weight, none], [casadi.triu(square) if solver == "ipopt" else square]
        )
        self._solver = casadi.nlpsol(
            "window", solver, {"x": x, "p": p, "f": casadi.sumsqr(residuals)}, {**OPTIONS[solver], "hess_lag": hessian}
        )

    def arguments(self, estimator: Estimator) -> dict[str, Floats]:
        """Return a window as the solver's arguments, started from the estimator's present estimate."""
        memory = estimator.memory
        factor = np.linalg.inv(np.linalg.cholesky(memory.prior_covariance)) * self._unit_x
        records = memory.measurements[1:]
        data = np.stack([records[:, EFFORT], records[:, VELOCITY], records[:, ACCELERATION]])
        f = self._problem.friction
        speed = memory.measurements[:, VELOCITY]
        level = f.coulomb_force + (f.static_force - f.coulomb_force) * np.exp(-((speed / f.stribeck_velocity) ** 2))
        bound = np.repeat(self._beta * level / f.coulomb_force, len(self._unit))
        return {
            "x0": np.concatenate([memory.p, (memory.forces / self._unit).ravel()]),
            "p": np.concatenate(
                [memory.prior / self._unit_x, factor.ravel(order="F"), memory.velocities.ravel(), data.ravel(order="F")]
            ),
            "lbx": np.concatenate([self._limits[0], -bound]),
            "ubx": np.concatenate([self._limits[1], bound]),
        }

    def solve(self, arguments: dict[str, Floats]) -> Any:
        """Return CasADi's answer; this call is what is timed."""
        return self._solver(**arguments)

    def newest_force(self, answer: Any) -> float:
        """Return the sum of the element forces at the newest node [N]."""
        return float(np.array(answer["x"]).ravel()[-len(self._unit) :] @ self._unit)


def _time_do_mpc(problem: Problem, estimator: Estimator) -> tuple[list[float], list[float]]:
    """Return seconds of each ``make_step`` of do-mpc with a full window, and the force at its newest nodes [N]."""
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


@dataclass(frozen=True)
class Peer:
    """A peer's time, and how far its answer is from ours.

    Attributes:
        timing: of one call, without building the programme.
        difference: median difference of the friction force: sqpmethod from one real-time iteration of ours, ipopt
            from our converged solution, do-mpc (whose arrival cost is its own) from our estimate [N].
        calls: how many were timed.
    """

    timing: Timing
    difference: float
    calls: int


def time_casadi(problem: Problem) -> dict[str, Peer]:
    """Time sqpmethod, one iteration, and ipopt, converged, from the estimator's warm start in every full window."""
    estimator = problem.estimator()
    windows = {solver: ParametricWindow(problem, estimator, solver) for solver in OPTIONS}
    seconds: dict[str, list[float]] = {solver: [] for solver in OPTIONS}
    differences: dict[str, list[float]] = {solver: [] for solver in OPTIONS}
    with undisturbed():
        for _, is_full in problem.windows(estimator):
            if not is_full:
                improve(estimator.flat)
                continue
            exact = newest_force(converged(estimator.flat))
            answers = {}
            for solver, window in windows.items():
                arguments = window.arguments(estimator)
                start = perf_counter()
                answer = window.solve(arguments)
                seconds[solver].append(perf_counter() - start)
                answers[solver] = window.newest_force(answer)
            improve(estimator.flat)
            differences["sqpmethod"].append(abs(answers["sqpmethod"] - newest_force(estimator.flat)))
            differences["ipopt"].append(abs(answers["ipopt"] - exact))
    return {
        f"casadi_{solver}": Peer(
            Timing.of(seconds[solver]), float(np.median(differences[solver])), len(seconds[solver])
        )
        for solver in OPTIONS
    }


def time_peers(problem: Problem) -> tuple[dict[str, Peer | None], list[str]]:
    """Time every peer.

    Returns:
        Name to result, None for a peer that is not installed; and a sentence for each of those.
    """
    found: dict[str, Peer | None] = dict(time_casadi(problem))
    estimator = problem.estimator()
    ours = []
    for _, is_full in problem.windows(estimator):
        improve(estimator.flat)
        if is_full:
            ours.append(newest_force(estimator.flat))
    try:
        seconds, forces = _time_do_mpc(problem, estimator)
    except ImportError:
        found["do_mpc"] = None
        return found, ["do-mpc is not installed, so it is not timed: pip install 'sgms_observer[bench]'"]
    found["do_mpc"] = Peer(Timing.of(seconds), float(np.median(np.abs(np.subtract(forces, ours)))), len(seconds))
    return found, []
