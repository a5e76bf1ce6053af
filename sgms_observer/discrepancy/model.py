"""The model under test: nominal parameters and effects, simulated along a measured motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.discrepancy.motion import PLAY, Motion, second_difference, split_at_reversals, without_flicker
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.formulas import vectorised
from sgms_observer.friction.gms import gms_step
from sgms_observer.friction.sgms import sgms_step
from sgms_observer.jit import njit
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sgms_observer.settings.friction import FrictionSettings

Floats = NDArray[np.float64]

stribeck_level = vectorised("friction").stribeck_level

MASS, VISCOUS, COULOMB, STATIC, KNEE = range(5)
CREEP = 20.0
SHARED = ("mass", "viscous_coefficient", "coulomb_force", "static_force", "stribeck_velocity")


@dataclass(frozen=True)
class Model:
    """An axis's model as far as recordings can judge it.

    Attributes:
        mass: moving mass [kg].
        friction: friction settings.
        effects: effects in it.
    """

    mass: float
    friction: FrictionSettings
    effects: tuple[EffectSettings, ...] = ()

    @staticmethod
    def of(axis: AxisSettings) -> Model:
        """Return the model of an axis."""
        return Model(axis.mass, axis.friction, axis.effects)

    def parameter_names(self) -> tuple[str, ...]:
        """Return the names of the nominal parameters in the order of ``shifted``."""
        n_z = len(self.friction.element_stiffness)
        names = list(SHARED)
        if self.friction.model == "gms":
            names.append("attraction_rate")
        names += [f"element_stiffness[{i + 1}]" for i in range(n_z)]
        names += [f"element_fraction[{i + 1}]" for i in range(n_z)]
        return tuple(names)

    def shifted(self, logs: Floats) -> Model:
        """Return the model with each nominal parameter times ``exp(logs)``; shares still sum to 1."""
        old, scale = self.friction, np.exp(logs)
        n_z = len(old.element_stiffness)
        fraction = np.array(old.element_fraction) * scale[-n_z:]
        coulomb = old.coulomb_force * scale[COULOMB]
        friction = replace(
            old,
            viscous_coefficient=float(old.viscous_coefficient * scale[VISCOUS]),
            coulomb_force=float(coulomb),
            static_force=float(max(old.static_force * scale[STATIC], coulomb)),
            stribeck_velocity=float(old.stribeck_velocity * scale[KNEE]),
            attraction_rate=float(old.attraction_rate * (scale[5] if old.model == "gms" else 1.0)),
            element_stiffness=tuple((np.array(old.element_stiffness) * scale[-2 * n_z : -n_z]).tolist()),
            element_fraction=tuple((fraction / fraction.sum()).tolist()),
        )
        return replace(self, mass=float(self.mass * scale[MASS]), friction=friction)

    def refined(self) -> Model:
        """Return the model with each element split in two of the same stiffness together, one slipping early, one late.

        Four elements stand for a continuous contact; twice as many leave less of it in the residual.
        """
        old = self.friction
        early = 0.65
        late = 1.0 / (2.0 - 1.0 / early)
        stiffness, fraction = [], []
        for kappa, share in zip(old.element_stiffness, old.element_fraction, strict=True):
            stiffness += [0.5 * kappa / early, 0.5 * kappa / late]
            fraction += [0.5 * share, 0.5 * share]
        n_z = len(stiffness)
        friction = replace(
            old, element_stiffness=tuple(stiffness), element_fraction=tuple(fraction), element_damping=(0.0,) * n_z
        )
        return replace(self, friction=friction)

    def with_effects(self, effects: Sequence[EffectSettings]) -> Model:
        """Return the model with ``effects`` added to its own."""
        return replace(self, effects=(*self.effects, *effects))


@dataclass(frozen=True)
class Prediction:
    """What a model makes of a motion, at the working rate.

    Attributes:
        residual: effort that arrives minus what the model needs [N].
        friction: simulated element friction [N].
        doubt: 0 where the contact slides, 1 where it sticks or creeps and the encoder's grid decides; empty without a
            new simulation.
    """

    residual: Floats
    friction: Floats
    doubt: Floats


@njit
def _element_friction(
    first: Floats, second: Floats, period: float, kappa: Floats, fraction: Floats, level: Floats, numbers: Floats,
    out: Floats, stiffness: Floats,
) -> None:  # fmt: skip
    """Write the summed element force after each step, and the stiffness of what sticks.

    ``numbers``: is_gms, lambda, zeta, gamma, is_paper, v_s, C.
    """
    n_z = kappa.shape[0]
    force = np.zeros(n_z)
    mode = np.zeros(n_z, dtype=np.int64)
    for k in range(first.shape[0]):
        for part in range(2):
            travel = first[k] if part == 0 else second[k]
            if travel == 0.0:
                continue
            velocity = travel / period
            gain = numbers[3]
            if numbers[4] > 0.5:
                gain *= abs(velocity) / numbers[5]
            for i in range(n_z):
                if numbers[0] > 0.5:
                    force[i], mode[i] = gms_step(
                        force[i], mode[i], velocity, period, kappa[i], fraction[i], level[k], numbers[6]
                    )
                else:
                    force[i] = sgms_step(
                        force[i], velocity, period, kappa[i], fraction[i] * level[k], numbers[1], numbers[2], gain
                    )
        total = 0.0
        stuck = 0.0
        for i in range(n_z):
            total += force[i]
            if abs(force[i]) < 0.95 * fraction[i] * level[k]:
                stuck += kappa[i]
        out[k] = total
        stiffness[k] = stuck


def element_friction(
    friction: FrictionSettings, first: Floats, second: Floats, period: float, level: Floats
) -> tuple[Floats, Floats]:
    """Return the friction of the elements along a motion, without the viscous term [N], and their stiffness [N/m].

    Args:
        friction: the model.
        first, second: displacement of each step before and after a reversal in it [m].
        period: length of a step [s].
        level: sliding level at each sample, effects included [N].
    """
    numbers = np.array(
        [
            float(friction.model == "gms"),
            friction.smoothing_lambda,
            friction.smoothing_zeta,
            friction.smoothing_gamma,
            float(friction.reset == "paper"),
            friction.stribeck_velocity,
            friction.attraction_rate,
        ]
    )
    out, stiffness = np.empty(len(first)), np.empty(len(first))
    _element_friction(
        first,
        second,
        period,
        np.array(friction.element_stiffness),
        np.array(friction.element_fraction),
        level,
        numbers,
        out,
        stiffness,
    )
    return out, stiffness


def predict(model: Model, motion: Motion, fixed_friction: Floats | None = None) -> Prediction:
    """Return the residual of the balance of forces along a motion.

    Args:
        model: what is judged.
        motion: the recording.
        fixed_friction: element friction of the model without level effects; when given, level effects scale it instead
            of being simulated again (for a first look at many effects).
    """
    position, velocity, acceleration = motion.position, motion.velocity, motion.acceleration
    first, second, effort, mass = motion.first, motion.second, motion.effort, model.mass
    friction = model.friction
    n = len(position)
    force, factor = 0.0, np.ones(n)
    effects: CompiledEffects | None = None
    if model.effects:
        effects = CompiledEffects(model.effects, motion.period)
        state = effects.initial_state()
        effort = effects.arrived_effort(effort, state)
        if effects.has_position:
            position = motion.smoothed(effects.corrected_position(motion.raw))
            velocity = np.gradient(position, motion.period)
            acceleration = second_difference(position, motion.period)
            first, second = split_at_reversals(without_flicker(position, PLAY * motion.resolution), motion.period)
        mass += effects.added_mass
    speed = np.concatenate(([0.0], np.diff(position))) / motion.period
    level = stribeck_level(speed, friction.static_force, friction.coulomb_force, friction.stribeck_velocity)
    if effects is not None and effects.has_force_or_level:
        force, factor = effects.evaluate(
            position, velocity, acceleration, motion.time, effort, np.full(n, motion.period), level, state,
            motion.other_velocity, motion.other_acceleration,
        )  # fmt: skip
    doubt = np.zeros(0)
    if fixed_friction is None:
        elements, stiffness = element_friction(friction, first, second, motion.period, level * factor)
        doubt = np.maximum(stiffness / sum(friction.element_stiffness), creep(motion))
    else:
        elements = fixed_friction * factor
    needed = mass * acceleration + friction.viscous_coefficient * velocity + elements + force
    return Prediction(effort - needed, elements, doubt)


def creep(motion: Motion) -> Floats:
    """Return 1 where the stage is slower than ``CREEP`` steps of the encoder's grid per sample, else 0."""
    if motion.resolution <= 0.0:
        return np.zeros(len(motion.time))
    slow = CREEP * motion.resolution / motion.period
    return np.asarray(np.exp(-((motion.velocity / slow) ** 4)))


def largest_reach(friction: FrictionSettings) -> float:
    """Return the deflection at which the last element slips [m]."""
    reaches = np.array(friction.element_fraction) * friction.static_force / np.array(friction.element_stiffness)
    return float(reaches.max())
