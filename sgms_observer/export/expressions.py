"""Python expressions and calls as C expressions: the strict subset in which the kernels are written."""

from __future__ import annotations

import ast
import math
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from sgms_observer.estimators import memory
from sgms_observer.export.program import Source, snake, source_of
from sgms_observer.export.values import (
    ATOM,
    BOOL,
    INT,
    LONG,
    NONE,
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
from sgms_observer.export.views import Views

ARITHMETIC = {ast.Add: ("+", 70), ast.Sub: ("-", 70), ast.Mult: ("*", 80), ast.Div: ("/", 80)}
COMPARISONS = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
_COMPUTE: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: lambda a, b: a + b,
    ast.Sub: lambda a, b: a - b,
    ast.Mult: lambda a, b: a * b,
    ast.Div: lambda a, b: a / b if b else math.nan,
    ast.FloorDiv: lambda a, b: a // b,
    ast.Mod: lambda a, b: a % b,
    ast.Pow: lambda a, b: a**b,
    ast.Lt: lambda a, b: a < b,
    ast.LtE: lambda a, b: a <= b,
    ast.Gt: lambda a, b: a > b,
    ast.GtE: lambda a, b: a >= b,
    ast.Eq: lambda a, b: a == b,
    ast.NotEq: lambda a, b: a != b,
}

MATH = {
    "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "log1p", "expm1", "sqrt", "tanh", "sinh",
    "cosh", "fabs", "floor", "ceil", "hypot", "copysign", "pow", "cbrt", "fmod",
}  # fmt: skip
TESTS = {"isfinite", "isnan", "isinf"}


def reads_of(values: Sequence[Value]) -> frozenset[str]:
    """Return the local names that any of these values has in it."""
    return frozenset().union(*(value.reads for value in values))


_MATH_NAMES = {getattr(math, name): name for name in MATH | TESTS}


