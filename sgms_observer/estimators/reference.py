"""The converged solution of eq. 14, as a nonlinear programme in CasADi: what real-time iterations are measured against.

Every step of the model is an equality constraint on its own variable, straight from the formulas; nothing of the
kernels is used but the window's data.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi
import numpy as np

from sgms_observer.errors import DataError
from sgms_observer.estimators.estimator import Estimator
from sgms_observer.estimators.layout import (
    COULOMB,
    GAMMA,
    KAPPA,
    LAMBDA,
    MASS,
    NU,
    OFFSET,
    P_KAPPA,
    PAPER_RESET,
    RESET,
    SGMS,
    SIGMA,
    SLOT,
    STATIC,
    STRIBECK,
    VISCOUS,
    ZETA,
    Floats,
)
from sgms_observer.estimators.memory import ACCELERATION, COUNT, EFFORT, FACTOR, IS_USED, VELOCITY
from sgms_observer.formulas import symbolic
from sgms_observer.friction.symbolic import element_residual

SOLVERS = {
    "ipopt": {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.tol": 1e-10,
        "ipopt.max_iter": 500,
        "ipopt.mu_init": 1e-6,
        "ipopt.bound_push": 1e-10,
        "ipopt.sb": "yes",
    },
    "sqpmethod": {
        "print_time": False,
        "print_header": False,
        "print_iteration": False,
        "print_status": False,
        "qpsol": "qrqp",
        "qpsol_options": {"print_iter": False, "print_header": False, "error_on_fail": False},
        "error_on_fail": False,
        "max_iter": 1,
        "hessian_approximation": "gauss-newton",
    },
}


@dataclass(frozen=True)
class Solution:
    """Converged window.

    Attributes:
        forces: element forces at the nodes [N], shape (count + 1, n_z).
        p: parameters as shares of their nominal value, shape (n_p,).
        cost: eq. 14, without the factor 1/2.
        friction: friction at the newest node [N].
        is_converged: whether the solver said so.
    """

    forces: Floats
    p: Floats
    cost: float
    friction: float
    is_converged: bool


@dataclass(frozen=True)
class Programme:
    """Eq. 14 for one window, ready for any NLP solver: ``problem`` with start, bounds and how to read the answer."""

    problem: dict[str, casadi.SX]
    start: Floats
    lower: Floats
    upper: Floats
    force_scale: Floats
    node_at: tuple[slice, ...]
    p_at: slice
    residuals: casadi.SX


def window_programme(estimator: Estimator) -> Programme:
    """State eq. 14 for the estimator's present window, starting from its present estimate.

    Args:
        estimator: an S-GMS moving horizon estimator with at least one interval in its window.

    Returns:
        The programme; its variables are shares of nu f_C and of the nominal parameters.

    Raises:
        DataError: if the estimator runs the GMS model or its window is empty.
    """
    memory = estimator.memory
    model = estimator.model
    count = int(memory.flags[COUNT])
    if int(model.scalars[0]) != SGMS or count == 0:
        raise DataError("the converged reference needs the S-GMS model and a window with an interval in it")
    n_z, n_p = estimator.sizes.n_z, estimator.sizes.n_p
    scale = model.elements[NU] * model.scalars[COULOMB]
    p = casadi.SX.sym("p", n_p)
    scalars, elements = _with_parameters(estimator, p)
    variables, start, lower, upper = [p], [memory.p], [estimator.parameters.lower], [estimator.parameters.upper]
    formulas = symbolic("friction")
    constraints: list[casadi.SX] = []
    residuals: list[casadi.SX] = []
    node_at: list[slice] = []

    def add(name: str, value: Floats) -> casadi.SX:
        variable = casadi.SX.sym(name, n_z)
        node_at.append(slice(sum(v.numel() for v in variables), sum(v.numel() for v in variables) + n_z))
        variables.append(variable)
        start.append(np.asarray(value) / scale)
        return variable * scale

    def level_of(velocity: float, factor: float) -> casadi.SX:
        return factor * formulas.stribeck_level(velocity, scalars[STATIC], scalars[COULOMB], scalars[STRIBECK])

    def gain_of(velocity: float) -> casadi.SX:
        if model.scalars[RESET] == PAPER_RESET:
            return formulas.reset_gain_paper(abs(velocity), scalars[GAMMA], scalars[STRIBECK])
        return formulas.reset_gain_rate_independent(abs(velocity), scalars[GAMMA], scalars[STRIBECK])

    def bound(node: int, force: casadi.SX) -> None:
        record = memory.measurements[node]
        level = level_of(record[VELOCITY], record[FACTOR])
        for i in range(n_z):
            constraints.append(force[i] / (estimator.tuning.beta * elements[NU][i] * level))

    nodes = [add("f0", memory.forces[0])]
    is_bound: list[bool] = []
    bound(0, nodes[0])
    is_bound += [True] * n_z
    factor = np.linalg.cholesky(memory.prior_covariance)
    deviation = casadi.vertcat(nodes[0], p) - memory.prior
    residuals.append(casadi.solve(casadi.DM(factor), deviation))
    chosen = [0]
    for k in range(count):
        force = nodes[-1]
        value = np.array(memory.forces[k])
        for j in range(memory.velocity.shape[1]):
            velocity, period = float(memory.velocity[k, j]), float(memory.period[k, j])
            if velocity == 0.0:
                continue
            level = level_of(velocity, float(memory.factor[k, j]))
            value = _kernel_step(estimator, value, velocity, period, float(memory.factor[k, j]))
            after = add(f"s{k}_{j}", value)
            for i in range(n_z):
                constraints.append(
                    element_residual(
                        after[i], force[i], velocity, period, elements[KAPPA][i], elements[NU][i] * level,
                        scalars[LAMBDA], scalars[ZETA], gain_of(velocity),
                    )  # fmt: skip
                )
                is_bound.append(False)
            force = after
        node = add(f"f{k + 1}", memory.forces[k + 1])
        chosen.append(len(node_at) - 1)
        residuals.append((node - force) / np.sqrt(estimator.process))
        bound(k + 1, node)
        is_bound += [True] * n_z
        nodes.append(node)
        record = memory.measurements[k + 1]
        if record[IS_USED] > 0.0:
            friction = scalars[VISCOUS] * record[VELOCITY]
            level = level_of(record[VELOCITY], record[FACTOR])
            for i in range(n_z):
                u = np.sign(record[VELOCITY]) * node[i] / (elements[NU][i] * level)
                rate = formulas.sgms_deflection_rate(
                    record[VELOCITY], u, scalars[LAMBDA], scalars[ZETA], gain_of(record[VELOCITY])
                )
                friction += node[i] + model.elements[SIGMA, i] * rate
            modelled = friction + scalars[MASS] * record[ACCELERATION] + scalars[OFFSET]
            residuals.append((record[EFFORT] - modelled) / np.sqrt(estimator.tuning.variance))
    stacked = casadi.vertcat(*residuals)
    total = sum(v.numel() for v in variables)
    ends = np.where(is_bound, 1.0, 0.0)
    del lower[1:], upper[1:]
    return Programme(
        problem={"x": casadi.vertcat(*variables), "f": casadi.sumsqr(stacked), "g": casadi.vertcat(*constraints)},
        start=np.concatenate(start),
        lower=np.concatenate([lower[0], np.full(total - n_p, -np.inf), -ends]),
        upper=np.concatenate([upper[0], np.full(total - n_p, np.inf), ends]),
        force_scale=scale,
        node_at=tuple(node_at[i] for i in chosen),
        p_at=slice(0, n_p),
        residuals=stacked,
    )


def solve(estimator: Estimator, solver: str = "ipopt") -> Solution:
    """Solve the estimator's present window to convergence, starting from its present estimate.

    Args:
        estimator: an S-GMS moving horizon estimator with at least one interval in its window.
        solver: a key of ``SOLVERS``.

    Returns:
        The solution; the estimator is left as it was.

    Raises:
        DataError: as ``window_programme``.
    """
    programme = window_programme(estimator)
    size = len(programme.start)
    function = casadi.nlpsol("reference", solver, programme.problem, SOLVERS[solver])
    answer = function(
        x0=programme.start,
        lbx=programme.lower[:size],
        ubx=programme.upper[:size],
        lbg=programme.lower[size:],
        ubg=programme.upper[size:],
    )
    x = np.array(answer["x"]).ravel()
    forces = np.array([x[at] * programme.force_scale for at in programme.node_at])
    p = x[programme.p_at]
    memory = estimator.memory
    velocity = memory.measurements[int(memory.flags[COUNT]), VELOCITY]
    viscous = float(estimator.model.scalars[VISCOUS])
    for kind, scale, value in zip(estimator.parameters.kinds, estimator.parameters.scale, p, strict=True):
        if kind != P_KAPPA and SLOT[kind] == VISCOUS:
            viscous = value * scale
    return Solution(
        forces=forces,
        p=p,
        cost=float(answer["f"]),
        friction=float(forces[-1].sum() + viscous * velocity),
        is_converged=bool(function.stats()["success"]),
    )


def _with_parameters(estimator: Estimator, p: casadi.SX) -> tuple[list[casadi.SX], list[list[casadi.SX]]]:
    """Return the model's scalars and element rows with the symbols p in place."""
    scalars = [casadi.SX(float(value)) for value in estimator.model.scalars]
    elements = [[casadi.SX(float(value)) for value in row] for row in estimator.model.elements]
    for j, (kind, scale) in enumerate(zip(estimator.parameters.kinds, estimator.parameters.scale, strict=True)):
        if kind == P_KAPPA:
            elements[KAPPA] = [value * p[j] for value in elements[KAPPA]]
        else:
            scalars[SLOT[kind]] = p[j] * scale
    return scalars, elements


def _kernel_step(estimator: Estimator, force: Floats, velocity: float, period: float, factor: float) -> Floats:
    """Return a starting point for one step's variables."""
    from sgms_observer.estimators.interval import advance_forces

    memory = estimator.memory
    after = np.array(force)
    advance_forces(memory.scalars, memory.elements, after, np.zeros(len(after)), velocity, period, factor)
    return after
