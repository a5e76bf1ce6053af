"""Hidden faults of the drive, the mechanics and the encoder."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from sim_plant.blind import slots as s
from sim_plant.blind.hidden_effect import Hidden, Kind, Maker
from sim_plant.blind.motion import Motion
from sim_plant.blind.stage import TrueStage


def actuator_delay(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """The effort arrives later; the strength is scaled until what is missing has the size."""

    def make(strength: float) -> Hidden:
        delay = 5.0e-3 * strength
        return Hidden(stage, stage, {s.DELAY: delay}, truth={"delay": delay})

    return make


def actuator_gain(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Less (or more) force than commanded; the strength is the share that is missing."""
    side = -1.0 if rng.random() < 0.7 else 1.0

    def make(strength: float) -> Hidden:
        gain = 1.0 + side * strength
        return Hidden(stage, stage, {s.GAIN: gain}, truth={"gain": gain})

    return make


def actuator_saturation(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A limit that bends in, lower than the motion asks for."""
    demand = stage.mass * motion.acceleration + stage.viscous * motion.velocity
    demand = demand + stage.coulomb_force * np.sign(motion.velocity)
    asked = float(np.quantile(np.abs(demand), 0.995))

    def make(strength: float) -> Hidden:
        limit = max(1.5 * asked * float(np.exp(-2.0 * strength)), 1.5 * stage.coulomb_force)
        return Hidden(stage, stage, {s.LIMIT: limit}, truth={"limit": 1.03 * limit})

    return make


def actuator_dead_zone(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Small efforts are lost, with a soft edge; the catalogue's width is compared with the mean loss."""
    demand = stage.mass * motion.acceleration + stage.viscous * motion.velocity
    demand = np.abs(demand + stage.coulomb_force * np.sign(motion.velocity))[motion.velocity != 0.0]

    def make(strength: float) -> Hidden:
        band = strength * stage.coulomb_force
        loss = band + demand - np.sqrt(demand**2 + band**2)
        return Hidden(stage, stage, {s.DEAD_BAND: band}, truth={"width": float(np.mean(loss))})

    return make


def flexible_mode(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A second mass on a damped spring, part of the known total."""
    frequency, damping = float(np.exp(rng.uniform(np.log(20.0), np.log(55.0)))), rng.uniform(0.02, 0.06)

    def make(strength: float) -> Hidden:
        mass = min(strength, 0.35) * stage.mass
        omega = 2.0 * np.pi * frequency
        entries = {s.LINK_MASS: mass, s.LINK_STIFFNESS: mass * omega**2, s.LINK_DAMPING: 2.0 * damping * omega * mass}
        return Hidden(stage, stage, entries, truth={"frequency": frequency, "mass": mass})

    return make


def backlash(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Play between the carriage and a light load that carries a share (the strength) of the friction."""
    gap, share = float(np.exp(rng.uniform(np.log(2.0e-5), np.log(1.2e-4)))), rng.uniform(0.02, 0.05)

    def make(strength: float) -> Hidden:
        mass = share * stage.mass
        omega = 2.0 * np.pi * 300.0
        entries = {s.LINK_MASS: mass, s.LINK_STIFFNESS: mass * omega**2, s.LINK_DAMPING: 0.8 * omega * mass}
        entries |= {s.LINK_GAP: gap, s.LINK_FRICTION_SHARE: strength}
        return Hidden(stage, stage, entries, truth={"gap": gap, "share": strength})

    return make


def encoder_interpolation_error(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Two harmonics of the grating in what the encoder shows."""
    pitch = float(rng.choice([2.0e-5, 4.0e-5, 1.0e-4]))
    phase, second = rng.uniform(-np.pi, np.pi), rng.uniform(0.1, 0.3)

    def make(strength: float) -> Hidden:
        amplitude = min(strength * 2.0e-6, 0.03 * pitch)
        entries = {
            s.ENCODER_A: amplitude,
            s.ENCODER_PITCH: pitch,
            s.ENCODER_PHASE: phase,
            s.ENCODER_A2: second * amplitude,
        }
        return Hidden(stage, stage, entries, truth={"pitch": pitch, "amplitude": amplitude})

    return make


def quantisation(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A coarser encoder than its owner believes."""

    def make(strength: float) -> Hidden:
        step = min(max(strength * 5.0e-6, 5.0e-8), 2.0e-5)
        return Hidden(stage, stage, {s.RESOLUTION: step}, truth={"resolution": step})

    return make


KINDS = (
    Kind("actuator_delay", actuator_delay),
    Kind("actuator_gain", actuator_gain, is_direct=True, smallest=0.1),
    Kind("actuator_saturation", actuator_saturation),
    Kind("actuator_dead_zone", actuator_dead_zone, is_direct=True),
    Kind("flexible_mode", flexible_mode),
    Kind("backlash", backlash, is_direct=True),
    Kind("encoder_interpolation_error", encoder_interpolation_error),
    Kind("quantisation", quantisation),
)
