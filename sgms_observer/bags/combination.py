"""Sums, differences and factors of a log's columns: ``q1*10.69-q2*2``.

A combination is ``[-]TERM {+|- TERM}``, a term is ``COLUMN {*|/ FACTOR}``. A column is a name of the log or a name in
double quotes; where names begin alike, the longest that an operator or the end follows is meant, so that a name may
hold operators itself. ``NAME[k]`` is the k-th series of a matrix, or the k-th number of a column where a factor stands.
A factor is a number, ``pi``, or a single number of the log.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import RecordingError

_OPERATOR = re.compile(r"\s*([-+*/])\s*")
_END = re.compile(r"\s*([-+*/]|$)")
_INDEX = re.compile(r"\s*\[\s*(\d{1,9})\s*\]")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_QUOTED = re.compile(r'"([^"]*)"')
_NAMES_SHOWN = 40
_NEAR = 0.6  # least similarity of a name that comes first, of difflib: that of a misspelling


@dataclass(frozen=True)
class Place:
    """A column of the log, or one of its numbers.

    Attributes:
        name: the column.
        index: which of its numbers, from 1; 0 for the whole column.
        text: as the user wrote it.
    """

    name: str
    index: int
    text: str


@dataclass(frozen=True)
class Factor:
    """What a column is multiplied with.

    Attributes:
        value: a number, or where the log holds it [-].
        text: as the user wrote it.
        is_divisor: the column is divided by it.
        is_negative: a minus stands before it.
    """

    value: float | Place
    text: str
    is_divisor: bool
    is_negative: bool


@dataclass(frozen=True)
class Term:
    """A column times its factors.

    Attributes:
        is_negative: it is subtracted.
        column: the column.
        factors: what it is multiplied with, in order.
    """

    is_negative: bool
    column: Place
    factors: tuple[Factor, ...]


class Combination:
    """Sums, differences and factors of columns.

    Args:
        path: the log, for messages.
        text: as the user wrote it.
        spellings: every way to write a column to its name.
        names: the names, for messages.

    Raises:
        RecordingError: it holds something that is neither a column nor a factor; one sentence.
    """

    def __init__(self, path: Path, text: str, spellings: Mapping[str, str], names: Sequence[str]) -> None:
        self._path, self._text, self._spellings, self._known = path, text.strip(), spellings, names
        self._at = 0
        self._terms = self._parse()

    @property
    def names(self) -> tuple[str, ...]:
        """Return the columns that are needed."""
        places = [term.column for term in self._terms]
        places += [f.value for term in self._terms for f in term.factors if isinstance(f.value, Place)]
        return tuple(dict.fromkeys(place.name for place in places))

    def value(self, columns: Mapping[str, Floats]) -> Floats:
        """Return the combination, shape (n,).

        Args:
            columns: the columns of ``names`` [any].

        Raises:
            RecordingError: columns differ in length, or a factor is no single finite number other than zero.
        """
        total: Floats | None = None
        for term in self._terms:
            values = self._whole(term.column, columns)
            for factor in term.factors:
                number = self._number(factor, columns)
                values = values / number if factor.is_divisor else values * number
            if total is None:
                total = -values if term.is_negative else values
                continue
            if values.size != total.size:
                raise RecordingError(
                    f"{self._path}: {term.column.text} has {values.size} entries, the columns before it in"
                    f" {self._text} have {total.size}; combine columns of the same length"
                )
            total = total - values if term.is_negative else total + values
        assert total is not None
        return total

    def _parse(self) -> tuple[Term, ...]:
        terms = []
        is_negative = self._sign()
        while True:
            terms.append(self._term(is_negative))
            operator = _OPERATOR.match(self._text, self._at)
            if operator is None:
                return tuple(terms)
            self._at = operator.end()
            is_negative = operator[1] == "-"

    def _sign(self) -> bool:
        """Step over a sign and return whether it is a minus."""
        found = self._text[self._at : self._at + 1]
        if found in ("-", "+") and not self._place_is_here():
            self._at += len(self._text[self._at :]) - len(self._text[self._at + 1 :].lstrip())
            return found == "-"
        return False

    def _term(self, is_negative: bool) -> Term:
        column = self._place()
        if column is None:
            raise self._unknown("column")
        factors = []
        while (operator := _OPERATOR.match(self._text, self._at)) is not None and operator[1] in "*/":
            self._at = operator.end()
            factors.append(self._factor(operator[1] == "/"))
        return Term(is_negative, column, tuple(factors))

    def _factor(self, is_divisor: bool) -> Factor:
        found = _NUMBER.match(self._text, self._at)
        if found is not None and _END.match(self._text, found.end()):
            self._at = found.end()
            return Factor(float(found[0]), found[0], is_divisor, False)
        is_negative = self._sign()
        start = self._at
        place = self._place()
        if place is not None:
            return Factor(place, place.text, is_divisor, is_negative)
        if self._text.startswith("pi", start) and _END.match(self._text, start + 2):
            self._at = start + 2
            return Factor(math.pi, "pi", is_divisor, is_negative)
        raise self._unknown("factor")

    def _place_is_here(self) -> bool:
        at = self._at
        found = self._place() is not None
        self._at = at
        return found

    def _place(self) -> Place | None:
        """Step over a column's name and return it; None, and no step, where there is none."""
        start = self._at
        quoted = _QUOTED.match(self._text, start)
        if quoted is not None and quoted[1] in self._spellings:
            return self._indexed(self._spellings[quoted[1]], start, quoted.end())
        for name in sorted(
            (n for n in self._spellings if n and self._text.startswith(n, start)), key=len, reverse=True
        ):
            if (place := self._indexed(self._spellings[name], start, start + len(name))) is not None:
                return place
        return None

    def _indexed(self, name: str, start: int, end: int) -> Place | None:
        """Step over a name with or without an index if an operator or the end follows."""
        index = _INDEX.match(self._text, end)
        for stop, number in ((end, 0), *([(index.end(), int(index[1]))] if index else [])):
            if _END.match(self._text, stop):
                self._at = stop
                return Place(name, number, self._text[start:stop])
        return None

    def _whole(self, place: Place, columns: Mapping[str, Floats]) -> Floats:
        values = columns[place.name]
        return values if place.index == 0 else self._one(place, values)

    def _one(self, place: Place, values: Floats) -> Floats:
        if not 1 <= place.index <= values.size:
            raise RecordingError(
                f"{self._path}: {place.text} is beyond the {values.size} entries of {place.name}; count from 1"
            )
        return values[place.index - 1 : place.index]

    def _number(self, factor: Factor, columns: Mapping[str, Floats]) -> float:
        if isinstance(factor.value, Place):
            values = self._whole(factor.value, columns)
            if values.size != 1:
                raise RecordingError(
                    f"{self._path}: the factor {factor.text} has {values.size} entries; only a single number"
                    " can be one,"
                    f" such as {factor.text}[1]"
                )
            number = float(values[0])
        else:
            number = factor.value
        if not np.isfinite(number) or number == 0.0:
            raise RecordingError(
                f"{self._path}: the factor {factor.text} is {number}; give a finite number other than zero"
            )
        return -number if factor.is_negative else number

    def _unknown(self, kind: str) -> RecordingError:
        """Return the error about what stands here."""
        rest = self._text[self._at :]
        found = re.match(r"[-+]?[^-+*/]*", rest)
        text = (found[0].strip() if found else "") or rest or "nothing"
        if kind == "factor":
            return RecordingError(f"{self._path} has no factor {text}; give a number or a single number of the file")
        if text == "nothing":
            return RecordingError(f"{self._path}: {self._text} ends where a column must follow; add the column")
        order, hint = self._by_likeness(text), ""
        left = len(order) - _NAMES_SHOWN
        held = ", ".join(order[:_NAMES_SHOWN]) or "none"
        more = f" and {left} more, of which any part of a name shows its own" if left > 0 else ""
        if _NUMBER.fullmatch(text) and self._text[: self._at].strip(" +-"):
            hint = "; a number cannot be added, only a column"
        elif _NUMBER.fullmatch(text) and not all(map(str.isdigit, self._known)):
            hint = "; this table has names: give one of them"
        return RecordingError(f"{self._path} has no column {text}; it has {held}{more}{hint}")

    def _by_likeness(self, text: str) -> list[str]:
        """Return the columns, first those whose names are like a text or hold it."""
        if _NUMBER.fullmatch(text):
            return list(self._known)
        near = difflib.get_close_matches(text, self._known, _NAMES_SHOWN, _NEAR)
        near += [name for name in self._known if text.lower() in name.lower() and name not in near]
        return [*near, *(name for name in self._known if name not in near)]
