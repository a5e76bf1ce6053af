"""The estimator's loop over a block of samples: predict at every sample, correct at every k-th."""

from __future__ import annotations

import math

from sgms_observer.arrays import Floats
from sgms_observer.estimators import memory as at
from sgms_observer.estimators.descent import NO_DESCENT, NOT_FINITE, apply_estimate
from sgms_observer.estimators.ekf import ekf_correct, predict_measurement
from sgms_observer.estimators.interval import advance_forces, friction_force, level_at, simulate_interval
from sgms_observer.estimators.layout import KAPPA, NU, P_VISCOUS, copy_vector
from sgms_observer.estimators.memory import matrix, vector
from sgms_observer.estimators.mhe import mhe_correct
from sgms_observer.filters import motion as row_of
from sgms_observer.friction.gms import gms_branch
from sgms_observer.jit import njit_bare

# status codes, the same numbers as sgms_observer.status.Status (a test holds them together)
RUNNING, STARTING, PREDICTING, SAMPLE_REJECTED, NOT_CONVERGED, WAS_NOT_FINITE, DEADLINE, RESTARTED = range(8)
JUMPED, TOO_DENSE = 8, 9

# columns of the table the loop writes: these, then element forces, their deflections, slip modes, p and its deviations
FRICTION, FRICTION_STD, INNOVATION, INNOVATION_STD, STATUS, RESULT_SIZE = range(6)


@njit_bare
def start_interval(flat: Floats) -> None:
    """Begin a new interval at the newest corrected estimate."""
    x_hat, now, now_a, now_b = (
        vector(flat, at.X_HAT), vector(flat, at.NOW), vector(flat, at.NOW_A), matrix(flat, at.NOW_B),
    )  # fmt: skip
    n_z, n_p = now_b.shape
    apply_estimate(flat, x_hat[n_z:])
    copy_vector(x_hat[:n_z], now)
    copy_vector(vector(flat, at.SLIP), vector(flat, at.NOW_SLIP))
    for i in range(n_z):
        now_a[i] = 1.0
        for j in range(n_p):
            now_b[i, j] = 0.0
    flat[at.SAMPLES] = 0.0


@njit_bare
def restart(flat: Floats, keep_p: bool) -> None:
    """Forget the element forces (and p, unless it is kept) and start from the initial uncertainty."""
    x_hat, covariance, initial = vector(flat, at.X_HAT), matrix(flat, at.COVARIANCE), vector(flat, at.INITIAL)
    slip, start = vector(flat, at.SLIP), vector(flat, at.START)
    n_z, d = slip.shape[0], x_hat.shape[0]
    for i in range(d):
        for j in range(d):
            if i < n_z or j < n_z or not keep_p:
                covariance[i, j] = initial[i] if i == j else 0.0
        if i < n_z:
            x_hat[i] = 0.0
            slip[i] = 0.0
        elif not keep_p:
            x_hat[i] = start[i - n_z]
    flat[at.COUNT] = 0.0
    flat[at.STARTED] = 1.0
    start_interval(flat)


@njit_bare
def advance(flat: Floats, velocity: float, period: float, factor: float) -> None:
    """Predict one sample ahead (eq. 11a) and carry the interval's linearisation along.

    Args:
        flat: the estimator's memory.
        velocity: mean velocity over the step [m/s].
        period: the step [s].
        factor: the effects' factor on the Stribeck level [-].
    """
    here = int(flat[at.SAMPLES])
    velocities, periods = vector(flat, at.NOW_VELOCITY), vector(flat, at.NOW_PERIOD)
    factors = vector(flat, at.NOW_FACTOR)
    now, now_slip = vector(flat, at.NOW), vector(flat, at.NOW_SLIP)
    now_a, now_b = vector(flat, at.NOW_A), matrix(flat, at.NOW_B)
    a, b = vector(flat, at.STEP_A), matrix(flat, at.STEP_B)
    n_z, n_p = now_b.shape
    velocities[here] = velocity
    periods[here] = period
    factors[here] = factor
    branches, elements, is_held = matrix(flat, at.NOW_BRANCHES), matrix(flat, at.ELEMENTS), flat[at.HOLDS_MODES] > 0.0
    if is_held:
        level = level_at(vector(flat, at.SCALARS), velocity, factor)
        for i in range(n_z):
            branches[here, i] = gms_branch(now[i], int(now_slip[i]), velocity, elements[NU, i], level)
    simulate_interval(
        vector(flat, at.SCALARS), elements, vector(flat, at.KINDS), vector(flat, at.X_HAT)[n_z:],
        velocities[here : here + 1], periods[here : here + 1], factors[here : here + 1],
        branches[here : here + 1], is_held,
        now, now_slip, now, now_slip, a, b,
    )  # fmt: skip
    for i in range(n_z):
        for j in range(n_p):
            now_b[i, j] = a[i] * now_b[i, j] + b[i, j]
        now_a[i] *= a[i]
    flat[at.SAMPLES] = here + 1.0


