"""The unknown, learnt: a smooth map of the force that is left, over the one or two coordinates that carry it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import Improvement, improvement, in_blocks
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.effects.learnt_map import LearntMap, MotionPath, learnt_coordinates
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units

Floats = NDArray[np.float64]

MAP_NAMES = ("learnt_map", "learnt_map_2", "learnt_map_3")
COORDINATES = (
    ("position",), ("position", "direction"), ("velocity",), ("time",), ("time", "direction"), ("travel", "direction"),
    ("dwell", "direction"), ("load", "direction"), ("position", "time"), ("velocity", "load"),
)  # fmt: skip
"""Coordinates that are tried; a map over fewer goes before one over more where the data do not tell them apart."""
POINTS = {1: 24, 2: 10}
"""Grid points of a coordinate, by the number of coordinates that have a grid."""
SMOOTHNESS = (1.0e-3, 1.0e-2, 1.0e-1, 1.0, 10.0)
"""Weights of the squared second differences that are tried, over the mean weight of a grid point's data."""
FOLDS, FOLD_TIME = 5, 2.0
"""Parts that are left out in turn to choose the smoothness, and the length of their pieces [s]."""


@dataclass(frozen=True)
class FittedMap:
    """A learnt map and what it is worth.

    Attributes:
        map: the map.
        coordinates: names of its coordinates.
        improvement: on the recordings to judge on [N^2].
        share: closed share of the squared gap there.
        sentence: what it looks like.
    """

    map: LearntMap
    coordinates: tuple[str, ...]
    improvement: Improvement
    share: float
    sentence: str

    @property
    def settings(self) -> EffectSettings:
        """Return the map as an effect of the parameter file."""
        return self.map.settings()


@dataclass(frozen=True)
class _Columns:
    """Columns of a map's values in the weighted residual, and its pieces of time.

    Attributes:
        rows: shape (n, k).
        fold: part that each row belongs to, shape (n,).
    """

    rows: Floats
    fold: NDArray[np.int64]


def fit_map(
    known: WeightedResidual, judge: WeightedResidual, name: str, units: Units, criteria: Criteria
) -> FittedMap | None:
    """Learn the map that predicts most of a residual on data it was not fitted to, or None where none surely does.

    Args:
        known: what a model leaves of the recordings to learn from.
        judge: of those to judge on; the same object as ``known`` where there are no others: parts of them are then left
            out in turn.
        name: of the effect, one of ``MAP_NAMES``.
        units: of the axis.
        criteria: thresholds.
    """
    target = np.concatenate(known.weighted)
    found: list[tuple[FittedMap, list[Floats]]] = []
    for coordinates in COORDINATES:
        empty = _empty(coordinates, known.motions, name)
        if empty is None:
            continue
        columns = _columns(empty, known.motions, known.weights)
        penalty = _penalty(empty)
        weight = _smoothness(columns, target, penalty)
        values = _solve(columns.rows, target, weight * penalty)
        filled = empty.filled(values)
        if known is judge:
            predicted = _in_turn(columns, target, weight * penalty)
        else:
            predicted = _columns(empty, judge.motions, judge.weights).rows @ values
        parts = np.split(predicted, np.cumsum([len(part) for part in judge.residual])[:-1])
        left = [part - guess for part, guess in zip(judge.weighted, parts, strict=True)]
        after = in_blocks(left, judge.motions, criteria.block)
        gain = improvement(judge.blocks(criteria.block), after)
        if gain.z_score >= criteria.z_score_of(len(COORDINATES)) and gain.share >= criteria.min_closed_share:
            found.append((FittedMap(filled, coordinates, gain, gain.share, sentence(filled, units)), after))
    if not found:
        return None
    best = max(found, key=lambda pair: pair[0].improvement.decrease)
    for item in found:
        is_simpler = len(item[0].map.values) < len(best[0].map.values)
        if is_simpler and improvement(item[1], best[1]).z_score < criteria.min_z_score:
            return item[0]
    return best[0]


def _path(motion: Motion) -> MotionPath:
    """Return a motion as a map sees it."""
    return MotionPath(
        motion.period, position=motion.position, velocity=motion.velocity, acceleration=motion.acceleration,
        time=motion.time,
    )  # fmt: skip


