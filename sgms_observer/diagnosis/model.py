"""The model under test: nominal parameters and effects, simulated along a measured motion.

The prediction is always the measured effort: the command that the motion needs. An effect on the path of the effort is
inverted to predict the command, so that no effect can close the gap by reducing the measured effort.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.diagnosis.contact import element_friction
from sgms_observer.diagnosis.motion import PLAY_HALF_WIDTH, Motion, second_difference
from sgms_observer.effects.catalogue import effect, is_built_in
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.effect import Place
from sgms_observer.effects.kernels import MINIMUM_LEVEL_FACTOR
from sgms_observer.effects.memoryless import is_same_over_arrays, output_along
from sgms_observer.formulas import vectorised
from sgms_observer.settings.axis import AxisSettings, EffectSettings, FrictionSettings

stribeck_level = vectorised("friction").stribeck_level
asymmetric_coulomb = vectorised("effects").asymmetric_coulomb
periodic_disturbance = vectorised("effects").periodic_disturbance
ASYMMETRIC_COULOMB = "asymmetric_coulomb"
"""The effect with a separate sliding force for each direction, which is chosen by the displacement within a step."""
NEED_SLIDING_FORCE = ("frictional_lag", "backlash")
"""Effects that depend on the sliding force."""
HALF_A_REVERSAL = 1.0
"""Change of the friction in half a reversal of the contact, over the static force."""
PERIODIC_DISTURBANCE = "periodic_disturbance"
"""The effect whose phase differs between recordings: a pump or the mains runs independently of them."""
PHASE = 2
"""Index of its phase."""

DAMPING = "element_damping"
"""Name of the parameter that scales the damping of all elements."""
LOG_SPACED_COUNT = 8
"""Number of elements of an unknown contact: two per decade over four decades."""

MASS, VISCOUS, COULOMB, STATIC, STRIBECK_VELOCITY = range(5)
SCALAR_PARAMETERS = ("mass", "viscous_coefficient", "coulomb_force", "static_force", "stribeck_velocity")


@dataclass(frozen=True)
class Model:
    """Model of an axis along a recording.

    Attributes:
        mass: moving mass [kg].
        friction: friction settings.
        effects: effects of the model.
        is_unsmoothed: whether S-GMS elements are computed as unsmoothed Maxwell-slip elements: GMS elements with a
            fast attraction.
        relaxation: damping over stiffness, the same for all elements [s]; 0 for no damping.
        file_slip_deflection: largest slip deflection of the elements of the file [m]; None if the model has them.
        joint_period: period in position that the joint implies (2 pi on a revolute one), or None.
    """

    mass: float
    friction: FrictionSettings
    effects: tuple[EffectSettings, ...] = ()
    is_unsmoothed: bool = False
    relaxation: float = 0.0
    joint_period: float | None = None
    file_slip_deflection: float | None = None

    @staticmethod
    def of(axis: AxisSettings) -> Model:
        """Return the model of an axis."""
        period = 2.0 * np.pi if axis.joint_type == "revolute" else None
        friction = axis.friction
        relaxation = sum(friction.element_damping) / sum(friction.element_stiffness)
        return Model(axis.mass, friction, axis.effects, relaxation=relaxation, joint_period=period)

    def parameter_names(self) -> tuple[str, ...]:
        """Return the names of the nominal parameters in the order of ``shifted``."""
        n_z = len(self.friction.element_stiffness)
        names = list(SCALAR_PARAMETERS)
        if self.friction.model == "gms":
            names.append("attraction_rate")
        if self.relaxation > 0.0:
            names.append(DAMPING)
        names += [f"element_stiffness[{i + 1}]" for i in range(n_z)]
        names += [f"element_fraction[{i + 1}]" for i in range(n_z)]
        return tuple(names)

    def shifted(self, logs: Floats) -> Model:
        """Return the model with each nominal parameter times ``exp(logs)``; the shares are normalised to sum 1."""
        old, scale = self.friction, np.exp(logs)
        names = self.parameter_names()
        n_z = len(old.element_stiffness)
        fraction = np.array(old.element_fraction) * scale[-n_z:]
        coulomb = old.coulomb_force * scale[COULOMB]
        rate = scale[names.index("attraction_rate")] if old.model == "gms" else 1.0
        friction = replace(
            old,
            viscous_coefficient=float(old.viscous_coefficient * scale[VISCOUS]),
            coulomb_force=float(coulomb),
            static_force=float(max(old.static_force * scale[STATIC], coulomb)),
            stribeck_velocity=float(old.stribeck_velocity * scale[STRIBECK_VELOCITY]),
            attraction_rate=float(old.attraction_rate * rate),
            element_stiffness=tuple((np.array(old.element_stiffness) * scale[-2 * n_z : -n_z]).tolist()),
            element_fraction=tuple((fraction / fraction.sum()).tolist()),
        )
        relaxation = self.relaxation * (float(scale[names.index(DAMPING)]) if DAMPING in names else 1.0)
        return replace(self, mass=float(self.mass * scale[MASS]), friction=friction, relaxation=relaxation)

    def with_split_elements(self) -> Model:
        """Return the model with each element split in two, one with a smaller and one with a larger slip deflection.

        The pair has the stiffness and the force of the element. More elements approximate a continuous contact better.
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

    def with_log_spaced_elements(self, smallest: float, largest: float) -> Model:
        """Return the model with elements whose slip deflections are spaced logarithmically over a range.

        They represent a contact with unknown elements. Each starts with the same share.

        Args:
            smallest, largest: slip deflections of the first and of the last element [m].
        """
        deflection = np.geomspace(smallest, largest, LOG_SPACED_COUNT)
        share = 1.0 / LOG_SPACED_COUNT
        friction = replace(
            self.friction,
            element_stiffness=tuple((share * self.friction.coulomb_force / deflection).tolist()),
            element_fraction=(share,) * LOG_SPACED_COUNT,
            element_damping=(0.0,) * LOG_SPACED_COUNT,
        )
        return replace(self, friction=friction, file_slip_deflection=self.slip_deflection)

    @property
    def slip_deflection(self) -> float:
        """Return the largest slip deflection of the elements of the file [m]."""
        return (
            largest_slip_deflection(self.friction) if self.file_slip_deflection is None else self.file_slip_deflection
        )

    def with_effects(self, effects: Sequence[EffectSettings]) -> Model:
        """Return the model with ``effects`` added to its own."""
        return replace(self, effects=(*self.effects, *effects))


