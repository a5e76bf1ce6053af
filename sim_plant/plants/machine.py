"""A machine: contact law, mass, controller, log and encoder, drawn from one seed and scaled to each other.

``PLANTS`` names the kinds of machines: a contact law and what its machines have in common; the seed draws the rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats
from sim_plant.plants.contact import LAWS, draw_law

LOOP_RATIOS = (1, 2, 4, 10, 20)
"""How many times the controller runs between two logged samples; at 1 the effort is held over the log's period."""
LOOP_RATES = (1.0e3, 2.0e4)
"""Slowest and fastest controller [Hz]."""


@dataclass(frozen=True, eq=False)
class Machine:
    """One machine. Rotary machines have rad, N m and kg m^2 where m, N and kg stand.

    Attributes:
        seed: seed it was drawn from.
        law: contact law.
        is_rotary: whether it turns.
        mass: moving mass [kg].
        viscous: viscous coefficient [N s/m].
        curve: sliding curve, see ``stribeck``.
        law_parameters: see the law's module; SI units.
        distance: static force over presliding stiffness [m].
        half_stroke: largest distance from the middle [m].
        speed: top speed of its motions [m/s].
        acceleration: top acceleration of its motions [m/s^2].
        controller: columns of ``kernel``; SI units.
        bandwidth: of the position loop [Hz].
        loop_rate: of the controller [Hz].
        log_rate: of the log [Hz].
        resolution: of the encoder [m].
        force_noise: rms force on the mass [N].
        effort_noise: rms noise of the logged effort [N].
        noise_corner: corner of the effort's noise [Hz]; 0 for white.
    """

    seed: int
    law: str
    is_rotary: bool
    mass: float
    viscous: float
    curve: Floats
    law_parameters: Floats
    distance: float
    half_stroke: float
    speed: float
    acceleration: float
    controller: Floats
    bandwidth: float
    loop_rate: float
    log_rate: float
    resolution: float
    force_noise: float
    effort_noise: float
    noise_corner: float

    @property
    def coulomb_force(self) -> float:
        """Return the Coulomb force [N], of which effects are shares."""
        return float(self.curve[0])

    @property
    def every(self) -> int:
        """Return how many periods of the controller lie between two logged samples."""
        return round(self.loop_rate / self.log_rate)

    @property
    def is_held(self) -> bool:
        """Return whether the logged effort acts unchanged until the next sample."""
        return self.every == 1


def draw(
    seed: int,
    law: str,
    *,
    is_rotary: bool = False,
    log_rate: float = 1000.0,
    coulomb_force: float | None = None,
    resolution: float | None = None,
    has_integrator: bool | None = None,
) -> Machine:
    """Draw a machine; what is not given is drawn as well.

    Args:
        seed: of every number in it.
        law: contact law, one of ``contact.LAWS``.
        is_rotary: whether it turns.
        log_rate: of the log [Hz].
        coulomb_force: friction at speed [N], 0.1 to 1000 when drawn.
        resolution: of the encoder [m], 5e-7 to 5e-5 of the half stroke when drawn.
        has_integrator: whether the controller integrates.

    Returns:
        The machine. The same seed gives the same machine up to what is given.
    """
    if law not in LAWS:
        raise ValueError(f"contact law {law!r} is unknown; use one of {', '.join(LAWS)}")
    rng = np.random.default_rng([seed, 11])
    drawn_force = _log_uniform(rng, 0.5, 200.0) if is_rotary else _log_uniform(rng, 0.1, 1000.0)
    force = coulomb_force or drawn_force
    size = rng.uniform(0.7, 1.4)
    stroke = 1.1 * size if is_rotary else 0.02 * math.sqrt(force / 6.0) * size
    speed = 3.0 * stroke * rng.uniform(0.7, 1.4)
    friction_deceleration = stroke * _log_uniform(rng, 15.0, 90.0)
    mass = force / friction_deceleration
    acceleration = friction_deceleration * rng.uniform(0.8, 1.4)
    distance = stroke * 10.0 ** rng.uniform(-4.2, -3.2)
    curve = np.array(
        [force, force * rng.uniform(1.1, 1.4), speed * 10.0 ** rng.uniform(-2.0, -1.2), rng.uniform(0.8, 2.0)]
    )
    viscous = force * rng.uniform(0.1, 0.5) / speed
    law_parameters = draw_law(law, np.random.default_rng([seed, 12]), curve, distance, mass, speed)
    bandwidth = _log_uniform(rng, 12.0, 35.0)
    integral_share = rng.uniform(0.08, 0.2)
    integrates = bool(rng.random() < 0.6)
    ratio = int(rng.choice(LOOP_RATIOS))
    ratios = [one for one in (*LOOP_RATIOS, 50, 100) if LOOP_RATES[0] <= log_rate * one <= LOOP_RATES[1]]
    ratio = min(ratios, key=lambda one: abs(math.log(one / ratio)))
    loop_rate = log_rate * ratio
    encoder = resolution or min(max(stroke * 10.0 ** rng.uniform(-6.3, -4.3), 1.0e-9), 1.0e-4)
    force_noise = force * rng.uniform(1.0e-4, 5.0e-4)
    effort_noise = force * rng.uniform(0.002, 0.01)
    corner = float(rng.choice([0.0, 20.0, 60.0, 150.0]))
    omega = 2.0 * math.pi * bandwidth
    wants_integral = integrates if has_integrator is None else has_integrator
    controller = np.array(
        [
            mass * omega**2,
            1.6 * mass * omega,
            mass * omega**3 * integral_share if wants_integral else 0.0,
            min(6.0 * omega, 0.8 * loop_rate),
            mass * rng.uniform(0.9, 1.1),
        ]
    )
    return Machine(
        seed=seed,
        law=law,
        is_rotary=is_rotary,
        mass=mass,
        viscous=viscous,
        curve=curve,
        law_parameters=law_parameters,
        distance=distance,
        half_stroke=stroke,
        speed=speed,
        acceleration=acceleration,
        controller=controller,
        bandwidth=bandwidth,
        loop_rate=loop_rate,
        log_rate=log_rate,
        resolution=encoder,
        force_noise=force_noise,
        effort_noise=effort_noise,
        noise_corner=min(corner, 0.2 * log_rate),
    )


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


