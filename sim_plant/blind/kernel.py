"""The blind plant in closed loop: 10 us leapfrog steps, event-driven contact, controller at the sampling rate."""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.jit import njit
from sim_plant.blind import slots as s
from sim_plant.blind.hidden_force import added_force, arriving_effort, placed_factor, reading, sided_factor

STEPS = 100  # per sample of 1 ms: 10 us

# columns of what the plant puts out, one row per sample
SHOWN, EFFORT, TRUE_X, TRUE_V, TRUE_A, HIDDEN, FRICTION, LEVEL = 0, 1, 2, 3, 4, 5, 6, 7


@njit
def sliding_curve(speed: float, low_speed_force: float, high_speed_force: float, knee: float) -> float:
    """Return the friction of steady sliding [N] at ``speed`` [m/s]: it falls with the square of speed over ``knee``."""
    return high_speed_force + (low_speed_force - high_speed_force) * math.exp(-((speed / knee) ** 2))


@njit
def carry(
    loads: Floats,
    is_slipping: Booleans,
    springs: Floats,
    shares: Floats,
    travel: float,
    duration: float,
    level: float,
    rate: float,
) -> float:
    """Move the contact by ``travel`` in one direction and return its force.

    Args:
        loads: force of each element [N]; changed in place.
        is_slipping: mode of each element; changed in place.
        springs: stiffness of each element [N/m].
        shares: share of the level each element carries.
        travel: signed displacement [m].
        duration: time it takes [s].
        level: sliding friction at this speed [N].
        rate: attraction of slipping elements to the level [N/s].

    Returns:
        Friction force, positive against positive motion [N].
    """
    if travel == 0.0:
        return float(loads.sum())
    side = 1.0 if travel > 0.0 else -1.0
    forget = math.exp(-rate * duration / level)
    total = 0.0
    for i in range(loads.shape[0]):
        target = side * shares[i] * level
        if is_slipping[i]:
            loads[i] = target + (loads[i] - target) * forget
        else:
            tried = loads[i] + springs[i] * travel
            if side * tried < side * target:
                loads[i] = tried
            else:
                used = side * (target - loads[i]) / (springs[i] * abs(travel))
                start = target
                if used < 0.0:  # the level fell below what the element carries
                    used = 0.0
                    start = loads[i]
                loads[i] = target + (start - target) * math.exp(-rate * duration * (1.0 - used) / level)
                is_slipping[i] = True
        total += loads[i]
    return total


