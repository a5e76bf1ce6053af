"""Hidden effects that no catalogue name fits: the workflow has to say that it does not know them."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from sim_plant.blind import slots as s
from sim_plant.blind.hidden_effect import Around, Floats, Hidden, Kind, Maker
from sim_plant.blind.motion import PERIOD, Motion
from sim_plant.blind.stage import TrueStage


def vibration_bursts(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Bursts of outside vibration at irregular times lower the friction while they last."""

    def make(strength: float) -> Hidden:
        def series(around: Around) -> Floats:
            factor = np.ones(around.time.size)
            moment = around.rng.uniform(0.3, 1.2)
            while moment < around.time[-1]:
                length = around.rng.uniform(0.25, 1.0)
                away = np.abs(around.time - moment - 0.5 * length) - 0.5 * length
                factor -= strength / (1.0 + np.exp(np.clip(away / 0.01, -50.0, 50.0)))
                moment += length + around.rng.exponential(1.5) + 0.2
            return np.clip(factor, 0.1, None)

        return Hidden(stage, stage, level=series)

    return make


def direction_memory(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Friction that grows with how long the stage has gone the same way, over seconds."""
    time = rng.uniform(0.8, 2.5)

    def make(strength: float) -> Hidden:
        return Hidden(stage, stage, {s.MEMORY_A: strength, s.MEMORY_TIME: time})

    return make


def cover_stick_slip(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A sheet cover that is dragged along by its spring and jumps: a saw-tooth over millimetres of travel."""
    jump = rng.uniform(0.002, 0.008)

    def make(strength: float) -> Hidden:
        stick = strength * stage.coulomb_force
        entries = {s.COVER_STICK: stick, s.COVER_SLIP: 0.3 * stick, s.COVER_STIFFNESS: 0.7 * stick / jump}
        return Hidden(stage, stage, entries)

    return make


def random_walk_force(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A force that wanders without a law."""
    time = rng.uniform(0.5, 2.0)

    def make(strength: float) -> Hidden:
        def series(around: Around) -> Floats:
            keep = np.exp(-PERIOD / time)
            kicks = around.rng.standard_normal(around.time.size) * np.sqrt(1.0 - keep**2)
            return np.asarray(0.5 * strength * stage.coulomb_force * lfilter([1.0], [1.0, -keep], kicks))

        return Hidden(stage, stage, force=series)

    return make


def magnetic_hysteresis(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Iron in the motor: the force depends on where the effort came from."""
    width = rng.uniform(0.8, 1.5)

    def make(strength: float) -> Hidden:
        return Hidden(stage, stage, {s.IRON_SHARE: strength / width, s.IRON_WIDTH: width * stage.coulomb_force})

    return make


def viscosity_spikes(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Lumps of cold grease: the viscous coefficient jumps at irregular times and decays within a second."""

    def make(strength: float) -> Hidden:
        def series(around: Around) -> Floats:
            factor = np.ones(around.time.size)
            moment = around.rng.uniform(0.2, 1.0)
            while moment < around.time[-1]:
                since = around.time - moment
                fade = np.exp(-np.clip(since, 0.0, None) / around.rng.uniform(0.3, 1.0))
                factor += np.where(since > 0.0, 4.0 * strength * around.rng.uniform(0.5, 1.5) * fade, 0.0)
                moment += around.rng.exponential(2.0) + 0.4
            return factor

        return Hidden(stage, stage, viscous=series)

    return make


def grease_ridge(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Grease pushed up where the stage last rested makes it drag there again."""
    width = rng.uniform(0.05, 0.12) * stage.half_stroke

    def make(strength: float) -> Hidden:
        return Hidden(stage, stage, {s.RIDGE_A: 1.5 * strength, s.RIDGE_WIDTH: width})

    return make


def sweeping_disturbance(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A machine nearby that speeds up and slows down: no fixed frequency, not in step with anything."""
    low, high, time = rng.uniform(2.0, 4.0), rng.uniform(8.0, 14.0), rng.uniform(3.0, 7.0)

    def make(strength: float) -> Hidden:
        def series(around: Around) -> Floats:
            start = around.rng.uniform(0.0, 2.0 * np.pi)
            wander = np.cumsum(around.rng.standard_normal(around.time.size)) * np.sqrt(PERIOD) * 0.3
            frequency = low + (high - low) * (0.5 + 0.5 * np.sin(2.0 * np.pi * around.time / time + start + wander))
            return np.asarray(strength * stage.coulomb_force * np.sin(2.0 * np.pi * np.cumsum(frequency) * PERIOD))

        return Hidden(stage, stage, force=series)

    return make


KINDS = (
    Kind("vibration_bursts", vibration_bursts, is_inside=False),
    Kind("direction_memory", direction_memory, is_inside=False),
    Kind("cover_stick_slip", cover_stick_slip, is_inside=False),
    Kind("random_walk_force", random_walk_force, is_inside=False),
    Kind("magnetic_hysteresis", magnetic_hysteresis, is_inside=False),
    Kind("viscosity_spikes", viscosity_spikes, is_inside=False),
    Kind("grease_ridge", grease_ridge, is_inside=False),
    Kind("sweeping_disturbance", sweeping_disturbance, is_inside=False),
)
