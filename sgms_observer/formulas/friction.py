"""GMS and S-GMS friction, eqs 1-8 of Boegli et al., in element force f = kappa z and in displacement.

An element's ratio r = z / z_s is taken along the direction of motion, so u = r sgn(v): +1 is steady sliding,
negative is just after a reversal. All forces [N], velocities [m/s], stiffness [N/m], damping [N s/m].
"""

import math


def stribeck_level(velocity, static_force, coulomb_force, stribeck_velocity):
    """Steady-state friction s(v) without the viscous term [N]; below eq. 2, even in velocity."""
    ratio = velocity / stribeck_velocity
    return coulomb_force + (static_force - coulomb_force) * math.exp(-ratio * ratio)


def transition_a(u, smoothing_lambda, smoothing_zeta):
    """Return eta_A of eq. 6: 0 while the element sticks, 1 where |u| exceeds zeta."""
    return (
        1.0
        - 0.5 * math.tanh(smoothing_lambda * (u + smoothing_zeta))
        + 0.5 * math.tanh(smoothing_lambda * (u - smoothing_zeta))
    )


def transition_b(u, reset_gain):
    """Return eta_B of eq. 7: 0 after a reversal, 1 in motion along the deflection."""
    return 0.5 + 0.5 * math.tanh(reset_gain * u)


def reset_gain_paper(speed, smoothing_gamma, stribeck_velocity):
    """Return the reset's gain as the paper has it (eq. 7): it vanishes at creep, see notes trap 2."""
    return smoothing_gamma * speed / stribeck_velocity


def reset_gain_rate_independent(speed, smoothing_gamma, stribeck_velocity):
    """Return the rate-independent reset's gain: as smooth, and right at every speed (notes trap 2)."""
    return smoothing_gamma


def slip_fraction(u, smoothing_lambda, smoothing_zeta, reset_gain):
    """Return eta = eta_A eta_B (eq. 5)."""
    return transition_a(u, smoothing_lambda, smoothing_zeta) * transition_b(u, reset_gain)


def sgms_residual(u_next, u, travel, smoothing_lambda, smoothing_zeta, reset_gain):
    """Backward-Euler residual of eq. 4 in displacement; zero at the next ratio.

    ``travel`` = kappa |v| h / (nu s): the step's displacement over the element's slip deflection.
    """
    eta = slip_fraction(u_next, smoothing_lambda, smoothing_zeta, reset_gain)
    return u_next - u - travel * (1.0 - eta * u_next)


def sgms_deflection_rate(velocity, u, smoothing_lambda, smoothing_zeta, reset_gain):
    """Deflection rate dz/dt of eq. 4 [m/s]."""
    return velocity * (1.0 - slip_fraction(u, smoothing_lambda, smoothing_zeta, reset_gain) * u)


def friction_output(element_forces, deflection_rates, element_damping, viscous_coefficient, velocity):
    """Friction force of eq. 3 [N]: element forces, element damping and the viscous term."""
    total = viscous_coefficient * velocity
    for i in range(len(element_damping)):
        total = total + element_forces[i] + element_damping[i] * deflection_rates[i]
    return total
