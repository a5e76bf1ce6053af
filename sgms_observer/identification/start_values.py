"""Start values of the element distribution: the solution of a convex problem, merged into clusters.

On a flat Stribeck curve the friction of many elements with given slip deflections is linear in their forces. A
non-negative least-squares fit over a log-spaced grid of deflections is unique, needs no start values, and shows the
distribution as atoms; neighbouring atoms are merged until the wanted number of elements is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from sgms_observer.identification.effect_terms import EffectVector
from sgms_observer.identification.linear_effects import LinearEffects
from sgms_observer.identification.prepared import Prepared
from sgms_observer.identification.problem import Parameters
from sgms_observer.identification.simulation import ElementShape, unit_elements

Floats = NDArray[np.float64]

_GRID_PER_DECADE = 5
_ROWS = 40_000  # largest number of rows for a start
_NEGLIGIBLE = 5.0e-3  # of the Coulomb force: smaller atoms are dropped
_FRICTION_SHARE = 0.95
_MARGIN = 5.0  # largest deflection of the second grid over the slip deflection of the first fit
_MAX_OPPOSED_RATIO = 0.9  # squared residual with reversed effort over that without; below it the sign is reversed
_BUMPS = (0.2, 1.0, 5.0)  # of the start's Stribeck velocity: widths of the rise at low speed


@dataclass(frozen=True)
class Atoms:
    """The convex fit.

    Attributes:
        deflection: slip deflection of each atom [m], ascending.
        force: its force [N].
        mass: [kg].
        viscous: [N s/m].
        offset: [N].
        rise: share by which friction at rest exceeds friction at speed [-].
        effects: values of the effects, those with a linear strength fitted.
        cost: mean squared residual [N^2].
        opposed_cost: the same with reversed effort; smaller if the effort has the opposite sign of the position.
    """

    deflection: Floats
    force: Floats
    mass: float
    viscous: float
    offset: float
    rise: float
    effects: EffectVector
    cost: float
    opposed_cost: float

    @property
    def slip_deflection(self) -> float:
        """Slip deflection below which 95 % of the friction has built up [m]."""
        share = np.cumsum(self.force) / self.force.sum()
        return float(self.deflection[np.searchsorted(share, _FRICTION_SHARE)])

    @property
    def is_opposed(self) -> bool:
        """Whether friction and mass fit the reversed effort better."""
        return self.opposed_cost < _MAX_OPPOSED_RATIO * self.cost


def fit_atoms(
    data: Sequence[Prepared],
    shape: ElementShape,
    smallest: float,
    largest: float,
    stribeck_velocity: float,
    terms: LinearEffects,
) -> Atoms:
    """Fit the distribution over a coarse grid of slip deflections, then over a grid up to the largest deflection.

    Args:
        data: prepared recordings.
        shape: smoothing of the elements.
        smallest: smallest deflection of the grid [m].
        largest: largest deflection of the grid [m].
        stribeck_velocity: order of magnitude of v_s [m/s].
        terms: effects with linear strengths.

    Raises:
        DataError: if the recordings show no friction.
    """
    first = _fit(data, shape, smallest, largest, stribeck_velocity, 10.0 * smallest, terms)
    if first.is_opposed or first.force.sum() <= 0.0:
        return first
    slip_deflection = first.slip_deflection
    largest = min(largest, max(_MARGIN * slip_deflection, 4.0 * smallest))
    return _fit(data, shape, smallest, largest, stribeck_velocity, slip_deflection, terms)


def _fit(
    data: Sequence[Prepared],
    shape: ElementShape,
    smallest: float,
    largest: float,
    stribeck_velocity: float,
    forgotten: float,
    terms: LinearEffects,
) -> Atoms:
    """Solve the convex problem on one grid, once elements up to deflection ``forgotten`` have forgotten their start."""
    count = max(3, int(np.ceil(_GRID_PER_DECADE * np.log10(largest / smallest))) + 1)
    grid = np.geomspace(smallest, largest, count)
    rows, efforts = [], []
    for piece, base, added in zip(data, terms.base, terms.columns, strict=True):
        mask = piece.settled(forgotten)
        if not np.any(mask):
            mask = piece.usable
        elements = unit_elements(piece.position, piece.period, grid, shape)
        velocity: Floats = np.gradient(piece.position) / piece.period
        bumps = [np.sign(velocity) * np.exp(-((velocity / (share * stribeck_velocity)) ** 2)) for share in _BUMPS]
        columns = piece.low_pass(np.column_stack([elements, *bumps]))
        stride = max(1, int(mask.sum()) * len(data) // _ROWS)
        ones = np.ones(len(piece.time))
        matrix = np.column_stack([columns, piece.acceleration, piece.velocity, ones, -ones, added, -added])
        rows.append(matrix[mask][::stride])
        efforts.append((piece.effort(piece.time) - base)[mask][::stride])
    matrix, effort = np.concatenate(rows), np.concatenate(efforts)
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    orthogonal, triangle = np.linalg.qr(matrix / scale)
    projected = orthogonal.T @ effort
    orthogonal_square = float(effort @ effort - projected @ projected)  # squared norm outside the columns
    solution, norm = nnls(triangle, projected)
    _opposed, opposed_norm = nnls(triangle, -projected)
    weights = solution / scale
    force = weights[:count]
    total = float(force.sum())
    keep = force > _NEGLIGIBLE * total
    rest = weights[count + len(_BUMPS) :]
    plus, minus = np.split(rest[4:], 2)
    return Atoms(
        grid[keep],
        force[keep],
        float(rest[0]),
        float(rest[1]),
        float(rest[2] - rest[3]),
        float(weights[count : count + len(_BUMPS)].sum()) / max(total, 1e-300),
        terms.vector_of(plus - minus),
        max(float(norm**2) + orthogonal_square, 1e-300) / len(effort),
        max(float(opposed_norm**2) + orthogonal_square, 1e-300) / len(effort),
    )


def cluster(atom_deflection: Floats, atom_force: Floats, count: int) -> tuple[Floats, Floats]:
    """Merge or split atoms into ``count`` elements.

    Args:
        atom_deflection: slip deflection of each atom [m], ascending.
        atom_force: its force [N].
        count: number of elements.

    Returns:
        Slip deflection [m] and force [N] of each element, ascending in deflection.
    """
    deflection, force = list(atom_deflection), list(atom_force)
    while len(force) > count:
        losses = [
            force[i] * force[i + 1] / (force[i] + force[i + 1]) * np.log(deflection[i + 1] / deflection[i]) ** 2
            for i in range(len(force) - 1)
        ]
        i = int(np.argmin(losses))
        total = force[i] + force[i + 1]
        # the stiffness of the pair stays the same: a reversal shows it first
        deflection[i] = total / (force[i] / deflection[i] + force[i + 1] / deflection[i + 1])
        force[i] = total
        del deflection[i + 1], force[i + 1]
    while len(force) < count:
        i = int(np.argmax(force))
        deflection[i : i + 1] = [deflection[i] / 1.5, deflection[i] * 1.5]
        force[i : i + 1] = [0.5 * force[i], 0.5 * force[i]]
    return np.array(deflection), np.array(force)


def start_parameters(atoms: Atoms, count: int, stribeck_velocity: float, delay: float, rate: float) -> Parameters:
    """Return start values for ``count`` elements.

    Args:
        atoms: the convex fit.
        count: number of elements.
        stribeck_velocity: v_s [m/s].
        delay: [s].
        rate: c = C / f_C of the GMS model [1/s].
    """
    deflection, force = cluster(atoms.deflection, atoms.force, count)
    rho = min(max(1.0 + atoms.rise, 1.01), 3.0)
    scalars = np.array([atoms.mass, atoms.viscous, atoms.offset, delay, rho, stribeck_velocity, rate, 0.0])
    return Parameters(scalars, force / deflection, force, atoms.effects)


def merge_elements(parameters: Parameters, count: int) -> Parameters:
    """Return the same model with fewer elements.

    Args:
        parameters: a model with at least ``count`` elements.
        count: number of elements.
    """
    order = np.argsort(parameters.level / parameters.kappa)
    level = parameters.level[order]
    deflection, force = cluster(level / parameters.kappa[order], level, count)
    return Parameters(parameters.scalars, force / deflection, force, parameters.effects)
