"""How much of a residual could be predicted at all: a free-form regression, judged on data it was not fitted to.

Gradient-boosted trees see nothing of forces that are periodic in time and of the effort's path, so they complement the
catalogue's candidates and do not replace them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import HistGradientBoostingRegressor

from sgms_observer.diagnosis.coordinates import coordinates_of
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import Improvement, improvement
from sgms_observer.diagnosis.gap import WeightedResidual

Floats = NDArray[np.float64]

ALL = (
    "position", "direction", "velocity", "acceleration", "time", "time since reversal", "distance since reversal",
    "dwell",
)  # fmt: skip
"""Coordinates of the ceiling."""
FOLDS = 5
"""Parts of the recordings that are left out in turn where there are no held-out ones."""
FOLD_BLOCK = 2.0
"""Length of the pieces that the parts are made of in turn [s]: long beside what a contact remembers."""
TREES, LEAF_TIME = 120, 0.2
"""Number of trees, and the least time of the recording in one leaf [s]: less is one event."""


@dataclass(frozen=True)
class FreeForm:
    """What a free-form term over some coordinates predicts of a residual.

    Attributes:
        names: the coordinates.
        predicted: predicted residual of each motion that is judged on [N].
        improvement: what it would improve there.
    """

    names: tuple[str, ...]
    predicted: tuple[Floats, ...]
    improvement: Improvement


def free_form(
    names: Sequence[str], learn: WeightedResidual, judge: WeightedResidual, criteria: Criteria, seed: int
) -> FreeForm:
    """Predict a residual over some coordinates.

    Args:
        names: coordinates, see ``coordinates_of``.
        learn: what a model leaves of the recordings to learn from.
        judge: of those to judge on; the same object as ``learn`` where there are no others: parts of them are then left
            out in turn.
        criteria: lengths of blocks.
        seed: of the regression.
    """
    known = [coordinates_of(motion, names) for motion in learn.motions]
    period = learn.motions[0].residual_period
    if learn is judge:
        predicted = _in_turn(known, learn, period, seed)
    else:
        weights = np.concatenate(list(learn.weights))
        model = _fit(np.vstack(known), np.concatenate(list(learn.residual)), weights, period, seed)
        predicted = [np.asarray(model.predict(coordinates_of(motion, names))) for motion in judge.motions]
    gain = improvement(judge.blocks(criteria.block), judge.minus(predicted).blocks(criteria.block))
    return FreeForm(tuple(names), tuple(predicted), gain)


def _fit(rows: Floats, target: Floats, weights: Floats, period: float, seed: int) -> HistGradientBoostingRegressor:
    """Return the fitted regression."""
    leaf = max(20, min(round(LEAF_TIME / period), len(rows) // 20))
    model = HistGradientBoostingRegressor(
        max_iter=TREES, learning_rate=0.06, min_samples_leaf=leaf, early_stopping=False, random_state=seed
    )
    return model.fit(rows, target, weights**2)


def _in_turn(known: Sequence[Floats], learn: WeightedResidual, period: float, seed: int) -> list[Floats]:
    """Return the prediction of each part of the recordings by a regression that has not seen it."""
    rows, target, weights = (np.concatenate(list(parts)) for parts in (known, learn.residual, learn.weights))
    fold = (np.arange(len(target)) * period / FOLD_BLOCK).astype(np.int64) % FOLDS
    predicted = np.zeros(len(target))
    for number in range(FOLDS):
        out = fold == number
        if out.any() and not out.all():
            predicted[out] = _fit(rows[~out], target[~out], weights[~out], period, seed).predict(rows[out])
    return np.split(predicted, np.cumsum([len(part) for part in learn.residual])[:-1])
