"""Pictures of friction and residual: over velocity, over position, measured against modelled."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import FixedLocator, FuncFormatter

from sgms_observer.arrays import Floats
from sgms_observer.report.drawing import BACKWARD, ESTIMATE, FORWARD, MEASURED, REFERENCE, sheet, thinned
from sgms_observer.report.page import Picture
from sgms_observer.settings.units import Units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Curve = tuple[Floats, Floats]

SLOWEST = 1.0e-3
"""Slowest velocity of a model's line, as a share of the largest velocity."""
_RANGES_OF_A_DECADE, _MIN_RANGES, _MAX_RANGES = 7, 4, 28  # of the speed, in each direction
_FEW_DECADES = 100.0  # ratio of the speeds up to which an axis has ticks between those of the decades
_MAX_SPEED_TICKS = 3  # of one direction, so that their labels stay apart
_MIN_ROWS = 5  # rows of a bin that is drawn
_MAX_DOTS = 20_000  # of a picture
_MAX_POINTS = 2_000  # of a line over position
_BINS = 120  # of the position, as far as the rows suffice
_ROWS_OF_A_BIN = 20
_BINS_OF_A_PERIOD = 12  # so that a period is seen and not folded
_PERIODS = 20  # of an effect that are shown where the whole stroke has too many
_LINE_POINTS = 1_000  # of an effect's line over position: fifty for each period


def _slowest_speed(velocity: Floats) -> float:
    """Return the speed from which on there is data [m/s]: the slowest one but a few; 0 where too few rows slide."""
    speed = np.sort(np.abs(velocity[velocity != 0.0]))
    return float(speed[_MIN_ROWS - 1]) if len(speed) >= _MIN_ROWS else 0.0


def stribeck_points(velocity: Floats, friction: Floats) -> tuple[Floats, Floats, Floats]:
    """Return mean velocity, mean friction and its standard deviation in ranges that are even in the speed's logarithm.

    The ranges begin at the slowest speed and end at the fastest one.

    Args:
        velocity: of rows where the axis slides.
        friction: of the same rows.
    """
    slowest = _slowest_speed(velocity)
    points = []
    if slowest > 0.0:
        top = float(np.max(np.abs(velocity)))
        count = int(np.clip(_RANGES_OF_A_DECADE * math.log10(top / slowest), _MIN_RANGES, _MAX_RANGES))
        edges = np.geomspace(slowest * (1.0 - 1e-9), top * (1.0 + 1e-9), count + 1)
        for low, high in pairwise(edges):
            for sign in (-1.0, 1.0):
                inside = (sign * velocity > low) & (sign * velocity <= high)
                if np.sum(inside) >= _MIN_ROWS:
                    points.append((velocity[inside].mean(), friction[inside].mean(), friction[inside].std()))
    ordered = np.array(sorted(points)).reshape(-1, 3)
    return ordered[:, 0], ordered[:, 1], ordered[:, 2]


def over_velocity(
    name: str, caption: str, velocity: Floats, friction: Floats, model: Sequence[Curve], units: Units
) -> Picture:
    """Draw friction over velocity: rows, their means and the model; the caption says from which speed on there is data.

    Args:
        name: short name.
        caption: what it shows, without the speed.
        velocity: of rows where the axis slides.
        friction: measured, of the same rows.
        model: velocity and friction of the model, a line for each direction.
        units: of the axis.
    """
    speeds = [float(np.max(np.abs(part), initial=0.0)) for part in (velocity, *(line for line, _ in model))]
    fastest = max(speeds)
    factor, unit = units.prefixed(fastest, "m/s")
    slowest = _slowest_speed(velocity)
    slowest_row = " It never slides so far and so long one way that a row counts."
    if slowest > 0.0:
        speed = units.readable(slowest, "m/s")
        slowest_row = (
            f" The plot starts at {speed}; slower samples are too close to a reversal. The velocity axis is"
            " logarithmic from there on."
        )
    with sheet(name, caption + slowest_row) as drawn:
        axes = drawn.axes[0]
        _draw_rows(axes, factor * velocity, friction, REFERENCE, 1.5, 0.5, "rows")
        centre, mean, deviation = stribeck_points(velocity, friction)
        axes.errorbar(factor * centre, mean, deviation, fmt="o", color=MEASURED, ms=4, lw=1.0, label="measured, mean")
        for number, (line, level) in enumerate(model):
            axes.plot(factor * line, level, color=ESTIMATE, label="model" if number == 0 else None)
        if slowest > 0.0:
            _spread_slow_speeds(axes, factor * slowest, factor * fastest)
        axes.set_xlabel(f"velocity [{unit}]")
        axes.set_ylabel(f"friction [{units.effort}]")
    return drawn.picture