@dataclass(frozen=True)
class Prediction:
    """Prediction of a model along a motion, at the working rate.

    Attributes:
        residual: measured minus modelled effort [N].
        friction: simulated element friction [N].
        sticking: 0 where the contact slides, 1 where it sticks; empty if the contact was not simulated.
        needed: force that the motion needs [N].
        phases: phase of each periodic disturbance in this recording [rad].
        is_shown: whether the log shows the command, which is not beyond its limits.
    """

    residual: Floats
    friction: Floats
    sticking: Floats
    needed: Floats
    phases: tuple[float, ...]
    is_shown: Booleans


@dataclass(frozen=True)
class CorrectedMotion:
    """A motion corrected by the effects outside the contact: true position, added force and added mass."""

    position: Floats
    velocity: Floats
    acceleration: Floats
    first: Floats
    second: Floats
    force: Floats
    added_mass: float
    has_position: bool


@dataclass(frozen=True)
class Parts:
    """A model along a motion, by where its effects act.

    Attributes:
        on_sliding_force: effects on the sliding force.
        on_path: effects on the path of the effort.
        periodic: forces that are periodic in time.
        corrected: the motion, corrected by the other effects.
        sides: factors on the sliding force for forward and backward motion.
    """

    on_sliding_force: tuple[EffectSettings, ...]
    on_path: tuple[EffectSettings, ...]
    periodic: tuple[EffectSettings, ...]
    corrected: CorrectedMotion
    sides: tuple[float, float]


