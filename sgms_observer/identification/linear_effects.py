"""Start values of effects whose force is linear in a strength: gravity and other sines, springs, drags.

A sine of unknown phase is linear in two columns, at phase 0 and at phase pi/2. A column that is nearly a linear
combination of mass, friction, offset and earlier columns is left out: its parameter keeps the value of the file.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.identification.effect_terms import EffectTerms, EffectVector
from sgms_observer.identification.prepared import Prepared

MIN_INDEPENDENT_SHARE = 1.0e-3
"""Norm of what other columns cannot imitate, over the column's norm, from which a column is fitted:
whether what is left of it can be told from noise is judged after the fit."""
IMITATED = "mass, friction, offset or another effect can imitate it on this motion"
_LINEAR_WITHIN = 1.0e-6


@dataclass(frozen=True)
class LinearEffects:
    """The linear part of the effects, as columns of the balance.

    Attributes:
        start: values of the parameter file, and which are fitted.
        strengths: number of the strength of each column, and of its phase where it has two columns.
        base: force of all other effects at the rows of each recording [N].
        columns: columns of each recording, shape (n, k).
        reasons: number of a parameter that is not fitted, to the reason.
    """

    start: EffectVector
    strengths: tuple[tuple[int, int | None], ...]
    base: tuple[Floats, ...]
    columns: tuple[Floats, ...]
    reasons: dict[int, str]

    def vector_of(self, weights: Floats) -> EffectVector:
        """Return the effects with fitted strengths and phases."""
        values = self.start.values.copy()
        at = 0
        for strength, phase in self.strengths:
            if phase is None:
                values[strength], at = weights[at], at + 1
            else:
                values[strength] = math.hypot(weights[at], weights[at + 1])
                values[phase], at = math.atan2(weights[at + 1], weights[at]), at + 2
        return self.start.with_values(np.clip(values, self.start.low, self.start.high))


def linear_effects(data: Sequence[Prepared], terms: EffectTerms, vector: EffectVector, coulomb: float) -> LinearEffects:
    """Find the linear strengths and build their columns.

    Args:
        data: prepared recordings.
        terms: effects of the axis.
        vector: their start values.
        coulomb: Coulomb force of the start settings [N].
    """
    parameters = terms.parameters
    widest = max(data, key=lambda piece: float(np.ptp(piece.position)))
    linear = [n for n in vector.free if parameters[n].is_strength and _is_linear(widest, vector, n, coulomb)]
    basic = vector.values.copy()
    basic[linear] = 0.0
    known = [_known_columns(piece) for piece in data] if linear else []
    base = tuple(_rows(piece, basic, coulomb) for piece in data)
    chosen: list[tuple[int, int | None]] = []
    columns: list[list[Floats]] = []
    reasons: dict[int, str] = {}
    for number in linear:
        phase = terms.phase_of(number)
        trials = [(number, phase)] if phase is None else [(number, phase), (number, None)]
        for strength, free_phase in trials:
            found = [_unit_columns(piece, basic, strength, free_phase, coulomb) for piece in data]
            if _is_independent(data, known, found):
                known = [np.column_stack(pair) for pair in zip(known, found, strict=True)]
                chosen.append((strength, free_phase))
                columns.append(found)
                break
            reasons.update({free_phase if free_phase is not None else strength: IMITATED})
    reasons.update(dict.fromkeys(_shapes_of(list(reasons), terms, vector), IMITATED))
    free = tuple(number for number in vector.free if number not in reasons)
    stacked = tuple(
        np.column_stack([group[k] for group in columns]) if columns else np.empty((len(data[k].time), 0))
        for k in range(len(data))
    )
    given = basic.copy()  # strengths without a column keep the value of the file
    fixed_numbers = [number for number in linear if number not in {strength for strength, _phase in chosen}]
    given[fixed_numbers] = vector.values[fixed_numbers]
    if fixed_numbers:
        base = tuple(_rows(piece, given, coulomb) for piece in data)
    return LinearEffects(replace(vector, values=given, free=free), tuple(chosen), base, stacked, reasons)


def _shapes_of(numbers: Sequence[int], terms: EffectTerms, vector: EffectVector) -> list[int]:
    """Return the free shape parameters of the effects whose strength is among ``numbers``."""
    names, parameters = terms.names, terms.parameters
    owners = {names[number].split(".")[0] for number in numbers if parameters[number].is_strength}
    return [
        other for other in vector.free if names[other].split(".")[0] in owners and not parameters[other].is_strength
    ]


def _level(piece: Prepared, coulomb: float) -> Floats:
    return np.full(len(piece.position), coulomb)


def _rows(piece: Prepared, values: Floats, coulomb: float) -> Floats:
    """Return the effects' force at the rows of the balance."""
    if len(values) == 0:
        return np.zeros(len(piece.time))
    return piece.low_pass(piece.effects.at(values, _level(piece, coulomb))[0])


def _unit_columns(piece: Prepared, basic: Floats, strength: int, phase: int | None, coulomb: float) -> Floats:
    """Return the columns of a strength of 1, at phase 0 and pi/2 where the phase is free."""
    nothing = _rows(piece, basic, coulomb)
    out = []
    for angle in (None,) if phase is None else (0.0, 0.5 * math.pi):
        values = basic.copy()
        values[strength] = 1.0
        if phase is not None and angle is not None:
            values[phase] = angle
        out.append(_rows(piece, values, coulomb) - nothing)
    return np.column_stack(out)


def _is_linear(piece: Prepared, vector: EffectVector, number: int, coulomb: float) -> bool:
    """Return whether the force is proportional to a strength and the factor does not depend on it."""
    level = _level(piece, coulomb)
    forces = []
    for size in (0.0, 1.0, 2.0):
        values = vector.values.copy()
        values[number] = size * vector.scale[number]
        force, factor = piece.effects.at(values, level)
        if not np.array_equal(factor, piece.effects.at(vector.values, level)[1]):
            return False
        forces.append(force)
    one, two = forces[1] - forces[0], forces[2] - forces[0]
    return bool(np.abs(two - 2.0 * one).max() <= _LINEAR_WITHIN * np.abs(two).max()) and bool(np.abs(two).max() > 0.0)


def _known_columns(piece: Prepared) -> Floats:
    """Return the columns of mass, viscous and Coulomb friction and offset."""
    direction = piece.low_pass(np.sign(np.gradient(piece.position)))
    return np.column_stack([piece.acceleration, piece.velocity, direction, np.ones(len(piece.time))])


def _is_independent(data: Sequence[Prepared], known: Sequence[Floats], found: Sequence[Floats]) -> bool:
    """Return whether each new column is sufficiently independent of the known ones and of its group."""
    rows = [piece.usable for piece in data]
    before = np.concatenate([values[mask] for values, mask in zip(known, rows, strict=True)])
    new = np.concatenate([values[mask] for values, mask in zip(found, rows, strict=True)])
    for column in range(new.shape[1]):
        others = np.column_stack([before, np.delete(new, column, axis=1)])
        scale = np.linalg.norm(others, axis=0)
        others = others / np.where(scale > 0.0, scale, 1.0)
        rest = new[:, column] - others @ np.linalg.lstsq(others, new[:, column], rcond=1e-9)[0]
        if not float(np.linalg.norm(rest)) > MIN_INDEPENDENT_SHARE * float(np.linalg.norm(new[:, column])):
            return False
    return True
