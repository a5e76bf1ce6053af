"""Start values of the element distribution: the solution of a convex problem, merged into clusters.

On a flat Stribeck curve the friction of many elements with given slip deflections is linear in their forces. A
non-negative least-squares fit over a log-spaced grid of deflections is unique, needs no start values, and shows the
distribution as atoms; neighbouring atoms are merged until the wanted number of elements is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import nnls

from sgms_observer.arrays import Floats
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.errors import DataError
from sgms_observer.identification.effect_terms import GRAVITY, SPRING, EffectTerms, EffectVector, effect_terms
from sgms_observer.identification.linear_effects import LinearEffects, linear_effects
from sgms_observer.identification.prepared import Prepared, prepare_all
from sgms_observer.identification.problem import ELEMENTS, ElementShape, Parameters, unit_elements
from sgms_observer.identification.search import Scales, scales_of
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings

MIN_REVERSALS = 2
"""Fewer reversals cannot tell friction from whatever else changed at that time."""
_REVERSAL_SHARE = 0.02  # of the travel: a shorter way back is no reversal of the sliding
_MIN_GAIN = {GRAVITY: 0.05, SPRING: 0.2}
"""Share of the squared residual that an effect has to explain which the file does not have. A joint has gravity; any
force over the position has a slope, which need not be a spring: see docs/real_logs.md."""
_V_S_SHARES = (1.0e-3, 0.3)  # of the largest velocity: where the search for the Stribeck velocity starts
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


@dataclass(frozen=True)
class Start:
    """Start of the search.

    Attributes:
        data: prepared recordings.
        terms: effects of the balance.
        linear: their linear part.
        atoms: the convex fit.
        scales: typical sizes of the signals.
        velocity: start value of v_s [m/s].
        rate: start value of c = C / f_C of the GMS model [1/s].
    """

    data: list[Prepared]
    terms: EffectTerms
    linear: LinearEffects
    atoms: Atoms
    scales: Scales
    velocity: float
    rate: float

    def parameters(self, count: int, stribeck_velocity: float) -> Parameters:
        """Return start values for ``count`` elements.

        Args:
            count: number of elements.
            stribeck_velocity: v_s [m/s].
        """
        atoms = self.atoms
        deflection, force = cluster(atoms.deflection, atoms.force, count)
        rho = min(max(1.0 + atoms.rise, 1.01), 3.0)
        scalars = np.array([atoms.mass, atoms.viscous, atoms.offset, 0.0, rho, stribeck_velocity, self.rate, 0.0])
        return Parameters(scalars, force / deflection, force, atoms.effects)

    def vector(self, parameters: Parameters, axis: AxisSettings) -> Floats:
        """Return ``Parameters.vector`` with the start settings' values of all shared parameters and effects."""
        friction = axis.friction
        offset = next((item.values[0] for item in axis.effects if item.name == "offset" and item.values), 0.0)
        out = parameters.vector()
        out[:ELEMENTS] = [
            axis.mass,
            max(friction.viscous_coefficient, 1e-6 * self.scales.viscous),
            offset,
            0.0,
            max(friction.static_force / friction.coulomb_force, 1.0),
            friction.stribeck_velocity,
            self.rate,
            0.0,
        ]
        out[parameters.first_effect :] = self.terms.start.values
        return out


def linear_start(recordings: Sequence[Recording], axis: AxisSettings, shape: ElementShape, cutoff: float) -> Start:
    """Fit the linear parameters; gravity or a spring that the file does not have stays only if the recordings show it.

    Over less than a turn, gravity and a spring imitate each other: a joint with gravity gets no spring.

    Args:
        recordings: evenly sampled pieces.
        axis: start settings.
        shape: smoothing of the elements.
        cutoff: corner of the balance's low-pass [Hz].

    Raises:
        DataError: if the recordings hold too little motion.
    """
    terms = effect_terms(axis)
    data = prepare_all(recordings, cutoff, terms)
    _check_reversals(recordings, data, scales_of(data))
    start = _start_with(data, axis, shape, terms)
    if GRAVITY in terms.added:
        without = _start_with(data, axis, shape, terms.without(GRAVITY))
        start = start if _is_shown(GRAVITY, start, without) else without
    names = [item.name for item in start.terms.fitted]
    if SPRING in names or (axis.units.is_revolute and GRAVITY in names):
        return start
    ends = [float(end) for piece in data for end in (piece.position.min(), piece.position.max())]
    spring = EffectSettings(SPRING, (0.0, 0.5 * (min(ends) + max(ends))))
    more = _start_with(data, axis, shape, start.terms.with_added(spring))
    return more if _is_shown(SPRING, more, start) else start


def _is_shown(name: str, start: Start, without: Start) -> bool:
    """Return whether an effect explains more than the others, with its phase if it has one."""
    number = start.terms.strength_of(name)
    is_identifiable = (number, start.terms.phase_of(number)) in start.linear.strengths
    return is_identifiable and 1.0 - start.atoms.cost / without.atoms.cost > _MIN_GAIN[name]