@dataclass(frozen=True)
class Plant:
    """One kind of machine.

    Attributes:
        law: contact law.
        fixed: arguments of ``draw`` that are not left to the seed.
        summary: what is special, in a few words.
    """

    law: str
    fixed: dict[str, Any]
    summary: str


PLANTS: dict[str, Plant] = {
    "lugre": Plant("lugre", {}, "LuGre, logged at 1 kHz"),
    "elasto_plastic": Plant("elasto_plastic", {}, "elasto-plastic bristle, logged at 1 kHz"),
    "bouc_wen": Plant("bouc_wen", {}, "Bouc-Wen hysteresis, logged at 1 kHz"),
    "rate_state": Plant("rate_state", {}, "rate-and-state friction, logged at 1 kHz"),
    "robot_joint": Plant(
        "lugre", {"is_rotary": True, "log_rate": 500.0, "has_integrator": False}, "LuGre, rotary, logged at 500 Hz"
    ),
    "gantry": Plant(
        "elasto_plastic",
        {"coulomb_force": 1000.0, "resolution": 1.0e-4, "log_rate": 250.0},
        "elasto-plastic, 1000 N, encoder of 100 um, logged at 250 Hz",
    ),
    "slow_log": Plant("bouc_wen", {"log_rate": 100.0}, "Bouc-Wen, logged at 100 Hz"),
    "fast_log": Plant(
        "rate_state",
        {"coulomb_force": 0.1, "resolution": 1.0e-9, "log_rate": 10_000.0},
        "rate-and-state, 0.1 N, encoder of 1 nm, logged at 10 kHz",
    ),
    "leuven": Plant("leuven", {}, "Leuven hysteresis, logged at 1 kHz"),
}
"""Every plant; leaving one out leaves out a whole row."""


_ROOM = 32
"""Plants that a seed has room for, so that a new plant at the end changes none before it."""


def draw_plant(name: str, seed: int) -> Machine:
    """Return one machine of a plant.

    Args:
        name: one of ``PLANTS``.
        seed: of everything that the plant does not fix; plants do not share their chance.

    Raises:
        ValueError: for an unknown plant.
    """
    if name not in PLANTS:
        raise ValueError(f"plant {name!r} is unknown; use one of {', '.join(PLANTS)}")
    own_seed = _ROOM * seed + list(PLANTS).index(name)
    return draw(own_seed, PLANTS[name].law, **PLANTS[name].fixed)
