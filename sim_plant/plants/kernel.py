"""The machine in closed loop: sampled controller, effort held over its period, semi-implicit Euler steps between.

What the hidden effects do at one instant stands first; ``effects`` says how large they are and where they come from.
"""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit
from sim_plant.plants import slots as s
from sim_plant.plants.contact import advance
from sim_plant.plants.stribeck import relaxed

POSITION, EFFORT, FRICTION, HIDDEN, TRUE_VELOCITY = 0, 1, 2, 3, 4
"""Columns of what comes out, one row per logged sample."""

PROPORTIONAL, DERIVATIVE, INTEGRAL, FILTER_RATE, FEEDFORWARD = 0, 1, 2, 3, 4
"""Columns of the controller: N/m, N s/m, N/(m s), corner of the velocity filter [rad/s], mass it assumes [kg]."""


@njit
def _added_force(q: float, v: float, t: float, p: Floats) -> float:
    """Return the hidden force against positive motion at a position [m], a velocity [m/s] and a time [s] [N]."""
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
def _slack_force(q: float, slack: float, p: Floats) -> float:
    """Return the force of a spring that pulls harder going out (slack towards 1) than going back (towards -1) [N]."""
    stretch = q / p[s.SLACK_REACH]
    return float(p[s.SLACK_FORCE] * stretch * (1.0 + 0.6 * slack * math.copysign(1.0, stretch)))


@njit
def _placed_scale(q: float, v: float, p: Floats) -> float:
    """Return the factor on friction that place and direction make [-]."""
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
def _timed_scale(t: float, age: float, p: Floats) -> float:
    """Return the factor on friction that running in and the age of the contact [s] make [-]."""
    scale = 1.0
    if p[s.WARM_SHARE] != 0.0:
        scale += p[s.WARM_SHARE] * math.expm1(-t / p[s.WARM_TIME])
    if p[s.AGE_SHARE] != 0.0:
        scale *= 1.0 + p[s.AGE_SHARE] * math.log1p(age / p[s.AGE_TIME]) / math.log1p(1.0 / p[s.AGE_TIME])
    return scale


@njit
def _arriving_effort(demand: float, p: Floats) -> float:
    """Return the effort that reaches the mass when the controller demands one [N]."""
    arrived = float(demand * (1.0 - p[s.LOST_GAIN]))
    if abs(arrived) <= p[s.DEAD_WIDTH]:
        return 0.0
    return arrived - math.copysign(float(p[s.DEAD_WIDTH]), arrived)


@njit
def _on_map(q: float, values: Floats, p: Floats) -> float:
    """Return a map's value at a place, linear between its points and constant beyond its ends; 0 without a map."""
    if values.shape[0] == 0:
        return 0.0
    place = min(max((q - p[s.MAP_START]) / p[s.MAP_STEP], 0.0), values.shape[0] - 1.000001)
    left = int(place)
    return float(values[left] + (place - left) * (values[left + 1] - values[left]))


@njit
def run(
    goal: Floats,
    goal_v: Floats,
    goal_a: Floats,
    period: float,
    steps: int,
    every: int,
    number: int,
    mass: float,
    viscous: float,
    curve: Floats,
    law: Floats,
    state: Floats,
    controller: Floats,
    resolution: float,
    p: Floats,
    force_map: Floats,
    scale_map: Floats,
    outside: Floats,
) -> Floats:
    """Run the closed loop and return one row per logged sample.

    Args:
        goal: reference position at each sample of the controller [m].
        goal_v: its velocity [m/s].
        goal_a: its acceleration [m/s^2].
        period: of the controller [s].
        steps: integration steps per period.
        every: the log keeps each ``every``-th sample.
        number: place of the contact law in ``contact.LAWS``.
        mass: nominal moving mass [kg].
        viscous: viscous coefficient [N s/m].
        curve: sliding curve, see ``stribeck``.
        law: parameters of the contact law.
        state: of the contact; changed.
        controller: columns named above.
        resolution: of the encoder [m].
        p: hidden parameters, see ``slots``.
        force_map: hidden force over position [N], evenly spaced from ``p[MAP_START]``; empty for none.
        scale_map: hidden share of friction over position, in the positive direction only [-]; empty for none.
        outside: force against positive motion at each sample [N]: noise and hidden alike.
    """
    count = goal.shape[0]
    rows = (count + every - 1) // every
    out = np.zeros((rows, 5))
    efforts = np.zeros(count)
    h = period / steps
    body = mass + p[s.ADDED_MASS] - p[s.LOAD_MASS]
    keep = math.exp(-controller[FILTER_RATE] * period)
    q, v = goal[0], 0.0
    load_q, load_v = q, 0.0
    contact, age, slack = 0.0, 0.5, 0.0
    shown_before = math.floor(q / resolution + 0.5) * resolution
    speed, integral = 0.0, 0.0
    for k in range(count):
        shown = math.floor(q / resolution + 0.5) * resolution
        speed = keep * speed + (1.0 - keep) * (shown - shown_before) / period
        shown_before = shown
        error = goal[k] - shown
        integral += controller[INTEGRAL] * error * period
        effort = controller[PROPORTIONAL] * error + controller[DERIVATIVE] * (goal_v[k] - speed) + integral
        effort += controller[FEEDFORWARD] * goal_a[k]
        efforts[k] = effort
        row = k // every
        if k % every == 0:
            out[row, POSITION] = shown
            out[row, EFFORT] = effort
            out[row, TRUE_VELOCITY] = v
        weight = 1.0 / (steps * min(every, count - row * every))
        for j in range(steps):
            t = (k + j / steps) * period
            demand = effort
            if p[s.DELAY] > 0.0:
                demand = efforts[max(math.floor(k + j / steps - p[s.DELAY] / period), 0)]
            applied = _arriving_effort(demand, p)
            hidden = _added_force(q, v, t, p) + _on_map(q, force_map, p)
            if p[s.SLACK_FORCE] != 0.0:
                slack = relaxed(slack, v / p[s.SLACK_DISTANCE], abs(v) / p[s.SLACK_DISTANCE], h)
                hidden += _slack_force(q, slack, p)
            scale = _placed_scale(q, v, p) * _timed_scale(t, age, p)
            if v > 0.0:
                scale *= 1.0 + _on_map(q, scale_map, p)
            if p[s.AGE_SHARE] != 0.0:
                age = relaxed(age, 1.0, abs(v) / p[s.AGE_LENGTH], h)
            friction = contact + viscous * v
            link = 0.0
            if p[s.LOAD_MASS] > 0.0:
                link = p[s.LOAD_STIFFNESS] * (q - load_q) + p[s.LOAD_DAMPING] * (v - load_v)
                load_v += h * link / p[s.LOAD_MASS]
                load_q += h * load_v
            acceleration = (applied - friction - hidden - outside[k] - link) / body
            out[row, FRICTION] += weight * (friction + hidden)
            missed = hidden + effort - applied + contact * (1.0 - 1.0 / scale) + p[s.ADDED_MASS] * acceleration
            if p[s.LOAD_MASS] > 0.0:
                missed += link - p[s.LOAD_MASS] * acceleration
            out[row, HIDDEN] += weight * missed
            v += h * acceleration
            q += h * v
            contact = advance(number, v, h, scale, curve, law, state)
    return out
