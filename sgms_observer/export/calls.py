"""Calls as C: of Python's own functions, of ``math``, of a structure, and of a function that is translated too."""

from __future__ import annotations

import ast
import math
from typing import Any

from sgms_observer.estimators import fields
from sgms_observer.export.expressions import Expressions, reads_of
from sgms_observer.export.program import Source, snake, source_of
from sgms_observer.export.values import (
    BOOL,
    INT,
    LONG,
    REAL,
    UNKNOWN,
    Array,
    Scalar,
    Struct,
    Value,
    argument_text,
    cast,
    number,
    number_as,
)

MATH = {
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "log1p", "expm1", "sqrt", "tanh", "sinh",
    "cosh", "fabs", "floor", "ceil", "hypot", "copysign", "pow", "cbrt", "fmod",
}  # fmt: skip
TESTS = {"isfinite", "isnan", "isinf"}
_MATH_NAMES = {getattr(math, name): name for name in MATH | TESTS}


class Calls(Expressions):
    """Translates the expressions of one function."""

    def _call(self, node: ast.Call) -> Value:
        target = self.expression(node.func).const
        if node.keywords:
            raise self.refuse(node, "an argument by name")
        arguments = [self.expression(item) for item in node.args]
        if target is fields.vector or target is fields.matrix:
            return self.field_of(node, arguments[0], arguments[1])
        known = self._known(node, target, arguments)
        if known is not None:
            return known
        if isinstance(target, type) and hasattr(target, "_fields"):
            return self._construct(target, arguments)
        source = target if isinstance(target, Source) else source_of(getattr(target, "py_func", target))
        if source is None:
            raise self.refuse(node, "this call")
        return self._translated(source, arguments)

    def _translated(self, source: Source, arguments: list[Value]) -> Value:
        """Return the call of a function that is translated too."""
        function = self.program.function(source, arguments)
        texts = []
        reads: frozenset[str] = frozenset()
        for parameter, argument in zip(function.parameters, arguments, strict=True):
            if not parameter.is_used:
                continue
            if parameter.is_written:
                self.written |= argument.roots
            texts.append(argument_text(parameter.value, argument))
            reads |= argument.reads
        is_pure = function.is_pure
        return Value(f"{function.name}({', '.join(texts)})", function.result, reads=reads, is_pure=is_pure)

    def _construct(self, target: Any, arguments: list[Value]) -> Value:
        """Return a new structure from the values of its members."""
        kinds = tuple((name, item.type) for name, item in zip(target._fields, arguments, strict=True))
        label = f"{snake(target.__name__)}_struct"
        kind = self.program.structs.setdefault(label, Struct(label, kinds))
        parts = [number_as(member, item) for (_, member), item in zip(kind.fields, arguments, strict=True)]
        return Value(f"({kind.name}){{{', '.join(parts)}}}", kind, 90, reads=reads_of(arguments))

    def _known(self, node: ast.Call, target: Any, arguments: list[Value]) -> Value | None:
        """Return the C of a function that C has too; None for any other."""
        reads = reads_of(arguments)
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
            raise self.refuse(node, "this call")
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
            rest = self._known(node, target, arguments[:-1])
            assert rest is not None
            return self._known(node, target, [rest, arguments[-1]])
        if target in ("min", "max") and len(arguments) == 2:
            if all(item.is_known for item in arguments):
                return number((min if target == "min" else max)(item.const for item in arguments))
            if all(item.type is INT for item in arguments):
                return Value(f"int_{target}({arguments[0].text}, {arguments[1].text})", INT, reads=reads)
            return Value(f"real_{target}({texts})", REAL, reads=reads)
        raise self.refuse(node, "this call")
