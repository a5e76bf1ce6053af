"""What an observer learnt, as changes to its parameter file."""

from __future__ import annotations

from typing import Any

from sgms_observer.settings.axis import AxisSettings

_OF_FRICTION = ("viscous_coefficient", "coulomb_force", "static_force", "stribeck_velocity")


def learnt_changes(axis: AxisSettings, values: dict[str, float], added_mass: float = 0.0) -> dict[str, Any]:
    """Return the settings that estimated parameters stand for.

    Args:
        axis: the settings that the observer started from.
        values: estimated parameter to its value: SI units, kappa as a share of the nominal stiffness.
        added_mass: mass that effects add to the axis's own [kg]; an estimated mass contains it.

    Returns:
        Setting's name inside the axis (``friction.static_force``) to its new value.
    """
    changes: dict[str, Any] = {}
    for name, value in values.items():
        if name == "kappa":
            changes["friction.element_stiffness"] = [value * kappa for kappa in axis.friction.element_stiffness]
        elif name in _OF_FRICTION:
            changes[f"friction.{name}"] = value
        elif name == "mass":
            changes["mass"] = value - added_mass
        elif name == "offset":
            changes |= _offset(axis, value)
    return changes


def _offset(axis: AxisSettings, value: float) -> dict[str, Any]:
    """Return the effect ``offset`` with the estimated force [N] on top of the one it has."""
    names = [effect.name for effect in axis.effects]
    known = next((effect.values[0] for effect in axis.effects if effect.name == "offset"), 0.0)
    changes: dict[str, Any] = {"effects.offset.force": known + value}
    if "offset" not in names:
        changes["effects.names"] = [*names, "offset"]
    return changes
