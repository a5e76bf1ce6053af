"""The paper's block V: finite difference and a 2nd-order (Butterworth) low-pass.

As in the paper, nothing knows of the filter's delay. With ``align_effort`` every output is centred on one and the same
instant, the low-pass's delay plus one sample ago, and the effort passes the same low-pass.
"""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.filters import layout, motion
from sgms_observer.jit import njit

# own part of config
ANGULAR_CUTOFF = layout.OWN
DELAY = layout.OWN + 1

# own part of state
POSITION_STATE = layout.MEMORY  # low-pass of the position: value, rate, last input
EFFORT_STATE = layout.MEMORY + 3
LAST_PERIOD = layout.MEMORY + 6
LAST_VELOCITY = layout.MEMORY + 7
LAST_EFFORT = layout.MEMORY + 8
EARLIER_EFFORT = layout.MEMORY + 9
SIZE = layout.MEMORY + 10


def lowpass_config(cutoff: float, period: float) -> Floats:
    """Return the own part of ``config``.

    Args:
        cutoff: -3 dB frequency [Hz]; kept exactly by prewarping the bilinear transformation.
        period: nominal time between two samples [s].
    """
    angular = 2.0 / period * math.tan(math.pi * cutoff * period)
    return np.array([angular, math.sqrt(2.0) / angular + period])


@njit
def _lowpass_step(state: Floats, at: int, period: float, angular: float, value: float) -> None:
    """Step a 2nd-order Butterworth low-pass of corner ``angular`` [rad/s] by the trapezoidal rule over any period [s].

    ``state`` has value, rate and last input from ``at`` on.
    """
    half = 0.5 * period
    damping = math.sqrt(2.0) * angular
    stiffness = angular * angular
    y = state[at]
    rate = state[at + 1]
    push = stiffness * (0.5 * (state[at + 2] + value) - y)
    pull = (damping + half * stiffness) * rate
    change = period * (push - pull) / (1.0 + half * damping + half * half * stiffness)
    state[at] = y + period * (rate + 0.5 * change)
    state[at + 1] = rate + change
    state[at + 2] = value


@njit
def lowpass_sample(config: Floats, state: Floats, period: float, position: float, effort: float, row: Floats) -> None:
    """Take one sample and write its row.

    Args:
        config: the filter's fixed numbers.
        state: the filter's memory.
        period: time since the previous sample [s].
        position: measured position [m].
        effort: effort [N], NaN where missing.
        row: receives the columns of ``Motion``.
    """
    angular = config[ANGULAR_CUTOFF]
    nominal = config[layout.SAMPLE_PERIOD]
    known_effort = effort
    if not math.isfinite(effort):
        known_effort = state[LAST_EFFORT]
        state[layout.MISSING] = config[layout.READY_AFTER]
    if state[layout.COUNT] == 1.0:
        state[layout.ORIGIN] = position
        for j in range(layout.MEMORY, SIZE):
            state[j] = 0.0
        if math.isfinite(effort):
            state[EFFORT_STATE] = effort
            state[EFFORT_STATE + 2] = effort
            state[LAST_EFFORT] = effort
            state[EARLIER_EFFORT] = effort
        state[LAST_PERIOD] = nominal
        return
    last_position = state[POSITION_STATE]
    _lowpass_step(state, POSITION_STATE, period, angular, position - state[layout.ORIGIN])
    velocity = (state[POSITION_STATE] - last_position) / period
    acceleration = (velocity - state[LAST_VELOCITY]) / (0.5 * (period + state[LAST_PERIOD]))
    if config[layout.IS_HELD] > 0.0:
        acting = 0.5 * (state[LAST_EFFORT] + state[EARLIER_EFFORT])
    else:
        acting = state[LAST_EFFORT]
    _lowpass_step(state, EFFORT_STATE, period, angular, acting)
    if config[layout.IS_ALIGNED] > 0.0:
        lead = int(config[layout.DELAY_SAMPLES])
        share = period / (period + state[LAST_PERIOD])
        row[motion.PERIOD] = state[LAST_PERIOD]
        row[motion.POSITION] = state[layout.ORIGIN] + last_position
        row[motion.VELOCITY] = velocity + share * (state[LAST_VELOCITY] - velocity)
        row[motion.STEP_VELOCITY] = state[LAST_VELOCITY]
        row[motion.EFFORT] = state[EFFORT_STATE]
        if state[layout.MISSING] > 0.0:
            row[motion.EFFORT] = math.nan
        ahead = config[DELAY]
        step = ahead / max(lead, 1)
        for j in range(lead):
            row[motion.LEAD + j] = row[motion.VELOCITY] + acceleration * step * (j + 0.5)
            row[motion.LEAD + lead + j] = step
    else:
        ahead = 0.0
        row[motion.PERIOD] = period
        row[motion.POSITION] = position
        row[motion.VELOCITY] = velocity
        row[motion.STEP_VELOCITY] = velocity
        row[motion.EFFORT] = effort
    row[motion.ACCELERATION] = acceleration
    row[motion.PRESENT_ACCELERATION] = acceleration
    row[motion.PRESENT_VELOCITY] = row[motion.VELOCITY] + acceleration * ahead
    row[motion.PRESENT_POSITION] = row[motion.POSITION] + (row[motion.VELOCITY] + 0.5 * acceleration * ahead) * ahead
    state[LAST_PERIOD] = period
    state[LAST_VELOCITY] = velocity
    state[EARLIER_EFFORT] = state[LAST_EFFORT]
    state[LAST_EFFORT] = known_effort
    if state[layout.MISSING] > 0.0:
        state[layout.MISSING] -= 1.0
