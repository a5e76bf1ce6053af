"""Calls of Python's own functions, of ``math`` and of a user's effects in C."""

from __future__ import annotations

import ast
import math
from typing import TYPE_CHECKING, Any

from sgms_observer.export.values import (
    BOOL,
    INT,
    LONG,
    REAL,
    UNKNOWN,
    Array,
    Record,
    Scalar,
    Struct,
    Value,
    cast,
    number,
)

if TYPE_CHECKING:
    from sgms_observer.export.expressions import Expressions

MATH = {
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "log1p", "expm1", "sqrt", "tanh", "sinh",
    "cosh", "fabs", "floor", "ceil", "hypot", "copysign", "pow", "cbrt", "fmod",
}  # fmt: skip
TESTS = {"isfinite", "isnan", "isinf"}
_MATH_NAMES = {getattr(math, name): name for name in MATH | TESTS}


def known(caller: Expressions, node: ast.Call, target: Any, arguments: list[Value]) -> Value | None:
    """Return the C of a function that C has too; None for any other.

    Args:
        caller: the function that calls.
        node: the call.
        target: the function, or its name where it is Python's own.
        arguments: what it is called with.
    """
    reads: frozenset[str] = frozenset().union(*(item.reads for item in arguments))
    texts = ", ".join(cast(item, REAL).text for item in arguments if isinstance(item.type, Scalar))
    name = _MATH_NAMES.get(target) if callable(target) else None
    if name is not None:
        if name in TESTS:
            return Value(f"{name}({texts})", BOOL, reads=reads)
        return Value(f"real_{name}({texts})", REAL, reads=reads)
    if not isinstance(target, str):
        return None
    value = arguments[0]
    if target == "len" and isinstance(value.type, Array) and value.type.shape[0] is not None:
        return number(value.type.shape[0])
    if not isinstance(value.type, Scalar):
        raise caller.refuse(node, "this call")
    const: Any = value.const if value.is_known else UNKNOWN
    if target == "float":
        return cast(value, REAL)
    if target == "int":
        if const is not UNKNOWN:
            return number(int(const))
        return value if value.type in (INT, LONG) else cast(value, INT)
    if target == "bool":
        return value
    if target == "abs":
        if value.type is REAL:
            return Value(f"real_fabs({value.text})", REAL, reads=reads)
        return number(abs(const)) if const is not UNKNOWN else Value(f"abs({value.text})", value.type, reads=reads)
    if target in ("min", "max") and len(arguments) > 2:
        rest = known(caller, node, target, arguments[:-1])
        assert rest is not None
        return known(caller, node, target, [rest, arguments[-1]])
    if target in ("min", "max") and len(arguments) == 2:
        if all(item.is_known for item in arguments):
            return number((min if target == "min" else max)(item.const for item in arguments))
        if all(item.type is INT for item in arguments):
            return Value(f"int_{target}({arguments[0].text}, {arguments[1].text})", INT, reads=reads)
        return Value(f"real_{target}({texts})", REAL, reads=reads)
    raise caller.refuse(node, "this call")


def argument_text(wanted: Value, argument: Value) -> str:
    """Return an argument as a C function takes it.

    Args:
        wanted: the parameter.
        argument: what is handed over.
    """
    if isinstance(argument.type, (Struct, Record)):
        return argument.text if argument.is_pointer else f"&{argument.inside(100)}"
    return number_as(wanted.type, argument)


def number_as(kind: Any, value: Value) -> str:
    """Return a value's text, as another number where that is wanted.

    Args:
        kind: the wanted type.
        value: the value.
    """
    if isinstance(kind, Scalar):
        return cast(value, kind).text
    return f"*{value.text}" if isinstance(kind, Struct) and value.is_pointer else value.text
