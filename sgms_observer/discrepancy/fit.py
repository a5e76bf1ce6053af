"""Refits: nominal parameters within their tolerance, together with the parameters of effects, on whitened residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.discrepancy.model import COULOMB, KNEE, STATIC, Model, largest_reach, predict
from sgms_observer.discrepancy.motion import Motion
from sgms_observer.discrepancy.noise import Noise, fit_noise
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

ELEMENT_SLACK = 15.0
STEP = 1.0e-4
SHORTEST = 0.75
"""Shortest distance of a memory, as a share of the contact's largest reach: less is the contact's own business."""
SHORTEST_PLAY = 0.3
"""Shortest play, as a share of the same: a wall is felt within a few micrometres, however long the contact's reach."""
SHORTEST_STOP = 0.01
"""Shortest give of a wall, as a share of the same: less no recording tells."""
WIDEST_STEP = 0.08
"""Widest step of wear, as a share of the travel."""
SHORTEST_DRIFT, LONGEST_DRIFT = 0.05, 5.0
"""Time constants of a drift, as shares of the recording's length."""
SLOWEST_LAG = 0.2
"""Slowest attraction, in Coulomb forces per second."""
LONGEST_ELEMENT = 1.0e-3
"""Longest distance over which a contact's missing element builds up [m]."""
LONGEST_PITCH = 0.7
"""Longest period in position, as a share of the stroke."""
UNITS = {"nonlinear_viscous": (2,), "thermal_drift": (3,)}
"""Parameters that are a unit of others and never fitted: (effect, indices)."""
REFRESH = 3
"""Steps after which derivatives by the nominal parameters are computed anew."""
BY_RATIO = (
    "attraction_rate", "distance", "memory_distance", "gap", "stop", "time_constant", "dwell_time", "width", "velocity",
    "peak_velocity",
)  # fmt: skip
"""Positive parameters that may be off by a factor: they are moved by their logarithm."""
MISSING_ELEMENT = "presliding"
LOAD_BEHIND_PLAY = "backlash"
PARTS_OF_THE_LEVEL = (MISSING_ELEMENT, LOAD_BEHIND_PLAY)
"""Effects whose force the owner's Coulomb and static force already contain."""
LEAST_NOISE = 1.0e-3
"""Least rms noise of a measured force, as a share of the effort."""
_MAX_ITERATIONS = 12


@dataclass(frozen=True)
class Judged:
    """Motions with the noise and weights every column passes.

    Attributes:
        motions: recordings.
        noise: of each recording.
        weights: of each recording at the rate of residuals.
    """

    motions: tuple[Motion, ...]
    noise: tuple[Noise, ...]
    weights: tuple[Floats, ...]

    def whitened(self, columns: Sequence[Floats]) -> Floats:
        """Return one column of all recordings, from working-rate series, in units of the noise."""
        parts = [
            noise.whitened(motion.low_pass(column), weights)
            for motion, noise, weights, column in zip(self.motions, self.noise, self.weights, columns, strict=True)
        ]
        return np.concatenate(parts)

    def residual(self, model: Model) -> Floats:
        """Return the model's residual in units of the noise."""
        return self.whitened([predict(model, motion).residual for motion in self.motions])

    @property
    def count(self) -> int:
        """Number of whitened residuals."""
        return len(self.whitened([np.zeros(len(motion.time)) for motion in self.motions]))


def judged_with(motions: Sequence[Motion], model: Model) -> Judged:
    """Return motions with the noise that the model's residual has."""
    noises, weights = [], []
    for motion in motions:
        prediction = predict(model, motion)
        doubt = motion.thinned(prediction.doubt)
        least = LEAST_NOISE * float(np.std(motion.effort))
        noise = fit_noise(motion.low_pass(prediction.residual), doubt, motion.residual_period, least)
        noises.append(noise)
        weights.append(noise.weights(doubt))
    return Judged(tuple(motions), tuple(noises), tuple(weights))


def prior_widths(model: Model, tolerance: float) -> Floats:
    """Return how far the logarithm of each nominal parameter may be off (one standard deviation).

    Args:
        model: the nominal model.
        tolerance: largest relative error its owner expects; elements may be off ``ELEMENT_SLACK`` times as far, because
            few elements stand for a continuous contact.
    """
    names = model.parameter_names()
    one = tolerance / np.sqrt(3.0)
    return np.array([ELEMENT_SLACK * one if name.startswith("element") else one for name in names])


