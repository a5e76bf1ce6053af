"""Fit of nominal parameters within their tolerance and of effect parameters to whitened residuals."""

from __future__ import annotations

from collections.abc import Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.model import (
    COULOMB,
    DAMPING,
    PERIODIC_DISTURBANCE,
    PHASE,
    STATIC,
    Model,
    hidden_friction_drop,
    predict,
    unknown_initial_friction,
    with_phases_of,
)
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.noise import Noise, fit_noise, largest_noise
from sgms_observer.diagnosis.ranges import plausible_range, unit_of
from sgms_observer.diagnosis.sliding_force import PARTS_OF_SLIDING_FORCE, total_force_logs
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

ELEMENT_TOLERANCE_RATIO = 15.0
"""Ratio of the tolerance of elements to that of other values: few elements approximate a continuous contact."""
FREED_FRICTION = np.log(2.0)
"""Prior standard deviation of the logarithm of a free friction value: a factor of two."""
FREED_DAMPING = np.log(10.0)
"""Prior standard deviation of the logarithm of the element damping, which files seldom state: a factor of ten."""
FREED_ELEMENTS = np.log(3.0)
"""Prior standard deviation of the logarithm of a free element's stiffness and share: a factor of three."""
DERIVATIVE_STEP = 1.0e-4
"""Step of numerical derivatives, in units of the parameters."""
REFERENCE_PARAMETERS = {
    "nonlinear_viscous": (2,), "thermal_drift": (3,), "dwell_breakaway": (3,), "gravity": (2,),
    PERIODIC_DISTURBANCE: (PHASE,),
}  # fmt: skip
"""Parameters that are a reference value or follow from joint or recording. They are never fitted: (effect, indices)."""
JACOBIAN_REFRESH_STEPS = 3
"""Number of steps between computations of the derivatives with respect to the nominal parameters."""
FITTED_BY_LOGARITHM = (
    "attraction_rate", "distance", "memory_distance", "gap", "stop", "time_constant", "dwell_time", "width", "velocity",
    "peak_velocity",
)  # fmt: skip
"""Parameters that are fitted by their logarithm where they cannot be zero."""
MIN_NOISE_SHARE = 1.0e-3
"""Smallest rms noise of a measured force, as a share of the effort."""
MAX_STEPS = 40
"""Steps after which a fit that is to converge ends anyway."""


@dataclass(frozen=True)
class WhitenedData:
    """Recordings with the noise and weights that whiten their residuals.

    Attributes:
        motions: recordings.
        noise: noise of each recording.
        weights: weights of the residuals of each recording.
        gap_weights: weights of the residuals in the gap: low where the encoder resolution hides the force.
    """

    motions: tuple[Motion, ...]
    noise: tuple[Noise, ...]
    weights: tuple[Floats, ...]
    gap_weights: tuple[Floats, ...]

    def whitened(self, columns: Sequence[Floats]) -> Floats:
        """Return one whitened column of all recordings, from a series at the working rate for each."""
        parts = [
            noise.whitened(motion.low_pass(column), weights)
            for motion, noise, weights, column in zip(self.motions, self.noise, self.weights, columns, strict=True)
        ]
        return np.concatenate(parts)

    def residual(self, model: Model) -> Floats:
        """Return the whitened residual of a model."""
        return self.whitened([predict(model, motion).residual for motion in self.motions])


def data_with_own_noise(motions: Sequence[Motion], model: Model) -> WhitenedData:
    """Return recordings with the noise fitted to the residual of a model."""
    noises, stick_indicators, hidden = [], [], [_hidden_square(model, motion) for motion in motions]
    for motion, square in zip(motions, hidden, strict=True):
        found = predict(model, motion)
        least = MIN_NOISE_SHARE * float(np.std(motion.effort))
        residual, stick_indicator = motion.low_pass(found.residual), motion.thinned(found.stick_indicator)
        noises.append(fit_noise(residual, stick_indicator, motion.residual_period, motion.band, least, square))
        stick_indicators.append(stick_indicator)
    return _whitened_data(motions, noises, stick_indicators, hidden)


def data_with_noise_of(motions: Sequence[Motion], data: WhitenedData, model: Model) -> WhitenedData:
    """Return recordings with the noise of other recordings.

    Args:
        motions: recordings; may be empty.
        data: the other recordings; the largest of their noises is used.
        model: model that computes where the contact sticks.
    """
    noise = largest_noise(data.noise)
    noises = [replace(noise, period=motion.residual_period) for motion in motions]
    stick_indicators = [motion.thinned(predict(model, motion).stick_indicator) for motion in motions]
    return _whitened_data(motions, noises, stick_indicators, [_hidden_square(model, motion) for motion in motions])


