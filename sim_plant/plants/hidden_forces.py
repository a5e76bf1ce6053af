"""What the hidden effects do at one instant; see ``effects`` for how large they are and where they come from."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sgms_observer.jit import njit
from sim_plant.plants import slots as s

Floats = NDArray[np.float64]


@njit
def added_force(q: float, v: float, t: float, p: Floats) -> float:
    """Return the hidden force against positive motion [N].

    Args:
        q: position [m].
        v: velocity [m/s].
        t: time [s].
        p: hidden parameters.
    """
    force = p[s.CONSTANT] + p[s.SPRING] * (q - p[s.SPRING_CENTRE]) + p[s.DRAG] * v * abs(v)
    if p[s.RIPPLE] != 0.0:
        angle = 2.0 * math.pi * q / p[s.RIPPLE_PITCH]
        force += p[s.RIPPLE] * math.sin(angle + p[s.RIPPLE_PHASE])
        force += p[s.RIPPLE_SECOND] * math.sin(2.0 * angle + p[s.RIPPLE_SECOND_PHASE])
    if p[s.SHAKE] != 0.0:
        force += p[s.SHAKE] * math.sin(2.0 * math.pi * p[s.SHAKE_FREQUENCY] * t + p[s.SHAKE_PHASE])
    if p[s.WEIGHT] != 0.0:
        force += p[s.WEIGHT] * math.sin(q + p[s.WEIGHT_ANGLE])
    return float(force)


@njit
def slack_force(q: float, slack: float, p: Floats) -> float:
    """Return the force of a spring that pulls harder on the way out than on the way back [N].

    Args:
        q: position [m].
        slack: -1 long after going back, 1 long after going out [-].
        p: hidden parameters.
    """
    stretch = q / p[s.SLACK_REACH]
    return float(p[s.SLACK_FORCE] * stretch * (1.0 + 0.6 * slack * math.copysign(1.0, stretch)))


@njit
def placed_scale(q: float, v: float, p: Floats) -> float:
    """Return the factor on friction that place and direction make [-].

    Args:
        q: position [m].
        v: velocity [m/s].
        p: hidden parameters.
    """
    scale = 1.0
    if p[s.TIGHT_SHARE] != 0.0:
        away = abs(q - p[s.TIGHT_CENTRE]) / p[s.TIGHT_HALF_WIDTH]
        if away < 1.0:
            scale += p[s.TIGHT_SHARE] * math.cos(0.5 * math.pi * away) ** 2
    if v > 0.0:
        scale *= 1.0 + p[s.SIDE_SHARE]
    elif v < 0.0:
        scale *= 1.0 - p[s.SIDE_SHARE]
    return scale


@njit
def timed_scale(t: float, age: float, p: Floats) -> float:
    """Return the factor on friction that running in and resting make [-].

    Args:
        t: time [s].
        age: of the contact, grown at rest and lost by sliding [s].
        p: hidden parameters.
    """
    scale = 1.0
    if p[s.WARM_SHARE] != 0.0:
        scale += p[s.WARM_SHARE] * math.expm1(-t / p[s.WARM_TIME])
    if p[s.AGE_SHARE] != 0.0:
        scale *= 1.0 + p[s.AGE_SHARE] * math.log1p(age / p[s.AGE_TIME]) / math.log1p(1.0 / p[s.AGE_TIME])
    return scale


@njit
def arriving_effort(demand: float, p: Floats) -> float:
    """Return the effort that reaches the mass [N].

    Args:
        demand: effort of the controller [N].
        p: hidden parameters.
    """
    arrived = float(demand * (1.0 - p[s.LOST_GAIN]))
    if abs(arrived) <= p[s.DEAD_WIDTH]:
        return 0.0
    return arrived - math.copysign(float(p[s.DEAD_WIDTH]), arrived)


@njit
def on_map(q: float, values: Floats, p: Floats) -> float:
    """Return a map's value at a place, linear between its points and constant beyond its ends; 0 without a map.

    Args:
        q: position [m].
        values: map, in the unit of its values.
        p: hidden parameters.
    """
    if values.shape[0] == 0:
        return 0.0
    place = min(max((q - p[s.MAP_START]) / p[s.MAP_STEP], 0.0), values.shape[0] - 1.000001)
    left = int(place)
    return float(values[left] + (place - left) * (values[left + 1] - values[left]))
