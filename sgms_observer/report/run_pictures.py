"""Pictures of one axis's run: motion, friction with its band, friction over velocity and position, a reversal."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes

from sgms_observer.arrays import Floats
from sgms_observer.report.drawing import ESTIMATE, MEASURED, REFERENCE, TRUTH, extreme_rows, sheet, with_breaks
from sgms_observer.report.page import Picture
from sgms_observer.settings.units import Units

_MAX_POINTS = 4_000
_MIN_POINTS = 50


@dataclass(frozen=True)
class Run:
    """Signals of one axis to draw; all arrays of shape (n,), NaN where a signal is unknown.

    Attributes:
        time: since the first sample [s].
        position: measured [m].
        velocity: estimated [m/s].
        reference: set-point [m].
        friction: estimated [N].
        friction_std: its standard deviation [N].
        truth: true friction [N].
        compensation: feedforward [N].
        units: of the axis; those above are a prismatic one's.
    """

    time: Floats
    position: Floats
    velocity: Floats
    reference: Floats
    friction: Floats
    friction_std: Floats
    truth: Floats
    compensation: Floats
    units: Units = field(default_factory=Units)

    def between(self, start: float, end: float) -> Run:
        """Return the part from ``start`` to ``end`` [s]."""
        rows = slice(*np.searchsorted(self.time, [start, end]))
        signals = {name: getattr(self, name)[rows] for name in self.__dataclass_fields__ if name != "units"}
        return Run(**signals, units=self.units)

    def with_breaks(self, maximum_gap: float) -> Run:
        """Return the run with a row of NaN in each step of time above ``maximum_gap`` [s], to draw it."""
        names = [name for name in self.__dataclass_fields__ if name not in ("time", "units")]
        time, signals = with_breaks(self.time, [getattr(self, name) for name in names], maximum_gap)
        return Run(time, **dict(zip(names, signals, strict=True)), units=self.units)

    @property
    def has_truth(self) -> bool:
        """Return whether the true friction is known."""
        return bool(np.isfinite(self.truth).any())


@dataclass(frozen=True)
class Tracking:
    """Tracking error of every sample of one axis, whether or not its estimate was published.

    Attributes:
        time: since the first sample of the run [s], shape (n,).
        error: position minus set-point [m], NaN where one of the two is unknown, shape (n,).
        units: of the axis.
    """

    time: Floats
    error: Floats
    units: Units = field(default_factory=Units)

    def with_breaks(self, maximum_gap: float) -> Tracking:
        """Return the errors with a row of NaN in each step of time above ``maximum_gap`` [s], to draw them."""
        time, (error,) = with_breaks(self.time, [self.error], maximum_gap)
        return Tracking(time, error, self.units)

    def rows(self, start: float, end: float) -> slice:
        """Return the rows from ``start`` to ``end`` [s]."""
        return slice(*np.searchsorted(self.time, [start, end]))


def clearest_reversal(run: Run) -> float:
    """Return the time of the last reversal but one, so that the run has what follows it too [s]; else its end."""
    fast = np.flatnonzero(np.abs(run.velocity) > 0.2 * np.nanmax(np.abs(run.velocity), initial=0.0))
    signs = np.sign(run.velocity[fast])
    turns = np.flatnonzero(np.diff(signs) != 0)
    if not turns.size:
        return float(run.time[-1])
    turn = turns[max(0, turns.size - 2)]
    between = run.velocity[fast[turn] : fast[turn + 1]]
    return float(run.time[fast[turn] + int(np.nanargmin(np.abs(between)))])


def run_pictures(run: Run, window: tuple[float, float], name: str = "") -> tuple[Picture, ...]:
    """Draw the run.

    Args:
        run: the whole run.
        window: the part that the time series show [s]; moved to the samples before it if the recording has a gap there.
        name: put in front of the pictures' names.
    """
    part = run.between(*window)
    if len(part.time) < _MIN_POINTS:
        rows = max(0, int(np.searchsorted(run.time, window[0])) - _MIN_POINTS)
        start = float(run.time[rows])
        part = run.between(start, start + window[1] - window[0])
    return _motion(part, name), _friction(part, name), hysteresis_picture(part, name), reversal_picture(part, name)


def tracking_picture(tracking: Tracking, before: tuple[float, float], after: tuple[float, float], name: str) -> Picture:
    """Draw the tracking error without and with compensation, on one scale.

    Args:
        tracking: of the whole run.
        before: part without compensation [s].
        after: part with compensation [s].
        name: of the picture.
    """
    parts = [tracking.rows(*window) for window in (before, after)]
    spans = [f"{_span(tracking.time[part][np.isfinite(tracking.error[part])]):.2g} s" for part in parts]
    shown = f"{spans[0]} of each part" if spans[0] == spans[1] else f"{spans[0]} without and {spans[1]} with it"
    caption = f"Tracking error without compensation, then with it, on one scale: the last {shown}."
    factor, unit = largest_prefixed(np.concatenate([tracking.error[part] for part in parts]), tracking.units)
    with sheet(name, caption, rows=2, height=1.9, sharey=True) as drawn:
        for axes, part, word in zip(drawn.axes, parts, ("without", "with"), strict=True):
            draw_line(axes, tracking.time[part], factor * tracking.error[part], MEASURED)
            axes.set(ylabel=f"error [{unit}]", title=f"tracking error {word} compensation")
        drawn.axes[1].set_xlabel("time [s]")
    return drawn.picture


def _span(time: Floats) -> float:
    """Return the time from the first row to the last one [s]; 0 without rows."""
    return float(time[-1] - time[0]) if len(time) else 0.0


def _motion(run: Run, name: str) -> Picture:
    caption = "Position with its set-point, tracking error and estimated velocity."
    factor, unit = largest_prefixed(run.position, run.units)
    error_factor, error_unit = largest_prefixed(run.position - run.reference, run.units)
    speed_factor, speed_unit = largest_prefixed(run.velocity, run.units, "m/s")
    with sheet(f"{name}motion", caption, rows=3, height=1.9, sharex=True) as drawn:
        top, middle, bottom = drawn.axes
        draw_line(top, run.time, factor * run.reference, REFERENCE, "set-point", linestyle="--")
        draw_line(top, run.time, factor * run.position, MEASURED, "measured")
        top.set_ylabel(f"position [{unit}]")
        draw_line(middle, run.time, error_factor * (run.position - run.reference), MEASURED)
        middle.set_ylabel(f"tracking error [{error_unit}]")
        draw_line(bottom, run.time, speed_factor * run.velocity, ESTIMATE, "estimated")
        bottom.set(xlabel="time [s]", ylabel=f"velocity [{speed_unit}]")
    return drawn.picture


def _friction(run: Run, name: str) -> Picture:
    caption = (
        "Friction: truth (where known), estimate with its two-sigma band, and the compensation as sent; it acts one"
        " look-ahead later."
    )
    with sheet(f"{name}friction", caption, rows=2, height=2.5, sharex=True) as drawn:
        top, bottom = drawn.axes
        _band(top, run)
        draw_line(top, run.time, run.compensation, MEASURED, "compensation", linestyle=":")
        top.set_ylabel(f"friction [{run.units.effort}]")
        if run.has_truth:
            draw_line(bottom, run.time, run.friction - run.truth, ESTIMATE, "estimate - truth")
        width = 2.0 * run.friction_std
        bottom.fill_between(run.time, -width, width, color=ESTIMATE, alpha=0.15, linewidth=0, label="two sigma")
        bottom.set(xlabel="time [s]", ylabel=f"error [{run.units.effort}]")
    return drawn.picture


def hysteresis_picture(run: Run, name: str) -> Picture:
    """Draw the friction over velocity and over position.

    Args:
        run: the part to draw.
        name: put in front of the picture's name.
    """
    caption = "Friction over velocity and over position: a Coulomb model cannot reproduce this hysteresis."
    factor, unit = largest_prefixed(run.position, run.units)
    speed_factor, speed_unit = largest_prefixed(run.velocity, run.units, "m/s")
    abscissas = (speed_factor * run.velocity, factor * run.position)
    labels = (f"velocity [{speed_unit}]", f"position [{unit}]")
    with sheet(f"{name}hysteresis", caption, rows=2, height=2.8, sharey=True) as drawn:
        for axes, abscissa, label in zip(drawn.axes, abscissas, labels, strict=True):
            if run.has_truth:
                draw_line(axes, abscissa, run.truth, TRUTH, "truth")
            draw_line(axes, abscissa, run.friction, ESTIMATE, "estimate", alpha=0.8)
            axes.set(xlabel=label, ylabel=f"friction [{run.units.effort}]")
    return drawn.picture


def reversal_picture(run: Run, name: str) -> Picture:
    """Draw the friction at the clearest reversal.

    Args:
        run: the part in which it is looked for.
        name: put in front of the picture's name.
    """
    reversal = clearest_reversal(run)
    zoomed = run.between(reversal - 0.015, reversal + 0.035)
    run = zoomed if len(zoomed.time) else run
    caption = f"One reversal, magnified, at {reversal:.3f} s: presliding until the stage slides again."
    with sheet(f"{name}reversal", caption, height=3.2) as drawn:
        axes = drawn.axes[0]
        _band(axes, run)
        axes.axvline(reversal, color=REFERENCE, linewidth=0.8)
        axes.set(xlabel="time [s]", ylabel=f"friction [{run.units.effort}]")
    return drawn.picture


def largest_prefixed(values: Floats, units: Units, unit: str = "m") -> tuple[float, str]:
    """Return the factor and unit in which the largest of the known values is easy to read.

    Args:
        values: shape (n,); NaN where nothing is known.
        units: of the axis.
        unit: of the values on a prismatic axis.
    """
    known = np.abs(values[np.isfinite(values)])
    return units.prefixed(float(known.max(initial=0.0)), unit)


def _band(axes: Axes, run: Run) -> None:
    """Draw truth, estimate and band over time."""
    if run.has_truth:
        draw_line(axes, run.time, run.truth, TRUTH, "truth")
    draw_line(axes, run.time, run.friction, ESTIMATE, "estimate")
    width = 2.0 * run.friction_std
    axes.fill_between(
        run.time, run.friction - width, run.friction + width, color=ESTIMATE, alpha=0.15, linewidth=0, label="two sigma"
    )


def draw_line(axes: Axes, x: Floats, y: Floats, color: str, label: str | None = None, **style: object) -> None:
    """Draw a line of about ``_MAX_POINTS`` points at most, nothing where nothing is known.

    Args:
        axes: where it is drawn.
        x: abscissas, shape (n,).
        y: ordinates, shape (n,).
        color: of the line.
        label: in the legend.
        style: for matplotlib.
    """
    if np.isfinite(y).any():
        rows = extreme_rows([x, y], _MAX_POINTS)
        axes.plot(x[rows], y[rows], color=color, label=label, **style)  # type: ignore[arg-type]
