"""Step and rate of one S-GMS element as CasADi functions with exact derivatives, to test the kernels against."""

from __future__ import annotations

from functools import cache

import casadi

from sgms_observer.formulas import symbolic
from sgms_observer.friction.symbolic import element_residual

_INPUTS = ("force", "velocity", "period", "stiffness", "level", "smoothing_lambda", "smoothing_zeta", "reset_gain")


@cache
def element_step() -> tuple[casadi.Function, casadi.Function]:
    """Return the residual of an element's step and the step's exact derivatives.

    Returns:
        ``residual(force_next, inputs)`` and ``slopes(force_next, inputs)``, the latter the derivatives of the force
        after the step with respect to all inputs by the implicit function theorem; inputs are force, velocity, period,
        stiffness, level, smoothing_lambda, smoothing_zeta, reset_gain.
    """
    force_next = casadi.SX.sym("force_next")
    inputs = casadi.SX.sym("inputs", len(_INPUTS))
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
