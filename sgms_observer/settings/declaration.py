"""What the settings dataclasses declare, read once: base of the check, the ROS parameters and the reference page."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, get_type_hints

from sgms_observer.settings.units import Units

#: YAML types of a setting, under ROS's names for them.
DOUBLE, INTEGER, BOOL, STRING = "double", "integer", "bool", "string"
DOUBLES, STRINGS = "double_array", "string_array"

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
        minimum: smallest allowed value, if any.
        maximum: largest allowed value, if any.
        above: bound that the value must strictly exceed, if any.
        choices: the allowed words, if they are listed.
        is_nonzero: whether zero is the one number that is not allowed.
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

    def of_joint_type(self, joint_type: str) -> Declared:
        """Return the setting with the unit that it has on an axis of this joint type.

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
    """Return the groups inside a group, by name: their dataclass and their description.

    Args:
        kind: a dataclass whose fields were made with ``setting`` and ``section``.
    """
    if kind in _sections:
        return _sections[kind]
    found: dict[str, tuple[type, str]] = {}
    for entry in fields(kind):
        if entry.metadata.get("section") and entry.default_factory is not MISSING:
            found[entry.name] = (entry.default_factory, entry.metadata["description"])  # type: ignore[assignment]
    _sections[kind] = found
    return found
