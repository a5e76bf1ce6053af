"""Fit of nominal parameters within their tolerance and of effect parameters to whitened residuals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.diagnosis.contact_slopes import contact_parameters
from sgms_observer.diagnosis.model import (
    COULOMB,
    DAMPING,
    PERIODIC_DISTURBANCE,
    PHASE,
    SCALAR_PARAMETERS,
    STATIC,
    Model,
    with_phases_of,
)
from sgms_observer.diagnosis.ranges import plausible_range, unit_of
from sgms_observer.diagnosis.sliding_force import PARTS_OF_SLIDING_FORCE, total_force_logs
from sgms_observer.diagnosis.whitened import WhitenedData
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.effect import EffectParameter
from sgms_observer.settings.axis import EffectSettings

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
    "nonlinear_viscous": (2,), "thermal_drift": (3,), "gravity": (2,), PERIODIC_DISTURBANCE: (PHASE,),
}  # fmt: skip
"""Parameters that are a reference value or follow from joint or recording. They are never fitted: (effect, indices)."""
FITTED_BY_LOGARITHM = (
    "attraction_rate", "distance", "memory_distance", "gap", "stop", "time_constant", "dwell_time", "width", "velocity",
    "peak_velocity", "rest_velocity",
)  # fmt: skip
"""Parameters that are fitted by their logarithm where they cannot be zero."""
COST_TOLERANCE = 1.0e-4
"""Relative decrease of the cost at which a fit has converged: of thousands of residuals, less than one squared standard
deviation, which no comparison of hypotheses sees."""
MAX_EVALUATIONS = 12
"""Evaluated models of a fit that is compared with others: on another contact law the cost decreases slowly."""
WRITTEN_EVALUATIONS = 100
"""Evaluated models of a fit that is written, after which it ends anyway."""
FRICTION_VALUES = frozenset((*SCALAR_PARAMETERS, "attraction_rate")) - {"mass"}
"""Names of the friction values that a change of the contact frees."""
SLIDING_FRICTION_VALUES = frozenset(("coulomb_force", "viscous_coefficient"))
"""Those that make the friction far above the Stribeck velocity."""
BOUND_TOLERANCE = 1.0e-6
"""Distance from a bound, relative where the bound exceeds 1, below which a coordinate counts as at it."""


@dataclass(frozen=True)
class Freedom:
    """Values of the file that the fit may move beyond the tolerance.

    Attributes:
        friction: names of friction values, any of ``FRICTION_VALUES``.
        elements: stiffness and share of the elements.
        has_narrow_elements: whether elements that are not free have the tolerance of the other values.
    """

    friction: frozenset[str] = frozenset()
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
            widths.append(FREED_FRICTION if name in freedom.friction else one)
    return np.array(widths)


def limits(model: Model, tolerance: float, freedom: Freedom = Freedom()) -> Floats:
    """Return the bound on the logarithm of each nominal parameter; arguments as above.

    The tolerance is a hard bound, except for elements and free values.
    """
    free = 3.0 * prior_widths(model, tolerance, freedom)
    one = np.log1p(tolerance)
    is_held = [not (name.startswith("element") or name in freedom.friction) for name in model.parameter_names()]
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

    def without_jacobian(self) -> Refit:
        """Return the fit to keep: its jacobian takes megabytes, and a search keeps every fit that it compared."""
        return replace(self, jacobian=np.zeros((0, self.jacobian.shape[1])))

    def with_signs_of(self, given: Mapping[str, Sequence[float]], held: Set[tuple[int, int]]) -> Refit:
        """Return the same model with each sine written as the file writes it, or else with a positive amplitude.

        A negative amplitude is the same force as a positive one at the opposite angle.

        Args:
            given: values of the effects of the file, by name.
            held: effect parameters that stay next to the values of the file: they are written as it writes them.
        """
        effects, flips = list(self.effects), np.ones(self.jacobian.shape[1])
        free, first = {*self.free} - held, len(flips) - len(self.free)
        for i, item in enumerate(effects):
            values, like = list(item.values), given.get(item.name, (0.0,) * len(item.values))
            for strength, angle in effect(item.name).waves:
                if not {(i, strength), (i, angle)} <= free:
                    continue
                if values[strength] * (like[strength] or 1.0) < 0.0:
                    values[strength], values[angle] = -values[strength], values[angle] + np.pi
                    flips[first + self.free.index((i, strength))] = -1.0
                turns = np.round((values[angle] - like[angle]) / (2.0 * np.pi))
                values[angle] = _within_turns(values[angle] - 2.0 * np.pi * turns, effect(item.name).parameters[angle])
            effects[i] = replace(item, values=tuple(map(float, values)))
        count = len(effects)
        model = replace(self.model, effects=(*self.model.effects[: len(self.model.effects) - count], *effects))
        return replace(self, model=model, effects=tuple(effects), jacobian=self.jacobian * flips)

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


class _Problem:
    """A fit as a bounded least-squares problem.

    Coordinates are the logarithms of the nominal parameters over the given ones, then each free effect parameter in its
    unit, or the logarithm of that.

    Args:
        data, nominal, tolerance, effects, fixed, within, freedom, workers: as in ``refit``.
    """

    def __init__(
        self,
        data: WhitenedData,
        nominal: Model,
        tolerance: float,
        effects: Sequence[EffectSettings],
        fixed: Sequence[tuple[int, int]],
        within: Mapping[tuple[int, int], tuple[float, float]],
        freedom: Freedom,
        workers: int,
    ) -> None:
        self.data, self.nominal, self.effects, self._workers = data, nominal, tuple(effects), workers
        self.free = tuple((i, j) for i, e in enumerate(effects) for j in range(len(e.values)) if (i, j) not in fixed)
        self.widths = prior_widths(nominal, tolerance, freedom)
        self.count = len(self.widths)
        self.in_contact = contact_parameters(nominal.with_effects(self.effects))
        catalogue = [effect(item.name) for item in effects]
        parameters = [catalogue[i].parameters[j] for i, j in self.free]
        ranges = [
            plausible_range(effects[i].name, catalogue[i].parameters[j].name, data.motions, nominal)
            for i, j in self.free
        ]
        ranges = [within.get(index, one) for index, one in zip(self.free, ranges, strict=True)]
        self._minimum = np.array([max(one.minimum, low) for one, (low, _) in zip(parameters, ranges, strict=True)])
        self._maximum = np.array([min(one.maximum, high) for one, (_, high) in zip(parameters, ranges, strict=True)])
        stroke = float(np.ptp(np.concatenate([motion.position for motion in data.motions])))
        self._scales = np.array([unit_of(effects[i], j, nominal, stroke) for i, j in self.free])
        self._by_logarithm = np.array(
            [one.name in FITTED_BY_LOGARITHM and one.minimum > 0.0 for one in parameters], dtype=bool
        )
        self._held = np.array([k for k, index in enumerate(self.free) if index in within], dtype=np.int64)
        self._held_middle = self._coordinates(0.5 * (self._minimum + self._maximum))[self._held]
        self._held_widths = (self._coordinates(self._maximum)[self._held] - self._held_middle) / np.sqrt(3.0)
        bound = limits(nominal, tolerance, freedom)
        self.low = np.concatenate([-bound, self._coordinates(self._minimum)])
        self.high = np.concatenate([bound, self._coordinates(self._maximum)])
        if any(item.name in PARTS_OF_SLIDING_FORCE for item in effects):
            self.low[[COULOMB, STATIC]] = -1.0
        self._last = (np.zeros(0), np.zeros(0))

    @property
    def prior_count(self) -> int:
        """Return the number of prior rows."""
        return self.count + len(self._held)

    def _coordinates(self, values: Floats) -> Floats:
        """Return the coordinates of values of the free effect parameters."""
        shares = values / np.where(self._scales > 0, self._scales, 1.0)
        logarithms = np.log(np.where(self._by_logarithm, np.maximum(shares, 1e-12), 1.0))
        return np.where(self._by_logarithm, logarithms, shares)

    def start(self, logs: Floats | None) -> Floats:
        """Return the coordinates of the effects' values and of these logarithms, zero if None."""
        values = np.array([self.effects[i].values[j] for i, j in self.free])
        x = np.concatenate([np.zeros(self.count) if logs is None else logs, self._coordinates(values)])
        return np.asarray(np.clip(x, self.low, self.high))

    def effects_at(self, x: Floats) -> tuple[EffectSettings, ...]:
        """Return the effects with the values of these coordinates."""
        lists = [list(item.values) for item in self.effects]
        shares = np.where(self._by_logarithm, np.exp(x[self.count :] * self._by_logarithm), x[self.count :])
        for (i, j), value, low, high in zip(
            self.free, shares * self._scales, self._minimum, self._maximum, strict=True
        ):
            lists[i][j] = float(min(max(value, low), high))
        return tuple(EffectSettings(item.name, tuple(v)) for item, v in zip(self.effects, lists, strict=True))

    def model_at(self, x: Floats) -> Model:
        """Return the model of these coordinates."""
        return self.nominal.shifted(x[: self.count]).with_effects(self.effects_at(x))

    def residual(self, x: Floats) -> Floats:
        """Return whitened residuals and prior rows."""
        if not np.array_equal(x, self._last[0]):
            rows = np.concatenate([self.data.residual(self.model_at(x)), self._prior(x, self.effects_at(x))])
            self._last = (x.copy(), rows)
        return self._last[1]

    def _prior(self, x: Floats, effects: Sequence[EffectSettings]) -> Floats:
        """Return the prior rows: of the nominal parameters, then of effects that stay within the tolerance."""
        of_nominal = total_force_logs(x[: self.count], self.nominal, effects) / self.widths
        return np.concatenate([of_nominal, (x[self.count + self._held] - self._held_middle) / self._held_widths])

    def jacobian(self, x: Floats, wanted: Booleans, nominal_columns: Floats | None) -> Floats:
        """Return the derivatives of ``residual``, by differences except for the contact.

        Args:
            x: coordinates.
            wanted: whether to differentiate with respect to each coordinate; the other columns are zero.
            nominal_columns: derivatives with respect to the nominal parameters if they are known.
        """
        here = self.residual(x)
        columns = np.zeros((len(here), len(x)))
        known: Sequence[int] = self.in_contact
        if nominal_columns is not None:
            of_held = np.zeros((len(self._held), self.count))
            columns[:, : self.count] = np.vstack([nominal_columns, np.diag(1.0 / self.widths), of_held])
            known = range(self.count)
        elif known and wanted[known].any():
            columns[:, known] = self._contact_columns(x)

        others = [k for k in np.flatnonzero(wanted) if k not in known]
        shares = [share for share in np.array_split(others, self._workers) if len(share)]
        if len(shares) == 1:  # every new thread would keep memory of its own
            columns[:, others] = self._differences(x, shares[0])
        elif shares:
            with ThreadPoolExecutor(max_workers=self._workers) as pool:
                columns[:, others] = np.hstack(list(pool.map(partial(self._differences, x), shares)))
        return columns

    def _differences(self, x: Floats, numbers: NDArray[np.intp]) -> Floats:
        """Return the derivatives with respect to some coordinates by differences."""
        steps = np.where(x[numbers] + DERIVATIVE_STEP <= self.high[numbers], DERIVATIVE_STEP, -DERIVATIVE_STEP)
        moved = x + steps[:, None] * np.eye(len(x))[numbers]
        residuals = self.data.residuals([self.model_at(one) for one in moved])
        priors = np.transpose([self._prior(one, self.effects_at(one)) for one in moved])
        return np.asarray((np.vstack([residuals, priors]) - self.residual(x)[:, None]) / steps)

    def _contact_columns(self, x: Floats) -> Floats:
        """Return the derivatives with respect to the parameters of the contact."""
        effects = self.effects_at(x)
        steps = DERIVATIVE_STEP * np.eye(len(x))[self.in_contact]
        of_prior = [(self._prior(x + step, effects) - self._prior(x, effects)) / DERIVATIVE_STEP for step in steps]
        slopes = self.data.contact_slopes(self.nominal.with_effects(effects), x[: self.count])
        return np.vstack([slopes, np.transpose(of_prior)])

    def units(self, x: Floats) -> Floats:
        """Return the derivative of each free effect parameter with respect to its coordinate."""
        return np.where(self._by_logarithm, self._scales * np.exp(x[self.count :] * self._by_logarithm), self._scales)


