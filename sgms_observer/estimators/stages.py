"""The stages of one correction as calls of their own: for timing them, and for schedules other than the block loop.

Each takes the estimator's flat memory; ``Estimator`` holds all other arguments.
"""

from __future__ import annotations

from sgms_observer.estimators.block import Tuning, advance, start_interval
from sgms_observer.estimators.layout import Floats, Integers, ModelArrays, ParameterArrays
from sgms_observer.estimators.memory import (
    ACCELERATION,
    COUNT,
    EFFORT,
    FACTOR,
    HORIZON,
    IS_USED,
    VELOCITY,
    views,
)
from sgms_observer.estimators.mhe import append_interval, iterate, slide_window, store_newest
from sgms_observer.jit import njit_bare


@njit_bare
def predict(flat: Floats, kinds: Integers, velocity: float, period: float) -> None:
    """Predict one sample ahead (eq. 11a), with its derivatives.

    Args:
        flat: the estimator's memory; overwritten.
        kinds: P_* code of each entry of p.
        velocity: velocity over the step [m/s].
        period: the step [s].
    """
    memory, _length = views(flat)
    advance(memory, kinds, velocity, period, 1.0)


@njit_bare
def take_in(flat: Floats, parameters: ParameterArrays, process: Floats, walk: float, variance: float,
            effort: float, velocity: float, acceleration: float) -> None:  # fmt: skip
    """Slide a full window (arrival cost) and append the running interval with its measurement.

    Args:
        flat: the estimator's memory; overwritten.
        parameters: which parameters are estimated.
        process: variances of Q, shape (n_z,).
        walk: variance of each parameter's drift per correction.
        variance: R [N^2].
        effort: measured effort [N].
        velocity: velocity there [m/s].
        acceleration: acceleration there [m/s^2].
    """
    memory, _length = views(flat)
    record = memory.record
    record[EFFORT], record[VELOCITY], record[ACCELERATION] = effort, velocity, acceleration
    record[FACTOR], record[IS_USED] = 1.0, 1.0
    if memory.flags[COUNT] >= memory.flags[HORIZON]:
        slide_window(memory, process, walk, variance)
    append_interval(memory, parameters, record)


@njit_bare
def improve(flat: Floats, model: ModelArrays, parameters: ParameterArrays, process: Floats, tuning: Tuning) -> int:
    """One real-time iteration on the window as it stands: solve, step with backtracking, relinearise.

    Args:
        flat: the estimator's memory; overwritten.
        model: nominal model.
        parameters: which parameters are estimated.
        process: variances of Q, shape (n_z,).
        tuning: estimator settings.

    Returns:
        As ``mhe.iterate``.
    """
    memory, _length = views(flat)
    return iterate(
        memory, model.scalars, model.elements, parameters, process, tuning.variance, tuning.beta, tuning.tolerance
    )


@njit_bare
def finish(flat: Floats, model: ModelArrays, parameters: ParameterArrays) -> None:
    """Take the window's newest node as the estimate and begin the next interval there.

    Args:
        flat: the estimator's memory; overwritten.
        model: nominal model.
        parameters: which parameters are estimated.
    """
    memory, _length = views(flat)
    store_newest(memory)
    start_interval(memory, model, parameters)
