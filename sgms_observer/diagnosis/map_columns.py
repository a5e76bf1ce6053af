"""The values of a learnt map as a linear least-squares problem: columns, smoothness and cross-validation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.diagnosis.evidence import in_blocks
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.effects.learnt_map import LearntMap, MotionPath

Solve = Callable[[Floats, Floats], Floats]
"""Takes rows (n, k) and the weighted residual (n,), returns the values of a map (k,)."""

SMOOTHNESS = (1.0e-3, 1.0e-2, 1.0e-1, 1.0, 10.0)
"""Tried weights of the squared second differences, relative to the mean weight of the data of a grid point."""
FOLDS, FOLD_TIME = 5, 2.0
"""Number of folds of the cross-validation, and length of the pieces assigned to them in turn [s]."""

_RIDGE = 1.0e-3
"""Weight that draws every value to zero, relative to that of the smoothness. Where the data of a grid point weigh less
than this share of the mean, they do not determine its value: the smoothness would go on in a straight line there, as
far as the corner of a grid over velocity and load that no recording reaches."""


@dataclass(frozen=True)
class MapColumns:
    """A weighted residual and its derivative with respect to each value of a map.

    Attributes:
        rows: derivatives, shape (n, k).
        target: weighted residual [N], shape (n,).
        fold: fold of each row, shape (n,).
    """

    rows: Floats
    target: Floats
    fold: Ints

    @classmethod
    def of(cls, learnt: LearntMap, rest: WeightedResidual) -> MapColumns:
        """Return the columns of a map.

        Args:
            learnt: the map; its values do not matter.
            rest: the residual.
        """
        rows, folds = [], []
        for motion, weight in zip(rest.motions, rest.weights, strict=True):
            basis = learnt.basis(path_of(motion)).toarray()
            rows.append(weight[:, None] * motion.low_pass(basis.T).T)
            folds.append((motion.thinned(motion.time) / FOLD_TIME).astype(np.int64) % FOLDS)
        return cls(np.vstack(rows), np.concatenate(rest.weighted), np.concatenate(folds))

    @property
    def data_shares(self) -> Floats:
        """Return the weight of the data of each value, relative to the largest, shape (k,)."""
        weights = np.sum(self.rows**2, axis=0)
        return np.asarray(weights / max(float(weights.max()), 1e-300))

    def predicted(self, solve: Solve, others: MapColumns | None = None) -> Floats:
        """Return the prediction of the weighted residual of other recordings, or of each fold by the other folds.

        Args:
            solve: fit.
            others: columns of the recordings to predict. None: these, cross-validated.
        """
        if others is not None:
            return np.asarray(others.rows @ solve(self.rows, self.target))
        predicted = np.zeros(len(self.target))
        for fold in range(FOLDS):
            out = self.fold == fold
            if out.any() and not out.all():
                predicted[out] = self.rows[out] @ solve(self.rows[~out], self.target[~out])
        return predicted


def path_of(motion: Motion) -> MotionPath:
    """Return a motion in the form that a map is evaluated along."""
    return MotionPath(
        motion.period, position=motion.position, velocity=motion.velocity, acceleration=motion.acceleration,
        time=motion.time,
    )  # fmt: skip


def blocks_left(rest: WeightedResidual, predicted: Floats, length: float) -> list[Floats]:
    """Return a weighted residual minus its prediction, in blocks of time.

    Args:
        rest: the residual.
        predicted: of all recordings, weighted [N].
        length: of a block [s].
    """
    parts = np.split(predicted, np.cumsum([len(part) for part in rest.residual])[:-1])
    left = [part - guess for part, guess in zip(rest.weighted, parts, strict=True)]
    return in_blocks(left, rest.motions, length)


def smooth_values(learnt: LearntMap, columns: MapColumns) -> Solve:
    """Return the penalised least-squares fit with the smoothness that cross-validation prefers.

    Args:
        learnt: the map; its values do not matter.
        columns: its columns.
    """
    penalty = _penalty(learnt)

    def error(weight: float) -> float:
        predicted = columns.predicted(lambda rows, target: _solve(rows, target, weight * penalty))
        return float(np.sum((columns.target - predicted) ** 2))

    weight = min(SMOOTHNESS, key=error)
    return lambda rows, target: _solve(rows, target, weight * penalty)


def _penalty(empty: LearntMap) -> Floats:
    """Return the penalty matrix: squared second differences along each grid, plus a small multiple of the identity."""
    sizes = [len(grid) for grid in empty.grids]
    total = np.zeros((int(np.prod(sizes)), int(np.prod(sizes))))
    for place, key in enumerate(empty.coordinates):
        if key == "direction":
            continue
        second = np.diff(np.eye(sizes[place]), 2, axis=0)
        parts = [second.T @ second if i == place else np.eye(size) for i, size in enumerate(sizes)]
        whole: Floats = np.asarray(parts[0], dtype=np.float64)
        for part in parts[1:]:
            whole = np.asarray(np.kron(whole, part), dtype=np.float64)
        total += whole
    return total + _RIDGE * np.eye(len(total))


def _solve(rows: Floats, target: Floats, penalty: Floats) -> Floats:
    """Return the values of the penalised least-squares fit; those that no data determine stay between the others."""
    normal = rows.T @ rows
    scale = float(np.trace(normal)) / len(normal)
    values = np.linalg.solve(normal + max(scale, 1e-300) * penalty, rows.T @ target)
    reached = values[np.diag(normal) > _RIDGE * scale]
    return np.asarray(np.clip(values, reached.min(), reached.max()) if len(reached) else values)
