"""Plots over time of the paper's simulation: motion, true and estimated friction, and the error of the estimates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sgms_observer.paper.conditions import (
    CHOSEN,
    LOWPASS,
    ROWS,
    estimate,
    estimator_friction,
    estimator_settings,
    simulate,
)
from sgms_observer.paper.figures import SEED
from sgms_observer.report.drawing import Line, Panel, time_plot
from sgms_observer.report.page import Plot

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
