"""The catalogue as one compiled switch, called sample by sample by stage, observer, replay and compensation.

Effects are numbered by ``KIND``; each has a slice of one flat parameter array and of one flat state array. ``user`` is
the compiled function of the user's own effects (see ``user_kernels``), called for numbers from ``FIRST_USER_KIND`` on.
"""

from __future__ import annotations

from typing import Any

from sgms_observer.effects.catalogue import BUILT_IN
from sgms_observer.effects.switch import (
    built_in_step,
    effort_effect,
    needed_effect,
    position_correction,
    position_effect,
)
from sgms_observer.formulas import effects
from sgms_observer.jit import njit

KIND = {entry.name: number for number, entry in enumerate(BUILT_IN)}
DELAY = next(KIND[entry.name] for entry in BUILT_IN if entry.is_delay)
FIRST_USER_KIND = 100
MINIMUM_LEVEL_FACTOR = 0.01

delayed: Any = njit(effects.actuator_delay)


@njit
def _user_effect_step(
    number: int, p: Any, s: Any, user: Any, q: float, v: float, a: float, t: float, u: float, h: float, level: float,
    v2: float, a2: float, out: Any,
) -> tuple[float, float]:  # fmt: skip
    """Advance user effect ``number``; return force [N] and level factor [-]; other arguments as in ``effects_step``."""
    out[2] = 0.0
    out[3] = 1.0
    if user is not None:
        inputs = out[4:13]
        inputs[0] = q
        inputs[1] = v
        inputs[2] = a
        inputs[3] = t
        inputs[4] = u
        inputs[5] = h
        inputs[6] = level
        inputs[7] = v2
        inputs[8] = a2
        user(number, inputs, s, p, out[2:4])
    return out[2], out[3]


@njit
def effects_step(
    kinds: Any, p_at: Any, s_at: Any, parameters: Any, state: Any, user: Any, q: float, v: float, a: float, t: float,
    u: float, h: float, level: float, v2: float, a2: float, out: Any,
) -> None:  # fmt: skip
    """Advance every effect by one step and write added force [N] and level factor [-] into ``out[0:2]``.

    Args:
        kinds: number of each effect, int64.
        p_at: first parameter of each effect in ``parameters``, and the end, int64.
        s_at: first state of each effect in ``state``, and the end, int64.
        parameters: flat parameter values.
        state: flat states; changed in place.
        user: compiled user effects, or None.
        q, v, a: position [m], velocity [m/s] and acceleration [m/s^2] at the end of the step.
        t: time since the first sample [s].
        u: effort [N].
        h: length of the step [s].
        level: the model's Stribeck level at ``v`` [N].
        v2, a2: velocity and acceleration of the other axis.
        out: at least 4 floats. The rest is scratch.

    The mass of PLANT effects is not in the force: see ``CompiledEffects.added_mass``.
    """
    force = 0.0
    factor = 1.0
    for i in range(kinds.shape[0]):
        kind = kinds[i]
        p = parameters[p_at[i] : p_at[i + 1]]
        s = state[s_at[i] : s_at[i + 1]]
        if kind < FIRST_USER_KIND:
            added, scale = built_in_step(kind, p, s, q, v, a, t, u, h, level, v2, a2)
        else:
            added, scale = _user_effect_step(kind - FIRST_USER_KIND, p, s, user, q, v, a, t, u, h, level, v2, a2, out)
        force += added
        factor *= scale
    out[0] = force
    out[1] = max(factor, MINIMUM_LEVEL_FACTOR)


@njit
def effort_step(kinds: Any, p_at: Any, s_at: Any, parameters: Any, state: Any, u: float) -> float:
    """Advance the effort's path by one sample and return the effort that arrives [N].

    Args:
        kinds, p_at, s_at, parameters, state: as in ``effects_step``.
        u: published effort [N].

    A delay keeps a ring of past efforts in its state: whole and broken part of the delay in samples, number of efforts
    seen, place of the latest, then the ring.
    """
    for i in range(kinds.shape[0]):
        kind = kinds[i]
        p = parameters[p_at[i] : p_at[i + 1]]
        if kind != DELAY:
            u = effort_effect(kind, p, u)
        else:
            s = state[s_at[i] : s_at[i + 1]]
            ring = s[4:]
            size = ring.shape[0]
            if s[2] == 0.0:
                for j in range(size):
                    ring[j] = u
            s[2] = 1.0
            latest = (int(s[3]) + 1) % size
            s[3] = float(latest)
            ring[latest] = u
            whole = int(s[0])
            u = delayed(ring[(latest - whole) % size], ring[(latest - whole - 1) % size], s[1])
    return u


