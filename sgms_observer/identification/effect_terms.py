"""Effects of the parameter file as terms of the force balance: which of their parameters are fitted, and their force.

Added forces, level factors and effects of the plant are fitted. Effects of the effort's path and of the measured
position keep their values: they change the measurement, so a fit could reduce the residual by reducing the measurement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.effects import kernels
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.compiled import SCRATCH, CompiledEffects
from sgms_observer.effects.effect import EffectParameter, Place
from sgms_observer.settings.axis import AxisSettings, EffectSettings

OFFSET_EFFECT = "offset"
GRAVITY = "gravity"
SPRING = "spring"
_TRANSFORMING = (Place.EFFORT_PATH, Place.MEASURED_POSITION)
_PHASES = ("phase", "second_phase", "angle")
_FIXED = {"gravity.ratio": "it is the gear ratio, which is known", "mass_error.mass": "mass is fitted in its place"}
"""Parameters that are never fitted, and why."""
_FIXED_IF_ADDED = {"spring.rest_position": "it is the middle of the stroke, where the offset is the force"}
"""Parameters that are not fitted where the parameter file does not have the effect, and why."""
_SHARE_STEP = 0.1  # scale of a strength without unit
_SHAPE_STEP = 0.3  # scale of a shape over its value


@dataclass(frozen=True)
class EffectVector:
    """Values of the effects' parameters in one search.

    Attributes:
        values: SI units, in the order of ``EffectTerms.names``, shape (m,).
        scale: size of a typical change of each, shape (m,).
        low, high: bounds, shape (m,).
        free: numbers of those that are fitted.
    """

    values: Floats = field(default_factory=lambda: np.empty(0))
    scale: Floats = field(default_factory=lambda: np.empty(0))
    low: Floats = field(default_factory=lambda: np.empty(0))
    high: Floats = field(default_factory=lambda: np.empty(0))
    free: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.values)

    def with_values(self, values: Floats) -> EffectVector:
        """Return the same with other values."""
        return replace(self, values=np.asarray(values, dtype=np.float64))


@dataclass(frozen=True)
class EffectTerms:
    """The effects of one axis in the identification.

    Attributes:
        fitted: effects whose force enters the balance; the offset is a parameter of its own.
        transforming: effects of the effort's path and of the measured position, which keep their values.
        added: names of effects that are not in the parameter file.
        unit: of the position, for sentences.
    """

    fitted: tuple[EffectSettings, ...] = ()
    transforming: tuple[EffectSettings, ...] = ()
    added: tuple[str, ...] = ()
    unit: str = "m"

    @property
    def parameters(self) -> tuple[EffectParameter, ...]:
        """Return the catalogue's entry of each parameter."""
        return tuple(entry for item in self.fitted for entry in effect(item.name).parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Return ``effect.parameter`` of each parameter."""
        return tuple(f"{item.name}.{entry.name}" for item in self.fitted for entry in effect(item.name).parameters)

    @property
    def start(self) -> EffectVector:
        """Return the values of the parameter file; all parameters free that can be fitted at all."""
        values = [value for item in self.fitted for value in item.values or effect(item.name).defaults]
        free = tuple(number for number, name in enumerate(self.names) if not self.reason_fixed(name))
        low, high = (np.array([getattr(entry, key) for entry in self.parameters]) for key in ("minimum", "maximum"))
        return EffectVector(np.array(values, dtype=np.float64), np.ones(len(values)), low, high, free)

    def reason_fixed(self, name: str) -> str:
        """Return why ``effect.parameter`` is not fitted; empty if it is."""
        is_added = name.split(".")[0] in self.added
        return _FIXED.get(name, _FIXED_IF_ADDED.get(name, "") if is_added else "")

    def strength_of(self, name: str) -> int:
        """Return the number of the first strength of an effect."""
        strengths = (f"{name}.{entry.name}" for entry in effect(name).parameters if entry.is_strength)
        return self.names.index(next(strengths))

    def with_added(self, item: EffectSettings) -> EffectTerms:
        """Return the terms with an effect that is not in the parameter file."""
        return replace(self, fitted=(*self.fitted, item), added=(*self.added, item.name))

    def without(self, name: str) -> EffectTerms:
        """Return the terms without one effect."""
        keep = tuple(item for item in self.fitted if item.name != name)
        return replace(self, fitted=keep, added=tuple(other for other in self.added if other != name))

    def phase_of(self, number: int) -> int | None:
        """Return the number of the phase that belongs to a strength, or None: ``A sin(.. + phase)``."""
        names = self.names
        owner, parameter_name = names[number].split(".")
        wanted = "second_phase" if parameter_name == "second_amplitude" else None
        for other, name in enumerate(names):
            effect_name, parameter = name.split(".")
            is_phase = parameter == wanted if wanted else parameter in _PHASES and parameter != "second_phase"
            if effect_name == owner and parameter_name.endswith("amplitude") and is_phase:
                return other
        return None


def effect_terms(axis: AxisSettings) -> EffectTerms:
    """Return the terms of an axis; a revolute joint gets gravity whether or not its file has it."""
    others = [item for item in axis.effects if item.name != OFFSET_EFFECT]
    fitted = tuple(item for item in others if effect(item.name).place not in _TRANSFORMING)
    transforming = tuple(item for item in others if effect(item.name).place in _TRANSFORMING)
    terms = EffectTerms(fitted, transforming, (), axis.units.position)
    if axis.units.is_revolute and all(item.name != GRAVITY for item in others):
        return terms.with_added(EffectSettings(GRAVITY, effect(GRAVITY).defaults))
    return terms


@dataclass(frozen=True)
class EffectForce:
    """The force of the fitted effects along one recording; the motion is differentiated when an effect first needs it.

    Attributes:
        compiled: the effects, with a state that fits the period.
        period: time between two samples [s].
        position: filtered position, shape (n,).
        effort: effort [N], shape (n,).
        other: position of the other axis, shape (n,), or None.
        first: time of the first sample since the recording began [s].
    """

    compiled: CompiledEffects
    period: float
    position: Floats
    effort: Floats
    other: Floats | None
    first: float

    @cached_property
    def velocity(self) -> Floats:
        """Velocity, shape (n,)."""
        return np.asarray(np.gradient(self.position, self.period))

    @cached_property
    def acceleration(self) -> Floats:
        """Acceleration, shape (n,)."""
        return np.asarray(np.gradient(self.velocity, self.period))

    @cached_property
    def seconds(self) -> Floats:
        """Time since the recording's first sample [s], shape (n,)."""
        return np.asarray(self.first + self.period * np.arange(len(self.position)))

    @cached_property
    def other_motion(self) -> tuple[Floats, Floats]:
        """Velocity and acceleration of the other axis, zero without one, shapes (n,)."""
        if self.other is None:
            nothing = np.zeros(len(self.position))
            return nothing, nothing
        velocity: Floats = np.gradient(self.other, self.period)
        return velocity, np.asarray(np.gradient(velocity, self.period))

    def at(self, values: Floats, level: Floats) -> tuple[Floats, Floats]:
        """Return force [N] and factor on the Stribeck level [-].

        Args:
            values: of the effects' parameters, shape (m,).
            level: Stribeck level [N], shape (n,).
        """
        effects = self.compiled
        force, factor = np.zeros(len(self.position)), np.ones(len(self.position))
        periods = np.full(len(self.position), self.period)
        if effects.has_force_or_level:
            kernels.effects_block(
                effects.kinds, effects.p_at, effects.s_at, values, effects.initial_state(), effects.user,
                self.position, self.velocity, self.acceleration, self.seconds, self.effort, periods, level,
                *self.other_motion, np.zeros(SCRATCH), force, factor,
            )  # fmt: skip
        for name, start in zip(effects.names, effects.p_at, strict=False):
            if name in ("mass_error", "flexible_mode"):
                force = force + (values[start] if name == "mass_error" else -values[start]) * self.acceleration
        return force, factor

    def scales(self, vector: EffectVector, names: Sequence[str], level: Floats, effort_rms: float) -> Floats:
        """Return the size of a typical change of each parameter.

        Args:
            vector: start values.
            names: ``effect.parameter`` of each.
            level: Stribeck level [N], shape (n,).
            effort_rms: rms of the effort [N].
        """
        base, _factor = self.at(vector.values, level)
        out = np.ones(len(vector))
        for number, name in enumerate(names):
            owner, parameter_name = name.split(".")
            entry = effect(owner).parameter(parameter_name)
            if entry.is_strength:
                more = vector.values.copy()
                more[number] += 1.0e-3 * (1.0 if entry.unit == "-" else entry.maximum)
                change = float(np.sqrt(np.mean((self.at(more, level)[0] - base) ** 2)))
                per_unit = change / (more[number] - vector.values[number])
                out[number] = effort_rms / per_unit if per_unit > 0.0 and entry.unit != "-" else _SHARE_STEP
            elif entry.unit != "rad":
                out[number] = _SHAPE_STEP * (abs(vector.values[number]) or 0.1 * entry.maximum)
        return out
