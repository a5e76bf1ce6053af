"""Predictive evidence: how much better one model predicts data that neither model was fitted to.

Held-out recordings are predicted by the fit. Without held-out recordings, each block of time is predicted by the fit
without the block. The derivatives of the fit give the change of its parameters when the block is left out (exact for a
linear model).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.fit import Refit
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.uncertainty import as_time_series, leave_one_out_shifts
from sgms_observer.diagnosis.whitened import WhitenedData


@dataclass(frozen=True)
class Improvement:
    """Improvement of the prediction from an earlier to a later model.

    Attributes:
        decrease: decrease of the squared residual, in units of the noise or N^2.
        z_score: the decrease over its standard error.
        before: squared residual of the earlier model, in the same unit.
    """

    decrease: float
    z_score: float
    before: float

    @property
    def share(self) -> float:
        """Return the relative decrease of the squared residual; 0 if it increases."""
        return max(0.0, self.decrease / self.before) if self.before > 0.0 else 0.0


def improvement(before: Sequence[Floats], after: Sequence[Floats]) -> Improvement:
    """Compare two models by their residuals on the same blocks.

    With ``d`` the change of the residual and ``e`` the residual of the later model, the square decreases by
    ``d^2 + 2 e d``. The term ``d^2`` is deterministic: an effect may act in a few reversals only. The product ``e d``
    is random; its scatter over blocks is the standard error.

    Args:
        before: residual of the earlier model in each block.
        after: residual of the later model in the same blocks.
    """
    decrease = sum(float(one @ one - other @ other) for one, other in zip(before, after, strict=True))
    products = [2.0 * float(other @ (one - other)) for one, other in zip(before, after, strict=True)]
    error = float(np.sqrt(np.sum(np.square(products))))
    total = sum(float(one @ one) for one in before)
    return Improvement(decrease, decrease / error if error > 0.0 else 0.0, total)


def preference(one: Sequence[Floats], other: Sequence[Floats]) -> float:
    """Return the z-score by which one model predicts better than another that it does not contain.

    Neither of the two has to be true, so the difference of the squared residuals is compared with its own scatter over
    blocks, the same for both (Vuong 1989, Likelihood ratio tests for model selection and non-nested hypotheses,
    Econometrica 57(2), eq. 5.6).

    Args:
        one: residual of the one model in each block.
        other: residual of the other one in the same blocks.
    """
    gains = np.array([float(b @ b - a @ a) for a, b in zip(one, other, strict=True)])
    scatter = float(np.std(gains, ddof=1)) if len(gains) > 1 else 0.0
    return float(np.mean(gains)) * np.sqrt(len(gains)) / scatter if scatter > 0.0 else 0.0


def blocks_of(values: Floats, period: float, length: float) -> list[Floats]:
    """Return a series cut into blocks.

    Args:
        values: shape (n,) or (n, k).
        period: time between two rows [s].
        length: of a block [s].
    """
    count = max(1, round(len(values) * period / length))
    return np.array_split(values, count)


def in_blocks(parts: Sequence[Floats], motions: Sequence[Motion], length: float) -> list[Floats]:
    """Return the residuals of recordings, cut into blocks.

    Args:
        parts: residual of each recording.
        motions: the recordings.
        length: of a block [s].
    """
    return [
        block
        for part, motion in zip(parts, motions, strict=True)
        for block in blocks_of(part, motion.residual_period, length)
    ]


def left_out_residuals(found: Refit, data: WhitenedData, length: float) -> list[Floats]:
    """Return the whitened residual of each block of the fitted recordings, predicted without the block.

    Args:
        found: fit with derivatives at its solution.
        data: recordings that it was fitted to.
        length: of a block [s].
    """
    rows = len(found.residual)
    columns = np.column_stack([found.jacobian[:rows], found.residual])
    parts: list[Floats] = []
    for motion, series in zip(data.motions, as_time_series(columns, data), strict=True):
        duration = len(motion.time) * motion.period
        parts += blocks_of(series, duration / len(series), length)
    moved = leave_one_out_shifts(parts, found.jacobian.T @ found.jacobian)
    return [part[:, -1] + part[:, :-1] @ step for part, step in zip(parts, moved, strict=True)]


def whitened_blocks(whitened: Floats, data: WhitenedData, length: float) -> list[Floats]:
    """Return a whitened series of all recordings, cut into blocks of time.

    Args:
        whitened: shape (n,), as of ``WhitenedData.whitened``.
        data: the recordings.
        length: of a block [s].
    """
    parts: list[Floats] = []
    for motion, series in zip(data.motions, as_time_series(whitened[:, None], data), strict=True):
        duration = len(motion.time) * motion.period
        parts += [part[:, 0] for part in blocks_of(series, duration / len(series), length)]
    return parts


def fit_residuals(found: Refit, data: WhitenedData, length: float) -> list[Floats]:
    """Return the whitened residual of each block of the fitted recordings; arguments as of ``left_out_residuals``."""
    return whitened_blocks(found.residual, data, length)


def held_out_residuals(model: Model, held: WhitenedData, length: float) -> list[Floats]:
    """Return the whitened residual of each block of held-out recordings.

    Args:
        model: model that was not fitted to them.
        held: held-out recordings with the noise for whitening.
        length: of a block [s].
    """
    return whitened_blocks(held.residual(model), held, length) if held.motions else []
