"""What the translator knows of an expression: its C text, its type, and its value where that never changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Scalar:
    """A C number.

    Attributes:
        c: its C type.
        rank: the larger of two ranks is the type of a sum.
    """

    c: str
    rank: int


BOOL, INT, LONG, REAL = Scalar("bool", 0), Scalar("int", 1), Scalar("int64_t", 2), Scalar("real", 3)


@dataclass(frozen=True)
class Array:
    """A C array that lies row by row.

    Attributes:
        item: type of its entries.
        shape: lengths; None where the translator does not know one.
    """

    item: Scalar
    shape: tuple[int | None, ...]

    @property
    def size(self) -> int:
        """Return how many entries it has; all lengths are known."""
        total = 1
        for length in self.shape:
            total *= length or 0
        return total


@dataclass(frozen=True)
class Struct:
    """A C structure made from a NamedTuple, or what a function with several results returns.

    Attributes:
        name: its C name.
        fields: name and type of each member.
        bound: members that are constants elsewhere and not in the structure.
    """

    name: str
    fields: tuple[tuple[str, Any], ...]
    bound: Mapping[str, Value] = field(default_factory=dict, compare=False)


@dataclass(frozen=True, eq=False)
class Record:
    """A C structure that Python keeps in one flat array, addressed by numbers.

    Attributes:
        name: its C name.
        entries: index of a single number to its member's name and type.
        fields: number of a field (``estimators.memory``) to its member's name and type.
        constants: index, or field number plus ``FIELD_OFFSET``, to a constant elsewhere.
        tail: shape of the member ``at`` that holds every other index; None without.
    """

    name: str
    entries: Mapping[int, tuple[str, Scalar]]
    fields: Mapping[int, tuple[str, Array]]
    constants: Mapping[int, Value]
    tail: tuple[int, ...] | None = None
    used: set[str] = field(default_factory=set)


FIELD_OFFSET = 1000
"""Added to a field's number in ``Record.constants``, so that fields and entries do not collide."""

Type = Scalar | Array | Struct | Record | None


class Unknown:
    """Stands for a value that changes while the C program runs."""


UNKNOWN = Unknown()
ATOM = 100
"""Precedence of a name, a number or a call."""


@dataclass(frozen=True)
class Value:
    """One translated expression.

    Attributes:
        text: C text.
        type: C type; None for None.
        precedence: of the operator in ``text``, as C ranks them.
        const: value, where it is the same in every run.
        data: entries of a constant array.
        selects: loops over this array are written out, so that what it selects is decided by the translator.
        binds: a function that is handed this array is written for it, instead of taking it as a parameter.
        reads: local names in ``text``.
        roots: names through which the memory of this value is accessed.
        items: members of a tuple that exists in Python only.
        is_pointer: a structure reached through a pointer.
        is_stable: ``text`` means the same memory everywhere in the function.
        is_pure: evaluating it changes nothing.
    """

    text: str
    type: Type = REAL
    precedence: int = ATOM
    const: Any = UNKNOWN
    data: NDArray[Any] | None = None
    selects: bool = False
    binds: bool = False
    reads: frozenset[str] = frozenset()
    roots: frozenset[str] = frozenset()
    items: tuple[Value, ...] | None = None
    is_pointer: bool = False
    is_stable: bool = False
    is_pure: bool = True

    @property
    def is_known(self) -> bool:
        """Return whether the translator knows the value."""
        return self.const is not UNKNOWN

    def inside(self, precedence: int) -> str:
        """Return the text, in parentheses where an operator of this precedence would tear it apart."""
        return self.text if self.precedence >= precedence else f"({self.text})"


NONE = Value("NULL", None, const=None)


def number(value: bool | int | float) -> Value:
    """Return a constant number as C writes it."""
    if isinstance(value, (bool, np.bool_)):
        return Value("true" if value else "false", BOOL, const=bool(value))
    if isinstance(value, (int, np.integer)):
        return Value(str(int(value)), INT, ATOM if value >= 0 else 90, const=int(value))
    return Value(real_text(float(value)), REAL, const=float(value))


def real_text(value: float) -> str:
    """Return a number of the selectable type ``real`` in C; what a float cannot hold becomes its largest number."""
    if np.isnan(value):
        return "REAL_NAN"
    if abs(value) > 1.0e38:
        return ("-" if value < 0 else "") + ("REAL_INFINITY" if np.isinf(value) else "REAL_HUGE")
    return f"R({value!r})"


def cast(value: Value, wanted: Scalar) -> Value:
    """Return a number as another C type, without a cast where C needs none."""
    if value.type == wanted or not isinstance(value.type, Scalar):
        return value
    if value.is_known and isinstance(value.const, (bool, int, float)) and value.precedence == ATOM:
        if wanted is REAL and value.text.lstrip("-").isdigit():
            return replace(number(float(value.const)), reads=value.reads)
        if wanted in (INT, LONG) and float(value.const).is_integer():
            return replace(number(int(value.const)), type=wanted, reads=value.reads)
    if wanted.rank > value.type.rank and wanted is not REAL:
        return replace(value, type=wanted)
    return replace(value, text=f"({wanted.c}){value.inside(90)}", type=wanted, precedence=90)


def argument_text(wanted: Value, argument: Value) -> str:
    """Return an argument as a C function takes it."""
    if isinstance(argument.type, (Struct, Record)):
        return argument.text if argument.is_pointer else f"&{argument.inside(100)}"
    return number_as(wanted.type, argument)


def number_as(kind: Any, value: Value) -> str:
    """Return a value's text, as another number where that is wanted."""
    if isinstance(kind, Scalar):
        return cast(value, kind).text
    return f"*{value.text}" if isinstance(kind, Struct) and value.is_pointer else value.text
