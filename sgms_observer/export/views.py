"""What is known inside one function, and its arrays as C: pointers whose lengths are known to the translator."""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.export.program import Program
from sgms_observer.export.values import (
    ATOM,
    FIELD_OFFSET,
    INT,
    REAL,
    UNKNOWN,
    Array,
    Record,
    Struct,
    Value,
    cast,
    number,
)


class Views:
    """Translates the entries, rows, slices and members that one function reaches.

    Args:
        program: what is translated all together.
        label: the function and its file, for refusals.
        scope: the function's global names.
    """

    def __init__(self, program: Program, label: str, scope: dict[str, Any]) -> None:
        self.program = program
        self.label = label
        self.scope = scope
        self.flow: dict[str, Value] = {}
        self.types: dict[str, Any] = {}
        self.parameters: dict[str, Value] = {}
        self.written: set[str] = set()
        self.roots: dict[str, frozenset[str]] = {}

    def refuse(self, node: ast.AST, what: str) -> ConfigurationError:
        """Return the error for what has no translation."""
        return ConfigurationError(
            [
                f"sgms export cannot write {what} in C ({self.label}, line {getattr(node, 'lineno', 0)}: "
                f"{ast.unparse(node)[:80]}); write it with arithmetic, math functions, if, and for over range"
            ]
        )

    def expression(self, node: ast.expr) -> Value:
        """Return the translation of an expression."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(node, f"a {type(node).__name__}")
        value: Value = method(node)
        return value

    def whole(self, node: ast.expr) -> int:
        """Return a whole number that the translator has to know."""
        value = self.expression(node)
        if not value.is_known:
            raise self.refuse(node, "an index that is not known beforehand")
        return int(value.const)

    def _subscript(self, node: ast.Subscript) -> Value:
        owner = self.expression(node.value)
        index = node.slice
        if owner.items is not None:
            return owner.items[self.whole(index)]
        if isinstance(owner.type, Struct):
            name, kind = owner.type.fields[self.whole(index)]
            text = f"{owner.inside(ATOM)}{'->' if owner.is_pointer else '.'}{name}"
            return Value(text, kind, reads=owner.reads, roots=owner.roots, is_pure=owner.is_pure)
        if isinstance(owner.type, Record):
            return self._of_record(node, owner, index)
        if isinstance(owner.type, Array):
            return self._of_array(node, owner, index)
        raise self.refuse(node, "this index")

    def _of_record(self, node: ast.Subscript, owner: Value, index: ast.expr) -> Value:
        """Return a member of a record, a part of its tail, or a constant that belongs to it."""
        record = owner.type
        assert isinstance(record, Record)
        if not isinstance(index, ast.Slice):
            place = self.expression(index)
            if place.is_known and int(place.const) in record.constants:
                return record.constants[int(place.const)]
            if place.is_known and int(place.const) in record.entries:
                name, kind = record.entries[int(place.const)]
                record.used.add(name)
                return Value(f"{owner.text}->{name}", kind, reads=owner.reads, roots=owner.roots)
        if record.tail is None:
            raise self.refuse(node, "an index without a member")
        record.used.add("at")
        whole = Value(f"{owner.text}->at", Array(REAL, record.tail), reads=owner.reads, roots=owner.roots,
                      is_stable=True)  # fmt: skip
        return self._of_array(node, whole, index)

    def field_of(self, node: ast.AST, owner: Value, index: Value) -> Value:
        """Return a field of a record (``estimators.memory``)."""
        record = owner.type
        if not isinstance(record, Record) or not index.is_known:
            raise self.refuse(node, "a field that is not known beforehand")
        place = int(index.const)
        if place + FIELD_OFFSET in record.constants:
            return record.constants[place + FIELD_OFFSET]
        name, kind = record.fields[place]
        record.used.add(name)
        return Value(f"{owner.text}->{name}", kind, reads=owner.reads, roots=owner.roots, is_stable=True)

    def _of_array(self, node: ast.Subscript, owner: Value, index: ast.expr) -> Value:
        """Return an entry, a row or a slice of an array."""
        kind = owner.type
        assert isinstance(kind, Array)
        first, *others = index.elts if isinstance(index, ast.Tuple) else [index]
        if len(kind.shape) > 2 or (len(kind.shape) == 1 and others):
            raise self.refuse(node, "an array of more than two dimensions")
        if isinstance(first, ast.Slice):
            if others:
                raise self.refuse(node, "a slice of columns")
            return self._slice(node, owner, first)
        place = self._place(first)
        if len(kind.shape) == 1:
            return _at(owner, place)
        columns = kind.shape[1]
        if columns is None:
            raise self.refuse(node, "an array of more than two dimensions")
        if others and not isinstance(others[0], ast.Slice):
            return _at(owner, _in_table(place, columns, self._place(others[0])))
        row = _row(owner, place, columns)
        return self._slice(node, row, others[0]) if others and isinstance(others[0], ast.Slice) else row

    def _place(self, node: ast.expr) -> Value:
        """Return an index as an integer."""
        return cast(self.expression(node), INT)

    def _slice(self, node: ast.Subscript, owner: Value, part: ast.Slice) -> Value:
        """Return some entries (of one dimension) or some rows (of two) that follow each other."""
        kind = owner.type
        assert isinstance(kind, Array)
        if part.step is not None:
            raise self.refuse(node, "a slice with a step")
        lower = self._place(part.lower) if part.lower is not None else number(0)
        upper = self._place(part.upper) if part.upper is not None else None
        length: int | None = None
        if upper is None:
            if lower.is_known and kind.shape[0] is not None:
                length = kind.shape[0] - int(lower.const)
        elif lower.is_known and upper.is_known:
            length = int(upper.const) - int(lower.const)
        elif isinstance(part.upper, ast.BinOp) and isinstance(part.upper.op, ast.Add) and part.lower is not None:
            more = self.expression(part.upper.right)
            if ast.dump(part.upper.left) == ast.dump(part.lower) and more.is_known:
                length = int(more.const)
        columns = kind.shape[1] if len(kind.shape) == 2 else 1
        assert columns is not None
        data = None
        if owner.data is not None and lower.is_known and length is not None:
            data = owner.data[int(lower.const) : int(lower.const) + length]
        return replace(
            owner,
            text=_sum(owner.inside(70), _times(lower, columns)),
            type=Array(kind.item, (length, *kind.shape[1:])),
            precedence=owner.precedence if lower.is_known and lower.const == 0 else 70,
            data=data,
            binds=False,
            reads=owner.reads | lower.reads,
            is_stable=owner.is_stable and lower.is_known,
        )


def _sum(base: str, offset: Value) -> str:
    """Return a pointer moved on by some entries."""
    return base if offset.is_known and offset.const == 0 else f"{base} + {offset.inside(71)}"


def _times(offset: Value, columns: int) -> Value:
    """Return an offset in rows as one in entries."""
    if offset.is_known:
        return number(int(offset.const) * columns)
    return Value(f"{offset.inside(80)} * {columns}", INT, 80, reads=offset.reads) if columns != 1 else offset


def _in_table(row: Value, columns: int, column: Value) -> Value:
    """Return the place of an entry in the memory of an array of two dimensions."""
    start = _times(row, columns)
    if start.is_known and column.is_known:
        return number(int(start.const) + int(column.const))
    if start.is_known and start.const == 0:
        return column
    return Value(f"{start.inside(70)} + {column.inside(71)}", INT, 70, reads=start.reads | column.reads)


def _row(owner: Value, row: Value, columns: int) -> Value:
    """Return one row of an array of two dimensions."""
    assert isinstance(owner.type, Array)
    return replace(
        owner,
        text=_sum(owner.inside(70), _times(row, columns)),
        type=Array(owner.type.item, (columns,)),
        precedence=ATOM if row.is_known and row.const == 0 else 70,
        data=None if owner.data is None or not row.is_known else owner.data[int(row.const)],
        binds=False,
        reads=owner.reads | row.reads,
        is_stable=owner.is_stable and row.is_known,
    )


def _at(owner: Value, place: Value) -> Value:
    """Return one entry by its place in the memory."""
    assert isinstance(owner.type, Array)
    const: Any = UNKNOWN
    if owner.data is not None and place.is_known:
        const = owner.data.ravel()[int(place.const)].item()
    text = f"{owner.inside(ATOM)}[{place.text}]"
    if owner.selects and const is not UNKNOWN:
        return number(const)
    return Value(text, owner.type.item, const=const, reads=owner.reads | place.reads, roots=owner.roots)
