"""The true stage of one seed: mass, an eleven-element contact, controller gains. Nothing hidden in it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FILTER_TIME = 1.5e-4  # s, of the controller's velocity: more would excite the contact's own resonance at 100-150 Hz


@dataclass(frozen=True)
class TrueStage:
    """Truth about one stage, SI units.

    Attributes:
        mass: moving mass [kg].
        shares: share of the sliding level of each element.
        reaches: deflection at which each element slips at the Coulomb force [m].
        static_force: sliding friction toward zero speed [N].
        coulomb_force: sliding friction at high speed [N].
        knee: speed of the fall between them [m/s].
        viscous: viscous coefficient [N s/m].
        attraction: rate at which slipping elements follow the sliding friction [N/s].
        top_speed: largest speed of its motions [m/s].
        top_acceleration: largest acceleration of its motions [m/s^2].
        half_stroke: motions stay within plus and minus this [m].
        bandwidth: of the controller [rad/s].
        model: friction model its owner uses, ``sgms`` or ``gms``.
    """

    mass: float
    shares: tuple[float, ...]
    reaches: tuple[float, ...]
    static_force: float
    coulomb_force: float
    knee: float
    viscous: float
    attraction: float
    top_speed: float
    top_acceleration: float
    half_stroke: float
    bandwidth: float
    model: str

    @property
    def springs(self) -> Floats:
        """Return the stiffness of each element [N/m]."""
        return np.asarray(np.array(self.shares) * self.coulomb_force / np.array(self.reaches), dtype=np.float64)

    @property
    def curve(self) -> Floats:
        """Return the kernel's row: static and Coulomb force, knee, viscous coefficient, attraction."""
        return np.array([self.static_force, self.coulomb_force, self.knee, self.viscous, self.attraction])

    @property
    def gains(self) -> Floats:
        """Return the kernel's row: position, velocity and integral gain, filter time, largest effort."""
        rate = self.bandwidth
        return np.array(
            [
                self.mass * rate**2,
                1.6 * self.mass * rate,
                self.mass * rate**3 / 8.0,
                FILTER_TIME,
                40.0 * self.coulomb_force,
            ]
        )

    def with_elements(self, shares: Floats, reaches: Floats) -> TrueStage:
        """Return the same stage with another contact."""
        return replace(self, shares=tuple(float(one) for one in shares), reaches=tuple(float(one) for one in reaches))


def draw_stage(rng: Generator) -> TrueStage:
    """Draw a stage of a believable machine; slow S-GMS owners have a contact without visible lag."""
    coulomb = float(np.exp(rng.uniform(np.log(3.0), np.log(14.0))))
    mass = coulomb * float(rng.uniform(0.7, 1.6))
    count = int(rng.integers(10, 13))
    reaches = np.sort(np.exp(rng.uniform(np.log(5.0e-7), np.log(1.5e-5), count)))
    shares = rng.dirichlet(np.full(count, 3.0) * np.linspace(0.6, 1.8, count))
    top_speed = float(rng.uniform(0.12, 0.3))
    model = "gms" if rng.random() < 0.25 else "sgms"
    settle = float(rng.uniform(0.008, 0.04)) if model == "gms" else 2.0e-4
    return TrueStage(
        mass=mass,
        shares=tuple(float(one) for one in shares),
        reaches=tuple(float(one) for one in reaches),
        static_force=coulomb * float(rng.uniform(1.05, 1.3)),
        coulomb_force=coulomb,
        knee=float(np.exp(rng.uniform(np.log(6.0e-4), np.log(4.0e-3)))),
        viscous=coulomb * float(rng.uniform(0.25, 0.9)) / top_speed,
        attraction=coulomb / settle,
        top_speed=top_speed,
        top_acceleration=coulomb / mass * float(rng.uniform(1.2, 2.2)),
        half_stroke=float(rng.uniform(0.025, 0.06)),
        bandwidth=2.0 * np.pi * float(rng.uniform(25.0, 40.0)),
        model=model,
    )
