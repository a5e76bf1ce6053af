"""Columns of numbers from logs of drives, instruments and MATLAB, whatever the file's format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.mat_log import MatLog
from sgms_observer.bags.text_log import TextLog
from sgms_observer.errors import RecordingError

Floats = NDArray[np.float64]


class Log(Protocol):
    """A log whose columns can be read by name."""

    @property
    def names(self) -> tuple[str, ...]:
        """Return the columns, in the order of the file."""

    @property
    def spellings(self) -> Mapping[str, str]:
        """Return every way to write a column to its name in ``names``."""

    def columns(self, names: Sequence[str]) -> dict[str, Floats]:
        """Return some columns, each of shape (n,); a single number has shape (1,).

        Args:
            names: entries of ``names``.
        """


def open_log(path: Path) -> Log:
    """Open a text or MAT file.

    Args:
        path: the file; everything that does not end in ``.mat`` is read as text.

    Raises:
        RecordingError: it cannot be read.
    """
    try:
        return MatLog(path) if path.suffix.lower() == ".mat" else TextLog(path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror or error}; check the path") from None
