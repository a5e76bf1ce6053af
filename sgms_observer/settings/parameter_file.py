"""Reads a ROS 2 parameter file as a tree, finds its sections, and combines them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.yaml_text import Group, parse

#: Nodes of this package: a section of one of them is laid over ``/**``.
NODE_NAMES = ("stage_node", "observer_node")

_PARAMETERS = "ros__parameters"
_DEEPEST_NAMESPACE = 8
_LARGEST_FILE = 50_000_000


def read_document(path: str | Path) -> dict[str, Any]:
    """Return a parameter file as a tree.

    Raises:
        ConfigurationError: the file is missing, not text, not YAML or has no section for parameters; one sentence.
    """
    try:
        with Path(path).open("rb") as file:  # a device or a pipe may have no end
            content = file.read(_LARGEST_FILE + 1)
        if len(content) > _LARGEST_FILE:
            raise ConfigurationError([f"{path} is larger than {_LARGEST_FILE // 1_000_000} MB; name a parameter file"])
        text = content.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise ConfigurationError([f"{path} is not a text file in UTF-8; name a YAML parameter file"]) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a possible file name"
        raise ConfigurationError([f"{path} cannot be read: {reason}; check the path of the parameter file"]) from None
    document = parse(text, str(path))
    if not isinstance(document, dict) or not any(sections(document)):
        raise ConfigurationError(
            [f"{path} has no ros__parameters; put all parameters below /**: ros__parameters: as in config/table.yaml"]
        )
    return document


def sections(
    document: Mapping[Any, Any], keys: tuple[str, ...] = (), _barren: set[int] | None = None
) -> Iterator[tuple[str, tuple[str, ...], Any]]:
    """Yield every node's full name, the keys that lead to its parameters, and the parameters.

    Args:
        document: the tree of a file; namespaces may be nested or written with slashes.
        keys: keys so far.
    """
    barren: set[int] = set() if _barren is None else _barren  # groups without a section, which aliases can repeat often
    for key, value in document.items():
        if not isinstance(key, str) or not isinstance(value, Mapping) or len(keys) > _DEEPEST_NAMESPACE:
            continue
        if _PARAMETERS in value:
            place = (*keys, key, _PARAMETERS)
            yield "/" + "/".join(name.strip("/") for name in place[:-1]), place, value[_PARAMETERS]
        elif id(value) not in barren:
            found = list(sections(value, (*keys, key), barren))
            yield from found
            if not found:
                barren.add(id(value))


def is_for_node(section_name: str, node_names: tuple[str, ...]) -> bool:
    """Return whether a section is for one of these nodes.

    Args:
        section_name: as ``sections`` yields it; ``*`` stands for one name and ``**`` for any.
        node_names: plain node names, or with their namespace (``/table/observer_node``, ``/observer_node``).
    """
    for node in node_names:
        if "/" not in node:  # the namespace is unknown, so the last name is compared
            last = section_name.rsplit("/", 1)[-1]
            if last in ("*", "**", node):
                return True
            continue
        tokens = (re.escape(token) if "*" not in token else token for token in section_name.strip("/").split("/"))
        pattern = "".join("(/[^/]+)*" if token == "**" else f"/{token.replace('*', '[^/]*')}" for token in tokens)
        if re.fullmatch(pattern, "/" + node.strip("/")):
            return True
    return False


def overlaid(below: Mapping[Any, Any], above: Mapping[Any, Any]) -> dict[Any, Any]:
    """Return two parameter trees as one; the second overrides the first."""
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        merged[key] = overlaid(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged


def expanded(tree: Any, _seen: dict[int, Any] | None = None) -> Any:
    """Return a parameter tree with ``a.b: 1`` written as ``a: {b: 1}``, which is the same for ROS.

    Args:
        tree: any YAML value; only mappings change.
    """
    if not isinstance(tree, Mapping):
        return tree
    visited = {} if _seen is None else _seen
    if id(tree) in visited:
        return visited[id(tree)]
    visited[id(tree)] = tree  # a tree that contains itself is not changed
    result: dict[Any, Any] = {}
    for key, value in tree.items():
        nested = expanded(value, visited)
        names = key.split(".") if isinstance(key, str) and "." in key.strip(".") else [key]
        for name in reversed(names[1:]):
            nested = {name: nested}
        old = result.get(names[0])
        result[names[0]] = overlaid(old, nested) if isinstance(old, Mapping) and isinstance(nested, Mapping) else nested
    visited[id(tree)] = result
    return result


def repeated_keys(tree: Any, prefix: str = "", _seen: set[int] | None = None) -> Iterator[tuple[str, int]]:
    """Yield the full name and line of every key that a file has twice in one group.

    Args:
        tree: parameters as ``yaml_text.parse`` returned them.
        prefix: full name of the group, with a dot.
    """
    visited = set() if _seen is None else _seen
    if not isinstance(tree, Mapping) or id(tree) in visited:
        return
    visited.add(id(tree))
    if isinstance(tree, Group):
        yield from ((f"{prefix}{key}", line) for key, line in tree.repeated)
    for key, value in tree.items():
        yield from repeated_keys(value, f"{prefix}{key}.", visited)


def our_sections(
    document: Mapping[Any, Any], node_names: tuple[str, ...] = NODE_NAMES
) -> list[tuple[str, tuple[str, ...], Any]]:
    """Return the sections for these nodes, in rising priority.

    Args:
        document: the tree of a file.
        node_names: wildcard sections come first, then those of each of these nodes.
    """
    found = list(sections(document))
    wild = [entry for entry in found if "*" in entry[0] and is_for_node(entry[0], node_names)]
    named = [entry for node in node_names for entry in found if "*" not in entry[0] and is_for_node(entry[0], (node,))]
    return wild + named


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
    ours = our_sections(document, node_names)
    if not ours:
        theirs = ", ".join(name for name, *_ in found[:4])
        node = node_names[-1].rsplit("/", 1)[-1]
        raise ConfigurationError(
            [f"{source_name} has parameters for {theirs} only; put those of {node} below /**: ros__parameters:"]
        )
    merged: dict[Any, Any] = {}
    for name, _, parameters in ours:
        if parameters is None:
            continue
        if not isinstance(parameters, Mapping):
            raise ConfigurationError(
                [f"{source_name}: ros__parameters of {name} must be a group; indent parameters below it"]
            )
        merged = overlaid(merged, expanded(parameters))
    return merged