def refit(
    data: WhitenedData,
    nominal: Model,
    tolerance: float,
    effects: Sequence[EffectSettings] = (),
    start: Floats | None = None,
    fixed: Sequence[tuple[int, int]] = (),
    within: Mapping[tuple[int, int], tuple[float, float]] = MappingProxyType({}),
    evaluations: int = MAX_EVALUATIONS,
    nominal_columns: Floats | None = None,
    freedom: Freedom = Freedom(),
    workers: int = 1,
    is_nominal_held: bool = False,
) -> Refit:
    """Fit nominal parameters and effects, each within its bounds.

    The fit goes on until its cost hardly decreases: hypotheses are compared by what they leave, and one that ended
    early leaves more. The search is the bounded trust region of Branch, Coleman and Li (1999), SIAM J. Sci. Comput. 21.

    Args:
        data: recordings.
        nominal: the given model.
        tolerance: of its parameters, see ``prior_widths``.
        effects: effects to add, at their start values.
        start: start of the logarithms; zero if None.
        fixed: (effect, parameter) pairs that keep their value.
        within: bounds of (effect, parameter) pairs, narrower than their plausible ranges.
        evaluations: largest number of evaluated models; 1 for the derivatives at the start only.
        nominal_columns: derivatives of the whitened residual with respect to the nominal parameters, if they are
            known: they hardly change while an effect is fitted.
        freedom: nominal parameters that may move beyond the tolerance.
        workers: number of threads for the derivatives.
        is_nominal_held: whether the nominal parameters keep their start.

    Returns:
        The fit.
    """
    problem = _Problem(data, nominal, tolerance, effects, fixed, within, freedom, workers)
    x = problem.start(start)
    moves = problem.low < problem.high
    moves[: problem.count] &= not is_nominal_held
    is_converged = True

    def with_moved(values: Floats) -> Floats:
        whole = x.copy()
        whole[moves] = values
        return whole

    if evaluations > 1 and np.any(moves):
        found = least_squares(
            lambda values: problem.residual(with_moved(values)), x[moves],
            lambda values: problem.jacobian(with_moved(values), moves, nominal_columns)[:, moves],
            (problem.low[moves], problem.high[moves]), x_scale="jac", ftol=COST_TOLERANCE, max_nfev=evaluations,
        )  # fmt: skip
        x = with_moved(_at_bounds(found.x, problem.low[moves], problem.high[moves]))
        is_converged, jacobian = found.status > 0, found.jac
    if evaluations == 1 or not np.all(moves):
        jacobian = problem.jacobian(x, np.ones(len(x), dtype=bool), nominal_columns)
    here = problem.residual(x)
    model, moved = problem.model_at(x), problem.effects_at(x)
    if any(effects[i].name == PERIODIC_DISTURBANCE for i, _ in problem.free):
        model = with_phases_of(model, data.motions[0])
        moved = model.effects[len(model.effects) - len(moved) :]
    n = problem.count
    return Refit(
        model, x[:n].copy(), moved, here[: len(here) - problem.prior_count], 0.5 * float(here @ here), jacobian,
        problem.units(x), problem.free, is_converged,
    )  # fmt: skip


