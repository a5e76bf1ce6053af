"""A node's arguments, before ROS reads them: parameter files checked, and put into a form that rcl takes.

rcl refuses ``[12.0e6, 2, 3.0]`` and an integer for a double with a traceback, and hands on empty lists without a type.
So the node's files and ``-p`` values are read here first, every fault is said in one sentence, and rcl gets one file
with the same parameters in the form it takes.
"""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.settings.axis import SAVE_FILE, Settings
from sgms_observer.settings.effects import CatalogueSource
from sgms_observer.settings.load import installed_catalogue, repeated_faults, settings_from_tree
from sgms_observer.settings.normal_form import normal_parameters, without_empty
from sgms_observer.settings.parameter_file import (
    NODE_NAMES,
    expanded,
    is_for_node,
    our_sections,
    overlaid,
    parameter_tree,
    read_document,
)
from sgms_observer.settings.write import write_text
from sgms_observer.settings.yaml_text import parse, text_of

_FILE, _PARAMETER, _REMAP = ("--params-file",), ("-p", "--param"), ("-r", "--remap")


@dataclass(frozen=True)
class RewrittenArguments:
    """What a node starts with.

    Attributes:
        argv: arguments for ``rclpy.init``, with one parameter file in place of all files and ``-p`` values.
        settings: the checked settings in them.
        file: the temporary parameter file, if there is one; ``discard`` it once ROS has read it.
    """

    argv: list[str]
    settings: Settings
    file: Path | None = None

    def discard(self) -> None:
        """Remove the temporary file; ``rclpy.init`` has read it by then."""
        if self.file is not None:
            with contextlib.suppress(OSError):
                self.file.unlink(missing_ok=True)


def normalise_params_file(
    path: str | Path, node_names: tuple[str, ...] = NODE_NAMES, catalogue: CatalogueSource = installed_catalogue
) -> str:
    """Return the parameters of a file for our nodes as YAML text that rcl takes: one section, types as declared.

    Args:
        path: a parameter file.
        node_names: nodes whose sections count.
        catalogue: gives the known effects.

    Raises:
        ConfigurationError: one sentence per fault of the file.
    """
    document = read_document(path)
    tree = parameter_tree(document, str(path), node_names)
    settings_from_tree(document, str(path), folder=Path(path).parent, node_names=node_names, catalogue=catalogue)
    return _text(_moved(tree, Path(path).parent))


def _text(tree: dict[Any, Any]) -> str:
    """Return parameters in normal form as the text of a file for every node."""
    return text_of({"/**": {"ros__parameters": without_empty(normal_parameters(tree))}})


def _moved(tree: dict[Any, Any], folder: Path) -> dict[Any, Any]:
    """Return parameters whose relative file names no longer depend on the folder of their file."""
    return normal_parameters(tree, lambda name: str((folder / name).resolve()) if (folder / name).exists() else name)


def rewrite_arguments(
    argv: Sequence[str], node_name: str = "observer_node", catalogue: CatalogueSource = installed_catalogue
) -> RewrittenArguments:
    """Check the parameters in a node's arguments and return arguments that rcl takes.

    Args:
        argv: the process's arguments, ``sys.argv``; what has nothing to do with parameters stays as it is.
        node_name: name of the node, unless the arguments rename it.
        catalogue: gives the known effects.

    Returns:
        The arguments with all parameter files and ``-p`` values in one file, the later ones deciding as in ROS.

    Raises:
        ConfigurationError: one sentence per fault of all the parameters together.
        RecordingError: the temporary file cannot be written.
    """
    kept, given, place, full_name = _taken_apart(argv, node_name)
    if not given:
        return RewrittenArguments(list(argv), settings_from_tree({}, node_names=(full_name,), catalogue=catalogue))
    tree, sentences = _laid_over_each_other(given, full_name)
    try:
        settings = settings_from_tree(tree, node_names=(full_name,), catalogue=catalogue)
    except ConfigurationError as error:
        sentences += error.sentences
    if sentences:
        raise ConfigurationError(sentences)
    file = _temporary_file()
    write_text(_text(tree), file)
    return RewrittenArguments([*kept[:place], "--params-file", str(file), *kept[place:]], settings, file)


def refuse_incomplete(arguments: RewrittenArguments, node_name: str) -> None:
    """Refuse to start a node on the example's numbers: somebody's axes and their masses must be given.

    Args:
        arguments: what ``rewrite_arguments`` returned.
        node_name: for the sentence.

    Raises:
        ConfigurationError: one sentence per value that is missing, or one about parameters that are missing at all.
    """
    if arguments.file is None:
        raise ConfigurationError(
            [
                f"{node_name} was started without parameters; name a parameter file with --config FILE, in a launch"
                " file with params_file:=FILE (a copy of config/table.yaml is a start), and check its path"
            ]
        )
    tree = parameter_tree(arguments.settings.source, str(arguments.file))
    if "axes" not in tree:
        raise ConfigurationError(
            ["axes must be given; check the path of the parameter file, or write for instance axes: [x] into it"]
        )
    missing = [axis.name for axis in arguments.settings.axes if "mass" not in (tree.get(axis.name) or {})]
    if missing:
        raise ConfigurationError([f"{name}.mass must be given; weigh or identify what moves" for name in missing])


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


def _temporary_file() -> Path:
    """Return a new file in the system's folder for temporary files."""
    try:
        handle, name = tempfile.mkstemp(prefix="sgms_observer_", suffix=".yaml")
    except OSError as error:
        reason = error.strerror or "there is no folder for temporary files"
        raise RecordingError(f"the checked parameters cannot be written: {reason}; make room in TMPDIR") from None
    os.close(handle)
    return Path(name)


def _taken_apart(argv: Sequence[str], node_name: str) -> tuple[list[str], list[tuple[tuple[str, ...], str]], int, str]:
    """Return the other arguments, the parameter arguments in order, where these stood, and the node's full name."""
    kept: list[str] = []
    given: list[tuple[tuple[str, ...], str]] = []
    place, namespace, name = 0, "/", node_name
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
            target, _, new = value.partition(":=")
            namespace = new if target.rsplit(":", 1)[-1] == "__ns" else namespace
            name = new if target.rsplit(":", 1)[-1] in ("__node", "__name") else name
            continue
        place = place if given else len(kept)
        given.append((kind, value))
    return kept, given, place, "/" + "/".join(part for part in (namespace.strip("/"), name) if part)


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