def parts_of(model: Model, motion: Motion) -> Parts:
    """Return the parts of a model along a motion.

    Args:
        model: the model.
        motion: the recording.
    """
    on_sliding_force = tuple(item for item in model.effects if effect(item.name).place is Place.LEVEL_FACTOR)
    on_path = tuple(item for item in model.effects if effect(item.name).place is Place.EFFORT_PATH)
    periodic = tuple(item for item in model.effects if item.name == PERIODIC_DISTURBANCE)
    others = tuple(item for item in model.effects if item not in on_sliding_force + on_path + periodic)
    sides = (1.0, 1.0)
    for item in on_sliding_force:
        if item.name == ASYMMETRIC_COULOMB:
            forward, backward = (float(asymmetric_coulomb(side, item.values)) for side in (1.0, -1.0))
            sides = (sides[0] * forward, sides[1] * backward)
    return Parts(on_sliding_force, on_path, periodic, _corrected_motion(others, model.friction, motion), sides)


def predict(model: Model, motion: Motion, fixed_friction: Floats | None = None) -> Prediction:
    """Return the prediction of a model along a motion.

    A periodic disturbance has the phase that fits this motion best, whatever its settings say.

    Args:
        model: the model.
        motion: the recording.
        fixed_friction: element friction of the model without effects on the sliding force. If given, these effects
            scale it and the contact is not simulated again (for the screening of many effects).
    """
    friction, parts = model.friction, parts_of(model, motion)
    on_sliding_force, on_path, corrected, sides = parts.on_sliding_force, parts.on_path, parts.corrected, parts.sides
    if fixed_friction is None:

        def simulated() -> tuple[Floats, Floats]:
            sliding_force = stribeck(friction, corrected.position, motion.period)
            factor = factor_on_sliding_force(parts, friction, motion)
            return element_friction(
                friction,
                corrected.first,
                corrected.second,
                motion.period,
                sliding_force * factor,
                sides,
                model.is_unsmoothed,
            )

        key = (replace(friction, viscous_coefficient=0.0), on_sliding_force, model.is_unsmoothed)
        is_cacheable = not corrected.has_position and all(is_built_in(item.name) for item in on_sliding_force)
        elements, stiffness = motion.cached("contact", key, simulated) if is_cacheable else simulated()
        sticking = stiffness / sum(friction.element_stiffness)
    else:
        elements = (
            fixed_friction
            * factor_on_sliding_force(parts, friction, motion)
            * np.where(corrected.velocity > 0.0, *sides)
        )
        sticking = np.zeros(0)
    if model.relaxation > 0.0:  # sum of sigma_i dz_i/dt with sigma_i over kappa_i the same for all
        elements = elements + model.relaxation * np.gradient(elements, motion.period)
    mass = model.mass + corrected.added_mass
    needed = (
        mass * corrected.acceleration + friction.viscous_coefficient * corrected.velocity + elements + corrected.force
    )
    command, phases = needed_command(on_path, needed, motion), []
    for item in parts.periodic:
        phases.append(_phase_in(item, on_path, needed, command, motion))
        needed = needed + _periodic_force(item, phases[-1], motion)
        command = needed_command(on_path, needed, motion)
    reading = shown(command, motion)
    return Prediction(motion.effort - reading, elements, sticking, needed, tuple(phases), reading == command)


def shown(command: Floats, motion: Motion) -> Floats:
    """Return what the log shows of a command: no more than its limits [N]."""
    return np.clip(command, *motion.effort_limits) if motion.is_cut_off else command


def with_phases_of(model: Model, motion: Motion) -> Model:
    """Return the model whose periodic disturbances have their phases in one recording.

    Args:
        model: the model.
        motion: the recording.
    """
    if not any(item.name == PERIODIC_DISTURBANCE for item in model.effects):
        return model
    phases = iter(predict(model, motion).phases)
    return replace(
        model,
        effects=tuple(
            EffectSettings(item.name, (*item.values[:PHASE], next(phases)))
            if item.name == PERIODIC_DISTURBANCE
            else item
            for item in model.effects
        ),
    )


def _phase_in(
    item: EffectSettings, on_path: Sequence[EffectSettings], needed: Floats, command: Floats, motion: Motion
) -> float:
    """Return the phase with which a periodic disturbance predicts the effort of a recording best [rad].

    Args:
        item: the disturbance.
        on_path: effects on the path of the effort.
        needed: force that the motion needs without it [N], shape (n,).
        command: the command for that force [N], shape (n,).
        motion: the recording.
    """
    if item.values[0] == 0.0:
        return item.values[PHASE]
    sides = np.array([
        needed_command(on_path, needed + _periodic_force(item, phase, motion), motion) - command
        for phase in (0.0, 0.5 * np.pi)
    ])  # fmt: skip
    (sine, cosine), *_ = np.linalg.lstsq(sides @ sides.T, sides @ (motion.effort - command), rcond=None)
    return float(np.arctan2(cosine, sine))