def _spread_slow_speeds(axes: Axes, slowest: float, fastest: float) -> None:
    """Give the velocity a logarithmic axis for each direction, from the slowest data on; between these it is linear."""
    ticks = speed_ticks(slowest, fastest)
    axes.set_xscale("symlog", linthresh=slowest, linscale=0.3)
    axes.xaxis.set_major_locator(FixedLocator([*(-tick for tick in ticks[::-1]), 0.0, *ticks]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}".replace("-", "\N{MINUS SIGN}")))
    axes.minorticks_off()


def speed_ticks(slowest: float, fastest: float) -> list[float]:
    """Return the speeds to label, rising; below two decades 2 and 5 are labelled between the powers of ten, too.

    Where those are too many for the width, every second or third is left out. The fastest one stays, so that the
    outermost data lie near a label.

    Args:
        slowest: the slowest data, above 0 [the unit of the axis].
        fastest: the fastest data [the unit of the axis].
    """
    steps = (1.0, 2.0, 5.0) if fastest < _FEW_DECADES * slowest else (1.0,)
    decades = range(math.floor(math.log10(slowest)), math.ceil(math.log10(fastest)) + 1)
    ticks = [step * 10.0**decade for decade in decades for step in steps]
    ticks = [tick for tick in ticks if slowest <= tick <= fastest * (1.0 + 1e-9)]
    return ticks[:: -math.ceil(len(ticks) / _MAX_SPEED_TICKS)][::-1] if ticks else []


def hysteresis(name: str, caption: str, position: Floats, measured: Floats, modelled: Floats, units: Units) -> Picture:
    """Draw measured and modelled friction over position.

    Args:
        name: short name.
        caption: what it shows.
        position: shape (n,); NaN between pieces.
        measured, modelled: friction at these positions.
        units: of the axis.
    """
    factor, unit = _prefixed(position, units)
    with sheet(name, caption) as drawn:
        axes = drawn.axes[0]
        for values, colour, label in ((measured, MEASURED, "measured"), (modelled, ESTIMATE, "modelled")):
            places = factor * thinned(position, _MAX_POINTS)
            axes.plot(places, thinned(values, _MAX_POINTS), color=colour, lw=0.7, label=label)
        axes.set_xlabel(f"position [{unit}]")
        axes.set_ylabel(f"friction [{units.effort}]")
    return drawn.picture


def measured_against_modelled(
    name: str, caption: str, measured: Floats, modelled: Floats, fit: float, units: Units
) -> Picture:
    """Draw measured over modelled effort, with the line on which a perfect model lies.

    Args:
        name: short name.
        caption: what it shows.
        measured, modelled: efforts of the same rows.
        fit: 100 minus the rms residual in % of the rms effort [%].
        units: of the axis.
    """
    with sheet(name, caption) as drawn:
        axes = drawn.axes[0]
        _draw_rows(axes, modelled, measured, MEASURED, 2.0, 0.6, f"rows, fit {fit:.1f} %")
        ends = [float(np.min(measured)), float(np.max(measured))]
        axes.plot(ends, ends, color=ESTIMATE, label="measured = modelled")
        axes.set_xlabel(f"modelled {units.effort_word} [{units.effort}]")
        axes.set_ylabel(f"measured {units.effort_word} [{units.effort}]")
    return drawn.picture


def residual_over_position(
    name: str,
    caption: str,
    position: Floats,
    velocity: Floats,
    residual: Floats,
    units: Units,
    effect: Floats | None = None,
    period: float | None = None,
    of_position: Callable[[Floats], Floats] | None = None,
) -> Picture:
    """Draw the residual in even bins of the position, a colour for each direction, with the fitted effects.

    The line of the effects goes over all positions that were visited, also where a bin holds too few rows.

    Args:
        name: short name.
        caption: what it shows.
        position, velocity: shape (n,).
        residual: without the effects, shape (n,).
        units: of the axis.
        effect: effort of the effects at the same rows; None where there are none.
        period: shortest period in position of an effect; the part of the stroke with the most rows is shown where the
            whole has more than ``_PERIODS`` of them and too many bins.
        of_position: effort of those of the effects that are functions of the position alone; None where there are none.
    """
    low, high, count = position_bins(position, period)
    factor, unit = units.prefixed(max(abs(low), abs(high)))
    edges = np.linspace(low, high, count + 1)
    centre = factor * 0.5 * (edges[1:] + edges[:-1])
    with sheet(name, caption) as drawn:
        axes = drawn.axes[0]
        for sign, colour, label in ((1.0, FORWARD, "forward"), (-1.0, BACKWARD, "backward")):
            rows = (sign * velocity > 0.0) & (position >= low) & (position <= high)
            mean, error = binned(position[rows], residual[rows], edges)
            axes.errorbar(centre, mean, error, fmt="o", color=colour, ms=2.5, lw=0.8, label=label)
            if effect is not None and rows.any():
                places, fitted = effect_line(position[rows], effect[rows], edges, of_position)
                axes.plot(factor * places, fitted, color=colour, lw=1.4, label=f"effect, {label}")
        axes.set_xlabel(f"position [{unit}]")
        axes.set_ylabel(f"residual [{units.effort}]")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2 if effect is not None else 4,
                    borderaxespad=0.2, columnspacing=1.0, handlelength=1.4)  # fmt: skip
    return drawn.picture


