"""A MAT file of versions 4 to 7 as a log: vectors, rows and columns of matrices, fields of structs.

Every length is checked, so that a damaged file cannot end the process; scipy's reader crashes on some. This one reads
what a log holds: real arrays and structs of them.

Source: The MathWorks, MAT-File Format (versions 4 and 5).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Floats
from sgms_observer.errors import RecordingError

_MAX_SERIES = 1024
"""Series of one matrix that are offered; a matrix with more on its shorter side is an image or a map, not a log."""

_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_MATRIX, _COMPRESSED = 14, 15
_STRUCT, _FIRST_NUMERIC, _LAST_NUMERIC = 2, 6, 15
_OLD_NUMBERS = ("f8", "f4", "i4", "i2", "u2", "u1")
_HEADER = 128
_DEEPEST = 16
_LARGEST = 1 << 31
"""A compressed variable that unpacks to more bytes than this is not a log."""


class MatLog:
    """A MAT file up to version 7.

    A vector is a column of its name, a field of a struct is ``name.field``. A matrix is a set of series along its
    longer side: ``name(:,k)`` for a tall one, ``name(k,:)`` for a wide one, ``name[k]`` for either, k from 1.

    Args:
        path: the file.

    Attributes:
        names: the columns.
        spellings: every way to write a column to its name in ``names``.
    """

    def __init__(self, path: Path) -> None:
        self._places: dict[str, NDArray[Any]] = {}
        self.spellings: dict[str, str] = {}
        self._collect("", _read_mat(path))
        self.names = tuple(self._places)
        self.spellings |= {name: name for name in self.names}

    def columns(self, names: Sequence[str]) -> dict[str, Floats]:
        """Return some columns, each of shape (n,); a single number has shape (1,).

        Args:
            names: entries of ``names``.
        """
        return {name: np.array(self._places[name], dtype=np.float64) for name in names}

    def _collect(self, prefix: str, values: Mapping[str, Any]) -> None:
        """Note where each column is; numbers are copied only when a column is asked for."""
        for key, value in values.items():
            name = prefix + key
            if isinstance(value, dict):
                self._collect(name + ".", value)
                continue
            try:
                table = np.squeeze(np.asarray(value))
            except (TypeError, ValueError):
                continue
            if table.dtype.kind not in "biuf" or table.size == 0 or table.ndim > 2:
                continue
            if table.ndim <= 1:
                self._places[name] = table.reshape(-1)
            elif min(table.shape) <= _MAX_SERIES:
                self._collect_matrix(name, table)

    def _collect_matrix(self, name: str, table: NDArray[Any]) -> None:
        is_wide = table.shape[1] > table.shape[0]
        for k, series in enumerate(table if is_wide else table.T, start=1):
            column = f"{name}({k},:)" if is_wide else f"{name}(:,{k})"
            self._places[column] = series
            self.spellings[f"{name}[{k}]"] = column


class _Damaged(Exception):
    """What is wrong with the file, in a few words."""


class _Element(NamedTuple):
    kind: int
    data: memoryview


def _read_mat(path: Path) -> dict[str, Any]:
    """Return the numeric variables of a MAT file: arrays, and dictionaries for structs of one element."""
    data = memoryview(path.read_bytes())
    try:
        if len(data) < 20:
            raise _Damaged("it is too short")
        if 0 in data[:4]:
            return dict(_old_variables(data))
        if len(data) < _HEADER:
            raise _Damaged("it ends inside its header")
        order = {b"IM": "<", b"MI": ">"}.get(bytes(data[126:128]))
        if order is None:
            raise _Damaged("it does not begin as one")
        version: int = struct.unpack_from(order + "H", data, 124)[0]
        if version >> 8 == 2:
            raise RecordingError(f"{path} is a MAT file of version 7.3, which is not read; in MATLAB: save(..., '-v7')")
        return dict(_variables(data[_HEADER:], order))
    except (_Damaged, struct.error, ValueError, OverflowError, MemoryError) as error:
        raise RecordingError(f"{path} is no readable MAT file ({error}); save it again") from None


def _variables(data: memoryview, order: str) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each variable that holds numbers."""
    for element in _elements(data, order):
        if element.kind == _COMPRESSED:
            try:
                unpacked = zlib.decompressobj().decompress(element.data, _LARGEST)
            except zlib.error:
                raise _Damaged("a compressed variable is damaged") from None
            element = next(_elements(memoryview(unpacked), order), element)
        if element.kind == _MATRIX:
            name, value = _matrix(element.data, order, 0)
            if name and value is not None:
                yield name, value


