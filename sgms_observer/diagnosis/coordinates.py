"""Coordinates along a motion that a residual may depend on: place, speed, time and the contact's history."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.motion import Motion
from sgms_observer.jit import njit

Floats = NDArray[np.float64]

REST_SHARE = 2.0e-3
"""Slower than this share of the fast speed (99.5 %) the stage counts as resting."""
CONTACT = ("velocity", "acceleration", "direction", "distance since reversal", "time since reversal", "dwell")
"""Coordinates of whatever the contact law may be: an effect on them has to predict better than any function of them."""
CONTACT_EFFECTS = (
    "asymmetric_viscous", "nonlinear_viscous", "quadratic_drag", "eddy_current", "stribeck", "load_dependent_friction",
    "dwell_breakaway", "presliding", "backlash", "frictional_lag",
)  # fmt: skip
"""Effects that a contact law other than the file's may look like."""
CONTACT_LAW_EFFECTS = (
    "nonlinear_viscous", "eddy_current", "stribeck", "load_dependent_friction", "presliding", "backlash",
    "frictional_lag",
)  # fmt: skip
"""Those of them that describe nothing but another contact law: where the contact follows another law than the file's,
they fit whatever the file's law leaves."""
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
"""Coordinates of the free-form term that an effect has to match; effects periodic in time have none."""


def is_contact_law_effect(name: str) -> bool:
    """Return whether an effect describes nothing but another contact law.

    Args:
        name: of an effect.
    """
    return name in CONTACT_LAW_EFFECTS


def is_confusable_with_contact(name: str) -> bool:
    """Return whether a contact law other than the file's may look like an effect.

    Args:
        name: of an effect.
    """
    return FREE_FORM.get(name) == CONTACT


@njit
def _history(direction: Floats, position: Floats, period: float, since: Floats, far: Floats, rest: Floats) -> None:
    """Write time and distance since the last reversal and the rest before this motion."""
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
        since[k] = (k - start) * period
        far[k] = abs(position[k] - position[start])
        rest[k] = before


def coordinates_of(motion: Motion, names: Sequence[str]) -> Floats:
    """Return coordinates at the samples of residuals.

    Args:
        motion: the recording.
        names: ``position``, ``direction``, ``velocity``, ``acceleration``, ``time``, ``effort``,
            ``time since reversal``, ``distance since reversal``, ``dwell``.

    Returns:
        Shape (n, len(names)), SI units; the direction is -1, 0 or 1.
    """
    made = motion.cached("coordinates", "all", lambda: _all(motion))
    return np.column_stack([made[name] for name in names])


def _all(motion: Motion) -> dict[str, Floats]:
    """Return every coordinate at the samples of residuals."""
    speed = np.abs(motion.velocity)
    direction = np.where(speed > REST_SHARE * float(np.quantile(speed, 0.995)), np.sign(motion.velocity), 0.0)
    since, far, rest = (np.zeros(len(direction)) for _ in range(3))
    _history(direction, motion.position, motion.period, since, far, rest)
    listed = {
        "position": motion.position,
        "direction": direction,
        "velocity": motion.velocity,
        "acceleration": motion.acceleration,
        "time": motion.time,
        "effort": motion.effort,
        "time since reversal": since,
        "distance since reversal": far,
        "dwell": rest,
    }
    return {name: motion.thinned(values) for name, values in listed.items()}
