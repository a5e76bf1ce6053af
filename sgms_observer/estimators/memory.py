"""Everything an estimator remembers, in one flat array: a reset or a snapshot is a copy, a call is one argument."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sgms_observer.estimators.layout import MODEL_SIZE, Floats
from sgms_observer.jit import inlined

# entries of Memory.flags; the first four are the sizes and never change
N_Z, N_P, HORIZON, INTERVAL, COUNT, SAMPLES, EKF_NEXT, STARTED, FLAGS_SIZE = range(9)
# entries of one measurement record
EFFORT, VELOCITY, ACCELERATION, FACTOR, IS_USED, LEVEL, MEASUREMENT_SIZE = range(7)


class Sizes(NamedTuple):
    """Dimensions of an estimator: elements n_z, parameters n_p, horizon N, samples per interval m."""

    n_z: int
    n_p: int
    horizon: int
    samples: int

    @property
    def augmented(self) -> int:
        """Return the length of x = (element forces, p)."""
        return self.n_z + self.n_p


class Memory(NamedTuple):
    """Views into the flat array. n = n_z, p = n_p, d = n + p; node k = 0..N, interval k leads from node k to k + 1.

    Attributes:
        flags: the sizes; COUNT intervals in the window, SAMPLES since the last correction, EKF_NEXT, STARTED.
        x_hat: newest corrected estimate of (element forces [N], p); shape (d,).
        covariance: its covariance, shape (d, d).
        slip: GMS modes at the newest correction, shape (n,).
        now: element forces at the newest sample [N], shape (n,).
        now_slip: modes at the newest sample, shape (n,).
        now_a: d now / d x_hat forces (diagonal), shape (n,).
        now_b: d now / d p, shape (n, p).
        now_velocity, now_period, now_factor: steps since the last correction, shape (m,).
        scalars, elements: the model with p applied; see layout.py.
        prior: arrival state, shape (d,).
        prior_covariance: arrival covariance, shape (d, d).
        forces: element forces at the nodes [N], shape (N + 1, n).
        slips: modes at the nodes, shape (N + 1, n).
        p: parameters of the window, shape (p,).
        velocity, period, factor: steps of the intervals, shape (N, m).
        ends: Phi of each interval, shape (N, n).
        end_slips: modes at the end of each interval, shape (N, n).
        a, b: linearisation of each interval, shapes (N, n), (N, n, p).
        measurements: record at each node, shape (N + 1, MEASUREMENT_SIZE).
        rows: H at each node, shape (N + 1, d).
        residuals: measured minus modelled effort at each node [N], shape (N + 1,).
        trial: forces, p, ends, end_slips, a, b, rows, residuals at a trial point, laid out as their namesakes.
        deviations, covariances: filtered, at each node; shapes (N + 1, d), (N + 1, d, d).
        gains, innovations, spreads: one per node and measurement slot; shapes (N + 1, d + 1, d), (N + 1, d + 1).
        active: -1, 0 or 1 where a bound holds, shape (N + 1, d).
        steps: solution of the subproblem, shape (N + 1, d).
        record: the measurement being taken in, shape (MEASUREMENT_SIZE,).
        predicted, predicted_row: covariance and H at that measurement before it is used, shapes (d, d), (d,).
        lead, lead_slip: forces and modes on the way from the delayed instant to the present, shape (n,).
        lower, work, adjoint, unit: scratch, shapes (d, d), (d,), (d,), (d,).
    """

    flags: Floats
    x_hat: Floats
    covariance: Floats
    slip: Floats
    now: Floats
    now_slip: Floats
    now_a: Floats
    now_b: Floats
    now_velocity: Floats
    now_period: Floats
    now_factor: Floats
    scalars: Floats
    elements: Floats
    prior: Floats
    prior_covariance: Floats
    forces: Floats
    slips: Floats
    p: Floats
    velocity: Floats
    period: Floats
    factor: Floats
    ends: Floats
    end_slips: Floats
    a: Floats
    b: Floats
    measurements: Floats
    rows: Floats
    residuals: Floats
    trial_forces: Floats
    trial_p: Floats
    trial_ends: Floats
    trial_end_slips: Floats
    trial_a: Floats
    trial_b: Floats
    trial_rows: Floats
    trial_residuals: Floats
    deviations: Floats
    covariances: Floats
    gains: Floats
    innovations: Floats
    spreads: Floats
    active: Floats
    steps: Floats
    record: Floats
    predicted: Floats
    predicted_row: Floats
    lead: Floats
    lead_slip: Floats
    lower: Floats
    work: Floats
    adjoint: Floats
    unit: Floats


@inlined
def _take1(flat: Floats, start: int, rows: int) -> tuple[Floats, int]:
    """Return a vector view and where the next view starts."""
    return flat[start : start + rows], start + rows


@inlined
def _take2(flat: Floats, start: int, rows: int, columns: int) -> tuple[Floats, int]:
    """Return a matrix view and where the next view starts."""
    end = start + rows * columns
    return flat[start:end].reshape((rows, columns)), end


@inlined
def _take3(flat: Floats, start: int, depth: int, rows: int, columns: int) -> tuple[Floats, int]:
    """Return a view of three dimensions and where the next view starts."""
    end = start + depth * rows * columns
    return flat[start:end].reshape((depth, rows, columns)), end


@inlined
def views(flat: Floats) -> tuple[Memory, int]:
    """Return the views into the flat array, and the length they need.

    Args:
        flat: the estimator's whole memory, beginning with its sizes.
    """
    n, p, h, m = int(flat[N_Z]), int(flat[N_P]), int(flat[HORIZON]), int(flat[INTERVAL])
    d = n + p
    w = h + 1
    i = 0
    flags, i = _take1(flat, i, FLAGS_SIZE)
    x_hat, i = _take1(flat, i, d)
    covariance, i = _take2(flat, i, d, d)
    slip, i = _take1(flat, i, n)
    now, i = _take1(flat, i, n)
    now_slip, i = _take1(flat, i, n)
    now_a, i = _take1(flat, i, n)
    now_b, i = _take2(flat, i, n, p)
    now_velocity, i = _take1(flat, i, m)
    now_period, i = _take1(flat, i, m)
    now_factor, i = _take1(flat, i, m)
    scalars, i = _take1(flat, i, MODEL_SIZE)
    elements, i = _take2(flat, i, 3, n)
    prior, i = _take1(flat, i, d)
    prior_covariance, i = _take2(flat, i, d, d)
    forces, i = _take2(flat, i, w, n)
    slips, i = _take2(flat, i, w, n)
    p_window, i = _take1(flat, i, p)
    velocity, i = _take2(flat, i, h, m)
    period, i = _take2(flat, i, h, m)
    factor, i = _take2(flat, i, h, m)
    ends, i = _take2(flat, i, h, n)
    end_slips, i = _take2(flat, i, h, n)
    a, i = _take2(flat, i, h, n)
    b, i = _take3(flat, i, h, n, p)
    measurements, i = _take2(flat, i, w, MEASUREMENT_SIZE)
    rows, i = _take2(flat, i, w, d)
    residuals, i = _take1(flat, i, w)
    trial_forces, i = _take2(flat, i, w, n)
    trial_p, i = _take1(flat, i, p)
    trial_ends, i = _take2(flat, i, h, n)
    trial_end_slips, i = _take2(flat, i, h, n)
    trial_a, i = _take2(flat, i, h, n)
    trial_b, i = _take3(flat, i, h, n, p)
    trial_rows, i = _take2(flat, i, w, d)
    trial_residuals, i = _take1(flat, i, w)
    deviations, i = _take2(flat, i, w, d)
    covariances, i = _take3(flat, i, w, d, d)
    gains, i = _take3(flat, i, w, d + 1, d)
    innovations, i = _take2(flat, i, w, d + 1)
    spreads, i = _take2(flat, i, w, d + 1)
    active, i = _take2(flat, i, w, d)
    steps, i = _take2(flat, i, w, d)
    record, i = _take1(flat, i, MEASUREMENT_SIZE)
    predicted, i = _take2(flat, i, d, d)
    predicted_row, i = _take1(flat, i, d)
    lead, i = _take1(flat, i, n)
    lead_slip, i = _take1(flat, i, n)
    lower, i = _take2(flat, i, d, d)
    work, i = _take1(flat, i, d)
    adjoint, i = _take1(flat, i, d)
    unit, i = _take1(flat, i, d)
    memory = Memory(
        flags, x_hat, covariance, slip, now, now_slip, now_a, now_b, now_velocity, now_period, now_factor, scalars,
        elements, prior, prior_covariance, forces, slips, p_window, velocity, period, factor, ends, end_slips, a,
        b, measurements, rows, residuals, trial_forces, trial_p, trial_ends, trial_end_slips, trial_a, trial_b,
        trial_rows, trial_residuals, deviations, covariances, gains, innovations, spreads, active, steps, record,
        predicted, predicted_row, lead, lead_slip, lower, work, adjoint, unit,
    )  # fmt: skip
    return memory, i


def allocate(sizes: Sizes) -> Floats:
    """Return an empty memory for these sizes.

    Args:
        sizes: dimensions of the estimator.
    """
    n, p, h, m = sizes
    d, w = n + p, h + 1
    vectors = 64 + 8 * (d + 2) ** 2 + 20 * n + 3 * m + n * p
    flat = np.zeros(vectors + w * (4 * d * d + 40 * (d + 2)) + h * (3 * m + 2 * n * p + 6 * n))
    flat[: len(sizes)] = sizes
    _memory, needed = views(flat)
    return flat[:needed].copy()


def forget(flat: Floats) -> None:
    """Empty a memory, its sizes excepted.

    Args:
        flat: the estimator's whole memory.
    """
    flat[INTERVAL + 1 :] = 0.0
