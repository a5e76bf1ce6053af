"""Translates the kernels to C: each function once for every set of argument types that it is called with."""

from __future__ import annotations

import ast
import inspect
import math
import sys
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np

from sgms_observer.errors import ConfigurationError
from sgms_observer.estimators import fields
from sgms_observer.export import calls
from sgms_observer.export.expressions import Expressions
from sgms_observer.export.lines import Line, Statement, print_block, walk, without_unused, wrapped
from sgms_observer.export.statements import Statements, assigned_in
from sgms_observer.export.values import ATOM, INT, REAL, Array, Record, Scalar, Struct, Type, Value, number, real_text


@dataclass
class Parameter:
    """A parameter of a C function.

    Attributes:
        name: its name.
        value: what stands for it inside the function.
        is_used: whether the function needs it; one that it does not need is left out.
        is_written: whether the function writes the memory behind it.
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
class Translator:
    """A C program in the making.

    Attributes:
        float_values: constants by name that the type float needs otherwise (a tolerance below its rounding error).
    """

    float_values: dict[str, float] = field(default_factory=dict)
    functions: dict[Any, Function] = field(default_factory=dict)
    structs: dict[str, Struct] = field(default_factory=dict)
    constants: dict[str, Any] = field(default_factory=dict)
    owners: dict[str, Any] = field(default_factory=dict)

    def outside(self, name: str, found: Any, scope: dict[str, Any], node: ast.AST) -> Value:
        """Return what a global name of a function means."""
        if isinstance(found, bool) or not isinstance(found, (int, float)):
            return Value(name, None, const=found)
        origin = _origin(scope.get("__name__", ""), name, found).rsplit(".", 1)[-1]
        label = f"{origin}_{name.strip('_')}".upper()
        if self.constants.setdefault(label, found) != found:
            raise ConfigurationError([f"sgms export: two constants are named {label}; rename one of the modules"])
        return Value(label, REAL if isinstance(found, float) else INT, const=found)

    def call(self, caller: Expressions, node: ast.Call, target: Any, arguments: list[Value]) -> Value:
        """Return the translation of a call."""
        if target is fields.vector or target is fields.matrix:
            return caller.field_of(node, arguments[0], arguments[1])
        known = calls.known(caller, node, target, arguments)
        if known is not None:
            return known
        if isinstance(target, type) and hasattr(target, "_fields"):
            return self._construct(target, arguments)
        source = target if isinstance(target, Source) else source_of(getattr(target, "py_func", target))
        if source is None:
            raise caller.refuse(node, "this call")
        function = self.function(source, arguments)
        texts = []
        reads: frozenset[str] = frozenset()
        for parameter, argument in zip(function.parameters, arguments, strict=True):
            if not parameter.is_used:
                continue
            if parameter.is_written:
                caller.written |= argument.roots
            texts.append(calls.argument_text(parameter.value, argument))
            reads |= argument.reads
        is_pure = function.is_pure
        return Value(f"{function.name}({', '.join(texts)})", function.result, reads=reads, is_pure=is_pure)

    def _construct(self, target: Any, arguments: list[Value]) -> Value:
        """Return a new structure from the values of its members."""
        kinds = tuple((name, item.type) for name, item in zip(target._fields, arguments, strict=True))
        label = f"{snake(target.__name__)}_struct"
        kind = self.structs.setdefault(label, Struct(label, kinds))
        parts = [calls.number_as(member, item) for (_, member), item in zip(kind.fields, arguments, strict=True)]
        reads: frozenset[str] = frozenset().union(*(item.reads for item in arguments))
        return Value(f"({kind.name}){{{', '.join(parts)}}}", kind, 90, reads=reads)

    def function(self, source: Source, arguments: Sequence[Value]) -> Function:
        """Return the C function for these argument types, translated when it is asked for first.

        Args:
            source: the Python function.
            arguments: what it is called with.
        """
        key = (source, tuple(_key(argument) for argument in arguments))
        if key not in self.functions:
            self.functions[key] = self._translated(source, arguments, key)
        return self.functions[key]

    def _translated(self, source: Source, arguments: Sequence[Value], key: Any) -> Function:
        """Translate a function until the types of its variables no longer change."""
        label = f"{source.name} in {source.file}"
        names = [item.arg for item in source.tree.args.args]
        if len(names) != len(arguments):
            raise ConfigurationError([f"sgms export: {label} takes {len(names)} arguments, not {len(arguments)}"])
        parameters = [Parameter(name, _inside(name, item)) for name, item in zip(names, arguments, strict=True)]
        changed = assigned_in(source.tree.body)
        types: dict[str, Any] = {}
        result: Type = None
        while True:
            work = Statements(self, label, source.scope)
            work.types, work.returns, work.result = dict(types), [], result
            for parameter in parameters:
                if parameter.name in changed:  # the function changes its own copy
                    work.types.setdefault(parameter.name, parameter.value.type)
                else:
                    work.parameters[parameter.name] = parameter.value
            block, _leaves = work.block(source.tree.body)
            found = self._result_of(work, source.name, key)
            if work.types == types and found == result:
                break
            types, result = work.types, found
        return self._printed(source, parameters, work, without_unused(block), changed)

    def _printed(
        self, source: Source, parameters: list[Parameter], work: Statements, block: list[Statement], changed: set[str]
    ) -> Function:
        """Return the function with its text."""
        result = work.result
        mentioned: frozenset[str] = frozenset().union(*(item.reads for item in walk(block)))
        written = _closure(work.written, work.roots)
        for parameter in parameters:
            parameter.is_used = parameter.name in mentioned and not parameter.value.binds
            parameter.is_written = parameter.name in written
        copied = {parameter.name for parameter in parameters if parameter.name in changed}

        def declare(name: str, is_once: bool) -> str:
            if name in copied:
                return name
            kind = work.types[name]
            if isinstance(kind, Array):
                return f"{'' if name in written else 'const '}{kind.item.c} *{name}"
            return f"{'const ' if is_once else ''}{kind.name if isinstance(kind, Struct) else kind.c} {name}"

        def hoisted(name: str) -> str:
            kind = work.types[name]
            if name in copied:
                return f"(void){name}"
            if isinstance(kind, Scalar):
                return f"{declare(name, False)} = {'R(0.0)' if kind is REAL else '0' if kind.rank else 'false'}"
            return f"{declare(name, False)} = {'NULL' if isinstance(kind, Array) else '{0}'}"

        lines = print_block(block, declare, hoisted)
        lines = [line for line in lines if not line.strip().startswith("(void)")]
        base = source.name.strip("_")
        if base in C_NAMES:
            base = f"{base}_kernel"
        taken = {function.name for function in self.functions.values()}
        name, count = base, 1
        while name in taken:
            count += 1
            name = f"{base}_{count}"
        shown = [declaration(item) for item in parameters if item.is_used]
        kind = "void" if result is None else result.name if isinstance(result, (Struct, Record)) else _c(result)
        head = f"static {kind} {name}({', '.join(shown) or 'void'})"
        comment = f"/* {source.summary} */\n" if source.summary else ""
        is_pure = not any(item.is_written for item in parameters)
        text = comment + "\n".join([*wrapped(head), "{", *lines, "}"]) + "\n"
        return Function(name, parameters, result, text, is_pure)

    def _result_of(self, work: Statements, name: str, key: Any) -> Type:
        """Return the type of what a function returns."""
        if not work.returns:
            return None
        if work.returns[0].items is None:
            kind: Type = work.returns[0].type
            for value in work.returns[1:]:
                kind = self.unified(work, ast.Constant(0), kind, value.type)
            return kind
        columns = list(zip(*(value.items or () for value in work.returns), strict=True))
        kinds = []
        for number_, column in enumerate(columns):
            kind = column[0].type
            for value in column[1:]:
                kind = self.unified(work, ast.Constant(0), kind, value.type)
            kinds.append((f"r{number_}", kind))
        label, count = f"{name.strip('_')}_result", 1
        while self.owners.setdefault(label if count == 1 else f"{label}_{count}", key) != key:
            count += 1
        struct = Struct(label if count == 1 else f"{label}_{count}", tuple(kinds))
        self.structs[struct.name] = struct
        return struct

    def literal(self, work: Statements, value: Value) -> str:
        """Return several results as one structure."""
        kind = work.result
        if not isinstance(kind, Struct):
            return ""
        parts = [
            calls.number_as(member, item) for (_, member), item in zip(kind.fields, value.items or (), strict=True)
        ]
        return f"({kind.name}){{{', '.join(parts)}}}"

    def unified(self, work: Statements, node: ast.AST, first: Any, second: Any) -> Any:
        """Return the type of a variable that holds both."""
        if first is None or first == second:
            return second
        if isinstance(first, Scalar) and isinstance(second, Scalar):
            return max(first, second, key=lambda item: item.rank)
        are_arrays = isinstance(first, Array) and isinstance(second, Array)
        if are_arrays and first.item == second.item and len(first.shape) == len(second.shape):
            pairs = zip(first.shape, second.shape, strict=True)
            return Array(first.item, tuple(a if a == b else None for a, b in pairs))
        raise work.refuse(node, "a variable of two types")

    def local_array(self, work: Statements, target: ast.expr, node: ast.expr) -> list[Statement] | None:
        """Return the room for ``numpy.empty``, ``zeros`` or ``ones`` of a length known beforehand; None for others."""
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and isinstance(target, ast.Name)):
            return None
        owner = work.expression(node.func.value)
        if owner.const is not np or node.func.attr not in ("empty", "zeros", "ones"):
            return None
        size = work.expression(node.args[0])
        lengths = tuple(item.const for item in size.items or (size,))
        if not all(isinstance(length, int) for length in lengths):
            raise work.refuse(node, "an array whose length is not known beforehand")
        kind = Array(INT if node.keywords else REAL, lengths)
        name = target.id
        work.types[name] = kind
        work.flow[name] = Value(name, kind, reads=frozenset([name]), roots=frozenset([name]), is_stable=True)
        one = number(1) if node.keywords else number(1.0)
        fill = ", ".join([one.text] * kind.size) if node.func.attr == "ones" and kind.size else "0"
        text = f"{kind.item.c} {name}[{max(kind.size, 1)}] = {{{fill}}}"
        return [Line(text, frozenset(), name, True, is_array=True)]


C_NAMES = set(calls.MATH) | {"sgms_init", "sgms_step", "sgms_reset", "sgms_enable", "main", "abs", "signal", "index"}
"""Names that a function of this program must not have."""


def snake(name: str) -> str:
    """Return a class's name as C names: with underscores."""
    return "".join(f"_{letter.lower()}" if letter.isupper() else letter for letter in name).strip("_")