def _start_with(recordings: Sequence[Prepared], axis: AxisSettings, shape: ElementShape, terms: EffectTerms) -> Start:
    """Fit the linear parameters with given effects, of which those of the effort's path and of the position stay."""
    data = [
        replace(piece, effects=replace(piece.effects, compiled=CompiledEffects(terms.fitted, piece.period)))
        for piece in recordings
    ]
    scales = scales_of(data)
    vector, coulomb = terms.start, axis.friction.coulomb_force
    widest = max(data, key=lambda piece: float(np.ptp(piece.position)))
    level = np.full(len(widest.position), coulomb)
    vector = replace(vector, scale=widest.effects.scales(vector, terms.names, level, scales.effort))
    linear = linear_effects(data, terms, vector, coulomb)
    low, high = (share * scales.top_velocity for share in _V_S_SHARES)
    velocity = min(max(axis.friction.stribeck_velocity, low), high)
    atoms = _fit_atoms(data, shape, scales, velocity, linear)
    rate = axis.friction.attraction_rate / axis.friction.coulomb_force
    return Start(data, terms, linear, atoms, scales, velocity, rate)


def _check_reversals(recordings: Sequence[Recording], data: Sequence[Prepared], scales: Scales) -> None:
    """Raise an error if the axis has too few reversals; parts that were cut from one piece are looked at together."""
    reversals, extreme, way = 0, 0.0, 0
    before: Recording | None = None
    for recording, piece in zip(recordings, data, strict=True):
        if before is None or not recording.continues(before):
            extreme, way = float(piece.position[0]), 0
        before = recording
        for value in piece.position[:: piece.stride]:
            moved = float(value) - extreme
            if way * moved > 0.0:
                extreme = float(value)
            elif abs(moved) > _REVERSAL_SHARE * scales.travel:
                reversals += way != 0
                extreme, way = float(value), 1 if moved > 0.0 else -1
    if reversals < MIN_REVERSALS:
        raise DataError(
            f"the axis reverses {'once' if reversals else 'never'}: these recordings cannot show its friction, which"
            f" offset, gravity and slow changes imitate; record {MIN_REVERSALS} reversals or more (sgms excite)"
        )


def _fit_atoms(
    data: Sequence[Prepared], shape: ElementShape, scales: Scales, stribeck_velocity: float, terms: LinearEffects
) -> Atoms:
    """Fit the distribution over a coarse grid of slip deflections, then over a grid up to the largest deflection."""
    smallest, largest = scales.smallest, scales.largest()
    first = _fit(data, shape, _grid(smallest, largest), stribeck_velocity, 10.0 * smallest, terms)
    if first.is_opposed or first.force.sum() <= 0.0:
        return first
    slip_deflection = first.slip_deflection
    largest = min(largest, max(_MARGIN * slip_deflection, 4.0 * smallest))
    return _fit(data, shape, _grid(smallest, largest), stribeck_velocity, slip_deflection, terms)


def _grid(smallest: float, largest: float) -> Floats:
    count = max(3, int(np.ceil(_GRID_PER_DECADE * np.log10(largest / smallest))) + 1)
    return np.geomspace(smallest, largest, count)


def _fit(
    data: Sequence[Prepared],
    shape: ElementShape,
    grid: Floats,
    stribeck_velocity: float,
    forgotten: float,
    terms: LinearEffects,
) -> Atoms:
    """Solve the convex problem on one grid, once elements up to deflection ``forgotten`` have forgotten their start."""
    rows, efforts = [], []
    masks = [piece.settled(forgotten) for piece in data]
    if not any(np.any(mask) for mask in masks):
        masks = [piece.usable for piece in data]
    stride = max(1, sum(int(mask.sum()) for mask in masks) // _ROWS)
    for piece, mask, base, added in zip(data, masks, terms.base, terms.columns, strict=True):
        rows.append(_columns(piece, shape, grid, stribeck_velocity, added)[mask][::stride])
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
    force, bumps, rest = np.split(weights, [len(grid), len(grid) + len(_BUMPS)])
    total = float(force.sum())
    keep = force > _NEGLIGIBLE * total
    plus, minus = np.split(rest[4:], 2)
    return Atoms(
        grid[keep],
        force[keep],
        float(rest[0]),
        float(rest[1]),
        float(rest[2] - rest[3]),
        float(bumps.sum()) / max(total, 1e-300),
        terms.vector_of(plus - minus),
        max(float(norm**2) + orthogonal_square, 1e-300) / len(effort),
        max(float(opposed_norm**2) + orthogonal_square, 1e-300) / len(effort),
    )


def _columns(piece: Prepared, shape: ElementShape, grid: Floats, stribeck_velocity: float, added: Floats) -> Floats:
    """Return a column for each unknown: elements, Stribeck bumps, mass, viscous friction, then signs of the rest."""
    elements = unit_elements(piece.position, piece.period, grid, shape)
    velocity: Floats = np.gradient(piece.position) / piece.period
    bumps = [np.sign(velocity) * np.exp(-((velocity / (share * stribeck_velocity)) ** 2)) for share in _BUMPS]
    columns = piece.low_pass(np.column_stack([elements, *bumps]))
    ones = np.ones(len(piece.time))
    return np.column_stack([columns, piece.acceleration, piece.velocity, ones, -ones, added, -added])


def cluster(atom_deflection: Floats, atom_force: Floats, count: int) -> tuple[Floats, Floats]:
    """Return slip deflection [m] and force [N] of ``count`` elements, merged or split from atoms in ascending order."""
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
