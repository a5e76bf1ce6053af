"""One correction interval: m steps of the friction model, its linearisation, and the measurement at its end."""

from __future__ import annotations

import math
from collections.abc import Callable

from sgms_observer.arrays import Floats, Ints
from sgms_observer.estimators.layout import (
    ATTRACTION,
    COULOMB,
    GAMMA,
    GMS,
    KAPPA,
    LAMBDA,
    MASS,
    MODEL,
    NU,
    OFFSET,
    P_COULOMB,
    P_KAPPA,
    P_MASS,
    P_OFFSET,
    P_STATIC,
    P_STRIBECK,
    P_VISCOUS,
    PAPER_RESET,
    RESET,
    SIGMA,
    STATIC,
    STRIBECK,
    VISCOUS,
    ZETA,
)
from sgms_observer.formulas import friction as formulas
from sgms_observer.friction.gms import gms_rate, gms_step, gms_step_in_branch, gms_step_with_slopes
from sgms_observer.friction.sgms import sgms_rate, sgms_step, sgms_step_with_slopes
from sgms_observer.jit import njit_bare

stribeck_level: Callable[..., float] = njit_bare(formulas.stribeck_level)


@njit_bare
def reset_gain(scalars: Floats, velocity: float) -> float:
    """Return the gain of the reset eta_B at this velocity (eq. 7 and notes trap 2)."""
    if scalars[RESET] == PAPER_RESET:
        return float(scalars[GAMMA] * abs(velocity) / scalars[STRIBECK])
    return float(scalars[GAMMA])


@njit_bare
def level_at(scalars: Floats, velocity: float, factor: float) -> float:
    """Return the Stribeck curve s(v) [N] times the effects' factor on it."""
    return factor * stribeck_level(velocity, scalars[STATIC], scalars[COULOMB], scalars[STRIBECK])


@njit_bare
def simulate_interval(scalars: Floats, elements: Floats, kinds: Floats, p: Floats,
                      velocity: Floats, period: Floats, factor: Floats, branches: Floats, is_held: bool,
                      force_in: Floats, memory_in: Floats,
                      force_out: Floats, memory_out: Floats, a: Floats, b: Floats) -> None:  # fmt: skip
    """Advance all elements through one interval and linearise it exactly.

    Args:
        scalars: model with p applied (layout.py).
        elements: rows kappa, nu, sigma.
        kinds: P_* code of each entry of p.
        p: estimated parameters as shares of their nominal value (the derivatives are taken with respect to them).
        velocity: velocity of each step [m/s].
        period: length of each step [s].
        factor: effects' factor on the Stribeck level at each step [-].
        branches: branch of each step and element of a GMS model, shape (m, n_z).
        is_held: take those branches rather than the ones that the forces lead to.
        force_in: element forces at the start [N], shape (n_z,).
        memory_in: GMS slip modes at the start, shape (n_z,).
        force_out: element forces at the end, written.
        memory_out: modes at the end, written.
        a: d force_out / d force_in (diagonal), shape (n_z,), written.
        b: d force_out / d p, shape (n_z, n_p), written.
    """
    n_z = elements.shape[1]
    is_gms = scalars[MODEL] == GMS
    needs_level = False
    kappa_scale = 0.0
    for j in range(kinds.shape[0]):
        if kinds[j] == P_KAPPA:
            kappa_scale = 1.0
        elif kinds[j] == P_COULOMB or kinds[j] == P_STATIC or kinds[j] == P_STRIBECK:
            needs_level = True
    lam, zeta, rate = scalars[LAMBDA], scalars[ZETA], scalars[ATTRACTION]
    f_c, f_s, v_s = scalars[COULOMB], scalars[STATIC], scalars[STRIBECK]
    for i in range(n_z):
        force_out[i] = force_in[i]
        memory_out[i] = memory_in[i]
        a[i] = 1.0
        for j in range(kinds.shape[0]):
            b[i, j] = 0.0
    for k in range(velocity.shape[0]):
        v, h = velocity[k], period[k]
        gaussian = math.exp(-(v / v_s) * (v / v_s))
        level = factor[k] * (f_c + (f_s - f_c) * gaussian)
        gain = reset_gain(scalars, v)
        for i in range(n_z):
            kappa, nu = elements[KAPPA, i], elements[NU, i]
            if is_gms:
                if is_held:
                    after, mode, by_force, by_kappa, by_level = gms_step_in_branch(
                        force_out[i], int(branches[k, i]), v, h, kappa, nu, level, rate
                    )
                else:
                    after, mode, by_force, by_kappa, by_level = gms_step_with_slopes(
                        force_out[i], int(memory_out[i]), v, h, kappa, nu, level, rate
                    )
                memory_out[i] = mode
                by_gain = 0.0
            else:
                after, by_force, by_kappa, by_level, by_gain = sgms_step_with_slopes(
                    force_out[i], v, h, kappa, nu * level, lam, zeta, gain
                )
                by_level *= nu
            force_out[i] = after
            a[i] *= by_force
            if kappa_scale > 0.0 or needs_level:
                for j in range(kinds.shape[0]):
                    kind = kinds[j]
                    slope = 0.0
                    if kind == P_KAPPA:
                        slope = by_kappa * kappa
                    elif kind == P_COULOMB:
                        slope = by_level * factor[k] * (1.0 - gaussian) * f_c
                    elif kind == P_STATIC:
                        slope = by_level * factor[k] * gaussian * f_s
                    elif kind == P_STRIBECK:
                        slope = by_level * factor[k] * (f_s - f_c) * gaussian * 2.0 * (v / v_s) * (v / v_s)
                        if scalars[RESET] == PAPER_RESET:
                            slope -= by_gain * gain
                    b[i, j] = by_force * b[i, j] + slope
    for j in range(kinds.shape[0]):
        if kinds[j] != P_OFFSET:
            for i in range(n_z):
                b[i, j] /= p[j]  # from d/d log(parameter)