def phase_slopes(model: Model, motion: Motion, columns: Floats) -> Floats:
    """Return the derivatives of the force of the periodic disturbances with respect to parameters of the other forces.

    Its phase fits the recording best, so it follows what the other forces leave: the derivative of the least-squares
    solution of ``_phase_in``. No effect on the path of the effort may be in the model.

    Args:
        model: the model.
        motion: the recording.
        columns: derivatives of the other forces, shape (parameters, n).

    Returns:
        Shape (parameters, n).
    """
    found, slopes = predict(model, motion), np.zeros_like(columns)
    periodic = (item for item in model.effects if item.name == PERIODIC_DISTURBANCE)
    for item, phase in zip(periodic, found.phases, strict=True):
        if item.values[0] == 0.0:
            continue
        sides = np.array([_periodic_force(item, one, motion) for one in (0.0, 0.5 * np.pi)])
        left = found.residual + _periodic_force(item, phase, motion)
        sine, cosine = np.linalg.solve(sides @ sides.T, sides @ left)
        by_sine, by_cosine = np.linalg.solve(sides @ sides.T, -sides @ columns.T)
        turn = (sine * by_cosine - cosine * by_sine) / (sine**2 + cosine**2)
        slopes += turn[:, None] * _periodic_force(item, phase + 0.5 * np.pi, motion)
    return slopes


def _periodic_force(item: EffectSettings, phase: float, motion: Motion) -> Floats:
    """Return the force of a periodic disturbance with a phase along a recording [N]."""
    return np.asarray(periodic_disturbance(motion.time, (*item.values[:PHASE], phase)), dtype=np.float64)


def needed_command(on_path: Sequence[EffectSettings], needed: Floats, motion: Motion) -> Floats:
    """Return the command that makes the needed force arrive: the inverse of the effort's path [N].

    Inside a dead zone the command is not determined; the centre of the dead zone is predicted. Beyond a saturation
    limit the command is not determined either; there the part of the recorded command beyond the limit is predicted.

    Args:
        on_path: effects on the path of the effort, in the order in which the effort passes them.
        needed: force that the motion needs [N], shape (n,).
        motion: the recording.
    """
    limits = [item.values[0] for item in on_path if item.name == "actuator_saturation"]
    others = tuple(item for item in on_path if item.name != "actuator_saturation")
    command = CompiledEffects(others, motion.period).needed_command(needed)
    for limit in limits:
        command = command + motion.effort - np.clip(motion.effort, -limit, limit)
    return np.asarray(command, dtype=np.float64)


def _corrected_motion(
    others: tuple[EffectSettings, ...], friction: FrictionSettings, motion: Motion
) -> CorrectedMotion:
    """Return the motion corrected by the effects outside the contact; cached, because many fits need the same one."""
    level_values = friction.static_force, friction.coulomb_force, friction.stribeck_velocity

    def computed() -> CorrectedMotion:
        position, velocity, acceleration = motion.position, motion.velocity, motion.acceleration
        first, second, n = motion.first, motion.second, len(motion.position)
        effects = CompiledEffects(others, motion.period)
        if effects.has_position:
            raw = effects.corrected_position(motion.raw)
            position = motion.smoothed(raw)
            velocity = np.gradient(position, motion.period)
            acceleration = second_difference(position, motion.period)
            first, second = motion.contact_motion(raw)
        moved = compensated_for_hold(acceleration) if effects.added_mass != 0.0 else acceleration
        force = np.zeros(n)

        def force_of(item: EffectSettings) -> Floats:
            return _force_and_factor(item, friction, motion, position, velocity, moved)[0]

        for item in others:
            sliding = level_values if item.name in NEED_SLIDING_FORCE else ()
            if effects.has_position or not is_built_in(item.name):
                force = force + force_of(item)
            else:
                key = (item, sliding, effects.added_mass != 0.0)
                force = force + motion.cached("force", key, partial(force_of, item))
        return CorrectedMotion(
            position, velocity, acceleration, first, second, force, effects.added_mass, effects.has_position
        )

    needs_sliding_force = any(item.name in NEED_SLIDING_FORCE for item in others)
    return (
        motion.cached("corrected motion", (others, level_values if needs_sliding_force else ()), computed)
        if all(is_built_in(item.name) for item in others)
        else computed()
    )