@njit_bare
def _clip_to_bounds(flat: Floats) -> bool:
    """Clip the newest estimate to its bounds (14d, 14e); return whether it is finite."""
    x_hat, covariance, record = vector(flat, at.X_HAT), matrix(flat, at.COVARIANCE), vector(flat, at.RECORD)
    lower, upper, elements = vector(flat, at.LOWER), vector(flat, at.UPPER), matrix(flat, at.ELEMENTS)
    n_z = elements.shape[1]
    level = flat[at.BETA] * level_at(vector(flat, at.SCALARS), record[at.VELOCITY], record[at.FACTOR])
    for i in range(x_hat.shape[0]):
        value = x_hat[i]
        if not abs(value) < 1e300 or not abs(covariance[i, i]) < 1e300:
            return False
        if i < n_z:
            high = elements[NU, i] * level
            x_hat[i] = min(max(value, -high), high)
        else:
            x_hat[i] = min(max(value, lower[i - n_z]), upper[i - n_z])
    return True


@njit_bare
def _correct(flat: Floats) -> tuple[int, float, float]:
    """Correct at the end of the running interval; return status, innovation [N] and its deviation [N]."""
    record = vector(flat, at.RECORD)
    innovation, innovation_covariance = predict_measurement(flat)
    status = RUNNING if record[at.IS_USED] > 0.0 else PREDICTING
    limit = flat[at.OUTLIER_NIS]
    if record[at.IS_USED] > 0.0 and limit > 0.0 and innovation * innovation > limit * innovation_covariance:
        record[at.IS_USED] = 0.0
        status = SAMPLE_REJECTED
    use_ekf = flat[at.IS_MHE] == 0.0
    if flat[at.EKF_NEXT] > 0.0 and not use_ekf:
        use_ekf = True
        status = DEADLINE
    flat[at.EKF_NEXT] = 0.0
    if not use_ekf:
        result = mhe_correct(flat)
        if result in (NO_DESCENT, NOT_FINITE):
            use_ekf = True
            status = NOT_CONVERGED if result == NO_DESCENT else WAS_NOT_FINITE
    if use_ekf:
        ekf_correct(flat, innovation)
        flat[at.COUNT] = 0.0
    if _clip_to_bounds(flat):
        start_interval(flat)
    else:
        restart(flat, False)
        status = WAS_NOT_FINITE
    return status, innovation, math.sqrt(innovation_covariance)


@njit_bare
def _friction_variance(flat: Floats, velocity: float) -> float:
    """Variance of the estimated friction (eq. 13) at the newest sample [N^2]; p's uncertainty included."""
    now_a, now_b, process = vector(flat, at.NOW_A), matrix(flat, at.NOW_B), vector(flat, at.PROCESS)
    covariance, row = matrix(flat, at.COVARIANCE), vector(flat, at.ADJOINT)
    kinds, scale = vector(flat, at.KINDS), vector(flat, at.SCALE)
    n_z, n_p = now_b.shape
    share = flat[at.SAMPLES] / flat[at.INTERVAL]
    total = 0.0
    for i in range(n_z):
        row[i] = now_a[i]
        total += share * process[i]
    for j in range(n_p):
        row[n_z + j] = scale[j] * velocity if kinds[j] == P_VISCOUS else 0.0
        for i in range(n_z):
            row[n_z + j] += now_b[i, j]
    for i in range(row.shape[0]):
        for j in range(row.shape[0]):
            total += row[i] * covariance[i, j] * row[j]
    return max(total, 0.0)


