"""What the docstrings of a module say of each argument, compared with its signatures; read from the source, not run."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_SECTION = re.compile(r"^(Args|Attributes):(.*)$")
_ENTRY = re.compile(r"^([*\w]+(?:(?:, | and )[*\w]+)*): ?(.*)$")
_AS_OTHER = re.compile(r"as (?:for |of )?``([\w.]+)``")
_UNIT = re.compile(r"\[[^\]]+\]")
_HAS_UNIT = re.compile(r"\bfloat\b|\bFloats\b|float64")
_SAYS_UNIT = ("share", "SI unit", "the unit", "as published", "of the encoder's counts")


@dataclass(frozen=True)
class Argument:
    """One argument of a public name.

    Attributes:
        owner: the function's, method's or class's name.
        name: the argument.
        annotation: its type as written.
        text: what the docstring says of it; None if it says nothing.
    """

    owner: str
    name: str
    annotation: str
    text: str | None

    @property
    def needs_unit(self) -> bool:
        """Return whether it carries physical numbers."""
        return bool(_HAS_UNIT.search(self.annotation)) and "Callable" not in self.annotation

    @property
    def has_unit(self) -> bool:
        """Return whether its description gives a unit, ``[-]`` included, or says whose unit it has."""
        text = self.text or ""
        return bool(_UNIT.search(text)) or any(phrase in text for phrase in _SAYS_UNIT)


def described(docstring: str) -> dict[str, str]:
    """Return what a docstring's Args or Attributes say.

    Args:
        docstring: cleaned docstring.
    """
    found: dict[str, str] = {}
    names: list[str] = []
    depth = -1
    for line in docstring.splitlines():
        if _SECTION.match(line):
            depth = 0
            continue
        if depth >= 0 and line and not line.startswith(" "):
            depth = -1
        entry = _ENTRY.match(line.strip()) if depth >= 0 else None
        indent = len(line) - len(line.lstrip())
        if entry and indent == 4:
            names = [name.lstrip("*") for name in re.split(r", | and ", entry.group(1))]
            found.update(dict.fromkeys(names, entry.group(2)))
        elif depth >= 0 and line.strip():
            found.update({name: f"{found[name]} {line.strip()}" for name in names})
    return found


def undocumented(path: Path) -> list[str]:
    """Return the public names of a module that have no docstring at all."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return [name for name, node in _public(tree, "") if ast.get_docstring(node) is None and not _is_overload(node)]


def arguments(path: Path) -> list[Argument]:
    """Return every argument of every public function, method and class of a module, dataclass fields included."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docstrings = {name: ast.get_docstring(node) or "" for name, node in _public(tree, "")}
    found = []
    for name, node in _public(tree, ""):
        says = _with_references(docstrings[name], docstrings)
        for argument, annotation in _arguments_of(node):
            found.append(Argument(name, argument, annotation, says.get(argument)))
    return found


def _with_references(docstring: str, docstrings: dict[str, str]) -> dict[str, str]:
    """Return what a docstring says, together with what the one says that it refers to."""
    says: dict[str, str] = {}
    for other in _AS_OTHER.findall(docstring):
        if docstrings.get(other, docstring) != docstring:
            says.update(_with_references(docstrings[other], docstrings))
    return {**says, **described(docstring)}


def _public(node: ast.AST, prefix: str) -> Iterator[tuple[str, ast.FunctionDef | ast.ClassDef]]:
    """Yield public functions, classes and methods; a class stands for its constructor."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef) and not child.name.startswith("_"):
            yield prefix + child.name, child
            if isinstance(child, ast.ClassDef) and not any("Protocol" in ast.unparse(base) for base in child.bases):
                yield from _public(child, f"{prefix}{child.name}.")


def _arguments_of(node: ast.FunctionDef | ast.ClassDef) -> Iterator[tuple[str, str]]:
    if isinstance(node, ast.ClassDef):
        for part in node.body:
            if isinstance(part, ast.FunctionDef) and part.name == "__init__":
                yield from _arguments_of(part)
            elif isinstance(part, ast.AnnAssign) and _is_dataclass(node):
                name = ast.unparse(part.target)
                is_setting = "setting(" in ast.unparse(part)  # says it in its declaration
                if not name.startswith("_") and not is_setting:
                    yield name, ast.unparse(part.annotation)
        return
    for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs):
        if argument.arg not in ("self", "cls"):
            yield argument.arg, ast.unparse(argument.annotation) if argument.annotation else ""


def _is_dataclass(node: ast.ClassDef) -> bool:
    return any("dataclass" in ast.unparse(decorator) for decorator in node.decorator_list)


def _is_overload(node: ast.AST) -> bool:
    return isinstance(node, ast.FunctionDef) and any("overload" in ast.unparse(d) for d in node.decorator_list)