@njit_bare
def advance_forces(scalars: Floats, elements: Floats, force: Floats, memory: Floats,
                   velocity: float, period: float, factor: float) -> None:  # fmt: skip
    """Advance all element forces by one step in place, without derivatives.

    Args:
        scalars: model with p applied (layout.py).
        elements: rows kappa, nu, sigma.
        force: element forces [N], shape (n_z,); overwritten.
        memory: GMS slip modes, shape (n_z,); overwritten.
        velocity: velocity over the step [m/s].
        period: length of the step [s].
        factor: effects' factor on the Stribeck level [-].
    """
    level, gain = level_at(scalars, velocity, factor), reset_gain(scalars, velocity)
    advance_at_level(scalars, elements, force, memory, velocity, period, level, gain)


@njit_bare
def advance_at_level(scalars: Floats, elements: Floats, force: Floats, memory: Floats | Ints,
                     velocity: float, period: float, level: float, gain: float) -> None:  # fmt: skip
    """Advance all element forces by one step in place where level and gain are known already.

    Args:
        scalars: model with p applied (layout.py).
        elements: rows kappa, nu, sigma.
        force: element forces [N], shape (n_z,); overwritten.
        memory: GMS slip modes, shape (n_z,); overwritten.
        velocity: velocity over the step [m/s].
        period: length of the step [s].
        level: Stribeck level times the effects' factor [N].
        gain: gain of the reset eta_B [-].
    """
    for i in range(force.shape[0]):
        kappa, nu = elements[KAPPA, i], elements[NU, i]
        if scalars[MODEL] == GMS:
            force[i], memory[i] = gms_step(
                force[i], int(memory[i]), velocity, period, kappa, nu, level, scalars[ATTRACTION]
            )
        else:
            force[i] = sgms_step(force[i], velocity, period, kappa, nu * level, scalars[LAMBDA], scalars[ZETA], gain)


@njit_bare
def predict_effort(scalars: Floats, elements: Floats, force: Floats, memory: Floats,
                   velocity: float, acceleration: float, factor: float) -> float:  # fmt: skip
    """Effort that the model expects: eq. 3 plus inertia and offset [N].

    Args:
        scalars: model with p applied.
        elements: rows kappa, nu, sigma.
        force: element forces [N].
        memory: GMS slip modes.
        velocity: velocity [m/s].
        acceleration: acceleration [m/s^2].
        factor: effects' factor on the Stribeck level.
    """
    others = float(scalars[MASS] * acceleration + scalars[OFFSET])
    return friction_force(scalars, elements, force, memory, velocity, factor) + others


