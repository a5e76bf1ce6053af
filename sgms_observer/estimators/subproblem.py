"""The quadratic programme of one Gauss-Newton iteration: filter forward, smooth backward, bounds by an active set."""

from __future__ import annotations

from sgms_observer.arrays import Floats
from sgms_observer.estimators import memory as at
from sgms_observer.estimators.kalman import (
    correct_scalar,
    propagate_covariance,
    propagate_deviation,
    smooth_back,
    smooth_back_transition,
)
from sgms_observer.estimators.layout import NU, copy_matrix, copy_vector
from sgms_observer.estimators.memory import layer, matrix, vector
from sgms_observer.jit import njit_bare

_MAX_ACTIVE_SET_PASSES = 12
_BOUND_TOLERANCE = 1e-9


@njit_bare
def bound_of(flat: Floats, node: int, index: int, side: float) -> float:
    """Return the bound (14d, 14e) of entry ``index`` of x at a node; ``side`` is -1 or +1."""
    n_z = int(flat[at.N_Z])
    if index >= n_z:
        return float(vector(flat, at.UPPER)[index - n_z] if side > 0.0 else vector(flat, at.LOWER)[index - n_z])
    level = matrix(flat, at.MEASUREMENTS)[node, at.LEVEL]
    return float(side * flat[at.BETA] * matrix(flat, at.ELEMENTS)[NU, index] * level)


@njit_bare
def prior_deviation(flat: Floats, deviation: Floats) -> None:
    """Write the deviation of the prior from the first node of the window; shape (n_z + n_p,)."""
    prior, forces, p = vector(flat, at.PRIOR), matrix(flat, at.FORCES), vector(flat, at.P)
    n_z = forces.shape[1]
    for i in range(n_z):
        deviation[i] = prior[i] - forces[0, i]
    for j in range(p.shape[0]):
        deviation[n_z + j] = prior[n_z + j] - p[j]


@njit_bare
def _filter_forward(flat: Floats) -> None:
    """Filter the window's deviations from node to node; active bounds enter as exact measurements."""
    forces, p, ends = matrix(flat, at.FORCES), vector(flat, at.P), matrix(flat, at.ENDS)
    deviations, a, rows = matrix(flat, at.DEVIATIONS), matrix(flat, at.A), matrix(flat, at.ROWS)
    residuals, measurements = vector(flat, at.RESIDUALS), matrix(flat, at.MEASUREMENTS)
    innovations, innovation_covariances, active = (
        matrix(flat, at.INNOVATIONS),
        matrix(flat, at.INNOVATION_COVARIANCES),
        matrix(flat, at.ACTIVE),
    )
    process, unit = vector(flat, at.PROCESS), vector(flat, at.UNIT)
    n_z, d = forces.shape[1], unit.shape[0]
    for k in range(int(flat[at.COUNT]) + 1):
        deviation, covariance, gains = deviations[k], layer(flat, at.COVARIANCES, k), layer(flat, at.GAINS, k)
        if k == 0:
            prior_deviation(flat, deviation)
            copy_matrix(matrix(flat, at.PRIOR_COVARIANCE), covariance)
        else:
            b = layer(flat, at.B, k - 1)
            copy_vector(deviations[k - 1], deviation)
            copy_matrix(layer(flat, at.COVARIANCES, k - 1), covariance)
            propagate_deviation(deviation, a[k - 1], b)
            propagate_covariance(covariance, a[k - 1], b, process)
            for i in range(n_z):
                deviation[i] += ends[k - 1, i] - forces[k, i]
        for i in range(d + 1):
            innovation_covariances[k, i] = 0.0
        if k > 0 and measurements[k, at.IS_USED] > 0.0:
            innovations[k, d], innovation_covariances[k, d] = correct_scalar(
                deviation, covariance, rows[k], residuals[k], flat[at.VARIANCE], gains[d]
            )
        for i in range(d):
            if active[k, i] != 0.0:
                bound = bound_of(flat, k, i, active[k, i])
                present = forces[k, i] if i < n_z else p[i - n_z]
                unit[:] = 0.0
                unit[i] = 1.0
                innovations[k, i], innovation_covariances[k, i] = correct_scalar(
                    deviation, covariance, unit, bound - present, 0.0, gains[i]
                )


@njit_bare
def _smooth_backward(flat: Floats) -> bool:
    """Smooth the filtered deviations into ``STEPS`` and release bounds with a wrong multiplier; return if none was."""
    deviations, steps, active = matrix(flat, at.DEVIATIONS), matrix(flat, at.STEPS), matrix(flat, at.ACTIVE)
    innovations, innovation_covariances = matrix(flat, at.INNOVATIONS), matrix(flat, at.INNOVATION_COVARIANCES)
    a, rows, adjoint, unit = matrix(flat, at.A), matrix(flat, at.ROWS), vector(flat, at.ADJOINT), vector(flat, at.UNIT)
    d, count = unit.shape[0], int(flat[at.COUNT])
    adjoint[:] = 0.0
    is_optimal = True
    for k in range(count, -1, -1):
        covariance, gains = layer(flat, at.COVARIANCES, k), layer(flat, at.GAINS, k)
        if k < count:
            smooth_back_transition(adjoint, a[k], layer(flat, at.B, k))
        for i in range(d):
            total = deviations[k, i]
            for j in range(d):
                total -= covariance[i, j] * adjoint[j]
            steps[k, i] = total
        for i in range(d - 1, -1, -1):
            if active[k, i] != 0.0:
                unit[:] = 0.0
                unit[i] = 1.0
                multiplier = smooth_back(adjoint, unit, gains[i], innovations[k, i], innovation_covariances[k, i])
                if multiplier * active[k, i] > 0.0:
                    active[k, i] = 0.0
                    is_optimal = False
        smooth_back(adjoint, rows[k], gains[d], innovations[k, d], innovation_covariances[k, d])
    return is_optimal


@njit_bare
def _activate_bounds(flat: Floats) -> bool:
    """Activate every bound that the step crosses; return whether there was none."""
    forces, p = matrix(flat, at.FORCES), vector(flat, at.P)
    steps, active = matrix(flat, at.STEPS), matrix(flat, at.ACTIVE)
    n_z, d = forces.shape[1], active.shape[1]
    is_optimal = True
    for k in range(int(flat[at.COUNT]) + 1):
        last = d if k == 0 else n_z  # p is one variable for the whole window
        for i in range(last):
            if active[k, i] == 0.0:
                value = steps[k, i] + (forces[k, i] if i < n_z else p[i - n_z])
                for side in (-1.0, 1.0):
                    bound = bound_of(flat, k, i, side)
                    if side * (value - bound) > _BOUND_TOLERANCE * (1.0 + abs(bound)):
                        active[k, i] = side
                        is_optimal = False
    return is_optimal


@njit_bare
def solve_subproblem(flat: Floats) -> None:
    """Solve the quadratic programme of one Gauss-Newton iteration on the linearised window into ``STEPS``."""
    active = matrix(flat, at.ACTIVE)
    for k in range(active.shape[0]):
        for i in range(active.shape[1]):
            active[k, i] = 0.0
    for _ in range(_MAX_ACTIVE_SET_PASSES):
        _filter_forward(flat)
        is_smooth = _smooth_backward(flat)
        if _activate_bounds(flat) and is_smooth:
            break
