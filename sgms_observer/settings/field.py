"""One setting, declared once: default, unit, range and meaning.

The YAML check, the ROS parameter descriptors, the error sentences and ``docs/parameters.md`` all read this.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any


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
        default: value when the YAML is silent; its type is the setting's type (a tuple means a list).
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
    """Declare a dataclass field as a group of settings of its own.

    Args:
        kind: the group's dataclass; its defaults are the group's.
        description: one sentence for people.
    """
    return field(default_factory=kind, metadata={"description": description, "section": True})