@njit_bare
def friction_force(scalars: Floats, elements: Floats, force: Floats, memory: Floats,
                   velocity: float, factor: float) -> float:  # fmt: skip
    """Friction force of eq. 3 [N]; arguments as ``predict_effort``."""
    total = scalars[VISCOUS] * velocity
    level = level_at(scalars, velocity, factor)
    gain = reset_gain(scalars, velocity)
    for i in range(force.shape[0]):
        total += force[i]
        sigma = elements[SIGMA, i]
        if sigma > 0.0:
            kappa, nu = elements[KAPPA, i], elements[NU, i]
            if scalars[MODEL] == GMS:
                rate = gms_rate(force[i], int(memory[i]), velocity, kappa, nu, level, scalars[ATTRACTION])[0]
            else:
                rate = sgms_rate(force[i], velocity, nu * level, scalars[LAMBDA], scalars[ZETA], gain)[0]
            total += sigma * rate
    return float(total)


@njit_bare
def effort_slopes(scalars: Floats, elements: Floats, kinds: Floats, scale: Floats, p: Floats, force: Floats,
                  memory: Floats, velocity: float, acceleration: float, factor: float,
                  row: Floats) -> None:  # fmt: skip
    """Derivatives of ``predict_effort`` with respect to the element forces and p.

    Args:
        scalars: model with p applied.
        elements: rows kappa, nu, sigma.
        kinds: P_* code of each entry of p.
        scale: SI value of one unit of each entry of p.
        p: estimated parameters in those units.
        force: element forces [N].
        memory: GMS slip modes.
        velocity: velocity [m/s].
        acceleration: acceleration [m/s^2].
        factor: effects' factor on the Stribeck level.
        row: H, shape (n_z + n_p,), written.
    """
    n_z = force.shape[0]
    f_c, f_s, v_s = scalars[COULOMB], scalars[STATIC], scalars[STRIBECK]
    gaussian = math.exp(-(velocity / v_s) * (velocity / v_s))
    level = factor * (f_c + (f_s - f_c) * gaussian)
    gain = reset_gain(scalars, velocity)
    by_level, by_kappa, by_gain = 0.0, 0.0, 0.0
    for i in range(n_z):
        row[i] = 1.0
        sigma = elements[SIGMA, i]
        if sigma > 0.0:
            kappa, nu = elements[KAPPA, i], elements[NU, i]
            if scalars[MODEL] == GMS:
                rate, rate_by_force, rate_by_level = gms_rate(
                    force[i], int(memory[i]), velocity, kappa, nu, level, scalars[ATTRACTION]
                )
                if memory[i] * velocity > 0.0:
                    by_kappa -= sigma * rate
            else:
                rate, rate_by_force, rate_by_level, rate_by_gain = sgms_rate(
                    force[i], velocity, nu * level, scalars[LAMBDA], scalars[ZETA], gain
                )
                rate_by_level *= nu
                by_gain += sigma * rate_by_gain
            row[i] += sigma * rate_by_force
            by_level += sigma * rate_by_level
    for j in range(kinds.shape[0]):
        kind = kinds[j]
        slope = 0.0
        if kind == P_KAPPA:
            slope = by_kappa / p[j]
        elif kind == P_VISCOUS:
            slope = velocity * scale[j]
        elif kind == P_MASS:
            slope = acceleration * scale[j]
        elif kind == P_OFFSET:
            slope = scale[j]
        elif kind == P_COULOMB:
            slope = by_level * factor * (1.0 - gaussian) * scale[j]
        elif kind == P_STATIC:
            slope = by_level * factor * gaussian * scale[j]
        elif kind == P_STRIBECK:
            ratio = velocity / v_s
            slope = by_level * factor * (f_s - f_c) * gaussian * 2.0 * ratio * ratio / v_s * scale[j]
            if scalars[RESET] == PAPER_RESET:
                slope -= by_gain * gain / p[j]
        row[n_z + j] = slope
