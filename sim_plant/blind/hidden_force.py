"""The hidden forces and friction factors of the blind plant, in shapes of their own."""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit
from sim_plant.blind import slots as s


@njit
def added_force(x: float, v: float, p: Floats) -> float:
    """Return the hidden force against positive motion that depends on position [m] and velocity [m/s] alone [N]."""
    total = p[s.OFFSET]
    if p[s.COGGING_A] != 0.0:
        turn = 2.0 * math.pi * x / p[s.COGGING_PITCH]
        total += p[s.COGGING_A] * math.cos(turn - p[s.COGGING_PHASE])
        total += p[s.COGGING_A2] * math.cos(2.0 * turn - p[s.COGGING_PHASE2])
    if p[s.SPRING_K1] != 0.0:
        stretch = x - p[s.SPRING_REST]
        total += stretch * (p[s.SPRING_K1] + p[s.SPRING_K3] * stretch * stretch)
    speed = abs(v)
    side = 1.0 if v > 0.0 else (-1.0 if v < 0.0 else 0.0)
    if p[s.SIDED_VISCOUS_A] != 0.0:  # the seal of one side: nearly proportional, slightly bent
        share = speed / p[s.SIDED_VISCOUS_SPEED]
        total += p[s.SIDED_VISCOUS_A] * share * 1.2 / (1.0 + 0.2 * share)
    if p[s.POWER_A] != 0.0:
        total += side * p[s.POWER_A] * (speed / p[s.POWER_SPEED]) ** p[s.POWER_EXPONENT]
    if p[s.DRAG_A] != 0.0:
        share = speed / p[s.DRAG_SPEED]
        total += side * p[s.DRAG_A] * share * share * (0.9 + 0.1 * share)
    if p[s.EDDY_A] != 0.0:
        share = speed / p[s.EDDY_SPEED]
        total += side * p[s.EDDY_A] * 2.0 * share / (1.0 + share ** p[s.EDDY_POWER])
    return float(total)


@njit
def placed_factor(x: float, v: float, p: Floats) -> float:
    """Return the factor on the sliding level that depends on position and velocity alone [-]."""
    factor = 1.0
    if p[s.RIPPLE_A] != 0.0:  # a triangle with rounded tips, as of balls entering a race
        turn = 2.0 * math.pi * x / p[s.RIPPLE_PITCH] + p[s.RIPPLE_PHASE]
        factor *= 1.0 + p[s.RIPPLE_A] * math.asin(0.95 * math.sin(turn)) / math.asin(0.95)
    if p[s.SPOT_A] != 0.0:  # flat top, steep edges
        away = abs(x - p[s.SPOT_PLACE]) - p[s.SPOT_HALF_WIDTH]
        factor *= 1.0 + p[s.SPOT_A] / (1.0 + math.exp(min(50.0, away / p[s.SPOT_EDGE])))
    if p[s.WEAKENING_A] != 0.0:
        factor *= 1.0 + p[s.WEAKENING_A] / (1.0 + (abs(v) / p[s.WEAKENING_SPEED]) ** p[s.WEAKENING_POWER])
    return float(factor)


@njit
def sided_factor(v: float, remembered: float, p: Floats) -> float:
    """Return the factor on the sliding level that depends on the direction alone [-].

    Args:
        v: its sign is the direction.
        remembered: how long it went which way, -1 to 1.
        p: the hidden parameters.
    """
    side = 1.0 if v > 0.0 else -1.0
    return float((1.0 + side * p[s.SIDED_COULOMB_A]) * (1.0 + side * p[s.MEMORY_A] * remembered))


@njit
def arriving_effort(demand: float, p: Floats) -> float:
    """Return the force that reaches the carriage for an effort ``demand`` [N]: gain, dead band, limit."""
    size = abs(demand)
    band = p[s.DEAD_BAND]
    if band > 0.0:  # a hyperbola: soft inside, full loss outside
        size = math.sqrt(size * size + band * band) - band
    limit = p[s.LIMIT]
    if limit < np.inf and size > 0.95 * limit:
        rest = 0.08 * limit  # bends at 0.95 of the limit and creeps to 1.03 of it
        size = 0.95 * limit + rest * math.tanh((size - 0.95 * limit) / rest)
    return float(p[s.GAIN] * (size if demand > 0.0 else -size))


@njit
def reading(x: float, p: Floats) -> float:
    """Return what the encoder shows at position ``x`` [m]."""
    shown = x
    if p[s.ENCODER_A] != 0.0:
        turn = 2.0 * math.pi * x / p[s.ENCODER_PITCH] + p[s.ENCODER_PHASE]
        shown += p[s.ENCODER_A] * math.cos(turn) + p[s.ENCODER_A2] * math.cos(2.0 * turn)
    step = p[s.RESOLUTION]
    return float(step * math.floor(shown / step + 0.5))
