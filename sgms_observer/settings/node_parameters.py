"""The parameters of a node: their declarations, and its arguments, checked before ROS reads them. Imports no ROS.

rcl refuses ``[12.0e6, 2, 3.0]`` and an integer for a double with a traceback, and passes on empty lists without a type.
So the files and ``-p`` values of the node are read here. Every fault is one sentence, and the node gets its parameters
in the types that it declares.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import SAVE_FILE, AxisSettings, FrictionSettings, Settings
from sgms_observer.settings.check import Faults, checked_value
from sgms_observer.settings.declaration import Declared, declared_sections, declared_settings
from sgms_observer.settings.effects import NAMES, Catalogue, CatalogueSource, declared_values
from sgms_observer.settings.load import AXES, installed_catalogue, repeated_faults, settings_from_tree, usable_axes
from sgms_observer.settings.parameter_file import (
    expanded,
    is_for_node,
    our_sections,
    overlaid,
    parameter_tree,
    read_document,
)
from sgms_observer.settings.units import JOINT_TYPES, PRISMATIC
from sgms_observer.settings.write import given_parameters, normal_parameters
from sgms_observer.settings.yaml_text import parse

#: Declares one parameter and returns the value that it has then.
Declare = Callable[[Declared], Any]


def _declaration(name: str, declared: Declared) -> Declared:
    """Return a setting as a parameter of a node: with its full name, arrays as lists, unit and choices in words."""
    unit = "" if declared.unit == "-" else f" [{declared.unit}]"
    choices = f" ({', '.join(declared.choices)})" if declared.choices else ""
    description = f"{declared.description}{unit}{choices}"
    return replace(declared, name=name, default=_plain(declared.default), description=description)


def declare_all(declare: Declare, catalogue: CatalogueSource = installed_catalogue) -> None:
    """Declare every parameter of a node, each after the parameters that it depends on.

    The axes determine the groups, the names of the effects determine their parameters, and the friction of the axis is
    the default of the true friction.

    Args:
        declare: declares one parameter and returns its value (None stands for the default).
        catalogue: gives the known effects.
    """

    def declared_value(declaration: Declared) -> Any:
        value = _plain(declare(declaration))
        return declaration.default if value is None else value

    names = usable_axes(declared_value(_declaration("axes", AXES)))
    shared = {key: declared_value(_declaration(key, entry)) for key, entry in declared_settings(Settings).items()}
    known = _known_effects(catalogue, shared["effect_files"])
    for name in names:
        _declare_axis(name, declared_value, known)


def _known_effects(catalogue: CatalogueSource, files: Any) -> Catalogue:
    """Return the known effects; the check reports a file that cannot be used."""
    try:
        return catalogue(
            checked_value("effect_files", declared_settings(Settings)["effect_files"], files, Faults()) or ()
        )
    except ConfigurationError:
        return {}


def _declare_axis(axis: str, declared_value: Declare, known: Catalogue) -> None:
    """Declare everything about one axis."""
    friction: dict[str, Any] = {}
    asked = declared_value(_declaration(f"{axis}.joint_type", declared_settings(AxisSettings)["joint_type"]))
    joint_type = asked if asked in JOINT_TYPES else PRISMATIC
    for declaration in _group(axis, AxisSettings, joint_type):
        if declaration.name == f"{axis}.joint_type":
            continue  # declared first, because the units of the others follow it
        if declaration.name == f"{axis}.friction.element_damping":
            declaration = replace(
                declaration, default=[0.0] * len(friction[f"{axis}.friction.element_stiffness"] or ())
            )
        value = declared_value(declaration)
        if declaration.name.startswith(f"{axis}.friction."):
            friction[declaration.name] = value
    _declare_effects(f"{axis}.effects", declared_value, known, joint_type)
    for declaration in _group(f"{axis}.stage.friction", FrictionSettings, joint_type):
        declared_value(replace(declaration, default=friction[declaration.name.replace(".stage.", ".", 1)]))
    _declare_effects(f"{axis}.stage.effects", declared_value, known, joint_type)


def _group(path: str, kind: type, joint_type: str) -> Iterable[Declared]:
    """Yield the parameters of a group and of the groups in it."""
    for key, declared in declared_settings(kind).items():
        yield _declaration(f"{path}.{key}", declared.of_joint_type(joint_type))
    for key, (nested, _) in declared_sections(kind).items():
        yield from _group(f"{path}.{key}", nested, joint_type)


def _declare_effects(path: str, declared_value: Declare, known: Catalogue, joint_type: str) -> None:
    """Declare the names of the effects, then their parameters."""
    names = declared_value(_declaration(f"{path}.names", NAMES))
    for name in dict.fromkeys(names if isinstance(names, (list, tuple)) else ()):
        for key, declared in declared_values(known[name], joint_type).items() if name in known else ():
            declared_value(_declaration(f"{path}.{name}.{key}", declared))


def _plain(value: Any) -> Any:
    """Return a parameter's value with lists in place of arrays and tuples."""
    if hasattr(value, "tolist"):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


