"""Drawing for reports: pictures in one style, SVG in the colours of the page, and signals over time that zoom."""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import matplotlib
import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import TightLayoutEngine
from matplotlib.ticker import AutoLocator

from sgms_observer.arrays import Floats, Ints
from sgms_observer.report.page import COLOURS, DrawnPlot, Picture, Plot, light

matplotlib.use("Agg")


TRUTH, ESTIMATE, MEASURED, REFERENCE = light("ink"), light("estimate"), light("measured"), light("reference")
FORWARD, BACKWARD = light("forward"), light("backward")
_WIDTH = 4.6  # inch: two pictures side by side on a desk, and letters of 9 px at least on a telephone
_PNG_DPI = 160
_MOST_TICKS = 7  # of the abscissa: labels of five digits stay apart
_LEGEND_LETTERS, _HANDLE_LETTERS = 58, 5  # letters beside each other in a legend; a line and its gap count as letters
_STYLE: dict[Any, Any] = {
    "figure.dpi": 100,
    "font.size": 9.5,
    "text.color": light("ink"),
    "axes.edgecolor": light("soft"),
    "axes.labelcolor": light("ink"),
    "xtick.color": light("ink"),
    "ytick.color": light("ink"),
    "axes.grid": True,
    "grid.color": light("line"),
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titlesize": 9.5,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "agg.path.chunksize": 20000,
    "svg.fonttype": "none",
}

MAX_BREAKS = 200  # of a line at missing samples
_STILL_SHARE, _MIN_STILL_POINTS = 0.1, 300
"""Points of a line in the still picture, of those of the plot; at least one for each point of its width."""
_MORE_DIGITS = re.compile(r"(?<=\d\.\d\d)\d+")
"""A coordinate of a drawing with more digits than show: a hundredth of a point is a fiftieth of a pixel."""
_SPACES = re.compile(r"\s+(?=[A-Z])|(?<=[A-Z])\s+")
"""Blanks around the letters of a path, which need none."""


@dataclass
class Sheet:
    """A figure being drawn; ``picture`` is there once the block ends."""

    figure: Figure
    axes: list[Axes]
    drawn: Picture | None = None

    @property
    def picture(self) -> Picture:
        """Return the picture of a sheet whose block has ended."""
        if self.drawn is None:
            raise RuntimeError("the sheet is still being drawn")
        return self.drawn