def _whitened_data(
    motions: Sequence[Motion], noises: Sequence[Noise], stick_indicators: Sequence[Floats], hidden: Sequence[Floats]
) -> WhitenedData:
    """Return recordings with their noise and the weights that follow from it."""
    weights = [noise.weights(*pair) for noise, *pair in zip(noises, stick_indicators, hidden, strict=True)]
    gap_weights = [noise.gap_weights(square) for noise, square in zip(noises, hidden, strict=True)]
    return WhitenedData(tuple(motions), tuple(noises), tuple(weights), tuple(gap_weights))


def _hidden_square(model: Model, motion: Motion) -> Floats:
    """Return the mean square of the friction that the recording does not determine [N^2].

    That is the force hidden by the encoder resolution, uniformly distributed from zero, and that of the unknown state
    at the start, uniformly distributed around zero.
    """
    drop, width = hidden_friction_drop(model.friction, motion), unknown_initial_friction(model.friction, motion)
    return motion.thinned(drop**2 / 3.0 + width**2 / 12.0)


@dataclass(frozen=True)
class Freedom:
    """Values of the file that the fit may move beyond the tolerance.

    Attributes:
        friction: viscous, Coulomb and static force, Stribeck velocity, attraction rate.
        elements: stiffness and share of the elements.
        has_narrow_elements: whether elements that are not free have the tolerance of the other values.
    """

    friction: bool = False
    elements: bool = False
    has_narrow_elements: bool = False


def prior_widths(model: Model, tolerance: float, freedom: Freedom = Freedom()) -> Floats:
    """Return the prior standard deviation of the logarithm of each nominal parameter.

    Args:
        model: the nominal model.
        tolerance: largest expected relative error of the file's values. Elements may be off
            ``ELEMENT_TOLERANCE_RATIO`` times as far, unless the freedom has narrow elements.
        freedom: free values.
    """
    one = tolerance / np.sqrt(3.0)
    widths = []
    for name in model.parameter_names():
        if name == DAMPING:
            widths.append(FREED_DAMPING)
        elif name.startswith("element"):
            widths.append(
                FREED_ELEMENTS
                if freedom.elements
                else (1.0 if freedom.has_narrow_elements else ELEMENT_TOLERANCE_RATIO) * one
            )
        else:
            widths.append(FREED_FRICTION if freedom.friction and name != "mass" else one)
    return np.array(widths)


def limits(model: Model, tolerance: float, freedom: Freedom = Freedom()) -> Floats:
    """Return the bound on the logarithm of each nominal parameter; arguments as above.

    The tolerance is a hard bound, except for elements and free values.
    """
    free = 3.0 * prior_widths(model, tolerance, freedom)
    one = np.log1p(tolerance)
    is_held = [
        not (name.startswith("element") or (freedom.friction and name != "mass")) for name in model.parameter_names()
    ]
    return np.where(is_held, one, free)


@dataclass(frozen=True)
class Refit:
    """A fitted model.

    Attributes:
        model: model with the fitted parameters and effects.
        logs: logarithms of the nominal parameters over the given ones.
        effects: the effects of this fit.
        residual: whitened residual.
        cost: half the squared residual plus half the squared prior rows.
        jacobian: derivatives of residual and prior rows with respect to (logs, free effect parameters).
        scales: unit of each free effect parameter in ``jacobian``.
        free: index (effect, parameter) of each free effect parameter.
        is_converged: whether the decrease of the cost in the last step was negligible.
    """

    model: Model
    logs: Floats
    effects: tuple[EffectSettings, ...]
    residual: Floats
    cost: float
    jacobian: Floats
    scales: Floats
    free: tuple[tuple[int, int], ...]
    is_converged: bool = True

    def standard_errors(
        self, held: Set[tuple[int, int]] = frozenset(), held_nominal: Set[int] = frozenset()
    ) -> dict[tuple[int, int], float]:
        """Return the standard error of each free effect parameter, SI units.

        Args:
            held: effect parameters that count as known.
            held_nominal: nominal parameters that count as known.
        """
        n = self.jacobian.shape[1] - len(self.free)
        free = [k for k, index in enumerate(self.free) if index not in held]
        nominal = [k for k in range(n) if k not in held_nominal]
        columns = self.jacobian[:, [*nominal, *(n + k for k in free)]]
        variance = np.diag(np.linalg.pinv(columns.T @ columns))[len(nominal) :]
        errors = np.sqrt(np.maximum(variance, 0.0)) * self.scales[free]
        return {self.free[k]: float(error) for k, error in zip(free, errors, strict=True)}


