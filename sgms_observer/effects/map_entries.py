"""Catalogue entries of the learnt maps: forces whose table stands in the parameter file."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import Any

from sgms_observer.effects.effect import Effect, EffectList, EffectParameter, Place
from sgms_observer.formulas import learnt_map as formula

MAX_VALUES = 10_000  # entries of one table; more makes a parameter file that ROS reads for seconds

_UNITS = {
    "position": "m",
    "velocity": "m/s",
    "acceleration": "m/s^2",
    "load": "m/s^2",
    "time": "s",
    "travel": "m",
    "dwell": "s",
    "rest": "s",
}
_MEANING = {
    "position": "grid over the position",
    "velocity": "grid over the velocity",
    "acceleration": "grid over the acceleration",
    "load": "grid over the magnitude of the acceleration",
    "time": "grid over the time since the first sample",
    "travel": "grid over the distance travelled since the first sample",
    "dwell": "grid over the time at rest before the present motion",
    "rest": "grid over the time at rest so far, zero in motion",
}
GRIDS = tuple(_UNITS)


def size_of(coordinates: tuple[str, ...], grids: Mapping[str, tuple[float, ...]]) -> int:
    """Return how many values a table over these coordinates has; the direction has two grid points, -1 and 1.

    Args:
        coordinates: the coordinates' names.
        grids: grid points by the coordinate's name [SI units].
    """
    size = 1
    for name in coordinates:
        size *= 2 if name == "direction" else len(grids[name])
    return size


def _map_faults(lists: Mapping[str, tuple[Any, ...]], where: str) -> list[str]:
    """Return one sentence per fault of a table; ``lists`` has coordinates, grids and values by name [SI units]."""
    coordinates = lists["coordinates"]
    faults = []
    if len(coordinates) not in (1, 2) or len(set(coordinates)) < len(coordinates):
        listed = ", ".join(coordinates)
        faults.append(f"{where}.coordinates = [{listed}] must name one coordinate or two different ones; correct it")
    for name in GRIDS:
        grid = lists[name]
        if name not in coordinates:
            if grid:
                faults.append(
                    f"{where}.{name} has a grid, but {where}.coordinates does not name {name};"
                    " add it or remove the grid"
                )
        elif len(grid) < 2:
            faults.append(
                f"{where}.{name} has {len(grid)} grid points and must have at least 2 in {_UNITS[name]},"
                f" because {where}.coordinates names {name}; add them"
            )
        else:
            faults += [
                f"{where}.{name} must rise from entry to entry, but entry {i + 2} is {high:g} after {low:g}"
                f" {_UNITS[name]}; sort the grid"
                for i, (low, high) in enumerate(pairwise(grid))
                if not high > low
            ][:1]
    wanted, values = size_of(coordinates, {name: lists[name] for name in GRIDS}), lists["values"]
    if len(values) != wanted and not faults:
        points = " x ".join(f"{2 if name == 'direction' else len(lists[name])} of {name}" for name in coordinates)
        faults.append(
            f"{where}.values has {len(values)} entries and must have {wanted} ({points}); give one force in N per grid"
            " point, the last coordinate running fastest"
        )
    if len(values) > MAX_VALUES:
        faults.append(f"{where}.values has {len(values)} entries and may have {MAX_VALUES} at most; use a coarser grid")
    return faults


def _entry(name: str) -> Effect:
    """Return a learnt map under this name."""
    return Effect(
        name,
        Place.ADDED_FORCE,
        (
            EffectParameter("scale", "-", 1.0, -10.0, 10.0, "factor on the table's forces", is_strength=True),
            EffectParameter("reversal_distance", "m", 1.0e-5, 1.0e-9, 1.0, "travel over which the direction reverses"),
        ),
        "F = scale * table(x1) or scale * table(x1, x2), linear between the grid points",
        "any shape: a force that a diagnosis learnt and could not name",
        "the motions that the axis will make: the table is zero beyond them",
        (),
        "Bishop 2006, Pattern Recognition and Machine Learning, ch. 3 (linear models of local basis functions)",
        formula.learnt_map,
        formula.learnt_map_next,
        (0.0, 0.0, 0.0, 0.0, 0.0),
        (
            EffectList("coordinates", "-", ("direction",), 0.0, 0.0, "one or two coordinates", formula.COORDINATES),
            *(EffectList(key, unit, (), -1.0e9, 1.0e9, _MEANING[key]) for key, unit in _UNITS.items()),
            EffectList(
                "values",
                "N",
                (0.0, 0.0),
                -1.0e6,
                1.0e6,
                "forces at the grid points, the last coordinate running fastest",
            ),
        ),
        _map_faults,
    )


MAP_EFFECTS = (_entry("learnt_map"), _entry("learnt_map_2"), _entry("learnt_map_3"))
