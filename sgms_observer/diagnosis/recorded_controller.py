"""The linear controller that a recording with a reference shows, for a simulated loop that follows as the machine did.

A PID, a PD with feedforward and a cascade of P and PI loops are all a PID on the tracking error and a linear
feedforward of the reference:

effort = k_p e + k_d e' + k_i integral of e + c_0 + c_1 r + c_2 r' + c_3 r'', e = r - q.

Where a friction compensation was on, a stiffer PID would stand for it. So the compensation of the model is tried as a
further term.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import ControllerSettings

MAX_COMPENSATION = 0.5
"""Largest share of the compensation in the effort with which no compensation counts as on: half of it."""


@dataclass(frozen=True)
class RecordedController:
    """A controller, and what it adds to a PID on the tracking error.

    Attributes:
        settings: the PID in the form of ``stage.controller``.
        feedforward: of the reference, beside the PID, at each sample of the recording [N], shape (n,).
    """

    settings: ControllerSettings
    feedforward: Floats

    @property
    def sentence(self) -> str:
        """Return the PID in words."""
        one = self.settings
        return (
            f"bandwidth {one.bandwidth:.3g} Hz, damping_ratio {one.damping_ratio:.3g},"
            f" integral_rate {one.integral_rate:.3g} Hz"
        )

    def as_dict(self) -> dict[str, float]:
        """Return the PID for JSON."""
        one = self.settings
        return {"bandwidth": one.bandwidth, "damping_ratio": one.damping_ratio, "integral_rate": one.integral_rate}


def recorded_controller(
    record: Recording, mass: float, given: ControllerSettings, compensation: Floats, band: float
) -> RecordedController | None:
    """Return the controller that predicts the recorded effort best, by least squares below the band.

    The relation holds between filtered signals as between the signals themselves. Encoder noise that the controller got
    is part of it; noise of the log alone makes the gains too small.

    Args:
        record: position, effort and reference.
        mass: that the settings are scaled with [kg].
        given: settings of the file; the limit of the effort is taken from them.
        compensation: of the whole model along the recorded motion [N], shape (n,).
        band: upper corner of the band [Hz].

    Returns:
        None without a reference at every sample, where a gain of the PID has the wrong sign, and where the effort holds
        more than ``MAX_COMPENSATION`` of the compensation.
    """
    reference = record.whole_reference
    if reference is None:
        return None
    period, motion = record.period, motion_of(record, band=band)
    error, rate = reference - record.position, np.gradient(reference, period)
    centred = reference - np.mean(reference)
    of_reference = np.array([np.ones(len(record)), centred, rate, np.gradient(rate, period)])
    of_error = np.array([error, np.gradient(error, period), period * np.cumsum(error)])
    columns = np.vstack([of_error, of_reference, compensation])
    size = np.sqrt(np.mean(columns**2, axis=1))
    size[size == 0.0] = 1.0
    filtered = np.array([motion.low_pass(motion.smoothed(one)) for one in (*(columns / size[:, None]), record.effort)])

    def gains(count: int) -> Floats:
        return np.asarray(np.linalg.lstsq(filtered[:count].T, filtered[-1], rcond=None)[0] / size[:count])

    share, found = gains(len(columns))[-1], gains(len(columns) - 1)
    proportional, derivative, integral = map(float, found[: len(of_error)])
    if proportional <= 0.0 or derivative <= 0.0 or abs(share) > MAX_COMPENSATION:
        return None
    omega = math.sqrt(proportional / mass)
    settings = replace(
        given,
        bandwidth=omega / (2.0 * math.pi),
        damping_ratio=derivative / (2.0 * omega * mass),
        integral_rate=max(integral, 0.0) / proportional / (2.0 * math.pi),
        feedforward_mass=0.0,
    )
    return RecordedController(settings, found[len(of_error) :] @ of_reference)
