"""How far real-time iterations are from the converged solution of their own window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.bench.problem import Problem, improve
from sgms_observer.estimators.descent import IMPROVED
from sgms_observer.estimators.memory import COUNT, TOLERANCE, Memory
from sgms_observer.estimators.reference import WindowProgramme

_MAX_ITERATIONS = 60
_CONVERGED = 1e-9  # as the estimator's own converge mode


@dataclass(frozen=True)
class Accuracy:
    """Errors of the friction force at the newest node.

    Attributes:
        rms: root mean square against the converged solution, over all full windows [N].
        largest: the largest of them [N].
        instants: how many windows.
        ipopt_largest: largest difference of the converged solution from ipopt's on the formulas themselves [N].
        ipopt_instants: how many windows were given to ipopt.
    """

    rms: float
    largest: float
    instants: int
    ipopt_largest: float
    ipopt_instants: int


def newest_force(flat: Floats) -> float:
    """Return the sum of the element forces at the window's newest node [N]."""
    memory = Memory(flat)
    return float(memory.forces[int(memory.flags[COUNT])].sum())


def converged(flat: Floats) -> Floats:
    """Return a copy of an estimator's memory whose window is iterated to convergence."""
    copy = flat.copy()
    copy[TOLERANCE] = _CONVERGED
    for _ in range(_MAX_ITERATIONS):
        if improve(copy) != IMPROVED:
            break
    return copy


def accuracy(problem: Problem, iterations: int, ipopt_every: int = 0) -> Accuracy:
    """Run the estimator with a fixed number of iterations and compare every window with its converged solution.

    Args:
        problem: the problem.
        iterations: real-time iterations per correction.
        ipopt_every: windows from one that is also given to ipopt to the next; 0 for none.
    """
    estimator = problem.estimator()
    errors: list[float] = []
    differences: list[float] = []
    for _, is_full in problem.windows(estimator):
        exact = newest_force(converged(estimator.flat))
        if is_full and ipopt_every and len(errors) % ipopt_every == ipopt_every // 2:
            solution = WindowProgramme(estimator).solve("ipopt")
            if solution.is_converged:
                differences.append(abs(float(solution.forces[-1].sum()) - exact))
        for _ in range(iterations):
            if improve(estimator.flat) != IMPROVED:
                break
        if is_full:
            errors.append(abs(newest_force(estimator.flat) - exact))
    return Accuracy(
        rms=float(np.sqrt(np.mean(np.square(errors)))),
        largest=max(errors),
        instants=len(errors),
        ipopt_largest=max(differences, default=float("nan")),
        ipopt_instants=len(differences),
    )
