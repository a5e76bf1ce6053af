"""The menu: hidden effects by name, one or two of them together; here those of the drive, and those without a name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator
from scipy.signal import lfilter

from sgms_observer.arrays import Floats
from sim_plant.blind import slots as s
from sim_plant.blind.force_effects import FORCE_KINDS, FRICTION_KINDS
from sim_plant.blind.hidden_effect import Around, Hidden, Kind, Maker, Series
from sim_plant.blind.stage import PERIOD, Motion, TrueStage

NOTHING = "nothing"
"""Name of a case with nothing hidden."""

PAIRS = (
    ("cogging", "asymmetric_coulomb"),
    ("cogging", "actuator_delay"),
    ("position_periodic_friction", "asymmetric_viscous"),
    ("position_dependent_friction", "quadratic_drag"),
    ("spring", "stribeck"),
    ("spring", "thermal_drift"),
    ("offset", "eddy_current"),
    ("periodic_disturbance", "position_dependent_friction"),
    ("flexible_mode", "cogging"),
    ("wear_step", "asymmetric_coulomb"),
    ("actuator_dead_zone", "spring"),
    ("thermal_drift", "cogging"),
    ("presliding", "offset"),
    ("load_dependent_friction", "periodic_disturbance"),
)
"""Effects that are hidden together: no two of one pair are confusable with each other."""


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
        entries = {s.ENCODER_A: amplitude, s.ENCODER_A2: second * amplitude}
        entries |= {s.ENCODER_PITCH: pitch, s.ENCODER_PHASE: phase}
        return Hidden(stage, stage, entries, truth={"pitch": pitch, "amplitude": amplitude})

    return make


def quantisation(stage: TrueStage, motion: Motion, rng: Generator) -> Maker:
    """A coarser encoder than in the file of its owner."""

    def make(strength: float) -> Hidden:
        step = min(max(strength * 5.0e-6, 5.0e-8), 2.0e-5)
        return Hidden(stage, stage, {s.RESOLUTION: step}, truth={"resolution": step})

    return make


PATH_KINDS = (
    Kind("actuator_delay", actuator_delay),
    Kind("actuator_gain", actuator_gain, is_direct=True, smallest=0.1),
    Kind("actuator_saturation", actuator_saturation),
    Kind("actuator_dead_zone", actuator_dead_zone, is_direct=True),
    Kind("flexible_mode", flexible_mode),
    Kind("backlash", backlash, is_direct=True),
    Kind("encoder_interpolation_error", encoder_interpolation_error),
    Kind("quantisation", quantisation),
)


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
    return lambda strength: Hidden(stage, stage, {s.MEMORY_A: strength, s.MEMORY_TIME: time})


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
    return lambda strength: Hidden(
        stage, stage, {s.IRON_SHARE: strength / width, s.IRON_WIDTH: width * stage.coulomb_force}
    )


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
    return lambda strength: Hidden(stage, stage, {s.RIDGE_A: 1.5 * strength, s.RIDGE_WIDTH: width})


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


OUTSIDE_KINDS = (
    Kind("vibration_bursts", vibration_bursts, is_inside=False),
    Kind("direction_memory", direction_memory, is_inside=False),
    Kind("cover_stick_slip", cover_stick_slip, is_inside=False),
    Kind("random_walk_force", random_walk_force, is_inside=False),
    Kind("magnetic_hysteresis", magnetic_hysteresis, is_inside=False),
    Kind("viscosity_spikes", viscosity_spikes, is_inside=False),
    Kind("grease_ridge", grease_ridge, is_inside=False),
    Kind("sweeping_disturbance", sweeping_disturbance, is_inside=False),
)


KINDS: dict[str, Kind] = {kind.name: kind for kind in (*FORCE_KINDS, *FRICTION_KINDS, *PATH_KINDS, *OUTSIDE_KINDS)}
INSIDE = tuple(name for name, kind in KINDS.items() if kind.is_inside)
"""Effects the catalogue has a name for."""
OUTSIDE = tuple(name for name, kind in KINDS.items() if not kind.is_inside)
"""Effects it has none for."""


def names(effect: str) -> tuple[str, ...]:
    """Return the effects in ``effect``: none, one, or two joined by ``+``.

    Raises:
        ValueError: for a name that is not on the menu.
    """
    if effect == NOTHING:
        return ()
    parts = tuple(effect.split("+"))
    strange = [part for part in parts if part not in KINDS]
    if strange:
        raise ValueError(
            f"hidden effect {strange[0]!r} is not on the menu; use {NOTHING}, {', '.join(KINDS)}, or two joined by +"
        )
    return parts


def together(first: Hidden, second: Hidden) -> Hidden:
    """Return both effects in one plant; ``second`` was drawn for the stage of ``first``."""

    def both(one: Series | None, other: Series | None, join: Callable[[Floats, Floats], Floats]) -> Series | None:
        if one is None or other is None:
            return one or other
        left, right = one, other

        def series(around: Around) -> Floats:
            return join(left(around), right(around))

        return series

    return Hidden(
        known=first.known,
        true=second.true if second.true is not second.known else first.true,
        slots=first.slots | second.slots,
        force=both(first.force, second.force, lambda a, b: a + b),
        level=both(first.level, second.level, lambda a, b: a * b),
        viscous=both(first.viscous, second.viscous, lambda a, b: a * b),
    )
