"""The S-GMS model as CasADi expressions, from the same formulas as the kernels; derivatives by CasADi."""

from __future__ import annotations

from functools import cache

import casadi

from sgms_observer.formulas import symbolic

_SGMS_INPUTS = ("force", "velocity", "period", "stiffness", "level", "smoothing_lambda", "smoothing_zeta", "reset_gain")


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


@cache
def element_step() -> tuple[casadi.Function, casadi.Function]:
    """Return the residual of an element's step and the step's exact derivatives.

    Returns:
        ``residual(force_next, inputs)`` and ``slopes(force_next, inputs)``, the latter the derivatives of the force
        after the step with respect to all inputs by the implicit function theorem; inputs are force, velocity, period,
        stiffness, level, smoothing_lambda, smoothing_zeta, reset_gain.
    """
    force_next = casadi.SX.sym("force_next")
    inputs = casadi.SX.sym("inputs", len(_SGMS_INPUTS))
    residual = element_residual(force_next, *casadi.vertsplit(inputs))
    slopes = -casadi.jacobian(residual, inputs) / casadi.jacobian(residual, force_next)
    return (
        casadi.Function("residual", [force_next, inputs], [residual]),
        casadi.Function("slopes", [force_next, inputs], [slopes]),
    )


@cache
def element_rate() -> casadi.Function:
    """Return ``(force, velocity, level, lambda, zeta, gain) -> deflection rate [m/s] and its gradient`` (eq. 4)."""
    names = ("force", "velocity", "level", "smoothing_lambda", "smoothing_zeta", "reset_gain")
    inputs = casadi.SX.sym("inputs", len(names))
    force, velocity, level, lam, zeta, gain = casadi.vertsplit(inputs)
    u = casadi.sign(velocity) * force / level
    rate = symbolic("friction").sgms_deflection_rate(velocity, u, lam, zeta, gain)
    return casadi.Function("rate", [inputs], [rate, casadi.jacobian(rate, inputs)])
