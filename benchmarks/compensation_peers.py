"""What a user would pick instead of this package's compensation, each written in a few lines, each tuned beside it.

Every peer takes one sample (measured position, effort, reference position and velocity) and returns a feedforward [N].
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from scipy import signal

from sgms_observer.settings.axis import FrictionSettings


class Peer(Protocol):
    """A compensation, one sample at a time."""

    def step(self, position: float, effort: float, reference: float, velocity: float) -> float:
        """Return the feedforward for the next sample [N]."""
        ...


class CoulombViscous:
    """Static feedforward: gain (f_C sgn(v) + sigma_v v) of the reference velocity, held while the reference rests."""

    def __init__(self, friction: FrictionSettings, gain: float) -> None:
        self._friction, self._gain = friction, gain
        self._direction = 0.0

    def step(self, position: float, effort: float, reference: float, velocity: float) -> float:
        """Return the feedforward for the next sample [N]."""
        if velocity != 0.0:
            self._direction = math.copysign(1.0, velocity)
        force = self._friction.coulomb_force * self._direction + self._friction.viscous_coefficient * velocity
        return self._gain * force


class LuGre:
    """LuGre feedforward along the reference (Canudas de Wit et al. 1995), bristle stiffness tuned by the caller."""

    def __init__(self, friction: FrictionSettings, gain: float, stiffness: float, period: float) -> None:
        self._friction, self._gain, self._stiffness, self._period = friction, gain, stiffness, period
        self._deflection = 0.0

    def step(self, position: float, effort: float, reference: float, velocity: float) -> float:
        """Return the feedforward for the next sample [N]."""
        p = self._friction
        ratio = velocity / p.stribeck_velocity
        level = p.coulomb_force + (p.static_force - p.coulomb_force) * math.exp(-ratio * ratio)
        h = self._period
        self._deflection = (self._deflection + velocity * h) / (1.0 + self._stiffness * abs(velocity) * h / level)
        return self._gain * (self._stiffness * self._deflection + p.viscous_coefficient * velocity)


class DisturbanceObserver:
    """Disturbance observer: Q(s) (u - m s^2 x) with a binomial low-pass Q of third order."""

    def __init__(self, mass: float, bandwidth: float, period: float) -> None:
        w = 2.0 * math.pi * bandwidth
        bottom = np.poly([-w, -w, -w])
        force = signal.bilinear([w**3], bottom, 1.0 / period)
        inertia = signal.bilinear([mass * w**3, 0.0, 0.0], bottom, 1.0 / period)
        self._force_b, self._force_a = force
        self._inertia_b, self._inertia_a = inertia
        self._force_state = np.zeros(3)
        self._inertia_state: np.ndarray | None = None

    def step(self, position: float, effort: float, reference: float, velocity: float) -> float:
        """Return the feedforward for the next sample [N]."""
        if self._inertia_state is None:
            self._inertia_state = signal.lfilter_zi(self._inertia_b, self._inertia_a) * position
        force, self._force_state = _filter(self._force_b, self._force_a, self._force_state, effort)
        inertia, self._inertia_state = _filter(self._inertia_b, self._inertia_a, self._inertia_state, position)
        return force - inertia


def _filter(b: np.ndarray, a: np.ndarray, state: np.ndarray, value: float) -> tuple[float, np.ndarray]:
    """Run one sample through a digital filter, transposed direct form II."""
    out = float(b[0]) * value + float(state[0])
    following = np.array(
        [
            state[1] + b[1] * value - a[1] * out,
            state[2] + b[2] * value - a[2] * out,
            b[3] * value - a[3] * out,
        ]
    )
    return out, following
