"""One recording of a machine, with what is hidden in it, and its rosbag2 with the topics that the diagnosis reads."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.random import Generator
from scipy.signal import butter, lfilter, sosfiltfilt

from sgms_observer.arrays import Floats
from sgms_observer.bags.writer import BagWriter
from sim_plant.plants import kernel
from sim_plant.plants.contact import LAWS, rested_state
from sim_plant.plants.effects import Hidden, Peaks, draw_hidden, outside_force
from sim_plant.plants.machine import Machine
from sim_plant.plants.motion import make_motion

LARGEST_STEP = 2.5e-5  # s
FORCE_BAND = 100.0
"""Hidden forces count below this frequency [Hz], or below 0.4 of the log's rate."""
CALIBRATION_DURATION = 15.0  # s
LARGEST_LOAD_PART = 0.6
"""Largest share of the mass behind the spring of a flexible mode."""


@dataclass(frozen=True)
class Recording:
    """What the log holds, and the truth beside it. One entry per logged sample.

    Attributes:
        time: [s].
        position: measured [m].
        effort: logged [N].
        reference: [m].
        reference_velocity: [m/s].
        true_velocity: sealed [m/s].
        friction: contact, viscous and hidden force together, mean until the next sample; sealed [N].
        hidden_force: force a perfect model without the effects misses, mean until the next sample; sealed [N].
        hidden: what was hidden; sealed.
    """

    time: Floats
    position: Floats
    effort: Floats
    reference: Floats
    reference_velocity: Floats
    true_velocity: Floats
    friction: Floats
    hidden_force: Floats
    hidden: Hidden


def record(
    machine: Machine,
    effects: Sequence[str] = (),
    share: float = 0.15,
    seed: int = 0,
    kind: str = "rich",
    duration: float = 30.0,
) -> Recording:
    """Make one recording.

    Args:
        machine: see ``machine.draw``.
        effects: names of what is hidden, see ``effects.KINDS``.
        share: size of each as a share of the Coulomb force.
        seed: of motion and noise; the effects' chance comes from the machine's seed, so that two recordings of one
            machine hide the same.
        kind: of motion, ``rich`` or ``steps``.
        duration: [s].
    """
    return run(machine, hidden_in(machine, tuple(effects), share), seed, kind, duration)


@lru_cache(maxsize=64)
def _peaks_of(machine: Machine) -> Peaks:
    """Return what a learning motion of the machine, drawn from its seed, reaches with nothing hidden."""
    empty = run(machine, Hidden(), machine.seed, "rich", CALIBRATION_DURATION)
    period = 1.0 / machine.log_rate
    velocity = _low_passed(empty.true_velocity, machine.log_rate)
    effort = _low_passed(empty.effort, machine.log_rate)
    signals = (velocity, np.gradient(velocity, period), np.gradient(effort, period))
    return Peaks(*(float(np.quantile(np.abs(one), 0.995)) for one in signals))


@lru_cache(maxsize=64)
def hidden_in(machine: Machine, effects: tuple[str, ...], share: float) -> Hidden:
    """Return what is hidden in a machine, each effect as large as its share of the Coulomb force.

    Args:
        machine: the machine; its seed is that of the effects.
        effects: names.
        share: of the Coulomb force.
    """
    sizes = dict.fromkeys(effects, share)
    if not effects:
        return draw_hidden(machine, Peaks(1.0, 1.0, 1.0), sizes, machine.seed)
    peaks = _peaks_of(machine)
    if "flexible_mode" in effects:
        sizes["flexible_mode"] = _flexible_part(machine, peaks, share)
    return draw_hidden(machine, peaks, sizes, machine.seed)


