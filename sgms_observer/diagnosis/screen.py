"""Screening of all effects: chi2_reduction of the linear columns of each effect, beyond the nominal parameters."""

from __future__ import annotations

from collections.abc import Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis import search
from sgms_observer.diagnosis.contact_slopes import contact_parameters
from sgms_observer.diagnosis.fit import DERIVATIVE_STEP, Freedom, Refit, prior_widths
from sgms_observer.diagnosis.model import PERIODIC_DISTURBANCE, predict, stribeck
from sgms_observer.diagnosis.noise import spectrum_of
from sgms_observer.diagnosis.sliding_force import BACKLASH, PARTS_OF_SLIDING_FORCE, share_of_sliding_force
from sgms_observer.diagnosis.whitened import WhitenedData
from sgms_observer.effects.catalogue import effect, is_built_in
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.effect import Effect, Place
from sgms_observer.effects.memoryless import output_along
from sgms_observer.settings.axis import EffectSettings

SIMULATED_EFFECTS = ("asymmetric_coulomb",)
"""Effects on the sliding force whose column needs a simulation: at rest they differ from an added force."""
SECOND_START_SHARE = {BACKLASH: 0.5}
"""Smallest chi2_reduction of a second start, as a share of the largest, if it is not 0.8. Backlash with a slightly
wrong gap engages at the wrong time, so the grid of shapes may miss the best gap."""
MIN_PERIODS = 20
"""Smallest number of periods of a periodic disturbance in the recording: the motion explains slower ones as well."""
MAX_SHAPES = 8
"""Largest number of shapes that are kept for an effect."""
SINES_OF_POSITION, PITCH = ("cogging", "position_periodic_friction"), 1
"""Effects that are a sine of the position, and the index of its pitch."""
MANY_SHAPES, NORM_STEP = 96, 8
"""Of more pitches than ``MANY_SHAPES``, only so many are computed in full: twelve times as many as are kept. The norms
between every ``NORM_STEP``-th one are interpolated. A test compares with the screening of all."""


@dataclass(frozen=True)
class Columns:
    """Orthonormal columns of one shape after projection onto the complement of the nominal parameters' columns.

    Attributes:
        shape: the shape.
        basis: orthonormal, shape (n, k).
        to_coefficients: from projections on ``basis`` to the shape's coefficients, shape (columns, k).
        independent_share: norm of the columns after the projection over the norm before it.
        norm: norm of the columns before the projection, whitened, for unit coefficients.
    """

    shape: search.Shape
    basis: Floats
    to_coefficients: Floats
    independent_share: float
    norm: float

    def chi2_reduction(self, residual: Floats) -> float:
        """Return the decrease of the squared residual by the columns."""
        projection = self.basis.T @ residual
        if self.shape.is_positive and (self.to_coefficients @ projection)[0] > 0.0:
            return 0.0
        return float(projection @ projection)

    def start(self, residual: Floats) -> EffectSettings:
        """Return the effect with the strengths that reduce the residual most."""
        return self.shape.settings(-(self.to_coefficients @ (self.basis.T @ residual)))


@dataclass(frozen=True)
class Screening:
    """Result of the screening of one effect.

    Attributes:
        best: chi2_reduction and columns of the best shapes, the largest reduction first.
        trials: number of tried shapes.
        independent_share: median share of a shape's norm that the nominal parameters do not absorb.
    """

    best: tuple[tuple[float, Columns], ...]
    trials: int
    independent_share: float

    @property
    def chi2_reduction(self) -> float:
        """Return the largest chi2_reduction; 0 if no shape reduces the residual."""
        return self.best[0][0] if self.best else 0.0


