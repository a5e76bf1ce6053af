"""The true stage of one seed, with nothing hidden in it, and the references of its fitted and held-out recordings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats

FILTER_TIME = 1.5e-4  # s, of the controller's velocity: more would excite the contact's own resonance at 100-150 Hz

PERIOD = 1.0e-3  # s
HELD_OUT = ("staircase", "wander", "triangle", "chirp")
"""Kinds of the held-out recordings."""


@dataclass(frozen=True)
class TrueStage:
    """Truth about one stage, SI units.

    Attributes:
        mass: moving mass [kg].
        shares: share of the sliding level of each element.
        slip_deflections: deflection at which each element slips at the Coulomb force [m].
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
    slip_deflections: tuple[float, ...]
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
        return np.asarray(
            np.array(self.shares) * self.coulomb_force / np.array(self.slip_deflections), dtype=np.float64
        )

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

    def with_elements(self, shares: Floats, slip_deflections: Floats) -> TrueStage:
        """Return the same stage with another contact."""
        return replace(
            self,
            shares=tuple(float(one) for one in shares),
            slip_deflections=tuple(float(one) for one in slip_deflections),
        )


def draw_stage(rng: Generator) -> TrueStage:
    """Draw a stage of a believable machine; slow S-GMS owners have a contact without visible lag."""
    coulomb = float(np.exp(rng.uniform(np.log(3.0), np.log(14.0))))
    mass = coulomb * float(rng.uniform(0.7, 1.6))
    count = int(rng.integers(10, 13))
    slip_deflections = np.sort(np.exp(rng.uniform(np.log(5.0e-7), np.log(1.5e-5), count)))
    shares = rng.dirichlet(np.full(count, 3.0) * np.linspace(0.6, 1.8, count))
    top_speed = float(rng.uniform(0.12, 0.3))
    model = "gms" if rng.random() < 0.25 else "sgms"
    settle = float(rng.uniform(0.008, 0.04)) if model == "gms" else 2.0e-4
    return TrueStage(
        mass=mass,
        shares=tuple(float(one) for one in shares),
        slip_deflections=tuple(float(one) for one in slip_deflections),
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


@dataclass(frozen=True)
class Motion:
    """A reference sampled at 1 kHz: position [m], velocity [m/s], acceleration [m/s^2]."""

    kind: str
    position: Floats
    velocity: Floats
    acceleration: Floats

    @property
    def time(self) -> Floats:
        """Return the sample times [s]."""
        return np.asarray(PERIOD * np.arange(self.position.size), dtype=np.float64)


class Path:
    """Velocity samples put one after the other; every piece starts and ends at rest."""

    def __init__(self, start: float) -> None:
        self.place = start
        self.start = start
        self.pieces: list[Floats] = []

    @property
    def duration(self) -> float:
        """Return the time so far [s]."""
        return PERIOD * sum(piece.size for piece in self.pieces)

    def add(self, velocity: Floats) -> None:
        """Append velocity samples [m/s]."""
        self.pieces.append(velocity)
        self.place += float(velocity.sum()) * PERIOD

    def rest(self, duration: float) -> None:
        """Stand still for ``duration`` [s]."""
        self.add(np.zeros(round(duration / PERIOD)))

    def go(self, target: float, speed: float, acceleration: float) -> None:
        """Move to ``target`` [m] with a trapezoid of ``speed`` [m/s] and ``acceleration`` [m/s^2]."""
        distance = abs(target - self.place)
        if distance < 1.0e-9:
            return
        speed = min(speed, np.sqrt(distance * acceleration))
        ramp = max(2, int(np.ceil(speed / acceleration / PERIOD)))
        cruise = max(0, int(np.ceil(distance / speed / PERIOD)) - ramp)
        up = (np.arange(ramp) + 0.5) / ramp
        shape = np.concatenate((up, np.ones(cruise), up[::-1]))
        self.add(np.sign(target - self.place) * shape * distance / (shape.sum() * PERIOD))

    def sines(self, duration: float, amplitudes: Floats, frequencies: Floats, phases: Floats) -> None:
        """Swing around the place: a sum of sines, faded in and out over a fifth of ``duration`` [s]."""
        t = PERIOD * np.arange(round(duration / PERIOD) + 1)
        edge = np.clip(np.minimum(t, t[-1] - t) / (0.2 * t[-1]), 0.0, 1.0)
        window = edge * edge * edge * (10.0 - 15.0 * edge + 6.0 * edge * edge)
        swing = window * np.sin(2.0 * np.pi * np.outer(t, frequencies) + phases).dot(amplitudes)
        self.add(np.diff(swing) / PERIOD)

    def finish(self, kind: str, duration: float) -> Motion:
        """Round the corners of the velocity and return exactly ``duration`` [s]."""
        count = round(duration / PERIOD)
        velocity = np.concatenate([*self.pieces, np.zeros(count)])[:count]
        for width in (9, 7):
            velocity = np.convolve(np.concatenate((velocity, np.zeros(width))), np.ones(width) / width)[:count]
        position = self.start + PERIOD * np.concatenate(([0.0], np.cumsum(velocity)[:-1]))
        return Motion(kind, position, velocity, np.gradient(velocity, PERIOD))


def tones(stage: TrueStage, rng: Generator, lowest: float, highest: float, count: int) -> tuple[Floats, Floats, Floats]:
    """Return amplitudes [m], frequencies [Hz] and phases of tones that share the stage's speed and acceleration."""
    frequencies = np.geomspace(lowest, highest, count) * rng.uniform(0.93, 1.07, count)
    omega = 2.0 * np.pi * frequencies
    by_acceleration = 0.45 * stage.top_acceleration / omega**2
    by_speed = 0.3 * stage.top_speed / omega
    by_stroke = np.full(count, 0.25 * stage.half_stroke)
    amplitudes = np.minimum(np.minimum(by_acceleration, by_speed), by_stroke)
    return amplitudes, frequencies, rng.uniform(0.0, 2.0 * np.pi, count)


def rich_motion(stage: TrueStage, rng: Generator, duration: float = 30.0) -> Motion:
    """Return a motion for identification: tones, log-spaced speeds, traverses, dwells, small cycles, moves."""
    half_stroke, max_speed, max_acceleration = stage.half_stroke, stage.top_speed, stage.top_acceleration
    path = Path(0.0)

    def log_speeds() -> None:
        for speed in np.geomspace(1.0e-4, 0.5 * max_speed, 7) * rng.uniform(0.8, 1.25, 7):
            length = min(0.45 * speed, 0.8 * half_stroke)
            path.go(path.place + length, speed, max_acceleration)
            path.go(path.place - length, speed, max_acceleration)
        path.rest(0.05)

    def traverses() -> None:
        for crossing_time in (2.0, 1.1):
            speed = 2.0 * half_stroke / crossing_time
            path.go(-half_stroke, max_speed, max_acceleration)
            path.go(half_stroke, speed, max_acceleration)
            path.go(-half_stroke, speed * rng.uniform(0.85, 1.15), max_acceleration)
        path.go(0.0, max_speed, max_acceleration)

    def swings() -> None:
        path.go(rng.uniform(-0.3, 0.3) * half_stroke, max_speed, max_acceleration)
        path.sines(max(4.0, duration - 22.0), *tones(stage, rng, 0.4, 40.0, 10))

    def dwells() -> None:
        for wait in rng.permutation([0.1, 0.2, 0.4, 0.8, 1.5]):
            side = 1.0 if rng.random() < 0.5 else -1.0
            path.rest(wait)
            path.go(path.place + side * 1.2e-3, 4.0e-3, max_acceleration)

    def small_swings() -> None:
        for amplitude in (4.0e-6, 1.2e-5, 4.0e-5):
            path.sines(0.9, np.array([amplitude]), np.array([4.0]), np.zeros(1))

    def moves() -> None:
        for target in (0.9, -0.9, 0.5, -0.2):
            path.go(target * half_stroke, max_speed, max_acceleration)
            path.rest(0.06)

    pieces = [log_speeds, traverses, swings, dwells, small_swings, moves]
    path.rest(0.15)
    for index in rng.permutation(len(pieces)):
        pieces[index]()
    return path.finish("rich", duration)


def held_out_motion(kind: str, stage: TrueStage, rng: Generator, duration: float = 12.0) -> Motion:
    """Return a motion of a ``kind`` that the rich one does not contain.

    Raises:
        ValueError: for a kind not in ``HELD_OUT``.
    """
    half_stroke, max_speed, max_acceleration = stage.half_stroke, stage.top_speed, stage.top_acceleration
    path = Path(0.0)
    path.rest(0.15)
    if kind == "staircase":  # steps of many sizes with waits, as in inspection
        while path.duration < duration:
            target = float(
                np.clip(
                    path.place + rng.choice([-1, 1]) * half_stroke * rng.uniform(0.02, 0.8),
                    -0.95 * half_stroke,
                    0.95 * half_stroke,
                )
            )
            path.go(target, max_speed * rng.uniform(0.15, 1.0), max_acceleration)
            path.rest(rng.choice([0.05, 0.15, 0.6]))
    elif kind == "wander":  # band-limited random walk
        frequencies = np.sort(np.exp(rng.uniform(np.log(0.15), np.log(12.0), 40)))
        amplitudes = rng.rayleigh(1.0, 40) / (1.0 + (frequencies / 0.6) ** 2)
        phases = rng.uniform(0.0, 2.0 * np.pi, 40)
        t = PERIOD * np.arange(round(duration / PERIOD))
        swing = np.sin(2.0 * np.pi * np.outer(t, frequencies) + phases).dot(amplitudes)
        excess = max(
            np.ptp(swing) / (1.6 * half_stroke),
            np.max(np.abs(np.gradient(swing, PERIOD))) / (0.9 * max_speed),
            np.max(np.abs(np.gradient(np.gradient(swing, PERIOD), PERIOD))) / (1.2 * max_acceleration),
        )
        path.sines(duration - 0.4, amplitudes / excess, frequencies, phases)
    elif kind == "triangle":  # scanning back and forth with sharp reversals
        while path.duration < duration:
            half = half_stroke * rng.uniform(0.1, 0.95)
            speed = max_speed * float(np.exp(rng.uniform(np.log(0.1), 0.0)))
            path.go(half, speed, max_acceleration)
            path.go(-half, speed, max_acceleration)
    elif kind == "chirp":  # a swept swing, its speed held
        t = PERIOD * np.arange(round((duration - 0.4) / PERIOD) + 1)
        rate = np.log(15.0 / 0.4) / t[-1]
        frequency = 0.4 * np.exp(rate * t)
        omega = 2.0 * np.pi * frequency
        size = np.minimum(np.minimum(0.8 * max_speed / omega, 0.8 * max_acceleration / omega**2), 0.7 * half_stroke)
        edge = np.clip(np.minimum(t, t[-1] - t) / 0.4, 0.0, 1.0)
        path.add(
            np.diff(edge**2 * (3.0 - 2.0 * edge) * size * np.sin(2.0 * np.pi * 0.4 * np.expm1(rate * t) / rate))
            / PERIOD
        )
    else:
        raise ValueError(f"held-out motion {kind!r} is unknown; use one of {', '.join(HELD_OUT)}")
    return path.finish(kind, duration)
