"""A text file as a log: CSV in its dialects, tables of instruments with lines of words above them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any, Literal

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.bags.text_dialect import Dialect, find_dialect, number, unreadable_field
from sgms_observer.errors import RecordingError

_HEADS = (200, 2_000, 20_000, 200_000)
"""Lines that are looked at for the table: more each time, where fewer are all words."""
_ROWS_SEEN = 20  # rows of a table that are enough to know how it is written
_LONGEST_LINE = 1 << 20  # characters; a longer line is no row of a log
_FIELD_SHOWN = 40  # characters
_THOUSANDS = re.compile(r"[+-]?\d{1,3}(,\d{3})+")
"""A whole number with commas between thousands, or one with a decimal comma: nothing tells them apart."""
_TABLE: Literal[2] = 2  # dimensions
_HALF_DAY, _DAY = 43_200.0, 86_400.0  # s


class TextLog:
    """A text file with comma, semicolon, tab, bar or spaces, decimal point or comma, and a line of names or none.

    Any lines may stand above the table. A line of units below the names is passed over. Without names the columns are
    called 1, 2, ... Dates and times of day become seconds; an empty field becomes NaN.

    Args:
        path: the file.

    Attributes:
        names: the columns.
        spellings: every way to write a column to its name in ``names``.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._encoding = "utf-8-sig"
        with path.open("rb") as file:
            start = file.read(2)
        if start in (b"\xff\xfe", b"\xfe\xff"):
            self._encoding = "utf-16"
        try:
            self._dialect = self._find()
        except UnicodeDecodeError:
            self._encoding = "latin-1"
            self._dialect = self._find()
        self.names = self._dialect.names
        self.spellings = {name: name for name in self.names}

    def columns(self, names: Sequence[str]) -> dict[str, Floats]:
        """Return some columns, each of shape (n,).

        Args:
            names: entries of ``names``.
        """
        indices = [self.names.index(name) for name in names]
        order = sorted(set(indices))
        try:
            table = self._table(order)
        except UnicodeDecodeError:
            if self._encoding == "latin-1":
                raise RecordingError(f"{self._path} is no text; give a text or MAT file") from None
            self._encoding = "latin-1"
            return self.columns(names)
        values = {name: table[:, order.index(i)] for name, i in zip(names, indices, strict=True)}
        for name, i in zip(names, indices, strict=True):
            if self._dialect.is_time_of_day(i):
                values[name] = values[name] + _DAY * np.cumsum(
                    np.diff(values[name], prepend=values[name][0]) < -_HALF_DAY
                )
        return values

    def _table(self, order: Sequence[int]) -> Floats:
        """Return some columns side by side: read fast, or field by field where the numbers are not plain."""
        try:
            return self._load(order, is_plain=True)
        except ValueError as error:
            if isinstance(error, UnicodeDecodeError):
                raise
        try:
            return self._load(order, is_plain=False)
        except ValueError as error:
            if isinstance(error, UnicodeDecodeError):
                raise
            sentence = self._line_sentence(str(error))
        dialect = self._dialect
        is_possible = not dialect.has_decimal_comma and dialect.separator != ","
        if is_possible and self._has_decimal_commas(order):  # whole numbers only, up to the first comma
            self._dialect = replace(dialect, has_decimal_comma=True)
            try:
                return self._load(order, is_plain=False)
            except ValueError:
                self._dialect = dialect
        raise RecordingError(sentence)

    def _has_decimal_commas(self, order: Sequence[int]) -> bool:
        """Return whether a number in some columns has a comma that cannot stand between thousands."""
        with self._path.open(encoding=self._encoding, newline=None) as file:
            for line in islice(file, self._dialect.first_row, None):
                fields = line.split(self._dialect.separator)
                for text in (fields[i].strip() for i in order if i < len(fields)):
                    if "," in text and not _THOUSANDS.fullmatch(text):
                        return True
        return False

    def _load(self, order: Sequence[int], is_plain: bool) -> Floats:
        dialect = self._dialect
        has_comma = dialect.has_decimal_comma
        converters: dict[int | str, Any] = {i: found for i in order if (found := dialect.converter(i)) is not None}
        if not is_plain:
            converters = {**{i: lambda text: number(text, has_comma) for i in order}, **converters}
        is_replaced = has_comma and is_plain and dialect.separator != ","
        with self._path.open(encoding=self._encoding, newline=None) as file:
            lines: Any = _with_points(file, dialect.first_row) if is_replaced else file
            values: Floats = np.loadtxt(
                lines,
                delimiter=dialect.separator,
                skiprows=dialect.first_row,
                usecols=list(order),
                comments=None,
                ndmin=_TABLE,
                converters=converters or None,
                encoding=None,
                quotechar='"' if dialect.has_quotes else None,
            )
        return values

    def _line_sentence(self, text: str) -> str:
        """Return the error with numpy's reason, the column's name, and the line of the file instead of numpy's row."""
        place = re.search(r"(.*) (?:at|in) row (\d+)(?:, column (\d+))?", text)
        if place is None:
            reason = text.split("; use")[0].split("\n")[0].strip().rstrip(".;")
            return f"{self._path} cannot be read: {reason}; correct or remove that line"
        line = int(place[2]) + self._dialect.first_row
        if "column index" in place[1]:
            return f"{self._path}: too few columns in line {line}; correct or remove that line"
        column = int(place[3]) - 1 if place[3] else -1
        named = f", column {self.names[column]}" if 0 <= column < len(self.names) else ""
        why = " beside decimal commas" if self._dialect.has_decimal_comma and "." in place[1] else ""
        return f"{self._path}{named}: line {line + 1} cannot be read, {place[1]}{why}; correct or remove that line"

    def _find(self) -> Dialect:
        """Return how the table is written."""
        for most in _HEADS:
            with self._path.open(encoding=self._encoding, newline=None) as file:
                head = list(_lines(file, most))
            found = find_dialect(head)
            is_all = len(head) < most
            if found is not None and (found[1] >= _ROWS_SEEN or is_all):
                return found[0]
            if is_all or max(map(len, head), default=0) >= _LONGEST_LINE:
                break
        odd = unreadable_field(head[: _HEADS[0]])
        if odd is None:
            if not any(line.strip() for line in head):
                raise RecordingError(f"{self._path} is empty; export the log again")
            raise RecordingError(f"{self._path} holds no line of numbers; export the log again")
        raise RecordingError(
            f"{self._path} has no table of numbers: in line {odd[0]} the field {odd[1][:_FIELD_SHOWN]!r} is neither"
            " number nor time; write it as 1234.5, 2026-03-01T12:59:58.5 or 12:59:58.5"
        )


def _with_points(file: Any, first_row: int) -> Iterator[str]:
    """Yield the lines with decimal points in place of commas; ValueError where a row has points already."""
    for i, line in enumerate(file):
        if i >= first_row and "." in line:
            raise ValueError("a point beside decimal commas")
        yield line.replace(",", ".")


def _lines(file: Any, most: int) -> Iterator[str]:
    """Yield the first lines of a file, cut where a line is far too long."""
    for _ in range(most):
        line = file.readline(_LONGEST_LINE)
        if not line:
            return
        yield line.rstrip("\n")
