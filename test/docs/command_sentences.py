"""Every error and warning that a command can print, read from the source: what the troubleshooting page must list."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from node_sentences import HOLE, ROOT

ERRORS = (
    "ConfigurationError", "RecordingError", "DataError", "SgmsError", "HiddenError", "HeldUp", "_Silence", "OutOfTime"
)  # fmt: skip
PREFIX = "Warning: "
ELSEWHERE = ("settings", "nodes", "export", "effects", "formulas")
"""Folders whose sentences are of one kind each, which the page explains as one, or that `node_sentences` reads."""

AXES = "sgms_observer/settings/axis.py"
"""Where every command looks up the names of --axis."""

_HEAD = re.compile(r"^(.*?)(?:[;:(]| - |$)")
_FEWEST_LETTERS = 12


def command_sentences() -> dict[str, str]:
    """Return the fixed beginning of each error and warning with the file that it stands in."""
    found: dict[str, str] = {}
    for path in sorted(ROOT.glob("sgms_observer/**/*.py")):
        file = path.relative_to(ROOT)
        if file.parts[1] in ELSEWHERE and file.as_posix() != AXES:
            continue
        for sentence in _sentences(path):
            head = beginning(sentence)
            if len(head.replace(HOLE, "")) >= _FEWEST_LETTERS:
                found.setdefault(head, file.as_posix())
    return found


def beginning(sentence: str) -> str:
    """Return the words of a sentence up to its first remedy, list or value in brackets.

    Args:
        sentence: with holes for what is filled in.
    """
    plain = sentence.removeprefix(PREFIX).replace(f"{HOLE}: ", f"{HOLE} ", 1).replace("\n", " ")
    head = _HEAD.match(plain)
    assert head is not None
    return re.sub(rf"(?:[{HOLE} .,=]+|^)$", "", re.sub(rf"^[{HOLE} .,=]+", "", head.group(1))).strip()


def _sentences(path: Path) -> Iterator[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    for node in ast.walk(tree):
        if id(node) in inside:
            continue
        if isinstance(node, ast.Call) and _name(node.func) in ERRORS and node.args:
            first = node.args[0]
            yield from filter(None, map(_text, first.elts if isinstance(first, ast.List) else [first]))
        elif isinstance(node, ast.Call) and _name(node.func) == "append" and _name(_owner(node.func)) in _LISTS:
            yield from filter(None, map(_text, node.args))
        elif isinstance(node, ast.Yield) and node.value is not None and path.name == "check.py":
            yield from filter(None, [_text(node.value)])
        elif isinstance(node, ast.FunctionDef) and node.name.endswith("_sentence"):
            yield from filter(
                None, (_text(one.value) for one in ast.walk(node) if isinstance(one, ast.Return) and one.value)
            )
        elif isinstance(node, ast.JoinedStr | ast.Constant) and (text := _text(node) or "").startswith(PREFIX):
            yield text


_LISTS = ("warnings", "_warnings", "faults", "doubts", "out", "poor", "said")


def _owner(call: ast.expr) -> ast.expr:
    return call.value if isinstance(call, ast.Attribute) else call


def _name(node: ast.expr) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _text(node: ast.AST) -> str | None:
    """Return a literal string, holes for what is filled in; None for anything else."""
    if isinstance(node, ast.JoinedStr):
        return "".join(str(part.value) if isinstance(part, ast.Constant) else HOLE for part in node.values)
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return node.value
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        left, right = _text(node.left), _text(node.right)
        return None if left is None and right is None else (left or HOLE) + (right or HOLE)
    return None
