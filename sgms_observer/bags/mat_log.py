"""A MAT file as a log: vectors, rows and columns of matrices, fields of structs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.mat_reader import read_mat

Floats = NDArray[np.float64]

_MAX_SERIES = 1024
"""Series of one matrix that are offered; a matrix with more on its shorter side is an image or a map, not a log."""


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
        self._collect("", read_mat(path))
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
