"""The quadratic programme of one Gauss-Newton iteration: filter forward, smooth backward, bounds by an active set."""

from __future__ import annotations

from sgms_observer.estimators.kalman import (
    correct_scalar,
    propagate_covariance,
    propagate_deviation,
    smooth_back,
    smooth_back_transition,
)
from sgms_observer.estimators.layout import NU, Floats, ParameterArrays, copy_matrix, copy_vector
from sgms_observer.estimators.memory import COUNT, IS_USED, LEVEL, Memory
from sgms_observer.jit import njit_bare

_MAX_ACTIVE_SET_PASSES = 12
_BOUND_TOLERANCE = 1e-9


@njit_bare
def bound_of(memory: Memory, node: int, index: int, beta: float, parameters: ParameterArrays, side: float) -> float:
    """Return the bound (14d, 14e) of entry ``index`` of x at a node; ``side`` is -1 or +1."""
    n_z = memory.now.shape[0]
    if index >= n_z:
        return float(parameters.upper[index - n_z] if side > 0.0 else parameters.lower[index - n_z])
    return float(side * beta * memory.elements[NU, index] * memory.measurements[node, LEVEL])


@njit_bare
def _filter_and_smooth(
    memory: Memory, process: Floats, variance: float, beta: float, parameters: ParameterArrays
) -> bool:
    """Solve the equality-constrained subproblem into ``memory.steps``; return whether the active set is right."""
    n_z = memory.now.shape[0]
    d = memory.x_hat.shape[0]
    count = int(memory.flags[COUNT])
    unit = memory.unit
    for k in range(count + 1):
        deviation = memory.deviations[k]
        covariance = memory.covariances[k]
        if k == 0:
            for i in range(d):
                deviation[i] = memory.prior[i] - (memory.forces[0, i] if i < n_z else memory.p[i - n_z])
            copy_matrix(memory.prior_covariance, covariance)
        else:
            copy_vector(memory.deviations[k - 1], deviation)
            copy_matrix(memory.covariances[k - 1], covariance)
            propagate_deviation(deviation, memory.a[k - 1], memory.b[k - 1])
            propagate_covariance(covariance, memory.a[k - 1], memory.b[k - 1], process)
            for i in range(n_z):
                deviation[i] += memory.ends[k - 1, i] - memory.forces[k, i]
        memory.spreads[k, :] = 0.0
        if k > 0 and memory.measurements[k, IS_USED] > 0.0:
            memory.innovations[k, d], memory.spreads[k, d] = correct_scalar(
                deviation, covariance, memory.rows[k], memory.residuals[k], variance, memory.gains[k, d]
            )
        for i in range(d):
            side = memory.active[k, i]
            if side != 0.0:
                present = memory.forces[k, i] if i < n_z else memory.p[i - n_z]
                unit[:] = 0.0
                unit[i] = 1.0
                memory.innovations[k, i], memory.spreads[k, i] = correct_scalar(
                    deviation, covariance, unit, bound_of(memory, k, i, beta, parameters, side) - present, 0.0,
                    memory.gains[k, i],
                )  # fmt: skip
    adjoint = memory.adjoint
    adjoint[:] = 0.0
    is_right = True
    for k in range(count, -1, -1):
        if k < count:
            smooth_back_transition(adjoint, memory.a[k], memory.b[k])
        for i in range(d):
            total = memory.deviations[k, i]
            for j in range(d):
                total -= memory.covariances[k, i, j] * adjoint[j]
            memory.steps[k, i] = total
        for i in range(d - 1, -1, -1):
            if memory.active[k, i] != 0.0:
                unit[:] = 0.0
                unit[i] = 1.0
                pull = smooth_back(adjoint, unit, memory.gains[k, i], memory.innovations[k, i], memory.spreads[k, i])
                if pull * memory.active[k, i] > 0.0:
                    memory.active[k, i] = 0.0
                    is_right = False
        smooth_back(adjoint, memory.rows[k], memory.gains[k, d], memory.innovations[k, d], memory.spreads[k, d])
    return is_right


@njit_bare
def solve_subproblem(
    memory: Memory, process: Floats, variance: float, beta: float, parameters: ParameterArrays
) -> None:
    """Solve the quadratic programme of one Gauss-Newton iteration into ``memory.steps``.

    Args:
        memory: the estimator's memory, its window linearised.
        process: variances of Q, shape (n_z,).
        variance: R [N^2].
        beta: state bound of 14d.
        parameters: which parameters are estimated, with their bounds.
    """
    n_z = memory.now.shape[0]
    d = memory.x_hat.shape[0]
    count = int(memory.flags[COUNT])
    memory.active[:, :] = 0.0
    for _ in range(_MAX_ACTIVE_SET_PASSES):
        is_right = _filter_and_smooth(memory, process, variance, beta, parameters)
        for k in range(count + 1):
            last = d if k == 0 else n_z  # p is one variable for the whole window
            for i in range(last):
                if memory.active[k, i] == 0.0:
                    value = memory.steps[k, i] + (memory.forces[k, i] if i < n_z else memory.p[i - n_z])
                    for side in (-1.0, 1.0):
                        bound = bound_of(memory, k, i, beta, parameters, side)
                        if side * (value - bound) > _BOUND_TOLERANCE * (1.0 + abs(bound)):
                            memory.active[k, i] = side
                            is_right = False
        if is_right:
            break
