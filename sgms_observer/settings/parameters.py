"""The settings as ROS parameters: what a node declares, and the way back to a tree. No ROS in here."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import AxisSettings, FrictionSettings, Settings
from sgms_observer.settings.check import Faults, checked_value
from sgms_observer.settings.declaration import Declared, declared_sections, declared_settings
from sgms_observer.settings.effects import NAMES, Catalogue, CatalogueSource, declared_values
from sgms_observer.settings.load import AXES, installed_catalogue, usable_axes
from sgms_observer.settings.parameter_file import expanded
from sgms_observer.settings.units import JOINT_TYPES, PRISMATIC


@dataclass(frozen=True)
class ParameterDeclaration:
    """One parameter of a node.

    Attributes:
        name: full name, ``x.friction.static_force``.
        type: ``double``, ``integer``, ``bool``, ``string``, ``double_array`` or ``string_array``.
        default: value when nobody gives one; a list for an array.
        unit: SI unit, or ``-``.
        description: one sentence for people, with the unit.
        minimum: smallest allowed value, itself allowed; None for what is no number.
        maximum: largest allowed value, itself allowed; None for what is no number.
        choices: the allowed words; None for any.
    """

    name: str
    type: str
    default: Any
    unit: str
    description: str
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] | None = None


#: Declares one parameter and returns the value that it has then.
Declare = Callable[[ParameterDeclaration], Any]


def _declaration(name: str, declared: Declared) -> ParameterDeclaration:
    """Return a setting as a parameter of a node."""
    value = declared.default
    unit = "" if declared.unit == "-" else f" [{declared.unit}]"
    choices = f" ({', '.join(declared.choices)})" if declared.choices else ""
    return ParameterDeclaration(
        name=name,
        type=declared.kind,
        default=list(value) if isinstance(value, tuple) else value,
        unit=declared.unit,
        description=f"{declared.description}{unit}{choices}",
        minimum=declared.minimum,
        maximum=declared.maximum,
        choices=declared.choices,
    )


def declare_all(declare: Declare, catalogue: CatalogueSource = installed_catalogue) -> None:
    """Declare every parameter of a node, each as soon as what it depends on is known.

    The axes decide which groups there are, the effects' names which parameters they have, the axis's friction what the
    true friction is by default.

    Args:
        declare: declares one parameter and returns its value (None stands for the default).
        catalogue: gives the known effects.
    """

    def own(declaration: ParameterDeclaration) -> Any:
        value = _plain(declare(declaration))
        return declaration.default if value is None else value

    names = usable_axes(own(_declaration("axes", AXES)))
    shared = {key: own(_declaration(key, entry)) for key, entry in declared_settings(Settings).items()}
    known = _known_effects(catalogue, shared["effect_files"])
    for name in names:
        _declare_axis(name, own, known)


def _known_effects(catalogue: CatalogueSource, files: Any) -> Catalogue:
    """Return the known effects; a file that cannot be used is left to the check, which has a sentence for it."""
    try:
        return catalogue(
            checked_value("effect_files", declared_settings(Settings)["effect_files"], files, Faults()) or ()
        )
    except ConfigurationError:
        return {}


def _declare_axis(axis: str, own: Declare, known: Catalogue) -> None:
    """Declare everything about one axis."""
    friction: dict[str, Any] = {}
    asked = own(_declaration(f"{axis}.joint_type", declared_settings(AxisSettings)["joint_type"]))
    joint_type = asked if asked in JOINT_TYPES else PRISMATIC
    for declaration in _group(axis, AxisSettings, joint_type):
        if declaration.name == f"{axis}.joint_type":
            continue  # declared before the others, whose units follow it
        if declaration.name == f"{axis}.friction.element_damping":
            declaration = replace(
                declaration, default=[0.0] * len(friction[f"{axis}.friction.element_stiffness"] or ())
            )
        value = own(declaration)
        if declaration.name.startswith(f"{axis}.friction."):
            friction[declaration.name] = value
    _declare_effects(f"{axis}.effects", own, known, joint_type)
    for declaration in _group(f"{axis}.stage.friction", FrictionSettings, joint_type):
        own(replace(declaration, default=friction[declaration.name.replace(".stage.", ".", 1)]))
    _declare_effects(f"{axis}.stage.effects", own, known, joint_type)


def _group(path: str, kind: type, joint_type: str) -> Iterable[ParameterDeclaration]:
    """Yield the parameters of a group and of the groups in it."""
    for key, declared in declared_settings(kind).items():
        yield _declaration(f"{path}.{key}", declared.of_joint_type(joint_type))
    for key, (nested, _) in declared_sections(kind).items():
        yield from _group(f"{path}.{key}", nested, joint_type)


def _declare_effects(path: str, own: Declare, known: Catalogue, joint_type: str) -> None:
    """Declare the names of effects, then the parameters of those that are named."""
    names = own(_declaration(f"{path}.names", NAMES))
    for name in dict.fromkeys(names if isinstance(names, (list, tuple)) else ()):
        for key, declared in declared_values(known[name], joint_type).items() if name in known else ():
            own(_declaration(f"{path}.{name}.{key}", declared))


def _plain(value: Any) -> Any:
    """Return a parameter's value with lists in place of arrays and tuples."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def tree_from_parameters(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters as the tree that ``settings_from_tree`` takes.

    Args:
        values: full name to value; None, which ROS has for a parameter without a type, counts as not given, and so do
            empty names of the stage's true effects: they are the axis's then, and ``none`` is the word for none.
    """
    given = {name: _plain(value) for name, value in values.items() if value is not None}
    tree: dict[str, Any] = expanded(
        {name: value for name, value in given.items() if value != [] or not name.endswith(".stage.effects.names")}
    )
    return tree
