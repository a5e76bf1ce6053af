"""The identification problem: friction along a measured motion with its sensitivities, residual and Jacobian."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.formulas import vectorised
from sgms_observer.friction.gms import gms_step_with_slopes
from sgms_observer.friction.sgms import sgms_step_with_slopes
from sgms_observer.identification.effect_terms import EffectVector
from sgms_observer.identification.prepared import Prepared
from sgms_observer.jit import njit
from sgms_observer.settings.axis import FrictionSettings

SHARED = 3  # rho, v_s, c
RHO, V_S, RATE = range(SHARED)
_IS_GMS, _LAMBDA, _ZETA, _GAMMA, _IS_PAPER, _FIXED = range(6)

MASS, VISCOUS, OFFSET, DELAY, RHO, V_S, RATE, RELAXATION, ELEMENTS = range(9)
SCALARS = (
    "mass", "viscous_coefficient", "offset", "delay", "stribeck_ratio", "stribeck_velocity", "relaxation_rate",
    "damping_over_stiffness",
)  # fmt: skip

stribeck_level = vectorised("friction").stribeck_level
_DIFFERENCE = 1.0e-6  # step of a numeric derivative over the parameter's scale


@dataclass(frozen=True)
class ElementShape:
    """Kind and smoothing of the model, which are not fitted.

    Attributes:
        is_gms: GMS instead of S-GMS.
        numbers: fixed numbers for the kernel.
        stated_deflection: largest slip deflection that the settings state [m].
    """

    is_gms: bool
    numbers: Floats
    stated_deflection: float = 0.0

    @staticmethod
    def of(settings: FrictionSettings, model: str) -> ElementShape:
        """Take the smoothing from settings and the kind from ``model`` (``sgms`` or ``gms``)."""
        numbers = np.zeros(_FIXED)
        numbers[_IS_GMS] = float(model == "gms")
        numbers[_LAMBDA] = settings.smoothing_lambda
        numbers[_ZETA] = settings.smoothing_zeta
        numbers[_GAMMA] = settings.smoothing_gamma
        numbers[_IS_PAPER] = float(settings.reset == "paper")
        limits = settings.static_force * np.array(settings.element_fraction)
        return ElementShape(model == "gms", numbers, float(np.max(limits / np.array(settings.element_stiffness))))


@njit
def _simulate(
    first: Floats, second: Floats, velocity: Floats, factor: Floats, sides: Floats, period: float, kappa: Floats,
    level: Floats, shared: Floats, numbers: Floats, out: Floats, slopes: Floats,
) -> None:  # fmt: skip
    """Write the summed element force after each step and its derivatives (kappa.., a.., rho, v_s, c)."""
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    mode = np.zeros(n_z, dtype=np.int64)
    element_slopes = np.zeros((n_z, 2 + 3))  # d force_i / d (kappa_i, a_i, rho, v_s, c)
    rho, v_s, rate = shared[0], shared[1], shared[2]
    for k in range(first.shape[0]):
        ratio = velocity[k] / v_s
        fading = math.exp(-ratio * ratio)
        for part in range(2):
            travel = first[k] if part == 0 else second[k]
            if travel == 0.0:
                continue
            direction = 1.0 if travel > 0.0 else -1.0
            scale = factor[k] * (sides[0] if travel > 0.0 else sides[1])
            bump = fading * scale
            curve = scale + (rho - 1.0) * bump
            curve_v_s = (rho - 1.0) * bump * 2.0 * ratio * ratio / v_s
            rate_of_travel = travel / period
            gain = numbers[_GAMMA]
            gain_v_s = 0.0
            if numbers[_IS_PAPER] > 0.5:
                gain = numbers[_GAMMA] * abs(rate_of_travel) / v_s
                gain_v_s = -gain / v_s
            for i in range(n_z):
                if numbers[_IS_GMS] > 0.5:
                    after, mode_after, keep, by_kappa, by_curve = gms_step_with_slopes(
                        force[i], mode[i], rate_of_travel, period, kappa[i], level[i], curve, rate
                    )
                    mode[i] = mode_after
                    by_level = 0.0
                    by_rate = 0.0
                    if mode_after != 0:
                        by_level = direction * curve * (1.0 - keep)
                        if keep > 0.0:
                            by_rate = -(after - direction * level[i] * curve) * period / curve
                    by_gain = 0.0
                else:
                    limit = level[i] * curve
                    after, keep, by_kappa, by_limit, by_gain = sgms_step_with_slopes(
                        force[i], rate_of_travel, period, kappa[i], limit, numbers[_LAMBDA], numbers[_ZETA], gain
                    )
                    by_level = by_limit * curve
                    by_curve = by_limit * level[i]
                    by_rate = 0.0
                force[i] = after
                element_slopes[i, 0] = keep * element_slopes[i, 0] + by_kappa
                element_slopes[i, 1] = keep * element_slopes[i, 1] + by_level
                element_slopes[i, 2] = keep * element_slopes[i, 2] + by_curve * bump
                element_slopes[i, 3] = keep * element_slopes[i, 3] + by_curve * curve_v_s + by_gain * gain_v_s
                element_slopes[i, 4] = keep * element_slopes[i, 4] + by_rate
        total = 0.0
        for j in range(3):
            slopes[k, 2 * n_z + j] = 0.0
        for i in range(n_z):
            total += force[i]
            slopes[k, i] = element_slopes[i, 0]
            slopes[k, n_z + i] = element_slopes[i, 1]
            for j in range(3):
                slopes[k, 2 * n_z + j] += element_slopes[i, 2 + j]
        out[k] = total


@njit
def _simulate_forces(travel: Floats, period: float, kappa: Floats, level: Floats, numbers: Floats, out: Floats) -> None:
    """Write the force of each element by itself on a flat Stribeck curve."""
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    lam, zeta, gamma = numbers[_LAMBDA], numbers[_ZETA], numbers[_GAMMA]
    for k in range(travel.shape[0]):
        if travel[k] != 0.0:
            for i in range(n_z):
                after, _keep, _by_kappa, _by_limit, _by_gain = sgms_step_with_slopes(
                    force[i], travel[k] / period, period, kappa[i], level[i], lam, zeta, gamma
                )
                force[i] = after
        out[k, :] = force


def friction_and_slopes(
    position: Floats,
    period: float,
    kappa: Floats,
    level: Floats,
    shared: Floats,
    shape: ElementShape,
    factor: Floats | None = None,
) -> tuple[Floats, Floats]:
    """Simulate the elements along a measured motion, from rest without force.

    Args:
        position: position [m], shape (n,).
        period: time between two samples [s].
        kappa: element stiffness [N/m], shape (n_z,).
        level: element Coulomb force a_i [N], shape (n_z,).
        shared: rho [-], v_s [m/s], c [1/s].
        shape: kind of model and its smoothing.
        factor: known effects' factor on the Stribeck level [-], shape (n,); None for 1.

    Returns:
        Summed element force [N], shape (n,); its derivatives by kappa (n_z), a (n_z), rho, v_s, c,
        shape (n, 2 n_z + 3).
    """
    travel = np.diff(position, prepend=position[:1])
    return friction_and_slopes_along(
        np.zeros(len(position)), travel, travel / period, period, kappa, level, shared, shape, factor
    )


def friction_and_slopes_along(
    first: Floats,
    second: Floats,
    velocity: Floats,
    period: float,
    kappa: Floats,
    level: Floats,
    shared: Floats,
    shape: ElementShape,
    factor: Floats | None = None,
    sides: tuple[float, float] = (1.0, 1.0),
) -> tuple[Floats, Floats]:
    """Simulate the elements along a motion whose steps are split at reversals, from rest without force.

    Args:
        first, second: displacement of each step before and after a reversal in the step [m], shape (n,).
        velocity: velocity of the Stribeck curve [m/s], shape (n,).
        period, kappa, level, shared, shape, factor: as for ``friction_and_slopes``.
        sides: factors on the Stribeck level for forward and backward motion [-].

    Returns:
        As ``friction_and_slopes``.
    """
    out, slopes = np.empty(len(first)), np.empty((len(first), 2 * len(kappa) + SHARED))
    ones = np.ones(len(first)) if factor is None else factor
    _simulate(first, second, velocity, ones, np.array(sides), period, kappa, level, shared, shape.numbers, out, slopes)
    return out, slopes


def unit_elements(position: Floats, period: float, slip_deflection: Floats, shape: ElementShape) -> Floats:
    """Simulate elements of 1 N that slip at given deflections, each by itself.

    Args:
        position: position [m], shape (n,).
        period: time between two samples [s].
        slip_deflection: deflection at which each slips [m], shape (k,).
        shape: smoothing of the model.

    Returns:
        Force of each element [N], shape (n, k).
    """
    travel = np.diff(position, prepend=position[:1])
    out = np.empty((len(position), len(slip_deflection)))
    _simulate_forces(travel, period, 1.0 / slip_deflection, np.ones(len(slip_deflection)), shape.numbers, out)
    return out


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


def chunk_numbers(masks: Sequence[Booleans], count: int) -> list[Ints]:
    """Number the rows of all recordings by consecutive chunks that hold equal numbers of the rows to use.

    Args:
        masks: rows to use of each recording, one at least in all.
        count: number of chunks.

    Returns:
        Chunk number of each row, from 0, per recording; a chunk may end in the next recording.
    """
    used = np.concatenate(list(masks))
    place = np.maximum(np.cumsum(used) - 1, 0)
    numbers = place * count // max(int(np.count_nonzero(used)), 1)
    return np.split(numbers, np.cumsum([len(mask) for mask in masks])[:-1])
