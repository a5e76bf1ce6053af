"""Statements on their way to C: which are needed, where their variables are declared, and how they are indented."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field


@dataclass
class Line:
    """One C statement.

    Attributes:
        text: the statement without its semicolon; of an assignment only what is assigned.
        reads: local names in it.
        target: local variable that it assigns, or None.
        is_pure: without its assignment it does nothing.
        is_array: it makes room for a local array; ``text`` is the whole declaration.
    """

    text: str
    reads: frozenset[str] = frozenset()
    target: str | None = None
    is_pure: bool = False
    is_array: bool = False


@dataclass
class Branch:
    """An if with its two blocks."""

    test: str
    reads: frozenset[str]
    then: list[Statement] = field(default_factory=list)
    otherwise: list[Statement] = field(default_factory=list)


@dataclass
class Loop:
    """A for with its block.

    Attributes:
        head: what stands in the parentheses.
        reads: local names in it.
        variable: the counter, declared in the head.
        block: what is repeated.
    """

    head: str
    reads: frozenset[str]
    variable: str
    block: list[Statement] = field(default_factory=list)


_WIDTH = 112  # of a line of C

Statement = Line | Branch | Loop
Declare = Callable[[str, bool], str]
"""Takes a variable's name and whether it is assigned but once, returns its declaration without a semicolon."""


def blocks_of(statement: Statement) -> list[list[Statement]]:
    """Return the blocks inside a statement."""
    if isinstance(statement, Branch):
        return [statement.then, statement.otherwise]
    return [statement.block] if isinstance(statement, Loop) else []


def walk(block: list[Statement]) -> Iterator[Statement]:
    """Return every statement of a block and of the blocks inside."""
    for statement in block:
        yield statement
        for inner in blocks_of(statement):
            yield from walk(inner)


def without_unused(block: list[Statement]) -> list[Statement]:
    """Return a function's statements without those that nothing needs."""
    while True:
        needed = _read_in(block)
        count = sum(1 for _ in walk(block))
        block = _needed(block, needed)
        if sum(1 for _ in walk(block)) == count:
            return block


def _read_in(block: list[Statement]) -> frozenset[str]:
    """Return the variables that a block reads. The counter of a loop is not a variable outside it of the same name."""
    found: frozenset[str] = frozenset()
    for statement in block:
        inside = frozenset().union(*map(_read_in, blocks_of(statement)))
        found |= statement.reads | (inside - {statement.variable} if isinstance(statement, Loop) else inside)
    return found


def _needed(block: list[Statement], needed: frozenset[str]) -> list[Statement]:
    """Return a block without unused assignments and without empty blocks."""
    used: list[Statement] = []
    for statement in block:
        if isinstance(statement, Line):
            if statement.target is not None and statement.target not in needed:
                if statement.is_pure:
                    continue
                statement = Line(statement.text, statement.reads)
            used.append(statement)
        elif isinstance(statement, Branch):
            then, otherwise = _needed(statement.then, needed), _needed(statement.otherwise, needed)
            if then or otherwise:
                used.append(Branch(statement.test, statement.reads, then, otherwise))
        else:
            inner = _needed(statement.block, needed)
            if inner:
                used.append(Loop(statement.head, statement.reads, statement.variable, inner))
    return used


def _mentions(statement: Statement, name: str) -> bool:
    """Return whether a statement itself, not a block inside, has a variable in it."""
    return name in statement.reads or (isinstance(statement, Line) and statement.target == name)


def _home(block: list[Statement], name: str) -> Statement | None:
    """Return the assignment that can declare a variable, or None where it must be declared at the top."""
    with_it = [
        statement
        for statement in block
        if _mentions(statement, name) or any(_mentions(inner, name) for part in blocks_of(statement)
                                             for inner in walk(part))
    ]  # fmt: skip
    first = with_it[0]
    if isinstance(first, Line):
        return first if first.target == name and name not in first.reads else None
    if len(with_it) > 1 or _mentions(first, name):
        return None
    parts = [part for part in blocks_of(first) if any(_mentions(inner, name) for inner in walk(part))]
    return _home(parts[0], name) if len(parts) == 1 else None


def declarations(block: list[Statement]) -> tuple[dict[int, str], list[str], dict[str, int]]:
    """Return where each local variable is declared.

    Args:
        block: the function's statements, without unused ones.

    Returns:
        id of the assignment to the variable it declares; variables declared at the top; number of assignments of each.
    """
    counts: dict[str, int] = {}
    for statement in walk(block):
        if isinstance(statement, Line) and statement.target is not None and not statement.is_array:
            counts[statement.target] = counts.get(statement.target, 0) + 1
    at_home: dict[int, str] = {}
    at_top = []
    for name in counts:
        home = _home(block, name)
        if home is None:
            at_top.append(name)
        else:
            at_home[id(home)] = name
    return at_home, at_top, counts


def wrapped(line: str) -> list[str]:
    """Return a line of C in pieces that are not too long."""
    indent = line[: len(line) - len(line.lstrip())] + "    "
    pieces = []
    while len(line) > _WIDTH:
        ends = [line.rfind(mark, 0, _WIDTH) + len(mark) for mark in (", ", "&& ", "|| ", "+ ", "* ")]
        place = next((end for end in ends if end > len(indent) + 8), 0)
        if not place:
            break
        pieces.append(line[:place].rstrip())
        line = indent + line[place:]
    return [*pieces, line]


def print_block(block: list[Statement], declare: Declare, hoisted: Callable[[str], str]) -> list[str]:
    """Return a function's body as indented lines of C.

    Args:
        block: the statements.
        declare: see ``Declare``.
        hoisted: takes a variable declared at the top and returns its whole declaration.
    """
    at_home, at_top, counts = declarations(block)

    def lines_of(part: list[Statement], indent: str) -> Iterator[str]:
        for statement in part:
            if isinstance(statement, Line):
                text = statement.text
                if statement.target is not None and not statement.is_array:
                    name = at_home.get(id(statement))
                    left = declare(name, counts[name] == 1) if name else statement.target
                    text = f"{left} = {text}"
                yield f"{indent}{text};"
            elif isinstance(statement, Loop):
                yield f"{indent}for ({statement.head}) {{"
                yield from lines_of(statement.block, indent + "    ")
                yield f"{indent}}}"
            else:
                yield from branch(statement, indent, "")

    def branch(statement: Branch, indent: str, before: str) -> Iterator[str]:
        then, otherwise, test = statement.then, statement.otherwise, statement.test
        if not then:
            then, otherwise, test = otherwise, [], f"!({test})"
        yield f"{indent}{before}if ({test}) {{"
        yield from lines_of(then, indent + "    ")
        if len(otherwise) == 1 and isinstance(otherwise[0], Branch):
            yield from branch(otherwise[0], indent, "} else ")
            return
        if otherwise:
            yield f"{indent}}} else {{"
            yield from lines_of(otherwise, indent + "    ")
        yield f"{indent}}}"

    lines = [f"    {hoisted(name)};" for name in at_top] + list(lines_of(block, "    "))
    return [piece for line in lines for piece in wrapped(line)]