@dataclass(frozen=True)
class Refit:
    """A refitted model.

    Attributes:
        model: with the refitted parameters and effects.
        logs: logarithms of the nominal parameters over the given ones.
        effects: the effects of this fit.
        residual: whitened residual.
        cost: half its square plus the prior's.
        jacobian: of residual and prior rows by (logs, free effect parameters), at the solution.
        scales: unit of each free effect parameter in ``jacobian``.
        free: index (effect, parameter) of each free effect parameter.
    """

    model: Model
    logs: Floats
    effects: tuple[EffectSettings, ...]
    residual: Floats
    cost: float
    jacobian: Floats
    scales: Floats
    free: tuple[tuple[int, int], ...]

    def deviations(self) -> Floats:
        """Return the standard deviation of each free effect parameter, SI units."""
        n = len(self.free)
        if n == 0:
            return np.zeros(0)
        normal = self.jacobian.T @ self.jacobian
        covariance = np.linalg.pinv(normal)
        return np.sqrt(np.maximum(np.diag(covariance)[-n:], 0.0)) * self.scales


def refit(
    judged: Judged,
    nominal: Model,
    tolerance: float,
    effects: Sequence[EffectSettings] = (),
    start: Floats | None = None,
    fixed: Sequence[tuple[int, int]] = (),
    iterations: int = _MAX_ITERATIONS,
    nominal_columns: Floats | None = None,
    limit: float | None = None,
) -> Refit:
    """Fit nominal parameters and effects by Levenberg-Marquardt with numerical derivatives.

    Args:
        judged: recordings.
        nominal: the given model.
        tolerance: of its parameters, see ``prior_widths``.
        effects: effects to add, at their start values.
        start: start of the logarithms; zero if None.
        fixed: (effect, parameter) pairs that keep their value.
        iterations: largest number of steps.
        nominal_columns: derivatives of the whitened residual by the nominal parameters, when they are known well
            enough: they hardly change while an effect is fitted.
        limit: largest logarithm by which a parameter may move; elements ``ELEMENT_SLACK`` times as far.

    Returns:
        The best point found.
    """
    widths = prior_widths(nominal, tolerance)
    free = tuple((i, j) for i, e in enumerate(effects) for j in range(len(e.values)) if (i, j) not in fixed)
    catalogue = [effect(e.name) for e in effects]
    minimum = np.array([catalogue[i].parameters[j].minimum for i, j in free])
    maximum = np.array([catalogue[i].parameters[j].maximum for i, j in free])
    for k, (i, j) in enumerate(free):
        low_limit, high_limit = believable(effects[i].name, catalogue[i].parameters[j].name, judged.motions, nominal)
        minimum[k], maximum[k] = max(minimum[k], low_limit), min(maximum[k], high_limit)
    values = np.array([effects[i].values[j] for i, j in free])
    scales = np.array([_scale(effects[i], j, nominal) for i, j in free])
    n = len(widths)
    ratio = np.array([catalogue[i].parameters[j].name in BY_RATIO for i, j in free], dtype=bool)

    def coordinate(value: Floats) -> Floats:
        shares = value / np.where(scales > 0, scales, 1.0)
        return np.where(ratio, np.log(np.where(ratio, np.maximum(shares, 1e-12), 1.0)), shares)

    x = np.concatenate([np.zeros(n) if start is None else start, coordinate(values)])
    low = np.concatenate([np.full(n, -3.0), coordinate(minimum)])
    high = np.concatenate([np.full(n, 3.0), coordinate(maximum)])
    if limit is not None:
        low[: KNEE + 1], high[: KNEE + 1] = -limit, limit
        low[KNEE + 1 : n], high[KNEE + 1 : n] = -ELEMENT_SLACK * limit, ELEMENT_SLACK * limit
        if any(item.name in PARTS_OF_THE_LEVEL for item in effects):
            low[[COULOMB, STATIC]] = -1.0
    x = np.clip(x, low, high)

    def unpack(z: Floats) -> tuple[Model, tuple[EffectSettings, ...]]:
        lists = [list(e.values) for e in effects]
        for (i, j), value, scale in zip(free, np.where(ratio, np.exp(z[n:] * ratio), z[n:]), scales, strict=True):
            parameter = catalogue[i].parameters[j]
            lists[i][j] = float(min(max(value * scale, parameter.minimum), parameter.maximum))
        moved = tuple(EffectSettings(e.name, tuple(v)) for e, v in zip(effects, lists, strict=True))
        return nominal.shifted(z[:n]).with_effects(moved), moved

    def residual(z: Floats) -> Floats:
        model, moved = unpack(z)
        return np.concatenate([judged.residual(model), told(z[:n], nominal, moved) / widths])

    here = residual(x)
    cost = 0.5 * float(here @ here)
    damping = 1.0e-3
    jacobian = np.zeros((len(here), len(x)))
    if nominal_columns is not None:
        jacobian[:, :n] = np.vstack([nominal_columns, np.diag(1.0 / widths)])
    units = np.concatenate([1.0 / widths, np.ones(len(free))])
    age = 0
    for _ in range(iterations):
        for k in range(n if nominal_columns is not None or age > 0 else 0, len(x)):
            step = STEP if x[k] + STEP <= high[k] else -STEP
            shifted = x.copy()
            shifted[k] += step
            jacobian[:, k] = (residual(shifted) - here) / step
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ here
        improved = 0.0
        for _attempt in range(6):
            lhs = normal + damping * np.diag(np.diag(normal) + 1e-12)
            candidate = np.clip(x - np.linalg.solve(lhs, gradient), low, high)
            there = residual(candidate)
            new_cost = 0.5 * float(there @ there)
            if np.isfinite(new_cost) and new_cost < cost:
                improved = cost - new_cost
                moved = (candidate - x) * units
                if nominal_columns is None:  # Broyden's update, until the columns are computed anew
                    missed = there - here - jacobian @ (candidate - x)
                    jacobian += np.outer(missed, moved * units / max(float(moved @ moved), 1e-30))
                x, here, cost = candidate, there, new_cost
                damping = max(damping / 5.0, 1e-7)
                break
            damping *= 6.0
        is_small = improved < 1.0e-4 * cost + 0.2
        if is_small and (age == 0 or nominal_columns is not None):
            break
        age = 0 if is_small else (age + 1) % REFRESH
    model, moved = unpack(x)
    units = np.where(ratio, scales * np.exp(x[n:] * ratio), scales)
    return Refit(model, x[:n].copy(), moved, here[: len(here) - n], cost, jacobian, units, free)