def _elements(data: memoryview, order: str) -> Iterator[_Element]:
    """Yield the elements that follow each other in some bytes."""
    at = 0
    while at + 8 <= len(data):
        kind, size = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # a small element: kind and size share a word, the data are in the next
            kind, size, start, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise _Damaged("an element has a wrong length")
        else:
            start = at + 8
            end = start + size if kind == _COMPRESSED else start + size + -size % 8
        if start + size > len(data):
            raise _Damaged("it ends inside a variable")
        yield _Element(kind, data[start : start + size])
        at = end


def _matrix(data: memoryview, order: str, depth: int) -> tuple[str, Any]:
    """Return name and value of a matrix; None for what holds no real numbers."""
    parts = _elements(data, order)
    flags, shape, name = next(parts, None), next(parts, None), next(parts, None)
    if flags is None or shape is None or name is None or len(flags.data) < 8:
        return "", None  # MATLAB writes an empty matrix without any of them
    kind = struct.unpack_from(order + "I", flags.data)[0] & 0xFF
    sizes = tuple(_numbers(shape, order).astype(np.int64).tolist())
    if any(size < 0 for size in sizes):
        raise _Damaged("a variable has a negative size")
    text = bytes(name.data).decode("utf-8", "replace")
    if _FIRST_NUMERIC <= kind <= _LAST_NUMERIC:
        content = next(parts, None)
        values = _numbers(content, order) if content is not None else np.empty(0)
        return text, values.reshape(sizes, order="F")
    if kind == _STRUCT and sizes == (1, 1) and depth < _DEEPEST:
        return text, _struct(parts, order, depth)
    return text, None


def _struct(parts: Iterator[_Element], order: str, depth: int) -> dict[str, Any]:
    """Return the fields of a struct of one element."""
    length, names = next(parts, None), next(parts, None)
    if length is None or names is None:
        raise _Damaged("a struct ends before its fields")
    width = int(_numbers(length, order)[0]) if len(length.data) >= 4 else 0
    if width <= 0:
        raise _Damaged("a struct has no names")
    text = bytes(names.data)
    found: dict[str, Any] = {}
    for at in range(0, len(text), width):
        field = next(parts, None)
        if field is None or field.kind != _MATRIX:
            raise _Damaged("a struct ends before its fields")
        _, value = _matrix(field.data, order, depth + 1)
        name = text[at : at + width].split(b"\0")[0].decode("utf-8", "replace")
        if name and value is not None:
            found[name] = value
    return found


def _numbers(element: _Element, order: str) -> np.ndarray[Any, np.dtype[Any]]:
    """Return the numbers of an element."""
    code = _NUMBERS.get(element.kind)
    if code is None:
        raise _Damaged(f"numbers of the unknown kind {element.kind}")
    whole = len(element.data) - len(element.data) % int(code[1])
    return np.frombuffer(element.data[:whole], dtype=order + code)


def _old_variables(data: memoryview) -> Iterator[tuple[str, Any]]:
    """Yield name and value of each variable of a file of version 4."""
    at = 0
    order = "<" if struct.unpack_from("<I", data)[0] < 5000 else ">"
    while at + 20 <= len(data):
        kind, rows, columns, is_complex, length = struct.unpack_from(order + "IIIII", data, at)
        precision, content = kind // 10 % 10, kind % 10
        if kind >= 5000 or precision >= len(_OLD_NUMBERS) or not 0 < length <= 256:
            raise _Damaged("it does not begin as one")
        code = order + _OLD_NUMBERS[precision]
        size = rows * columns * np.dtype(code).itemsize
        start = at + 20 + length
        at = start + size * (2 if is_complex else 1)
        if at > len(data):
            raise _Damaged("it ends inside a variable")
        if content == 0:
            name = bytes(data[start - length : start]).split(b"\0")[0].decode("latin-1")
            yield name, np.frombuffer(data[start : start + size], dtype=code).reshape((rows, columns), order="F")
