"""Figures 5 to 7: the sine, and how the estimators follow the friction at a reversal and into sliding."""

from __future__ import annotations

import numpy as np

from sgms_observer.observer.samples import Floats
from sgms_observer.paper.conditions import (
    CHOSEN,
    LOWPASS,
    MODELS,
    ROWS,
    SINE_PERIOD,
    estimator_friction,
    estimator_settings,
    simulate,
)
from sgms_observer.paper.estimate import Estimate, estimate
from sgms_observer.report.drawing import BACKWARD, ESTIMATE, FORWARD, MEASURED, REFERENCE, TRUTH, sheet
from sgms_observer.report.page import Picture
from sim_plant.record import StageRecord

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
