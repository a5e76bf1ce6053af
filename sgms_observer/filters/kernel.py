"""The filter's step: checks the stamp of a sample, then calls the chosen kind of filter. Compiled, with plain
arrays."""

from __future__ import annotations

import math

from sgms_observer.arrays import Floats, Ints
from sgms_observer.filters import layout, motion
from sgms_observer.filters.lowpass import lowpass_sample
from sgms_observer.filters.polynomial import polynomial_sample
from sgms_observer.filters.tracking import tracking_sample
from sgms_observer.jit import njit

_LARGEST = 1.0e9
"""A larger position [m] or effort [N] is no measurement, and would stay in a recursive filter's memory for long."""


@njit
def _has_jumped(config: Floats, state: Floats, position: float, period: float) -> bool:
    """Return whether the speed changed by more than is possible: the encoder wrapped or was set to another value."""
    speed = (position - state[layout.LATEST_POSITION]) / period
    return bool(abs(speed - state[layout.LATEST_SPEED]) > config[layout.JUMP_SPEED])


@njit
def _elapsed(config: Floats, state: Floats, high: int, low: int, is_used: bool) -> float:
    """Return the time since the latest sample, used or not [s], and remember this one if time went on."""
    elapsed: float = config[layout.SAMPLE_PERIOD]
    if state[layout.HAS_PREVIOUS] > 0.0:
        elapsed = 1.0e-9 * ((high - state[layout.SEEN_HIGH]) * layout.STAMP_SPLIT + (low - state[layout.SEEN_LOW]))
        if elapsed > config[layout.MAXIMUM_GAP] or elapsed < -layout.CLOCK_RESET:
            if not is_used:
                return 0.0
            elapsed = config[layout.SAMPLE_PERIOD]
        elif not elapsed > 0.0:
            return 0.0
    elif not is_used:
        return 0.0
    state[layout.SEEN_HIGH] = high
    state[layout.SEEN_LOW] = low
    return elapsed


@njit
def filter_sample(config: Floats, state: Floats, stamp_ns: int, position: float, effort: float, row: Floats) -> None:
    """Take one sample and write its row.

    Args:
        config: the filter's fixed numbers, see ``layout``.
        state: the filter's memory, see ``layout``.
        stamp_ns: sample time [ns].
        position: measured position [m].
        effort: effort [N], NaN where missing.
        row: receives the columns of ``Motion``; on entry the previous row, which a rejected sample repeats.
    """
    high = stamp_ns // layout.STAMP_SPLIT
    low = stamp_ns - high * layout.STAMP_SPLIT
    period = config[layout.SAMPLE_PERIOD]
    is_restart = False
    is_jump = False
    if state[layout.HAS_PREVIOUS] > 0.0:
        period = 1.0e-9 * ((high - state[layout.STAMP_HIGH]) * layout.STAMP_SPLIT + (low - state[layout.STAMP_LOW]))
        is_restart = period > config[layout.MAXIMUM_GAP] or period < -layout.CLOCK_RESET
        if period > 0.0 and not is_restart:
            is_jump = _has_jumped(config, state, position, period)
            is_restart = is_jump
    if not abs(effort) < _LARGEST:
        effort = math.nan
    row[motion.IS_RESTART] = 0.0
    row[motion.IS_JUMP] = 0.0
    row[motion.IS_DENSE] = 0.0
    row[motion.IS_READY] = 0.0
    row[motion.IS_REJECTED] = 0.0
    is_used = (period > 0.0 or is_restart) and abs(position) < _LARGEST
    row[motion.ELAPSED] = _elapsed(config, state, high, low, is_used)
    if not is_used:
        row[motion.IS_REJECTED] = 1.0
        row[motion.PERIOD] = 0.0
        row[motion.EFFORT] = math.nan
        return
    state[layout.HAS_PREVIOUS] = 1.0
    state[layout.STAMP_HIGH] = high
    state[layout.STAMP_LOW] = low
    if 0.0 < period < layout.DENSE * config[layout.SAMPLE_PERIOD]:
        row[motion.IS_DENSE] = 1.0
    state[layout.LATEST_SPEED] = math.nan
    if not is_restart and state[layout.COUNT] > 0.0:
        state[layout.LATEST_SPEED] = (position - state[layout.LATEST_POSITION]) / period
    state[layout.LATEST_POSITION] = position
    if is_restart:
        row[motion.IS_RESTART] = 1.0
        row[motion.IS_JUMP] = 1.0 if is_jump else 0.0
        state[layout.COUNT] = 0.0
        state[layout.MISSING] = 0.0
        period = config[layout.SAMPLE_PERIOD]
    state[layout.COUNT] += 1.0
    is_ready = state[layout.COUNT] >= config[layout.READY_AFTER]
    if not is_ready:
        row[motion.PERIOD] = period
        row[motion.POSITION] = position
        row[motion.VELOCITY] = 0.0
        row[motion.ACCELERATION] = 0.0
        row[motion.EFFORT] = math.nan
        row[motion.STEP_VELOCITY] = 0.0
        row[motion.PRESENT_POSITION] = position
        row[motion.PRESENT_VELOCITY] = 0.0
        row[motion.PRESENT_ACCELERATION] = 0.0
        lead = int(config[layout.DELAY_SAMPLES])
        for j in range(lead):
            row[motion.LEAD + j] = 0.0
            row[motion.LEAD + lead + j] = config[layout.SAMPLE_PERIOD]
    if config[layout.KIND] == layout.SAVGOL:
        polynomial_sample(config, state, period, position, effort, row)
    elif config[layout.KIND] == layout.KALMAN:
        tracking_sample(config, state, period, position, effort, row)
    else:
        lowpass_sample(config, state, period, position, effort, row)
    if is_ready:
        row[motion.IS_READY] = 1.0


@njit
def filter_block(
    config: Floats, state: Floats, row: Floats, stamp_ns: Ints, position: Floats, effort: Floats, table: Floats
) -> None:
    """Take a block of samples, one after the other.

    Args:
        config: the filter's fixed numbers.
        state: the filter's memory.
        stamp_ns: sample times [ns], shape (n,).
        position: measured positions [m], shape (n,).
        effort: efforts [N], shape (n,).
        row: the previous row, shape (width,); updated.
        table: receives the rows, shape (n, width).
    """
    for k in range(stamp_ns.shape[0]):
        filter_sample(config, state, stamp_ns[k], position[k], effort[k], row)
        for j in range(row.shape[0]):
            table[k, j] = row[j]
