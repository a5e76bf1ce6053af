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
MAX_BINS = 255
"""Number of bins of a coordinate: as many as the regression has."""
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
        predicted = [model.predict(coordinates_of(motion, names)) for motion in evaluated.motions]
    gain = improvement(evaluated.blocks(criteria.block), evaluated.minus(predicted).blocks(criteria.block))
    return FreeForm(tuple(names), tuple(predicted), gain)


@dataclass(frozen=True)
class _Regression:
    """A fitted regression over the numbers of the bins that the coordinates lie in.

    The regression divides each coordinate into bins of equal weight in any case, and its result is the same to the last
    bit. But it searches the data once more for each edge, which takes twice as long as to grow all trees.

    Attributes:
        edges: upper edge of each bin but the last one, of each coordinate.
        model: regression over the numbers of the bins.
    """

    edges: tuple[Floats, ...]
    model: HistGradientBoostingRegressor

    def predict(self, rows: Floats) -> Floats:
        """Return the prediction at some coordinates, shape (n, coordinates) [N]."""
        return np.asarray(self.model.predict(_bins_of(rows, self.edges)))


def _fit(rows: Floats, target: Floats, weights: Floats, period: float, seed: int) -> _Regression:
    """Return the fitted regression."""
    leaf = max(20, min(round(LEAF_TIME / period), len(rows) // 20))
    model = HistGradientBoostingRegressor(
        max_iter=TREES, learning_rate=0.06, max_bins=MAX_BINS, min_samples_leaf=leaf, early_stopping=False,
        random_state=seed,
    )  # fmt: skip
    edges = tuple(_edges(column, weights**2) for column in rows.T)
    return _Regression(edges, model.fit(_bins_of(rows, edges), target, weights**2))


def _edges(values: Floats, weights: Floats) -> Floats:
    """Return the upper edges of all bins but the last one: of equal weight, or one bin for each value if these are few.

    Args:
        values: shape (n,).
        weights: at least zero, shape (n,).
    """
    order = np.flatnonzero(weights)
    order = order[np.argsort(values[order])]
    values = values[order]
    distinct = np.unique(values)
    if len(distinct) <= MAX_BINS:
        return np.asarray(0.5 * (distinct[:-1] + distinct[1:]))
    summed = np.cumsum(weights[order])
    wanted = np.linspace(0.0, 100.0, MAX_BINS + 1)[1:-1] / 100.0 * summed[-1]  # rounded as the regression would
    at = np.minimum(np.searchsorted(summed, wanted), len(values) - 1)
    after = np.minimum(at + 1, len(values) - 1)
    is_inside = summed[at] - wanted > np.finfo(np.float64).eps
    return np.unique(np.where(is_inside, values[at], 0.5 * (values[at] + values[after])))


def _bins_of(rows: Floats, edges: Sequence[Floats]) -> Floats:
    """Return the numbers of the bins that coordinates lie in, shape as ``rows``."""
    bins = [np.searchsorted(edge, column) for edge, column in zip(edges, rows.T, strict=True)]
    return np.column_stack(bins).astype(np.float64)


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