def factor_on_sliding_force(parts: Parts, friction: FrictionSettings, motion: Motion) -> Floats:
    """Return the factor of effects on the sliding force, except the one that depends on the direction."""
    corrected, factor = parts.corrected, np.ones(len(parts.corrected.position))
    level_values = friction.static_force, friction.coulomb_force, friction.stribeck_velocity

    def factor_of(item: EffectSettings) -> Floats:
        return _force_and_factor(
            item, friction, motion, corrected.position, corrected.velocity, corrected.acceleration
        )[1]

    for item in parts.on_sliding_force:
        if item.name == ASYMMETRIC_COULOMB:
            continue
        is_cacheable = not corrected.has_position and is_built_in(item.name)
        key = (item, level_values if item.name in NEED_SLIDING_FORCE else ())
        factor = factor * (motion.cached("factor", key, partial(factor_of, item)) if is_cacheable else factor_of(item))
    return np.maximum(factor, MINIMUM_LEVEL_FACTOR)


def _force_and_factor(
    item: EffectSettings, friction: FrictionSettings, motion: Motion, position: Floats, velocity: Floats,
    acceleration: Floats,
) -> tuple[Floats, Floats]:  # fmt: skip
    """Return the force [N] and the factor on the sliding force [-] of one effect along a motion, shape (n,) each.

    Args:
        item: the effect.
        friction: settings of the contact, for an effect that depends on the sliding force.
        motion: the recording.
        position, velocity, acceleration: its motion, corrected by other effects [m, m/s, m/s^2].
    """
    entry, count = effect(item.name), len(position)
    if is_same_over_arrays(entry):
        found = output_along(entry, item.values or entry.defaults, {
            "q": position, "v": velocity, "a": acceleration, "t": motion.time, "u": motion.effort,
            "v2": motion.other_velocity, "a2": motion.other_acceleration,
        })  # fmt: skip
        is_force = entry.place is Place.ADDED_FORCE
        return (found, np.ones(count)) if is_force else (np.zeros(count), np.maximum(found, MINIMUM_LEVEL_FACTOR))
    effects = CompiledEffects((item,), motion.period)
    return effects.evaluate(
        position, velocity, acceleration, motion.time, motion.effort, np.full(count, motion.period),
        stribeck(friction, position, motion.period), effects.initial_state(), motion.other_velocity,
        motion.other_acceleration,
    )  # fmt: skip


def compensated_for_hold(acceleration: Floats) -> Floats:
    """Return step-wise constant accelerations that drive a flexible mode like the continuous acceleration.

    An acceleration that is constant over a step of length h excites a mode of frequency w by the factor
    1 - (w h)^2 / 24 only. The weights compensate this factor and the interpolation to the middle of the step, up to the
    fourth order of w h.

    Args:
        acceleration: at the samples, shape (n,) [m/s^2].
    """
    first, last = acceleration[:1], acceleration[-1:]
    around = np.concatenate((first, first, acceleration, last))
    near, far = around[2:-1] + around[1:-2], around[3:] + around[:-3]
    return np.asarray((7.0 * near - far) / 12.0, dtype=np.float64)


def step_speed(position: Floats, period: float) -> Floats:
    """Return the mean velocity of the step before each sample [m/s], shape (n,)."""
    return np.concatenate(([0.0], np.diff(position))) / period


def stribeck(friction: FrictionSettings, position: Floats, period: float) -> Floats:
    """Return the sliding force along a motion [N]."""
    speed = step_speed(position, period)
    return np.asarray(stribeck_level(speed, friction.static_force, friction.coulomb_force, friction.stribeck_velocity))


def hidden_friction_drop(friction: FrictionSettings, motion: Motion) -> Floats:
    """Return the largest decrease of friction that the encoder resolution can hide at each sample [N].

    Where the encoder may hide a reversal, the contact may have moved back by up to the width of the play operator.

    Args:
        friction: settings of the contact.
        motion: the recording.
    """
    return np.where(motion.hidden_periods > 0.0, _drop_within_play(friction, motion), 0.0)


