"""Signals over time as a plot that zooms, and as a still picture for paper."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.report.drawing import sheet
from sgms_observer.report.page import Picture, Plot, light

Floats = NDArray[np.float64]

MAX_POINTS = 20_000
"""Points of a line in the plot: at this many, a page of ten lines has about one megabyte of them."""
_STILL_POINTS = 2_000
"""Points of a line in the still picture: three for each pixel of its width."""


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
    rows = extreme_rows(signals, MAX_POINTS)
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
    return Plot(name, caption, content, _still(name, caption, time, panels))


def extreme_rows(signals: Sequence[Floats], most: int) -> NDArray[np.int64]:
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


def _still(name: str, caption: str, time: Floats, panels: Sequence[Panel]) -> Picture:
    """Draw the whole of it."""
    with sheet(name, caption, rows=len(panels), height=1.7, sharex=True) as drawn:
        for axes, panel in zip(drawn.axes, panels, strict=True):
            for line in panel.lines:
                rows = extreme_rows([line.values], _STILL_POINTS)
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