def refit(
    data: WhitenedData,
    nominal: Model,
    tolerance: float,
    effects: Sequence[EffectSettings] = (),
    start: Floats | None = None,
    fixed: Sequence[tuple[int, int]] = (),
    iterations: int = MAX_STEPS,
    nominal_columns: Floats | None = None,
    freedom: Freedom = Freedom(),
    workers: int = 1,
    is_nominal_held: bool = False,
) -> Refit:
    """Fit nominal parameters and effects by Levenberg-Marquardt with numerical derivatives.

    Args:
        data: recordings.
        nominal: the given model.
        tolerance: of its parameters, see ``prior_widths``.
        effects: effects to add, at their start values.
        start: start of the logarithms; zero if None.
        fixed: (effect, parameter) pairs that keep their value.
        iterations: largest number of steps.
        nominal_columns: derivatives of the whitened residual with respect to the nominal parameters, if they are
            known: they hardly change while an effect is fitted.
        freedom: nominal parameters that may move beyond the tolerance.
        workers: number of threads for the derivatives.
        is_nominal_held: whether the nominal parameters keep their start.

    Returns:
        The fit with the smallest cost.
    """
    widths = prior_widths(nominal, tolerance, freedom)
    free = tuple((i, j) for i, e in enumerate(effects) for j in range(len(e.values)) if (i, j) not in fixed)
    catalogue = [effect(e.name) for e in effects]
    parameters = [catalogue[i].parameters[j] for i, j in free]
    minimum = np.array([parameter.minimum for parameter in parameters])
    maximum = np.array([parameter.maximum for parameter in parameters])
    for k, (i, j) in enumerate(free):
        low_limit, high_limit = plausible_range(effects[i].name, catalogue[i].parameters[j].name, data.motions, nominal)
        minimum[k], maximum[k] = max(minimum[k], low_limit), min(maximum[k], high_limit)
    values = np.array([effects[i].values[j] for i, j in free])
    stroke = float(np.ptp(np.concatenate([motion.position for motion in data.motions])))
    scales = np.array([unit_of(effects[i], j, nominal, stroke) for i, j in free])
    n = len(widths)
    ratio = np.array([one.name in FITTED_BY_LOGARITHM and one.minimum > 0.0 for one in parameters], dtype=bool)

    def coordinate(value: Floats) -> Floats:
        shares = value / np.where(scales > 0, scales, 1.0)
        return np.where(ratio, np.log(np.where(ratio, np.maximum(shares, 1e-12), 1.0)), shares)

    x = np.concatenate([np.zeros(n) if start is None else start, coordinate(values)])
    bound = limits(nominal, tolerance, freedom)
    low, high = np.concatenate([-bound, coordinate(minimum)]), np.concatenate([bound, coordinate(maximum)])
    if any(item.name in PARTS_OF_SLIDING_FORCE for item in effects):
        low[[COULOMB, STATIC]] = -1.0
    x = np.clip(x, low, high)
    moves = np.ones(len(x), dtype=bool)
    moves[:n] = not is_nominal_held

    def unpack(z: Floats) -> tuple[Model, tuple[EffectSettings, ...]]:
        lists = [list(e.values) for e in effects]
        for (i, j), value, scale in zip(free, np.where(ratio, np.exp(z[n:] * ratio), z[n:]), scales, strict=True):
            parameter = catalogue[i].parameters[j]
            lists[i][j] = float(min(max(value * scale, parameter.minimum), parameter.maximum))
        moved = tuple(EffectSettings(e.name, tuple(v)) for e, v in zip(effects, lists, strict=True))
        return nominal.shifted(z[:n]).with_effects(moved), moved

    def residual(z: Floats) -> Floats:
        model, moved = unpack(z)
        return np.concatenate([data.residual(model), total_force_logs(z[:n], nominal, moved) / widths])

    here = residual(x)
    cost = 0.5 * float(here @ here)
    damping = 1.0e-3
    jacobian = np.zeros((len(here), len(x)))
    if nominal_columns is not None:
        jacobian[:, :n] = np.vstack([nominal_columns, np.diag(1.0 / widths)])
    units = np.concatenate([1.0 / widths, np.ones(len(free))])

    def derivative(k: int) -> Floats:
        step = DERIVATIVE_STEP if x[k] + DERIVATIVE_STEP <= high[k] else -DERIVATIVE_STEP
        shifted = x.copy()
        shifted[k] += step
        return np.asarray((residual(shifted) - here) / step)

    age, is_small = 0, False
    with ThreadPoolExecutor(max_workers=workers) as pool:
        for _ in range(iterations):
            wanted = range(n if nominal_columns is not None or age > 0 else 0, len(x))
            for k, column in zip(wanted, pool.map(derivative, wanted), strict=True):
                jacobian[:, k] = column
            normal, gradient = jacobian.T @ jacobian, jacobian.T @ here
            improved = 0.0
            for _attempt in range(6):
                lhs = normal + damping * np.diag(np.diag(normal) + 1e-12)
                candidate = x.copy()
                candidate[moves] -= np.linalg.solve(lhs[np.ix_(moves, moves)], gradient[moves])
                candidate = np.clip(candidate, low, high)
                there = residual(candidate)
                new_cost = 0.5 * float(there @ there)
                if np.isfinite(new_cost) and new_cost < cost:
                    improved = cost - new_cost
                    moved = (candidate - x) * units
                    if nominal_columns is None:  # Broyden's update until the next computation of the columns
                        missed = there - here - jacobian @ (candidate - x)
                        jacobian += np.outer(missed, moved * units / max(float(moved @ moved), 1e-30))
                    x, here, cost = candidate, there, new_cost
                    damping = max(damping / 5.0, 1e-7)
                    break
                damping *= 6.0
            is_small = improved < 1.0e-4 * cost + 0.2
            if is_small and (age == 0 or nominal_columns is not None):
                break
            age = 0 if is_small else (age + 1) % JACOBIAN_REFRESH_STEPS
    model, moved = unpack(x)
    if any(effects[i].name == PERIODIC_DISTURBANCE for i, _ in free):
        model = with_phases_of(model, data.motions[0])
        moved = model.effects[len(model.effects) - len(moved) :]
    units = np.where(ratio, scales * np.exp(x[n:] * ratio), scales)
    return Refit(model, x[:n].copy(), moved, here[: len(here) - n], cost, jacobian, units, free, is_small)


