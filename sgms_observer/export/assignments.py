"""Assignments of Python as C statements, with what is known of each variable along the way."""

from __future__ import annotations

import ast
from typing import Any

import numpy as np

from sgms_observer.export.calls import Calls
from sgms_observer.export.lines import Line, Loop, Statement
from sgms_observer.export.values import ATOM, INT, REAL, Array, Record, Scalar, Struct, Value, cast, number


class Assignments(Calls):
    """Translates the assignments of one function."""

    temporaries: int = 0

    def _do_annassign(self, node: ast.AnnAssign) -> tuple[list[Statement], bool]:
        if node.value is None:
            return [], False
        return self._assign([node.target], node.value), False

    def _do_assign(self, node: ast.Assign) -> tuple[list[Statement], bool]:
        return self._assign(node.targets, node.value), False

    def _assign(self, targets: list[ast.expr], value_node: ast.expr) -> list[Statement]:
        """Return the assignment of one expression to one or more targets."""
        local = self._local_array(targets[0], value_node)
        if local is not None:
            return local
        value = self.expression(value_node)
        done: list[Statement] = []
        for target in reversed(targets):
            if isinstance(target, ast.Tuple):
                done.extend(self._unpack(target, value))
            else:
                done.extend(self._store(target, value))
        return done

    def _unpack(self, target: ast.Tuple, value: Value) -> list[Statement]:
        """Return the assignment of several values at once."""
        done: list[Statement] = []
        if value.items is None:
            if not isinstance(value.type, Struct):
                raise self.refuse(target, "this unpacking")
            done, items = self._received(value)
        else:
            items = list(value.items)
            names = {node.id for node in ast.walk(target) if isinstance(node, ast.Name)}
            for number_, item in enumerate(items):
                if item.reads & names and number_ > 0:
                    self.temporaries += 1
                    name = f"new_{self.temporaries}"
                    self.types[name] = item.type
                    done.append(Line(item.text, item.reads, name, item.is_pure))
                    items[number_] = Value(name, item.type, reads=frozenset([name]))
        for part, item in zip(target.elts, items, strict=True):
            done.extend(self._store(part, item))
        return done

    def _store(self, target: ast.expr, value: Value) -> list[Statement]:
        """Return the assignment of one value to a name, an entry or a whole slice."""
        if isinstance(target, ast.Name):
            return self._store_name(target, value)
        if not isinstance(target, ast.Subscript):
            raise self.refuse(target, "this assignment")
        place = self.expression(_read(target))
        self.written |= place.roots
        if isinstance(place.type, Array):
            return self._store_all(target, place, value)
        assert isinstance(place.type, Scalar)
        return [Line(f"{place.text} = {cast(value, place.type).text}", place.reads | value.reads)]

    def _store_all(self, target: ast.expr, place: Value, value: Value) -> list[Statement]:
        """Return a loop that writes every entry of a slice."""
        assert isinstance(place.type, Array)
        if None in place.type.shape:
            raise self.refuse(target, "an array whose length is not known beforehand")
        source = value.text if isinstance(value.type, Scalar) else f"{value.inside(100)}[n]"
        if isinstance(value.type, Scalar):
            source = cast(value, place.type.item).text
        line = Line(f"{place.inside(100)}[n] = {source}", place.reads | value.reads)
        return [Loop(f"int n = 0; n < {place.type.size}; n++", frozenset(), "n", [line])] if place.type.size else []

    def _store_name(self, target: ast.Name, value: Value) -> list[Statement]:
        """Return the assignment to a local variable, and note what is known of it from here on."""
        name = target.id
        if name in self.parameters:
            raise self.refuse(target, "an assignment to an argument")
        if value.items is not None or isinstance(value.type, Record) or value.type is None:
            self.flow[name] = value
            return []
        kind = self.unified(target, self.types.get(name), value.type)
        self.types[name] = kind
        self.flow.pop(name, None)
        if isinstance(value.type, Array) and value.is_stable:
            self.flow[name] = value
        elif value.is_known and isinstance(kind, Scalar):
            is_plain = value.precedence == ATOM and "[" not in value.text
            own = Value(name, kind, const=value.const, reads=frozenset([name]))
            self.flow[name] = cast(value, kind) if is_plain else own
        if isinstance(value.type, Array):
            self.roots[name] = self.roots.get(name, frozenset([name])) | value.roots
        text = cast(value, kind).text if isinstance(kind, Scalar) else value.text
        if value.is_pointer:
            text = f"*{text}"
        return [Line(text, value.reads, name, value.is_pure)]

    def _do_augassign(self, node: ast.AugAssign) -> tuple[list[Statement], bool]:
        before = self.expression(_read(node.target))
        after = self.combine(node, node.op, before, self.expression(node.value))
        if isinstance(node.target, ast.Name):
            return self._store_name(node.target, after), False
        value = self.expression(node.value)
        self.written |= before.roots
        sign = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}.get(type(node.op))
        if sign is None or not isinstance(before.type, Scalar):
            raise self.refuse(node, "this operator")
        text = f"{before.text} {sign} {cast(value, before.type).text}"
        return [Line(text, before.reads | value.reads)], False

    def _received(self, value: Value) -> tuple[list[Statement], list[Value]]:
        """Return the statement that takes in several results of a call, and the results."""
        assert isinstance(value.type, Struct)
        self.temporaries += 1
        name = f"got_{self.temporaries}"
        self.types[name] = value.type
        own = frozenset([name])
        items = [Value(f"{name}.{member}", kind, reads=own) for member, kind in value.type.fields]
        return [Line(value.text, value.reads, name, value.is_pure)], items

    def _local_array(self, target: ast.expr, node: ast.expr) -> list[Statement] | None:
        """Return the room for ``numpy.empty``, ``zeros`` or ``ones`` of a length known beforehand; None for others."""
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and isinstance(target, ast.Name)):
            return None
        owner = self.expression(node.func.value)
        if owner.const is not np or node.func.attr not in ("empty", "zeros", "ones"):
            return None
        size = self.expression(node.args[0])
        lengths = tuple(item.const for item in size.items or (size,))
        if not all(isinstance(length, int) for length in lengths):
            raise self.refuse(node, "an array whose length is not known beforehand")
        kind = Array(INT if node.keywords else REAL, lengths)
        name = target.id
        self.types[name] = kind
        self.flow[name] = Value(name, kind, reads=frozenset([name]), roots=frozenset([name]), is_stable=True)
        one = number(1) if node.keywords else number(1.0)
        fill = ", ".join([one.text] * kind.size) if node.func.attr == "ones" and kind.size else "0"
        text = f"{kind.item.c} {name}[{max(kind.size, 1)}] = {{{fill}}}"
        return [Line(text, frozenset(), name, True, is_array=True)]

    def unified(self, node: ast.AST, first: Any, second: Any) -> Any:
        """Return the type of a variable that holds both."""
        if first is None or first == second:
            return second
        if isinstance(first, Scalar) and isinstance(second, Scalar):
            return max(first, second, key=lambda item: item.rank)
        are_arrays = isinstance(first, Array) and isinstance(second, Array)
        if are_arrays and first.item == second.item and len(first.shape) == len(second.shape):
            pairs = zip(first.shape, second.shape, strict=True)
            return Array(first.item, tuple(a if a == b else None for a, b in pairs))
        raise self.refuse(node, "a variable of two types")


def _read(target: ast.expr) -> ast.expr:
    """Return a target of an assignment as an expression that is read."""
    copy = ast.parse(ast.unparse(target), mode="eval").body
    return ast.copy_location(copy, target)
