"""Checks of the recordings before any fit: excitation, encoder resolution, sign of the effort."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.model import HALF_A_REVERSAL, Model, hidden_by_encoder
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.offline.cut_off_logs import cut_off_logs
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import Units

MIN_GRID_RATIO = 1.5
"""Smallest ratio of measured encoder step to configured resolution that is reported as a discrepancy."""
MIN_TRAVEL_OVER_SLIP_DEFLECTION = 50.0
"""Smallest ratio of travel to the largest slip deflection. Below it the contact hardly slides."""
MIN_GRID_STEPS = 50
"""Smallest range of the position in encoder steps. Below it the encoder is too coarse for the motion."""
MIN_REVERSALS = 2
"""Smallest number of reversals. With fewer, friction and offset cannot be distinguished."""
MOVING_SPEED_SHARE = 0.05
"""The stage counts as moving above this share of the 99 % quantile of the speed."""
WIDE_ANGLE = 0.5
"""Range of the position above which gravity is not linear in it [rad]."""
REVERSED_Z = 6.0
"""Standard errors by which the fitted friction must be negative for a reversed sign of the effort."""


@dataclass(frozen=True)
class Audit:
    """Result of the checks.

    Attributes:
        notes: sentences about the recordings.
        warnings: sentences for the user.
        is_poor: whether the excitation is too poor for any result.
        hidden_by_encoder: friction of the file that reverses within one encoder step, over the static force.
        resolution: measured encoder step if it is coarser than the configured one [its unit], or None.
    """

    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    is_poor: bool
    hidden_by_encoder: float
    resolution: float | None


def audit(motions: Sequence[Motion], axis: AxisSettings) -> Audit:
    """Check recordings.

    Args:
        motions: fitted recordings.
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
        poor.append(
            f"the axis hardly reverses: record moves in both directions, with at least {MIN_REVERSALS} reversals"
        )
    if grid_step > 0.0 and float(np.ptp(position)) < MIN_GRID_STEPS * grid_step:
        poor.append(
            f"the encoder is too coarse for this motion ({float(np.ptp(position)) / grid_step:.0f} steps of"
            f" {grid_step:.3g} {units.position} in all): move further"
        )
    if not poor and is_reversed(motions):
        poor.append(
            "the sign of control_effort is reversed relative to position: reverse the sign of effort_scale in the"
            " parameter file, or that of the effort when the log is converted"
        )
    if reversals < 10 and not poor:
        notes.append(f"only {reversals} reversals: little can be said about presliding and break-away")
    warnings += poor
    hidden = hidden_by_encoder(friction, motions)
    if hidden > HALF_A_REVERSAL:
        warnings.append(
            f"the encoder step of {grid_step:.3g} {units.position} is too coarse for the contact:"
            f" {50.0 * hidden:.0f} % of the change of friction at a reversal lies within one encoder step, so the"
            " effects that resemble contact friction (delay, saturation, mass error) are not named. Use a finer encoder"
        )
    configured = axis.stage.encoder.resolution
    coarser = configured > 0.0 and grid_step > MIN_GRID_RATIO * configured
    return Audit(tuple(notes), tuple(warnings), bool(poor), hidden, grid_step if coarser else None)


def cut_off_warnings(records: Sequence[Recording], units: Units) -> tuple[str, ...]:
    """Return a sentence about each log that shows no effort beyond a limit."""
    return tuple(
        f"the effort of {log.name} is cut off at {' and '.join(units.readable(limit, 'N') for limit in log.limits)},"
        f" which {100.0 * log.share:.2g} % of the samples have: what the model needs beyond was not judged. If the"
        " drive was not at its limit, log a larger range"
        for log in cut_off_logs(records)
    )


def travel_of(motion: Motion) -> float:
    """Return the distance that a recording covers [m or rad]."""
    return float(np.sum(np.abs(np.diff(motion.position))))


def reversals_of(motion: Motion) -> int:
    """Return how often a recording reverses between parts that count as moving."""
    moving = np.abs(motion.velocity) > MOVING_SPEED_SHARE * np.quantile(np.abs(motion.velocity), 0.99)
    signs = np.sign(motion.velocity[moving])
    return int(np.sum(signs[1:] != signs[:-1]))


def is_reversed(motions: Sequence[Motion]) -> bool:
    """Return whether the sign of the effort is reversed: fitted mass, fitted friction and work are all negative.

    A machine dissipates energy, so all three are positive with the right sign.

    Args:
        motions: recordings.
    """
    columns, target, work = [], [], 0.0
    for motion in motions:
        speed = motion.low_pass(motion.velocity)
        sign = np.tanh(speed / (MOVING_SPEED_SHARE * float(np.quantile(np.abs(speed), 0.99)) + 1e-300))
        work += float(motion.effort @ motion.velocity) * motion.period
        columns.append(np.column_stack([sign, motion.low_pass(motion.acceleration), *_conservative(motion)]))
        target.append(motion.low_pass(motion.effort))
    rows, effort = np.vstack(columns), np.concatenate(target)
    rows = rows / np.maximum(np.std(rows, axis=0), 1e-12)
    solution = np.linalg.lstsq(rows, effort, rcond=None)[0]
    left = effort - rows @ solution
    # neighbouring samples are correlated: the band sets the number of independent ones
    share = 2.0 * motions[0].band * motions[0].residual_period
    variance = np.maximum(np.diag(np.linalg.pinv(rows.T @ rows)), 0.0)
    error = np.sqrt(variance * float(left @ left) / max(len(left) * share, 1.0))
    friction, mass = solution[:2] / np.maximum(error[:2], 1e-300)
    return bool(friction < -REVERSED_Z and mass < 0.0 and work < 0.0)


def _conservative(motion: Motion) -> list[Floats]:
    """Return columns of forces that depend on the position: constant, spring, gravity if the angle is wide."""
    place = motion.thinned(motion.position)
    listed = [np.ones(len(place)), place]
    return [*listed, np.sin(place), np.cos(place)] if float(np.ptp(place)) > WIDE_ANGLE else listed
