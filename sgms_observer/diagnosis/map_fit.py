"""Fit of a smooth map to the remaining residual, over one or two coordinates."""

from __future__ import annotations

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.coordinates import CONTACT
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least
from sgms_observer.diagnosis.evidence import Improvement, improvement
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.map_columns import MapColumns, blocks_left, path_of, smooth_values
from sgms_observer.diagnosis.map_formula import Formula
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.effects.learnt_map import LearntMap, learnt_coordinates
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units

MAP_NAMES = ("learnt_map", "learnt_map_2", "learnt_map_3")
COORDINATES = (
    ("position",), ("position", "direction"), ("velocity",), ("time",), ("time", "direction"), ("travel", "direction"),
    ("dwell", "direction"), ("load", "direction"), ("position", "time"), ("velocity", "load"),
)  # fmt: skip
"""Coordinates that are tried. A map with fewer values is preferred unless a larger one predicts better."""
AT_REST = (("rest",), ("rest", "direction"))
"""Coordinates of what relaxes while the stage rests."""
OF_CONTACT = frozenset({*CONTACT, "load", "rest"})
"""Coordinates that the force of any contact law may depend on."""
POINTS = {1: 24, 2: 10}
"""Number of grid points of a coordinate, by the number of coordinates with a grid."""

FEW_DATA = 0.05
"""Share of the data that may lie below the lowest force of a map."""


@dataclass(frozen=True)
class FittedMap:
    """A fitted map and its improvement.

    Attributes:
        map: the map.
        coordinates: names of its coordinates.
        improvement: improvement on the evaluated recordings [N^2].
        share: closed share of the squared gap there.
        sentence: description of the map.
        data_shares: weight of the data of each value of the map, relative to the largest.
        formula: short formula that predicts as well, or None.
    """

    map: LearntMap
    coordinates: tuple[str, ...]
    improvement: Improvement
    share: float
    sentence: str
    data_shares: Floats
    formula: Formula | None = None

    @property
    def is_of_contact(self) -> bool:
        """Return whether the force may be that of another contact law."""
        return set(self.coordinates) <= OF_CONTACT

    @property
    def is_at_rest(self) -> bool:
        """Return whether the force relaxes at rest. There a motionless stage shows what its contact holds."""
        return self.coordinates in AT_REST

    @property
    def is_friction_curve(self) -> bool:
        """Return whether the force depends on the velocity alone, as the friction of every sliding contact does."""
        return self.coordinates == ("velocity",)

    def is_beyond_contact(self, is_contact_hidden: bool) -> bool:
        """Return whether the force is surely not that of another contact.

        Args:
            is_contact_hidden: whether the encoder is too coarse for the contact.
        """
        return not (self.is_at_rest or self.is_friction_curve or (is_contact_hidden and self.is_of_contact))

    def lowest_force(self, sign: float) -> float:
        """Return the smallest force in one direction that is the same for both directions of motion [N].

        A twentieth of the data may lie below it: a map is uncertain where it has few.

        Args:
            sign: 1 or -1, the direction of the force.
        """
        force, shares = sign * self.map.table(), self.data_shares.reshape(self.map.table().shape)
        if "direction" in self.coordinates:
            force, shares = np.mean(force, axis=-1), np.sum(shares, axis=-1)
        order = np.argsort(force, axis=None)
        total = np.cumsum(shares.ravel()[order])
        return float(force.ravel()[order][np.searchsorted(total, FEW_DATA * total[-1])])

    @property
    def settings(self) -> EffectSettings:
        """Return the map as an effect of the parameter file."""
        return self.map.settings()


