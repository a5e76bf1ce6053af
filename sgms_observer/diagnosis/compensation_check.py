"""Check of a model by observer and compensation: run both over a recording and compute what they leave."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.compensation.feedforward_kernel import standstill_velocity
from sgms_observer.diagnosis.evidence import blocks_of, improvement
from sgms_observer.diagnosis.model import Model, with_phases_of
from sgms_observer.diagnosis.motion import HELD_LAG, EffortLag, Motion, contact_position, delayed, motion_of
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

SKIPPED = 0.5
"""Time at the start that does not count, for the transients of the filters [s]."""


@dataclass(frozen=True)
class CompensationCheck:
    """Errors of observer and compensation with one model.

    Attributes:
        innovation: rms of measured minus predicted friction at the corrections [N].
        friction_not_cancelled: rms of effort minus mass times acceleration minus feedforward, below the band of
            residuals [N]. The acceleration is the measured one, not the observer's. Only samples where the feedforward
            follows the motion count; NaN if there are none.
        blocks: the same residual for the feedforward along the measured motion, in blocks of time [N]; 0 while the
            stage rests, because the effort at rest does not show what the feedforward should have been. The feedforward
            takes the motion, without encoder jitter, for a reference: neither the measured effort nor a filter with a
            lag hides an error of the model.
        reference_blocks: the same along the recorded reference, 0 while that rests; empty without a reference.
        share: share of the time in which the feedforward follows the motion.
        has_reference: whether ``friction_not_cancelled`` is computed along the recorded reference.
    """

    innovation: float
    friction_not_cancelled: float
    blocks: tuple[Floats, ...] = ()
    reference_blocks: tuple[Floats, ...] = ()
    share: float = 1.0
    has_reference: bool = False

    @property
    def along(self) -> str:
        """Return the motion that the feedforward was computed along, in words."""
        return "the recorded reference" if self.has_reference else "the measured motion"

    def growth(self, earlier: CompensationCheck) -> float:
        """Return the z-score by which the feedforward leaves more than that of an earlier model.

        It has to grow along the measured motion and along a recorded reference: the tracking error hides differences
        of two models along the reference, and an effect that resonates makes a force of the encoder's noise along the
        measured motion, which a feedforward along the reference does not.

        Args:
            earlier: the same of the earlier model.
        """
        pairs = [(self.blocks, earlier.blocks)]
        if self.reference_blocks:
            pairs.append((self.reference_blocks, earlier.reference_blocks))
        return min(improvement(*pair).z_score for pair in pairs)


def check_compensation(record: Recording, axis: AxisSettings, band: float, block: float) -> CompensationCheck:
    """Run observer and compensation over a recording, along its measured motion and its reference if it has one.

    A periodic disturbance has its phase in this recording.

    Args:
        record: position and effort.
        axis: settings with the model.
        band: upper corner of the band [Hz].
        block: length of a block of time [s].
    """
    lag = HELD_LAG if axis.filter.effort_is_held else 0.0
    motion = motion_of(record, EffortLag((lag,)), band)
    axis = with_whole_compensation(replace(axis, effects=with_phases_of(Model.of(axis), motion).effects))
    n, period = len(record.position), record.period
    samples = replace(record.samples, reference_position=np.full(n, np.nan))
    estimates = AxisObserver(axis, period).step(samples)
    good = record.time > SKIPPED
    innovation = estimates.innovation[good & np.isfinite(estimates.innovation)]
    needed = motion.effort - axis.mass * motion.acceleration  # the force of an added mass is part of the feedforward
    counted = motion.thinned(motion.time) > SKIPPED

    def left_along(reference: Floats) -> Floats:
        feedforward = AxisObserver(axis, period).step(replace(samples, reference_position=reference)).compensation
        applied = delayed(np.nan_to_num(feedforward), lag)[:: motion.step]
        return motion.low_pass(needed - applied)[counted]

    left_along_measured = left_along(contact_position(record.position, motion.contact_width, 1, motion.resolution))
    standstill = axis.compensation.standstill_velocity or standstill_velocity(axis.filter, period)
    slides = motion.thinned(np.abs(estimates.velocity)[:: motion.step] > standstill)[counted]
    reference = record.whole_reference
    left, follows = left_along_measured, slides
    if reference is not None:
        left, follows = left_along(reference), moves(reference, motion)[counted]

    def in_blocks(values: Floats) -> tuple[Floats, ...]:
        return tuple(blocks_of(values, motion.residual_period, block))

    return CompensationCheck(
        innovation=float(np.sqrt(np.mean(innovation**2))),
        friction_not_cancelled=float(np.sqrt(np.mean(left[follows] ** 2))) if np.any(follows) else math.nan,
        blocks=in_blocks(np.where(slides, left_along_measured, 0.0)),
        reference_blocks=() if reference is None else in_blocks(np.where(follows, left, 0.0)),
        share=float(np.mean(follows)),
        has_reference=reference is not None,
    )


def with_whole_compensation(axis: AxisSettings) -> AxisSettings:
    """Return the axis with the compensation of its whole model, for the effort of each sample: nothing limits it."""
    whole = replace(
        axis.compensation, enabled=True, gain=1.0, limit=1.0e6, slew_limit=1.0e9, fade_std=1.0e6,
        look_ahead=0.0,  # the recorded effort is the effort of its own sample
    )  # fmt: skip
    return replace(axis, compensation=whole)


def moves(values: Floats, motion: Motion) -> Booleans:
    """Return whether a signal of the recording changes, at the samples of residuals.

    Args:
        values: at the samples of the recording, shape (n,).
        motion: of the recording.
    """
    change = np.abs(np.diff(values, prepend=values[:1])) > 0.0
    window = motion.step * motion.thinning
    recent = np.convolve(change, np.ones(window), "full")[: len(change)] > 0.5
    return motion.thinned(recent[:: motion.step])


def can_look_ahead(axis: AxisSettings) -> bool:
    """Return whether a feedforward along measured motion can test a model: a delay needs future samples."""
    return all(item.name != "actuator_delay" for item in axis.effects)
