"""The estimator's loop over a block of samples: predict at every sample, correct at every k-th."""

from __future__ import annotations

import math
from typing import NamedTuple

from sgms_observer.estimators.ekf import ekf_correct, predict_measurement
from sgms_observer.estimators.interval import advance_forces, friction_force, level_at, simulate_interval
from sgms_observer.estimators.layout import NU, P_VISCOUS, Floats, Integers, ModelArrays, ParameterArrays, apply_parameters
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
from sgms_observer.jit import njit

# status codes, the same numbers as sgms_observer.status.Status (a test holds them together)
RUNNING, STARTING, PREDICTING, SAMPLE_REJECTED, NOT_CONVERGED, WAS_NOT_FINITE, DEADLINE, RESTARTED = range(8)


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


class Steps(NamedTuple):
    """Motion of a block, all at the delayed instants; shapes (n,).

    Attributes:
        period: time since the sample before [s].
        travel_velocity: mean velocity over that time [m/s].
        velocity: velocity at the sample [m/s].
        acceleration: acceleration at the sample [m/s^2].
        effort: effort less the effects' forces [N]; NaN where there is none.
        factor: effects' factor on the Stribeck level [-].
        is_ready: 1 once the filters are full.
        is_restart: 1 where everything starts anew.
        lead_velocity: velocities from the delayed instant to the present [m/s], shape (n, L).
        present_velocity: velocity at the sample's own stamp [m/s].
    """

    period: Floats
    travel_velocity: Floats
    velocity: Floats
    acceleration: Floats
    effort: Floats
    factor: Floats
    is_ready: Floats
    is_restart: Floats
    lead_velocity: Floats
    present_velocity: Floats


class Results(NamedTuple):
    """What the loop writes; the columns of ``Estimates`` it is responsible for."""

    friction: Floats
    friction_std: Floats
    element_force: Floats
    slip: Floats
    parameters: Floats
    parameter_std: Floats
    innovation: Floats
    innovation_std: Floats
    status: Integers


@njit
def start_interval(memory: Memory, model: ModelArrays, parameters: ParameterArrays) -> None:
    """Begin a new interval at the newest corrected estimate."""
    n_z = memory.now.shape[0]
    apply_parameters(
        model.scalars, model.elements, parameters.kinds, parameters.scale, memory.x_hat[n_z:],
        memory.scalars, memory.elements,
    )  # fmt: skip
    memory.now[:] = memory.x_hat[:n_z]
    memory.now_slip[:] = memory.slip
    memory.now_a[:] = 1.0
    memory.now_b[:, :] = 0.0
    memory.flags[SAMPLES] = 0.0


@njit
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


@njit
def _advance(memory: Memory, parameters: ParameterArrays, velocity: float, period: float, factor: float) -> None:
    """Predict one sample ahead (eq. 11a) and carry the interval's linearisation along."""
    n_z = memory.now.shape[0]
    n_p = parameters.kinds.shape[0]
    at = int(memory.flags[SAMPLES])
    memory.now_velocity[at] = velocity
    memory.now_period[at] = period
    memory.now_factor[at] = factor
    a, b = memory.trial_a[0], memory.trial_b[0]
    simulate_interval(
        memory.scalars, memory.elements, parameters.kinds, memory.x_hat[n_z:],
        memory.now_velocity[at:], memory.now_period[at:], memory.now_factor[at:], 1,
        memory.now, memory.now_slip, memory.now, memory.now_slip, a, b,
    )  # fmt: skip
    for i in range(n_z):
        for j in range(n_p):
            memory.now_b[i, j] = a[i] * memory.now_b[i, j] + b[i, j]
        memory.now_a[i] *= a[i]
    memory.flags[SAMPLES] = at + 1.0


@njit
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


@njit
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
        if result == NO_DESCENT or result == NOT_FINITE:
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


@njit
def _friction_variance(memory: Memory, parameters: ParameterArrays, process: Floats, share: float, velocity: float) -> float:
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


