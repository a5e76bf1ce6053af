"""The closing step: observer and compensation over the same recording, with the given and with the augmented model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.evidence import blocks_of
from sgms_observer.diagnosis.motion import HELD, later, motion_of
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

BLOCK = 0.5
"""Length of a block of time [s]."""
SKIPPED = 0.5  # s, while filters fill


@dataclass(frozen=True)
class Closing:
    """Errors with one model.

    Attributes:
        innovation: rms of measured minus predicted friction at the corrections [N].
        compensation: rms of what the feedforward leaves of effort minus mass times acceleration, below the band of
            residuals, with the acceleration as it was and not as an observer knows it at the time [N].
        blocks: what ``compensation`` is the rms of, in blocks of time [N].
    """

    innovation: float
    compensation: float
    blocks: tuple[NDArray[np.float64], ...] = ()


def closing(record: Recording, axis: AxisSettings, period: float, band: float) -> Closing:
    """Run observer and compensation over a recording, along its measured motion.

    Args:
        record: position and effort.
        axis: settings with the model to try.
        period: nominal sample period [s].
        band: upper corner of the judging band [Hz].
    """
    tuned = replace(axis.compensation, enabled=True, gain=1.0, limit=1.0e6, slew_limit=1.0e9, fade_std=1.0e6)
    observer = AxisObserver(replace(axis, compensation=tuned), period)
    n = len(record.position)
    stamp = np.round(np.arange(n) * record.period * 1e9).astype(np.int64)
    nothing = np.full(n, np.nan)
    estimates = observer.step(Samples(stamp, record.position, record.effort, nothing, nothing))
    good = np.arange(n) * record.period > SKIPPED
    innovation = estimates.innovation[good & np.isfinite(estimates.innovation)]
    motion = motion_of(record, HELD if axis.filter.effort_is_held else 0.0, band)
    feedforward = later(np.nan_to_num(estimates.compensation), motion.lag)[:: motion.step]
    mass = axis.mass + observer.effects.added_mass
    left = motion.low_pass(motion.effort - mass * motion.acceleration - feedforward)
    left = left[motion.thinned(motion.time) > SKIPPED]
    blocks = tuple(blocks_of(left, motion.residual_period, BLOCK))
    return Closing(float(np.sqrt(np.mean(innovation**2))), float(np.sqrt(np.mean(left**2))), blocks)


def can_look_ahead(axis: AxisSettings) -> bool:
    """Return whether a feedforward along measured motion is a fair test of a model: a delay asks for the future."""
    return all(item.name != "actuator_delay" for item in axis.effects)
