"""References: one rich motion to learn from, and kinds it does not contain to be judged on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sim_plant.blind.stage import TrueStage

Floats = NDArray[np.float64]
PERIOD = 1.0e-3  # s
HELD_OUT = ("staircase", "wander", "triangle", "chirp")
"""Kinds of the held-out recordings."""


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
    """Return everything an identification wants: tones, log-spaced speeds, traverses, dwells, small swings, moves."""
    reach, fast, hard = stage.half_stroke, stage.top_speed, stage.top_acceleration
    path = Path(0.0)

    def log_speeds() -> None:
        for speed in np.geomspace(1.0e-4, 0.5 * fast, 7) * rng.uniform(0.8, 1.25, 7):
            length = min(0.45 * speed, 0.8 * reach)
            path.go(path.place + length, speed, hard)
            path.go(path.place - length, speed, hard)
        path.rest(0.05)

    def traverses() -> None:
        for crossing_time in (2.0, 1.1):
            speed = 2.0 * reach / crossing_time
            path.go(-reach, fast, hard)
            path.go(reach, speed, hard)
            path.go(-reach, speed * rng.uniform(0.85, 1.15), hard)
        path.go(0.0, fast, hard)

    def swings() -> None:
        path.go(rng.uniform(-0.3, 0.3) * reach, fast, hard)
        path.sines(max(4.0, duration - 22.0), *tones(stage, rng, 0.4, 40.0, 10))

    def dwells() -> None:
        for wait in rng.permutation([0.1, 0.2, 0.4, 0.8, 1.5]):
            side = 1.0 if rng.random() < 0.5 else -1.0
            path.rest(wait)
            path.go(path.place + side * 1.2e-3, 4.0e-3, hard)

    def small_swings() -> None:
        for amplitude in (4.0e-6, 1.2e-5, 4.0e-5):
            path.sines(0.9, np.array([amplitude]), np.array([4.0]), np.zeros(1))

    def moves() -> None:
        for target in (0.9, -0.9, 0.5, -0.2):
            path.go(target * reach, fast, hard)
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
    reach, fast, hard = stage.half_stroke, stage.top_speed, stage.top_acceleration
    path = Path(0.0)
    path.rest(0.15)
    if kind == "staircase":  # steps of many sizes with waits, as in inspection
        while path.duration < duration:
            target = float(
                np.clip(path.place + rng.choice([-1, 1]) * reach * rng.uniform(0.02, 0.8), -0.95 * reach, 0.95 * reach)
            )
            path.go(target, fast * rng.uniform(0.15, 1.0), hard)
            path.rest(rng.choice([0.05, 0.15, 0.6]))
    elif kind == "wander":  # band-limited random walk
        frequencies = np.sort(np.exp(rng.uniform(np.log(0.15), np.log(12.0), 40)))
        amplitudes = rng.rayleigh(1.0, 40) / (1.0 + (frequencies / 0.6) ** 2)
        phases = rng.uniform(0.0, 2.0 * np.pi, 40)
        t = PERIOD * np.arange(round(duration / PERIOD))
        swing = np.sin(2.0 * np.pi * np.outer(t, frequencies) + phases).dot(amplitudes)
        excess = max(
            np.ptp(swing) / (1.6 * reach),
            np.max(np.abs(np.gradient(swing, PERIOD))) / (0.9 * fast),
            np.max(np.abs(np.gradient(np.gradient(swing, PERIOD), PERIOD))) / (1.2 * hard),
        )
        path.sines(duration - 0.4, amplitudes / excess, frequencies, phases)
    elif kind == "triangle":  # scanning to and fro with sharp turns
        while path.duration < duration:
            half = reach * rng.uniform(0.1, 0.95)
            speed = fast * float(np.exp(rng.uniform(np.log(0.1), 0.0)))
            path.go(half, speed, hard)
            path.go(-half, speed, hard)
    elif kind == "chirp":  # a swept swing, its speed held
        t = PERIOD * np.arange(round((duration - 0.4) / PERIOD) + 1)
        rate = np.log(15.0 / 0.4) / t[-1]
        frequency = 0.4 * np.exp(rate * t)
        omega = 2.0 * np.pi * frequency
        size = np.minimum(np.minimum(0.8 * fast / omega, 0.8 * hard / omega**2), 0.7 * reach)
        edge = np.clip(np.minimum(t, t[-1] - t) / 0.4, 0.0, 1.0)
        path.add(
            np.diff(edge**2 * (3.0 - 2.0 * edge) * size * np.sin(2.0 * np.pi * 0.4 * np.expm1(rate * t) / rate))
            / PERIOD
        )
    else:
        raise ValueError(f"held-out motion {kind!r} is unknown; use one of {', '.join(HELD_OUT)}")
    return path.finish(kind, duration)
