"""The estimator's loop over a block of samples: predict at every sample, correct at every k-th."""

from __future__ import annotations

import math
from typing import NamedTuple

from sgms_observer.estimators.ekf import ekf_correct, predict_measurement
from sgms_observer.estimators.interval import advance_forces, friction_force, level_at, simulate_interval
from sgms_observer.estimators.layout import (
    NU,
    P_VISCOUS,
    Floats,
    Integers,
    ModelArrays,
    ParameterArrays,
    apply_parameters,
    copy_vector,
)
from sgms_observer.estimators.memory import (
    ACCELERATION,
    COUNT,
    EFFORT,
    EKF_NEXT,
    FACTOR,
    IS_USED,
    SAMPLES,
    STARTED,
    VELOCITY,
    Memory,
    views,
)
from sgms_observer.estimators.mhe import NO_DESCENT, NOT_FINITE, mhe_correct
from sgms_observer.filters.motion import ACCELERATION as ACCELERATION_COLUMN
from sgms_observer.filters.motion import (
    IS_DENSE,
    IS_JUMP,
    IS_READY,
    IS_REJECTED,
    IS_RESTART,
    LEAD,
    PERIOD,
    PRESENT_VELOCITY,
    STEP_VELOCITY,
)
from sgms_observer.filters.motion import VELOCITY as VELOCITY_COLUMN
from sgms_observer.jit import njit_bare

# status codes, the same numbers as sgms_observer.status.Status (a test holds them together)
RUNNING, STARTING, PREDICTING, SAMPLE_REJECTED, NOT_CONVERGED, WAS_NOT_FINITE, DEADLINE, RESTARTED = range(8)
JUMPED, TOO_DENSE = 8, 9


class Tuning(NamedTuple):
    """Estimator settings for the kernel.

    Attributes:
        is_mhe: MHE rather than EKF.
        correction_every: samples per interval.
        horizon: N.
        iterations: most Gauss-Newton iterations per correction.
        tolerance: relative step that ends them.
        variance: R [N^2].
        walk: variance of each parameter's drift per correction (in shares squared).
        beta: state bound of 14d.
        outlier_nis: normalised innovation squared above which a measurement is rejected; 0 never.
    """

    is_mhe: bool
    correction_every: int
    horizon: int
    iterations: int
    tolerance: float
    variance: float
    walk: float
    beta: float
    outlier_nis: float


# columns of the table the loop writes: these, then element forces, slip modes, p and the deviations of p
FRICTION, FRICTION_STD, INNOVATION, INNOVATION_STD, STATUS, RESULT_SIZE = range(6)


@njit_bare
def start_interval(memory: Memory, model: ModelArrays, parameters: ParameterArrays) -> None:
    """Begin a new interval at the newest corrected estimate."""
    n_z = memory.now.shape[0]
    apply_parameters(
        model.scalars, model.elements, parameters.kinds, parameters.scale, memory.x_hat[n_z:],
        memory.scalars, memory.elements,
    )  # fmt: skip
    copy_vector(memory.x_hat[:n_z], memory.now)
    copy_vector(memory.slip, memory.now_slip)
    memory.now_a[:] = 1.0
    memory.now_b[:, :] = 0.0
    memory.flags[SAMPLES] = 0.0


@njit_bare
def restart(memory: Memory, model: ModelArrays, parameters: ParameterArrays, initial: Floats, keep_p: bool) -> None:
    """Forget the element forces (and p, unless kept) and start from the initial uncertainty.

    Args:
        memory: the estimator's memory.
        model: nominal model.
        parameters: which parameters are estimated.
        initial: initial variances of x, shape (d,).
        keep_p: keep what was learnt of p.
    """
    n_z = memory.now.shape[0]
    d = memory.x_hat.shape[0]
    for i in range(d):
        for j in range(d):
            if i < n_z or j < n_z or not keep_p:
                memory.covariance[i, j] = initial[i] if i == j else 0.0
        if i < n_z:
            memory.x_hat[i] = 0.0
            memory.slip[i] = 0.0
        elif not keep_p:
            memory.x_hat[i] = parameters.start[i - n_z]
    memory.flags[COUNT] = 0.0
    memory.flags[STARTED] = 1.0
    start_interval(memory, model, parameters)


