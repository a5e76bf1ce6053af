"""The picture of one reversal, magnified until presliding shows: measured and modelled friction over the distance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.report.drawing import ESTIMATE, MEASURED, sheet
from sgms_observer.report.page import Picture
from sgms_observer.settings.units import Units

SHARE = 0.9
"""Share of the sliding force at which presliding counts as over: a weak element may slip only much later."""
_WIDTH = 10.0  # half width of the picture, in presliding distances
_MIN_ROWS = 4  # of a reversal that is drawn
_MAX_POINTS = 1_000  # of a line: a slow reversal has more rows
_MAX_MARKED = 100  # rows that are marked with a point each


def presliding_distance(stiffness: Sequence[float], sliding_force: Sequence[float]) -> float:
    """Return the deflection from rest at which the elements together reach ``SHARE`` of their sliding force [m].

    Args:
        stiffness: of each element [N/m].
        sliding_force: of each element [N].
    """
    kappa, force = np.asarray(stiffness, dtype=np.float64), np.asarray(sliding_force, dtype=np.float64)
    knots = np.append(0.0, np.sort(force / kappa))
    total = np.minimum(np.outer(knots, kappa), force).sum(axis=1)
    return float(np.interp(SHARE * total[-1], total, knots))


def reversal_picture(
    name: str, pieces: Sequence[tuple[Floats, Floats, Floats]], distance: float, units: Units
) -> Picture | None:
    """Draw friction at the reversal that shows presliding best; return None where no reversal has enough rows.

    Args:
        name: short name.
        pieces: position, measured friction and modelled friction of each piece, shapes (n,).
        distance: presliding distance of the model [m].
        units: of the axis.
    """
    width = _WIDTH * distance
    found = [(score, piece, rows, turn) for piece in pieces for score, rows, turn in _reversals(piece[0], width)]
    if not found:
        return None
    _, (position, measured, modelled), rows, turn = max(found, key=lambda one: one[0])
    factor, unit = units.prefixed(width)
    away = factor * (position[rows] - position[turn])
    caption = (
        "One reversal, magnified: friction over the distance from the turning point. The model reaches"
        f" {100.0 * SHARE:.0f} % of its sliding force within {units.readable(distance)}; {_WIDTH:g} times that is"
        " shown. Both lines passed the same low-pass."
    )
    style = ".-" if len(away) <= _MAX_MARKED else "-"
    every = slice(None, None, max(1, len(away) // _MAX_POINTS))
    with sheet(name, caption) as drawn:
        axes = drawn.axes[0]
        for values, colour, label in ((measured, MEASURED, "measured"), (modelled, ESTIMATE, "modelled")):
            axes.plot(away[every], values[rows][every], style, color=colour, ms=3.5, lw=1.0, label=label)
        axes.set_xlabel(f"distance from the turning point [{unit}]")
        axes.set_ylabel(f"friction [{units.effort}]")
    return drawn.picture


def turning_rows(position: Floats, least: float) -> list[int]:
    """Return the rows at which a motion turns, with at least so much travel before and after each.

    Args:
        position: shape (n,).
        least: travel [m].
    """
    turns: list[int] = []
    low = high = way = 0  # rows of the extremes since the last turn; the direction of the motion, 0 while unknown
    for row, place in enumerate(position):
        low = row if place < position[low] else low
        high = row if place > position[high] else high
        if way >= 0 and position[high] - place >= least:
            turns += [high] if way or position[high] - position[0] >= least else []
            low, way = row, -1
        elif way <= 0 and place - position[low] >= least:
            turns += [low] if way or position[0] - position[low] >= least else []
            high, way = row, 1
    return turns


def _reversals(position: Floats, width: float) -> list[tuple[tuple[float, float, int], slice, int]]:
    """Return score, rows within the width and turning row of each reversal that has enough rows.

    The best score has the longest way after the turning point, then the longest before it, then the most rows.
    """
    turns = turning_rows(position, width / _WIDTH)
    ends = [0, *turns, len(position) - 1]
    found = []
    for before, turn, after in zip(ends, turns, ends[2:], strict=False):
        near = np.abs(position[before : after + 1] - position[turn]) <= width
        end = turn + int(np.argmin(np.append(near[turn - before :], False)))
        first = turn - int(np.argmin(np.append(near[turn - before :: -1], False))) + 1
        if end - first < _MIN_ROWS:
            continue
        ways = [float(np.ptp(position[part])) / width for part in (slice(turn, end), slice(first, turn + 1))]
        found.append(((round(ways[0], 1), round(ways[1], 1), end - first), slice(first, end), turn))
    return found