@njit
def needed_command(kinds: Any, p_at: Any, parameters: Any, force: float) -> float:
    """Return the command [N] that lets ``force`` [N] arrive; a delay changes only its time.

    Args:
        kinds, p_at, parameters: as in ``effects_step``.
        force: wanted at the mass [N].
    """
    for i in range(kinds.shape[0] - 1, -1, -1):
        force = needed_effect(kinds[i], parameters[p_at[i] : p_at[i + 1]], force)
    return force


@njit
def measured_position(kinds: Any, p_at: Any, parameters: Any, q: float) -> float:
    """Return the position an encoder with the effects shows for the true position ``q`` [m]."""
    for i in range(kinds.shape[0]):
        q = position_effect(kinds[i], parameters[p_at[i] : p_at[i + 1]], q)
    return q


@njit
def corrected_position(kinds: Any, p_at: Any, parameters: Any, q: float) -> float:
    """Return the true position for the measured position ``q`` [m]; quantisation is not inverted."""
    for i in range(kinds.shape[0] - 1, -1, -1):
        q = position_correction(kinds[i], parameters[p_at[i] : p_at[i + 1]], q)
    return q


@njit
def effects_block(
    kinds: Any, p_at: Any, s_at: Any, parameters: Any, state: Any, user: Any, q: Any, v: Any, a: Any, t: Any, u: Any,
    h: Any, level: Any, v2: Any, a2: Any, scratch: Any, force: Any, factor: Any,
) -> None:  # fmt: skip
    """``effects_step`` over a block, one effect after the other; writes ``force`` and ``factor``.

    Args:
        kinds, p_at, s_at, parameters, state, user: as in ``effects_step``.
        q, v, a, t, u, h, level, v2, a2: of ``effects_step``, arrays of one length.
        scratch: ``out`` of ``effects_step``.
        force, factor: added force and level factor at each sample.
    """
    force[:] = 0.0
    factor[:] = 1.0
    for i in range(kinds.shape[0]):
        p = parameters[p_at[i] : p_at[i + 1]]
        s = state[s_at[i] : s_at[i + 1]]
        kind = kinds[i]
        for k in range(q.shape[0]):
            if kind < FIRST_USER_KIND:
                added, scale = built_in_step(kind, p, s, q[k], v[k], a[k], t[k], u[k], h[k], level[k], v2[k], a2[k])
            else:
                added, scale = _user_effect_step(
                    kind - FIRST_USER_KIND, p, s, user, q[k], v[k], a[k], t[k], u[k], h[k], level[k], v2[k], a2[k],
                    scratch,
                )  # fmt: skip
            force[k] += added
            factor[k] *= scale
    for k in range(q.shape[0]):
        factor[k] = max(factor[k], MINIMUM_LEVEL_FACTOR)


@njit
def effort_block(kinds: Any, p_at: Any, s_at: Any, parameters: Any, state: Any, u: Any, arrived: Any) -> None:
    """``effort_step`` over a block; writes ``arrived``."""
    for k in range(u.shape[0]):
        arrived[k] = effort_step(kinds, p_at, s_at, parameters, state, u[k])


@njit
def command_block(kinds: Any, p_at: Any, parameters: Any, force: Any, command: Any) -> None:
    """``needed_command`` over a block, one effect after the other; writes ``command``."""
    command[:] = force
    for i in range(kinds.shape[0] - 1, -1, -1):
        p = parameters[p_at[i] : p_at[i + 1]]
        for k in range(force.shape[0]):
            command[k] = needed_effect(kinds[i], p, command[k])


@njit
def position_block(kinds: Any, p_at: Any, parameters: Any, q: Any, is_correction: bool, result: Any) -> None:
    """``measured_position`` or, for a correction, ``corrected_position`` over a block, one effect after the other.

    Writes ``result``.
    """
    result[:] = q
    count = kinds.shape[0]
    for number in range(count):
        i = count - 1 - number if is_correction else number
        p = parameters[p_at[i] : p_at[i + 1]]
        for k in range(q.shape[0]):
            if is_correction:
                result[k] = position_correction(kinds[i], p, result[k])
            else:
                result[k] = position_effect(kinds[i], p, result[k])
