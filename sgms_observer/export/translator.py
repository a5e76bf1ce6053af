"""Translates the kernels to C: each function once for every set of argument types that it is called with."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgms_observer import __version__
from sgms_observer.errors import ConfigurationError
from sgms_observer.export.expressions import MATH
from sgms_observer.export.lines import Statement, print_block, walk, without_unused, wrapped
from sgms_observer.export.program import Function, Parameter, Program, Source, constant_lines
from sgms_observer.export.statements import Statements, assigned_in
from sgms_observer.export.values import ATOM, REAL, Array, Record, Scalar, Struct, Type, Value

_ENVIRONMENT = Environment(
    loader=FileSystemLoader(Path(__file__).with_name("templates")),
    undefined=StrictUndefined,
    keep_trailing_newline=True,
    trim_blocks=False,
)

HELPERS = {
    "floor_divide": """/* Quotient rounded down, as in Python. */
static int64_t floor_divide(int64_t a, int64_t b)
{
    return a / b - (a % b != 0 && (a % b < 0) != (b < 0) ? 1 : 0);
}
""",
    "floor_remainder": """/* Remainder with the sign of the divisor, as in Python. */
static int64_t floor_remainder(int64_t a, int64_t b)
{
    const int64_t rest = a % b;
    return rest != 0 && (rest < 0) != (b < 0) ? rest + b : rest;
}
""",
    "real_min": """/* The smaller number; the first one where either is not a number. */
static real real_min(real a, real b)
{
    return b < a ? b : a;
}
""",
    "real_max": """/* The larger number; the first one where either is not a number. */
static real real_max(real a, real b)
{
    return b > a ? b : a;
}
""",
    "int_min": """/* The smaller number. */
static int int_min(int a, int b)
{
    return b < a ? b : a;
}
""",
    "int_max": """/* The larger number. */
static int int_max(int a, int b)
{
    return b > a ? b : a;
}
""",
}

C_NAMES = set(MATH) | {
    "sgms_init", "sgms_step", "sgms_reset", "sgms_enable", "sgms_set_gain", "main", "abs", "signal", "index",
}  # fmt: skip
"""Names that a function of this program must not have."""


def names_in(text: str) -> set[str]:
    """Return every name and number of a C text."""
    return set(re.findall(r"\w+", text))


def functions_text(program: Program, calls: Sequence[str]) -> str:
    """Return the translated functions that the calls need, each before those that call it."""
    needed = names_in("\n".join(calls))
    texts: list[str] = []
    for function in reversed(list(program.functions.values())):
        if function.name in needed:
            texts.append(function.text)
            needed |= names_in(function.text)
    return "\n".join(reversed(texts))


def body_text(program: Program, functions: str, constants: Sequence[str], wanted: str) -> str:
    """Return everything between the top of the file and its interface.

    Args:
        program: after the translation.
        functions: from ``functions_text``.
        constants: definitions of constant arrays.
        wanted: text that names the constant arrays to keep.
    """
    used, wanted_names = names_in(functions), names_in(wanted)
    helpers = [text for name, text in HELPERS.items() if name in used]
    macros = [f"#define real_{name} REAL_FUNCTION({name})" for name in sorted(MATH) if f"real_{name}" in used]
    named = {name: value for name, value in program.constants.items() if name in used}
    structs = [struct_text(item) for item in program.structs.values() if item.name in used]
    tables = [text for text in constants if text.split("[")[0].split()[-1] in wanted_names]
    parts = ["\n".join(macros), "\n".join(constant_lines(named, program.float_values)), *tables, *structs, *helpers]
    return "\n\n".join(part for part in parts if part) + "\n\n" + functions


def struct_text(struct: Struct) -> str:
    """Return the definition of a structure."""
    lines = []
    for name, kind in struct.fields:
        if isinstance(kind, Array):
            lines.append(f"    {kind.item.c} {name}[{max(kind.size, 1)}];")
        else:
            lines.append(f"    {kind.c if isinstance(kind, Scalar) else kind.name} {name};")
    return "typedef struct {\n" + "\n".join(lines) + f"\n}} {struct.name};"


def fill(template: str, **values: Any) -> str:
    """Return a template with its values.

    Args:
        template: name of the file below ``templates`` without ``.j2``.
        values: what it asks for.
    """
    return _ENVIRONMENT.get_template(f"{template}.j2").render(version=__version__, **values)


class Translator(Program):
    """A C program that grows by each function that is asked for."""

    def function(self, source: Source, arguments: Sequence[Value]) -> Function:
        """Return the C function: see ``Program.function``."""
        key = (source, tuple(_key(argument) for argument in arguments))
        if key not in self.functions:
            self.functions[key] = self._translated(source, arguments, key)
        return self.functions[key]

    def _translated(self, source: Source, arguments: Sequence[Value], key: Any) -> Function:
        """Translate a function until the types of its variables no longer change."""
        label = f"{source.name} in {source.file}"
        names = [item.arg for item in source.tree.args.args]
        if len(names) != len(arguments):
            raise ConfigurationError(
                [
                    f"sgms export cannot write {label} in C: it takes {len(names)} arguments and the call gives"
                    f" {len(arguments)}; correct the call"
                ]
            )
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
        used_names = {function.name for function in self.functions.values()}
        name, count = base, 1
        while name in used_names:
            count += 1
            name = f"{base}_{count}"
        shown = [_declaration(item) for item in parameters if item.is_used]
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
                kind = work.unified(ast.Constant(0), kind, value.type)
            return kind
        columns = list(zip(*(value.items or () for value in work.returns), strict=True))
        kinds = []
        for number_, column in enumerate(columns):
            kind = column[0].type
            for value in column[1:]:
                kind = work.unified(ast.Constant(0), kind, value.type)
            kinds.append((f"r{number_}", kind))
        label, count = f"{name.strip('_')}_result", 1
        while self.owners.setdefault(label if count == 1 else f"{label}_{count}", key) != key:
            count += 1
        struct = Struct(label if count == 1 else f"{label}_{count}", tuple(kinds))
        self.structs[struct.name] = struct
        return struct


def _c(kind: Any) -> str:
    """Return the C text of a number's or pointer's type."""
    return f"{kind.item.c} *" if isinstance(kind, Array) else str(kind.c)


def _declaration(parameter: Parameter) -> str:
    """Return a parameter as it stands in the head of a C function."""
    kind = parameter.value.type
    const = "" if parameter.is_written else "const "
    if isinstance(kind, Array):
        return f"{const}{kind.item.c} *{parameter.name}"
    if isinstance(kind, (Struct, Record)):
        return f"{const}{kind.name} *{parameter.name}"
    return f"{_c(kind)} {parameter.name}"


def _inside(name: str, argument: Value) -> Value:
    """Return the value of an argument inside the function."""
    if argument.binds or argument.type is None:
        return argument
    if isinstance(argument.type, Scalar) and argument.is_known and isinstance(argument.const, bool):
        return argument
    reads_name = frozenset([name])
    is_pointer = isinstance(argument.type, (Struct, Record))
    return Value(name, argument.type, ATOM, reads=reads_name, roots=reads_name, is_pointer=is_pointer, is_stable=True)


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
