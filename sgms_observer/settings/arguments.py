"""A node's arguments, before ROS reads them: its parameters, checked, and what is left for ROS.

rcl refuses ``[12.0e6, 2, 3.0]`` and an integer for a double with a traceback, and hands on empty lists without a type.
So the node's files and ``-p`` values are read here instead: every fault is said in one sentence, and the node is made
with the parameters in the types that it declares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import SAVE_FILE, Settings
from sgms_observer.settings.load import repeated_faults, settings_from_tree
from sgms_observer.settings.parameter_file import (
    expanded,
    is_for_node,
    our_sections,
    overlaid,
    parameter_tree,
    read_document,
)
from sgms_observer.settings.write import given_parameters, normal_parameters
from sgms_observer.settings.yaml_text import parse

_FILE, _PARAMETER, _REMAP = ("--params-file",), ("-p", "--param"), ("-r", "--remap")


@dataclass(frozen=True)
class NodeArguments:
    """What a node starts with.

    Attributes:
        argv: arguments for ``rclpy.init``: all but the parameter files and ``-p`` values.
        settings: the checked settings in those.
        parameters: their values by full name, each in the type that the node declares; None if nobody gave any.
    """

    argv: list[str]
    settings: Settings
    parameters: dict[str, Any] | None


def read_arguments(argv: Sequence[str], node_name: str = "observer_node") -> NodeArguments:
    """Take the parameters out of a node's arguments and check them.

    Args:
        argv: the process's arguments, ``sys.argv``; what has nothing to do with parameters stays as it is.
        node_name: name of the node, unless the arguments rename it.

    Returns:
        The parameters of all files and ``-p`` values, the later ones deciding, and the other arguments.

    Raises:
        ConfigurationError: one sentence per fault of all the parameters together.
    """
    kept, given, full_name = _taken_apart(argv, node_name)
    tree, sentences = _laid_over_each_other(given, full_name)
    try:
        settings = settings_from_tree(tree, node_names=(full_name,))
    except ConfigurationError as error:
        sentences += error.sentences
    if sentences:
        raise ConfigurationError(sentences)
    return NodeArguments(kept, settings, given_parameters(tree) if given else None)


def refuse_incomplete(arguments: NodeArguments, node_name: str) -> None:
    """Refuse to start a node on the example's numbers: somebody's axes and their masses must be given.

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
    if "axes" not in arguments.parameters:
        raise ConfigurationError(
            ["axes must be given; check the path of the parameter file, or write for instance axes: [x] into it"]
        )
    names = [f"{axis.name}.mass" for axis in arguments.settings.axes]
    missing = [name for name in names if name not in arguments.parameters]
    if missing:
        raise ConfigurationError([f"{name} must be given; weigh or identify what moves" for name in missing])


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
            own = _moved(parameter_tree(document, value, (full_name,)), Path(value).parent)
            name = own.get("save_file", SAVE_FILE if "axes" in own else None)
            if isinstance(name, str):  # the check has a sentence for anything else
                own["save_file"] = str(Path(value).resolve().parent / Path(name).expanduser())
            tree = overlaid(tree, own)
        else:
            for_others.append((document, value))
    if for_others and not tree:  # a launch file may hand on files for others, but not only those
        parameter_tree(*for_others[0], (full_name,))
    return tree, sentences


def _moved(tree: dict[Any, Any], folder: Path) -> dict[Any, Any]:
    """Return parameters whose relative file names no longer depend on the folder of their file."""
    return normal_parameters(tree, lambda name: str((folder / name).resolve()) if (folder / name).exists() else name)


def _taken_apart(argv: Sequence[str], node_name: str) -> tuple[list[str], list[tuple[tuple[str, ...], str]], str]:
    """Return the other arguments, the parameter arguments in order, and the node's full name."""
    kept: list[str] = []
    given: list[tuple[tuple[str, ...], str]] = []
    rules: list[str] = []
    is_ros = False
    arguments = iter(argv)
    for argument in arguments:
        if argument in ("--ros-args", "--"):
            is_ros = argument == "--ros-args"
        kind = next((kind for kind in (_FILE, _PARAMETER, _REMAP) if is_ros and argument in kind), None)
        if kind is None:
            kept.append(argument)
            continue
        value = next(arguments, None)
        if value is None:
            raise ConfigurationError([f"{argument} = (nothing) must have a value; write it behind {argument}"])
        if kind == _REMAP:
            kept += [argument, value]
            rules.append(value)
        else:
            given.append((kind, value))
    name = _renamed(rules, node_name, ("__node", "__name")) or node_name
    namespace = (_renamed(rules, name, ("__ns",)) or "/").strip("/")
    return kept, given, f"/{namespace}/{name}" if namespace else f"/{name}"


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
