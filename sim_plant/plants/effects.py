"""Hidden effects: how each is drawn and scaled so that its largest force is a given share of the Coulomb force.

The random numbers of an effect depend on the machine's seed and the effect, never on the motion. Where the force
depends on speed, acceleration or stroke, it is scaled by the limits of the machine. Effects without a formula (delay,
flexible mode) are scaled by a simulation.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats
from sim_plant.plants import slots as s
from sim_plant.plants.machine import Machine

MAP_POINTS = 201
NOMINAL_DURATION = 30.0
"""Duration at which the warm-up is measured [s]."""


@dataclass(frozen=True)
class Peaks:
    """Largest speed, acceleration and effort rate of the machine's learning motion, measured with nothing hidden.

    Attributes:
        speed: largest speed [m/s].
        acceleration: largest acceleration below 100 Hz [m/s^2].
        effort_rate: 99.5 % quantile of the effort's rate of change below 100 Hz [N/s].
    """

    speed: float
    acceleration: float
    effort_rate: float


@dataclass(frozen=True)
class Hidden:
    """What is hidden in one machine.

    Attributes:
        p: parameters of the compiled plant, see ``slots``; SI units.
        force_map: force over position [N]; empty for none.
        scale_map: share of friction over position in the positive direction [-]; empty for none.
        figures: the true parameters by effect and name; SI units.
        pulses: largest force of the pulses at random times [N].
        wander: largest force of the slow wandering [N].
    """

    p: Floats = field(default_factory=lambda: np.zeros(s.COUNT))
    force_map: Floats = field(default_factory=lambda: np.zeros(0))
    scale_map: Floats = field(default_factory=lambda: np.zeros(0))
    figures: dict[str, dict[str, float]] = field(default_factory=dict)
    pulses: float = 0.0
    wander: float = 0.0


Draw = Callable[[Machine, Peaks, float, Generator], "tuple[dict[int, float], dict[str, float]]"]
"""Takes machine, peaks of its motion, share of the Coulomb force and random generator; returns slots and figures."""


def _ripple(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw cogging: two harmonics over a pitch of a third to a sixth of the stroke."""
    pitch = 2.0 * m.half_stroke / rng.uniform(3.0, 8.0)
    ratio, first, second = rng.uniform(0.0, 0.4), rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.0, 2.0 * np.pi)
    angle = np.linspace(0.0, 2.0 * np.pi, 2000)
    peak = np.max(np.abs(np.sin(angle + first) + ratio * np.sin(2.0 * angle + second)))
    size = share * m.coulomb_force / peak
    places = {s.RIPPLE: size, s.RIPPLE_PITCH: pitch, s.RIPPLE_PHASE: first}
    places |= {s.RIPPLE_SECOND: ratio * size, s.RIPPLE_SECOND_PHASE: second}
    return places, {"pitch": pitch, "amplitude": size}


