"""A small simulated recording for tests: the model's own friction along a rich motion, with an effect put in."""

from collections.abc import Sequence

import numpy as np

from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.gap import noise_floor, residuals, weighted_rms
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.diagnosis.whitened import data_with_noise_of, data_with_own_noise
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings, EncoderSettings, FrictionSettings, StageSettings

PERIOD = 1.0e-3
FRICTION = FrictionSettings(
    element_stiffness=(4.0e6, 1.0e6, 4.0e5),
    element_fraction=(0.3, 0.3, 0.4),
    element_damping=(0.0, 0.0, 0.0),
    viscous_coefficient=12.0,
    static_force=5.0,
    coulomb_force=4.0,
    stribeck_velocity=2.0e-3,
)
AXIS = AxisSettings(mass=5.0, friction=FRICTION, stage=StageSettings(encoder=EncoderSettings(resolution=1.0e-8)))


def rich_position(duration: float, seed: int, period: float = PERIOD) -> np.ndarray:
    """Return a motion with tones, slow and fast traverses and rests [m]."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration / period)) * period
    q = np.zeros(len(t))
    for frequency, amplitude in ((0.23, 0.02), (0.61, 0.008), (1.7, 0.002), (4.3, 4e-4), (9.1, 8e-5)):
        q += amplitude * np.sin(2 * np.pi * frequency * t + rng.uniform(0, 6.28))
    gate = np.clip(np.minimum((t % 6.0) * 5.0, (5.2 - t % 6.0) * 5.0), 0.0, 1.0)
    velocity = np.gradient(q, period) * gate
    return np.cumsum(velocity) * period


def record(
    effects: tuple[EffectSettings, ...] = (),
    seed: int = 1,
    duration: float = 20.0,
    mass: float = 5.0,
    is_unsmoothed: bool = False,
    period: float = PERIOD,
    scale: float = 1.0,
) -> Recording:
    """Return a recording of a stage with ``effects`` and force noise of 1 % of the Coulomb force.

    A periodic disturbance is added to the effort, because a prediction has the phase of the recording. ``scale`` is
    that of the motion.
    """
    raw = np.round(scale * rich_position(duration, seed, period) / 1e-8) * 1e-8
    rng = np.random.default_rng([seed, 5])
    white = rng.standard_normal(len(raw))
    noise = np.empty(len(raw))
    noise[0] = 0.0
    for k in range(1, len(raw)):
        noise[k] = 0.85 * noise[k - 1] + 0.527 * white[k]
    periodic = [one for one in effects if one.name == "periodic_disturbance"]
    truth = Model(mass, FRICTION, is_unsmoothed=is_unsmoothed).with_effects(
        [one for one in effects if one not in periodic]
    )
    motion = motion_of(Recording("test", period, raw, np.zeros(len(raw))))
    needed = -predict(truth, motion).residual + 0.04 * noise
    for one in periodic:
        amplitude, frequency, phase = one.values
        needed = needed + amplitude * np.sin(2.0 * np.pi * frequency * motion.time + phase)
    held = np.empty(len(raw))
    held[0] = needed[0]
    for k in range(1, len(raw)):  # the effort whose mean over the samples before and after is what is needed, damped
        held[k] = needed[k] + 0.9 * (needed[k] - held[k - 1])
    return Recording("test", period, raw, held)


def evaluation_of(
    learn: Sequence[Motion], truth: Model, held: Sequence[Motion] = (), floor: float | None = None
) -> EvaluationData:
    """Return evaluation data with the noise of the true model and the first gap of the nominal model.

    Args:
        learn: fitted recordings.
        truth: model with what is hidden.
        held: held-out recordings.
        floor: rms residual of a perfect model [N]; from replicates if None.
    """
    data = data_with_own_noise(learn, truth)
    judge = tuple(held) or tuple(learn)
    unseen = data_with_noise_of(held, data, truth)
    weights = unseen.weights if held else data.weights
    lowest = noise_floor(judge, truth, data.noise, 1, weights) if floor is None else floor
    first = weighted_rms(residuals(Model.of(AXIS), judge), weights)
    return EvaluationData(tuple(learn), judge, data, unseen, lowest, first, Criteria(), 1)
