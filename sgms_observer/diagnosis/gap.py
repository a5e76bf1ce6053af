"""The gap between simulation and measurement on recordings that were not used to fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.fit import Refits, judged_with
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.workflow import Diagnosis
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

BLOCK = 0.5
"""Length of the bootstrap's blocks [s]."""
DRAWS = 400
CROSS_TOLERANCE = 0.05
"""How far parameters may move from the fit of the whole when only one half is fitted."""


@dataclass(frozen=True)
class Gap:
    """Gaps in per cent of the rms effort below the band.

    Attributes:
        before: of the nominal model, refitted.
        after: with the effects that were found.
        floor: of the noise.
        interval_after: 90 % interval by moving blocks.
        held_out: which data: ``held-out`` recordings, or ``cross-validated`` halves of the recordings themselves.
        steps: gap after each effect, the first entry before any.
        residual_before, residual_after: residuals they are made of, one per motion [N].
        motions: the motions they belong to.
    """

    before: float
    after: float
    floor: float
    interval_after: tuple[float, float]
    held_out: str
    steps: tuple[float, ...]
    residual_before: tuple[Floats, ...]
    residual_after: tuple[Floats, ...]
    motions: tuple[Motion, ...]

    @property
    def closure(self) -> float | None:
        """Share of the closable gap that was closed, or None where there is nothing to close."""
        if self.before <= 1.02 * self.floor:
            return None
        return (self.before - self.after) / (self.before - self.floor)


def residuals(model: Model, motions: Sequence[Motion]) -> tuple[Floats, ...]:
    """Return the band-limited residual of a model in each motion [N]."""
    return tuple(motion.low_pass(predict(model, motion).residual) for motion in motions)


def relative(parts: Sequence[Floats], motions: Sequence[Motion]) -> float:
    """Return rms residual over rms effort [%]."""
    effort = np.concatenate([motion.low_pass(motion.effort) for motion in motions])
    return 100.0 * float(np.sqrt(np.mean(np.concatenate(parts) ** 2) / np.mean(effort**2)))


def measure(found: Diagnosis, before: Model, after: Model, stages: Sequence[Model], seed: int) -> Gap:
    """Measure the gap before and after.

    Args:
        found: the diagnosis.
        before: nominal model, refitted.
        after: model with the effects.
        stages: models after each effect but the last.
        seed: of the bootstrap.
    """
    if found.held_out:
        motions: tuple[Motion, ...] = found.held_out
        one, other = residuals(before, motions), residuals(after, motions)
        steps = [relative(one, motions), *(relative(residuals(m, motions), motions) for m in stages)]
        label = "held-out"
    else:
        motions = tuple(half for motion in found.motions for half in halves(motion))
        one = _crossed(found, motions, before, before.effects)
        other = _crossed(found, motions, after, after.effects)
        steps = [relative(one, motions)] * (1 + len(stages))
        label = "cross-validated"
    noise = max(item.rms for item in found.judged.noise)
    effort = np.concatenate([motion.low_pass(motion.effort) for motion in motions])
    gap_after = relative(other, motions)
    floor = min(100.0 * noise / float(np.sqrt(np.mean(effort**2))), gap_after)
    return Gap(
        relative(one, motions), gap_after, floor, _interval(other, motions, seed), label, (*steps, gap_after), one,
        other,
        motions,
    )  # fmt: skip


def halves(motion: Motion) -> tuple[Motion, Motion]:
    """Return the two halves of a motion; effects in time and travel start anew in the second."""
    middle = len(motion.time) // 2
    cuts = (slice(0, middle), slice(middle, None))
    listed = [(field.name, getattr(motion, field.name)) for field in fields(motion)]
    series = {key: value for key, value in listed if isinstance(value, np.ndarray) and len(value) == len(motion.time)}
    first, second = (
        replace(motion, **{key: value[cut] for key, value in series.items()})  # type: ignore[arg-type]
        for cut in cuts
    )
    return first, second


def _crossed(
    found: Diagnosis, motions: Sequence[Motion], start: Model, effects: Sequence[EffectSettings]
) -> tuple[Floats, ...]:
    """Return the residual of each half with parameters fitted on the other halves."""
    parts: list[Floats] = [np.zeros(0)] * len(motions)
    for side in (0, 1):
        learn = tuple(motions[i] for i in range(len(motions)) if i % 2 == side)
        refits = Refits(judged_with(learn, start), Model(start.mass, start.friction), CROSS_TOLERANCE)
        again = refits.of(effects, None, 4)
        for i in range(len(motions)):
            if i % 2 != side:
                parts[i] = residuals(again.model, (motions[i],))[0]
    return tuple(parts)


def _interval(parts: Sequence[Floats], motions: Sequence[Motion], seed: int) -> tuple[float, float]:
    """Return the 90 % interval of the gap by moving blocks."""
    rng = np.random.default_rng([seed, 77])
    squares = np.concatenate([part**2 for part in parts])
    effort = np.concatenate([motion.low_pass(motion.effort) for motion in motions])
    length = max(1, int(BLOCK / motions[0].residual_period))
    count = max(1, len(squares) // length)
    sums = np.concatenate(([0.0], np.cumsum(squares)))
    starts = rng.integers(0, max(1, len(squares) - length), size=(DRAWS, count))
    means = (sums[starts + length] - sums[starts]).sum(axis=1) / (count * length)
    low, high = np.quantile(100.0 * np.sqrt(means / np.mean(effort**2)), [0.05, 0.95])
    return float(low), float(high)
