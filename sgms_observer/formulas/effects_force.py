"""Effects that add a force the actuator has to supply, next to the friction: m a = u - friction - force.

Same rules as every formula module: plain Python over ``math``, no branches on a value. q position [m], v velocity
[m/s], a acceleration [m/s^2], t time [s], h time step [s], s state before or after the step, p parameters in the order
of the catalogue. ``*_next`` advances the state by one step, backwards in time like the friction models; the output
is taken from the new state.
"""

import math


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
