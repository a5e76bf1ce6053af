"""Recordings of the blind plant: coloured force noise, an encoder of 10 nm, 1 kHz; and the size of a hidden effect."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.signal import butter, filtfilt, lfilter

from sgms_observer.arrays import Floats
from sim_plant.blind import kernel, slots
from sim_plant.blind.hidden_effect import Around, Hidden, Kind, Maker
from sim_plant.blind.stage import PERIOD, Motion

NOISE_SHARE = 0.01
"""Rms of the force noise as a share of the Coulomb force."""
FORCE_BAND = 100.0
"""Hz; what is hidden counts as a force only below this: 1 kHz samples of position show no force much above."""

PEAK = 0.995
"""Quantile of the hidden force's magnitude that counts as its peak: 150 ms of 30 s may lie above."""
ROUNDS = 8
CLOSE = 0.05
VISIBLE = 0.5


@dataclass(frozen=True)
class Track:
    """One axis of one recording, one entry per sample.

    Attributes:
        position: measured [m].
        effort: commanded by the controller and held until the next sample [N].
        reference: set-point [m].
        reference_velocity: its velocity [m/s].
        true_position: without encoder [m]; sealed.
        true_velocity: sealed [m/s].
        true_acceleration: mean until the next sample; sealed [m/s^2].
        hidden_force: force a perfect nominal model would miss, mean until the next sample; sealed [N].
    """

    position: Floats
    effort: Floats
    reference: Floats
    reference_velocity: Floats
    true_position: Floats
    true_velocity: Floats
    true_acceleration: Floats
    hidden_force: Floats

    @property
    def time(self) -> Floats:
        """Return the sample times [s]."""
        return np.asarray(PERIOD * np.arange(self.position.size), dtype=np.float64)


def coloured_noise(count: int, corner: float, white_share: float, rng: Generator) -> Floats:
    """Return noise of unit rms: first-order below ``corner`` [Hz], with a white part.

    Args:
        count: number of samples at 1 kHz.
        corner: corner frequency [Hz].
        white_share: share of the variance that is white.
        rng: source of chance.
    """
    keep = np.exp(-2.0 * np.pi * corner * PERIOD)
    red = lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], rng.standard_normal(count))
    white = rng.standard_normal(count)
    return np.asarray(np.sqrt(1.0 - white_share) * red + np.sqrt(white_share) * white, dtype=np.float64)


def record(
    hidden: Hidden, motion: Motion, noise: Floats, rng: Generator, other: Track | None = None, steps: int = kernel.STEPS
) -> Track:
    """Run the plant once.

    Args:
        hidden: the stage and what is hidden in it.
        motion: reference.
        noise: force noise of unit rms, one entry per sample.
        rng: chance of effects that have no law.
        other: the second axis's recording, for a coupling.
        steps: integration steps per sample (100 is 10 us).
    """
    around = Around(
        motion.time, rng, other.true_position if other else None, other.true_acceleration if other else None
    )
    stage, count = hidden.true, motion.position.size
    flat = np.ones(count)
    hidden_series = hidden.force(around) if hidden.force else np.zeros(count)
    level = hidden.level(around) if hidden.level else flat
    viscous = hidden.viscous(around) if hidden.viscous else flat
    vector = hidden.vector()
    out = kernel.run(
        motion.position,
        motion.velocity,
        motion.acceleration,
        PERIOD,
        stage.mass,
        stage.springs,
        np.array(stage.shares),
        stage.curve,
        hidden.known.gains,
        vector,
        hidden_series + NOISE_SHARE * stage.coulomb_force * noise,
        level,
        viscous,
        steps,
    )
    force = out[:, kernel.HIDDEN] + hidden_series
    if vector[slots.ENCODER_A] != 0.0 or vector[slots.RESOLUTION] != slots.NOMINAL_RESOLUTION:
        error = out[:, kernel.SHOWN] - out[:, kernel.TRUE_X]
        bend = np.gradient(np.gradient(error, PERIOD), PERIOD)
        force = force - stage.mass * filtfilt(*butter(2, 2.0 * PERIOD * FORCE_BAND), bend)
    return Track(
        position=out[:, kernel.SHOWN],
        effort=out[:, kernel.EFFORT],
        reference=motion.position,
        reference_velocity=motion.velocity,
        true_position=out[:, kernel.TRUE_X],
        true_velocity=out[:, kernel.TRUE_V],
        true_acceleration=out[:, kernel.TRUE_A],
        hidden_force=force,
    )


class NotShownError(ValueError):
    """The motion does not show the effect as it was drawn; draw again."""


def measured_size(track: Track, coulomb_force: float) -> float:
    """Return the peak of the hidden force below ``FORCE_BAND`` (its rms where that is larger: rare, hard blows).

    Args:
        track: recording with the hidden force.
        coulomb_force: unit of the size [N].
    """
    slow = filtfilt(*butter(2, 2.0 * PERIOD * FORCE_BAND), track.hidden_force)
    return max(float(np.quantile(np.abs(slow), PEAK)) / coulomb_force, rms_size(track, coulomb_force))


def rms_size(track: Track, coulomb_force: float) -> float:
    """Return the rms of the hidden force over the recording, as a share of the Coulomb force."""
    return float(np.sqrt(np.mean(track.hidden_force**2))) / coulomb_force


def sized(kind: Kind, make: Maker, size: float, run: Callable[[Hidden], Track]) -> Hidden:
    """Return the effect with the strength that gives it ``size``.

    Args:
        kind: menu entry; where the strength is the size, nothing is run.
        make: the drawn effect.
        size: wanted share of the Coulomb force.
        run: records the main motion with an effect hidden.
    """
    if kind.is_direct:
        return make(size)
    strength, low, high = size, 0.0, np.inf
    for _ in range(ROUNDS):
        hidden = make(strength)
        ratio = size / max(measured_size(run(hidden), hidden.known.coulomb_force), 1.0e-6)
        if abs(ratio - 1.0) < CLOSE:
            break
        low, high = (max(low, strength), high) if ratio > 1.0 else (low, min(high, strength))
        guess = strength * float(np.clip(ratio, 0.2, 5.0))
        if low < guess < high:
            strength = guess
        else:
            strength = float(np.sqrt(max(low, 0.1 * high) * high))
    hidden = make(strength)
    if measured_size(run(hidden), hidden.known.coulomb_force) < VISIBLE * size:
        raise NotShownError(f"{kind.name} cannot be shown by this motion as it was drawn")
    return hidden