def _within_turns(angle: float, parameter: EffectParameter) -> float:
    """Return the same angle within the range of its parameter, which is at least one turn wide [rad]."""
    turns_down = math.ceil(max(angle - parameter.maximum, 0.0) / (2.0 * math.pi))
    turns_up = math.ceil(max(parameter.minimum - angle, 0.0) / (2.0 * math.pi))
    return angle + 2.0 * math.pi * (turns_up - turns_down)


def _at_bounds(x: Floats, low: Floats, high: Floats) -> Floats:
    """Return coordinates with those next to a bound at it: the search stays inside the bounds."""
    found = np.where(x - low < BOUND_TOLERANCE * np.maximum(1.0, np.abs(low)), low, x)
    return np.where(high - x < BOUND_TOLERANCE * np.maximum(1.0, np.abs(high)), high, found)


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
        held_effects: effects of the file whose values stay within the tolerance.
        file_effects: all effects of the file, with its values.
        workers: number of threads for the derivatives of one fit.
    """

    data: WhitenedData
    nominal: Model
    tolerance: float
    freedom: Freedom = Freedom()
    held_effects: frozenset[str] = frozenset()
    file_effects: tuple[EffectSettings, ...] = ()
    workers: int = 1

    def fit(
        self,
        effects: Sequence[EffectSettings],
        start: Floats | None = None,
        fixed: Sequence[tuple[int, int]] | None = None,
        columns: Floats | None = None,
        is_nominal_held: bool = False,
        evaluations: int = MAX_EVALUATIONS,
    ) -> Refit:
        """Return the fit with these effects.

        Args:
            effects: at their start values.
            start: logarithms of the nominal parameters to start from; zero if None.
            fixed: parameters that keep their value, see ``refit``; those that are never fitted if None.
            columns: derivatives with respect to the nominal parameters if they are known, see ``refit``.
            is_nominal_held: whether the nominal parameters keep their start.
            evaluations: largest number of evaluated models; 1 for the derivatives at the start only.
        """
        within = self.ranges_of_held_effects(effects)
        of_file = [(i, j) for i, e in enumerate(effects) if e.name in self.held_effects for j in range(len(e.values))]
        all_fixed = [*(fixed_parameters(effects) if fixed is None else fixed), *(set(of_file) - set(within))]
        found = refit(
            self.data,
            self.nominal,
            self.tolerance,
            effects,
            start,
            all_fixed,
            within,
            evaluations,
            columns,
            self.freedom,
            self.workers,
            is_nominal_held,
        )
        return found.with_signs_of({item.name: item.values for item in self.file_effects}, frozenset(within))

    def without(self, name: str, effects: Sequence[EffectSettings]) -> tuple[RefitSetup, tuple[EffectSettings, ...]]:
        """Return setup and effects without one effect. An effect of the file stays, with the file's values."""
        given = {item.name: item for item in self.file_effects}
        if name not in given:
            return self, tuple(item for item in effects if item.name != name)
        setup = replace(self, held_effects=self.held_effects | {name})
        return setup, tuple(given[name] if item.name == name else item for item in effects)

    def without_all(
        self, names: Iterable[str], effects: Sequence[EffectSettings]
    ) -> tuple[RefitSetup, tuple[EffectSettings, ...]]:
        """Return setup and effects without several effects, see ``without``."""
        setup, left = self, tuple(effects)
        for name in names:
            setup, left = setup.without(name, left)
        return setup, left

    def null_values(self, name: str) -> tuple[float, ...]:
        """Return the values of an effect that are no finding.

        They are the defaults, at which it makes no force. Of an effect of the file that has strengths alone they are
        the values of the file.
        """
        entry = effect(name)
        given = {item.name: item.values for item in self.file_effects}
        is_strength_alone = all(one.is_strength for one in entry.parameters)
        return tuple(given[name]) if name in given and is_strength_alone else tuple(entry.defaults)

    def ranges_of_held_effects(self, effects: Sequence[EffectSettings]) -> dict[tuple[int, int], tuple[float, float]]:
        """Return the range of each strength and angle of ``held_effects`` within the tolerance, (effect, parameter).

        An angle may be wrong by as many radians as a strength by its share: that moves the force as far.
        """
        given = {item.name: item.values for item in self.file_effects}
        never = set(fixed_parameters(effects))
        ranges = {}
        for i, item in enumerate(effects):
            for j, one in enumerate(effect(item.name).parameters if item.name in self.held_effects else ()):
                value = given[item.name][j]
                width = self.tolerance * (1.0 if one.unit == "rad" else abs(value))
                if (one.is_strength or one.unit == "rad") and width > 0.0 and (i, j) not in never:
                    ranges[i, j] = value - width, value + width
        return ranges
