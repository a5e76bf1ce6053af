"""One step of an S-GMS element: backward Euler in displacement, unconditionally stable, with exact derivatives.

The formulas are those of ``sgms_observer.formulas.friction``; here they are arranged for speed (saturated
hyperbolic tangents are skipped, sticking and sliding steps are closed forms). A test holds the two together.
"""

from __future__ import annotations

import math

from sgms_observer.jit import njit_bare

_SATURATED = 19.0  # 1 - tanh(19) is below the rounding error of 1
_TOLERANCE = 1e-15
_MAX_ITERATIONS = 80


@njit_bare
def _tanh(x: float) -> float:
    """Hyperbolic tangent, right to the rounding error of 1; one that is exact near 0 too takes four times as long."""
    return 1.0 - 2.0 / (math.exp(2.0 * x) + 1.0)


@njit_bare
def _slip_fraction_with_slope(u: float, lam: float, zeta: float, gain: float) -> tuple[float, float, float]:
    """Return the slip fraction eta of eq. 5 at u = z / z_s along the motion, d eta / du and d eta / d gain."""
    magnitude = abs(u)
    inner = lam * (magnitude - zeta)
    outer = lam * (magnitude + zeta)
    if inner < -_SATURATED and outer > _SATURATED:
        return 0.0, 0.0, 0.0
    t_in = 1.0 if inner > _SATURATED else _tanh(inner)
    t_out = 1.0 if outer > _SATURATED else _tanh(outer)
    eta_a = 1.0 - 0.5 * t_out + 0.5 * t_in
    slope_a = 0.5 * lam * (t_out * t_out - t_in * t_in)
    if u < 0.0:
        slope_a = -slope_a
    argument = gain * u
    if argument > _SATURATED:
        return eta_a, slope_a, 0.0
    if argument < -_SATURATED:
        return 0.0, 0.0, 0.0
    t_b = _tanh(argument)
    eta_b = 0.5 + 0.5 * t_b
    slope_b = 0.5 * (1.0 - t_b * t_b)
    return eta_a * eta_b, slope_a * eta_b + eta_a * slope_b * gain, eta_a * slope_b * u


@njit_bare
def _solve_ratio(u0: float, travel: float, lam: float, zeta: float, gain: float) -> float:
    """Solve u1 = u0 + a (1 - eta(u1) u1) of eq. 4 by bracketed Newton iterations; arguments as of ``sgms_ratio``.

    Next to the reversal of a sliding element, Newton iterations may go to and fro between two points inside the
    bracket. A step that does not halve the one before the last is therefore replaced by a bisection.

    Source: Brent 1973, Algorithms for Minimization without Derivatives, ch. 4.
    """
    stick = u0 + travel
    slip = stick / (1.0 + travel)
    low = min(stick, slip)
    high = max(stick, slip)
    u = min(max(zeta, low), high)
    before_last = 2.0 * (high - low)
    last = before_last
    for _ in range(_MAX_ITERATIONS):
        eta, slope, _gain_slope = _slip_fraction_with_slope(u, lam, zeta, gain)
        residual = u - stick + travel * eta * u
        derivative = 1.0 + travel * (eta + u * slope)
        if residual > 0.0:
            high = u
        else:
            low = u
        candidate = u - residual / derivative if derivative > 0.0 else low - 1.0
        is_newton = low <= candidate <= high and 2.0 * abs(candidate - u) <= before_last
        if not is_newton:
            candidate = 0.5 * (low + high)
        change = candidate - u
        u = candidate
        before_last = last
        last = abs(change)
        # the residual bends by less than 2 (lam + gain) times its slope, so this bounds the error that is left
        if (is_newton and (lam + gain) * change * change <= _TOLERANCE) or abs(change) <= _TOLERANCE:
            break
    return u


