"""A ROS 2 parameter file as a tree: read safely, its sections found and laid over each other."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from sgms_observer.errors import ConfigurationError

#: Nodes of this package: a section of one of them is laid over ``/**``.
NODE_NAMES = ("stage_node", "observer_node")

_DEEPEST_NAMESPACE = 8
_LARGEST_FILE = 50_000_000
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def parse(text: str, source_name: str) -> Any:
    """Return the tree of a YAML text, as ``yaml.safe_load`` reads it.

    Args:
        text: the file's text.
        source_name: name of the file for the sentence.

    Raises:
        ConfigurationError: the text is not YAML.
    """
    try:
        return yaml.load(text, Loader=_Loader)  # a safe loader, in C where PyYAML has it
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        reason = " ".join(str(error.problem or error.context or "cannot be read").split())
    except (yaml.YAMLError, ValueError, ArithmeticError, LookupError, TypeError, AttributeError) as error:
        where, reason = "", (str(error).splitlines() or ["cannot be read"])[0]
    except RecursionError:
        where, reason = "", "it is nested too deeply"
    raise ConfigurationError([f"{source_name}{where} is not YAML: {reason}; correct the line (indent with spaces)"])


def read_document(path: str | Path) -> dict[str, Any]:
    """Return a parameter file as a tree.

    Args:
        path: the YAML file.

    Raises:
        ConfigurationError: the file is missing, not text, not YAML or not a mapping; one sentence.
    """
    try:
        if Path(path).stat().st_size > _LARGEST_FILE:
            raise ConfigurationError([f"{path} is larger than {_LARGEST_FILE // 1_000_000} MB; name a parameter file"])
        text = Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ConfigurationError([f"{path} is not a text file in UTF-8; name a YAML parameter file"]) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a possible file name"
        raise ConfigurationError([f"{path} cannot be read: {reason}; check the path of the parameter file"]) from None
    document = parse(text, str(path))
    if not isinstance(document, dict):
        raise ConfigurationError(
            [f"{path} holds no parameters; start with /**: ros__parameters: as in config/table.yaml"]
        )
    return document


def sections(document: Mapping[Any, Any], prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Yield every node's name and parameters, whatever way the namespaces are nested.

    Args:
        document: the tree of a file.
        prefix: namespace so far.
        depth: how many namespaces deep.
    """
    for key, value in document.items():
        if not isinstance(key, str) or not isinstance(value, Mapping) or depth > _DEEPEST_NAMESPACE:
            continue
        name = f"{prefix}/{key.strip('/')}"
        if "ros__parameters" in value:
            yield name, value["ros__parameters"]
        else:
            yield from sections(value, name, depth + 1)


def is_for_node(section_name: str, node_names: tuple[str, ...]) -> bool:
    """Return whether a section speaks to one of these nodes.

    Args:
        section_name: as ``sections`` yields it; ``*`` stands for one name and ``**`` for any.
        node_names: plain node names, or with their namespace (``/table/observer_node``).
    """
    for node in node_names:
        if "/" not in node.lstrip("/"):  # the namespace is not known: the last name decides
            last = section_name.rsplit("/", 1)[-1]
            if last in ("*", "**", node.lstrip("/")):
                return True
            continue
        tokens = (re.escape(token) if "*" not in token else token for token in section_name.strip("/").split("/"))
        pattern = "".join("(/[^/]+)*" if token == "**" else f"/{token.replace('*', '[^/]*')}" for token in tokens)
        if re.fullmatch(pattern, "/" + node.strip("/")):
            return True
    return False


def overlaid(below: Mapping[Any, Any], above: Mapping[Any, Any]) -> dict[Any, Any]:
    """Return two parameter trees as one, the second deciding where both speak.

    Args:
        below: parameters that may be overruled.
        above: parameters that overrule.
    """
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        merged[key] = overlaid(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged


def expanded(tree: Any, _seen: dict[int, Any] | None = None) -> Any:
    """Return a parameter tree with ``a.b: 1`` written as ``a: {b: 1}``, which ROS takes for the same.

    Args:
        tree: any YAML value; only mappings change.
    """
    if not isinstance(tree, Mapping):
        return tree
    seen = {} if _seen is None else _seen
    if id(tree) in seen:
        return seen[id(tree)]
    seen[id(tree)] = tree  # a tree that contains itself stays as it is
    result: dict[Any, Any] = {}
    for key, value in tree.items():
        nested = expanded(value, seen)
        names = key.split(".") if isinstance(key, str) and "." in key.strip(".") else [key]
        for name in reversed(names[1:]):
            nested = {name: nested}
        old = result.get(names[0])
        result[names[0]] = overlaid(old, nested) if isinstance(old, Mapping) and isinstance(nested, Mapping) else nested
    seen[id(tree)] = result
    return result


def parameter_tree(
    document: Mapping[Any, Any], source_name: str, node_names: tuple[str, ...] = NODE_NAMES
) -> dict[Any, Any]:
    """Return the parameters that a document holds for our nodes, as one tree.

    Args:
        document: the tree of a file; one without any ``ros__parameters`` is taken as the parameters themselves.
        source_name: name of the file for sentences.
        node_names: whose sections count; wildcard sections come first, named ones over them in the given order.

    Raises:
        ConfigurationError: no section is for these nodes, or one holds no mapping.
    """
    found = list(sections(document))
    if not found:
        return dict(expanded(document))
    wild = [entry for entry in found if "*" in entry[0] and is_for_node(entry[0], node_names)]
    named = [entry for node in node_names for entry in found if "*" not in entry[0] and is_for_node(entry[0], (node,))]
    if not wild and not named:
        theirs = ", ".join(name for name, _ in found[:4])
        ours = node_names[-1].rsplit("/", 1)[-1]
        raise ConfigurationError(
            [f"{source_name} has parameters for {theirs} only; put those of {ours} below /**: ros__parameters:"]
        )
    merged: dict[Any, Any] = {}
    for name, parameters in [*wild, *named]:
        if parameters is None:
            continue
        if not isinstance(parameters, Mapping):
            raise ConfigurationError(
                [f"{source_name}: ros__parameters of {name} must be a group; indent parameters below it"]
            )
        merged = overlaid(merged, expanded(parameters))
    return merged
