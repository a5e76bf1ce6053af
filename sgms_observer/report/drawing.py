"""How every picture of a report is made: one style, PNG bytes, no screen needed."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgms_observer.report.page import Picture

TRUTH, ESTIMATE, MEASURED, REFERENCE = "#1c2430", "#d1495b", "#0b6e99", "#8a94a3"
_STYLE: dict[Any, Any] = {
    "figure.dpi": 110,
    "font.size": 9.5,
    "axes.grid": True,
    "grid.color": "#e3e7ec",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "axes.titlesize": 10,
    "agg.path.chunksize": 20000,
}


@dataclass
class Sheet:
    """A figure being drawn; ``picture`` is there once the block ends."""

    figure: Figure
    axes: list[Axes]
    picture: Picture | None = None


@contextmanager
def sheet(
    name: str, caption: str, rows: int = 1, columns: int = 1, height: float = 3.2, **share: Any
) -> Iterator[Sheet]:
    """Draw a picture.

    Args:
        name: short name.
        caption: what it shows, in one sentence.
        rows: rows of axes.
        columns: columns of axes.
        height: of one row [inch].
        share: ``sharex`` and the like, for matplotlib.

    Yields:
        The sheet to draw on; afterwards its ``picture`` holds the PNG.
    """
    with pyplot.rc_context(_STYLE):
        figure, grid = pyplot.subplots(rows, columns, figsize=(9.0, height * rows), squeeze=False, **share)
        drawn = Sheet(figure, list(grid.ravel()))
        try:
            yield drawn
            figure.tight_layout()
            buffer = io.BytesIO()
            figure.savefig(buffer, format="png")
            drawn.picture = Picture(name, caption, buffer.getvalue())
        finally:
            pyplot.close(figure)