@njit
def run(
    goal: Floats,
    goal_v: Floats,
    goal_a: Floats,
    period: float,
    mass: float,
    springs: Floats,
    shares: Floats,
    curve: Floats,
    gains: Floats,
    p: Floats,
    force_series: Floats,
    level_series: Floats,
    viscous_series: Floats,
    steps: int,
) -> Floats:
    """Run the closed loop and return one row per sample (columns named above).

    Args:
        goal: reference position at each sample [m].
        goal_v: reference velocity [m/s].
        goal_a: reference acceleration [m/s^2].
        period: sample period [s].
        mass: moving mass [kg].
        springs: stiffness of the contact's elements [N/m].
        shares: their shares of the level.
        curve: force at low speed, force at high speed [N], knee [m/s], viscous coefficient [N s/m], attraction
            [N/s].
        gains: position [N/m], velocity [N s/m], integral [N/(m s)], filter time of the velocity [s], largest
            effort [N].
        p: the hidden parameters, see ``slots``.
        force_series: force against positive motion at each sample [N], interpolated: noise and hidden alike.
        level_series: factor on the sliding level at each sample.
        viscous_series: factor on the viscous coefficient at each sample.
        steps: integration steps per sample.
    """
    count = goal.shape[0]
    out = np.zeros((count, 8))
    dt = period / steps
    loads = np.zeros(springs.shape[0])
    is_slipping = np.zeros(springs.shape[0], dtype=np.bool_)
    link_mass = p[s.LINK_MASS]
    body = mass + p[s.EXTRA_MASS] - link_mass
    carriage_share = 1.0 - p[s.LINK_FRICTION_SHARE]
    x = goal[0]
    v = 0.0
    x2 = x
    v2 = 0.0
    load2 = 0.0
    contact = 0.0
    acceleration = 0.0
    felt = 0.0
    lagged = curve[0]
    heat = 0.0
    travel = 0.0
    age = 0.5
    remembered = 0.0
    cover_x = x
    iron = 0.0
    at_rest = 0.0
    ridge_newer = np.inf
    ridge_older = np.inf
    has_left = False
    shown_before = reading(x, p)
    speed_estimate = 0.0
    integral = 0.0
    smooth = period / (period + gains[3])
    for k in range(count):
        shown = reading(x, p)
        speed_estimate += smooth * ((shown - shown_before) / period - speed_estimate)
        shown_before = shown
        error = goal[k] - shown
        effort = mass * goal_a[k] + gains[0] * error + gains[1] * (goal_v[k] - speed_estimate) + integral
        if abs(effort) < gains[4]:
            integral += gains[2] * error * period
        effort = min(max(effort, -gains[4]), gains[4])
        out[k, SHOWN] = shown
        out[k, EFFORT] = effort
        out[k, TRUE_X] = x
        out[k, TRUE_V] = v
        hidden_sum = 0.0
        friction_sum = 0.0
        level_sum = 0.0
        v_start = v
        after = min(k + 1, count - 1)
        for j in range(steps):
            part = (j + 0.5) / steps
            if p[s.DELAY] > 0.0:
                back = k + part - p[s.DELAY] / period
                demand = out[max(math.floor(back), 0), 1]
            else:
                demand = effort
            applied = arriving_effort(demand, p)
            if p[s.IRON_SHARE] != 0.0:
                iron = min(max(iron, demand - p[s.IRON_WIDTH]), demand + p[s.IRON_WIDTH])
                applied -= p[s.IRON_SHARE] * (demand - iron)
            outside = force_series[k] + part * (force_series[after] - force_series[k])
            hidden = added_force(x, v, p)
            if p[s.COVER_STIFFNESS] > 0.0:
                pull = p[s.COVER_STIFFNESS] * (x - cover_x)
                if abs(pull) > p[s.COVER_STICK]:
                    side = 1.0 if pull > 0.0 else -1.0
                    cover_x = x - side * p[s.COVER_SLIP] / p[s.COVER_STIFFNESS]
                hidden += p[s.COVER_STIFFNESS] * (x - cover_x)
            # --- sliding level and everything that scales it
            speed = abs(v)
            level = sliding_curve(speed, curve[0], curve[1], curve[2])
            plain = level
            if p[s.LAG_TIME] > 0.0:
                lagged += (level - lagged) * (1.0 - math.exp(-dt / p[s.LAG_TIME]))
                level = lagged
            factor = placed_factor(x, v, p) * level_series[k]
            if p[s.AGE_A] != 0.0:
                factor *= 1.0 + p[s.AGE_A] * math.log1p(age / p[s.AGE_TIME]) / math.log1p(2.0 / p[s.AGE_TIME])
            if p[s.HEAT_A] != 0.0:
                factor *= 1.0 + p[s.HEAT_A] * heat
                heat += dt / p[s.HEAT_TIME] * (abs(contact * v) / p[s.HEAT_POWER] - heat)
            if p[s.WEAR_A] != 0.0:
                travel += speed * dt
                progress = min(max((travel - p[s.WEAR_TRAVEL]) / p[s.WEAR_LENGTH], 0.0), 1.0)
                factor *= 1.0 + p[s.WEAR_A] * progress
            if p[s.LOAD_A] != 0.0:
                felt += dt / 0.001 * (abs(acceleration) - felt)
                factor *= 1.0 + p[s.LOAD_A] * (felt / p[s.LOAD_ACCELERATION]) ** 1.2
            if p[s.MEMORY_A] != 0.0:
                side = 1.0 if v > 0.0 else -1.0
                if speed > 1.0e-4:
                    remembered += dt / p[s.MEMORY_TIME] * (side - remembered)
            if p[s.RIDGE_A] != 0.0:
                width = p[s.RIDGE_WIDTH]
                at_rest = at_rest + dt if speed < 5.0e-4 else 0.0
                if at_rest > 0.03 and abs(x - ridge_newer) > 2.0 * width:
                    ridge_older = ridge_newer
                    ridge_newer = x
                    has_left = False
                if abs(x - ridge_newer) > 3.0 * width:
                    has_left = True
                bump = 0.0
                if at_rest == 0.0:
                    bump = math.exp(-(((x - ridge_older) / width) ** 2))
                    if has_left:
                        bump = max(bump, math.exp(-(((x - ridge_newer) / width) ** 2)))
                factor *= 1.0 + p[s.RIDGE_A] * bump
            either = level * factor * carriage_share
            level = either * sided_factor(v, remembered, p)
            # --- forces on the carriage
            viscous = curve[3] * viscous_series[k] * v
            extra_viscous = curve[3] * (viscous_series[k] - 1.0) * v
            link = 0.0
            if link_mass > 0.0:
                stretch = x - x2
                rate = v - v2
                gap = 0.5 * p[s.LINK_GAP]
                if abs(stretch) > gap:
                    stretch -= gap if stretch > 0.0 else -gap
                    link = p[s.LINK_STIFFNESS] * stretch + p[s.LINK_DAMPING] * rate
                if p[s.LINK_FRICTION_SHARE] > 0.0:
                    bound = p[s.LINK_FRICTION_SHARE] * plain
                    load2 = min(max(load2 + bound / 2.0e-6 * v2 * dt, -bound), bound)
                v2 += dt * (link - load2) / link_mass
                x2 += v2 * dt
            acceleration = (applied - contact - viscous - hidden - outside - link) / body
            v_new = v + acceleration * dt
            resisted = contact
            # --- the contact moves along, with the reversal inside the step
            if v * v_new < 0.0:
                turn = v / (v - v_new)
                contact = carry(loads, is_slipping, springs, shares, 0.5 * v * turn * dt, turn * dt, level, curve[4])
                is_slipping[:] = False
                left = 1.0 - turn
                level = either * sided_factor(v_new, remembered, p)
                contact = carry(
                    loads, is_slipping, springs, shares, 0.5 * v_new * left * dt, left * dt, level, curve[4]
                )
                x += 0.5 * (v * turn + v_new * left) * dt
            else:
                contact = carry(loads, is_slipping, springs, shares, v_new * dt, dt, level, curve[4])
                x += v_new * dt
            v = v_new
            if p[s.AGE_A] != 0.0:
                sliding = 0.0
                for i in range(shares.shape[0]):
                    if is_slipping[i]:
                        sliding += shares[i]
                age = age * math.exp(-sliding * abs(v) * dt / p[s.AGE_DISTANCE]) + dt
            # --- what a perfect nominal model would miss
            share_hidden = resisted - resisted * plain / (level if level > 0.0 else plain)
            hidden_sum += hidden + extra_viscous + share_hidden + (effort - applied)
            if p[s.LAG_TIME] == s.LAG_BY_ATTRACTION:
                side = 1.0 if v > 0.0 else -1.0
                for i in range(shares.shape[0]):
                    if is_slipping[i]:
                        hidden_sum += loads[i] - side * shares[i] * level
            hidden_sum += link + (p[s.EXTRA_MASS] - link_mass) * acceleration
            friction_sum += resisted
            level_sum += level
        out[k, TRUE_A] = (v - v_start) / period
        out[k, HIDDEN] = hidden_sum / steps
        out[k, FRICTION] = friction_sum / steps
        out[k, LEVEL] = level_sum / steps
    return out
