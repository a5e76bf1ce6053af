"""Python statements as C statements: what follows one another, branches, repeats and returns."""

from __future__ import annotations

import ast

from sgms_observer.export.assignments import Assignments
from sgms_observer.export.lines import Branch, Line, Loop, Statement
from sgms_observer.export.values import INT, Array, Scalar, Struct, Type, Value, cast, number, number_as

MOST_UNROLLED = 64
"""A loop over what selects is written out up to this length."""


HALVING = ("high - low > 1",)
MOST_HALVINGS = 31
"""A search by halving among whole numbers ends within so many rounds."""


def assigned_in(nodes: list[ast.stmt]) -> set[str]:
    """Return the names that any of these statements assigns."""
    return {
        node.id
        for statement in nodes
        for node in ast.walk(statement)
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
    }


class Statements(Assignments):
    """Translates the statements of one function."""

    returns: list[Value]
    result: Type = None

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
            f"int {name} = 0; {name} < {MOST_HALVINGS} && {test.inside(41)}; {name}++", test.reads, name, body
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
        if len(places) > MOST_UNROLLED:
            raise self.refuse(node, f"a choice among more than {MOST_UNROLLED} entries")
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