def most_hidden_friction_drop(friction: FrictionSettings, motion: Motion) -> Floats:
    """Return the largest decrease of friction that hidden reversals can add up to at each sample [N].

    After a reversal the friction need not rise to its old value again; how much stays lost depends on the contact law.
    A period of the motion's low-pass hides one reversal at most.

    Args:
        friction: settings of the contact.
        motion: the recording.
    """
    return np.minimum(_drop_within_play(friction, motion) * motion.hidden_periods, 2.0 * friction.static_force)


def _drop_within_play(friction: FrictionSettings, motion: Motion) -> Floats:
    """Return the decrease of friction when the contact moves back by the width of the play operator [N]."""
    return friction_drop_after_reversal(friction, 2.0 * PLAY_HALF_WIDTH * motion.resolution)


def unknown_initial_friction(friction: FrictionSettings, motion: Motion) -> Floats:
    """Return the width of the range of friction that the unknown state at the start leaves possible at each sample [N].

    Each element starts anywhere between its two sliding forces. A motion over a range of positions takes from the width
    what a sliding contact loses when it moves back as far. Where the recording starts in motion, elements with
    frictional lag may also be as far from the Stribeck curve as static from Coulomb force: see ``_unknown_lag``. The
    width that the whole recording leaves does not count: it is an offset.

    Args:
        friction: settings of the contact.
        motion: the recording.
    """
    known = friction_drop_after_reversal(friction, _range_so_far(motion.position))
    width = known[-1] - known
    return np.asarray(width + _unknown_lag(friction, motion) if friction.model == "gms" else width)


def _unknown_lag(friction: FrictionSettings, motion: Motion) -> Floats:
    """Return the width of the lagged friction that the unknown state at the start leaves possible at each sample [N].

    It decreases exponentially while the contact slides (eq. 2). Where the stage stops, the elements stick; they slip
    again on the Stribeck curve, so that the motion from there on takes away the rest.

    Args:
        friction: settings of the contact.
        motion: the recording.
    """
    slides_on = motion.is_moving & (np.sign(motion.velocity) == np.sign(motion.velocity[0]))
    stop = len(slides_on) if slides_on.all() else int(np.argmin(slides_on))
    lag = np.exp(-friction.attraction_rate / friction.static_force * motion.period * np.arange(len(slides_on)))
    if stop < len(slides_on):
        since = friction_drop_after_reversal(friction, _range_so_far(motion.position[stop:]))
        lag[stop:] = lag[stop] * (1.0 - since / (2.0 * friction.static_force)) if stop > 0 else 0.0
    return np.asarray((friction.static_force - friction.coulomb_force) * lag)


def _range_so_far(position: Floats) -> Floats:
    """Return the range of positions from the first sample to each sample [m]."""
    return np.asarray(np.maximum.accumulate(position) - np.minimum.accumulate(position))


def friction_drop_after_reversal(friction: FrictionSettings, distance: float | Floats) -> Floats:
    """Return the decrease of friction when a sliding contact moves back (Masing's rule) [N].

    Args:
        friction: settings of the contact.
        distance: distance of the motion back [m].
    """
    listed = zip(friction.element_fraction, friction.element_stiffness, strict=True)
    parts = [np.minimum(kappa * distance, 2.0 * share * friction.static_force) for share, kappa in listed]
    return np.asarray(np.sum(parts, axis=0), dtype=np.float64)


def hidden_by_encoder(friction: FrictionSettings, motions: Sequence[Motion]) -> float:
    """Return the friction that a reversing contact loses within one encoder step, over the static force.

    A whole reversal takes twice the static force: above ``HALF_A_REVERSAL`` the encoder hides more than half of it.

    Args:
        friction: settings of the contact.
        motions: recordings; the largest encoder step counts.
    """
    step = max(motion.resolution for motion in motions)
    return float(friction_drop_after_reversal(friction, step)) / friction.static_force


def largest_slip_deflection(friction: FrictionSettings) -> float:
    """Return the largest slip deflection of the elements [m]."""
    slips = np.array(friction.element_fraction) * friction.static_force / np.array(friction.element_stiffness)
    return float(slips.max())