@njit_bare
def advance(memory: Memory, kinds: Integers, velocity: float, period: float, factor: float) -> None:
    """Predict one sample ahead (eq. 11a) and carry the interval's linearisation along."""
    n_z = memory.now.shape[0]
    n_p = kinds.shape[0]
    at = int(memory.flags[SAMPLES])
    memory.now_velocity[at] = velocity
    memory.now_period[at] = period
    memory.now_factor[at] = factor
    a, b = memory.trial_a[0], memory.trial_b[0]
    simulate_interval(
        memory.scalars, memory.elements, kinds, memory.x_hat[n_z:],
        memory.now_velocity[at:], memory.now_period[at:], memory.now_factor[at:], 1,
        memory.now, memory.now_slip, memory.now, memory.now_slip, a, b,
    )  # fmt: skip
    for i in range(n_z):
        for j in range(n_p):
            memory.now_b[i, j] = a[i] * memory.now_b[i, j] + b[i, j]
        memory.now_a[i] *= a[i]
    memory.flags[SAMPLES] = at + 1.0


@njit_bare
def _keep_inside(memory: Memory, beta: float, parameters: ParameterArrays) -> bool:
    """Clip the newest estimate to its bounds (14d, 14e); return whether it is finite."""
    n_z = memory.now.shape[0]
    level = beta * level_at(memory.scalars, memory.record[VELOCITY], memory.record[FACTOR])
    for i in range(memory.x_hat.shape[0]):
        value = memory.x_hat[i]
        if not abs(value) < 1e300 or not abs(memory.covariance[i, i]) < 1e300:
            return False
        if i < n_z:
            high = memory.elements[NU, i] * level
            memory.x_hat[i] = min(max(value, -high), high)
        else:
            memory.x_hat[i] = min(max(value, parameters.lower[i - n_z]), parameters.upper[i - n_z])
    return True


@njit_bare
def _correct(memory: Memory, model: ModelArrays, parameters: ParameterArrays, process: Floats, initial: Floats,
             tuning: Tuning) -> tuple[int, float, float]:  # fmt: skip
    """Correct at the end of the running interval; return status, innovation [N] and its deviation [N]."""
    record = memory.record
    innovation, spread = predict_measurement(
        memory, parameters.kinds, parameters.scale, process, tuning.variance, record,
        memory.predicted_row, memory.predicted,
    )  # fmt: skip
    status = RUNNING if record[IS_USED] > 0.0 else PREDICTING
    if record[IS_USED] > 0.0 and tuning.outlier_nis > 0.0 and innovation * innovation > tuning.outlier_nis * spread:
        record[IS_USED] = 0.0
        status = SAMPLE_REJECTED
    use_ekf = not tuning.is_mhe
    if tuning.is_mhe and memory.flags[EKF_NEXT] > 0.0:
        use_ekf = True
        status = DEADLINE
    memory.flags[EKF_NEXT] = 0.0
    if not use_ekf:
        result = mhe_correct(
            memory, model.scalars, model.elements, parameters, process, tuning.walk, tuning.variance, tuning.beta,
            record, tuning.horizon, tuning.iterations, tuning.tolerance,
        )  # fmt: skip
        if result in (NO_DESCENT, NOT_FINITE):
            use_ekf = True
            status = NOT_CONVERGED if result == NO_DESCENT else WAS_NOT_FINITE
    if use_ekf:
        ekf_correct(
            memory, tuning.walk, tuning.variance, record[IS_USED] > 0.0, innovation,
            memory.predicted_row, memory.predicted,
        )  # fmt: skip
        memory.flags[COUNT] = 0.0
    if not _keep_inside(memory, tuning.beta, parameters):
        restart(memory, model, parameters, initial, False)
        return WAS_NOT_FINITE, innovation, math.sqrt(spread)
    start_interval(memory, model, parameters)
    return status, innovation, math.sqrt(spread)


@njit_bare
def _friction_variance(
    memory: Memory, parameters: ParameterArrays, process: Floats, share: float, velocity: float
) -> float:
    """Variance of the estimated friction (eq. 13) at the newest sample [N^2]; p's uncertainty included."""
    n_z = memory.now.shape[0]
    d = memory.x_hat.shape[0]
    row = memory.adjoint
    total = 0.0
    for i in range(n_z):
        row[i] = memory.now_a[i]
        total += share * process[i]
    for j in range(d - n_z):
        row[n_z + j] = parameters.scale[j] * velocity if parameters.kinds[j] == P_VISCOUS else 0.0
        for i in range(n_z):
            row[n_z + j] += memory.now_b[i, j]
    for i in range(d):
        for j in range(d):
            total += row[i] * memory.covariance[i, j] * row[j]
    return max(total, 0.0)