def kept(effects: Sequence[EffectSettings]) -> list[tuple[int, int]]:
    """Return the parameters that are never fitted: units of others, an absent second harmonic."""
    kept = [(i, j) for i, item in enumerate(effects) for j in UNITS.get(item.name, ())]
    for i, item in enumerate(effects):
        if item.name == "cogging" and item.values[3] == 0.0:
            kept += [(i, 3), (i, 4)]
    return kept


@dataclass(frozen=True)
class Refits:
    """Refits to the same recordings that differ in their effects.

    Attributes:
        judged: recordings to learn from.
        nominal: the given model.
        tolerance: of its parameters.
        limit: of the friction parameters, see ``refit``.
    """

    judged: Judged
    nominal: Model
    tolerance: float
    limit: float | None = None

    def of(
        self,
        effects: Sequence[EffectSettings],
        start: Floats | None,
        steps: int,
        fixed: Sequence[tuple[int, int]] | None = None,
        columns: Floats | None = None,
    ) -> Refit:
        """Fit with these effects.

        Args:
            effects: at their start values.
            start: logarithms of the nominal parameters to start from; zero if None.
            steps: largest number of steps.
            fixed: parameters that keep their value, see ``refit``; those that are never fitted if None.
            columns: derivatives by the nominal parameters where they are known, see ``refit``.
        """
        still = kept(effects) if fixed is None else fixed
        return refit(self.judged, self.nominal, self.tolerance, effects, start, still, steps, columns, self.limit)


