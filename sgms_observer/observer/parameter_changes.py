"""Estimated parameters of an observer as changes of its parameter file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.declaration import declared_sections, declared_settings

_OF_FRICTION = ("viscous_coefficient", "coulomb_force", "static_force", "stribeck_velocity")


def parameter_changes(axis: AxisSettings, values: dict[str, float], added_mass: float = 0.0) -> dict[str, Any]:
    """Return the settings that follow from estimated parameters.

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


def parameter_remarks(axis: AxisSettings, changes: Mapping[str, Any], writer: str) -> dict[str, str]:
    """Return the remark for each changed setting: its unit, and the node that estimated it.

    Args:
        axis: the settings that the observer started from.
        changes: result of ``parameter_changes``.
        writer: name of the node.
    """
    remarks = {}
    for name in changes:
        unit = _unit(name)
        remarks[name] = f"{axis.units.of(unit)}; learnt by {writer}" if unit != "-" else f"learnt by {writer}"
    return remarks


def _unit(name: str) -> str:
    """Return the unit of a setting of an axis that slides, or ``-``."""
    *groups, key = name.split(".")
    if groups[:1] == ["effects"]:
        parameters = effect(groups[1]).parameters if len(groups) > 1 else ()
        return next((parameter.unit for parameter in parameters if parameter.name == key), "-")
    kind: type = AxisSettings
    for group in groups:
        kind = declared_sections(kind)[group][0]
    return declared_settings(kind)[key].unit


def _offset(axis: AxisSettings, value: float) -> dict[str, Any]:
    """Return the effect ``offset`` with the estimated force [N] on top of the one it has."""
    names = [effect.name for effect in axis.effects]
    known = next((effect.values[0] for effect in axis.effects if effect.name == "offset"), 0.0)
    changes: dict[str, Any] = {"effects.offset.force": known + value}
    if "offset" not in names:
        changes["effects.names"] = [*names, "offset"]
    return changes
