"""Effects: forces that are added, factors on the Stribeck level, and what happens to effort and position on their way.

Same rules as every formula module: plain Python over ``math``, no branches on a value. q position [m], v velocity
[m/s], a acceleration [m/s^2], t time [s], h time step [s], s state before or after the step, p parameters in the order
of the catalogue. ``*_next`` advances the state by one step, backwards in time like the friction models; the output
is taken from the new state.
"""

import math

SOFT_SHARE = 0.05  # of a dead zone's width: needed forces below it get only a part of the width, instead of a jump

# Forces that the actuator has to supply, next to the friction: m a = u - friction - force.


def cogging(q, p):
    """Force periodic in position, equal both ways [N]; p: amplitude, pitch, phase, second_amplitude, second_phase."""
    angle = 2.0 * math.pi * q / p[1]
    return p[0] * math.sin(angle + p[2]) + p[3] * math.sin(2.0 * angle + p[4])


def spring(q, p):
    """Linear restoring force [N], for instance of a cable chain; p: stiffness, rest_position."""
    return p[0] * (q - p[1])


def offset(p):
    """Constant force [N]: tilt or amplifier bias; p: force."""
    return p[0]


def gravity(q, p):
    """Weight of a mass that turns with the joint, or lies on a slope (ratio 0) [N]; p: amplitude, angle, ratio."""
    return p[0] * math.sin(p[2] * q + p[1])


def asymmetric_viscous(v, p):
    """Part of the viscous friction that is even in velocity [N]; p: coefficient."""
    return p[0] * math.fabs(v)


def nonlinear_viscous(v, p):
    """Power law of the speed, below 1 for shear-thinning [N]; p: force, exponent, reference_velocity."""
    ratio = v / p[2]
    return p[0] * ratio * (ratio * ratio + 1.0e-8) ** (0.5 * (p[1] - 1.0))


def quadratic_drag(v, p):
    """Drag with the square of the speed [N]; p: coefficient."""
    return p[0] * v * math.fabs(v)


def eddy_current(v, p):
    """Eddy-current brake: rises to peak_force at peak_velocity, then falls [N]; p: peak_force, peak_velocity, breadth.

    Kloss's formula with its resistance term: at breadth 0 the brake without it, above 0 a broader peak.
    """
    ratio = v / p[1]
    return p[0] * (2.0 + p[2]) * ratio / (1.0 + p[2] * math.fabs(ratio) + ratio * ratio)


def periodic_disturbance(t, p):
    """Force of fixed frequency in time [N]; p: amplitude, frequency, phase."""
    return p[0] * math.sin(2.0 * math.pi * p[1] * t + p[2])


def cross_axis_coupling(v2, a2, p):
    """Reaction of another axis's motion [N]; p: inertia, viscous."""
    return p[0] * a2 + p[1] * v2


def mass_error(a, p):
    """Force on a mass the model does not have [N]; p: mass."""
    return p[0] * a


def presliding(s, p):
    """Force of slip elements the model lacks [N]; p: force, distance. State: force over limit, -1..1, of each."""
    return 0.5 * p[0] * (s[0] + s[1])


def presliding_next(v, h, s, p):
    """Advance two missing elements that slip at half and at one and a half times the distance; p: force, distance.

    They keep the force of a large motion through any number of small ones (nonlocal memory), as a real contact does.
    """
    early = s[0] + 2.0 * v * h / p[1]
    late = s[1] + 2.0 / 3.0 * v * h / p[1]
    return (
        0.5 * (math.fabs(early + 1.0) - math.fabs(early - 1.0)),
        0.5 * (math.fabs(late + 1.0) - math.fabs(late - 1.0)),
    )


def backlash(level, s, p):
    """Friction of a load behind play [N]: gone soon after a reversal, back at the other wall; p: gap, share, stop.

    State: stretch between both sides over its largest, -1..1. The wall gives by ``stop`` until the load slides. The
    load has ``share`` of all friction: ``level`` is the motor side's rest.
    """
    free = p[0] / (p[0] + 2.0 * p[2])
    pressed = (math.fabs(s[0] - free) - math.fabs(s[0] + free) + 2.0 * s[0]) / (2.0 - 2.0 * free)
    return p[1] / (1.0 - p[1]) * level * pressed


def backlash_next(v, h, s, p):
    """Move within the play and the walls' give, beyond which they carry the load along; p: gap, share, stop."""
    moved = s[0] + 2.0 * v * h / (p[0] + 2.0 * p[2])
    return (0.5 * (math.fabs(moved + 1.0) - math.fabs(moved - 1.0)),)


