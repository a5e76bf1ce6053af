"""Columns of numbers from logs of drives and MATLAB: CSV in its dialects, and MAT files."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.mat_reader import read_mat
from sgms_observer.errors import RecordingError

Floats = NDArray[np.float64]

_DELIMITERS = (";", "\t", ",", "|")
_COMMENTS = "#%"
_HEAD_LINES = 200
_WIDEST = 64  # columns of a matrix that are offered one by one


class Log(Protocol):
    """A log whose columns can be read by name."""

    names: tuple[str, ...]

    def column(self, name: str) -> Floats:
        """Return one column, shape (n,); a single number has shape (1,).

        Args:
            name: one of ``names``.
        """


def open_log(path: Path) -> Log:
    """Open a CSV or MAT file.

    Args:
        path: the file; everything that does not end in ``.mat`` is read as CSV.

    Raises:
        RecordingError: it cannot be read.
    """
    try:
        if path.suffix.lower() == ".mat":
            return MatLog(path)
        return CsvLog(path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}; check the path") from None


class MatLog:
    """A MAT file up to version 7: vectors, columns of matrices as ``name(:,k)``, fields of structs as ``name.field``.

    Args:
        path: the file.
    """

    def __init__(self, path: Path) -> None:
        self._columns: dict[str, Floats] = {}
        self._collect("", read_mat(path))
        self.names = tuple(self._columns)

    def column(self, name: str) -> Floats:
        """Return one column, shape (n,); a single number has shape (1,).

        Args:
            name: one of ``names``.
        """
        return self._columns[name]

    def _collect(self, prefix: str, values: Mapping[str, Any]) -> None:
        for key, value in values.items():
            name = prefix + key
            if isinstance(value, dict):
                self._collect(name + ".", value)
                continue
            try:
                table = np.asarray(value)
                if table.dtype.kind not in "biuf" or table.size == 0:
                    continue
                table = np.squeeze(table.astype(np.float64))
            except (TypeError, ValueError):
                continue
            if table.ndim <= 1:
                self._columns[name] = table.reshape(-1)
            elif table.ndim == 2 and table.shape[1] <= _WIDEST:
                self._columns |= {f"{name}(:,{k + 1})": table[:, k].copy() for k in range(table.shape[1])}


class CsvLog:
    """A CSV file with comma, semicolon, tab, bar or spaces, decimal point or comma, and a line of names or none.

    A second line of words, such as units, is skipped. Without names the columns are called 1, 2, ...

    Args:
        path: the file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._encoding = "utf-8-sig"
        try:
            head = self._head()
        except UnicodeDecodeError:
            self._encoding = "latin-1"
            head = self._head()
        self._delimiter, self._is_comma_decimal, first, names = _understand(path, head)
        self._skipped = first
        self.names = names

    def column(self, name: str) -> Floats:
        """Return one column, shape (n,).

        Args:
            name: one of ``names``.
        """
        index = self.names.index(name)
        try:
            with self._path.open(encoding=self._encoding, newline=None) as file:
                lines: Any = file
                if self._is_comma_decimal:
                    lines = io.StringIO(file.read().replace(",", "."))
                values: Floats = np.loadtxt(
                    lines, delimiter=self._delimiter, skiprows=self._skipped, usecols=index, comments=None, ndmin=1
                )
        except UnicodeDecodeError:
            raise RecordingError(f"{self._path} is no text; give a CSV or MAT file") from None
        except ValueError as error:
            reason = self._reason(str(error))
            raise RecordingError(f"{self._path}, column {name}: {reason}; correct or remove that line") from None
        return values

    def _reason(self, text: str) -> str:
        """Return numpy's reason, with the line of the file instead of its own row."""
        place = re.search(r"(.*) (?:at|in) row (\d+)", text)
        if place is None:
            return text.split("; use")[0].split("\n")[0].strip().rstrip(".;")
        line = int(place[2]) + self._skipped
        if "column index" in place[1]:
            return f"too few columns in line {line}"
        return f"{place[1]} in line {line + 1}"

    def _head(self) -> list[str]:
        with self._path.open(encoding=self._encoding, newline=None) as file:
            return [line.rstrip("\n") for _, line in zip(range(_HEAD_LINES), file, strict=False)]


def _understand(path: Path, head: list[str]) -> tuple[str | None, bool, int, tuple[str, ...]]:
    """Return delimiter, whether the decimal sign is a comma, the line where numbers start, and the names.

    The way of reading that finds most columns is the file's: ``0,1`` is two columns, ``0,1;2,5`` as well.
    """
    best: tuple[int, str | None, bool, int] = (0, None, False, 0)
    for delimiter in (*_DELIMITERS, None):
        for is_comma_decimal in (False, True) if delimiter != "," else (False,):
            first = next((i for i, line in enumerate(head) if _width(line, delimiter, is_comma_decimal)), None)
            if first is None:
                continue
            width = _width(head[first], delimiter, is_comma_decimal)
            if width > best[0]:
                best = (width, delimiter, is_comma_decimal, first)
    width, delimiter, is_comma_decimal, first = best
    if width == 0:
        raise RecordingError(f"{path} has no line of numbers among its first {_HEAD_LINES}; give a CSV or MAT file")
    numbered = [str(k + 1) for k in range(width)]
    for line in head[:first]:
        names = [name.strip().strip("\"'") for name in _split(line.lstrip(_COMMENTS + " "), delimiter)]
        if len(names) == width:
            # An empty or repeated name gives way to the column's number.
            named = [name if name and name not in names[:k] else numbered[k] for k, name in enumerate(names)]
            return delimiter, is_comma_decimal, first, tuple(named)
    return delimiter, is_comma_decimal, first, tuple(numbered)


def _split(line: str, delimiter: str | None) -> list[str]:
    return line.strip().split(delimiter) if delimiter is None else line.rstrip("\n").split(delimiter)


def _width(line: str, delimiter: str | None, is_comma_decimal: bool) -> int:
    """Return the number of columns of a line of numbers, some of which may be empty; 0 for any other line."""
    fields = [field.strip() for field in _split(line.replace(",", ".") if is_comma_decimal else line, delimiter)]
    if not any(fields):
        return 0
    try:
        for field in fields:
            float(field or "0")
    except ValueError:
        return 0
    return len(fields)
