"""Derivatives of a prediction with respect to the parameters of the contact, all in one pass along the motion.

They are exact and replace one simulation for each parameter.
"""

from __future__ import annotations

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.contact import UNSMOOTHED_SETTLING_TIME
from sgms_observer.diagnosis.model import (
    COULOMB,
    NEED_SLIDING_FORCE,
    PERIODIC_DISTURBANCE,
    SCALAR_PARAMETERS,
    STATIC,
    STRIBECK_VELOCITY,
    Model,
    factor_on_sliding_force,
    needed_command,
    parts_of,
    phase_slopes,
    predict,
    shown,
    step_speed,
)
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.effects.catalogue import effect, is_built_in
from sgms_observer.effects.effect import Place
from sgms_observer.identification.problem import SHARED, ElementShape, friction_and_slopes_along

PATH_STEP = 1.0e-4
"""Step of the numerical derivative along the inverse path of the effort, in units of the parameters."""


def contact_parameters(model: Model) -> list[int]:
    """Return the numbers of the parameters of ``Model.shifted`` whose derivatives ``contact_slopes`` gives.

    The list is empty with an effect of the user, or if a periodic disturbance, whose phase is fitted, passes an effect
    on the path of the effort. Where an effect depends on the sliding force in its own way, it holds only those that do
    not change the sliding force of the file.
    """
    names, n_z = model.parameter_names(), len(model.friction.element_stiffness)
    listed = [item.name for item in model.effects]
    is_bent = PERIODIC_DISTURBANCE in listed and any(effect(name).place is Place.EFFORT_PATH for name in listed)
    if is_bent or not all(is_built_in(name) for name in listed):
        return []
    rate = [len(SCALAR_PARAMETERS)] if model.friction.model == "gms" else []
    of_elements = [*rate, *range(len(names) - 2 * n_z, len(names))]
    if any(item.name in NEED_SLIDING_FORCE for item in model.effects):
        return of_elements
    return [COULOMB, STATIC, STRIBECK_VELOCITY, *of_elements]


def contact_slopes(nominal: Model, logs: Floats, motion: Motion) -> Floats:
    """Return the derivatives of the residual with respect to the logarithms of ``contact_parameters`` [N].

    Args:
        nominal: the given model, with its effects.
        logs: where to differentiate, see ``Model.shifted``.
        motion: the recording.

    Returns:
        Shape (parameters, n).
    """
    model = nominal.shifted(logs)
    friction, parts = model.friction, parts_of(model, motion)
    corrected, is_gms = parts.corrected, friction.model == "gms"
    speed = step_speed(corrected.position, motion.period)
    factor = factor_on_sliding_force(parts, friction, motion)
    coulomb, level = friction.coulomb_force, np.array(friction.element_fraction) * friction.coulomb_force
    rate = friction.attraction_rate / coulomb if is_gms else 1.0 / UNSMOOTHED_SETTLING_TIME
    shared = np.array([friction.static_force / coulomb, friction.stribeck_velocity, rate])
    shape = ElementShape.of(friction, "gms" if is_gms or model.is_unsmoothed else "sgms")
    _, slopes = friction_and_slopes_along(
        corrected.first, corrected.second, speed, motion.period, np.array(friction.element_stiffness), level, shared,
        shape, factor, parts.sides,
    )  # fmt: skip
    by_logs = _by_logs(nominal, logs, model, shared)[:, -len(contact_parameters(nominal)) :]
    columns = (slopes @ by_logs).T  # the columns lie side by side in memory, as the low-pass needs them
    if model.relaxation > 0.0:
        columns += model.relaxation * np.gradient(columns, motion.period, axis=1)
    if not (parts.on_path or motion.is_cut_off):
        return -columns - (phase_slopes(model, motion, columns) if parts.periodic else 0.0)
    if parts.periodic:  # not on a path, see ``contact_parameters``
        columns = columns + phase_slopes(model, motion, columns)
    needed = predict(model, motion).needed

    def command(force: Floats) -> Floats:
        return shown(needed_command(parts.on_path, force, motion), motion)

    moved = [command(needed + PATH_STEP * column) for column in columns]
    return np.asarray((command(needed) - np.array(moved)) / PATH_STEP)


def _by_logs(nominal: Model, logs: Floats, model: Model, shared: Floats) -> Floats:
    """Return the derivatives of (kappa.., a.., rho, v_s, c) of the elements with respect to the logarithms.

    Args:
        nominal, logs, model: as in ``contact_slopes``.
        shared: rho, v_s and c.
    """
    friction, is_gms = model.friction, model.friction.model == "gms"
    kappa, share = np.array(friction.element_stiffness), np.array(friction.element_fraction)
    level, n_z = share * friction.coulomb_force, len(kappa)
    width = 2 * n_z + SHARED
    rho, v_s, rate = range(2 * n_z, width)
    of_level = slice(n_z, 2 * n_z)
    is_static_free = nominal.friction.static_force * np.exp(logs[STATIC]) >= friction.coulomb_force
    by_coulomb, by_static, by_velocity, by_rate = np.zeros((4, width))
    by_coulomb[of_level] = level
    by_coulomb[rate] = -shared[2] if is_gms else 0.0
    if is_static_free:
        by_coulomb[rho] = -shared[0]
        by_static[rho] = shared[0]
    by_velocity[v_s], by_rate[rate] = shared[1], shared[2]
    by_stiffness, by_share = np.zeros((2, n_z, width))
    by_stiffness[:, :n_z] = np.diag(kappa)
    by_share[:, of_level] = np.diag(level) - np.outer(share, level)  # the shares are normalised to sum 1
    scalars = [by_coulomb, by_static, by_velocity, *([by_rate] if is_gms else [])]
    return np.vstack([*scalars, by_stiffness, by_share]).T