@njit_bare
def estimate_block(flat: Floats, model: ModelArrays, parameters: ParameterArrays, process: Floats,
                   initial: Floats, tuning: Tuning, motion: Floats, effort: Floats, factor: Floats,
                   results: Floats) -> None:  # fmt: skip
    """Run the estimator over a block of n samples.

    Args:
        flat: the estimator's memory (memory.py); overwritten.
        model: nominal model.
        parameters: which parameters are estimated.
        process: variances of Q per interval, shape (n_z,).
        initial: initial variances of x, shape (n_z + n_p,).
        tuning: estimator settings.
        motion: rows of block V, columns as in ``filters.motion``, shape (n, LEAD + 2 L).
        effort: effort at each row's instant less the effects' forces [N], NaN where there is none, shape (n,).
        factor: effects' factor on the Stribeck level [-], shape (n,).
        results: written, columns as above, shape (n, RESULT_SIZE + 2 n_z + 2 n_p).
    """
    n_z = model.elements.shape[1]
    n_p = parameters.kinds.shape[0]
    leads = (motion.shape[1] - LEAD) // 2
    memory, _length = views(flat)
    for s in range(motion.shape[0]):
        row = motion[s]
        result = results[s]
        status = RUNNING
        if memory.flags[STARTED] == 0.0:
            restart(memory, model, parameters, initial, False)
        if row[IS_RESTART] > 0.0:
            restart(memory, model, parameters, initial, True)
            status = JUMPED if row[IS_JUMP] > 0.0 else RESTARTED
        result[INNOVATION] = math.nan
        result[INNOVATION_STD] = math.nan
        if row[IS_REJECTED] > 0.0:
            status = SAMPLE_REJECTED
        elif row[IS_READY] == 0.0:
            if status == RUNNING:
                status = STARTING
        elif not abs(row[STEP_VELOCITY]) + abs(row[VELOCITY_COLUMN]) + row[PERIOD] < 1e300:
            status = WAS_NOT_FINITE
        else:
            advance(memory, parameters.kinds, row[STEP_VELOCITY], max(row[PERIOD], 0.0), factor[s])
            if memory.flags[SAMPLES] >= tuning.correction_every:
                memory.record[EFFORT] = effort[s]
                memory.record[VELOCITY] = row[VELOCITY_COLUMN]
                memory.record[ACCELERATION] = row[ACCELERATION_COLUMN]
                memory.record[FACTOR] = factor[s]
                is_finite = abs(effort[s]) + abs(row[ACCELERATION_COLUMN]) < 1e300
                memory.record[IS_USED] = 1.0 if is_finite else 0.0
                outcome, innovation, deviation = _correct(memory, model, parameters, process, initial, tuning)
                if is_finite:
                    result[INNOVATION] = innovation
                    result[INNOVATION_STD] = deviation
                if status == RUNNING:
                    status = outcome
        if status == RUNNING and row[IS_DENSE] > 0.0:
            status = TOO_DENSE
        share = memory.flags[SAMPLES] / tuning.correction_every
        velocity = row[PRESENT_VELOCITY]
        copy_vector(memory.now, memory.lead)
        copy_vector(memory.now_slip, memory.lead_slip)
        for k in range(leads if row[IS_READY] > 0.0 else 0):
            advance_forces(
                memory.scalars, memory.elements, memory.lead, memory.lead_slip,
                row[LEAD + k], row[LEAD + leads + k], factor[s],
            )  # fmt: skip
        result[FRICTION] = friction_force(
            memory.scalars, memory.elements, memory.lead, memory.lead_slip, velocity, factor[s]
        )
        result[FRICTION_STD] = math.sqrt(_friction_variance(memory, parameters, process, share, velocity))
        result[STATUS] = status
        for i in range(n_z):
            result[RESULT_SIZE + i] = memory.lead[i]
            result[RESULT_SIZE + n_z + i] = memory.lead_slip[i]
        for j in range(n_p):
            at = RESULT_SIZE + 2 * n_z + j
            result[at] = memory.x_hat[n_z + j] * parameters.scale[j]
            result[at + n_p] = math.sqrt(max(memory.covariance[n_z + j, n_z + j], 0.0)) * parameters.scale[j]