class Expressions(Views):
    """Translates the expressions of one function."""

    def _constant(self, node: ast.Constant) -> Value:
        if node.value is None:
            return NONE
        if not isinstance(node.value, (bool, int, float)):
            raise self.refuse(node, "this constant")
        return number(node.value)

    def _name(self, node: ast.Name) -> Value:
        name = node.id
        if name in self.flow:
            return self.flow[name]
        if name in self.parameters:
            return self.parameters[name]
        if name in self.types:
            kind = self.types[name]
            is_struct = isinstance(kind, Struct)
            return Value(name, kind, reads=frozenset([name]), roots=self.roots.get(name, frozenset([name])),
                         is_stable=not isinstance(kind, Array) and not is_struct)  # fmt: skip
        if name in self.scope:
            return self.program.named(name, self.scope[name], self.scope)
        if name in ("abs", "min", "max", "float", "int", "bool", "len"):
            return Value(name, None, const=name)
        raise self.refuse(node, f"the name {name}")

    def _attribute(self, node: ast.Attribute) -> Value:
        owner = self.expression(node.value)
        if isinstance(owner.const, ModuleType):
            if owner.const is math and node.attr in ("pi", "inf", "nan", "e"):
                if node.attr == "pi":
                    return Value("REAL_PI", REAL, const=math.pi)
                return number(getattr(math, node.attr))
            found = getattr(owner.const, node.attr, UNKNOWN)
            if found is UNKNOWN:
                raise self.refuse(node, "an unknown name")
            return self.program.named(node.attr, found, vars(owner.const))
        if isinstance(owner.type, Array) and node.attr == "shape":
            return Value("", None, items=tuple(self._length(node, length) for length in owner.type.shape))
        if isinstance(owner.type, Struct):
            if node.attr in owner.type.bound:
                return owner.type.bound[node.attr]
            for name, kind in owner.type.fields:
                if name == node.attr:
                    text = f"{owner.text}{'->' if owner.is_pointer else '.'}{name}"
                    return Value(text, kind, reads=owner.reads, roots=owner.roots, is_stable=isinstance(kind, Array))
        raise self.refuse(node, f"the attribute {node.attr}")

    def _length(self, node: ast.AST, length: int | None) -> Value:
        if length is None:
            raise self.refuse(node, "an array whose length is not known beforehand")
        return number(length)

    def _tuple(self, node: ast.Tuple) -> Value:
        items = tuple(self.expression(item) for item in node.elts)
        return Value("", None, items=items, reads=reads_of(items))

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        value = self.expression(node.operand)
        if isinstance(node.op, ast.Not):
            const = UNKNOWN if not value.is_known else not value.const
            if const is not UNKNOWN:
                return number(bool(const))
            return Value(f"!{value.inside(90)}", BOOL, 90, reads=value.reads)
        if isinstance(node.op, ast.USub):
            if value.is_known and value.precedence == ATOM and value.text.lstrip("-").replace(".", "").isdigit():
                return number(-value.const)
            const = -value.const if value.is_known else UNKNOWN
            return Value(f"-{value.inside(91)}", value.type, 90, const, reads=value.reads)
        raise self.refuse(node, "this operator")

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.expression(node.left), self.expression(node.right)
        return self.combine(node, node.op, left, right)

    def combine(self, node: ast.AST, operator: ast.operator, left: Value, right: Value) -> Value:
        """Return the C of ``left operator right``."""
        if not isinstance(left.type, Scalar) or not isinstance(right.type, Scalar):
            raise self.refuse(node, "arithmetic with whole arrays")
        reads = left.reads | right.reads
        kind = max(left.type, right.type, INT, key=lambda item: item.rank)
        is_division = isinstance(operator, ast.Div)
        if is_division:
            kind = REAL
        const: Any = UNKNOWN
        if left.is_known and right.is_known and type(operator) in _COMPUTE:
            const = _COMPUTE[type(operator)](left.const, right.const)
            if kind is not REAL:
                return number(int(const))
        a, b = cast(left, kind), cast(right, kind)
        if type(operator) in ARITHMETIC:
            sign, rank = ARITHMETIC[type(operator)]
            return Value(f"{a.inside(rank)} {sign} {b.inside(rank + 1)}", kind, rank, const, reads=reads)
        if isinstance(operator, (ast.FloorDiv, ast.Mod)) and kind is not REAL:
            name = "floor_divide" if isinstance(operator, ast.FloorDiv) else "floor_remainder"
            text = f"{name}({left.text}, {right.text})"
            result: Value = Value(text, LONG, const=const, reads=reads)
            return result if kind is LONG else Value(f"(int){text}", INT, 90, const, reads=reads)
        if isinstance(operator, ast.Pow):
            a, b = cast(left, REAL), cast(right, REAL)
            return Value(f"real_pow({a.text}, {b.text})", REAL, const=const, reads=reads)
        raise self.refuse(node, "this operator")

    def _boolop(self, node: ast.BoolOp) -> Value:
        is_and = isinstance(node.op, ast.And)
        operands = []
        for operand in node.values:
            value = self.expression(operand)
            if value.is_known:
                if bool(value.const) != is_and:
                    return number(not is_and)
                continue
            operands.append(value)
        if not operands:
            return number(is_and)
        if len(operands) == 1:
            return operands[0]
        sign, rank = ("&&", 40) if is_and else ("||", 30)
        # both signs in one line want parentheses from some compilers
        text = f" {sign} ".join(value.inside(41) for value in operands)
        return Value(text, BOOL, rank, reads=reads_of(operands))

    def _compare(self, node: ast.Compare) -> Value:
        if isinstance(node.ops[0], (ast.Is, ast.IsNot)):
            left = self.expression(node.left)
            return number((left.type is None and left.const is None) == isinstance(node.ops[0], ast.Is))
        if isinstance(node.ops[0], ast.In) and isinstance(node.comparators[0], ast.Tuple):
            choices = node.comparators[0].elts
            parts: list[ast.expr] = [ast.Compare(node.left, [ast.Eq()], [choice]) for choice in choices]
            return self.expression(ast.copy_location(ast.BoolOp(ast.Or(), parts), node))
        values = [self.expression(item) for item in (node.left, *node.comparators)]
        texts = []
        for left, operator, right in zip(values, node.ops, values[1:], strict=False):
            if type(operator) not in COMPARISONS or not isinstance(left.type, Scalar):
                raise self.refuse(node, "this comparison")
            if left.is_known and right.is_known:
                if not _COMPUTE[type(operator)](left.const, right.const):
                    return number(False)
                continue
            texts.append(self._comparison(left, COMPARISONS[type(operator)], right))
        if not texts:
            return number(True)
        return Value(" && ".join(texts), BOOL, 60 if len(texts) == 1 else 40, reads=reads_of(values))

    def _comparison(self, left: Value, sign: str, right: Value) -> str:
        """Return one comparison of two numbers; a counter is compared with a whole number as an integer."""
        assert isinstance(left.type, Scalar) and isinstance(right.type, Scalar)
        kind = max(left.type, right.type, key=lambda item: item.rank)
        for one, other in ((left, right), (right, left)):
            if one.is_known and isinstance(one.const, float) and one.const.is_integer() and other.type in (INT, LONG):
                kind = other.type
        return f"{cast(left, kind).inside(61)} {sign} {cast(right, kind).inside(61)}"

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.expression(node.test)
        if test.is_known:
            return self.expression(node.body if test.const else node.orelse)
        yes, no = self.expression(node.body), self.expression(node.orelse)
        if not isinstance(yes.type, Scalar) or not isinstance(no.type, Scalar):
            raise self.refuse(node, "a choice between arrays")
        kind = max(yes.type, no.type, key=lambda item: item.rank)
        text = f"{test.inside(21)} ? {cast(yes, kind).inside(21)} : {cast(no, kind).inside(21)}"
        return Value(text, kind, 20, reads=reads_of((test, yes, no)))

    def _call(self, node: ast.Call) -> Value:
        target = self.expression(node.func).const
        if node.keywords:
            raise self.refuse(node, "an argument by name")
        arguments = [self.expression(item) for item in node.args]
        if target is memory.vector or target is memory.matrix:
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