def _empty(coordinates: tuple[str, ...], motions: Sequence[Motion], name: str) -> LearntMap | None:
    """Return a map of zero force over the range of the recordings, or None where a coordinate hardly varies."""
    seen = np.vstack([learnt_coordinates(coordinates, _path(motion)) for motion in motions])
    gridded = [key for key in coordinates if key != "direction"]
    grids: list[tuple[float, ...]] = []
    for place, key in enumerate(coordinates):
        if key == "direction":
            grids.append(())
            continue
        low, high = float(seen[:, place].min()), float(seen[:, place].max())
        if not high - low > 1.0e-9 * max(abs(low), abs(high)):
            return None
        grids.append(tuple(np.linspace(low, high, POINTS[len(gridded)]).tolist()))
    stroke = max(float(np.ptp(motion.position)) for motion in motions)
    step = max(max(motion.resolution for motion in motions), 1.0e-4 * stroke)
    empty = LearntMap.zero(coordinates, tuple(grids), 4.0 * step)
    return LearntMap(coordinates, empty.grids, empty.values, empty.reversal_distance, name=name)


def _columns(empty: LearntMap, motions: Sequence[Motion], weights: Sequence[Floats]) -> _Columns:
    """Return what each value of a map changes in the weighted residual."""
    rows, folds = [], []
    for motion, weight in zip(motions, weights, strict=True):
        basis = empty.basis(_path(motion)).toarray()
        rows.append(weight[:, None] * np.column_stack([motion.low_pass(column) for column in basis.T]))
        folds.append((motion.thinned(motion.time) / FOLD_TIME).astype(np.int64) % FOLDS)
    return _Columns(np.vstack(rows), np.concatenate(folds))


def _penalty(empty: LearntMap) -> Floats:
    """Return the matrix of squared second differences along each grid, and a little of the values themselves."""
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
    return total + 1.0e-3 * np.eye(len(total))


def _solve(rows: Floats, target: Floats, penalty: Floats) -> Floats:
    """Return the values of the penalised least-squares fit."""
    normal = rows.T @ rows
    scale = float(np.trace(normal)) / len(normal)
    return np.asarray(np.linalg.solve(normal + max(scale, 1e-300) * penalty, rows.T @ target))


def _in_turn(columns: _Columns, target: Floats, penalty: Floats) -> Floats:
    """Return the prediction of each part by the fit without it."""
    predicted = np.zeros(len(target))
    for fold in range(FOLDS):
        out = columns.fold == fold
        if out.any() and not out.all():
            predicted[out] = columns.rows[out] @ _solve(columns.rows[~out], target[~out], penalty)
    return predicted


def _smoothness(columns: _Columns, target: Floats, penalty: Floats) -> float:
    """Return the weight of the second differences that predicts best what is left out in turn."""
    return min(
        SMOOTHNESS, key=lambda weight: float(np.sum((target - _in_turn(columns, target, weight * penalty)) ** 2))
    )


def sentence(learnt: LearntMap, units: Units) -> str:
    """Return in words what a map looks like.

    Args:
        learnt: the map.
        units: of the axis.
    """
    table = learnt.table()
    along = " and ".join(key for key in learnt.coordinates if key != "direction")
    low, high = float(table.min()), float(table.max())
    span = f"{low:.3g} to {high:.3g} {units.effort}"
    if "direction" not in learnt.coordinates:
        return f"a {units.effort_word} that varies along the {along}, {span}, the same in both directions"
    backward, forward = table[..., 0], table[..., 1]
    level, common = 0.5 * (forward - backward), 0.5 * (forward + backward)
    if np.ptp(level) > 2.0 * np.ptp(common):
        return (
            f"a friction level that varies along the {along}, {float(level.min()):.3g} to {float(level.max()):.3g}"
            f" {units.effort} beside the model's"
        )
    if np.ptp(common) > 2.0 * np.ptp(level):
        return f"a {units.effort_word} that varies along the {along}, {span}, almost the same in both directions"
    one, other = float(np.ptp(forward)), float(np.ptp(backward))
    if max(one, other) > 2.0 * min(one, other):
        word = "forward" if one > other else "backward"
        part = forward if one > other else backward
        return (
            f"friction that varies along the {along}, {float(part.min()):.3g} to {float(part.max()):.3g} {units.effort}"
            f" beside the model's, in {word} motion only"
        )
    return f"a {units.effort_word} that varies along the {along} and differs between the directions, {span}"
