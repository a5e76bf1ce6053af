"""Hidden forces and hidden changes of the friction, in shapes the catalogue does not have."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from sgms_observer.arrays import Floats
from sim_plant.blind import slots as s
from sim_plant.blind.hidden_effect import Around, Hidden, Kind, Maker
from sim_plant.blind.stage import PERIOD, Motion, TrueStage

TRIANGLE_FUNDAMENTAL = 0.9092  # of asin(0.95 sin) / asin(0.95), by quadrature


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
        size = strength * stage.coulomb_force
        return Hidden(stage, stage, {s.POWER_A: size, s.POWER_SPEED: stage.top_speed, s.POWER_EXPONENT: exponent})

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
    return lambda strength: Hidden(
        stage, stage, {s.EDDY_A: strength * stage.coulomb_force, s.EDDY_SPEED: peak, s.EDDY_POWER: power}
    )


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


FORCE_KINDS = (
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


def position_periodic_friction(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Balls entering a race: a rounded triangle over position."""
    pitch, phase = float(np.exp(rng.uniform(np.log(0.006), np.log(0.025)))), rng.uniform(-np.pi, np.pi)

    def make(strength: float) -> Hidden:
        truth = {"pitch": pitch, "share": TRIANGLE_FUNDAMENTAL * strength}
        return Hidden(stage, stage, {s.RIPPLE_A: strength, s.RIPPLE_PITCH: pitch, s.RIPPLE_PHASE: phase}, truth=truth)

    return make


def position_dependent_friction(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A tight place with a flat top and steep edges."""
    place = rng.uniform(-0.5, 0.5) * stage.half_stroke
    half_width = rng.uniform(0.12, 0.25) * stage.half_stroke

    def make(strength: float) -> Hidden:
        entries = {s.SPOT_A: strength, s.SPOT_PLACE: place}
        entries |= {s.SPOT_HALF_WIDTH: half_width, s.SPOT_EDGE: 0.15 * half_width}
        return Hidden(stage, stage, entries, truth={"center": place})

    return make


def asymmetric_coulomb(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Every element slips at another force in the other direction; the strength is half the difference."""
    side = sign(rng)
    return lambda strength: Hidden(stage, stage, {s.SIDED_COULOMB_A: side * strength}, truth={"share": side * strength})


def stribeck(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A second fall of friction at five to fifteen times the known speed, with a long tail instead of a bell."""
    speed, power = stage.knee * rng.uniform(5.0, 15.0), rng.uniform(1.2, 1.8)
    return lambda strength: Hidden(
        stage, stage, {s.WEAKENING_A: strength, s.WEAKENING_SPEED: speed, s.WEAKENING_POWER: power}
    )


def presliding(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Soft elements that the owner never saw: part of the level is reached only after 50 to 300 um."""
    soft = np.sort(np.exp(rng.uniform(np.log(5.0e-5), np.log(3.0e-4), 3)))
    weights = rng.dirichlet(np.full(3, 4.0))

    def make(strength: float) -> Hidden:
        shares = np.concatenate((np.array(stage.shares) * (1.0 - strength), strength * weights))
        slip_deflections = np.concatenate((stage.slip_deflections, soft))
        truth = {"force": strength * stage.coulomb_force}
        return Hidden(stage, stage.with_elements(shares, slip_deflections), truth=truth)

    return make


def dwell_breakaway(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A contact that ages with the logarithm of rest and forgets by sliding; the strength is reached after 2 s."""
    age_time, distance = rng.uniform(0.05, 0.2), float(np.exp(rng.uniform(np.log(2.0e-5), np.log(1.5e-4))))
    return lambda strength: Hidden(stage, stage, {s.AGE_A: strength, s.AGE_TIME: age_time, s.AGE_DISTANCE: distance})


def frictional_lag(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Sliding friction that lags behind a pronounced Stribeck curve; in half of the cases through slow attraction."""
    drop, is_attraction = rng.uniform(0.4, 0.7), rng.random() < 0.5
    knee = stage.knee * 3.0
    known = replace(
        stage,
        model="sgms",
        static_force=(1.0 + drop) * stage.coulomb_force,
        knee=knee,
        attraction=stage.coulomb_force / 2.0e-4,
    )

    def make(strength: float) -> Hidden:
        time = 0.3 * strength
        if is_attraction:
            true = replace(known, attraction=stage.coulomb_force / time)
            return Hidden(known, true, {s.LAG_TIME: s.LAG_BY_ATTRACTION}, truth={"attraction_rate": true.attraction})
        return Hidden(known, known, {s.LAG_TIME: time})

    return make


def thermal_drift(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Warm-up by the friction's own power: first order, but driven by the motion."""
    side = -1.0 if rng.random() < 0.8 else 1.0
    time = rng.uniform(5.0, 14.0)
    power = 1.3 * stage.coulomb_force * float(np.mean(np.abs(motion.velocity)))
    return lambda strength: Hidden(stage, stage, {s.HEAT_A: side * strength, s.HEAT_TIME: time, s.HEAT_POWER: power})


def wear_step(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Friction that changes linearly over a short stretch of travel and stays."""
    travel = float(np.sum(np.abs(motion.velocity)) * PERIOD)
    start, length = rng.uniform(0.2, 0.45) * travel, rng.uniform(0.02, 0.1) * travel
    side = sign(rng)

    def make(strength: float) -> Hidden:
        truth = {"share": side * strength, "travel": start + 0.5 * length}
        return Hidden(
            stage, stage, {s.WEAR_A: side * strength, s.WEAR_TRAVEL: start, s.WEAR_LENGTH: length}, truth=truth
        )

    return make


def load_dependent_friction(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """Friction that rises a little faster than the carried inertial load."""
    return lambda strength: Hidden(stage, stage, {s.LOAD_A: strength, s.LOAD_ACCELERATION: stage.top_acceleration})


FRICTION_KINDS = (
    Kind("position_periodic_friction", position_periodic_friction, is_direct=True),
    Kind("position_dependent_friction", position_dependent_friction, is_direct=True),
    Kind("asymmetric_coulomb", asymmetric_coulomb, is_direct=True),
    Kind("stribeck", stribeck, is_direct=True),
    Kind("presliding", presliding, is_direct=True),
    Kind("dwell_breakaway", dwell_breakaway, is_direct=True),
    Kind("frictional_lag", frictional_lag),
    Kind("thermal_drift", thermal_drift),
    Kind("wear_step", wear_step, is_direct=True),
    Kind("load_dependent_friction", load_dependent_friction),
)
