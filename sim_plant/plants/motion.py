"""References: a rich one for the fitted recording, and point-to-point steps with dwells for the held-out ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from sgms_observer.arrays import Floats
from sim_plant.plants.machine import Machine

KINDS = ("rich", "steps")
GROUPS = ((0.07, 0.17, 2), (0.35, 0.9, 3), (1.6, 8.0, 4))
"""Lowest and highest frequency [Hz] and number of the tones that use the stroke, the speed, the acceleration."""


@dataclass(frozen=True)
class Motion:
    """A reference at the controller's rate.

    Attributes:
        position: [m].
        velocity: [m/s].
        acceleration: [m/s^2].
    """

    position: Floats
    velocity: Floats
    acceleration: Floats


def make_motion(machine: Machine, kind: str, duration: float, rng: Generator) -> Motion:
    """Return a reference within the machine's stroke, speed and acceleration; it begins at rest at a random place.

    Args:
        machine: gives the limits and the rate.
        kind: ``rich`` or ``steps``.
        duration: [s].
        rng: source of chance.

    Raises:
        ValueError: for another kind.
    """
    if kind not in KINDS:
        raise ValueError(f"motion {kind!r} is unknown; use one of {', '.join(KINDS)}")
    period = 1.0 / machine.loop_rate
    count = round(duration * machine.loop_rate)
    position = _rich(machine, count, period, rng) if kind == "rich" else _steps(machine, count, period, rng)
    velocity = np.gradient(position, period)
    return Motion(position, velocity, np.gradient(velocity, period))


def _rich(machine: Machine, count: int, period: float, rng: Generator) -> Floats:
    """Return slow tones that use the stroke, middle ones for the speed, fast ones for the acceleration.

    The time of the tones runs slowly, or rests, at random times.
    """
    inner = period * np.concatenate(([0.0], np.cumsum(_pace(count, period, rng))[:-1]))
    limits = np.array([0.95 * machine.half_stroke, machine.speed, machine.acceleration])
    groups = np.zeros((len(GROUPS), 3, count))
    for group, (order, (lowest, highest, tones)) in zip(groups, enumerate(GROUPS), strict=True):
        for omega in 2.0 * np.pi * np.geomspace(lowest, highest, tones) * rng.uniform(0.9, 1.1, tones):
            group[0] += rng.uniform(0.7, 1.0) / omega**order * np.sin(omega * inner + rng.uniform(0.0, 2.0 * np.pi))
        group[1] = np.gradient(group[0], period)
        group[2] = np.gradient(group[1], period)
    weights = np.array([0.6 * limits[i] / _peaks(group)[i] for i, group in enumerate(groups)])
    for _ in range(4):  # until each group fills what the others leave of its limit
        weights *= limits / _peaks(np.tensordot(weights, groups, 1))
    path = np.tensordot(weights, groups, 1)
    middle = 0.5 * (path[0].max() + path[0].min())
    return np.asarray((path[0] - middle) * np.min(limits / _peaks(path)))


def _peaks(path: Floats) -> Floats:
    """Return half of the range [m], the largest speed [m/s] and the largest acceleration [m/s^2] of the three rows."""
    return np.array([0.5 * np.ptp(path[0]), np.max(np.abs(path[1])), np.max(np.abs(path[2]))])


def _pace(count: int, period: float, rng: Generator) -> Floats:
    """Return how fast the time of the tones runs: 0 at the start and during dwells, slow during slow parts, else 1."""
    t = period * np.arange(count)
    pace = _blend(t / 0.5)
    at = 2.0
    while at < t[-1]:
        slow = 0.0 if rng.random() < 0.6 else float(np.exp(rng.uniform(np.log(0.03), np.log(0.3))))
        wait = float(np.exp(rng.uniform(np.log(0.1), np.log(1.5))))
        edge = 0.25
        part = slice(int(at / period), int((at + wait + 2.0 * edge) / period) + 1)
        dip = _blend((t[part] - at) / edge) * _blend((at + wait + 2.0 * edge - t[part]) / edge)
        pace[part] *= 1.0 - (1.0 - slow) * dip
        at += wait + 2.0 * edge + rng.uniform(1.0, 4.0)
    return pace


def _steps(machine: Machine, count: int, period: float, rng: Generator) -> Floats:
    """Return minimum-jerk moves of random length with dwells between."""
    amplitude = 0.9 * machine.half_stroke
    place = rng.uniform(-amplitude, amplitude)
    pieces = [np.full(round(0.1 / period), place)]
    total = pieces[0].size
    while total < count:
        goal = rng.uniform(-amplitude, amplitude)
        if rng.random() < 0.3:  # a short one
            goal = float(
                np.clip(
                    place + rng.choice([-1.0, 1.0]) * 0.05 * amplitude * rng.uniform(0.2, 1.0), -amplitude, amplitude
                )
            )
        distance = abs(goal - place)
        fastest = max(1.875 * distance / machine.speed, np.sqrt(5.7735 * distance / machine.acceleration), 0.05)
        samples = int(fastest * rng.uniform(1.0, 2.0) / period)
        share = np.arange(1, samples + 1) / samples
        blend = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        pieces.append(place + (goal - place) * blend)
        pieces.append(np.full(int(rng.choice([0.05, 0.3, 1.0]) * rng.uniform(0.8, 1.2) / period), goal))
        total += pieces[-1].size + samples
        place = goal
    return np.asarray(np.concatenate(pieces)[:count])


def _blend(x: NDArray[np.floating[Any]]) -> Floats:
    """Return 0 below 0, 1 above 1 and a polynomial with two continuous derivatives between."""
    x = np.clip(x, 0.0, 1.0)
    return np.asarray(x**3 * (10.0 - 15.0 * x + 6.0 * x**2), dtype=np.float64)
