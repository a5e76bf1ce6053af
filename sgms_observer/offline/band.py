"""The band: the frequencies at which measured and modelled effort are compared.

Mass times the acceleration of a noisy position grows with the frequency to the power of 5/2. Above the corner chosen
here it would be larger than the share ``NOISE_SHARE`` of the effort (or larger than the effort's own noise), and a
residual would show the encoder instead of the machine. Identification and diagnosis use the same function.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal

from sgms_observer.errors import ConfigurationError, DataError
from sgms_observer.offline.encoder import white_noise
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

HIGHEST_CORNER = 160.0
"""Highest corner [Hz]: friction compensation acts below it."""
RATE_SHARE = 0.1
"""Highest corner over the sample rate: the driving position is filtered at 2.5 times the corner."""
NOISE_SHARE = 0.02
"""Share of the rms effort that mass times the noise of the acceleration may reach: small beside a residual of 5 %."""
MIN_PERIODS = 10.0
"""Shortest longest recording, in periods of the corner that the user wants."""
_MASS_CORNER = 10.0  # Hz, at which the rough mass is read
_MASS_RATE_SHARE = 0.05
_MIN_INERTIA_SHARE = 0.01  # of the rms effort; below it the recordings do not show the mass


@dataclass(frozen=True)
class Band:
    """A band with its reason.

    Attributes:
        corner: its upper corner [Hz].
        limit: what limits it, in words.
    """

    corner: float
    limit: str

    def sentence(self) -> str:
        """Return the sentence that commands print."""
        return f"band 0 to {self.corner:.4g} Hz, limited by {self.limit}"


def refuse_cutoff(cutoff: float) -> None:
    """Refuse a corner that is no frequency, before any work.

    Args:
        cutoff: corner that the user wants [Hz]; 0 for none.

    Raises:
        ConfigurationError: it is negative or not finite.
    """
    if not 0.0 <= cutoff < math.inf:
        raise ConfigurationError(
            [f"--cutoff {cutoff:g} Hz must be a positive number; leave the option out for the default"]
        )


def choose_band(recordings: Sequence[Recording], axis: AxisSettings, cutoff: float = 0.0) -> Band:
    """Choose the band.

    Args:
        recordings: evenly sampled pieces of one axis.
        axis: its settings; their mass counts only where the recordings do not show one.
        cutoff: corner that the user wants [Hz]; 0 for none.

    Raises:
        DataError: the recordings are too slow or too short for the corner that the user wants.
    """
    rate = min(1.0 / recording.period for recording in recordings)
    if cutoff > 0.0:
        longest = max(recording.duration for recording in recordings)
        if not MIN_PERIODS / longest <= cutoff < 0.5 * rate:
            raise DataError(
                f"--cutoff {cutoff:.4g} Hz must lie between {MIN_PERIODS / longest:.2g} and {0.5 * rate:.4g} Hz; leave"
                f" it out, or choose {MIN_PERIODS:g} periods in the longest recording and below half the sample rate"
            )
        return Band(cutoff, "--cutoff")
    limits = [
        (HIGHEST_CORNER, "the frequencies that compensation acts at"),
        (RATE_SHARE * rate, f"the sample rate of {rate:.4g} Hz"),
        (_noise_corner(recordings, axis), "the noise and resolution of the encoder"),
    ]
    return Band(*min(limits))


def rough_mass(recordings: Sequence[Recording], start_mass: float) -> float:
    """Return a rough mass for the choice of the band [kg or kg m^2].

    Least squares of the effort on acceleration, velocity, direction, position and a constant, at low frequencies.

    Args:
        recordings: evenly sampled pieces of one axis.
        start_mass: returned where the recordings do not show the mass [kg or kg m^2].
    """
    rows, efforts = [], []
    for recording in recordings:
        rate = 1.0 / recording.period
        corner = min(_MASS_CORNER, _MASS_RATE_SHARE * rate)
        sections = signal.butter(4, 2.0 * corner / rate, output="sos")
        position, effort = (signal.sosfiltfilt(sections, values) for values in (recording.position, recording.effort))
        velocity = np.gradient(position, recording.period)
        acceleration = np.gradient(velocity, recording.period)
        stride = max(1, int(rate / (4.0 * corner)))
        ones = np.ones(len(position))
        columns = [acceleration, velocity, np.sign(velocity), np.sin(position), np.cos(position), ones]
        rows.append(np.column_stack(columns)[::stride])
        efforts.append(effort[::stride])
    matrix, effort = np.concatenate(rows), np.concatenate(efforts)
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    mass = float(np.linalg.lstsq(matrix / scale, effort, rcond=1e-6)[0][0] / scale[0])
    inertia = mass * float(np.sqrt(np.mean(matrix[:, 0] ** 2)))
    return mass if inertia > _MIN_INERTIA_SHARE * float(np.std(effort)) else start_mass


def _noise_corner(recordings: Sequence[Recording], axis: AxisSettings) -> float:
    """Return the corner below which the acceleration's noise, times the mass, stays within its limit [Hz]."""
    mass = rough_mass(recordings, axis.mass)
    effort_rms = float(np.std(np.concatenate([recording.effort for recording in recordings])))
    corners = []
    for recording in recordings:
        # white noise of density 2 s^2 T, times (2 pi f)^4, summed up to the corner
        per_corner = 2.0 * recording.position_noise**2 * recording.period * (2.0 * math.pi) ** 4 / 5.0 * mass**2
        per_noise = 2.0 * white_noise(recording.effort) ** 2 * recording.period
        by_share = ((NOISE_SHARE * effort_rms) ** 2 / max(per_corner, 1e-300)) ** 0.2
        by_noise = (per_noise / max(per_corner, 1e-300)) ** 0.25
        corners.append(max(by_share, by_noise))
    return min(corners) if effort_rms > 0.0 else HIGHEST_CORNER