def tree_from_parameters(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters as the tree that ``settings_from_tree`` takes.

    Args:
        values: full name to value. None, which ROS has for a parameter without a type, counts as not given. So do empty
            names of the stage's true effects; the stage then has those of the axis, and ``none`` means no effect.
    """
    given = {name: _plain(value) for name, value in values.items() if value is not None}
    tree: dict[str, Any] = expanded(
        {name: value for name, value in given.items() if value != [] or not name.endswith(".stage.effects.names")}
    )
    return tree


_FILE, _PARAMETER, _REMAP = ("--params-file",), ("-p", "--param"), ("-r", "--remap")


@dataclass(frozen=True)
class NodeArguments:
    """Checked arguments of a node.

    Attributes:
        argv: arguments for ``rclpy.init``: all but the parameter files and ``-p`` values.
        settings: the checked settings in those.
        parameters: their values by full name, each in its declared type; None without any.
    """

    argv: list[str]
    settings: Settings
    parameters: dict[str, Any] | None


def read_arguments(argv: Sequence[str], node_name: str = "observer_node") -> NodeArguments:
    """Take the parameters out of a node's arguments and check them.

    Args:
        argv: the arguments of the process, ``sys.argv``; arguments other than parameters are returned unchanged.
        node_name: name of the node, unless the arguments rename it.

    Returns:
        The parameters of all files and ``-p`` values, where later ones override, and the other arguments.

    Raises:
        ConfigurationError: one sentence per fault of all the parameters together.
    """
    other_arguments, given, full_name = _taken_apart(argv, node_name)
    tree, sentences = _laid_over_each_other(given, full_name)
    try:
        settings = settings_from_tree(tree, node_names=(full_name,))
    except ConfigurationError as error:
        sentences += error.sentences
    if sentences:
        raise ConfigurationError(sentences)
    return NodeArguments(other_arguments, settings, given_parameters(tree) if given else None)


def refuse_incomplete(arguments: NodeArguments, node_name: str) -> None:
    """Refuse to start a node without axes or masses, because the defaults are those of an example.

    Args:
        arguments: what ``read_arguments`` returned.
        node_name: for the sentence.

    Raises:
        ConfigurationError: one sentence per value that is missing, or one about parameters that are missing at all.
    """
    if arguments.parameters is None:
        raise ConfigurationError(
            [
                f"{node_name} was started without parameters; name a parameter file with --config FILE, in a launch"
                " file with params_file:=FILE (a copy of config/table.yaml is a start), and check its path"
            ]
        )
    if missing := _missing(arguments.parameters, arguments.settings.axes):
        raise ConfigurationError(missing)


def missing_parameters(settings: Settings, axes: Sequence[AxisSettings]) -> list[str]:
    """Return a sentence for each required value that a parameter file lacks."""
    return _missing(given_parameters(parameter_tree(settings.source, "the parameter file")), axes)


def refuse_missing(settings: Settings, axes: Sequence[AxisSettings]) -> None:
    """Refuse a parameter file without axes or without a mass, because the defaults are those of an example.

    Args:
        settings: of the file.
        axes: those of its axes that matter.

    Raises:
        ConfigurationError: one sentence for each value that the file lacks.
    """
    if missing := missing_parameters(settings, axes):
        raise ConfigurationError(missing)


def _missing(given: Mapping[str, Any], axes: Sequence[AxisSettings]) -> list[str]:
    """Return a sentence for each required value that is missing in parameters by full name."""
    if "axes" not in given:
        return ["axes must be given; check the path of the parameter file, or write for instance axes: [x] into it"]
    names = [f"{axis.name}.mass" for axis in axes]
    return [f"{name} must be given; weigh the moving mass, or identify it" for name in names if name not in given]


def _laid_over_each_other(
    given: Sequence[tuple[tuple[str, ...], str]], full_name: str
) -> tuple[dict[Any, Any], list[str]]:
    """Return all given parameters as one tree, later ones over earlier ones, and the sentences about single files."""
    tree: dict[Any, Any] = {}
    sentences: list[str] = []
    for_others = []
    for kind, value in given:
        if kind != _FILE:
            tree = overlaid(tree, _one_parameter(value, full_name))
            continue
        document = read_document(value)
        sentences += (sentence for _, sentence in repeated_faults(document, value, (full_name,)))
        if our_sections(document, (full_name,)):
            parameters = _moved(parameter_tree(document, value, (full_name,)), Path(value).parent)
            name = parameters.get("save_file", SAVE_FILE if "axes" in parameters else None)
            if isinstance(name, str):  # the check reports any other type
                parameters["save_file"] = str(Path(value).resolve().parent / Path(name).expanduser())
            tree = overlaid(tree, parameters)
        else:
            for_others.append((document, value))
    if for_others and not tree:  # a launch file may pass files for other nodes too, but not only those
        parameter_tree(*for_others[0], (full_name,))
    return tree, sentences


def _moved(tree: dict[Any, Any], folder: Path) -> dict[Any, Any]:
    """Return parameters with absolute file names."""
    return normal_parameters(tree, lambda name: str((folder / name).resolve()) if (folder / name).exists() else name)


def _taken_apart(argv: Sequence[str], node_name: str) -> tuple[list[str], list[tuple[tuple[str, ...], str]], str]:
    """Return the other arguments, the parameter arguments in order, and the node's full name."""
    other_arguments: list[str] = []
    given: list[tuple[tuple[str, ...], str]] = []
    rules: list[str] = []
    is_ros = False
    arguments = iter(argv)
    for argument in arguments:
        if argument in ("--ros-args", "--"):
            is_ros = argument == "--ros-args"
        kind = next((kind for kind in (_FILE, _PARAMETER, _REMAP) if is_ros and argument in kind), None)
        if kind is None:
            other_arguments.append(argument)
            continue
        value = next(arguments, None)
        if value is None:
            raise ConfigurationError([f"{argument} = (nothing) must have a value; write it after {argument}"])
        if kind == _REMAP:
            other_arguments += [argument, value]
            rules.append(value)
        else:
            given.append((kind, value))
    name = _renamed(rules, node_name, ("__node", "__name")) or node_name
    namespace = (_renamed(rules, name, ("__ns",)) or "/").strip("/")
    return other_arguments, given, f"/{namespace}/{name}" if namespace else f"/{name}"


def _renamed(rules: Sequence[str], node_name: str, targets: tuple[str, ...]) -> str | None:
    """Return what the first rule for this node puts in the place of one of these names, as rcl does."""
    for rule in rules:
        node, _, target = rule.partition(":=")[0].rpartition(":")
        if target in targets and node in ("", node_name):
            return rule.partition(":=")[2]
    return None


def _one_parameter(rule: str, full_name: str) -> dict[Any, Any]:
    """Return the tree of ``name:=value`` or ``node:name:=value``; nothing if it is for another node."""
    left, assigned, text = rule.partition(":=")
    node, _, name = left.rpartition(":")
    if not assigned or not name:
        raise ConfigurationError([f"-p {rule} must have the form name:=value; write for instance -p x.mass:=10.0"])
    if node and not is_for_node(f"/{node.strip('/')}", (full_name if "/" in node else full_name.rsplit("/", 1)[-1],)):
        return {}
    tree: dict[Any, Any] = expanded({name: parse(text, f"-p {name}")})
    return tree
