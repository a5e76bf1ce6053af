"""Simulate a stage with the observer in the loop, without and with compensation.

python examples/compensate_in_the_loop.py
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import recordings

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.settings.load import load_settings
from sim_plant.closed_loop import ClosedLoop
from sim_plant.table import SimulatedTable


def main() -> None:
    """Do the job of the example."""
    args = recordings.options(__doc__, "out/compensate", 10.0)
    settings = load_settings(recordings.make(args.out, args.seconds).config)
    for gain in (0.0, 0.3, 0.6, 0.9):  # the order of docs/deployment.md
        axis = settings.axes[0]
        axis = replace(axis, compensation=replace(axis.compensation, enabled=gain > 0.0, gain=gain))
        now = replace(settings, axes=(axis,))
        observer = AxisObserver(axis, now.sample_period)
        loop = ClosedLoop(SimulatedTable(now), [observer.step], has_feedback=gain > 0.0)
        (record,), _ = loop.step(round(args.seconds / now.sample_period))
        error = (record.position - record.reference_position)[round(0.5 / now.sample_period) :]
        rms, peak = float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error)))
        print(f"gain {gain:.1f}: tracking error {1e6 * rms:.3f} um rms, {1e6 * peak:.3f} um peak")


if __name__ == "__main__":
    main()
