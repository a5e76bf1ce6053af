"""Entries, rows and slices of arrays as C: an array is a pointer, its lengths are known to the translator."""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sgms_observer.export.values import ATOM, INT, UNKNOWN, Array, Value, cast, number

if TYPE_CHECKING:
    from sgms_observer.export.expressions import Expressions


def _sum(base: str, offset: Value) -> str:
    """Return a pointer moved on by some entries."""
    return base if offset.is_known and offset.const == 0 else f"{base} + {offset.inside(71)}"


def _times(offset: Value, columns: int) -> Value:
    """Return an offset in rows as one in entries."""
    if offset.is_known:
        return number(int(offset.const) * columns)
    return Value(f"{offset.inside(80)} * {columns}", INT, 80, reads=offset.reads) if columns != 1 else offset


def of_array(self: Expressions, node: ast.Subscript, owner: Value, index: ast.expr) -> Value:
    """Return an entry, a row or a slice of an array.

    Args:
        self: of the function.
        node: the whole expression, for refusals.
        owner: the array.
        index: what stands in the brackets.
    """
    kind = owner.type
    assert isinstance(kind, Array)
    parts = list(index.elts) if isinstance(index, ast.Tuple) else [index]
    if len(kind.shape) == 1 and len(parts) == 1:
        return _slice(self, node, owner, parts[0]) if isinstance(parts[0], ast.Slice) else _entry(self, owner, parts[0])
    columns = kind.shape[1] if len(kind.shape) == 2 else None
    if columns is None:
        raise self.refuse(node, "an array of more than two dimensions")
    if isinstance(parts[0], ast.Slice):
        if len(parts) > 1:
            raise self.refuse(node, "a slice of columns")
        return _slice(self, node, owner, parts[0])
    row = _place(self, parts[0])
    if len(parts) == 2 and not isinstance(parts[1], ast.Slice):
        column = _place(self, parts[1])
        start = _times(row, columns)
        if start.is_known and column.is_known:
            place = number(int(start.const) + int(column.const))
        elif start.is_known and start.const == 0:
            place = column
        else:
            place = Value(f"{start.inside(70)} + {column.inside(71)}", INT, 70, reads=start.reads | column.reads)
        return _at(owner, place)
    line = replace(
        owner,
        text=_sum(owner.inside(70), _times(row, columns)),
        type=Array(kind.item, (columns,)),
        precedence=ATOM if row.is_known and row.const == 0 else 70,
        data=None if owner.data is None or not row.is_known else owner.data[int(row.const)],
        binds=False,
        reads=owner.reads | row.reads,
        is_stable=owner.is_stable and row.is_known,
    )
    if len(parts) == 1:
        return line
    assert isinstance(parts[1], ast.Slice)
    return _slice(self, node, line, parts[1])


def _place(self: Expressions, node: ast.expr) -> Value:
    """Return an index as an integer."""
    return cast(self.expression(node), INT)


def _entry(self: Expressions, owner: Value, index: ast.expr) -> Value:
    """Return one entry of an array of one dimension."""
    return _at(owner, _place(self, index))


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


def _slice(self: Expressions, node: ast.Subscript, owner: Value, part: ast.Slice) -> Value:
    """Return some entries (of one dimension) or some rows (of two) that follow each other."""
    kind = owner.type
    assert isinstance(kind, Array)
    if part.step is not None:
        raise self.refuse(node, "a slice with a step")
    lower = _place(self, part.lower) if part.lower is not None else number(0)
    upper = _place(self, part.upper) if part.upper is not None else None
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
