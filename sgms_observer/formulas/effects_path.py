"""Effects on the way of the effort to the mass [N], and of the position to the measurement [m].

Rules as in ``effects_force``. Clamps are written with ``fabs`` so that they carry no branch.
"""

import math


def actuator_gain(u, p):
    """Effort that arrives when the actuator's constant is off [N]; p: gain."""
    return p[0] * u


def actuator_saturation(u, p):
    """Effort that arrives when the actuator saturates [N]; p: limit."""
    return 0.5 * (math.fabs(u + p[0]) - math.fabs(u - p[0]))


def actuator_dead_zone(u, p):
    """Effort that arrives when small efforts are lost [N]; p: width."""
    return u - 0.5 * (math.fabs(u + p[0]) - math.fabs(u - p[0]))


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
