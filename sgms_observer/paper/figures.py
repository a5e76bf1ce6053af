"""Figures 2 and 3: friction of GMS and S-GMS on eight elements. Figures 5 to 7 and plots over time: the estimators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.jit import njit
from sgms_observer.paper.conditions import (
    CHOSEN,
    LOWPASS,
    MODELS,
    ROWS,
    SINE_PERIOD,
    Estimate,
    estimate,
    estimator_friction,
    estimator_settings,
    simulate,
)
from sgms_observer.report.drawing import (
    BACKWARD,
    ESTIMATE,
    FORWARD,
    MEASURED,
    REFERENCE,
    TRUTH,
    Line,
    Panel,
    sheet,
    time_plot,
)
from sgms_observer.report.page import Picture, Plot
from sgms_observer.settings.axis import FrictionSettings
from sim_plant.integration import TrueFriction, advance_elements, level_of, true_friction
from sim_plant.record import StageRecord

_N = 8
EIGHT = FrictionSettings(
    model="sgms",
    reset="paper",
    element_stiffness=tuple(1.0e7 * i / _N for i in range(1, _N + 1)),
    element_fraction=tuple(2.0 * i / (_N * (_N + 1)) for i in range(1, _N + 1)),
    element_damping=(0.0,) * _N,
    viscous_coefficient=0.0,
    static_force=3.0,
    coulomb_force=2.0,
    stribeck_velocity=1.0e-6,
    attraction_rate=50.0,
    smoothing_lambda=1000.0,
    smoothing_zeta=0.99,
    smoothing_gamma=10.0,
)
SLIP_DISTANCE = EIGHT.element_fraction[0] * EIGHT.static_force / EIGHT.element_stiffness[0]
"""All eight elements of the caption slip at this deflection [m]: nu_i / kappa_i is the same for each."""

MAX_POINTS = 5_000
"""Points of a line in a figure."""
_STEP = 1.0e-4  # s


@njit
def _friction_along(friction: TrueFriction, velocity: Floats, period: float, force: Floats, mode: Ints) -> Floats:
    """Friction after each step of a prescribed motion [N]; ``force`` and ``mode`` are the elements', updated."""
    total = np.zeros(velocity.shape[0])
    for k in range(velocity.shape[0]):
        level = level_of(friction, velocity[k])
        advance_elements(friction, level, velocity[k], period, force, mode, force, mode)
        for i in range(force.shape[0]):
            total[k] += force[i]
    return total


@dataclass
class Elements:
    """The elements of a model, with the paper's reset, and what they remember.

    Args:
        settings: the model.
        is_gms: GMS rather than S-GMS.
    """

    settings: FrictionSettings
    is_gms: bool

    def __post_init__(self) -> None:
        count = len(self.settings.element_stiffness)
        self.force, self._mode = np.zeros(count), np.zeros(count, dtype=np.int64)
        model = "gms" if self.is_gms else "sgms"
        self._friction = true_friction(replace(self.settings, model=model, reset="paper"))

    def follow(self, velocity: Floats, period: float = _STEP) -> Floats:
        """Return the friction after each step of a prescribed motion [N].

        Args:
            velocity: over each step [m/s].
            period: of a step [s].
        """
        friction: Floats = _friction_along(self._friction, velocity, period, self.force, self._mode)
        return friction


def hysteresis_path() -> Floats:
    """Return positions with two minor loops inside a major one, in presliding [m]; one per step."""
    turns = np.array([0.0, 1.8, -1.4, 0.6, -0.6, 1.0, 0.0, 1.8]) * SLIP_DISTANCE
    speed = 4.0e-6 * _STEP
    parts = [np.linspace(a, b, round(abs(b - a) / speed) + 1)[1:] for a, b in pairwise(turns)]
    return np.concatenate(parts)


def hysteresis(settings: FrictionSettings, is_gms: bool) -> tuple[Floats, Floats]:
    """Return position [m] and friction [N] along ``hysteresis_path``."""
    position = hysteresis_path()
    return position, Elements(settings, is_gms).follow(np.diff(position, prepend=0.0) / _STEP)


def drift(settings: FrictionSettings, is_gms: bool) -> tuple[Floats, Floats]:
    """Return time [s] and position [m] of a mass after sliding, under an oscillating force below breakaway.

    The force swings between 0 and 75 % of f_C, starting at its top; the mass starts at rest from sliding friction.
    """
    elements = Elements(settings, is_gms)
    period, mass, damping = 1.0e-5, 1.0, 2.0e3
    elements.follow(np.full(2000, 2.0e-6))
    elements.follow(np.full(10, 1.0e-12), period)
    time = np.arange(0.0, 2.0, period)
    top = float(elements.force.sum())
    force = 0.375 * settings.coulomb_force * (1.0 + np.cos(2.0 * np.pi * 4.0 * time))
    blend = np.minimum(time / 0.05, 1.0)
    force = (1.0 - blend) * top + blend * force
    position, velocity = np.zeros(len(time)), 0.0
    friction = top
    for k in range(1, len(time)):
        velocity = (velocity + period / mass * (force[k] - friction)) / (1.0 + period * damping / mass)
        friction = float(elements.follow(np.array([velocity]), period)[0])
        position[k] = position[k - 1] + velocity * period
    return time, position