def told(logs: Floats, nominal: Model, effects: Sequence[EffectSettings]) -> Floats:
    """Return the logarithms as their owner would see them: what a part of the level takes, he measured with it."""
    parts = [item for item in effects if item.name in PARTS_OF_THE_LEVEL]
    if not parts:
        return logs
    seen = logs.copy()
    for row, force in ((COULOMB, nominal.friction.coulomb_force), (STATIC, nominal.friction.static_force)):
        level = np.exp(logs[row])
        own = sum(taken(item.name, item.values, force, level) for item in parts)
        seen[row] = np.log(max(level + own, 1.0e-3))
    return seen


def told_start(logs: Floats, nominal: Model, start: EffectSettings) -> Floats:
    """Return where a fit with one more effect starts: a part of the level leaves the level as it is."""
    moved = logs.copy()
    for row, force in ((COULOMB, nominal.friction.coulomb_force), (STATIC, nominal.friction.static_force)):
        if start.name == MISSING_ELEMENT:
            moved[row] = np.log(max(np.exp(logs[row]) - start.values[0] / force, 0.1))
        elif start.name == LOAD_BEHIND_PLAY:
            moved[row] = logs[row] + np.log(1.0 - start.values[1])
    return moved


def taken(name: str, values: Sequence[float], force: float, level: float) -> float:
    """Return what a part of the level takes, as a share of the owner's force.

    Args:
        name: of an effect in ``PARTS_OF_THE_LEVEL``.
        values: its values.
        force: the level that the owner measured [N].
        level: what is left of it beside the part, as a share [-].
    """
    return values[0] / force if name == MISSING_ELEMENT else level * values[1] / (1.0 - values[1])


def believable(name: str, parameter: str, motions: Sequence[Motion], nominal: Model) -> tuple[float, float]:
    """Return the range in which a parameter gives its effect the shape of its name in these recordings.

    A ripple longer than the stroke is a slope, a spring whose rest lies far away is an offset, a step wider than the
    travel is a drift, a memory shorter than the contact's reach is the contact's own business.
    """
    position = np.concatenate([motion.position for motion in motions])
    stroke = float(np.ptp(position))
    if parameter == "pitch":
        return 0.0, LONGEST_PITCH * stroke
    if parameter == "rest_position":
        return float(position.min()) - 0.5 * stroke, float(position.max()) + 0.5 * stroke
    if name == "wear_step" and parameter == "width":
        return 0.0, WIDEST_STEP * max(float(np.sum(np.abs(np.diff(motion.position)))) for motion in motions)
    if name == "thermal_drift" and parameter == "time_constant":
        length = max(float(motion.time[-1]) for motion in motions)
        return SHORTEST_DRIFT * length, LONGEST_DRIFT * length
    if name == "stribeck" and parameter == "velocity":  # slower is the nominal curve itself
        return 2.5 * nominal.friction.stribeck_velocity, np.inf
    if name == "frictional_lag" and parameter == "distance":
        return 0.05 * largest_reach(nominal.friction), np.inf
    if parameter == "attraction_rate":  # slower than a recording can tell
        return SLOWEST_LAG * nominal.friction.coulomb_force, np.inf
    if name == MISSING_ELEMENT and parameter == "distance":  # what gives over millimetres is no contact
        return SHORTEST * largest_reach(nominal.friction), LONGEST_ELEMENT
    if parameter == "stop":  # softer is a missing element, not a wall
        return SHORTEST_STOP * largest_reach(nominal.friction), 0.5 * largest_reach(nominal.friction)
    if parameter == "gap":
        return SHORTEST_PLAY * largest_reach(nominal.friction), np.inf
    if parameter in ("memory_distance", "distance"):
        return SHORTEST * largest_reach(nominal.friction), np.inf
    return -np.inf, np.inf


def _scale(settings: EffectSettings, index: int, nominal: Model) -> float:
    """Return the unit in which an effect's parameter is moved."""
    parameter = effect(settings.name).parameters[index]
    if parameter.unit == "N":
        return nominal.friction.coulomb_force
    if parameter.unit == "rad" or (parameter.unit == "-" and parameter.is_strength):
        return 1.0
    if parameter.unit == "kg":
        return nominal.mass
    if parameter.unit == "N s/m":
        return max(nominal.friction.viscous_coefficient, abs(settings.values[index]), 1e-9)
    value = abs(settings.values[index])
    if parameter.name in ("center", "rest_position"):
        return 1.0e-2
    return value if value > 0.0 else 1.0