def fit_map(
    fitted: WeightedResidual, evaluated: WeightedResidual, name: str, units: Units, criteria: Criteria,
    over: Sequence[tuple[str, ...]] = COORDINATES,
) -> FittedMap | None:  # fmt: skip
    """Return the map that predicts most of a residual on data it was not fitted to, or None if none is significant.

    Args:
        fitted: residual on the fitted recordings.
        evaluated: residual on the evaluated recordings. The same object as ``fitted`` if there are no others; the
            prediction is then cross-validated.
        name: name of the effect, one of ``MAP_NAMES``.
        units: units of the axis.
        criteria: thresholds.
        over: coordinates of the maps that are tried.
    """
    found: list[tuple[FittedMap, list[Floats]]] = []
    tried = len(COORDINATES) + len(AT_REST)
    for coordinates in over:
        solved = _solved(coordinates, fitted, evaluated, criteria, name)
        if solved is None:
            continue
        gain = improvement(evaluated.blocks(criteria.block), solved.left)
        if gain.z_score >= criteria.z_score_of(tried) and gain.share >= criteria.min_closed_share:
            text, shares = sentence(solved.map, units), solved.columns.data_shares
            found.append((FittedMap(solved.map, coordinates, gain, gain.share, text, shares), solved.left))
    if not found:
        return None
    best = max(found, key=lambda pair: pair[0].improvement.decrease)
    for item in found:
        is_simpler = len(item[0].map.values) < len(best[0].map.values)
        if is_simpler and improvement(item[1], best[1]).z_score < criteria.min_z_score:
            return item[0]
    return best[0]


@dataclass(frozen=True)
class _Solved:
    """A map, its columns on the fitted recordings, and what it leaves in each block of the evaluated recordings."""

    map: LearntMap
    columns: MapColumns
    left: list[Floats]


def _solved(
    coordinates: tuple[str, ...],
    fitted: WeightedResidual,
    evaluated: WeightedResidual,
    criteria: Criteria,
    name: str = MAP_NAMES[0],
) -> _Solved | None:
    """Return the map over some coordinates, or None if one of them hardly varies; arguments as of ``fit_map``."""
    empty = _empty(coordinates, fitted.motions, name)
    if empty is None:
        return None
    columns = MapColumns.of(empty, fitted)
    solve = smooth_values(empty, columns)
    others = None if fitted is evaluated else MapColumns.of(empty, evaluated)
    left = blocks_left(evaluated, columns.predicted(solve, others), criteria.block)
    return _Solved(empty.filled(solve(columns.rows, columns.target)), columns, left)


def maps_over(coordinates: Set[str]) -> list[tuple[str, ...]]:
    """Return the coordinates of maps that depend on nothing but some coordinates, and perhaps on the direction."""
    return [key for key in COORDINATES if set(key) <= coordinates | {"direction"} and set(key) & coordinates]


def left_by_best_map(
    pair: tuple[WeightedResidual, WeightedResidual], over: Sequence[tuple[str, ...]], criteria: Criteria
) -> list[Floats] | None:
    """Return what the best predicting map leaves in each block of the evaluated recordings, weighted [N].

    Args:
        pair: residual on the fitted and on the evaluated recordings; as in ``fit_map``.
        over: coordinates of the maps that are tried.
        criteria: thresholds.

    Returns:
        None if all coordinates hardly vary.
    """
    tried = [found.left for key in over if (found := _solved(key, *pair, criteria))]
    return min(tried, key=_squared, default=None)


def _squared(blocks: Sequence[Floats]) -> float:
    """Return the sum of squares of all blocks."""
    return sum(float(part @ part) for part in blocks)


@dataclass(frozen=True)
class EffectAndMap:
    """An effect beside a map over its coordinates.

    Attributes:
        added: test that the map takes less than half of what the effect closes.
        left: what effect and map leave in each block of the evaluated recordings, weighted [N].
    """

    added: Test
    left: list[Floats]


