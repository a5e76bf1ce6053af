"""Local least-squares polynomial over the latest samples (Savitzky and Golay 1964), on the samples' own stamps.

The polynomial's value and derivatives are taken at the middle sample, where the delay is exactly half the window. The
second derivative is a weighted mean of the acceleration over the window; the effort is given exactly that weighting,
so that in ``u - m a`` not a bit of inertia is left over.
"""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.filters import layout, motion
from sgms_observer.jit import njit

# own part of config
WINDOW = layout.OWN
DEGREE = layout.OWN + 1
WEIGHTS = layout.OWN + 2  # (degree + 1) per sample of the window, then one effort weight per interval

# own part of state
END = layout.MEMORY  # index after the newest sample in the buffers
REGULAR = layout.MEMORY + 1  # how many of the latest periods were nominal
LAST_POSITION = layout.MEMORY + 2
BUFFERS = layout.MEMORY + 3  # periods, positions, efforts: twice the window each, then scratch

MAX_COEFFICIENTS = 7


def polynomial_config(window: int, degree: int, period: float) -> Floats:
    """Return the own part of ``config``: window, degree and the weights for evenly spaced samples.

    Args:
        window: samples in the window, odd.
        degree: degree of the polynomial.
        period: time between two samples [s].
    """
    count = degree + 1
    x = (np.arange(window) - window // 2) / (window // 2)
    powers = np.vander(x, count, increasing=True)
    orthogonal, triangle = np.linalg.qr(powers)
    weights = np.linalg.solve(triangle, orthogonal.T)  # (count, window)
    half = 0.5 * period * (window - 1)
    effort = np.zeros(window)
    _acceleration_kernel(weights[2] * (2.0 / half**2), np.full(window, period), effort, window)
    return np.concatenate(([float(window), float(degree)], weights.T.ravel(), effort[: window - 1]))


def polynomial_state_size(window: int) -> int:
    """Return how many numbers ``state`` needs in all."""
    return BUFFERS + 6 * window + 2 * window + MAX_COEFFICIENTS * (MAX_COEFFICIENTS + 2)


@njit
def _acceleration_kernel(weight: Floats, period: Floats, effort_weight: Floats, window: int) -> None:
    """Turn the second derivative's weights on positions into the equal weights on the acceleration.

    sum_i w_i q_i = integral of K(t) q''(t), where K is w integrated twice: piecewise linear, zero outside the window.
    ``effort_weight`` receives the integral of K over the interval after each sample.
    """
    slope = 0.0
    kernel = 0.0
    for j in range(window - 2, -1, -1):
        slope += weight[j + 1]
        before = kernel + slope * period[j + 1]
        effort_weight[j] = 0.5 * period[j + 1] * (kernel + before)
        kernel = before


@njit
def fit_uneven(
    period: Floats,
    position: Floats,
    origin: float,
    window: int,
    degree: int,
    scale: float,
    scratch: Floats,
    coefficients: Floats,
) -> None:
    """Fit the polynomial on uneven stamps and derive the effort's weights.

    Args:
        period: time from the previous sample to each sample [s], shape (window,).
        position: positions [m], shape (window,).
        origin: subtracted from the positions [m].
        window: number of samples.
        degree: degree of the polynomial.
        scale: time that maps to 1 in the polynomial's argument [s].
        scratch: work space; its first ``window`` entries return the effort's weights.
        coefficients: receives the polynomial's coefficients, shape (degree + 1,).
    """
    count = degree + 1
    x = scratch[window : 2 * window]
    work = scratch[2 * window :]
    gram = work[: count * count]
    second = work[count * count : count * count + count]
    middle = window // 2
    x[middle] = 0.0
    for j in range(middle + 1, window):
        x[j] = x[j - 1] + period[j] / scale
    for j in range(middle - 1, -1, -1):
        x[j] = x[j + 1] - period[j + 1] / scale
    for m in range(count * count):
        gram[m] = 0.0
    for m in range(count):
        coefficients[m] = 0.0
        second[m] = 0.0
    second[2] = 1.0
    for j in range(window):
        power = 1.0
        value = position[j] - origin
        for m in range(count):
            coefficients[m] += power * value
            gram[m] += power
            power *= x[j]
        for m in range(1, count):
            gram[m * count + degree] += power
            power *= x[j]
    for m in range(1, count):  # moments only: entry (m, n) is the moment m + n
        for n in range(degree):
            gram[m * count + n] = gram[(m - 1) * count + n + 1]
    _solve_positive(gram, coefficients, second, count)
    for j in range(window):
        value = second[degree]
        for m in range(degree - 1, -1, -1):
            value = value * x[j] + second[m]
        x[j] = value * 2.0 / (scale * scale)
    _acceleration_kernel(x, period, scratch, window)


@njit
def _solve_positive(matrix: Floats, first: Floats, second: Floats, count: int) -> None:
    """Solve a symmetric positive definite system for two right-hand sides, all in place (Cholesky)."""
    for j in range(count):
        for i in range(j, count):
            value = matrix[i * count + j]
            for n in range(j):
                value -= matrix[i * count + n] * matrix[j * count + n]
            if i == j:
                matrix[i * count + j] = math.sqrt(value)
            else:
                matrix[i * count + j] = value / matrix[j * count + j]
    for j in range(count):
        for n in range(j):
            first[j] -= matrix[j * count + n] * first[n]
            second[j] -= matrix[j * count + n] * second[n]
        first[j] /= matrix[j * count + j]
        second[j] /= matrix[j * count + j]
    for j in range(count - 1, -1, -1):
        for n in range(j + 1, count):
            first[j] -= matrix[n * count + j] * first[n]
            second[j] -= matrix[n * count + j] * second[n]
        first[j] /= matrix[j * count + j]
        second[j] /= matrix[j * count + j]


@njit
def polynomial_value(coefficients: Floats, degree: int, x: float) -> float:
    """Return the polynomial's value at ``x`` (Horner)."""
    value: float = coefficients[degree]
    for m in range(degree - 1, -1, -1):
        value = value * x + coefficients[m]
    return value


@njit
def polynomial_sample(
    config: Floats, state: Floats, period: float, position: float, effort: float, row: Floats
) -> None:
    """Take one sample into the window and write its row.

    Args:
        config: the filter's fixed numbers.
        state: the filter's memory.
        period: time since the previous sample [s].
        position: measured position [m].
        effort: effort [N], NaN where missing.
        row: receives the columns of ``Motion``.
    """
    window = int(config[WINDOW])
    degree = int(config[DEGREE])
    capacity = 2 * window
    periods = state[BUFFERS : BUFFERS + capacity]
    positions = state[BUFFERS + capacity : BUFFERS + 2 * capacity]
    efforts = state[BUFFERS + 2 * capacity : BUFFERS + 3 * capacity]
    end = int(state[END])
    if state[layout.COUNT] == 1.0:
        end = 0
        state[REGULAR] = 0.0
    elif end == capacity:
        for j in range(window - 1):
            periods[j] = periods[j + window + 1]
            positions[j] = positions[j + window + 1]
            efforts[j] = efforts[j + window + 1]
        end = window - 1
    nominal = config[layout.SAMPLE_PERIOD]
    if abs(period - nominal) <= config[layout.PERIOD_TOLERANCE]:
        state[REGULAR] += 1.0
    else:
        state[REGULAR] = 0.0
    periods[end] = period
    positions[end] = position
    efforts[end] = effort
    end += 1
    state[END] = end
    if state[layout.COUNT] < window:
        return

    start = end - window
    middle = window // 2
    scale = nominal * middle
    count = degree + 1
    scratch = state[BUFFERS + 3 * capacity :]
    coefficients = scratch[2 * window + MAX_COEFFICIENTS * (MAX_COEFFICIENTS + 1) :]
    origin = positions[start + middle]
    is_even = state[REGULAR] >= window - 1
    if is_even:
        weights = config[WEIGHTS:]
        for m in range(count):
            coefficients[m] = 0.0
        for j in range(window):
            value = positions[start + j] - origin
            for m in range(count):
                coefficients[m] += weights[j * count + m] * value
        effort_weight = config[WEIGHTS + count * window :]
    else:
        fit_uneven(periods[start:end], positions[start:end], origin, window, degree, scale, scratch, coefficients)
        effort_weight = scratch
    smooth_effort = 0.0
    if config[layout.IS_HELD] > 0.0:
        for j in range(window - 1):
            smooth_effort += effort_weight[j] * efforts[start + j]
    else:
        for j in range(window - 1):
            smooth_effort += effort_weight[j] * 0.5 * (efforts[start + j] + efforts[start + j + 1])

    row[motion.PERIOD] = periods[start + middle]
    row[motion.POSITION] = origin + coefficients[0]
    row[motion.VELOCITY] = coefficients[1] / scale
    row[motion.ACCELERATION] = 2.0 * coefficients[2] / (scale * scale)
    if config[layout.IS_ALIGNED] > 0.0:
        row[motion.EFFORT] = smooth_effort
    else:
        row[motion.EFFORT] = effort
    if state[layout.COUNT] == window:
        back = polynomial_value(coefficients, degree, -periods[start + middle] / scale)
        row[motion.STEP_VELOCITY] = (coefficients[0] - back) / periods[start + middle]
    else:
        row[motion.STEP_VELOCITY] = (row[motion.POSITION] - state[LAST_POSITION]) / periods[start + middle]
    state[LAST_POSITION] = row[motion.POSITION]
    x = 0.0
    before = coefficients[0]
    for j in range(middle):
        step = periods[start + middle + 1 + j]
        x += step / scale
        value = polynomial_value(coefficients, degree, x)
        row[motion.LEAD + j] = (value - before) / step
        row[motion.LEAD + middle + j] = step
        before = value
    slope = 0.0
    bend = 0.0
    for m in range(degree, 0, -1):
        bend = bend * x + slope
        slope = slope * x + m * coefficients[m]
    row[motion.PRESENT_POSITION] = origin + before
    row[motion.PRESENT_VELOCITY] = slope / scale
    row[motion.PRESENT_ACCELERATION] = bend / (scale * scale)
