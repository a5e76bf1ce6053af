"""Leuven: a hysteresis with non-local memory in presliding, without a memory of its own for each element.

    z' = v (1 - sgn(F_h / s(v)) |F_h / s(v)|^n),    F = F_h(z)

From rest F_h follows the virgin curve y(z) = F_y (1 - exp(-|z| / D)). After each reversal of z, at (z_r, F_r), it is
F_r +- 2 y(|z - z_r| / 2), until the loop that the reversal opened is closed and wiped out (Masing's rules).

Source: Swevers, Al-Bender, Ganseman, Prajogo 2000, An integrated friction model structure with improved presliding
behavior, IEEE Trans. Automatic Control 45(4); without its jump at the closing of loops: Lampaert, Swevers, Al-Bender
2002, Modification of the Leuven integrated friction model structure, 47(4), whose F_h is taken here as in the former.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats
from sgms_observer.jit import njit
from sim_plant.plants.stribeck import STATIC, sliding_force

LARGEST, DISTANCE, POWER = 0, 1, 2
DEFLECTION, SIDE, DEPTH, STACK = 0, 2, 3, 4
"""Places in the state: z [m], direction of its motion, number of open reversals, then their z_r [m] and F_r [N]."""
MAX_OPEN = 30
"""Reversals that are remembered; a smaller loop inside so many is forgotten."""


def draw(rng: Generator, curve: Floats, distance: float, mass: float, speed: float) -> Floats:
    """Return the largest hysteresis force F_y [N], its distance D [m] and the power n.

    Arguments as of ``contact.draw_law``.
    """
    largest = curve[STATIC] * rng.uniform(1.5, 2.0)
    return np.array([largest, distance * largest / curve[STATIC], rng.uniform(4.0, 10.0), 0.0, 0.0])


@njit
def hysteresis(z: float, side: float, law: Floats, state: Floats) -> tuple[float, float, int]:
    """Return force [N], stiffness [N/m] and the number of reversals still open, at a deflection on the way ``side``.

    Args:
        z: deflection [m]; beyond the last one in the direction of ``side``.
        side: 1 or -1.
        law: columns named above.
        state: not changed.
    """
    depth = int(state[DEPTH])
    while depth > 0:
        # the reversal before the last one (the last one mirrored, on the virgin curve) ends the loop
        end = state[STACK + 2 * (depth - 2)] if depth > 1 else -state[STACK]
        if side * (z - end) < 0.0:
            break
        depth -= 2 if depth > 1 else 1
    if depth == 0:
        decay = math.exp(-abs(z) / law[DISTANCE])
        return side * law[LARGEST] * (1.0 - decay), law[LARGEST] / law[DISTANCE] * decay, 0
    place, force = state[STACK + 2 * (depth - 1)], state[STACK + 2 * (depth - 1) + 1]
    decay = math.exp(-0.5 * abs(z - place) / law[DISTANCE])
    return force + side * 2.0 * law[LARGEST] * (1.0 - decay), law[LARGEST] / law[DISTANCE] * decay, depth


@njit
def _turn(force: float, state: Floats) -> None:
    """Remember a reversal at the present deflection and ``force`` [N] in the state."""
    depth = int(state[DEPTH])
    if depth >= MAX_OPEN:
        depth -= 2
    state[STACK + 2 * depth] = state[DEFLECTION]
    state[STACK + 2 * depth + 1] = force
    state[DEPTH] = depth + 1
    state[SIDE] = -state[SIDE]


@njit
def step(velocity: float, duration: float, scale: float, curve: Floats, law: Floats, state: Floats) -> float:
    """Advance the hysteresis at constant velocity (backward Euler in the deflection) and return its force [N].

    Arguments as of ``contact.advance``; the state: places named above; changed.
    """
    z = state[DEFLECTION]
    if state[SIDE] == 0.0:
        state[SIDE] = 1.0 if velocity >= 0.0 else -1.0
    force, _, _ = hysteresis(z, state[SIDE], law, state)
    if velocity == 0.0:
        return float(force)
    level = scale * sliding_force(velocity, curve)
    way = 1.0 if velocity > 0.0 else -1.0
    ratio = way * force / level
    pace = 1.0 - math.copysign(abs(ratio) ** law[POWER], ratio)  # z' / v
    if pace == 0.0:
        return float(force)
    side = way if pace > 0.0 else -way
    if side != state[SIDE]:
        _turn(force, state)
    travel = abs(velocity) * duration
    # distance x along ``side`` with x = travel |pace(x)|: rising in x on the left, falling on the right
    low, high = 0.0, travel * abs(pace)
    x = min(high, 0.5 * law[DISTANCE])
    depth = int(state[DEPTH])
    for _ in range(40):
        force, slope, depth = hysteresis(z + side * x, side, law, state)
        ratio = way * force / level
        power = abs(ratio) ** law[POWER]
        miss = x - travel * side * way * (1.0 - math.copysign(power, ratio))
        if miss > 0.0:
            high = x
        else:
            low = x
        rise = 1.0 + travel * law[POWER] * power / max(abs(ratio), 1.0e-12) * slope / level
        last = x
        x -= miss / rise
        if not low <= x <= high:
            x = 0.5 * (low + high)
        if abs(x - last) <= 1.0e-9 * law[DISTANCE]:
            break
    force, _, depth = hysteresis(z + side * x, side, law, state)
    state[DEFLECTION] = z + side * x
    state[DEPTH] = depth
    return float(force)
