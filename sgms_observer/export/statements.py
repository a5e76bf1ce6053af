"""Python statements as C statements: assignments, what follows one another, branches, repeats and returns."""

from __future__ import annotations

import ast
from typing import Any

import numpy as np

from sgms_observer.export.expressions import Expressions
from sgms_observer.export.lines import Branch, Line, Loop, Statement
from sgms_observer.export.values import (
    ATOM,
    INT,
    REAL,
    Array,
    Record,
    Scalar,
    Struct,
    Type,
    Value,
    cast,
    number,
    number_as,
)

MAX_UNROLLED = 64
"""A loop over what selects is written out up to this length."""

HALVING = ("high - low > 1",)
MAX_HALVINGS = 31
"""A search by halving among whole numbers ends within so many rounds."""


def _read(target: ast.expr) -> ast.expr:
    """Return a target of an assignment as an expression that is read."""
    copy = ast.parse(ast.unparse(target), mode="eval").body
    return ast.copy_location(copy, target)


def assigned_in(nodes: list[ast.stmt]) -> set[str]:
    """Return the names that any of these statements assigns."""
    return {
        node.id
        for statement in nodes
        for node in ast.walk(statement)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }


class Statements(Expressions):
    """Translates the statements of one function."""

    temporaries: int = 0
    returns: list[Value]
    result: Type = None

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
            constant = Value(name, kind, const=value.const, reads=frozenset([name]))
            self.flow[name] = cast(value, kind) if is_plain else constant
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
        reads_name = frozenset([name])
        items = [Value(f"{name}.{member}", kind, reads=reads_name) for member, kind in value.type.fields]
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

    def block(self, nodes: list[ast.stmt]) -> tuple[list[Statement], bool]:
        """Return a block's statements, and whether it leaves the block's surroundings (return, break, continue)."""
        done: list[Statement] = []
        for node in nodes:
            method = getattr(self, f"_do_{type(node).__name__.lower()}", None)
            if method is None:
                raise self.refuse(node, f"a {type(node).__name__}")
            more, leaves = method(node)
            done.extend(more)
            if leaves:
                return done, True
        return done, False

    def _do_expr(self, node: ast.Expr) -> tuple[list[Statement], bool]:
        if isinstance(node.value, ast.Constant):
            return [], False
        value = self.expression(node.value)
        return [Line(value.text, value.reads)] if value.text else [], False

    def _do_pass(self, node: ast.Pass) -> tuple[list[Statement], bool]:
        return [], False

    def _do_assert(self, node: ast.Assert) -> tuple[list[Statement], bool]:
        return [], False

    def _do_break(self, node: ast.Break) -> tuple[list[Statement], bool]:
        return [Line("break")], True

    def _do_continue(self, node: ast.Continue) -> tuple[list[Statement], bool]:
        return [Line("continue")], True

    def _do_return(self, node: ast.Return) -> tuple[list[Statement], bool]:
        if node.value is None or (isinstance(node.value, ast.Constant) and node.value.value is None):
            return [Line("return")], True
        value = self.expression(node.value)
        before: list[Statement] = []
        if isinstance(value.type, Struct) and value.type.name in self.program.owners:  # several results, handed on
            before, items = self._received(value)
            value = Value("", None, items=tuple(items), reads=items[0].reads)
        self.returns.append(value)
        if value.items is None:
            kind = self.result
            text = cast(value, kind).text if isinstance(kind, Scalar) else value.text
            if value.is_pointer:
                text = f"*{text}"
            return [Line(f"return {text}", value.reads)], True
        return [*before, Line(f"return {self._literal(value)}", value.reads)], True

    def _literal(self, value: Value) -> str:
        """Return several results as one structure."""
        kind = self.result
        if not isinstance(kind, Struct):
            return ""
        parts = [number_as(member, item) for (_, member), item in zip(kind.fields, value.items or (), strict=True)]
        return f"({kind.name}){{{', '.join(parts)}}}"

    def _do_if(self, node: ast.If) -> tuple[list[Statement], bool]:
        test = self.expression(node.test)
        if test.is_known:
            return self.block(node.body if test.const else node.orelse)
        before = dict(self.flow)
        then, then_leaves = self.block(node.body)
        after_then, self.flow = self.flow, dict(before)
        otherwise, otherwise_leaves = self.block(node.orelse)
        if otherwise_leaves:
            self.flow = after_then
        elif not then_leaves:
            self.flow = {
                name: value
                for name, value in self.flow.items()
                if name in after_then and _same(after_then[name], value)
            }
        done: list[Statement] = [Branch(test.text, test.reads, then, otherwise)]
        return done, then_leaves and otherwise_leaves

    def _do_while(self, node: ast.While) -> tuple[list[Statement], bool]:
        """Return a search by halving, ``while high - low > 1``, as a loop with a bound; no other while is bounded."""
        if node.orelse or not isinstance(node.test, ast.Compare) or ast.unparse(node.test) not in HALVING:
            raise self.refuse(node, "a while")
        changed = assigned_in(node.body)
        self._forget(changed)
        body, _leaves = self.block(node.body)
        self._forget(changed)
        test = self.expression(node.test)
        self.temporaries += 1
        name = f"halved_{self.temporaries}"
        loop: Statement = Loop(
            f"int {name} = 0; {name} < {MAX_HALVINGS} && {test.inside(41)}; {name}++", test.reads, name, body
        )
        return [loop], False

    def _do_for(self, node: ast.For) -> tuple[list[Statement], bool]:
        if not isinstance(node.target, ast.Name) or node.orelse:
            raise self.refuse(node, "this loop")
        name = node.target.id
        call = node.iter
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "range"):
            return self._over_entries(node, name), False
        limits = [self.expression(item) for item in call.args]
        start, stop = (number(0), limits[0]) if len(limits) == 1 else (limits[0], limits[1])
        step = self.whole(call.args[2]) if len(limits) == 3 else 1
        if self._selects(node, name) and start.is_known and stop.is_known:
            return self._written_out(node, name, range(int(start.const), int(stop.const), step)), False
        if start.is_known and stop.is_known:
            places = range(int(start.const), int(stop.const), step)
            leaves = any(isinstance(item, (ast.Break, ast.Continue)) for part in node.body for item in ast.walk(part))
            if not places or (len(places) == 1 and not leaves):
                return self._written_out(node, name, places), False
        changed = assigned_in(node.body) | {name}
        self._forget(changed)
        self.types[name] = INT
        body, _leaves = self.block(node.body)
        self._forget(changed)
        first, end = cast(start, INT), cast(stop, INT)
        move = {1: f"{name}++", -1: f"{name}--"}.get(step, f"{name} += {step}")
        head = f"int {name} = {first.text}; {name} {'<' if step > 0 else '>'} {end.inside(61)}; {move}"
        loop: Statement = Loop(head, first.reads | end.reads, name, body)
        return [loop], False

    def _over_entries(self, node: ast.For, name: str) -> list[Statement]:
        """Return a loop over the entries of an array."""
        values = self.expression(node.iter)
        if not isinstance(values.type, Array) or values.type.shape[0] is None or len(values.type.shape) != 1:
            raise self.refuse(node, "this loop")
        changed = assigned_in(node.body) | {name}
        self._forget(changed)
        self.types[name] = values.type.item
        counter = f"at_{name}"
        body, _leaves = self.block(node.body)
        self._forget(changed)
        first: Statement = Line(f"{values.inside(100)}[{counter}]", values.reads, name, True)
        head = f"int {counter} = 0; {counter} < {values.type.shape[0]}; {counter}++"
        return [Loop(head, frozenset(), counter, [first, *body])] if values.type.shape[0] else []

    def _selects(self, node: ast.For, name: str) -> bool:
        """Return whether the loop's body looks up what selects by the loop's counter."""
        for inner in ast.walk(node):
            if (
                isinstance(inner, ast.Subscript)
                and isinstance(inner.value, ast.Name)
                and isinstance(inner.slice, ast.Name)
                and inner.slice.id == name
                and self._name(inner.value).selects
            ):
                return True
        return False

    def _written_out(self, node: ast.For, name: str, places: range) -> list[Statement]:
        """Return the body once for every value of the counter."""
        if len(places) > MAX_UNROLLED:
            raise self.refuse(node, f"a choice among more than {MAX_UNROLLED} entries")
        done: list[Statement] = []
        for place in places:
            self.flow[name] = number(place)
            body, leaves = self.block(node.body)
            done.extend(body)
            if leaves:
                raise self.refuse(node, "a break or return in a loop over what selects")
        return done

    def _forget(self, names: set[str]) -> None:
        """Forget what is known of variables that a loop changes."""
        for name in names:
            self.flow.pop(name, None)


def _same(first: Value, second: Value) -> bool:
    """Return whether two values mean the same."""
    return first.text == second.text and first.type == second.type and first.items is second.items