def _c(kind: Any) -> str:
    """Return the C text of a number's or pointer's type."""
    return f"{kind.item.c} *" if isinstance(kind, Array) else str(kind.c)


def declaration(parameter: Parameter) -> str:
    """Return a parameter as it stands in the head of a C function."""
    kind = parameter.value.type
    const = "" if parameter.is_written else "const "
    if isinstance(kind, Array):
        return f"{const}{kind.item.c} *{parameter.name}"
    if isinstance(kind, (Struct, Record)):
        return f"{const}{kind.name} *{parameter.name}"
    return f"{_c(kind)} {parameter.name}"


def _inside(name: str, argument: Value) -> Value:
    """Return what stands for an argument inside the function."""
    if argument.binds or argument.type is None:
        return argument
    if isinstance(argument.type, Scalar) and argument.is_known and isinstance(argument.const, bool):
        return argument
    own = frozenset([name])
    is_pointer = isinstance(argument.type, (Struct, Record))
    return Value(name, argument.type, ATOM, reads=own, roots=own, is_pointer=is_pointer, is_stable=True)


def _key(argument: Value) -> Any:
    """Return what distinguishes two translations of a function."""
    if argument.binds or argument.type is None:
        return argument.text, id(argument.const)
    if isinstance(argument.type, Scalar) and argument.is_known and isinstance(argument.const, bool):
        return argument.const
    return argument.type


def _closure(written: set[str], roots: dict[str, frozenset[str]]) -> set[str]:
    """Return all names whose memory is written: through a pointer, what it points into is written too."""
    found = set(written)
    while True:
        more = {name for pointer, names in roots.items() if pointer in found for name in names}
        if more <= found:
            return found
        found |= more


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
        raise ConfigurationError([f"sgms export: {python.__name__} is no plain function; define it with def"])
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
    """Return the definitions of named constants.

    Args:
        constants: name to value.
        float_values: what a float needs instead.
    """
    whole = [f"    {name} = {value}" for name, value in sorted(constants.items()) if isinstance(value, int)]
    lines = ["enum {", ",\n".join(whole), "};"] if whole else []
    for name, value in sorted(constants.items()):
        if isinstance(value, float) and name in float_values:
            lines.append(f"#define {name} REAL_OR({value!r}, {float_values[name]!r}f)")
        elif isinstance(value, float):
            text = real_text(value) if math.isfinite(value) else number(value).text
            lines.append(f"#define {name} {text}")
    return lines