def flexible_mode(s, p):
    """Reaction of an attached mass on a spring, without its part -mass * a [N].

    p: mass, frequency, damping_ratio. State: its deflection [m] and rate [m/s] against the carriage. The whole
    reaction is mass * (d2 deflection); the part -mass * a is carried as added mass -mass, so that a stage model can
    be solved for its acceleration.
    """
    omega = 2.0 * math.pi * p[1]
    return -p[0] * (2.0 * p[2] * omega * s[1] + omega * omega * s[0])


def flexible_mode_next(a, h, s, p):
    """Advance the attached mass by an exact step for constant acceleration a; p: mass, frequency, damping_ratio < 1."""
    omega = 2.0 * math.pi * p[1]
    decay_rate = p[2] * omega
    damped = omega * math.sqrt(1.0 - p[2] * p[2])
    keep = math.exp(-decay_rate * h)
    cosine = math.cos(damped * h)
    sine = math.sin(damped * h) / damped
    steady = -a / (omega * omega)
    away = s[0] - steady
    deflection = steady + keep * (away * (cosine + decay_rate * sine) + s[1] * sine)
    rate = keep * (s[1] * (cosine - decay_rate * sine) - away * omega * omega * sine)
    return (deflection, rate)


# Factors on the Stribeck level s(v): each multiplies what every element carries when sliding. ``level`` is the model's
# own s(v) [N] before any factor.


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
    """Static friction that rises with the logarithm of rest [-]; p: share, dwell_time, memory_distance.

    State: ln(1 + age / dwell_time). The divisor is its value after 1 s at rest.
    """
    return 1.0 + p[0] * s[0] / math.log1p(1.0 / p[1])


def dwell_breakaway_next(v, h, s, p):
    """Age the contact at rest, renew it in motion; p: share, dwell_time, memory_distance, rest_velocity."""
    stillness = math.exp(-(v / p[3]) * (v / p[3]))
    aged = s[0] + math.log1p(stillness * h / p[1] * math.exp(-s[0]))
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


# On the way of the effort to the mass [N], and of the position to the measurement [m]. Clamps are written with ``fabs``
# so that they carry no branch. Each effect on the effort has its inverse beside it: the command that brings a needed
# force to the mass. A diagnosis predicts with it the effort that was commanded, a feedforward commands it.


def actuator_gain(u, p):
    """Effort that arrives when the actuator's constant is off [N]; p: gain."""
    return p[0] * u


def actuator_gain_command(force, p):
    """Command that lets ``force`` arrive when the actuator's constant is off [N]; p: gain."""
    return force / p[0]


def actuator_saturation(u, p):
    """Effort that arrives when the actuator saturates [N]; p: limit."""
    return 0.5 * (math.fabs(u + p[0]) - math.fabs(u - p[0]))


def actuator_saturation_command(force, p):
    """Command that lets ``force`` arrive, or as much of it as the actuator can give [N]; p: limit."""
    return 0.5 * (math.fabs(force + p[0]) - math.fabs(force - p[0]))


def actuator_dead_zone(u, p):
    """Effort that arrives when small efforts are lost [N]; p: width."""
    return u - 0.5 * (math.fabs(u + p[0]) - math.fabs(u - p[0]))


def actuator_dead_zone_command(force, p):
    """Command that lets ``force`` arrive when small efforts are lost [N]; p: width.

    Any command within the width lets no force arrive; of those the middle, 0, is returned. Around it the width comes in
    smoothly, over ``SOFT_SHARE`` of itself.
    """
    soft = SOFT_SHARE * p[0] + 1.0e-12
    return force + p[0] * force / math.sqrt(force * force + soft * soft)


def actuator_delay(newer, older, fraction):
    """Effort that arrives when ``fraction`` of a sample lies between the two stored efforts [N]."""
    return newer + fraction * (older - newer)


def encoder_interpolation_error(q, p):
    """Measured position when sine and cosine of the encoder are not perfect [m]; p: amplitude, pitch, phase."""
    return q + p[0] * math.sin(2.0 * math.pi * q / p[1] + p[2])


def encoder_interpolation_correction(q, p):
    """True position from the measured one, to second order in amplitude / pitch [m]; p: amplitude, pitch, phase."""
    rate = 2.0 * math.pi / p[1]
    first = q - p[0] * math.sin(rate * q + p[2])
    return q - p[0] * math.sin(rate * first + p[2])


def quantisation(q, p):
    """Measured position on a grid [m]; p: resolution."""
    return math.floor(q / p[0] + 0.5) * p[0]
