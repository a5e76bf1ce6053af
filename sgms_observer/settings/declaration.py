"""Fields of the settings dataclasses with unit, range and meaning: base of check, ROS parameters and reference page."""

from __future__ import annotations

import math
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import Any, get_type_hints

from sgms_observer.settings.units import Units, physical_range


def setting(
    default: Any,
    description: str,
    unit: str = "-",
    *,
    minimum: float | None = None,
    maximum: float | None = None,
    above: float | None = None,
    choices: tuple[str, ...] | None = None,
    is_nonzero: bool = False,
) -> Any:
    """Declare a dataclass field as a user's setting.

    Args:
        default: value without an entry in the YAML; its type is the setting's type (a tuple means a list).
        description: one sentence for people.
        unit: SI unit, or ``-``; that of a prismatic axis.
        minimum: smallest allowed value (each entry of a list).
        maximum: largest allowed value (each entry of a list).
        above: the value must be strictly greater.
        choices: the allowed words.
        is_nonzero: the value must not be zero.

    Returns:
        A ``dataclasses.field`` carrying the declaration in its metadata.
    """
    metadata = {
        "description": description,
        "unit": unit,
        "minimum": minimum,
        "maximum": maximum,
        "above": above,
        "choices": choices,
        "is_nonzero": is_nonzero,
    }
    return field(default=default, metadata=metadata)


def section(kind: type, description: str) -> Any:
    """Declare a dataclass field as a nested group of settings.

    Args:
        kind: the group's dataclass; its defaults are the group's.
        description: one sentence for people.
    """
    return field(default_factory=kind, metadata={"description": description, "section": True})


#: YAML types of a setting, under ROS's names for them.
DOUBLE, INTEGER, BOOL, STRING = "double", "integer", "bool", "string"
DOUBLES, STRINGS = "double_array", "string_array"

_LARGEST_INTEGER = 2**31 - 1

_KINDS: dict[Any, str] = {
    float: DOUBLE,
    int: INTEGER,
    bool: BOOL,
    str: STRING,
    tuple[float, ...]: DOUBLES,
    tuple[str, ...]: STRINGS,
}


_settings: dict[type, dict[str, Declared]] = {}
_sections: dict[type, dict[str, tuple[type, str]]] = {}


@dataclass(frozen=True)
class Declared:
    """One setting as its dataclass declares it.

    Attributes:
        name: key in the YAML.
        kind: one of ``double``, ``integer``, ``bool``, ``string``, ``double_array``, ``string_array``.
        default: value when the YAML is silent.
        description: one sentence for people.
        unit: SI unit, or ``-``; ``of_joint_type`` makes it that of a revolute axis.
        minimum: smallest allowed value; for a number without one, what is physical (``units.physical_range``).
        maximum: largest allowed value; likewise.
        above: bound that the value must strictly exceed, if any.
        choices: the allowed words, if they are listed.
        is_nonzero: whether zero is not allowed.
    """

    name: str
    kind: str
    default: Any
    description: str
    unit: str = "-"
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None
    choices: tuple[str, ...] | None = None
    is_nonzero: bool = False

    def __post_init__(self) -> None:
        """Give every number a finite range."""
        smallest, largest = physical_range(self.unit)
        if self.kind == INTEGER:
            largest = min(largest, _LARGEST_INTEGER)
        elif self.kind not in (DOUBLE, DOUBLES):
            return
        if self.minimum is None or math.isinf(self.minimum):
            lowest = -largest if self.above is None else self.above + smallest
            object.__setattr__(self, "minimum", lowest)
        if self.maximum is None or math.isinf(self.maximum):
            object.__setattr__(self, "maximum", largest)

    def of_joint_type(self, joint_type: str) -> Declared:
        """Return the setting with its unit on an axis of this joint type.

        Args:
            joint_type: ``prismatic`` or ``revolute``.
        """
        unit = Units(joint_type).of(self.unit)
        return self if unit == self.unit else replace(self, unit=unit)

    @property
    def is_list(self) -> bool:
        """Return whether the setting is a list."""
        return self.kind in (DOUBLES, STRINGS)


def declared_settings(kind: type) -> dict[str, Declared]:
    """Return the settings of one group, by name, in the order of their declaration.

    Args:
        kind: a dataclass whose fields were made with ``setting`` and ``section``.
    """
    if kind in _settings:
        return _settings[kind]
    hints = get_type_hints(kind)
    found: dict[str, Declared] = {}
    for entry in fields(kind):
        if "unit" in entry.metadata:
            found[entry.name] = Declared(
                name=entry.name, kind=_KINDS[hints[entry.name]], default=entry.default, **entry.metadata
            )
    _settings[kind] = found
    return found


def declared_sections(kind: type) -> dict[str, tuple[type, str]]:
    """Return the groups inside a group, by name: their dataclass and their description."""
    if kind in _sections:
        return _sections[kind]
    found: dict[str, tuple[type, str]] = {}
    for entry in fields(kind):
        if entry.metadata.get("section") and entry.default_factory is not MISSING:
            found[entry.name] = (entry.default_factory, entry.metadata["description"])  # type: ignore[assignment]
    _sections[kind] = found
    return found