@njit_bare
def take_sample(flat: Floats, row: Floats, effort: float, factor: float, result: Floats) -> int:
    """Advance by one row of block V, correct where it is due, and write the innovation.

    Args:
        flat: the estimator's memory (memory.py); overwritten.
        row: of block V, columns as in ``filters.motion``, shape (LEAD + 2 L,).
        effort: effort at the row's instant less the effects' forces [N], NaN where there is none.
        factor: effects' factor on the Stribeck level [-].
        result: INNOVATION and INNOVATION_STD are written [N], NaN without a correction.

    Returns:
        The status, one of the codes above.
    """
    status = RUNNING
    is_restart = row[row_of.IS_RESTART] > 0.0
    if is_restart or flat[at.STARTED] == 0.0:
        restart(flat, flat[at.STARTED] > 0.0)
    if is_restart:
        status = JUMPED if row[row_of.IS_JUMP] > 0.0 else RESTARTED
    result[INNOVATION] = math.nan
    result[INNOVATION_STD] = math.nan
    if row[row_of.IS_REJECTED] > 0.0:
        return SAMPLE_REJECTED
    if row[row_of.IS_READY] == 0.0:
        return STARTING if status == RUNNING else status
    if not abs(row[row_of.STEP_VELOCITY]) + abs(row[row_of.VELOCITY]) + row[row_of.PERIOD] < 1e300:
        return WAS_NOT_FINITE
    advance(flat, row[row_of.STEP_VELOCITY], max(row[row_of.PERIOD], 0.0), factor)
    if flat[at.SAMPLES] >= flat[at.INTERVAL]:
        record = vector(flat, at.RECORD)
        record[at.EFFORT] = effort
        record[at.VELOCITY] = row[row_of.VELOCITY]
        record[at.ACCELERATION] = row[row_of.ACCELERATION]
        record[at.FACTOR] = factor
        is_finite = abs(effort) + abs(row[row_of.ACCELERATION]) < 1e300
        record[at.IS_USED] = 1.0 if is_finite else 0.0
        outcome, innovation, deviation = _correct(flat)
        if is_finite:
            result[INNOVATION] = innovation
            result[INNOVATION_STD] = deviation
        if status == RUNNING:
            status = outcome
    if status == RUNNING and not abs(effort) < 1e300:
        return PREDICTING  # also between two corrections: no measurement will correct the prediction
    return TOO_DENSE if status == RUNNING and row[row_of.IS_DENSE] > 0.0 else status


@njit_bare
def write_present(flat: Floats, row: Floats, factor: float, result: Floats) -> None:
    """Advance the forces from the instant of the row to its sample and write the estimate there.

    Args:
        flat: the estimator's memory after ``take_sample``.
        row: as for ``take_sample``.
        factor: as for ``take_sample``.
        result: all columns but the status and the innovation are written, shape (RESULT_SIZE + 3 n_z + 2 n_p,).
    """
    lead, lead_slip = vector(flat, at.LEAD), vector(flat, at.LEAD_SLIP)
    scalars, elements = vector(flat, at.SCALARS), matrix(flat, at.ELEMENTS)
    x_hat, covariance, scale = vector(flat, at.X_HAT), matrix(flat, at.COVARIANCE), vector(flat, at.SCALE)
    n_z, n_p = lead.shape[0], scale.shape[0]
    velocity = row[row_of.PRESENT_VELOCITY]
    copy_vector(vector(flat, at.NOW), lead)
    copy_vector(vector(flat, at.NOW_SLIP), lead_slip)
    if row[row_of.IS_READY] > 0.0:
        leads = (row.shape[0] - row_of.LEAD) // 2
        for k in range(row_of.LEAD, row_of.LEAD + leads):
            advance_forces(scalars, elements, lead, lead_slip, row[k], row[leads + k], factor)
    result[FRICTION] = friction_force(scalars, elements, lead, lead_slip, velocity, factor)
    result[FRICTION_STD] = math.sqrt(_friction_variance(flat, velocity))
    for i in range(n_z):
        k = RESULT_SIZE + i
        result[k] = lead[i]
        result[k + n_z] = lead[i] / elements[KAPPA, i]
        result[k + 2 * n_z] = lead_slip[i]
    for j in range(n_p):
        k = RESULT_SIZE + 3 * n_z + j
        result[k] = x_hat[n_z + j] * scale[j]
        result[k + n_p] = math.sqrt(max(covariance[n_z + j, n_z + j], 0.0)) * scale[j]


@njit_bare
def estimate_block(flat: Floats, motion: Floats, effort: Floats, factor: Floats, results: Floats) -> None:
    """Run the estimator over a block of n samples.

    Args:
        flat: the estimator's memory (memory.py); overwritten.
        motion: rows of block V, columns as in ``filters.motion``, shape (n, LEAD + 2 L).
        effort: effort at each row's instant less the effects' forces [N], NaN where there is none, shape (n,).
        factor: effects' factor on the Stribeck level [-], shape (n,).
        results: written, columns as above, shape (n, RESULT_SIZE + 3 n_z + 2 n_p).
    """
    for s in range(motion.shape[0]):
        results[s, STATUS] = take_sample(flat, motion[s], effort[s], factor[s], results[s])
        write_present(flat, motion[s], factor[s], results[s])
