"""Kalman filter on position, velocity and acceleration driven by white jerk, with a fixed lag.

Row k is the estimate at the sample ``lag`` before k, given all samples up to k (Bryson and Frazier's backward recursion
over the lag); the samples in between are smoothed as well, so the lead velocities are the best there are. The effort
passes the very same time-varying filter, written in errors so that nothing grows: fed as if it were an acceleration, it
comes out weighted exactly as the acceleration is.
"""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.filters import layout, motion
from sgms_observer.jit import njit

# own part of config
NOISE_VARIANCE = layout.OWN
JERK_VARIANCE = layout.OWN + 1
MISSING_MEMORY = layout.OWN + 2

# own part of state: estimate (3), covariance (6), the effort's error state (3), then a ring of past samples
ESTIMATE = layout.MEMORY
COVARIANCE = layout.MEMORY + 3  # qq qv qa vv va aa
EFFORT_ERROR = layout.MEMORY + 9  # position error, velocity error, smoothed effort
LAST_EFFORT = layout.MEMORY + 12
LAST_POSITION = layout.MEMORY + 13
RING = layout.MEMORY + 14

# one sample in the ring
R_PERIOD = 0
R_PRIOR = 1  # prior estimate (3)
R_COVARIANCE = 4  # prior covariance (6)
R_GAIN = 10  # (3)
R_INNOVATION = 13  # over its variance
R_EFFORT_PRIOR = 14
R_EFFORT_INNOVATION = 15  # over its variance
R_EFFORT_LATER = 16  # effort acting over the period before this sample
R_SIZE = 17

INITIAL_VELOCITY_STD = 1.0  # m/s: nothing is known of the motion at a start
INITIAL_ACCELERATION_STD = 100.0  # m/s^2


def tracking_config(position_noise: float, jerk_density: float, missing_memory: int) -> Floats:
    """Return the own part of ``config``.

    Args:
        position_noise: standard deviation of a position [m].
        jerk_density: spectral density of the jerk [m/s^3/sqrt(Hz)].
        missing_memory: samples for which a missing effort is remembered.
    """
    return np.array([position_noise**2, jerk_density**2, float(missing_memory)])


def tracking_state_size(lag_samples: int) -> int:
    """Return how many numbers ``state`` needs in all."""
    return RING + R_SIZE * (lag_samples + 1)


@njit
def _tracking_predict(state: Floats, period: float, jerk_variance: float, effort: float) -> None:
    """Move estimate, covariance and the effort's error state over one period [s] with a mean effort [N]."""
    h = period
    half = 0.5 * h * h
    state[ESTIMATE] += h * state[ESTIMATE + 1] + half * state[ESTIMATE + 2]
    state[ESTIMATE + 1] += h * state[ESTIMATE + 2]
    surplus = state[EFFORT_ERROR + 2] - effort
    state[EFFORT_ERROR] += h * state[EFFORT_ERROR + 1] + half * surplus
    state[EFFORT_ERROR + 1] += h * surplus
    qq, qv, qa = state[COVARIANCE], state[COVARIANCE + 1], state[COVARIANCE + 2]
    vv, va, aa = state[COVARIANCE + 3], state[COVARIANCE + 4], state[COVARIANCE + 5]
    row_qv = qv + h * vv + half * va
    row_qa = qa + h * va + half * aa
    row_va = va + h * aa
    h3 = h * h * h
    state[COVARIANCE] = qq + h * qv + half * qa + h * row_qv + half * row_qa + jerk_variance * h3 * h * h / 20.0
    state[COVARIANCE + 1] = row_qv + h * row_qa + jerk_variance * h3 * h / 8.0
    state[COVARIANCE + 2] = row_qa + jerk_variance * h3 / 6.0
    state[COVARIANCE + 3] = vv + h * va + h * row_va + jerk_variance * h3 / 3.0
    state[COVARIANCE + 4] = row_va + jerk_variance * h * h / 2.0
    state[COVARIANCE + 5] = aa + jerk_variance * h


