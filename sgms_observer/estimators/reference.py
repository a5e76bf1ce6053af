"""The converged solution of eq. 14, as a nonlinear programme in CasADi: what real-time iterations are measured against.

Every step of the model is an equality constraint on its own variable, straight from the formulas; nothing of the
kernels is used but the window's data and a starting point.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi
import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import DataError
from sgms_observer.estimators.estimator import Estimator
from sgms_observer.estimators.interval import advance_forces
from sgms_observer.estimators.layout import (
    COULOMB,
    GAMMA,
    KAPPA,
    LAMBDA,
    MASS,
    MODEL,
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
)
from sgms_observer.estimators.memory import ACCELERATION, COUNT, EFFORT, FACTOR, IS_USED, VELOCITY
from sgms_observer.formulas import symbolic
from sgms_observer.friction.symbolic import element_residual

SOLVERS: dict[str, dict[str, Any]] = {
    "ipopt": {
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "print_time": False,
        "ipopt.tol": 1e-10,
        "ipopt.max_iter": 500,
        "ipopt.mu_init": 1e-6,
        "ipopt.bound_push": 1e-10,
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
    """A solved window.

    Attributes:
        forces: element forces at the nodes [N], shape (count + 1, n_z).
        p: parameters as shares of their nominal value, shape (n_p,).
        cost: eq. 14, without the factor 1/2 [-].
        is_converged: whether the solver said so.
    """

    forces: Floats
    p: Floats
    cost: float
    is_converged: bool


class _SymbolicModel:
    """The estimator's model with the symbols p in place."""

    def __init__(self, estimator: Estimator, p: casadi.SX) -> None:
        self.formulas = symbolic("friction")
        self.is_paper_reset = estimator.model.scalars[RESET] == PAPER_RESET
        self.scalars = [casadi.SX(float(value)) for value in estimator.model.scalars]
        self.elements = [[casadi.SX(float(value)) for value in row] for row in estimator.model.elements]
        for j, (kind, scale) in enumerate(zip(estimator.parameters.kinds, estimator.parameters.scale, strict=True)):
            if kind == P_KAPPA:
                self.elements[KAPPA] = [value * p[j] for value in self.elements[KAPPA]]
            else:
                self.scalars[SLOT[int(kind)]] = p[j] * scale

    def levels(self, velocity: float, factor: float) -> list[casadi.SX]:
        """Return nu s(v) of each element [N]."""
        s = self.formulas.stribeck_level(velocity, self.scalars[STATIC], self.scalars[COULOMB], self.scalars[STRIBECK])
        return [nu * factor * s for nu in self.elements[NU]]

    def gain(self, velocity: float) -> Any:
        """Return the reset's gain (eq. 7)."""
        reset = self.formulas.reset_gain_paper if self.is_paper_reset else self.formulas.reset_gain_rate_independent
        return reset(abs(velocity), self.scalars[GAMMA], self.scalars[STRIBECK])

    def step_residuals(
        self, after: casadi.SX, before: casadi.SX, velocity: float, period: float, factor: float
    ) -> list[casadi.SX]:
        """Return one equation per element, zero where ``after`` follows from ``before``."""
        smoothing = (self.scalars[LAMBDA], self.scalars[ZETA], self.gain(velocity))
        return [
            element_residual(
                after[i], before[i], casadi.SX(velocity), casadi.SX(period), self.elements[KAPPA][i], level, *smoothing
            )
            for i, level in enumerate(self.levels(velocity, factor))
        ]

    def effort(self, force: casadi.SX, velocity: float, acceleration: float, factor: float) -> casadi.SX:
        """Return the effort that the model expects: eq. 3, inertia and offset [N]."""
        rates = [
            self.formulas.sgms_deflection_rate(
                velocity,
                np.sign(velocity) * force[i] / level,
                self.scalars[LAMBDA],
                self.scalars[ZETA],
                self.gain(velocity),
            )
            for i, level in enumerate(self.levels(velocity, factor))
        ]
        friction = self.formulas.friction_output(
            casadi.vertsplit(force), rates, self.elements[SIGMA], self.scalars[VISCOUS], velocity
        )
        total: casadi.SX = friction + self.scalars[MASS] * acceleration + self.scalars[OFFSET]
        return total


