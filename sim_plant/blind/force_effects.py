"""Hidden forces of position, velocity and time, drawn in shapes the catalogue does not have."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from sim_plant.blind import slots as s
from sim_plant.blind.hidden_effect import Around, Floats, Hidden, Kind, Maker
from sim_plant.blind.motion import Motion
from sim_plant.blind.stage import TrueStage


def sign(rng: Generator) -> float:
    """Return plus or minus one by chance."""
    return 1.0 if rng.random() < 0.5 else -1.0


def cogging(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Two harmonics of a magnet pitch."""
    pitch = float(np.exp(rng.uniform(np.log(0.006), np.log(0.03))))
    phase, phase2, second = rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi), rng.uniform(0.15, 0.45)

    def make(strength: float) -> Hidden:
        force = strength * stage.coulomb_force
        entries = {s.COGGING_A: force, s.COGGING_PITCH: pitch, s.COGGING_PHASE: phase}
        entries |= {s.COGGING_A2: second * force, s.COGGING_PHASE2: phase2}
        return Hidden(stage, stage, entries, truth={"pitch": pitch, "amplitude": force})

    return make


def spring(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A hardening spring: at the stroke's end it carries 10 to 30 per cent more than a straight one."""
    rest, harder = rng.uniform(-0.3, 0.3) * stage.half_stroke, rng.uniform(0.1, 0.3)

    def make(strength: float) -> Hidden:
        stiffness = strength * stage.coulomb_force / stage.half_stroke
        entries = {s.SPRING_K1: stiffness, s.SPRING_K3: harder * stiffness / stage.half_stroke**2, s.SPRING_REST: rest}
        stretch = motion.position - rest
        force = entries[s.SPRING_K1] * stretch + entries[s.SPRING_K3] * stretch**3
        return Hidden(stage, stage, entries, truth={"stiffness": float(np.polyfit(stretch, force, 1)[0])})

    return make


def offset(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A constant force."""
    side = sign(rng)

    def make(strength: float) -> Hidden:
        force = side * strength * stage.coulomb_force
        return Hidden(stage, stage, {s.OFFSET: force}, truth={"force": force})

    return make


def asymmetric_viscous(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A seal that drags more in one direction, slightly bent over speed."""
    side = sign(rng)

    def make(strength: float) -> Hidden:
        force = side * strength * stage.coulomb_force
        share = np.abs(motion.velocity) / stage.top_speed
        shape = 1.2 * share / (1.0 + 0.2 * share)
        truth = {"coefficient": float(force * shape.dot(share) / share.dot(share) / stage.top_speed)}
        return Hidden(stage, stage, {s.SIDED_VISCOUS_A: force, s.SIDED_VISCOUS_SPEED: stage.top_speed}, truth=truth)

    return make


def nonlinear_viscous(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Shear-thinning lubricant |v|^n on top of the linear one."""
    exponent = float(rng.uniform(0.3, 0.6))

    def make(strength: float) -> Hidden:
        entries = {
            s.POWER_A: strength * stage.coulomb_force,
            s.POWER_SPEED: stage.top_speed,
            s.POWER_EXPONENT: exponent,
        }
        return Hidden(stage, stage, entries)

    return make


def quadratic_drag(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Air drag with a part of third order."""

    def make(strength: float) -> Hidden:
        force = strength * stage.coulomb_force
        share = np.abs(motion.velocity) / stage.top_speed
        square = share * share
        mean_share = float((square * (0.9 + 0.1 * share)).dot(square) / square.dot(square))
        truth = {"coefficient": force * mean_share / stage.top_speed**2}
        return Hidden(stage, stage, {s.DRAG_A: force, s.DRAG_SPEED: stage.top_speed}, truth=truth)

    return make


def eddy_current(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A brake whose force falls off otherwise than Kloss has it."""
    peak, power = rng.uniform(0.12, 0.35) * stage.top_speed, rng.uniform(1.7, 2.2)

    def make(strength: float) -> Hidden:
        entries = {s.EDDY_A: strength * stage.coulomb_force, s.EDDY_SPEED: peak, s.EDDY_POWER: power}
        return Hidden(stage, stage, entries)

    return make


def periodic_disturbance(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A pump: a sine with its third harmonic, in step with the recording's start."""
    frequency, phase = float(np.exp(rng.uniform(np.log(2.0), np.log(25.0)))), rng.uniform(-np.pi, np.pi)

    def make(strength: float) -> Hidden:
        force = strength * stage.coulomb_force

        def series(around: Around) -> Floats:
            turn = 2.0 * np.pi * frequency * around.time + phase
            return np.asarray(force * (np.cos(turn) + 0.2 * np.cos(3.0 * turn)))

        return Hidden(stage, stage, force=series, truth={"frequency": frequency, "amplitude": force})

    return make


def cross_axis_coupling(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """The other axis pushes as it accelerates, more at one end of its stroke."""
    side = sign(rng)

    def make(strength: float) -> Hidden:
        inertia = side * strength * stage.coulomb_force

        def series(around: Around) -> Floats:
            if around.other_position is None or around.other_acceleration is None:
                return np.zeros(around.time.size)
            lever = 1.0 + 0.25 * around.other_position / np.max(np.abs(around.other_position))
            return np.asarray(inertia * around.other_acceleration * lever)

        return Hidden(stage, stage, force=series, truth={"inertia": inertia})

    return make


def mass_error(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """More (or less) mass than the owner weighed; the strength is the share of the mass."""
    side = sign(rng)

    def make(strength: float) -> Hidden:
        extra = side * strength * stage.mass
        return Hidden(stage, stage, {s.EXTRA_MASS: extra}, truth={"mass": extra})

    return make


KINDS = (
    Kind("cogging", cogging),
    Kind("spring", spring),
    Kind("offset", offset, is_direct=True),
    Kind("asymmetric_viscous", asymmetric_viscous),
    Kind("nonlinear_viscous", nonlinear_viscous),
    Kind("quadratic_drag", quadratic_drag),
    Kind("eddy_current", eddy_current),
    Kind("periodic_disturbance", periodic_disturbance),
    Kind("cross_axis_coupling", cross_axis_coupling, needs_other_axis=True),
    Kind("mass_error", mass_error, is_direct=True, smallest=0.1),
)
