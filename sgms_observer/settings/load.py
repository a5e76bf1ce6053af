"""Reads YAML as checked settings, for the command line and for the nodes."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from sgms_observer.effects import catalogue as effects
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import AxisSettings, EffectSettings, FrictionSettings, Settings, StageSettings
from sgms_observer.settings.check import Faults, checked_group, checked_value, shown, unknown_key
from sgms_observer.settings.consistency import axis_consistency, friction_consistency, is_file
from sgms_observer.settings.declaration import BOOL, STRINGS, Declared, declared_sections, declared_settings
from sgms_observer.settings.effects import Catalogue, CatalogueSource, checked_effects
from sgms_observer.settings.parameter_file import (
    NODE_NAMES,
    is_for_node,
    our_sections,
    parameter_tree,
    read_document,
    repeated_keys,
    sections,
)
from sgms_observer.settings.units import JOINT_TYPES, PRISMATIC, Units

_APART_IN_AXIS = ("effects", "stage", "friction")
_APART_IN_STAGE = ("friction", "effects")

AXES = Declared(
    "axes", STRINGS, ("x",), "names of the axes, as in the messages; each has a group of settings of its own"
)

#: A slash separates the joints of several robots in one system: left/x.
_AXIS_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*(?:/[A-Za-z0-9_-]+)*")


def checked_axis(
    name: str, tree: Any, period: float, folder: Path, catalogue: Catalogue | None, faults: Faults
) -> AxisSettings:
    """Return one axis.

    Args:
        name: its name.
        tree: its settings as read.
        period: nominal sample period [s].
        folder: relative file names start here.
        catalogue: known effects; None when they are not known.
        faults: receives the sentences.
    """
    elsewhere = _elsewhere_in(name)
    kind = tree.get("joint_type") if isinstance(tree, Mapping) else None
    kind = kind if kind in JOINT_TYPES else PRISMATIC
    axis = checked_group(
        name, AxisSettings(name=name), tree, faults, separate=_APART_IN_AXIS, elsewhere=elsewhere, joint_type=kind
    )
    if not isinstance(tree, Mapping):
        tree = {}
    friction = _friction(f"{name}.friction", axis.friction, tree.get("friction"), elsewhere, faults, kind)
    stage_tree = tree.get("stage")
    stage: StageSettings = checked_group(
        f"{name}.stage", axis.stage, stage_tree, faults, separate=_APART_IN_STAGE, elsewhere=elsewhere, joint_type=kind
    )
    reference = (
        replace(stage.reference, file=resolved(stage.reference.file, folder))
        if stage.reference.file
        else stage.reference
    )
    stage_friction: FrictionSettings | None = None
    stage_effects: tuple[EffectSettings, ...] | None = None
    if isinstance(stage_tree, Mapping):
        if stage_tree.get("friction") not in (None, {}):
            stage_friction = _friction(
                f"{name}.stage.friction", friction, stage_tree["friction"], elsewhere, faults, kind, f"{name}.friction"
            )
        if stage_tree.get("effects") is not None:
            stage_effects = checked_effects(f"{name}.stage.effects", stage_tree["effects"], catalogue, faults, kind)
    axis = replace(
        axis,
        friction=friction,
        stage=replace(stage, reference=reference),
        stage_friction=stage_friction,
        stage_effects=stage_effects,
        effects=checked_effects(f"{name}.effects", tree.get("effects"), catalogue, faults, kind),
    )
    axis_consistency(axis, period, faults)
    return axis


def _friction(
    path: str,
    defaults: FrictionSettings,
    tree: Any,
    elsewhere: Mapping[str, str],
    faults: Faults,
    joint_type: str,
    parent: str = "",
) -> FrictionSettings:
    """Return one friction model with the values of its parent as defaults; missing damping is zero."""
    friction = checked_group(path, defaults, tree, faults, elsewhere=elsewhere, joint_type=joint_type)
    given = tuple(key for key in tree if isinstance(key, str)) if isinstance(tree, Mapping) else ()
    n_z = len(friction.element_stiffness)
    if "element_damping" not in given and len(friction.element_damping) != n_z:
        friction = replace(friction, element_damping=(0.0,) * n_z)
    friction_consistency(path, friction, given, faults, Units(joint_type), parent)
    return friction


@lru_cache(maxsize=8)
def _places() -> dict[str, str]:
    """Return the place of each setting in an axis; names with several places are left out."""
    found: dict[str, str] = {}
    twice: set[str] = set()

    def walk(kind: type, prefix: str) -> None:
        for key in declared_settings(kind):
            if key in found:
                twice.add(key)
            found[key] = f"{prefix}.{key}"
        for key, (nested, _) in declared_sections(kind).items():
            found.setdefault(key, f"{prefix}.{key}")
            walk(nested, f"{prefix}.{key}")

    walk(AxisSettings, "")
    return {key: place for key, place in found.items() if key not in twice}


def _elsewhere_in(axis: str) -> dict[str, str]:
    """Return the full name of every setting, by its short name, for suggestions about misplaced ones."""
    shared = {key: key for key in (*declared_settings(Settings), "axes")}
    return {**{key: f"{axis}{place}" for key, place in _places().items()}, **shared}


def resolved(name: str, folder: Path) -> str:
    """Return a file name that works from the current folder, for one that starts at the parameter file's folder.

    Args:
        name: as it stands in the file.
        folder: the parameter file's.
    """
    if not name or Path(name).is_absolute() or folder == Path("."):
        return name
    in_folder = str(folder / name)
    return in_folder if is_file(in_folder) else name


#: Switches that every rclpy node declares, and parameters of other ROS nodes, which have no effect here.
ROS_SWITCHES = {
    name: Declared(name, BOOL, False, "a switch of every ROS node")
    for name in ("use_sim_time", "start_type_description_service")
}
ROS_PARAMETERS = (*ROS_SWITCHES, "qos_overrides", "diagnostic_updater")


def installed_catalogue(effect_files: Sequence[str]) -> Catalogue:
    """Return the effects of the package, of installed plug-ins and of the user's own files.

    Args:
        effect_files: Python files with effects.

    Raises:
        ConfigurationError: a file or plug-in cannot be used.
    """
    effects.load_user_effects(effect_files)
    return {name: effects.effect(name) for name in effects.names()}


def load_settings(
    path: str | Path, *, node_names: tuple[str, ...] = NODE_NAMES, catalogue: CatalogueSource = installed_catalogue
) -> Settings:
    """Return the checked settings of a ROS 2 parameter file.

    Args:
        path: the YAML file.
        node_names: nodes whose sections are laid over ``/**``.
        catalogue: gives the known effects.

    Raises:
        ConfigurationError: one sentence per fault of the file, all at once.
    """
    return settings_from_tree(
        read_document(path), str(path), folder=Path(path).parent, node_names=node_names, catalogue=catalogue
    )


def settings_from_tree(
    tree: Mapping[Any, Any],
    source_name: str = "the parameters",
    *,
    folder: str | Path = ".",
    node_names: tuple[str, ...] = NODE_NAMES,
    catalogue: CatalogueSource = installed_catalogue,
) -> Settings:
    """Return checked settings from the tree of a parameter file, or from the tree of the parameters alone.

    Args:
        tree: ``{"/**": {"ros__parameters": {...}}}`` or ``{"axes": [...], "x": {...}}``.
        source_name: name of the source, for sentences about the whole.
        folder: relative file names in it start here.
        node_names: nodes whose sections are laid over ``/**``.
        catalogue: gives the known effects.

    Returns:
        Settings whose ``source`` is the tree as given, with its sections.

    Raises:
        ConfigurationError: one sentence per fault, all at once.
    """
    if not isinstance(tree, Mapping):
        raise ConfigurationError([f"{source_name} = {shown(tree)} must be a tree of parameters; start with axes: [x]"])
    parameters = parameter_tree(tree, source_name, node_names)
    source = dict(tree) if any(sections(tree)) else {"/**": {"ros__parameters": dict(tree)}}
    faults = Faults()
    for name, sentence in repeated_faults(tree, source_name, node_names):
        faults.add(name, sentence)
    names = _axis_names(parameters, faults)
    shared = {key: value for key, value in parameters.items() if key in declared_settings(Settings)}
    settings = checked_group("", Settings(axes=()), shared, faults)
    settings = replace(settings, effect_files=_found_files(settings.effect_files, Path(folder), faults))
    for name in parameters:
        if name in ROS_SWITCHES:
            checked_value(name, ROS_SWITCHES[name], parameters[name], faults)
    _unknown_at_the_top(parameters, names, faults)
    known = _catalogue(catalogue, settings.effect_files, faults)
    axes = tuple(
        checked_axis(name, parameters.get(name), settings.sample_period, Path(folder), known, faults) for name in names
    )
    for axis in axes:
        if axis.coupled_axis and (axis.coupled_axis == axis.name or axis.coupled_axis not in names):
            path, given = f"{axis.name}.coupled_axis", shown(axis.coupled_axis)
            faults.add(path, f"{path} = {given} must name another axis of axes = {shown(list(names))}; correct it")
    if faults.sentences:
        raise ConfigurationError(faults.sentences)
    return replace(settings, axes=axes, source=source, folder=str(folder))


def repeated_faults(
    document: Mapping[Any, Any], source_name: str, node_names: tuple[str, ...]
) -> Iterator[tuple[str, str]]:
    """Yield each parameter that the sections of these nodes define twice, with its sentence.

    Args:
        document: the tree of a file, as ``read_document`` returned it.
        source_name: name of the file.
        node_names: whose sections count.
    """
    for key, line in getattr(document, "repeated", ()):
        if is_for_node(f"/{key.strip('/')}", node_names):
            yield key, f"{key} in line {line} of {source_name} must be given once; join the two sections"
    for _, _, section in our_sections(document, node_names):
        for name, line in repeated_keys(section):
            yield name, f"{name} in line {line} of {source_name} must be given once; remove one of the two"


def usable_axes(raw: Any) -> tuple[str, ...]:
    """Return the valid names of ``axes``.

    Args:
        raw: the list as read.
    """
    return _axis_names({"axes": raw}, Faults())


def _axis_names(tree: Mapping[Any, Any], faults: Faults) -> tuple[str, ...]:
    """Return the usable names of ``axes``; without ``axes`` it is x."""
    names: Sequence[str] = checked_value("axes", AXES, tree.get("axes", ["x"]), faults) or ()
    if not names and not faults.has("axes"):
        faults.add("axes", "axes = [] must name at least one axis; write axes: [x]")
    usable: dict[str, None] = {}
    reserved = {*declared_settings(Settings), *ROS_PARAMETERS, "axes"}
    for name in names:
        if not _AXIS_NAME.fullmatch(name):
            faults.add(
                "axes",
                f"axes = {shown(name)} must be a word of letters, digits, -, _ and / between them; rename the axis",
            )
        elif name in reserved:
            faults.add("axes", f"axes = {shown(name)} must not be the name of a setting; rename the axis")
        elif name in usable:
            faults.add("axes", f"axes = {shown(list(names))} must name each axis once; remove the second {name}")
        else:
            usable[name] = None
    return tuple(usable)


def _unknown_at_the_top(tree: Mapping[Any, Any], names: Sequence[str], faults: Faults) -> None:
    """Note every key at the top that is neither a setting nor an axis."""
    known = [*declared_settings(Settings), "axes", *names[:100]]
    of_an_axis = {*declared_settings(AxisSettings), *declared_sections(AxisSettings), "effects"}
    for key, value in tree.items():
        if key in known or key in ROS_PARAMETERS or (isinstance(key, str) and key in names):
            continue
        if (
            isinstance(key, str)
            and isinstance(value, Mapping)
            and any(isinstance(k, str) and k in of_an_axis for k in value)
        ):
            faults.add(
                key,
                f"{key} has settings of an axis but axes = {shown(list(names))} must name it; "
                f"add {key} to axes or remove it",
            )
        else:
            elsewhere = {name: f"{axis}.{name}" for axis in names[:1] for name in of_an_axis}
            unknown_key("", key, known, elsewhere | _elsewhere_in(names[0] if names else "x"), faults)


def _catalogue(source: CatalogueSource, effect_files: Sequence[str], faults: Faults) -> Catalogue | None:
    """Return the known effects; None when some cannot be loaded, which is a fault of the file."""
    try:
        return source(effect_files)
    except ConfigurationError as error:
        for sentence in error.sentences:
            faults.add("effect_files", sentence)
        return None


def _found_files(files: Sequence[str], folder: Path, faults: Faults) -> tuple[str, ...]:
    """Return the paths of files that the settings name; note the missing ones."""
    found = []
    for name in files:
        path = resolved(name, folder)
        if is_file(path):
            found.append(path)
        else:
            faults.add("effect_files", f"effect_files = {shown(name)} must be a readable Python file; correct the path")
    return tuple(found)
