"""A short formula for a learnt map: proposed where it predicts data it was not fitted to as well as the map.

A formula is ``f(x)`` of one coordinate ``x`` with a grid, the same in both directions, times the direction, in one
direction only, or with amplitudes of its own in each. On the grid of the map it is a map with fewer free numbers, so
both are fitted to the same residual and judged alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import minimize

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.map_columns import MapColumns, blocks_left, smooth_values
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.learnt_map import LearntMap
from sgms_observer.settings.units import Units

_STARTS = 16
"""Number of start values of each shape parameter."""
_SIDES = {
    "": ([[1.0]], "{}"),
    "same": ([[1.0, 1.0]], "{}"),
    "friction": ([[-1.0, 1.0]], "({}) times the direction"),
    "forward": ([[0.0, 1.0]], "{} in forward motion, 0 in backward motion"),
    "backward": ([[1.0, 0.0]], "{} in backward motion, 0 in forward motion"),
    "both": ([[0.0, 1.0], [1.0, 0.0]], "{} in forward motion, {} in backward motion"),
}
"""Factors in backward and forward motion for each set of amplitudes, and the text. The first is for maps without
direction."""


@dataclass(frozen=True)
class Form:
    """Form of a formula: a constant and terms with an amplitude each, over one coordinate.

    Attributes:
        coordinates: coordinates that the form is tried for.
        terms: values of the terms at x, given the shape parameters.
        text: text of the terms, given the name of x, the amplitudes without the constant, and the shape parameters.
        ranges: smallest and largest value of each shape parameter, given the range of x.
    """

    coordinates: frozenset[str]
    terms: Callable[[Floats, Sequence[float]], Sequence[Floats]]
    text: Callable[[str, Sequence[float], Sequence[float]], str]
    ranges: Callable[[float, float], Sequence[tuple[float, float]]]


@dataclass(frozen=True)
class Formula:
    """A formula that predicts as well as a map.

    Attributes:
        text: the formula with its values, in the units of the axis.
        map: the same on the grid of the map.
        parameter_count: number of fitted values.
        left: share of what the map closes that the formula leaves.
    """

    text: str
    map: LearntMap
    parameter_count: int
    left: float


def _signed(value: float) -> str:
    """Return a number with its sign as the next term of a sum."""
    return f"{'-' if value < 0.0 else '+'} {abs(value):.3g}"


def _wave_text(x: str, amplitudes: Sequence[float], shape: Sequence[float]) -> str:
    """Return a sine with its phase."""
    size, phase = math.hypot(*amplitudes), math.atan2(amplitudes[1], amplitudes[0])
    return f"+ {size:.3g} sin(2 pi {x} / {shape[0]:.4g} {_signed(phase)})"


_PLACES, _SPANS = frozenset({"position"}), frozenset({"time", "travel", "dwell", "rest"})
_ALL = _PLACES | _SPANS | {"velocity", "load"}
FORMS = (
    Form(
        _ALL,
        lambda x, _: [x],
        lambda x, a, _: f"{_signed(a[0])} {x}",
        lambda low, high: (),
    ),
    Form(
        _ALL - _SPANS,
        lambda x, _: [x, x**2],
        lambda x, a, _: f"{_signed(a[0])} {x} {_signed(a[1])} {x}^2",
        lambda low, high: (),
    ),
    Form(
        frozenset({"velocity"}),
        lambda x, shape: [np.sign(x) * np.abs(x) ** shape[0]],
        lambda x, a, shape: f"{_signed(a[0])} sgn({x}) |{x}|^{shape[0]:.3g}",
        lambda low, high: ((0.2, 3.0),),
    ),
    Form(
        frozenset({"velocity", "position"}),
        lambda x, shape: [np.tanh((x - shape[1]) / shape[0])],
        lambda x, a, shape: f"{_signed(a[0])} tanh(({x} {_signed(-shape[1])}) / {shape[0]:.3g})",
        lambda low, high: ((0.02 * (high - low), high - low), (low, high)),
    ),
    Form(
        _PLACES,
        lambda x, shape: [np.sin(2.0 * np.pi * x / shape[0]), np.cos(2.0 * np.pi * x / shape[0])],
        _wave_text,
        lambda low, high: ((0.125 * (high - low), 2.0 * (high - low)),),
    ),
    Form(
        _PLACES,
        lambda x, shape: [np.exp(-(((x - shape[1]) / shape[0]) ** 2))],
        lambda x, a, shape: f"{_signed(a[0])} exp(-(({x} {_signed(-shape[1])}) / {shape[0]:.3g})^2)",
        lambda low, high: ((0.04 * (high - low), 0.5 * (high - low)), (low, high)),
    ),
    Form(
        _SPANS,
        lambda x, shape: [np.exp(-x / shape[0])],
        lambda x, a, shape: f"{_signed(a[0])} exp(-{x} / {shape[0]:.3g})",
        lambda low, high: ((0.04 * (high - low), 2.0 * (high - low)),),
    ),
    Form(
        _SPANS,
        lambda x, shape: [np.log1p(x / shape[0])],
        lambda x, a, shape: f"{_signed(a[0])} ln(1 + {x} / {shape[0]:.3g})",
        lambda low, high: ((0.01 * (high - low), high - low),),
    ),
)
"""Forms that are tried. A wave needs eight periods at most, so that the grid shows it."""


def formula_of(
    learnt: LearntMap, fitted: WeightedResidual, evaluated: WeightedResidual, units: Units, criteria: Criteria
) -> Formula | None:
    """Return the shortest formula that closes nearly all of what the map closes, or None.

    Neither the map nor another formula may predict significantly better.

    Args:
        learnt: the map.
        fitted: residual without the map on the fitted recordings.
        evaluated: the same on the evaluated recordings. The same object as ``fitted`` if there are no others; the
            predictions are then cross-validated.
        units: units of the axis.
        criteria: thresholds.
    """
    gridded = [name for name in learnt.coordinates if name != "direction"]
    if len(gridded) != 1 or learnt.coordinates[0] != gridded[0]:
        return None
    columns = MapColumns.of(learnt, fitted)
    others = None if evaluated is fitted else MapColumns.of(learnt, evaluated)
    before = evaluated.blocks(criteria.block)

    def left(solve: Callable[[Floats, Floats], Floats]) -> list[Floats]:
        return blocks_left(evaluated, columns.predicted(solve, others), criteria.block)

    by_map = left(smooth_values(learnt, columns))
    closed = improvement(before, by_map).decrease
    found: list[tuple[_Shaped, list[Floats], float]] = []
    sides = [side for side in _SIDES if bool(side) == ("direction" in learnt.coordinates)]
    for form, side in product(FORMS, sides):
        if gridded[0] not in form.coordinates:
            continue
        shaped = _shaped(form, side, learnt, columns)
        after = left(shaped.solve)
        decrease = improvement(before, after).decrease
        is_better = improvement(after, by_map).z_score >= criteria.min_z_score
        if not is_better and decrease >= (1.0 - criteria.min_predictable_share) * closed > 0.0:
            found.append((shaped, after, decrease))
    if not found:
        return None
    _, best, _ = max(found, key=lambda item: item[2])
    equal = [item for item in found if improvement(item[1], best).z_score < criteria.min_z_score]
    shortest, _, decrease = min(equal, key=lambda item: (item[0].parameter_count, -item[2]))
    return shortest.formula(columns, units, 1.0 - decrease / closed)


@dataclass(frozen=True)
class _Shaped:
    """A form with its shape parameters on the grid of a map, whose first coordinate has the grid.

    Attributes:
        form: the form.
        side: key of ``_SIDES``.
        shape: shape parameters.
        learnt: the map.
    """

    form: Form
    side: str
    shape: tuple[float, ...]
    learnt: LearntMap

    @property
    def basis(self) -> Floats:
        """Return the values of the map for unit amplitudes, shape (k, number of amplitudes)."""
        grid = np.array(self.learnt.grids[0])
        terms = [np.ones(len(grid)), *self.form.terms(grid, self.shape)]
        factors, _ = _SIDES[self.side]
        return np.column_stack([np.kron(term, factor) for factor in factors for term in terms])

    @property
    def parameter_count(self) -> int:
        """Return the number of fitted values."""
        return int(self.basis.shape[1]) + len(self.shape)

    def amplitudes(self, rows: Floats, target: Floats) -> Floats:
        """Return the amplitudes of the least-squares fit."""
        return np.asarray(np.linalg.lstsq(rows @ self.basis, target, rcond=None)[0])

    def solve(self, rows: Floats, target: Floats) -> Floats:
        """Return the values of the map of the least-squares fit."""
        return np.asarray(self.basis @ self.amplitudes(rows, target))

    def formula(self, columns: MapColumns, units: Units, left: float) -> Formula:
        """Return the fitted formula.

        Args:
            columns: the residual that it is fitted to.
            units: units of the axis.
            left: share of what the map closes that it leaves.
        """
        amplitudes = self.amplitudes(columns.rows, columns.target)
        name = self.learnt.coordinates[0]
        unit = next(item.unit for item in effect(self.learnt.name).lists if item.name == name)
        factors, sides = _SIDES[self.side]
        parts = [
            f"{one[0]:.3g} {self.form.text(name, one[1:].tolist(), self.shape)}"
            for one in amplitudes.reshape(len(factors), -1)
        ]
        low, high = self.learnt.grids[0][0], self.learnt.grids[0][-1]
        where = f"{name} in {units.of(unit)}, {low:.3g} to {high:.3g}"
        text = f"{units.effort_word} = {sides.format(*parts)} ({units.effort}, {where})"
        values = self.learnt.filled(self.basis @ amplitudes)
        return Formula(text, values, self.parameter_count, left)


def _shaped(form: Form, side: str, learnt: LearntMap, columns: MapColumns) -> _Shaped:
    """Return a form with the shape parameters that fit the residual best.

    Args:
        form: the form.
        side: key of ``_SIDES``.
        learnt: the map.
        columns: the residual that it is fitted to.
    """
    ranges = form.ranges(learnt.grids[0][0], learnt.grids[0][-1])
    normal, right = columns.rows.T @ columns.rows, columns.rows.T @ columns.target

    def within(shape: Sequence[float]) -> _Shaped:
        inside = tuple(float(np.clip(value, *limits)) for value, limits in zip(shape, ranges, strict=True))
        return _Shaped(form, side, inside, learnt)

    def cost(shape: Sequence[float]) -> float:
        basis = within(shape).basis
        amplitudes = np.linalg.lstsq(basis.T @ normal @ basis, basis.T @ right, rcond=None)[0]
        return -float(amplitudes @ (basis.T @ right))

    if not ranges:
        return within(())
    starts = [(np.geomspace if low > 0.0 else np.linspace)(low, high, _STARTS) for low, high in ranges]
    start = np.array(min(product(*starts), key=cost))
    simplex = np.array([start, *(start + 0.05 * np.diag([high - low for low, high in ranges]))])
    best = minimize(cost, start, method="Nelder-Mead", options={"initial_simplex": simplex, "xatol": 1.0e-6})
    return within(best.x)
