"""The step of an S-GMS element as a CasADi expression, from the same formulas as the kernels."""

from __future__ import annotations

import casadi

from sgms_observer.formulas import symbolic


def element_residual(force_next: casadi.SX, force: casadi.SX, velocity: casadi.SX, period: casadi.SX,
                     stiffness: casadi.SX, level: casadi.SX, smoothing_lambda: casadi.SX, smoothing_zeta: casadi.SX,
                     reset_gain: casadi.SX) -> casadi.SX:  # fmt: skip
    """Residual of one S-GMS element's step, zero at the element force after it (eq. 4, backward Euler).

    Args:
        force_next: element force after the step [N].
        force: element force before the step [N].
        velocity: velocity over the step [m/s].
        period: step [s].
        stiffness: kappa [N/m].
        level: nu s(v) [N].
        smoothing_lambda: eq. 6 [-].
        smoothing_zeta: eq. 6 [-].
        reset_gain: gain of eq. 7 [-].

    Returns:
        Residual as a share of the level [-].
    """
    formulas = symbolic("friction")
    direction = casadi.sign(velocity)
    travel = stiffness * casadi.fabs(velocity) * period / level
    residual: casadi.SX = formulas.sgms_residual(
        direction * force_next / level, direction * force / level, travel, smoothing_lambda, smoothing_zeta, reset_gain
    )
    return residual