def reference_parameters(effects: Sequence[EffectSettings]) -> list[tuple[int, int]]:
    """Return the parameters in ``REFERENCE_PARAMETERS``, (effect, parameter)."""
    return [(i, j) for i, item in enumerate(effects) for j in REFERENCE_PARAMETERS.get(item.name, ())]


def fixed_parameters(effects: Sequence[EffectSettings]) -> list[tuple[int, int]]:
    """Return the parameters that are never fitted: reference values, an absent second harmonic, a learnt table."""
    absent = [i for i, item in enumerate(effects) if item.name == "cogging" and item.values[3] == 0.0]
    tables = [(i, j) for i, item in enumerate(effects) if effect(item.name).lists for j in range(len(item.values))]
    return reference_parameters(effects) + [(i, j) for i in absent for j in (3, 4)] + tables


@dataclass(frozen=True)
class RefitSetup:
    """Setup of a fit: everything except the effects and their start.

    Attributes:
        data: recordings to learn from.
        nominal: the given model.
        tolerance: tolerance of its parameters.
        freedom: nominal parameters that may move beyond the tolerance.
        fixed_effects: effects of the file that keep their values.
        workers: number of threads for the derivatives of one fit.
    """

    data: WhitenedData
    nominal: Model
    tolerance: float
    freedom: Freedom = Freedom()
    fixed_effects: frozenset[str] = frozenset()
    workers: int = 1

    def fit(
        self,
        effects: Sequence[EffectSettings],
        start: Floats | None,
        steps: int,
        fixed: Sequence[tuple[int, int]] | None = None,
        columns: Floats | None = None,
        is_nominal_held: bool = False,
    ) -> Refit:
        """Return the fit with these effects.

        Args:
            effects: at their start values.
            start: logarithms of the nominal parameters to start from; zero if None.
            steps: largest number of steps.
            fixed: parameters that keep their value, see ``refit``; those that are never fitted if None.
            columns: derivatives with respect to the nominal parameters if they are known, see ``refit``.
            is_nominal_held: whether the nominal parameters keep their start.
        """
        all_fixed = [*(fixed_parameters(effects) if fixed is None else fixed), *self.fixed_effect_parameters(effects)]
        return refit(
            self.data,
            self.nominal,
            self.tolerance,
            effects,
            start,
            all_fixed,
            steps,
            columns,
            self.freedom,
            self.workers,
            is_nominal_held,
        )

    def fixed_effect_parameters(self, effects: Sequence[EffectSettings]) -> list[tuple[int, int]]:
        """Return the parameters of ``fixed_effects``, (effect, parameter)."""
        return [
            (i, j) for i, item in enumerate(effects) if item.name in self.fixed_effects for j in range(len(item.values))
        ]
