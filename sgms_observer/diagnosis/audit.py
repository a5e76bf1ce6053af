"""Audit of the data before anything is fitted: what they can answer, and what can be read off them directly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.settings.axis import AxisSettings

MIN_GRID_RATIO = 1.5
"""A grid this many times the configured resolution is a discrepancy."""
MIN_TRAVEL_OVER_SLIP_DEFLECTION = 50.0
"""Least travel over the contact's largest slip deflection: below it the contact hardly slides."""
MIN_GRID_STEPS = 50
"""Least range of the position in steps of the encoder's grid: below it the encoder is too coarse for the motion."""
MIN_REVERSALS = 2
"""Least number of reversals: with fewer, friction and offset cannot be told apart."""
MOVING = 0.05
"""Slower than this share of the fast speed (99 %) the stage does not count as moving."""
WIDE_ANGLE = 0.5
"""Range of the position from which a sine of it differs from a line [rad]."""
REVERSED_Z = 6.0
"""Standard errors by which friction has to be negative for the sign of the effort to be called reversed."""


@dataclass(frozen=True)
class Audit:
    """What the recordings can answer.

    Attributes:
        notes: sentences about the recordings.
        warnings: sentences that must not be overlooked.
        is_poor: whether their excitation is too poor to tell anything.
        resolution: coarser encoder step than the settings say [its unit], or None.
    """

    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    is_poor: bool
    resolution: float | None


def audit(motions: Sequence[Motion], axis: AxisSettings) -> Audit:
    """Audit recordings.

    Args:
        motions: recordings to learn from.
        axis: settings with the nominal model.
    """
    units = axis.units
    friction = Model.of(axis).friction
    slip_deflection = max(
        share * friction.static_force / kappa
        for share, kappa in zip(friction.element_fraction, friction.element_stiffness, strict=True)
    )
    notes, warnings = [], []
    sliding, reversals = sum(map(travel_of, motions)), sum(map(reversals_of, motions))
    for motion in motions:
        grid = f", position on a grid of {motion.resolution:.3g} {units.position}" if motion.resolution else ""
        notes.append(
            f"{motion.name}: {motion.time[-1]:.1f} s at {motion.step / motion.period:.4g} Hz, judged below"
            f" {motion.band:.3g} Hz{grid}"
        )
    position = np.concatenate([motion.position for motion in motions])
    grid_step = max(motion.resolution for motion in motions)
    poor = []
    if sliding < MIN_TRAVEL_OVER_SLIP_DEFLECTION * slip_deflection:
        poor.append("the axis hardly slides: record moves over the stroke in both directions")
    if reversals < MIN_REVERSALS:
        poor.append("the axis hardly reverses: record moves in both directions, at least ten reversals")
    if grid_step > 0.0 and float(np.ptp(position)) < MIN_GRID_STEPS * grid_step:
        poor.append(
            f"the encoder is too coarse for this motion ({float(np.ptp(position)) / grid_step:.0f} steps of"
            f" {grid_step:.3g} {units.position} in all): move further"
        )
    if not poor and is_reversed(motions):
        poor.append(
            "the effort points against the motion that it makes: turn the sign of effort_scale in the parameter file,"
            " or that of the effort when the log is converted"
        )
    if reversals < 10 and not poor:
        notes.append(f"only {reversals} reversals: little can be said about presliding and break-away")
    warnings += poor
    configured = axis.stage.encoder.resolution
    coarser = configured > 0.0 and grid_step > MIN_GRID_RATIO * configured
    return Audit(tuple(notes), tuple(warnings), bool(poor), grid_step if coarser else None)


def travel_of(motion: Motion) -> float:
    """Return the distance that a recording covers [m or rad]."""
    return float(np.sum(np.abs(np.diff(motion.position))))


def reversals_of(motion: Motion) -> int:
    """Return how often a recording reverses between parts that count as moving."""
    moving = np.abs(motion.velocity) > MOVING * np.quantile(np.abs(motion.velocity), 0.99)
    signs = np.sign(motion.velocity[moving])
    return int(np.sum(signs[1:] != signs[:-1]))


def is_reversed(motions: Sequence[Motion]) -> bool:
    """Return whether the effort surely points against the motion: mass, friction and the work done would be negative.

    A machine takes more work than it gives back; only the sign of the effort can turn that round.

    Args:
        motions: recordings.
    """
    columns, target, work = [], [], 0.0
    for motion in motions:
        speed = motion.low_pass(motion.velocity)
        sign = np.tanh(speed / (MOVING * float(np.quantile(np.abs(speed), 0.99)) + 1e-300))
        work += float(motion.effort @ motion.velocity) * motion.period
        columns.append(np.column_stack([sign, motion.low_pass(motion.acceleration), *_conservative(motion)]))
        target.append(motion.low_pass(motion.effort))
    rows, effort = np.vstack(columns), np.concatenate(target)
    rows = rows / np.maximum(np.std(rows, axis=0), 1e-12)
    solution = np.linalg.lstsq(rows, effort, rcond=None)[0]
    left = effort - rows @ solution
    # neighbouring samples are one: as many independent ones as the band lets pass
    share = 2.0 * motions[0].band * motions[0].residual_period
    variance = np.maximum(np.diag(np.linalg.pinv(rows.T @ rows)), 0.0)
    error = np.sqrt(variance * float(left @ left) / max(len(left) * share, 1.0))
    friction, mass = solution[:2] / np.maximum(error[:2], 1e-300)
    return bool(friction < -REVERSED_Z and mass < 0.0 and work < 0.0)


def _conservative(motion: Motion) -> list[NDArray[np.float64]]:
    """Return columns of forces that depend on the place: constant, spring, and gravity where the angle is wide."""
    place = motion.thinned(motion.position)
    listed = [np.ones(len(place)), place]
    return [*listed, np.sin(place), np.cos(place)] if float(np.ptp(place)) > WIDE_ANGLE else listed
