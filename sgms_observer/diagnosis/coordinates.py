"""Coordinates that a residual may depend on: position, velocity, time and history of the contact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.effects.catalogue import effect
from sgms_observer.jit import njit

CONTACT = ("velocity", "acceleration", "direction", "distance since reversal", "time since reversal", "dwell")
"""Coordinates of any contact law. An effect on them has to predict better than a regression over them."""


def free_form_coordinates(name: str) -> tuple[str, ...]:
    """Return the coordinates of the free-form regression that an effect has to match; empty for none.

    The direction alone belongs to many effects. Every other coordinate of a contact law brings in all of them, because
    the regression then stands for any contact law.

    Args:
        name: the effect.
    """
    coordinates = effect(name).coordinates
    return CONTACT if set(coordinates) & set(CONTACT) - {"direction"} else coordinates


def is_confusable_with_contact(name: str) -> bool:
    """Return whether another contact law than that of the file can imitate an effect.

    Args:
        name: the effect.
    """
    return free_form_coordinates(name) == CONTACT


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
            ``time since reversal``, ``distance since reversal``, ``dwell``.

    Returns:
        Shape (n, len(names)), SI units; the direction is -1, 0 or 1.
    """
    made = motion.cached("coordinates", "all", lambda: _all(motion))
    return np.column_stack([made[name] for name in names])


def _all(motion: Motion) -> dict[str, Floats]:
    """Return every coordinate at the samples of residuals."""
    direction = np.where(motion.is_moving, np.sign(motion.velocity), 0.0)
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