def _asymmetry(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw friction that is larger in one direction."""
    value = share * rng.choice([-1.0, 1.0])
    return {s.SIDE_SHARE: value}, {"share": value}


def _offset(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a constant force."""
    force = share * m.coulomb_force * rng.choice([-1.0, 1.0])
    return {s.CONSTANT: force}, {"force": force}


def _tight_spot(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a place of higher friction: a raised cosine."""
    places = {s.TIGHT_SHARE: share, s.TIGHT_CENTRE: m.half_stroke * rng.uniform(-0.45, 0.45)}
    return places | {s.TIGHT_HALF_WIDTH: m.half_stroke * rng.uniform(0.2, 0.5)}, {}


def _spring(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a spring that reaches its size at the farther end of the stroke."""
    centre = m.half_stroke * rng.uniform(-0.2, 0.2)
    stiffness = share * m.coulomb_force / (m.half_stroke + abs(centre))
    return {s.SPRING: stiffness, s.SPRING_CENTRE: centre}, {"stiffness": stiffness}


def _mass(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw an added mass whose inertia at the top acceleration has the size."""
    mass = share * m.coulomb_force / peaks.acceleration
    return {s.ADDED_MASS: mass}, {"mass": mass}


def _quadratic(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a drag that reaches its size at the top speed."""
    drag = share * m.coulomb_force / peaks.speed**2
    return {s.DRAG: drag}, {"coefficient": drag}


def _thermal(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw friction that falls while running in, from the start of each recording."""
    tau = rng.uniform(4.0, 12.0)
    fall = share / -np.expm1(-NOMINAL_DURATION / tau)
    return {s.WARM_SHARE: fall, s.WARM_TIME: tau}, {"time_constant": tau}


def _delay(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a delay of the effort whose force error at the largest rate of the effort has the size."""
    delay = share * m.coulomb_force / peaks.effort_rate
    return {s.DELAY: delay}, {"delay": delay}


def _gain(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a loss of gain; its size is the share of the effort, not of the Coulomb force."""
    return {s.LOST_GAIN: share}, {"gain": 1.0 - share}


def _dead_zone(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw an amplifier that loses a constant part of the effort."""
    width = share * m.coulomb_force
    return {s.DEAD_WIDTH: width}, {"width": width}


def _flexible(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a part of the mass behind a spring; ``recording`` scales the part."""
    part = share * m.mass
    frequency = m.bandwidth * rng.uniform(1.3, 2.2)
    damping = rng.uniform(0.015, 0.05)
    omega = 2.0 * np.pi * frequency
    places = {s.LOAD_MASS: part, s.LOAD_STIFFNESS: part * omega**2, s.LOAD_DAMPING: 2.0 * damping * part * omega}
    return places, {"frequency": frequency, "mass": part}


def _dwell(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw friction that grows with the logarithm of rest, to its size after 1 s, and is lost by sliding."""
    return {s.AGE_SHARE: share, s.AGE_TIME: rng.uniform(0.02, 0.05), s.AGE_LENGTH: 3.0 * m.distance}, {}


def _vibration(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a force of one frequency in time."""
    size, frequency = share * m.coulomb_force, rng.uniform(4.0, 18.0)
    places = {s.SHAKE: size, s.SHAKE_FREQUENCY: frequency, s.SHAKE_PHASE: rng.uniform(0.0, 2.0 * np.pi)}
    return places, {"amplitude": size, "frequency": frequency}


def _gravity(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw the weight of an arm; its torque is largest where the arm lies level, inside the stroke."""
    angle = 0.5 * np.pi - m.half_stroke * rng.uniform(-0.6, 0.6)
    size = share * m.coulomb_force
    return {s.WEIGHT: size, s.WEIGHT_ANGLE: float(angle)}, {"amplitude": size}


def _slack(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw a spring with hysteresis, such as a cable chain: it pulls harder on the way out."""
    places = {s.SLACK_FORCE: share * m.coulomb_force / 1.6, s.SLACK_REACH: m.half_stroke}
    return places | {s.SLACK_DISTANCE: 0.08 * m.half_stroke * rng.uniform(0.6, 1.4)}, {}


def _none(m: Machine, peaks: Peaks, share: float, rng: Generator) -> tuple[dict[int, float], dict[str, float]]:
    """Draw nothing in the slots: the effect lies in a map or in time."""
    return {}, {}


@dataclass(frozen=True)
class Kind:
    """One entry of the menu.

    Attributes:
        draw: fills the slots.
        is_inside: whether a catalogue of friction effects usually has a name for it.
        is_repeatable: whether another recording shows the same force at the same place, speed or time.
        is_rotary: whether only rotary machines can have it.
        has_small: whether it can be detected at 5 % although every value of the owner's file is up to 5 % wrong.
    """

    draw: Draw
    is_inside: bool = True
    is_repeatable: bool = True
    is_rotary: bool = False
    has_small: bool = True


KINDS: dict[str, Kind] = {
    "cogging": Kind(_ripple),
    "asymmetry": Kind(_asymmetry),
    "offset": Kind(_offset),
    "tight_spot": Kind(_tight_spot),
    "spring": Kind(_spring),
    "mass": Kind(_mass, has_small=False),
    "quadratic": Kind(_quadratic),
    "thermal": Kind(_thermal),
    "delay": Kind(_delay),
    "gain": Kind(_gain, has_small=False),
    "dead_zone": Kind(_dead_zone),
    "flexible_mode": Kind(_flexible),
    "dwell": Kind(_dwell),
    "vibration": Kind(_vibration),
    "gravity": Kind(_gravity, is_rotary=True),
    "pulses": Kind(_none, is_inside=False, is_repeatable=False),
    "force_map": Kind(_none, is_inside=False),
    "direction_and_place": Kind(_none, is_inside=False),
    "wandering_force": Kind(_none, is_inside=False, is_repeatable=False),
    "hysteretic_spring": Kind(_slack, is_inside=False),
}
"""Every effect that can be hidden, by name."""


def menu(machine: Machine) -> tuple[str, ...]:
    """Return the names of the effects that this machine can have."""
    return tuple(name for name, kind in KINDS.items() if machine.is_rotary or not kind.is_rotary)


def draw_hidden(machine: Machine, peaks: Peaks, effects: dict[str, float], seed: int) -> Hidden:
    """Return what is hidden.

    Args:
        machine: where.
        peaks: of its learning motion.
        effects: shares of the Coulomb force by name.
        seed: of the random numbers of the effects.

    Raises:
        ValueError: for an unknown effect, or one that this machine cannot have.
    """
    p = np.zeros(s.COUNT)
    p[s.MAP_START] = -1.2 * machine.half_stroke
    p[s.MAP_STEP] = 2.4 * machine.half_stroke / (MAP_POINTS - 1)
    maps = {"force_map": np.zeros(0), "direction_and_place": np.zeros(0)}
    figures = {}
    for name, share in effects.items():
        if name not in menu(machine):
            raise ValueError(f"effect {name!r} is unknown on this machine; use one of {', '.join(menu(machine))}")
        rng = np.random.default_rng([seed, zlib.crc32(name.encode())])
        places, figures[name] = KINDS[name].draw(machine, peaks, share, rng)
        for place, value in places.items():
            p[place] = value
        if name in maps:
            maps[name] = share * random_shape(rng)
    return Hidden(
        p=p,
        force_map=machine.coulomb_force * maps["force_map"],
        scale_map=maps["direction_and_place"],
        figures={name: {key: float(value) for key, value in one.items()} for name, one in figures.items()},
        pulses=effects.get("pulses", 0.0) * machine.coulomb_force,
        wander=effects.get("wandering_force", 0.0) * machine.coulomb_force,
    )


def random_shape(rng: Generator) -> Floats:
    """Return a smooth random shape over the stroke with largest magnitude 1, no mean and no slope."""
    x = np.linspace(-1.2, 1.2, MAP_POINTS)
    shape = np.zeros(MAP_POINTS)
    for _ in range(9):
        shape += rng.normal() * np.exp(-0.5 * ((x - rng.uniform(-1.0, 1.0)) / rng.uniform(0.08, 0.25)) ** 2)
    stroke = np.abs(x) <= 1.0
    shape -= np.polyval(np.polyfit(x[stroke], shape[stroke], 1), x)
    return np.asarray(np.clip(shape / np.max(np.abs(shape[stroke])), -1.0, 1.0))


def outside_force(hidden: Hidden, count: int, period: float, rng: Generator) -> Floats:
    """Return the hidden forces over time: pulses at random times, and a slow random force [N].

    Args:
        hidden: gives their sizes.
        count: samples of the controller.
        period: of the controller [s].
        rng: random numbers of the recording.
    """
    force = np.zeros(count)
    if hidden.pulses:
        width = max(2, round(0.04 / period))
        bump = np.hanning(width)
        for _ in range(max(1, round(count * period / 1.0))):
            at = int(rng.integers(0, max(1, count - width)))
            room = force[at : at + width]
            if np.all(room == 0.0):
                room += rng.choice([-1.0, 1.0]) * rng.uniform(0.6, 1.0) * hidden.pulses * bump[: room.size]
    if hidden.wander:
        knots = rng.standard_normal(max(4, round(count * period / 3.0)) + 4).cumsum()
        smooth = np.convolve(knots, [0.25, 0.5, 0.25], "valid")
        t = np.linspace(0.0, smooth.size - 1.0, count)
        left = np.minimum(t.astype(np.int64), smooth.size - 2)
        part = t - left
        part = part**2 * (3.0 - 2.0 * part)
        path = smooth[left] + part * (smooth[left + 1] - smooth[left])
        path -= path.mean()
        force += hidden.wander * path / np.max(np.abs(path))
    return force
