"""Effects that scale the Stribeck level s(v): the returned factor multiplies what every element carries when sliding.

Rules and names as in ``effects_force``; ``level`` is the model's own s(v) [N] before any factor.
"""

import math


def position_periodic_friction(q, p):
    """Friction periodic in position: flips with the direction, unlike cogging [-]; p: share, pitch, phase."""
    return 1.0 + p[0] * math.sin(2.0 * math.pi * q / p[1] + p[2])


def position_dependent_friction(q, p):
    """Tight spot or rail fit: more friction around one place [-]; p: share, center, width."""
    ratio = (q - p[1]) / p[2]
    return 1.0 + p[0] * math.exp(-0.5 * ratio * ratio)


def asymmetric_coulomb(v, p):
    """Coulomb friction that differs between the directions [-]; p: share.

    An element slips at the level of the way it is going, however slowly: a soft step between the two would let the
    flicker of an encoder at rest pull stuck elements from one level to the other.
    """
    return 1.0 + p[0] * v / (math.fabs(v) + 1.0e-12)


def stribeck(v, p):
    """A rise of the friction toward low speed the model lacks [-]; p: share, velocity."""
    ratio = v / p[1]
    return 1.0 + p[0] * math.exp(-ratio * ratio)


def load_dependent_friction(a, p):
    """Friction that rises with the transmitted inertial load [-]; p: coefficient [s^2/m]."""
    return 1.0 + p[0] * math.fabs(a)


def thermal_drift(s, p):
    """Warm-up, a first-order process [-]; p: share, time_constant, ... State: progress, 1 when warm."""
    return 1.0 + p[0] * s[0]


def thermal_drift_next(v, h, s, p):
    """Advance the warm-up by a step; p: share, time_constant, motion_share, reference_velocity.

    A share of the heat is the friction's own power, in proportion to the speed; the rest flows in all the time.
    """
    heat = 1.0 - p[2] + p[2] * math.fabs(v) / p[3]
    return (heat + (s[0] - heat) * math.exp(-h / p[1]),)


def wear_step(s, p):
    """Step or slope of the level over the travelled distance [-]; p: share, travel, width. State: travel [m]."""
    return 1.0 + 0.5 * p[0] * (1.0 + math.tanh((s[0] - p[1]) / p[2]))


def wear_step_next(v, h, s, p):
    """Advance the travelled distance by a step."""
    return (s[0] + math.fabs(v) * h,)


def dwell_breakaway(s, p):
    """Static friction that rises at rest [-]; p: share, dwell_time, memory_distance. State: age of contact 0..1."""
    return 1.0 + p[0] * s[0]


def dwell_breakaway_next(v, h, s, p):
    """Age the contact at rest, renew it in motion; p: share, dwell_time, memory_distance, rest_velocity."""
    stillness = math.exp(-(v / p[3]) * (v / p[3]))
    aged = 1.0 + (s[0] - 1.0) * math.exp(-stillness * h / p[1])
    return (aged * math.exp(-math.fabs(v) * h / p[2]),)


def frictional_lag(level, s, p):
    """Sliding friction that follows the Stribeck curve with the rate C of eq. 2 [-]; p: attraction_rate, distance.

    State: lagged level [N], presliding ratio -1..1, 1 once started.
    """
    return s[0] / level


def frictional_lag_next(v, h, level, s, p):
    """Advance the lagged level: d level / dt = C (1 - lagged / level) while sliding, renewed while the contact sticks.

    The contact sticks for about ``distance`` after a reversal; there GMS elements follow the curve itself (eqs 1-2).
    """
    keep = math.exp(-math.fabs(v) * h / p[1])
    direction = v / (math.fabs(v) + 1.0e-12)
    ratio = s[1] * keep + direction * (1.0 - keep)
    along = 0.5 + 0.5 * ratio * direction
    sticking = 1.0 - along * along * along * along
    decay = math.exp(-p[0] * h / level - 5.0 * sticking * math.fabs(v) * h / p[1])
    lagged = level + (s[0] - level) * decay * s[2]
    return (lagged, ratio, 1.0 + 0.0 * s[2])