@njit_bare
def sgms_ratio(u0: float, travel: float, lam: float, zeta: float, gain: float) -> tuple[float, float, float, float]:
    """Solve a step and evaluate it there.

    Args:
        u0: ratio before the step, along the direction of motion [-].
        travel: a = kappa |v| h / (nu s), the step over the slip deflection [-], >= 0.
        lam: smoothing lambda of eq. 6 [-].
        zeta: smoothing zeta of eq. 6 [-].
        gain: reset gain, gamma |v| / v_s or gamma (eq. 7, notes trap 2) [-].

    Returns:
        u1, eta(u1), dG/du1 of the residual G (its slope, > 0), dG/d gain.
    """
    u = _solve_ratio(u0, travel, lam, zeta, gain)
    eta, slope, gain_slope = _slip_fraction_with_slope(u, lam, zeta, gain)
    return u, eta, 1.0 + travel * (eta + u * slope), travel * u * gain_slope


@njit_bare
def sgms_step_with_slopes(
    force: float, velocity: float, period: float, stiffness: float, level: float, lam: float, zeta: float, gain: float
) -> tuple[float, float, float, float, float]:
    """Advance one element's force by one step, with the step's exact derivatives (implicit function theorem).

    Args:
        force: element force kappa z before the step [N].
        velocity: velocity over the step [m/s].
        period: step h [s].
        stiffness: kappa [N/m].
        level: nu s(v), the element's sliding force [N].
        lam: smoothing lambda [-].
        zeta: smoothing zeta [-].
        gain: reset gain [-].

    Returns:
        force after the step [N]; its derivatives with respect to the force before [-], the stiffness [m],
        the level [-] and the reset gain [N].

    Source: Boegli et al., eq. 4, backward Euler in displacement.
    """
    distance = velocity * period
    stuck = force + stiffness * distance
    if lam * abs(stuck) < (lam * zeta - _SATURATED) * level:
        return stuck, 1.0, distance, 0.0, 0.0
    direction = math.copysign(1.0, velocity)
    denominator = level + stiffness * abs(distance)
    push = direction * stuck
    if (
        lam * push > (lam * zeta + _SATURATED) * denominator and gain * push > _SATURATED * denominator
    ):  # u = push / denominator
        inverse = 1.0 / denominator
        return (
            level * stuck * inverse,
            level * inverse,
            distance * (level - direction * force) * inverse * inverse * level,
            stuck * inverse * (stiffness * abs(distance)) * inverse,
            0.0,
        )
    share = direction / level
    travel = stiffness * distance * share
    u, eta, slope, gain_slope = sgms_ratio(force * share, travel, lam, zeta, gain)
    inverse = 1.0 / slope
    return (
        direction * level * u,
        inverse,
        distance * (1.0 - eta * u) * inverse,
        direction * u * (1.0 - inverse),
        -direction * level * gain_slope * inverse,
    )


@njit_bare
def sgms_step(
    force: float, velocity: float, period: float, stiffness: float, level: float, lam: float, zeta: float, gain: float
) -> float:
    """Advance one element's force by one step, without derivatives.

    Args: as ``sgms_step_with_slopes``.

    Returns:
        Element force after the step [N].
    """
    distance = velocity * period
    stuck = force + stiffness * distance
    if lam * abs(stuck) < (lam * zeta - _SATURATED) * level:
        return stuck
    direction = math.copysign(1.0, velocity)
    denominator = level + stiffness * abs(distance)
    push = direction * stuck
    if lam * push > (lam * zeta + _SATURATED) * denominator and gain * push > _SATURATED * denominator:
        return level * stuck * (1.0 / denominator)
    share = direction / level
    return direction * level * _solve_ratio(force * share, stiffness * distance * share, lam, zeta, gain)


@njit_bare
def sgms_rate(
    force: float, velocity: float, level: float, lam: float, zeta: float, gain: float
) -> tuple[float, float, float, float]:
    """Deflection rate dz/dt of eq. 4 with its derivatives.

    Args: as ``sgms_step``.

    Returns:
        dz/dt [m/s]; its derivatives with respect to the force [m/(s N)], the level [m/(s N)] and the gain [m/s].
    """
    direction = math.copysign(1.0, velocity)
    u = direction * force / level
    eta, slope, gain_slope = _slip_fraction_with_slope(u, lam, zeta, gain)
    product_slope = eta + u * slope
    return (
        velocity * (1.0 - eta * u),
        -velocity * product_slope * direction / level,
        velocity * product_slope * u / level,
        -velocity * u * gain_slope,
    )
