"""Null twins: the refitted nominal model in the recording's own motion, with its noise, through the same pipeline."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.fit import Judged
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.diagnosis.noise import Noise, fit_noise
from sgms_observer.diagnosis.record import Record
from sgms_observer.diagnosis.screen import Screen

Floats = NDArray[np.float64]

SCALE_TWINS = 24
"""Twins that say how large each effect's gain is by chance."""
THRESHOLD_TWINS = 40
"""Other twins that say how large the largest standardised gain is by chance."""


@dataclass(frozen=True)
class Calibration:
    """What chance does to the gains.

    Attributes:
        mean: of each effect's gain over the scale twins.
        spread: its standard deviation.
        largest: largest standardised gain of each threshold twin.
        seconds: length of the recordings together [s].
    """

    mean: dict[str, float]
    spread: dict[str, float]
    largest: Floats
    seconds: float

    def standardised(self, name: str, gain: float) -> float:
        """Return a gain in standard deviations above its mean by chance."""
        return (gain - self.mean[name]) / self.spread[name]

    def p_value(self, score: float) -> float:
        """Return how often chance alone reaches a score at least as large."""
        return float((1 + np.sum(self.largest >= score)) / (1 + len(self.largest)))


def coloured(noise: Noise, count: int, period: float, rng: np.random.Generator) -> Floats:
    """Return force noise of the fitted spectrum at a rate of one's own [N]."""
    frequency = np.asarray(np.fft.rfftfreq(count, period), dtype=np.float64)
    white = rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency))
    spectrum = white * np.sqrt(noise.density(frequency) * count / (2.0 * period))
    return np.asarray(np.fft.irfft(spectrum, count), dtype=np.float64)


def twin_of(motion: Motion, model: Model, noise: Noise, rng: np.random.Generator) -> Motion:
    """Return a recording in which the model holds: the same motion on the same encoder, its own effort."""
    needed = motion.effort - predict(model, motion).residual
    effort = needed + coloured(noise, len(needed), motion.period, rng)
    position = motion.position
    if motion.resolution > 0.0:
        shift = rng.uniform(0.0, motion.resolution)
        position = np.round((position + shift) / motion.resolution) * motion.resolution - shift
    held = np.concatenate((effort[1:], effort[-1:]))  # undo the hold correction of ``motion_of`` to first order
    record = Record(motion.name, motion.period, position, 0.5 * (effort + held))
    made = motion_of(record, motion.lag)
    return replace(
        made, effort=effort, has_other=motion.has_other, other_velocity=motion.other_velocity,
        other_acceleration=motion.other_acceleration,
    )  # fmt: skip


def calibrate(screen: Screen, seed: int, workers: int, report: Callable[[float], None] | None = None) -> Calibration:
    """Run the twins.

    Args:
        screen: of the recordings.
        seed: of all chance; every twin has its own stream, so that the number of workers changes nothing.
        workers: threads.
        report: called with the share that is done.
    """
    total = SCALE_TWINS + THRESHOLD_TWINS
    names = list(screen.columns)

    def one(index: int) -> Floats:
        rng = np.random.default_rng([seed, index])
        gains = screen.gains(twin_residual(screen, rng))
        return np.array([gains[name][0] for name in names])

    rows = []
    with ThreadPoolExecutor(max_workers=workers) as pool:
        for done, row in enumerate(pool.map(one, range(total))):
            rows.append(row)
            if report is not None:
                report((done + 1) / total)
    table = np.array(rows)
    mean = table[:SCALE_TWINS].mean(axis=0)
    spread = np.maximum(table[:SCALE_TWINS].std(axis=0, ddof=1), 1.0)
    largest = ((table[SCALE_TWINS:] - mean) / spread).max(axis=1) if names else np.zeros(THRESHOLD_TWINS)
    seconds = sum(len(motion.time) * motion.period for motion in screen.judged.motions)
    return Calibration(dict(zip(names, mean, strict=True)), dict(zip(names, spread, strict=True)), largest, seconds)


def twin_residual(screen: Screen, rng: np.random.Generator) -> Floats:
    """Return the whitened residual of one twin of all recordings, its noise fitted anew."""
    judged = screen.judged
    motions, noises, weights = [], [], []
    for motion, noise in zip(judged.motions, judged.noise, strict=True):
        twin = twin_of(motion, screen.model, noise, rng)
        prediction = predict(screen.model, twin)
        doubt = twin.thinned(prediction.doubt)
        fitted = fit_noise(twin.low_pass(prediction.residual), doubt, twin.residual_period, start=noise)
        motions.append(twin)
        noises.append(fitted)
        weights.append(fitted.weights(doubt))
    return Judged(tuple(motions), tuple(noises), tuple(weights)).residual(screen.model)
