"""Parts of a C file around the translated functions, in an order that compiles, and the templates that take them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sgms_observer import __version__
from sgms_observer.export.calls import MATH
from sgms_observer.export.program import Program, constant_lines
from sgms_observer.export.values import Array, Scalar, Struct

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


def names_in(text: str) -> set[str]:
    """Return every name and number of a C text."""
    return set(re.findall(r"\w+", text))


def functions_text(program: Program, calls: Sequence[str]) -> str:
    """Return the translated functions that the calls need, each before those that call it."""
    needed = names_in("\n".join(calls))
    kept: list[str] = []
    for function in reversed(list(program.functions.values())):
        if function.name in needed:
            kept.append(function.text)
            needed |= names_in(function.text)
    return "\n".join(reversed(kept))


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
