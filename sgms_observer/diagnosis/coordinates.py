"""Coordinates that a residual may depend on: position, velocity, time and history of the contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.motion import Motion
from sgms_observer.jit import njit

Floats = NDArray[np.float64]

REST_SHARE = 2.0e-3
"""The stage counts as resting below this share of the 99.5 % quantile of the speed."""
CONTACT = ("velocity", "acceleration", "direction", "distance since reversal", "time since reversal", "dwell")
"""Coordinates of any contact law. An effect on them has to predict better than a regression over them."""
CONTACT_EFFECTS = (
    "asymmetric_viscous", "nonlinear_viscous", "quadratic_drag", "eddy_current", "stribeck", "load_dependent_friction",
    "dwell_breakaway", "presliding", "backlash", "frictional_lag",
)  # fmt: skip
"""Effects that another contact law than that of the file can imitate."""
CONTACT_LAW_EFFECTS = (
    "nonlinear_viscous", "eddy_current", "stribeck", "load_dependent_friction", "presliding", "backlash",
    "frictional_lag",
)  # fmt: skip
"""Effects that only describe another contact law. They fit the residual of any contact that deviates from the file."""
FREE_FORM = {
    "cogging": ("position",),
    "spring": ("position",),
    "gravity": ("position",),
    "position_periodic_friction": ("position", "direction"),
    "position_dependent_friction": ("position", "direction"),
    "asymmetric_coulomb": ("direction",),
    "thermal_drift": ("time", "direction"),
    "wear_step": ("time", "direction"),
    **dict.fromkeys((*CONTACT_EFFECTS, "mass_error", "flexible_mode", "actuator_delay", "actuator_dead_zone"), CONTACT),
}
"""Coordinates of the free-form regression that an effect has to match; effects periodic in time have none."""


def is_contact_law_effect(name: str) -> bool:
    """Return whether an effect only describes another contact law.

    Args:
        name: the effect.
    """
    return name in CONTACT_LAW_EFFECTS


def is_confusable_with_contact(name: str) -> bool:
    """Return whether another contact law than that of the file can imitate an effect.

    Args:
        name: the effect.
    """
    return FREE_FORM.get(name) == CONTACT


@njit
def _history(
    direction: Floats, position: Floats, period: float, time_since: Floats, distance: Floats, rest_before: Floats
) -> None:
    """Write time and distance since the last reversal, and the duration of the rest before the motion."""
    last, start, resting, before = 0.0, 0, 0, 0.0
    for k in range(direction.shape[0]):
        if direction[k] == 0.0:
            resting += 1
        else:
            if resting > 0:
                before = resting * period
                resting = 0
            if direction[k] != last:
                start, last = k, direction[k]
        time_since[k] = (k - start) * period
        distance[k] = abs(position[k] - position[start])
        rest_before[k] = before


def coordinates_of(motion: Motion, names: Sequence[str]) -> Floats:
    """Return coordinates at the samples of residuals.

    Args:
        motion: the recording.
        names: ``position``, ``direction``, ``velocity``, ``acceleration``, ``time``, ``effort``,
            ``time time_since reversal``, ``distance time_since reversal``, ``dwell``.

    Returns:
        Shape (n, len(names)), SI units; the direction is -1, 0 or 1.
    """
    made = motion.cached("coordinates", "all", lambda: _all(motion))
    return np.column_stack([made[name] for name in names])


def _all(motion: Motion) -> dict[str, Floats]:
    """Return every coordinate at the samples of residuals."""
    speed = np.abs(motion.velocity)
    direction = np.where(speed > REST_SHARE * float(np.quantile(speed, 0.995)), np.sign(motion.velocity), 0.0)
    time_since, distance, rest_before = (np.zeros(len(direction)) for _ in range(3))
    _history(direction, motion.position, motion.period, time_since, distance, rest_before)
    listed = {
        "position": motion.position,
        "direction": direction,
        "velocity": motion.velocity,
        "acceleration": motion.acceleration,
        "time": motion.time,
        "effort": motion.effort,
        "time since reversal": time_since,
        "distance since reversal": distance,
        "dwell": rest_before,
    }
    return {name: motion.thinned(values) for name, values in listed.items()}
