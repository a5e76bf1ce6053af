"""The identification problem: residual of the force balance with its Jacobian, as functions of the parameters.

``u(t - delay) = m a + sigma_v v + friction(x) + effects(x, v, t, ...) + offset``, both sides low-passed alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sgms_observer.formulas import vectorised
from sgms_observer.identification.effect_terms import EffectVector
from sgms_observer.identification.prepared import Prepared
from sgms_observer.identification.simulation import SHARED, ElementShape, friction_and_slopes

Floats = NDArray[np.float64]

MASS, VISCOUS, OFFSET, DELAY, RHO, V_S, RATE, RELAXATION, ELEMENTS = range(9)
SCALARS = (
    "mass", "viscous_coefficient", "offset", "delay", "stribeck_ratio", "stribeck_velocity", "relaxation_rate",
    "damping_over_stiffness",
)  # fmt: skip

stribeck_level = vectorised("friction").stribeck_level
_DIFFERENCE = 1.0e-6  # step of a numeric derivative over the parameter's scale


@dataclass(frozen=True)
class Parameters:
    """Physical parameters of the model under identification.

    Attributes:
        scalars: the entries named in ``SCALARS``, SI units, shape (8,).
        kappa: element stiffness [N/m], shape (n_z,).
        level: element Coulomb force a_i [N], shape (n_z,).
        effects: values of the effects' parameters.
    """

    scalars: Floats
    kappa: Floats
    level: Floats
    effects: EffectVector = field(default_factory=EffectVector)

    @property
    def count(self) -> int:
        """Number of elements."""
        return len(self.kappa)

    @property
    def slip_deflection(self) -> Floats:
        """Deflection at which each element slips at rest [m]."""
        return np.asarray(self.level * max(1.0, self.scalars[RHO]) / self.kappa)

    def vector(self) -> Floats:
        """Return all as one vector: scalars, kappa, a, effects."""
        return np.concatenate([self.scalars, self.kappa, self.level, self.effects.values])

    def with_vector(self, values: Floats) -> Parameters:
        """Return the parameters that ``values`` lists in the order of ``vector``."""
        n_z = self.count
        scalars, kappa, level, effects = np.split(values, [ELEMENTS, ELEMENTS + n_z, ELEMENTS + 2 * n_z])
        return Parameters(scalars, kappa, level, self.effects.with_values(effects))

    @property
    def first_effect(self) -> int:
        """Number of the first effect's parameter in ``vector``."""
        return ELEMENTS + 2 * self.count

    def free(self, frozen: Sequence[int], is_gms: bool) -> list[int]:
        """Return the numbers of the entries of ``vector`` that are fitted.

        Args:
            frozen: numbers that are not, beside the effects' own.
            is_gms: whether the model has an attraction rate.
        """
        first = self.first_effect
        scalars_and_elements = [j for j in range(first) if j not in frozen and (j != RATE or is_gms)]
        return scalars_and_elements + [first + j for j in self.effects.free if first + j not in frozen]

    def names(self) -> tuple[str, ...]:
        """Return the name of each entry of ``vector`` but the effects'."""
        elements = range(1, self.count + 1)
        return (*SCALARS, *(f"element_stiffness[{i}]" for i in elements), *(f"element_force[{i}]" for i in elements))


def residual_and_jacobian(data: Prepared, parameters: Parameters, shape: ElementShape) -> tuple[Floats, Floats]:
    """Predicted minus measured effort and its derivative by ``parameters.vector()``.

    Args:
        data: prepared recording.
        parameters: physical parameters.
        shape: kind of model and its smoothing.

    Returns:
        Residual [N], shape (n,), and Jacobian, shape (n, 8 + 2 n_z + m).
    """
    scalars = parameters.scalars
    n_z = parameters.count
    inner, slopes, rate, by_effects = _inner_force(data, parameters, shape)
    filtered = data.low_pass(np.column_stack([inner, slopes, rate, by_effects]))
    shifted = np.clip(data.time - scalars[DELAY], data.time[0], data.time[-1])
    residual = (
        scalars[MASS] * data.acceleration
        + scalars[VISCOUS] * data.velocity
        + scalars[OFFSET]
        + filtered[:, 0]
        - data.effort(shifted)
    )
    of_elements = slice(1, 1 + 2 * n_z)
    of_shared = slice(1 + 2 * n_z, 1 + 2 * n_z + SHARED)
    jacobian = np.empty((len(residual), parameters.first_effect + len(parameters.effects)))
    jacobian[:, MASS] = data.acceleration
    jacobian[:, VISCOUS] = data.velocity
    jacobian[:, OFFSET] = 1.0
    jacobian[:, DELAY] = data.effort(shifted, 1)
    jacobian[:, [RHO, V_S, RATE]] = filtered[:, of_shared]
    jacobian[:, RELAXATION] = filtered[:, of_shared.stop]
    jacobian[:, ELEMENTS : parameters.first_effect] = filtered[:, of_elements]
    jacobian[:, parameters.first_effect :] = filtered[:, of_shared.stop + 1 :]
    return residual, jacobian


def _inner_force(data: Prepared, parameters: Parameters, shape: ElementShape) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the force of elements and effects, its slopes by the elements, its lead and its slopes by the effects.

    All at the working rate, shapes (n,), (n, 2 n_z + 3), (n,) and (n, m). The effects' formulas are differentiated by
    small steps, which costs one compiled run each.
    """
    scalars, effects = parameters.scalars, parameters.effects
    shared = scalars[[RHO, V_S, RATE]]
    relaxation = scalars[RELAXATION]

    def elements(factor: Floats) -> tuple[Floats, Floats, Floats]:
        friction, slopes = friction_and_slopes(
            data.position, data.period, parameters.kappa, parameters.level, shared, shape, factor
        )
        rate: Floats = np.gradient(friction) / data.period
        if relaxation != 0.0:  # sigma_i = lasting * kappa_i: the force of every element leads by the same time
            friction = friction + relaxation * rate
            slopes = slopes + relaxation * np.gradient(slopes, axis=0) / data.period
        return friction, slopes, rate

    by_effects = np.zeros((len(data.position), len(effects)))
    if len(effects) == 0:
        friction, slopes, rate = elements(np.ones(len(data.position)))
        return friction, slopes, rate, by_effects
    coulomb = float(parameters.level.sum())
    level = stribeck_level(data.effects.velocity, scalars[RHO] * coulomb, coulomb, scalars[V_S])
    force, factor = data.effects.at(effects.values, level)
    friction, slopes, rate = elements(factor)
    for number in effects.free:
        values = effects.values.copy()
        step = _DIFFERENCE * effects.scale[number]
        values[number] += step if values[number] + step <= effects.high[number] else -step
        moved, moved_factor = data.effects.at(values, level)
        change = moved - force
        if not np.array_equal(moved_factor, factor):
            change = change + elements(moved_factor)[0] - friction
        by_effects[:, number] = change / (values[number] - effects.values[number])
    return friction + force, slopes, rate, by_effects


def chunk_numbers(data: Sequence[Prepared], count: int) -> list[NDArray[np.int64]]:
    """Number the rows of all recordings by chunks of equal duration.

    Returns:
        Chunk number of each row, per recording; numbers do not repeat between recordings.
    """
    total = sum(float(piece.time[-1]) for piece in data)
    numbers = []
    first = 0
    for piece in data:
        chunk_count = max(1, round(count * float(piece.time[-1]) / total))
        numbers.append(first + np.minimum(np.arange(len(piece.time)) * chunk_count // len(piece.time), chunk_count - 1))
        first += chunk_count
    return numbers