class WindowProgramme:
    """Eq. 14 for an estimator's present window, for any NLP solver; the estimator is left as it is.

    Variables are p and, as shares of nu f_C, the element forces at the nodes and after every step.

    Args:
        estimator: an S-GMS moving horizon estimator with at least one interval in its window.

    Raises:
        DataError: if the estimator runs the GMS model or its window is empty.
    """

    def __init__(self, estimator: Estimator) -> None:
        memory = estimator.memory
        count = int(memory.flags[COUNT])
        if int(estimator.model.scalars[MODEL]) != SGMS or count == 0:
            raise DataError("the converged reference needs the S-GMS model and a window with an interval in it")
        self._estimator = estimator
        self._memory = memory
        self._scale = estimator.model.elements[NU] * estimator.model.scalars[COULOMB]
        p = casadi.SX.sym("p", estimator.sizes.n_p)
        self._model = _SymbolicModel(estimator, p)
        self._variables, self._start = [p], [np.array(memory.p)]
        self._equations: list[casadi.SX] = []
        self._shares: list[casadi.SX] = []
        self._residuals: list[casadi.SX] = []
        node = self._add_node(0)
        factor = np.linalg.cholesky(memory.prior_covariance)
        self._residuals.append(casadi.solve(casadi.DM(factor), casadi.vertcat(node, p) - memory.prior))
        for k in range(count):
            end = self._add_interval(k, node)
            node = self._add_node(k + 1)
            self._residuals.append((node - end) / np.sqrt(estimator.process))
            self._add_measurement(k + 1, node)

    def solve(self, solver: str = "ipopt") -> Solution:
        """Solve from the estimator's present estimate.

        Args:
            solver: a key of ``SOLVERS``.
        """
        limits = self._estimator.parameters
        free = np.full(sum(v.numel() for v in self._variables[1:]), np.inf)
        equations, shares = casadi.vertcat(*self._equations), casadi.vertcat(*self._shares)
        bound = np.concatenate([np.zeros(equations.numel()), np.ones(shares.numel())])
        problem = {
            "x": casadi.vertcat(*self._variables),
            "f": casadi.sumsqr(casadi.vertcat(*self._residuals)),
            "g": casadi.vertcat(equations, shares),
        }
        function = casadi.nlpsol("window", solver, problem, SOLVERS[solver])
        answer = function(
            x0=np.concatenate(self._start),
            lbx=np.concatenate([limits.lower, -free]),
            ubx=np.concatenate([limits.upper, free]),
            lbg=-bound,
            ubg=bound,
        )
        values = casadi.vertsplit(answer["x"], np.cumsum([0] + [v.numel() for v in self._variables]).tolist())
        names = [v[0].name() for v in self._variables[1:]]
        nodes = [np.array(v).ravel() * self._scale for v, name in zip(values[1:], names, strict=True) if name[0] == "n"]
        return Solution(
            forces=np.array(nodes),
            p=np.array(values[0]).ravel(),
            cost=float(answer["f"]),
            is_converged=bool(function.stats()["success"]),
        )

    def _add(self, name: str, value: Floats) -> casadi.SX:
        """Add element forces as variables and return them in newton."""
        variable = casadi.SX.sym(name, len(self._scale))
        self._variables.append(variable)
        self._start.append(value / self._scale)
        force: casadi.SX = variable * self._scale
        return force

    def _add_node(self, k: int) -> casadi.SX:
        """Add a node with its bounds (14d)."""
        force = self._add(f"node{k}_", np.array(self._memory.forces[k]))
        record = self._memory.measurements[k]
        beta = self._estimator.tuning.beta
        for i, level in enumerate(self._model.levels(float(record[VELOCITY]), float(record[FACTOR]))):
            self._shares.append(force[i] / (beta * level))
        return force

    def _add_interval(self, k: int, force: casadi.SX) -> casadi.SX:
        """Add every step of interval k and return the forces at its end."""
        memory = self._memory
        value = np.array(memory.forces[k])
        for j in range(memory.velocities.shape[1]):
            velocity, period, factor = (float(row[k, j]) for row in (memory.velocities, memory.periods, memory.factors))
            if velocity == 0.0:
                continue
            advance_forces(memory.scalars, memory.elements, value, np.zeros(len(value)), velocity, period, factor)
            after = self._add(f"step{k}_{j}_", value)
            self._equations += self._model.step_residuals(after, force, velocity, period, factor)
            force = after
        return force

    def _add_measurement(self, k: int, force: casadi.SX) -> None:
        """Add the measurement at node k (14c)."""
        record = self._memory.measurements[k]
        if record[IS_USED] > 0.0:
            modelled = self._model.effort(
                force, float(record[VELOCITY]), float(record[ACCELERATION]), float(record[FACTOR])
            )
            self._residuals.append((record[EFFORT] - modelled) / np.sqrt(self._estimator.tuning.variance))
