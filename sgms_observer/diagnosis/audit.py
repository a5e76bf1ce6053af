"""Audit of the data before anything is fitted: what they can answer, and what can be read off them directly."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.settings.axis import AxisSettings

COARSER = 1.5
"""A grid this many times the configured resolution is a discrepancy."""


def findings(motions: Sequence[Motion], axis: AxisSettings) -> tuple[list[str], bool]:
    """Return sentences about the recordings, and whether their excitation is too poor to tell anything.

    Args:
        motions: recordings to learn from.
        axis: settings with the nominal model.
    """
    friction = Model.of(axis).friction
    reach = max(
        share * friction.static_force / kappa
        for share, kappa in zip(friction.element_fraction, friction.element_stiffness, strict=True)
    )
    slow = 3.0 * friction.stribeck_velocity
    notes, sliding, reversals, speeds = [], 0.0, 0, []
    for motion in motions:
        moving = np.abs(motion.velocity) > 0.05 * np.quantile(np.abs(motion.velocity), 0.99)
        sliding += float(np.sum(np.abs(np.diff(motion.position))))
        signs = np.sign(motion.velocity[moving])
        reversals += int(np.sum(signs[1:] != signs[:-1]))
        speeds.append(np.abs(motion.velocity[moving]))
        grid = f", position on a grid of {motion.resolution:.3g} m" if motion.resolution else ""
        notes.append(f"{motion.name}: {motion.time[-1]:.1f} s at {1.0 / motion.period:.0f} Hz{grid}")
    speed = np.concatenate(speeds)
    is_poor = sliding < 50.0 * reach or reversals < 2 or float(np.quantile(speed, 0.95)) < 1.0e-7
    if reversals < 10:
        notes.append(f"only {reversals} reversals: little is said about presliding and break-away")
    if float(np.mean(speed < slow)) < 0.01:
        notes.append(f"under 1 % of the motion is slower than {slow:.3g} m/s: little is said about low speed")
    if is_poor:
        notes.append("the stage hardly slides to and fro: record moves over the stroke in both directions")
    return notes, is_poor


def coarser_grid(motions: Sequence[Motion], configured: float) -> float | None:
    """Return the grid of the recorded positions where it is coarser than the configured resolution, else None [m]."""
    if configured <= 0.0:
        return None
    grid = max(motion.resolution for motion in motions)
    return grid if grid > COARSER * configured else None