@njit
def _lead_to_present(memory: Memory, lead_velocity: Floats, period: float, factor: float,
                     present_velocity: float) -> float:  # fmt: skip
    """Take the forces from the delayed instant to the present along the best velocities; return the friction there."""
    memory.lead[:] = memory.now
    memory.lead_slip[:] = memory.now_slip
    for k in range(lead_velocity.shape[0]):
        advance_forces(
            memory.scalars, memory.elements, memory.lead, memory.lead_slip, lead_velocity[k], period, factor
        )
    return friction_force(memory.scalars, memory.elements, memory.lead, memory.lead_slip, present_velocity, factor)


@njit
def estimate_block(flat: Floats, model: ModelArrays, parameters: ParameterArrays, process: Floats, initial: Floats,
                   tuning: Tuning, sample_period: float, steps: Steps, results: Results) -> None:  # fmt: skip
    """Run the estimator over a block of samples.

    Args:
        flat: the estimator's memory (memory.py); overwritten.
        model: nominal model.
        parameters: which parameters are estimated.
        process: variances of Q per interval, shape (n_z,).
        initial: initial variances of x, shape (n_z + n_p,).
        tuning: estimator settings.
        sample_period: nominal sample period, of the lead velocities [s].
        steps: the block's motion.
        results: rows to write, one per sample.
    """
    n_z = model.elements.shape[1]
    n_p = parameters.kinds.shape[0]
    memory, _length = views(flat, n_z, n_p, tuning.horizon, tuning.correction_every)
    for s in range(steps.period.shape[0]):
        status = RUNNING
        if memory.flags[STARTED] == 0.0:
            restart(memory, model, parameters, initial, False)
        if steps.is_restart[s] > 0.0:
            restart(memory, model, parameters, initial, True)
            status = RESTARTED
        results.innovation[s] = math.nan
        results.innovation_std[s] = math.nan
        velocity, period = steps.travel_velocity[s], steps.period[s]
        if not (abs(velocity) < 1e300 and abs(steps.velocity[s]) < 1e300 and period < 1e300):
            status = WAS_NOT_FINITE
        elif steps.is_ready[s] == 0.0:
            if status == RUNNING:
                status = STARTING
        else:
            _advance(memory, parameters, velocity, max(period, 0.0), steps.factor[s])
            if memory.flags[SAMPLES] >= tuning.correction_every:
                memory.record[EFFORT] = steps.effort[s]
                memory.record[VELOCITY] = steps.velocity[s]
                memory.record[ACCELERATION] = steps.acceleration[s]
                memory.record[FACTOR] = steps.factor[s]
                is_finite = abs(steps.effort[s]) < 1e300 and abs(steps.acceleration[s]) < 1e300
                memory.record[IS_USED] = 1.0 if is_finite else 0.0
                outcome, innovation, deviation = _correct(memory, model, parameters, process, initial, tuning)
                if outcome != PREDICTING:
                    results.innovation[s] = innovation
                    results.innovation_std[s] = deviation
                if status == RUNNING:
                    status = outcome
        share = memory.flags[SAMPLES] / tuning.correction_every
        variance = _friction_variance(memory, parameters, process, share, steps.present_velocity[s])
        results.friction[s] = _lead_to_present(
            memory, steps.lead_velocity[s], sample_period, steps.factor[s], steps.present_velocity[s]
        )
        results.friction_std[s] = math.sqrt(variance)
        results.status[s] = status
        for i in range(n_z):
            results.element_force[s, i] = memory.lead[i]
            results.slip[s, i] = memory.lead_slip[i]
        for j in range(n_p):
            results.parameters[s, j] = memory.x_hat[n_z + j] * parameters.scale[j]
            results.parameter_std[s, j] = math.sqrt(max(memory.covariance[n_z + j, n_z + j], 0.0)) * parameters.scale[j]
