"""Whether an effect earns its name on recordings it was not fitted to: it has to close a share of the closable gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.discrepancy.model import Model, predict
from sgms_observer.discrepancy.motion import Motion
from sgms_observer.discrepancy.noise import Noise
from sgms_observer.discrepancy.twins import twin_of

WHOLE = 0.5
"""Share of the closable gap that all effects together have to close for any of them to be named."""
SEVERAL = 0.75
"""The same where there are several: what two wrong names close together is no proof of either."""
STEP = 0.25
"""Share of what is left that each of them has to close: two effects of one size close a part each."""
FURTHER = 0.35
"""The same for those after the first."""
CLOSABLE = 1.06
"""There is something to close where the gap is this many times its floor."""
FLOOR_TWINS = 3


@dataclass(frozen=True)
class Gate:
    """Recordings to judge on.

    Attributes:
        motions: held-out recordings, or the recordings themselves where there are none.
        floor: rms residual that noise and encoder leave there to a perfect model [N].
    """

    motions: tuple[Motion, ...]
    floor: float

    def gap(self, model: Model) -> float:
        """Return the rms residual of a model below the band [N]."""
        return gap_of(model, self.motions)

    def closure(self, before: Model, after: Model) -> float | None:
        """Return the share of the closable gap that ``after`` closes, or None where nothing is closable."""
        here, there = self.gap(before), self.gap(after)
        if here < CLOSABLE * self.floor:
            return None
        return (here - there) / (here - self.floor)

    def passes(self, before: Model, after: Model, is_first: bool, is_structural: bool) -> bool:
        """Return whether the step from one model to the next earns its name.

        Args:
            before, after: models without and with the effect.
            is_first: whether it is the first one.
            is_structural: whether it looks like what few elements leave behind: then it has to show here.
        """
        closure = self.closure(before, after)
        if closure is None:
            return is_first and not is_structural and self.gap(after) <= self.gap(before)
        return closure > (STEP if is_first else FURTHER)


def gap_of(model: Model, motions: Sequence[Motion]) -> float:
    """Return the rms residual of a model below the band [N]."""
    parts = [motion.low_pass(predict(model, motion).residual) for motion in motions]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


def floor_of(motions: Sequence[Motion], model: Model, noise: Sequence[Noise], seed: int) -> float:
    """Return the rms residual that noise and the encoder's grid alone leave, from twins in which the model holds [N].

    Args:
        motions: recordings.
        model: any model of about the right friction.
        noise: of the recordings to learn from; the loudest counts.
        seed: of all chance.
    """
    loudest = max(noise, key=lambda item: item.rms)
    squares, count = 0.0, 0
    for number in range(FLOOR_TWINS):
        rng = np.random.default_rng([seed, 79, number])
        for motion in motions:
            twin = twin_of(motion, model, loudest, rng)
            residual = twin.low_pass(predict(model, twin).residual)
            squares, count = squares + float(residual @ residual), count + len(residual)
    return float(np.sqrt(squares / count))
