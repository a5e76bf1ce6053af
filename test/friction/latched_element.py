"""One step of an element that slips with memory, as GMS does, but smoothly: closed form, exact derivatives.

GMS (eqs 1-2) remembers that it slips until the velocity reverses, and while it slips its force relaxes to the Stribeck
curve at the rate C; S-GMS (eqs 4-7) has neither. Here the mode is a number m between 0 (sticks) and 1 (slips) that is
latched smoothly and reset smoothly, and the force is a smooth blend of the two closed solutions. With
u = f sgn(v) / (nu s):

    m_r   = m (1 + tanh(gamma u)) / 2                       reset at a reversal (eq. 7, at every speed)
    w     = 1 + (u - 1) exp(-C h / s)                       slipping, eq. 2 over the step
    x     = u + kappa |v| h / (nu s)                        sticking, eq. 1 over the step
    x_c   = softmin(x, softmax(1, w))                       sticking ends at the Stribeck curve
    u'    = (1 - m_r) x_c + m_r w
    m'    = m_r + (1 - m_r) (1 + tanh(lambda (x - 1))) / 2   latch

with soft minima of sharpness lambda. As lambda and gamma grow this is the GMS step; the force is off by at most
2 ln(2) / lambda of the sliding force, at the moment of breaking away. Infinitely differentiable in force, mode and
parameters; the velocity is an input and enters by its sign, as in eq. 4.
"""

from __future__ import annotations

import math

from sgms_observer.jit import njit_bare

_SATURATED = 36.0  # exp(-36) is below the rounding error of 1


@njit_bare
def _softplus(x: float) -> tuple[float, float]:
    """Return log(1 + e^x) and its derivative."""
    if x > _SATURATED:
        return x, 1.0
    if x < -_SATURATED:
        return 0.0, 0.0
    e = math.exp(x)
    return math.log1p(e), e / (1.0 + e)


@njit_bare
def latched_step_with_slopes(
    force: float,
    slip: float,
    velocity: float,
    period: float,
    stiffness: float,
    fraction: float,
    stribeck: float,
    rate: float,
    lam: float,
    gamma: float,
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Advance one element's force and mode by one step of constant velocity.

    Args:
        force: element force kappa z before the step [N].
        slip: mode m before the step, 0 sticks, 1 slips [-].
        velocity: velocity over the step [m/s].
        period: step h [s].
        stiffness: kappa [N/m].
        fraction: nu [-].
        stribeck: s(v) [N].
        rate: attraction parameter C [N/s].
        lam: sharpness of latch and soft minima [-].
        gamma: slope of the reset [-].

    Returns:
        force after the step [N], mode after the step [-]; derivatives of the force with respect to the force before
        [-], the mode before [N], the stiffness [m] and s [-]; derivatives of the mode with respect to the same.
    """
    if velocity == 0.0:
        return force, slip, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0
    direction = 1.0 if velocity > 0.0 else -1.0
    distance = abs(velocity) * period
    level = fraction * stribeck
    u = direction * force / level
    travel = stiffness * distance / level
    decay = math.exp(-rate * period / stribeck)

    t_reset = math.tanh(gamma * u)
    keep = 0.5 + 0.5 * t_reset
    keep_u = 0.5 * gamma * (1.0 - t_reset * t_reset)
    slipping = slip * keep
    slipping_u = slip * keep_u
    w = 1.0 + (u - 1.0) * decay
    plus_w, s_w = _softplus(lam * (w - 1.0))
    cap = 1.0 + plus_w / lam
    x = u + travel
    plus_x, s_x = _softplus(lam * (x - cap))
    stuck = x - plus_x / lam
    stuck_u = 1.0 - s_x + s_x * s_w * decay
    stuck_decay = s_x * s_w * (u - 1.0)
    t_latch = math.tanh(lam * (x - 1.0))
    latch = 0.5 + 0.5 * t_latch
    latch_x = 0.5 * lam * (1.0 - t_latch * t_latch)

    after = stuck + slipping * (w - stuck)
    after_u = stuck_u * (1.0 - slipping) + slipping * decay + slipping_u * (w - stuck)
    after_travel = (1.0 - s_x) * (1.0 - slipping)
    after_decay = stuck_decay * (1.0 - slipping) + slipping * (u - 1.0)
    after_slip = keep * (w - stuck)
    mode = slipping + (1.0 - slipping) * latch
    mode_u = slipping_u * (1.0 - latch) + (1.0 - slipping) * latch_x
    mode_travel = (1.0 - slipping) * latch_x

    decay_s = decay * rate * period / (stribeck * stribeck)
    after_s = (-after_u * u - after_travel * travel) / stribeck + after_decay * decay_s
    return (
        direction * level * after,
        mode,
        after_u,
        direction * level * after_slip,
        direction * after_travel * distance,
        direction * (fraction * after + level * after_s),
        mode_u * direction / level,
        keep * (1.0 - latch),
        mode_travel * distance / level,
        (-mode_u * u - mode_travel * travel) / stribeck,
    )