def thinned(values: Floats, most: int) -> Floats:
    """Return every k-th value, so few that a picture can hold them.

    Args:
        values: shape (n,).
        most: about how many.
    """
    return values[:: max(1, len(values) // most)]


@contextmanager
def sheet(
    name: str, caption: str, rows: int = 1, columns: int = 1, height: float = 3.0, **share: Any
) -> Iterator[Sheet]:
    """Draw a picture.

    Args:
        name: short name.
        caption: what it shows, in one sentence.
        rows: axes, one above the other.
        columns: axes beside each other; in a report one, or they could not be read on a telephone.
        height: of one row [inch].
        share: ``sharex`` and the like, for matplotlib.

    Yields:
        The sheet to draw on; afterwards its ``picture`` holds the SVG, and draws the PNG if it is asked for.
    """
    with pyplot.rc_context({**_STYLE, "svg.hashsalt": name}):
        figure, grid = pyplot.subplots(rows, columns, figsize=(_WIDTH * columns, height * rows), squeeze=False, **share)
        drawn = Sheet(figure, list(grid.ravel()))
        try:
            yield drawn
            for axes in drawn.axes:
                handles, labels = axes.get_legend_handles_labels()
                if len(labels) > 1 and axes.get_legend() is None:
                    axes.legend(handles, labels, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2,
                                ncols=_legend_columns(labels), handlelength=1.4, columnspacing=1.0)  # fmt: skip
                if isinstance(axes.xaxis.get_major_locator(), AutoLocator):
                    axes.locator_params(axis="x", nbins=_MOST_TICKS)
            # Not figure.tight_layout(): it leaves a layout engine, for which savefig draws every picture twice.
            layout = TightLayoutEngine(pad=0.5)
            layout.execute(figure)
            layout.execute(figure)  # the first one may change the ticks, and with them the width of their labels
            svg = io.StringIO()
            figure.savefig(svg, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
            drawn.drawn = Picture(name, caption, _of_the_page(svg.getvalue(), name, caption), partial(_png, figure))
        finally:
            pyplot.close(figure)


def _png(figure: Figure) -> bytes:
    """Return a figure as a PNG file."""
    png = io.BytesIO()
    with pyplot.rc_context(_STYLE):
        figure.savefig(png, format="png", dpi=_PNG_DPI)
    return png.getvalue()


def _legend_columns(labels: Sequence[str]) -> int:
    """Return so many columns that a legend is not wider than its picture."""
    for columns in range(min(4, len(labels)), 1, -1):
        widths = [max(map(len, labels[column::columns])) + _HANDLE_LETTERS for column in range(columns)]
        if sum(widths) <= _LEGEND_LETTERS:
            return columns
    return 1


def _of_the_page(svg: str, name: str, caption: str) -> str:
    """Return a drawing as a page carries it: described, in the page's colours, its names apart from other drawings'."""
    prefix = re.sub(r"\W", "_", name)
    svg = svg[svg.index("<svg") :].strip()
    size = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    width, height = size.groups() if size else ("100", "60")
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" viewBox="0 0 {width}'
        f' {height}" role="img" aria-label="{html.escape(caption)}">'
    )
    body = svg[svg.index(">") + 1 :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    body = re.sub(r'(?<= d=")[^"]*', lambda path: _shortened(path[0]), body)
    body = re.sub(r'\bid="', f'id="{prefix}-', body)
    body = re.sub(r'(url\(|href=")#', rf"\1#{prefix}-", body)
    names = {pair[0]: colour for colour, pair in COLOURS.items()}
    return head + re.sub("|".join(names), lambda found: f"var(--{names[found[0]]})", body)


def _shortened(path: str) -> str:
    """Return a path with two digits behind the point and no needless blanks, which is half as long."""
    return _SPACES.sub("", _MORE_DIGITS.sub("", path))


@dataclass(frozen=True)
class Line:
    """One signal.

    Attributes:
        label: name for the legend.
        values: at the times of the plot, shape (n,); NaN where nothing is known.
        colour: one of ``COLOURS``.
    """

    label: str
    values: Floats
    colour: str


@dataclass(frozen=True)
class Panel:
    """Signals over one axis.

    Attributes:
        label: quantity with its unit.
        lines: the signals.
    """

    label: str
    lines: Sequence[Line]


def time_plot(name: str, caption: str, time: Floats, panels: Sequence[Panel]) -> Plot:
    """Return a plot of signals over time, its panels one above the other.

    Args:
        name: short name.
        caption: what it shows, in one sentence.
        time: rising [s], shape (n,).
        panels: what stands above each other.
    """
    signals = [line.values for panel in panels for line in panel.lines]

    def draw(points: int) -> DrawnPlot:
        rows = extreme_rows(signals, points)
        content = {
            "time": _packed(time[rows]),
            "panels": [
                {
                    "label": panel.label,
                    "lines": [
                        {"label": line.label, "colour": line.colour, "values": _packed(line.values[rows])}
                        for line in panel.lines
                    ],
                }
                for panel in panels
            ],
        }
        still = _still(name, caption, time, panels, max(_MIN_STILL_POINTS, round(_STILL_SHARE * points)))
        return DrawnPlot(content, still)

    return Plot(name, caption, 1 + len(signals), draw)


def with_breaks(time: Floats, signals: Sequence[Floats], maximum_gap: float) -> tuple[Floats, list[Floats]]:
    """Return time and signals with a row of NaN in each long step of time, so that no line crosses missing samples.

    Only the ``MAX_BREAKS`` longest steps get a row: the size of a page stays bounded.

    Args:
        time: rising [s], shape (n,).
        signals: of shape (n,) each.
        maximum_gap: longest step that a line crosses [s]; at least one and a half usual steps.
    """
    steps = np.diff(time)
    if not steps.size:
        return time, list(signals)
    places = np.flatnonzero(steps > max(maximum_gap, 1.5 * float(np.median(steps))))
    places = np.sort(places[np.argsort(-steps[places], kind="stable")[:MAX_BREAKS]])
    middle = time[places] + 0.5 * steps[places]
    return np.insert(time, places + 1, middle), [np.insert(signal, places + 1, np.nan) for signal in signals]


def extreme_rows(signals: Sequence[Floats], most: int) -> Ints:
    """Return the rows to draw: all of them, or those where a signal is largest or smallest in its piece of time.

    Args:
        signals: of the same length; NaN where nothing is known.
        most: about how many rows.
    """
    count = len(signals[0])
    if count <= most:
        return np.arange(count)
    pieces = max(1, most // (2 * len(signals)))
    edges = np.linspace(0, count, pieces + 1).astype(np.int64)
    length = int(np.max(np.diff(edges)))
    place = np.minimum(edges[:-1, None] + np.arange(length), count - 1)
    chosen = [edges[:-1]]
    for signal in signals:
        for filled, pick in ((-np.inf, np.argmax), (np.inf, np.argmin)):
            values = np.where(np.isfinite(signal), signal, filled)[place]
            chosen.append(edges[:-1] + pick(values, axis=1))
        holes = np.flatnonzero(np.diff(np.isnan(signal).astype(int)) != 0)
        chosen += [holes, holes + 1]
    return np.unique(np.clip(np.concatenate(chosen), 0, count - 1))


def _packed(values: Floats) -> str:
    """Return numbers as the page carries them: four bytes each, as text."""
    return base64.b64encode(values.astype("<f4").tobytes()).decode("ascii")


def _still(name: str, caption: str, time: Floats, panels: Sequence[Panel], points: int) -> Picture:
    """Draw the whole of it."""
    with sheet(name, caption, rows=len(panels), height=1.7, sharex=True) as drawn:
        for axes, panel in zip(drawn.axes, panels, strict=True):
            for line in panel.lines:
                rows = extreme_rows([line.values], points)
                axes.plot(time[rows], line.values[rows], color=light(line.colour), lw=0.8, label=line.label)
            axes.set_ylabel(panel.label)
        drawn.axes[-1].set_xlabel("time [s]")
    return drawn.picture


def one_after_another(times: Sequence[Floats]) -> Floats:
    """Return the times of several recordings one after the other [s], with a hole between two.

    Args:
        times: of each recording, rising [s].
    """
    listed, end = [], 0.0
    for time in times:
        shifted = end + time - time[0]
        end = float(shifted[-1]) + (float(time[1] - time[0]) if len(time) > 1 else 0.0)
        listed.append(np.append(shifted, end))
    return np.concatenate(listed)


def with_holes(pieces: Sequence[Floats]) -> Floats:
    """Return signals of several recordings one after the other, at the times of ``one_after_another``.

    Args:
        pieces: one signal of each recording.
    """
    return np.concatenate([np.append(piece, np.nan) for piece in pieces])