def _flexible_part(machine: Machine, peaks: Peaks, share: float) -> float:
    """Return the part of the mass behind the spring whose missed force has the size; at most ``LARGEST_LOAD_PART``."""
    part = 0.2
    for _ in range(4):
        hidden = draw_hidden(machine, peaks, {"flexible_mode": part}, machine.seed)
        size = force_size(run(machine, hidden, machine.seed, "rich", CALIBRATION_DURATION), machine)
        part = min(max(part * share * machine.coulomb_force / size, 0.25 * part), 4.0 * part, LARGEST_LOAD_PART)
    return part


def force_size(recording: Recording, machine: Machine) -> float:
    """Return the 99.5 % quantile of the magnitude of the hidden force below ``FORCE_BAND`` [N]."""
    return float(np.quantile(np.abs(_low_passed(recording.hidden_force, machine.log_rate)), 0.995))


def _low_passed(values: Floats, rate: float) -> Floats:
    """Return ``values`` without what lies above the force band, without phase."""
    corner = min(FORCE_BAND, 0.4 * rate)
    return np.asarray(sosfiltfilt(butter(4, 2.0 * corner / rate, output="sos"), values))


def run(machine: Machine, hidden: Hidden, seed: int, kind: str, duration: float) -> Recording:
    """Run a machine with what is hidden in it.

    Args:
        machine: the machine.
        hidden: see ``effects.draw_hidden``.
        seed: of motion and noise.
        kind: of motion.
        duration: [s].
    """
    chance = np.random.default_rng([seed, machine.seed, zlib.crc32(kind.encode())])
    motion_chance, noise_chance, pulse_chance = chance.spawn(3)
    motion = make_motion(machine, kind, duration, motion_chance)
    period, count = 1.0 / machine.loop_rate, motion.position.size
    noise_force = machine.force_noise * _coloured(count, 100.0, machine.loop_rate, noise_chance)
    timed_force = outside_force(hidden, count, period, pulse_chance)
    out = kernel.run(
        motion.position,
        motion.velocity,
        motion.acceleration,
        period,
        int(np.ceil(period / LARGEST_STEP - 1.0e-9)),
        machine.every,
        LAWS.index(machine.law),
        machine.mass,
        machine.viscous,
        machine.curve,
        machine.law_parameters,
        rested_state(),
        machine.controller,
        machine.resolution,
        hidden.p,
        hidden.force_map,
        hidden.scale_map,
        noise_force + timed_force,
    )
    noise = machine.effort_noise * _coloured(out.shape[0], machine.noise_corner, machine.log_rate, noise_chance)
    return Recording(
        time=np.arange(out.shape[0]) / machine.log_rate,
        position=out[:, kernel.POSITION],
        effort=out[:, kernel.EFFORT] + noise,
        reference=motion.position[:: machine.every],
        reference_velocity=motion.velocity[:: machine.every],
        true_velocity=out[:, kernel.TRUE_VELOCITY],
        friction=out[:, kernel.FRICTION],
        hidden_force=out[:, kernel.HIDDEN] + timed_force[:: machine.every],
        hidden=hidden,
    )


def _coloured(count: int, corner: float, rate: float, rng: Generator) -> Floats:
    """Return noise of unit rms, of first order with a corner, or white where that is 0 Hz."""
    white = rng.standard_normal(count)
    if corner == 0.0:
        return np.asarray(white)
    keep = np.exp(-2.0 * np.pi * corner / rate)
    return np.asarray(lfilter([np.sqrt(1.0 - keep**2)], [1.0, -keep], white))


START_NS = 1_700_000_000_000_000_000


def write_bag(path: Path, recording: Recording) -> None:
    """Write position, control_effort and reference into a new bag; nothing of the truth."""
    stamps = START_NS + np.rint(recording.time * 1.0e9).astype(np.int64)
    with BagWriter(path) as bag:
        # The reference first: a reader does not wait for the first reference.
        bag.write_joint_states(
            "reference", stamps, ["x"], position=recording.reference, velocity=recording.reference_velocity
        )
        bag.write_joint_states("position", stamps, ["x"], position=recording.position)
        bag.write_joint_states("control_effort", stamps, ["x"], effort=recording.effort)