def effect_and_map(
    name: str,
    without: tuple[WeightedResidual, WeightedResidual],
    with_it: tuple[WeightedResidual, WeightedResidual],
    over: Sequence[tuple[str, ...]],
    criteria: Criteria,
) -> EffectAndMap | None:
    """Return an effect beside the map over its coordinates that predicts best without it; None if they hardly vary.

    A map has few values. It cannot take what is finer than its grid, as a ripple with a short pitch is; what it can
    take needs no name.

    Args:
        name: the effect.
        without, with_it: residual on the fitted and on the evaluated recordings, without the effect and with it; as in
            ``fit_map``.
        over: coordinates of the maps that are tried.
        criteria: thresholds.
    """
    tried = [(key, found.left) for key in over if (found := _solved(key, *without, criteria))]
    if not tried:
        return None
    key, left_alone = min(tried, key=lambda pair: _squared(pair[1]))
    both = _solved(key, *with_it, criteria)
    assert both is not None  # on the same recordings
    alone = improvement(without[1].blocks(criteria.block), with_it[1].blocks(criteria.block))
    gain = improvement(left_alone, both.left)
    is_significant = gain.z_score >= criteria.min_z_score
    share = gain.decrease / max(alone.decrease, 1.0e-300) if is_significant else 0.0
    title = "share of what it closes that it surely closes beside a map over its coordinates"
    return EffectAndMap(at_least(name, title, share, criteria.min_imitable_share), both.left)


def with_map(maps: Sequence[FittedMap], another: FittedMap, units: Units) -> list[FittedMap]:
    """Return maps with one more. A map over the same coordinates as an earlier one is added to that one.

    Args:
        maps: maps so far.
        another: map of their residual on the same recordings, so that equal coordinates have equal grids.
        units: units of the axis.
    """
    same = next((item for item in maps if item.coordinates == another.coordinates), None)
    if same is None:
        return [*maps, another]
    values = np.add(same.map.values, another.map.values)
    gain = replace(same.improvement, decrease=same.improvement.decrease + another.improvement.decrease)
    total = replace(same.map, values=tuple(values.tolist()))
    both = FittedMap(total, same.coordinates, gain, gain.share, sentence(total, units), same.data_shares)
    return [both if item is same else item for item in maps]


def _empty(coordinates: tuple[str, ...], motions: Sequence[Motion], name: str) -> LearntMap | None:
    """Return a map of zero force over the range of the recordings, or None if a coordinate hardly varies."""
    reached = np.vstack([learnt_coordinates(coordinates, path_of(motion)) for motion in motions])
    gridded = [key for key in coordinates if key != "direction"]
    grids: list[tuple[float, ...]] = []
    for place, key in enumerate(coordinates):
        if key == "direction":
            grids.append(())
            continue
        low, high = float(reached[:, place].min()), float(reached[:, place].max())
        if not high - low > 1.0e-9 * max(abs(low), abs(high)):
            return None
        grids.append(tuple(np.linspace(low, high, POINTS[len(gridded)]).tolist()))
    stroke = max(float(np.ptp(motion.position)) for motion in motions)
    step = max(max(motion.resolution for motion in motions), 1.0e-4 * stroke)
    empty = LearntMap.zero(coordinates, tuple(grids), 4.0 * step)
    return LearntMap(coordinates, empty.grids, empty.values, empty.reversal_distance, name=name)


def sentence(learnt: LearntMap, units: Units) -> str:
    """Return a description of a map in words.

    Args:
        learnt: the map.
        units: units of the axis.
    """
    table = learnt.table()
    along = " and ".join(key for key in learnt.coordinates if key != "direction")
    low, high = float(table.min()), float(table.max())
    span = f"{low:.3g} to {high:.3g} {units.effort}"
    if "direction" not in learnt.coordinates:
        sides = "" if "velocity" in learnt.coordinates else ", the same in both directions"
        return f"a {units.effort_word} that varies along the {along}, {span}{sides}"
    backward, forward = table[..., 0], table[..., 1]
    friction, common = 0.5 * (forward - backward), 0.5 * (forward + backward)
    if np.ptp(friction) > 2.0 * np.ptp(common):
        return (
            f"a friction level that varies along the {along}, {float(friction.min()):.3g} to"
            f" {float(friction.max()):.3g} {units.effort} beside the model's"
        )
    if np.ptp(common) > 2.0 * np.ptp(friction):
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
