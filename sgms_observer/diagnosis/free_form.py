"""Free-form regression: the part of a residual that is predictable from coordinates, on data it was not fitted to.

Gradient-boosted trees cannot represent forces that are periodic in time or effects on the path of the effort. They
complement the effects of the catalogue and do not replace them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.coordinates import coordinates_of
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import Improvement, improvement
from sgms_observer.diagnosis.gap import WeightedResidual

ALL = (
    "position", "direction", "velocity", "acceleration", "time", "time since reversal", "distance since reversal",
    "dwell",
)  # fmt: skip
"""All coordinates of the regression."""
FOLDS = 5
"""Number of cross-validation folds, used if there is no held-out recording."""
FOLD_BLOCK = 2.0
"""Length of the pieces that are assigned to the folds in turn [s]: much longer than the memory of a contact."""
TREES, LEAF_TIME = 120, 0.2
"""Number of trees, and smallest recorded time in one leaf [s]: a shorter time is a single event."""


@dataclass(frozen=True)
class FreeForm:
    """Prediction of a residual by a free-form regression.

    Attributes:
        names: the coordinates.
        predicted: predicted residual of each evaluated motion [N].
        improvement: improvement on these motions.
    """

    names: tuple[str, ...]
    predicted: tuple[Floats, ...]
    improvement: Improvement


def free_form(
    names: Sequence[str], fitted: WeightedResidual, evaluated: WeightedResidual, criteria: Criteria, seed: int
) -> FreeForm:
    """Predict a residual from coordinates.

    Args:
        names: coordinates, see ``coordinates_of``.
        fitted: residual on the fitted recordings.
        evaluated: residual on the evaluated recordings. The same object as ``fitted`` if there are no others; the
            prediction is then cross-validated.
        criteria: length of a block.
        seed: seed of the regression.
    """
    known = [coordinates_of(motion, names) for motion in fitted.motions]
    period = fitted.motions[0].residual_period
    if fitted is evaluated:
        predicted = _cross_validated(known, fitted, period, seed)
    else:
        weights = np.concatenate(list(fitted.weights))
        model = _fit(np.vstack(known), np.concatenate(list(fitted.residual)), weights, period, seed)
        predicted = [np.asarray(model.predict(coordinates_of(motion, names))) for motion in evaluated.motions]
    gain = improvement(evaluated.blocks(criteria.block), evaluated.minus(predicted).blocks(criteria.block))
    return FreeForm(tuple(names), tuple(predicted), gain)


def _fit(rows: Floats, target: Floats, weights: Floats, period: float, seed: int) -> HistGradientBoostingRegressor:
    """Return the fitted regression."""
    leaf = max(20, min(round(LEAF_TIME / period), len(rows) // 20))
    model = HistGradientBoostingRegressor(
        max_iter=TREES, learning_rate=0.06, min_samples_leaf=leaf, early_stopping=False, random_state=seed
    )
    return model.fit(rows, target, weights**2)


def _cross_validated(known: Sequence[Floats], fitted: WeightedResidual, period: float, seed: int) -> list[Floats]:
    """Return the prediction of each fold by the regression fitted to the other folds."""
    rows, target, weights = (np.concatenate(list(parts)) for parts in (known, fitted.residual, fitted.weights))
    fold = (np.arange(len(target)) * period / FOLD_BLOCK).astype(np.int64) % FOLDS
    predicted = np.zeros(len(target))
    for number in range(FOLDS):
        out = fold == number
        if out.any() and not out.all():
            predicted[out] = _fit(rows[~out], target[~out], weights[~out], period, seed).predict(rows[out])
    return np.split(predicted, np.cumsum([len(part) for part in fitted.residual])[:-1])