class Screen:
    """Screening of effects on one set of recordings.

    Args:
        data: recordings with noise.
        current: fit so far. The columns of its parameters are projected out of every column.
        tolerance: tolerance of its nominal parameters.
        freedom: nominal parameters that may move beyond the tolerance.
        names: screened effects.
        workers: number of threads.
        held: effects of the file within its tolerance. Their columns are not projected out: they may lie beyond it.
    """

    def __init__(
        self,
        data: WhitenedData,
        current: Refit,
        tolerance: float,
        freedom: Freedom,
        names: Sequence[str],
        workers: int = 1,
        held: Set[str] = frozenset(),
    ) -> None:
        model = current.model
        self.data, self.model, self.tolerance = data, model, tolerance
        base = [predict(model, motion) for motion in data.motions]
        self._base = [item.residual for item in base]
        self._friction = [item.friction for item in base]
        self.residual = data.whitened(self._base)
        self._thin = [
            {
                "q": motion.thinned(motion.position),
                "v": motion.low_pass(motion.velocity),
                "a": motion.low_pass(motion.acceleration),
                "t": motion.thinned(motion.time),
                "u": motion.low_pass(motion.effort),
                "v2": motion.low_pass(motion.other_velocity),
                "a2": motion.low_pass(motion.other_acceleration),
                "friction": motion.low_pass(friction),
            }
            for motion, friction in zip(data.motions, self._friction, strict=True)
        ]
        widths = prior_widths(model, tolerance, freedom)
        in_contact = contact_parameters(model)
        self.nominal_columns = np.empty((len(self.residual), len(widths)))
        if in_contact:
            self.nominal_columns[:, in_contact] = data.contact_slopes(model, np.zeros(len(widths)))
        for k in set(range(len(widths))) - set(in_contact):
            logs = np.zeros(len(widths))
            logs[k] = DERIVATIVE_STEP
            self.nominal_columns[:, k] = (data.residual(model.shifted(logs)) - self.residual) / DERIVATIVE_STEP
        n = len(widths)
        self._prior_residual = current.logs / widths
        stacked = np.vstack([self.nominal_columns, np.diag(1.0 / widths)])
        columns = [n + k for k, (i, _) in enumerate(current.free) if current.effects[i].name not in held]
        if columns:
            moving = current.jacobian[: len(stacked), columns]
            moving = moving[:, np.linalg.norm(moving, axis=0) > 1.0e-9]
            stacked = np.column_stack([stacked, moving])
        self._nominal_basis = np.linalg.qr(stacked)[0]
        self._left = self.residual_without_nominal()
        with ThreadPoolExecutor(max_workers=workers) as pool:
            self.screenings: dict[str, Screening] = dict(zip(names, pool.map(self._screened, names), strict=True))

    def without_nominal(self, values: Floats, prior: Floats | None = None) -> Floats:
        """Return whitened columns, with prior rows, projected onto the complement of the nominal columns."""
        padded = np.concatenate(
            [values, np.zeros((len(self._prior_residual), *values.shape[1:])) if prior is None else prior]
        )
        return np.asarray(padded - self._nominal_basis @ (self._nominal_basis.T @ padded))

    def residual_without_nominal(self) -> Floats:
        """Return the residual projected onto the complement of the nominal columns."""
        return self.without_nominal(self.residual, self._prior_residual)

    def _shapes(self, name: str) -> list[search.Shape]:
        """Return the shapes of an effect that the recordings can show."""
        return search.shapes(name, self.data.motions, self.model)

    def _screened(self, name: str) -> Screening:
        """Return the screening of one effect, with one shape in memory at a time."""
        if name == PERIODIC_DISTURBANCE:
            return self._strongest_sine()
        shapes = self._shapes(name)
        step = NORM_STEP if name in SINES_OF_POSITION and len(shapes) > MANY_SHAPES else 1
        found, norms, shares = self._computed(name, shapes[::step])
        if step > 1 and any(norms):
            found, *_ = self._computed(name, self._promising(name, shapes, norms))
        return Screening(tuple(found), len(shapes), float(np.median(shares)) if shares else 0.0)

    def _computed(
        self, name: str, shapes: Sequence[search.Shape]
    ) -> tuple[list[tuple[float, Columns]], list[float], list[float]]:
        """Return the best shapes with their chi2_reduction, each shape's norm after the projection, and the shares.

        Shares are those of the norms that the nominal parameters do not absorb, of the shapes that they leave.
        """
        found: list[tuple[float, Columns]] = []
        norms, shares = [], []
        for shape in shapes:
            raw = np.column_stack([self._column(name, item.values) for item in shape.columns()])
            item = self._orthonormal(shape, raw)
            norms.append(0.0 if item is None else item.independent_share * item.norm)
            if item is None:
                continue
            shares.append(item.independent_share)
            reduction = item.chi2_reduction(self._left)
            if reduction > 0.0:
                found = sorted([*found, (reduction, item)], key=lambda pair: -pair[0])[:MAX_SHAPES]
        return found, norms, shares

    def _promising(self, name: str, shapes: Sequence[search.Shape], norms: Sequence[float]) -> list[search.Shape]:
        """Return the pitches of a sine of the position that may reduce the residual most.

        The projection of the residual on a sine is exact, without whitening the sine; its norm is interpolated, because
        neighbouring pitches have nearly the same.

        Args:
            name: the effect, a sine of the position that is added, or that scales the friction.
            shapes: all its shapes.
            norms: norm after the projection of every ``NORM_STEP``-th of them.
        """
        waves = 1.0 / np.array([shape.bases[0][PITCH] for shape in shapes])
        sums = np.zeros(len(shapes), dtype=np.complex128)
        parts = zip(self.data.noise, self.data.weights, self._thin, self._left_of_recordings(), strict=True)
        for noise, weights, thin, left in parts:
            force = noise.adjoint(left, weights)
            if effect(name).place is Place.LEVEL_FACTOR:
                force = force * thin["friction"]
            sums += search.sums_over_waves(thin["q"], force, waves)
        places = np.arange(len(shapes))
        norm = np.interp(places, places[::NORM_STEP], norms)
        order = np.argsort(-np.abs(sums) / np.maximum(norm, 1.0e-3 * norm.max()), kind="stable")
        return [shapes[k] for k in order[:MANY_SHAPES]]

    def _left_of_recordings(self) -> list[Floats]:
        """Return the residual without the nominal parameters of each recording."""
        pairs = zip(self.data.noise, self._thin, strict=True)
        counts = [noise.length(len(thin["t"])) for noise, thin in pairs]
        return np.split(self._left, np.cumsum(counts))[:-1]  # behind the last recording: the prior rows

    def _strongest_sine(self) -> Screening:
        """Return the screening of sines in time near the largest line of all spectra; every line counts as a trial.

        Each recording has a phase of its own, hence a sine and a cosine of its own.
        """
        trials, largest, peak = 0, 0.0, (0.0, 1.0)
        parts = zip(self.data.motions, self.data.noise, self._thin, self._left_of_recordings(), strict=True)
        for motion, noise, thin, left in parts:
            grid, duration = noise.frequencies(len(thin["t"])), float(motion.time[-1])
            start = max(1, int(np.searchsorted(grid, MIN_PERIODS / duration)))
            spectrum = spectrum_of(left)[start:]
            power = spectrum.real**2 + spectrum.imag**2
            trials += len(power)
            if len(power) and power.max() > largest:
                largest, peak = float(power.max()), (float(grid[start + int(np.argmax(power))]), duration)
        best: tuple[float, Columns | None] = (0.0, None)
        for offset in (-0.6, -0.3, 0.0, 0.3, 0.6) if largest > 0.0 else ():
            item = self._sines(peak[0] + offset / peak[1])
            if item is not None and (reduction := item.chi2_reduction(self._left)) > best[0]:
                best = (reduction, item)
        reduction, found = best
        return (
            Screening((), trials, 1.0)
            if found is None
            else Screening(((reduction, found),), trials, found.independent_share)
        )

    def _sines(self, frequency: float) -> Columns | None:
        """Return a sine and a cosine in time for each recording, as columns of one shape."""
        size, count = search.TRIAL_SHARE * self.model.friction.coulomb_force, len(self.data.motions)
        pair = search.sine_and_cosine(PERIODIC_DISTURBANCE, size, frequency)
        sides = [self._thin_parts(effect(PERIODIC_DISTURBANCE), item.values) for item in pair.columns()]

        def combine(c: Floats) -> tuple[float, ...]:
            return (size * float(np.linalg.norm(c)) / np.sqrt(count), *pair.combine(c[:2])[1:])

        raw = linalg.block_diag(*(np.column_stack(parts) for parts in zip(*sides, strict=True)))
        return self._orthonormal(search.Shape(PERIODIC_DISTURBANCE, pair.bases * count, combine), raw)

    def starts(self, name: str, has_trial: bool = False) -> list[EffectSettings]:
        """Return the starts of a fit: the best shape, and a clearly different one that is nearly as good.

        Args:
            name: the effect.
            has_trial: whether there is a start, at the strength of the columns, where no shape reduces the residual.
        """
        listed = self.screenings[name].best
        if not listed:
            return [shape.columns()[0] for shape in self._shapes(name)[:1]] if has_trial else []
        largest, first = listed[0]
        found = [first.start(self._left)]
        for reduction, item in listed[1:]:
            if (
                reduction > SECOND_START_SHARE.get(name, 0.8) * largest
                and abs(float(first.basis[:, 0] @ item.basis[:, 0])) < 0.8
            ):
                return [*found, item.start(self._left)]
        return found

    def _orthonormal(self, shape: search.Shape, raw: Floats) -> Columns | None:
        """Return the orthonormal columns of a shape, or None if the parameters of the model absorb all of them.

        A column that they absorb is left out: beside an offset a spring has a stiffness, but no rest position.
        """
        norm = float(np.linalg.norm(raw))
        if not np.isfinite(norm) or norm < 1.0e-9:
            return None
        left = self.without_nominal(raw)
        independent_share = float(np.linalg.norm(left)) / norm
        q, r = np.linalg.qr(left)
        is_independent = np.abs(np.diag(r)) >= 1.0e-6 * norm
        if not is_independent.any():
            return None
        if not is_independent.all():
            q, r = np.linalg.qr(left[:, is_independent])
        to_coefficients = np.zeros((len(is_independent), len(r)))
        to_coefficients[is_independent] = np.linalg.inv(r)
        return Columns(shape, q, to_coefficients, independent_share, norm)

    def _column(self, name: str, values: tuple[float, ...]) -> Floats:
        """Return the change of the whitened residual by an effect."""
        entry = effect(name)
        if (
            name not in SIMULATED_EFFECTS
            and entry.place in (Place.ADDED_FORCE, Place.LEVEL_FACTOR)
            and is_built_in(name)
        ):
            return self._thin_column(entry, values) if entry.advance is None else self._memory_column(name, values)
        model = self.model.with_effects([EffectSettings(name, values)])
        is_simulated = name in SIMULATED_EFFECTS
        changes = [
            predict(model, motion, None if is_simulated else friction).residual - base
            for motion, friction, base in zip(self.data.motions, self._friction, self._base, strict=True)
        ]
        return self.data.whitened(changes)

    def _memory_column(self, name: str, values: tuple[float, ...]) -> Floats:
        """Return the column of an effect with memory, computed at the rate of residuals."""
        parts = []
        for motion, noise, weights, thin in zip(
            self.data.motions, self.data.noise, self.data.weights, self._thin, strict=True
        ):
            effects = CompiledEffects([EffectSettings(name, values)], noise.period)
            step = np.full(len(thin["q"]), noise.period)
            travel = np.diff(thin["q"], prepend=thin["q"][0])
            sliding_force = stribeck(self.model.friction, thin["q"], noise.period)
            force, factor = effects.evaluate(
                thin["q"], travel / noise.period, thin["a"], thin["t"] - motion.time[0], thin["u"], step, sliding_force,
                effects.initial_state(), thin["v2"], thin["a2"],
            )  # fmt: skip
            if name in PARTS_OF_SLIDING_FORCE:  # the sliding force of the file includes the effect
                factor = factor - share_of_sliding_force(name, values, self.model.friction.coulomb_force, 1.0)
            parts.append(noise.whitened(-(force + thin["friction"] * (factor - 1.0)), weights))
        return np.concatenate(parts)

    def _thin_column(self, entry: Effect, values: tuple[float, ...]) -> Floats:
        """Return the column of an effect without memory, computed at the rate of residuals."""
        return np.concatenate(self._thin_parts(entry, values))

    def _thin_parts(self, entry: Effect, values: tuple[float, ...]) -> list[Floats]:
        """Return the part of that column in each recording."""
        parts = []
        for noise, weights, thin in zip(self.data.noise, self.data.weights, self._thin, strict=True):
            result = output_along(entry, values, thin)
            force = thin["friction"] * (result - 1.0) if entry.place is Place.LEVEL_FACTOR else result
            parts.append(noise.whitened(-force, weights))
        return parts
