"""Whether an effect earns its name on recordings it was not fitted to: it has to close a share of the closable gap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.noise import Noise
from sgms_observer.diagnosis.twins import twin_of

Floats = NDArray[np.float64]

WHOLE = 0.5
"""Share of the closable gap that all effects together have to close for any of them to be named."""
SEVERAL = 0.75
"""The same where there are several: what two wrong names close together is no proof of either."""
SURE = 2.5
"""Each of them has to make the squared residual of the recordings smaller by this many standard errors,"""
STEP = 0.1
"""and to close this share of the closable squared residual: two effects of one size close a part each;"""
FURTHER = 0.3
"""the same for those after the first: what is left of a wrong shape must not be named."""
BLOCK = 0.5
"""Length of a block that counts as independent of the next [s]."""
CLOSABLE = 1.06
"""There is something to close where the gap is this many times its floor."""
FLOOR_TWINS = 3


@dataclass(frozen=True)
class Gate:
    """Recordings to judge on.

    Attributes:
        motions: held-out recordings, or the recordings themselves where there are none.
        floor: rms residual that noise and encoder leave there to a perfect model [N].
        is_unseen: whether nothing was fitted to them.
    """

    motions: tuple[Motion, ...]
    floor: float
    is_unseen: bool = True

    def enough(self, count: int) -> float:
        """Return the share of the closable gap that so many effects together have to close.

        A single recording holds all that the machine does beside them, and no second one tells how much of it returns:
        there half has to do for several effects too, each of which was sure by itself.

        Args:
            count: effects named.
        """
        return SEVERAL if count > 1 and self.is_unseen else WHOLE

    def gap(self, model: Model) -> float:
        """Return the rms residual of a model below the band [N]."""
        return gap_of(model, self.motions)

    def closure(self, before: Model, after: Model) -> float | None:
        """Return the share of the closable gap that ``after`` closes, or None where nothing is closable."""
        here, there = self.gap(before), self.gap(after)
        if here < CLOSABLE * self.floor:
            return None
        return (here - there) / (here - self.floor)

    def passes(self, before: Model, after: Model, is_first: bool) -> bool:
        """Return whether the step from one model to the next earns its name.

        Args:
            before, after: models without and with the effect.
            is_first: whether it is the first one.
        """
        if sureness(before, after, self.motions) < SURE:
            return False
        here, there, floor = self.gap(before) ** 2, self.gap(after) ** 2, self.floor**2
        if here < CLOSABLE**2 * floor:
            return True
        return here - there > (STEP if is_first else FURTHER) * (here - floor)


def sureness(before: Model, after: Model, motions: Sequence[Motion]) -> float:
    """Return by how many standard errors the squared residual falls from one model to the next.

    With ``d`` the change of the residual and ``e`` what the later model leaves, the square falls by ``d^2 + 2 e d``.
    The product is chance; its scatter over blocks is the error. Where an effect acts is no chance: a few hard reversals
    may hold all of it.
    """
    pairs = []
    for motion in motions:
        one, other = (motion.low_pass(predict(model, motion).residual) for model in (before, after))
        pairs.append((one, other, motion.residual_period))
    return sureness_of(pairs)


def sureness_of(pairs: Sequence[tuple[Floats, Floats, float]]) -> float:
    """Return the same of residuals.

    Args:
        pairs: of each recording the residual before and after, shape (n,) each [N], and its period [s].
    """
    falls, products = [], []
    for one, other, period in pairs:
        starts = np.arange(0, len(one), max(1, int(BLOCK / period)))
        falls.append(np.add.reduceat(one * one - other * other, starts))
        products.append(np.add.reduceat(2.0 * other * (one - other), starts))
    error = float(np.sqrt(np.sum(np.concatenate(products) ** 2)))
    return float(np.concatenate(falls).sum()) / max(error, 1.0e-300)


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
