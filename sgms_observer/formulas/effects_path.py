"""Effects on the way of the effort to the mass [N], and of the position to the measurement [m].

Rules as in ``effects_force``. Clamps are written with ``fabs`` so that they carry no branch. Each effect on the effort
has its inverse beside it: the command that brings a needed force to the mass. A diagnosis predicts with it the effort
that was commanded, a feedforward commands it.
"""

import math

SOFT_SHARE = 0.05  # of a dead zone's width: needed forces below it get only a part of the width, instead of a jump


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
