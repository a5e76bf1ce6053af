"""Figures 5 to 7: the sine, and how the estimators follow the friction at a reversal and into sliding."""

from __future__ import annotations

from pathlib import Path

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
from sgms_observer.whole_file import write_figure
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


def figure_five(folder: Path) -> None:
    """Write Figure 5: position, velocity and friction over the sine."""
    from matplotlib.figure import Figure

    record = simulate(CHOSEN, 2, SEED)
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    signals = (
        ("position [µm]", record.position * 1e6),
        ("velocity [mm/s]", record.velocity * 1e3),
        ("friction [N]", record.friction),
    )
    for axis, (label, values) in zip(axes, signals, strict=True):
        axis.plot(record.time, values)
        axis.set_ylabel(label)
        axis.grid(alpha=0.3)
    for onset in onsets(record):
        axes[2].axvspan(onset - _BEFORE, onset + _AFTER / 2, alpha=0.2)
    axes[0].set_title("Figure 5: sine of 200 µm at 5 Hz")
    axes[2].set_xlabel("time [s]")
    write_figure(figure, folder / "figure5.png", 150)


def figures_six_and_seven(folder: Path) -> None:
    """Write Figures 6 and 7: estimates with kappa 20 % low and high."""
    for number, row in ((6, "minus20"), (7, "plus20")):
        _zoom_figure(folder / f"figure{number}.png", number, row)


def _zoom_figure(path: Path, number: int, row: str) -> None:
    from matplotlib.figure import Figure

    record = simulate(CHOSEN, 2, SEED)
    factor = ROWS[row]
    windows = onsets(record)
    figure = Figure(figsize=(9.0, 6.5), layout="constrained")
    axes = figure.subplots(2, 2)
    for i, model in enumerate(MODELS):
        friction = estimator_friction(model, factor)
        estimates: dict[str, Estimate] = {
            name: estimate(record, LOWPASS, estimator_settings(name), friction, CHOSEN.mass, factor)
            for name in ("ekf_z", "mhe_zp")
        }
        curves: tuple[tuple[str, str, Floats], ...] = (
            ("system", "b-", record.friction),
            ("EKF(z)", "g--", estimates["ekf_z"].live),
            ("MHE(z,p), live", "r:", estimates["mhe_zp"].live),
            ("MHE(z,p), trajectory", "r-.", estimates["mhe_zp"].trajectory),
        )
        corrected = np.flatnonzero(np.isfinite(estimates["ekf_z"].results.innovation))
        for j, onset in enumerate(windows):
            axis = axes[i, j]
            shown = (record.time >= onset - _BEFORE) & (record.time <= onset + _AFTER)
            for label, style, values in curves:
                axis.plot(record.time[shown] * 1e3, values[shown], style, label=label, linewidth=1.2)
            at = corrected[shown[corrected]]
            axis.plot(record.time[at] * 1e3, record.friction[at], "ko", markersize=3, fillstyle="none")
            letter = "abcd"[2 * i + j]
            axis.set_title(f"({letter}) {'GMS' if model == 'gms' else 'S-GMS'}, {('presliding', 'sliding')[j]}")
            axis.set_xlabel("time [ms]")
            axis.set_ylabel("friction [N]")
            axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8)
    figure.suptitle(f"Figure {number}: kappa {100 * (factor - 1):+.0f} %")
    write_figure(figure, path, 150)
