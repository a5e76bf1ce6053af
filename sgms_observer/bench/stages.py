"""The stages of one correction as calls of their own, for timing them.

Each takes the estimator's flat memory, ``Estimator.flat``.
"""

from __future__ import annotations

from sgms_observer.estimators import memory as at
from sgms_observer.estimators.block import advance, start_interval
from sgms_observer.estimators.descent import iterate
from sgms_observer.estimators.fields import vector
from sgms_observer.estimators.layout import Floats
from sgms_observer.estimators.mhe import append_interval, slide_window, store_newest
from sgms_observer.jit import njit_bare


@njit_bare
def predict(flat: Floats, velocity: float, period: float) -> None:
    """Predict one sample ahead (eq. 11a), with its derivatives.

    Args:
        flat: the estimator's memory; overwritten.
        velocity: velocity over the step [m/s].
        period: the step [s].
    """
    advance(flat, velocity, period, 1.0)


@njit_bare
def take_in(flat: Floats, effort: float, velocity: float, acceleration: float) -> None:
    """Slide a full window (arrival cost) and append the running interval with its measurement.

    Args:
        flat: the estimator's memory; overwritten.
        effort: measured effort [N].
        velocity: velocity there [m/s].
        acceleration: acceleration there [m/s^2].
    """
    record = vector(flat, at.RECORD)
    record[at.EFFORT], record[at.VELOCITY], record[at.ACCELERATION] = effort, velocity, acceleration
    record[at.FACTOR], record[at.IS_USED] = 1.0, 1.0
    if flat[at.COUNT] >= flat[at.HORIZON]:
        slide_window(flat)
    append_interval(flat)


@njit_bare
def improve(flat: Floats) -> int:
    """One real-time iteration on the window as it stands: solve, step with a search along it, relinearise.

    Args:
        flat: the estimator's memory; overwritten.

    Returns:
        As ``descent.iterate``.
    """
    return iterate(flat)


@njit_bare
def finish(flat: Floats) -> None:
    """Take the window's newest node as the estimate and begin the next interval there.

    Args:
        flat: the estimator's memory; overwritten.
    """
    store_newest(flat)
    start_interval(flat)
