"""Simulate an axis in closed loop along a recording, with the augmented model as the truth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from sgms_observer.diagnosis.compensation_check import SKIPPED
from sgms_observer.diagnosis.motion import EDGE_TIME, HELD_LAG, motion_of
from sgms_observer.diagnosis.tracking import PredictedTracking, TrackingError
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings
from sim_plant.record import StageRecord
from sim_plant.reference_file import through_points
from sim_plant.stage import SimulatedStage

Floats = NDArray[np.float64]

MAX_SAMPLES = 200_000
MAX_SECONDS = 60.0
"""Samples and time [s] that are simulated, the last ones of the recording: some seconds of computing."""
HOLD = 1.5
"""Time from a sample to the middle of the interval in which its compensation acts, in samples."""
SUBSTEPS = 1
"""Integration steps per 0.1 ms: the errors differ from those with ten by less than a thousandth."""


def predict_tracking(
    record: Recording, given: AxisSettings, augmented: AxisSettings, band: float
) -> PredictedTracking | None:
    """Return the tracking errors that the augmented model promises; None where the simulated loop does not stay finite.

    The stage has the mass, friction and effects of ``augmented``, the controller of ``given`` and the encoder of the
    recording. Along a reference the compensation is a feedforward: it is computed from the run without it.

    Args:
        record: gives the motion, the rate and the encoder.
        given: settings as they were given.
        augmented: the same with what was found.
        band: a measured motion is followed below a multiple of this frequency [Hz].
    """
    count = min(len(record), MAX_SAMPLES, round(MAX_SECONDS / record.period))
    part = record.part(len(record) - count, len(record))
    reference = part.whole_reference
    path = _smooth(part, band) if reference is None else reference
    truth = _truth(part, given, augmented)
    moves = truth.stage.reference
    times = np.asarray(part.period * np.arange(count), dtype=np.float64)
    followed = through_points(
        times, path, "cubic", velocity=moves.velocity, acceleration=moves.acceleration, jerk=moves.jerk
    )
    counted = slice(round(SKIPPED / part.period), count - round(EDGE_TIME / part.period))
    plain = SimulatedStage(truth, part.period, reference=followed).step(count)
    runs = [plain]
    if not np.all(np.isfinite(plain.position)):
        return None
    for axis in (given, augmented):
        feedforward = _compensation(axis, truth, plain, part.period)
        runs.append(SimulatedStage(truth, part.period, reference=followed).step(count, feedforward))
    errors = [(run.position - run.reference_position)[counted] for run in runs]
    if not all(np.all(np.isfinite(error)) for error in errors):
        return None
    recorded = None
    if reference is not None:
        errors.append((part.position - reference)[counted])
        recorded = TrackingError.of(errors[-1])
    without, given_error, augmented_error = (TrackingError.of(error) for error in errors[:3])
    return PredictedTracking(
        without, given_error, augmented_error, recorded, part.duration, times[counted], tuple(errors)
    )


def _smooth(record: Recording, band: float) -> Floats:
    """Return the measured motion without its noise [m]."""
    return np.asarray(signal.sosfiltfilt(motion_of(record, HELD_LAG, band).smoothing, record.position))


def _truth(record: Recording, given: AxisSettings, augmented: AxisSettings) -> AxisSettings:
    """Return the axis whose stage is the augmented one."""
    noise = math.sqrt(max(record.position_noise**2 - record.encoder_step**2 / 12.0, 0.0))
    return replace(
        given,
        stage_friction=augmented.friction,
        stage_effects=augmented.effects,
        stage=replace(
            given.stage,
            mass=augmented.mass,
            substeps=given.stage.substeps if given.stage.actuation_delay else SUBSTEPS,  # a delay is whole steps
            encoder=replace(given.stage.encoder, resolution=record.encoder_step, noise=noise),
            accept_compensation=True,
        ),
    )


def _compensation(axis: AxisSettings, truth: AxisSettings, plain: StageRecord, period: float) -> Floats:
    """Return the compensation that acts at each sample of a run, one sample after it was computed [N]."""
    look_ahead = HOLD * period + truth.stage.actuation_delay
    switched_on = replace(axis.compensation, enabled=True, look_ahead=look_ahead)
    estimates = AxisObserver(replace(axis, compensation=switched_on), period).step(plain.samples)
    return np.concatenate(([0.0], np.nan_to_num(estimates.compensation[:-1])))
