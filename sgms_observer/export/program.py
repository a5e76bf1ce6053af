"""A C program in the making, and the Python functions that it is made of."""

from __future__ import annotations

import ast
import inspect
import math
import re
import sys
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from types import FunctionType
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.export.values import INT, REAL, Struct, Type, Value, number, real_text


@dataclass
class Parameter:
    """A parameter of a C function.

    Attributes:
        name: its name.
        value: its value inside the function.
        is_used: whether the function needs it; one that it does not need is left out.
        is_written: whether the function writes to its memory.
    """

    name: str
    value: Value
    is_used: bool = True
    is_written: bool = False


@dataclass
class Function:
    """One C function."""

    name: str
    parameters: list[Parameter]
    result: Type = None
    text: str = ""
    is_pure: bool = True


@dataclass(frozen=True, eq=False)
class Source:
    """A Python function to translate.

    Attributes:
        name: its name.
        file: where it stands, for refusals.
        summary: first sentence of its docstring.
        scope: its global names.
        tree: its syntax tree.
    """

    name: str
    file: str
    summary: str
    scope: dict[str, Any]
    tree: ast.FunctionDef


@dataclass
class Program(ABC):
    """A C program in the making.

    Attributes:
        float_values: constants by name that the type float needs otherwise (a tolerance below its rounding error).
        functions: source and argument types to the C function.
        structs: name to structure.
        constants: C name to value of each named constant.
        owners: name of a structure of several results to the function that returns it.
    """

    float_values: dict[str, float] = field(default_factory=dict)
    functions: dict[Any, Function] = field(default_factory=dict)
    structs: dict[str, Struct] = field(default_factory=dict)
    constants: dict[str, Any] = field(default_factory=dict)
    owners: dict[str, Any] = field(default_factory=dict)

    @abstractmethod
    def function(self, source: Source, arguments: Sequence[Value]) -> Function:
        """Return the C function for these argument types, translated when it is asked for first.

        Args:
            source: the Python function.
            arguments: what it is called with.
        """

    def named(self, name: str, found: Any, scope: dict[str, Any]) -> Value:
        """Return what a global name of a function means.

        Args:
            name: the name.
            found: its value.
            scope: the function's global names.
        """
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            return Value(name, None, const=found)
        origin = _origin(scope.get("__name__", ""), name, found).rsplit(".", 1)[-1]
        label = f"{origin}_{name.strip('_')}".upper()
        if self.constants.setdefault(label, found) != found:
            raise ConfigurationError(
                [f"sgms export cannot write {name} in C: two modules define {label}; rename one of the modules"]
            )
        return Value(label, REAL if isinstance(found, float) else INT, const=found)


@cache
def source_of(python: Any) -> Source | None:
    """Return a Python function with its syntax tree, whose line numbers are those of its file; None for no function."""
    if not isinstance(python, FunctionType):
        return None
    try:
        lines, first = inspect.getsourcelines(python)
        tree = ast.parse(textwrap.dedent("".join(lines)))
    except (OSError, SyntaxError):
        raise ConfigurationError(
            [f"sgms export needs the source of {python.__name__} and cannot read it; define it with def in a file"]
        ) from None
    ast.increment_lineno(tree, first - 1)
    found = tree.body[0]
    if not isinstance(found, ast.FunctionDef):
        raise ConfigurationError(
            [f"sgms export cannot write {python.__name__} in C: it is no plain function; define it with def"]
        )
    summary = (inspect.getdoc(python) or "").split("\n\n")[0].replace("\n", " ").replace("``", "")
    scope = {**python.__globals__, **inspect.getclosurevars(python).nonlocals}
    return Source(python.__name__, f"{python.__module__.replace('.', '/')}.py", summary, scope, found)


@cache
def _imports_of(module: str) -> dict[str, str]:
    """Return from where a module has its imported names."""
    loaded = sys.modules.get(module)
    if loaded is None or not getattr(loaded, "__file__", None):
        return {}
    return {
        alias.asname or alias.name: node.module or ""
        for node in ast.walk(ast.parse(inspect.getsource(loaded)))
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def _origin(module: str, name: str, value: Any) -> str:
    """Return the module that a constant comes from."""
    while name in _imports_of(module):
        module = _imports_of(module)[name]
    return module


def constant_lines(constants: dict[str, Any], float_values: dict[str, float]) -> list[str]:
    """Return the definitions of named constants."""
    whole = [f"    {name} = {value}" for name, value in sorted(constants.items()) if isinstance(value, int)]
    lines = ["enum {", ",\n".join(whole), "};"] if whole else []
    for name, value in sorted(constants.items()):
        if isinstance(value, float) and name in float_values:
            lines.append(f"#define {name} REAL_OR({value!r}, {float_values[name]!r}f)")
        elif isinstance(value, float):
            text = real_text(value) if math.isfinite(value) else number(value).text
            lines.append(f"#define {name} {text}")
    return lines


def c_name(name: str) -> str:
    """Return a name of the user's as part of a C name: any other sign than letters, digits and _ becomes _.

    Args:
        name: of an axis.
    """
    return re.sub(r"[^0-9a-zA-Z_]", "_", name)


def snake(name: str) -> str:
    """Return a class's name as C names: with underscores."""
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).strip("_")
