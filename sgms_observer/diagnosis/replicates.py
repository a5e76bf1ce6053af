"""Bootstrap replicates: simulated recordings with nothing hidden, with motion, noise and encoder of a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.model import Model, hidden_friction_drop, predict, unknown_initial_friction
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.diagnosis.noise import Noise
from sgms_observer.offline.recording import Recording


def coloured(noise: Noise, count: int, period: float, rng: np.random.Generator) -> Floats:
    """Return force noise with the fitted spectrum at any sample period [N]."""
    frequency = np.asarray(np.fft.rfftfreq(count, period), dtype=np.float64)
    white = rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency))
    spectrum = white * np.sqrt(noise.density(frequency) * count / (2.0 * period))
    return np.asarray(np.fft.irfft(spectrum, count), dtype=np.float64)


def replicate_of(motion: Motion, model: Model, noise: Noise, rng: np.random.Generator) -> Motion:
    """Return a recording with the same motion and encoder whose effort follows the model, plus noise.

    At each rest the contact has moved back by a random part of the distance that the encoder resolution hides. The
    recording starts with a random state of the contact.
    """
    found = predict(model, motion)
    needed = motion.effort - found.residual
    hides = motion.hidden_periods > 0.0
    rest = np.cumsum(np.diff(hides, prepend=False) & hides)
    fallen = rng.uniform(0.0, 1.0, rest[-1] + 1)[rest] * hidden_friction_drop(model.friction, motion)
    started = rng.uniform(-0.5, 0.5) * unknown_initial_friction(model.friction, motion)
    effort = needed - np.sign(found.friction) * fallen + started + coloured(noise, len(needed), motion.period, rng)
    position = motion.position
    if motion.resolution > 0.0:
        shift = rng.uniform(0.0, motion.resolution)
        position = np.round((position + shift) / motion.resolution) * motion.resolution - shift
    held = np.concatenate((effort[1:], effort[-1:]))  # undo the hold correction of ``motion_of`` to first order
    record = Recording(motion.name, motion.period, position, 0.5 * (effort + held), recorded_step=motion.resolution)
    made = motion_of(record, motion.lag, motion.band)
    return replace(
        made, effort=effort, effort_limits=motion.effort_limits, has_other=motion.has_other,
        other_velocity=motion.other_velocity, other_acceleration=motion.other_acceleration,
    )  # fmt: skip