def lag(settings: FrictionSettings, is_gms: bool, has_reversals: bool) -> tuple[Floats, Floats]:
    """Return velocity [m/s] and friction [N] over the last period of an oscillating velocity.

    Args:
        settings: the model.
        is_gms: GMS rather than S-GMS.
        has_reversals: oscillate about 0 rather than about the Stribeck velocity.
    """
    period, frequency = 1.0e-4, 5.0
    time = np.arange(0.0, 4.0 / frequency, period)
    stribeck = settings.stribeck_velocity
    velocity = stribeck * (3.0 * np.cos(2.0 * np.pi * frequency * time)) if has_reversals else stribeck * (
        1.05 - np.cos(2.0 * np.pi * frequency * time)
    )  # fmt: skip
    friction = Elements(settings, is_gms).follow(velocity, period)
    last = time >= 3.0 / frequency
    return velocity[last], friction[last]


def figure_two() -> tuple[Picture, ...]:
    """Draw Figures 2 a-d."""
    panels: dict[str, tuple[str, str, str, Callable[[bool], tuple[Floats, Floats]], float]] = {
        "a": ("hysteresis with nonlocal memory", "position [nm]", "friction [N]", lambda g: hysteresis(EIGHT, g), 1e9),
        "b": ("no drift under a force below breakaway", "time [s]", "position [nm]", lambda g: drift(EIGHT, g), 1.0),
        "c": ("frictional lag", "velocity [um/s]", "friction [N]", lambda g: lag(EIGHT, g, False), 1e6),
        "d": ("periodic motion with sliding", "velocity [um/s]", "friction [N]", lambda g: lag(EIGHT, g, True), 1e6),
    }
    pictures = []
    for name, (title, x_label, y_label, curve, x_scale) in panels.items():
        with sheet(f"figure2{name}", f"Figure 2({name}): {title}.") as drawn:
            axis = drawn.axes[0]
            for is_gms, label, colour, style in ((True, "GMS", MEASURED, "-"), (False, "S-GMS", ESTIMATE, "--")):
                x, y = curve(is_gms)
                every = max(1, len(x) // MAX_POINTS)
                y = y * (1e9 if name == "b" else 1.0)
                axis.plot((x * x_scale)[::every], y[::every], style, color=colour, label=label)
            axis.set(xlabel=x_label, ylabel=y_label)
        pictures.append(drawn.picture)
    return tuple(pictures)


def figure_three() -> tuple[Picture, ...]:
    """Draw Figures 3 a-d: lambda, gamma and zeta at the closing of a minor loop, and where that lies."""
    variants: dict[str, tuple[str, list[tuple[str, dict[str, Any]]]]] = {
        "a": (
            "S-GMS with three values of lambda",
            [(f"{x:g}", {"smoothing_lambda": x}) for x in (1000.0, 100.0, 30.0)],
        ),
        "b": ("S-GMS with three values of gamma", [(f"{x:g}", {"smoothing_gamma": x}) for x in (10.0, 1.0, 0.3)]),
        "c": ("S-GMS with three values of zeta", [(f"{x:g}", {"smoothing_zeta": x}) for x in (0.99, 0.95, 0.9)]),
        "d": ("the whole loop", [("S-GMS", {})]),
    }
    position, gms = hysteresis(EIGHT, True)
    top = float(np.max(position))
    pictures = []
    for name, (title, entries) in variants.items():
        with sheet(f"figure3{name}", f"Figure 3({name}): {title}.") as drawn:
            axis = drawn.axes[0]
            axis.plot(position * 1e9, gms, color=TRUTH, label="GMS", linewidth=1.0)
            for (label, change), colour in zip(entries, (ESTIMATE, FORWARD, BACKWARD), strict=False):
                smooth = hysteresis(replace(EIGHT, **change), False)[1]
                axis.plot(position * 1e9, smooth, "--", color=colour, label=label)
            if name != "d":
                axis.set_xlim(0.1 * top * 1e9, 1.02 * top * 1e9)
                axis.set_ylim(0.5 * float(np.max(gms)), 1.08 * float(np.max(gms)))
            axis.set(xlabel="position [nm]", ylabel="friction [N]")
        pictures.append(drawn.picture)
    return tuple(pictures)


SEED = 1
_BEFORE, _AFTER = 3.0e-3, 12.0e-3  # s, around an onset


def onsets(record: StageRecord) -> tuple[float, float]:
    """Return when, in the second half of the second period, presliding and full sliding begin [s].

    Args:
        record: at least two periods.
    """
    time, speed = record.time, record.velocity
    late = time >= 1.6 * SINE_PERIOD
    reversal = float(time[late & (np.sign(speed) != np.sign(np.roll(speed, 1)))][0])
    after = time > reversal + 1.0e-3
    slowest = np.abs(np.gradient(record.element_force[:, -1], time))
    stuck = slowest > 0.02 * np.max(slowest[after & (time < reversal + 0.05)])
    sliding = time[after & ~stuck]
    return reversal, float(sliding[0])


def figure_five() -> Picture:
    """Draw Figure 5: position, velocity and friction over the sine."""
    record = simulate(CHOSEN, 2, SEED)
    signals = (
        ("position [um]", record.position * 1e6),
        ("velocity [mm/s]", record.velocity * 1e3),
        ("friction [N]", record.friction),
    )
    with sheet("figure5", "Figure 5: sine of 200 um at 5 Hz.", rows=3, height=1.8, sharex=True) as drawn:
        for axis, (label, values) in zip(drawn.axes, signals, strict=True):
            axis.plot(record.time, values, color=MEASURED)
            axis.set_ylabel(label)
        for onset in onsets(record):
            drawn.axes[2].axvspan(onset - _BEFORE, onset + _AFTER / 2, color=REFERENCE, alpha=0.3)
        drawn.axes[2].set_xlabel("time [s]")
    return drawn.picture


def figures_six_and_seven() -> tuple[Picture, ...]:
    """Draw Figures 6 and 7: estimates with kappa 20 % low and high."""
    return tuple(_zoom_figure(number, row) for number, row in ((6, "minus20"), (7, "plus20")))


def _zoom_figure(number: int, row: str) -> Picture:
    record = simulate(CHOSEN, 2, SEED)
    factor = ROWS[row]
    windows = onsets(record)
    caption = (
        f"Figure {number}: kappa {100 * (factor - 1):+.0f} %; GMS (a, b) and S-GMS (c, d) in presliding (a, c) and"
        " where full sliding begins (b, d). Circles: the stage at the corrections."
    )
    with sheet(f"figure{number}", caption, rows=4, height=2.1) as drawn:
        for i, model in enumerate(MODELS):
            friction = estimator_friction(model, factor)
            estimates: dict[str, Estimate] = {
                name: estimate(record, LOWPASS, estimator_settings(name), friction, CHOSEN.mass, factor)
                for name in ("ekf_z", "mhe_zp")
            }
            curves: tuple[tuple[str, str, str, Floats], ...] = (
                ("system", MEASURED, "-", record.friction),
                ("EKF(z)", FORWARD, "--", estimates["ekf_z"].live),
                ("MHE(z,p), live", ESTIMATE, ":", estimates["mhe_zp"].live),
                ("MHE, trajectory", BACKWARD, "-.", estimates["mhe_zp"].trajectory),
            )
            corrected = np.flatnonzero(np.isfinite(estimates["ekf_z"].results.innovation))
            for j, onset in enumerate(windows):
                axis = drawn.axes[2 * i + j]
                shown = (record.time >= onset - _BEFORE) & (record.time <= onset + _AFTER)
                for label, colour, style, values in curves:
                    named = label if i == j == 0 else None
                    axis.plot(record.time[shown] * 1e3, values[shown], style, color=colour, label=named)
                at = corrected[shown[corrected]]
                axis.plot(record.time[at] * 1e3, record.friction[at], "o", color=TRUTH, markersize=3, fillstyle="none")
                axis.set(xlabel="time [ms]", ylabel=f"({'abcd'[2 * i + j]}) friction [N]")
        drawn.axes[0].legend(loc="lower center", bbox_to_anchor=(0.45, 1.0), ncols=2)
    return drawn.picture


PERIODS = 2
"""Periods of the sine in a plot; Table II counts the last one."""
_SETTLE = 0.02  # s at the start without an error: an estimator begins without friction
_SHOWN = {"ekf_z": ("EKF(z)", "forward"), "mhe_zp": ("MHE(z,p)", "estimate")}


def estimates_over_time() -> list[Plot]:
    """Return a plot that zooms for each row of Table II: estimates of S-GMS, live, beside the stage."""
    record = simulate(CHOSEN, PERIODS, SEED)
    plots = []
    for row, factor in ROWS.items():
        friction = estimator_friction("sgms", factor)
        lines = []
        for name, (label, colour) in _SHOWN.items():
            found = estimate(record, LOWPASS, estimator_settings(name), friction, CHOSEN.mass, factor, False)
            lines.append(Line(label, found.live, colour))
        truth = np.where(record.time < _SETTLE, np.nan, record.friction)
        errors = [replace(line, values=line.values - truth) for line in lines]
        panels = [
            Panel("friction [N]", [Line("stage", record.friction, "measured"), *lines]),
            Panel("error [N]", errors),
            Panel("velocity [mm/s]", [Line("velocity", 1e3 * record.velocity, "ink")]),
            Panel("position [um]", [Line("position", 1e6 * record.position, "reference")]),
        ]
        caption = (
            f"Friction of the stage and live estimates of S-GMS with kappa {100 * (factor - 1):+.0f} %. Error: estimate"
            f" minus friction of the stage, without the first {1e3 * _SETTLE:.0f} ms."
        )
        plots.append(time_plot(f"over_time_{row}", caption, record.time, panels))
    return plots