@njit
def tracking_sample(config: Floats, state: Floats, period: float, position: float, effort: float, row: Floats) -> None:
    """Take one sample and write the row of the sample ``lag`` before it.

    Args:
        config: the filter's fixed numbers.
        state: the filter's memory.
        period: time since the previous sample [s].
        position: measured position [m].
        effort: effort [N], NaN where missing.
        row: receives the columns of ``Motion``.
    """
    lag = int(config[layout.DELAY_SAMPLES])
    size = lag + 1
    count = int(state[layout.COUNT])
    known_effort = effort
    if not math.isfinite(effort):
        known_effort = state[LAST_EFFORT]
        state[layout.MISSING] = config[MISSING_MEMORY]
    if count == 1:
        for j in range(layout.MEMORY, RING):
            state[j] = 0.0
        state[layout.ORIGIN] = position
        state[COVARIANCE] = config[NOISE_VARIANCE]
        state[COVARIANCE + 3] = INITIAL_VELOCITY_STD * INITIAL_VELOCITY_STD
        state[COVARIANCE + 5] = INITIAL_ACCELERATION_STD * INITIAL_ACCELERATION_STD
        if not math.isfinite(effort):
            known_effort = 0.0
        state[EFFORT_ERROR + 2] = known_effort
        acting = known_effort
    else:
        acting = state[LAST_EFFORT]
        if config[layout.IS_HELD] == 0.0:
            acting = 0.5 * (acting + known_effort)
        _tracking_predict(state, period, config[JERK_VARIANCE], acting)
    state[LAST_EFFORT] = known_effort

    at = RING + R_SIZE * (count % size)
    innovation_variance = state[COVARIANCE] + config[NOISE_VARIANCE]
    innovation = position - state[layout.ORIGIN] - state[ESTIMATE]
    effort_innovation = -state[EFFORT_ERROR]
    state[at + R_PERIOD] = period
    for j in range(3):
        state[at + R_PRIOR + j] = state[ESTIMATE + j]
        state[at + R_GAIN + j] = state[COVARIANCE + j] / innovation_variance
    for j in range(6):
        state[at + R_COVARIANCE + j] = state[COVARIANCE + j]
    state[at + R_INNOVATION] = innovation / innovation_variance
    state[at + R_EFFORT_PRIOR] = state[EFFORT_ERROR + 2]
    state[at + R_EFFORT_INNOVATION] = effort_innovation / innovation_variance
    state[at + R_EFFORT_LATER] = acting
    gain_q, gain_v, gain_a = state[at + R_GAIN], state[at + R_GAIN + 1], state[at + R_GAIN + 2]
    for j in range(3):
        state[ESTIMATE + j] += state[at + R_GAIN + j] * innovation
        state[EFFORT_ERROR + j] += state[at + R_GAIN + j] * effort_innovation
    qq, qv, qa = state[COVARIANCE], state[COVARIANCE + 1], state[COVARIANCE + 2]
    state[COVARIANCE] = qq * config[NOISE_VARIANCE] / innovation_variance
    state[COVARIANCE + 1] = qv * (1.0 - gain_q)
    state[COVARIANCE + 2] = qa * (1.0 - gain_q)
    state[COVARIANCE + 3] -= gain_v * qv
    state[COVARIANCE + 4] -= gain_v * qa
    state[COVARIANCE + 5] -= gain_a * qa
    if count >= size:
        _smooth_row(config, state, count, lag, row)
        if config[layout.IS_ALIGNED] == 0.0:
            row[motion.EFFORT] = effort
        elif state[layout.MISSING] > 0.0:
            row[motion.EFFORT] = math.nan
    if state[layout.MISSING] > 0.0:
        state[layout.MISSING] -= 1.0


@njit
def _smooth_row(config: Floats, state: Floats, count: int, lag: int, row: Floats) -> None:
    """Run the backward recursion from sample ``count`` over the lag [samples] and write the columns of ``Motion``."""
    size = lag + 1
    m0, m1, m2 = 0.0, 0.0, 0.0
    e0, e1, e2 = 0.0, 0.0, 0.0
    later_position = 0.0
    later_period = 0.0
    for back in range(lag + 1):
        at = RING + R_SIZE * ((count - back) % size)
        m0 = m0 - (state[at + R_GAIN] * m0 + state[at + R_GAIN + 1] * m1 + state[at + R_GAIN + 2] * m2)
        e0 = e0 - (state[at + R_GAIN] * e0 + state[at + R_GAIN + 1] * e1 + state[at + R_GAIN + 2] * e2)
        m0 += state[at + R_INNOVATION]
        e0 += state[at + R_EFFORT_INNOVATION]
        covariance = state[at + R_COVARIANCE : at + R_COVARIANCE + 6]
        position = state[at + R_PRIOR] + covariance[0] * m0 + covariance[1] * m1 + covariance[2] * m2
        if back > 0:
            row[motion.LEAD + size - 1 - back] = (later_position - position) / later_period
            row[motion.LEAD + lag + size - 1 - back] = later_period
        if back == lag:
            row[motion.PERIOD] = state[at + R_PERIOD]
            row[motion.POSITION] = state[layout.ORIGIN] + position
            row[motion.VELOCITY] = (
                state[at + R_PRIOR + 1] + covariance[1] * m0 + covariance[3] * m1 + covariance[4] * m2
            )
            row[motion.ACCELERATION] = (
                state[at + R_PRIOR + 2] + covariance[2] * m0 + covariance[4] * m1 + covariance[5] * m2
            )
            row[motion.EFFORT] = (
                state[at + R_EFFORT_PRIOR] + covariance[2] * e0 + covariance[4] * e1 + covariance[5] * e2
            )
            if count == size:
                row[motion.STEP_VELOCITY] = row[motion.VELOCITY]
            else:
                row[motion.STEP_VELOCITY] = (position - state[LAST_POSITION]) / state[at + R_PERIOD]
            state[LAST_POSITION] = position
        h = state[at + R_PERIOD]
        m2 = 0.5 * h * h * m0 + h * m1 + m2
        m1 = h * m0 + m1
        e2 = 0.5 * h * h * e0 + h * e1 + e2
        e1 = h * e0 + e1
        later_position = position
        later_period = h
    row[motion.PRESENT_POSITION] = state[layout.ORIGIN] + state[ESTIMATE]
    row[motion.PRESENT_VELOCITY] = state[ESTIMATE + 1]
    row[motion.PRESENT_ACCELERATION] = state[ESTIMATE + 2]