def effect_line(
    position: Floats, effect: Floats, edges: Floats, of_position: Callable[[Floats], Floats] | None
) -> tuple[Floats, Floats]:
    """Return even positions over the visited range, and the effort of the effects there.

    What is a function of the position is evaluated. Of the rest the means of the bins that hold a row are joined: it is
    computed, so that one row is enough.

    Args:
        position: of rows of one direction, at least one.
        effect: effort of the effects at the same rows.
        edges: of the bins.
        of_position: the part of the effort that is a function of the position; None where there is none.
    """
    places = np.linspace(float(np.min(position)), float(np.max(position)), _LINE_POINTS)
    known, rest = (0.0, effect) if of_position is None else (of_position(places), effect - of_position(position))
    mean = binned(position, rest, edges, 1)[0]
    has_rows = np.isfinite(mean)
    centre = 0.5 * (edges[1:] + edges[:-1])
    return places, np.interp(places, centre[has_rows], mean[has_rows]) + known


def position_bins(position: Floats, period: float | None) -> tuple[float, float, int]:
    """Return the part of the stroke that is shown, and the number of even bins in it.

    Args:
        position: of all rows.
        period: that the bins must resolve; None for none.
    """
    low, high = float(np.min(position)), float(np.max(position))
    if high <= low:
        return low - 1e-9, low + 1e-9, 1
    count = int(np.clip(len(position) // _ROWS_OF_A_BIN, 1, _BINS))
    if period is None or (high - low) * _BINS_OF_A_PERIOD / period <= count:
        return low, high, count
    width = min(high - low, _PERIODS * period)
    starts = np.linspace(low, high - width, 200)
    ordered = np.sort(position)
    inside = np.searchsorted(ordered, starts + width) - np.searchsorted(ordered, starts)
    start = float(starts[int(np.argmax(inside))])
    return start, start + width, max(1, round(width * _BINS_OF_A_PERIOD / period))


def binned(position: Floats, values: Floats, edges: Floats, least: int = _MIN_ROWS) -> tuple[Floats, Floats]:
    """Return mean of each bin and its standard error; NaN where a bin holds too few rows.

    Args:
        position: shape (n,).
        values: shape (n,).
        edges: of k bins, shape (k + 1,).
        least: so many rows a bin has to hold.
    """
    size = len(edges) - 1
    place = np.clip(np.searchsorted(edges, position, side="right") - 1, 0, size - 1)
    count = np.bincount(place, minlength=size)
    enough = np.where(count >= least, count, np.nan)
    mean = np.bincount(place, values, size) / enough
    square = np.bincount(place, values**2, size) / enough
    return mean, np.sqrt(np.maximum(square - mean**2, 0.0) / enough)


def _draw_rows(axes: Axes, x: Floats, y: Floats, colour: str, size: float, alpha: float, label: str) -> None:
    """Draw a dot for each row, thinned; the legend's dot is opaque."""
    x, y = thinned(x, _MAX_DOTS), thinned(y, _MAX_DOTS)
    axes.plot(x, y, ".", color=colour, ms=size, alpha=alpha, rasterized=True)
    axes.plot([], [], ".", color=colour, label=label)


def _prefixed(position: Floats, units: Units) -> tuple[float, str]:
    """Return factor and unit in which positions are easy to read."""
    known = np.abs(position[np.isfinite(position)])
    return units.prefixed(float(np.max(known, initial=0.0)))
