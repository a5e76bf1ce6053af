"""The gap: rms of measured minus modelled effort in one band, over the rms measured effort of the same samples.

While the contact slides, its motion determines the friction. Where it sticks, or the encoder shows no motion, another
contact law or a hidden reversal may change the friction by much more than the noise. Such samples have a weight that
falls with the measured scatter of the residual, in the fit, in the evidence and in the gap. An rms with weights is that
of a sample of weight 1, so that it compares with any other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import in_blocks
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.noise import Noise, largest_noise
from sgms_observer.diagnosis.replicates import replicate_of

DRAWS = 400
"""Bootstrap draws of an interval."""
FLOOR_REPLICATES = 3
"""Number of bootstrap replicates from which the floor of noise and encoder is computed."""


@dataclass(frozen=True)
class Gap:
    """Gaps in per cent of the rms measured effort below the band.

    Attributes:
        given: gap of the given file.
        before: gap of the file refitted within its tolerance.
        after: gap of the final model without learnt maps.
        floor: gap that no predictor removes.
        noise: gap of a perfect model, from noise and encoder.
        unweighted_before, unweighted_after: gaps before and after in which every sample counts alike.
        interval_before, interval_after: 90 % intervals by moving blocks.
        held_out: data of the gap: ``held-out`` recordings, or ``cross-validated`` halves of the recordings.
        band: upper frequency of the residuals [Hz].
        min_over_floor: smallest ratio of gap to floor for which the gap is closable.
    """

    given: float
    before: float
    after: float
    floor: float
    noise: float
    unweighted_before: float
    unweighted_after: float
    interval_before: tuple[float, float]
    interval_after: tuple[float, float]
    held_out: str
    band: float
    min_over_floor: float

    @property
    def named(self) -> float:
        """Return the part that the final model closes: named^2 = before^2 - after^2 [%]."""
        return float(np.sqrt(max(0.0, self.before**2 - self.after**2)))

    @property
    def predictable(self) -> float:
        """Return the predictable part without a name: predictable^2 = after^2 - floor^2 [%]."""
        return float(np.sqrt(max(0.0, self.after**2 - self.floor**2)))

    @property
    def closure(self) -> float | None:
        """Return (before - after) / (before - floor), or None if there is nothing to close."""
        if self.before <= self.min_over_floor * self.floor:
            return None
        return (self.before - self.after) / (self.before - self.floor)


def residuals(model: Model, motions: Sequence[Motion]) -> tuple[Floats, ...]:
    """Return the band-limited residual of a model in each motion [N]."""
    return tuple(motion.low_pass(predict(model, motion).residual) for motion in motions)


def effort_rms(motions: Sequence[Motion], weights: Sequence[Floats]) -> float:
    """Return the rms measured effort below the band [N].

    Args:
        motions: recordings.
        weights: of their samples in the gap.
    """
    return weighted_rms([motion.low_pass(motion.effort) for motion in motions], weights)


def rms(parts: Sequence[Floats]) -> float:
    """Return the root of the mean square of all parts."""
    return float(np.sqrt(np.mean(np.square(np.concatenate(list(parts))))))


def weighted_rms(parts: Sequence[Floats], weights: Sequence[Floats]) -> float:
    """Return the root of the weighted mean square of all parts, sqrt(sum (w r)^2 / sum w^2).

    Args:
        parts: series of each motion [N].
        weights: weights of each motion.
    """
    return rms(weighted(parts, weights)) / rms(weights)


def interval(rest: WeightedResidual, criteria: Criteria, seed: int) -> tuple[float, float]:
    """Return the 90 % interval of the gap by moving blocks [%].

    Args:
        rest: residual of a model.
        criteria: length of a block.
        seed: of the bootstrap.

    Source: Kuensch 1989, Annals of Statistics 17(3).
    """
    rng = np.random.default_rng([seed, 77])
    squares = np.concatenate(rest.weighted) ** 2
    length = max(1, int(criteria.block / rest.motions[0].residual_period))
    count = max(1, len(squares) // length)
    sums = np.concatenate(([0.0], np.cumsum(squares)))
    starts = rng.integers(0, max(1, len(squares) - length), size=(DRAWS, count))
    means = (sums[starts + length] - sums[starts]).sum(axis=1) / (count * length)
    effort = effort_rms(rest.motions, rest.weights) * rms(rest.weights)
    low, high = np.quantile(100.0 * np.sqrt(means) / effort, [0.05, 0.95])
    return float(low), float(high)


def weighted(parts: Sequence[Floats], weights: Sequence[Floats]) -> tuple[Floats, ...]:
    """Return each series times its weights.

    Args:
        parts: series of each motion [N].
        weights: weights of each motion.
    """
    return tuple(part * weight for part, weight in zip(parts, weights, strict=True))


@dataclass(frozen=True)
class WeightedResidual:
    """Residual of a model in recordings, with weights.

    Attributes:
        motions: the recordings.
        residual: residual of each recording [N].
        weights: weights of the samples of each recording.
    """

    motions: Sequence[Motion]
    residual: Sequence[Floats]
    weights: Sequence[Floats]

    @property
    def weighted(self) -> tuple[Floats, ...]:
        """Return the weighted residual of each recording [N]."""
        return weighted(self.residual, self.weights)

    @property
    def rms(self) -> float:
        """Return the rms weighted residual [N]."""
        return weighted_rms(self.residual, self.weights)

    def minus(self, predicted: Sequence[Floats]) -> WeightedResidual:
        """Return the residual minus ``predicted`` [N] of each recording."""
        left = [residual - guess for residual, guess in zip(self.residual, predicted, strict=True)]
        return replace(self, residual=left)

    def blocks(self, length: float) -> list[Floats]:
        """Return the weighted residual of each block of time.

        Args:
            length: of a block [s].
        """
        return in_blocks(self.weighted, self.motions, length)


def noise_floor(
    motions: Sequence[Motion],
    model: Model,
    noise: Sequence[Noise],
    seed: int,
    weights: Sequence[Floats],
) -> float:
    """Return the rms residual of a perfect model, from noise and encoder resolution alone [N].

    Args:
        motions: recordings.
        model: model with approximately the right friction.
        noise: noise of the fitted recordings; the largest is used.
        seed: seed of the replicates.
        weights: of the samples of each recording.
    """
    parts: list[Floats] = []
    for number in range(FLOOR_REPLICATES):
        rng = np.random.default_rng([seed, 79, number])
        for motion in motions:
            parts += residuals(model, [replicate_of(motion, model, largest_noise(noise), rng)])
    return weighted_rms(parts, list(weights) * FLOOR_REPLICATES)


def halves(motion: Motion) -> tuple[Motion, Motion]:
    """Return the two halves of a motion. Effects with memory start again in the second half."""
    middle, count = len(motion.time) // 2, len(motion.time)
    listed = [(field.name, getattr(motion, field.name)) for field in fields(motion)]
    series = {key: value for key, value in listed if isinstance(value, np.ndarray) and len(value) == count}

    def part(first: int, last: int) -> Motion:
        cut = {key: value[first:last] for key, value in series.items()}
        return replace(motion, **{**cut, "raw": motion.raw[first * motion.step : last * motion.step]})  # type: ignore[arg-type]

    return part(0, middle), part(middle, count)
