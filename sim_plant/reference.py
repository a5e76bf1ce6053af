"""References: what the simulated stage is asked to follow, as functions of time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.stage import ReferenceSettings
from sim_plant.followed_reference import FollowedReference
from sim_plant.piecewise_motion import PiecewiseCubic, back_and_forth
from sim_plant.reference_file import read_reference_file

Floats = NDArray[np.float64]


class Reference(Protocol):
    """A motion that can be asked for any time."""

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion.

        Args:
            time: times [s], from 0 on, shape (n,).

        Returns:
            Position [m], velocity [m/s] and acceleration [m/s^2], each of shape (n,).
        """
        ...


@dataclass(frozen=True)
class Sines:
    """A sum of sines, starting at position sum(amplitude sin(phase)).

    Attributes:
        amplitudes: amplitude of each sine [m], shape (n,).
        frequencies: frequency of each sine [Hz], shape (n,).
        phases: phase of each sine at time 0 [rad], shape (n,).
    """

    amplitudes: Floats
    frequencies: Floats
    phases: Floats

    def at(self, time: Floats) -> tuple[Floats, Floats, Floats]:
        """Evaluate the motion; see ``Reference.at``."""
        position, velocity, acceleration = np.zeros_like(time), np.zeros_like(time), np.zeros_like(time)
        for amplitude, frequency, phase in zip(self.amplitudes, self.frequencies, self.phases, strict=True):
            rate = 2.0 * np.pi * frequency
            sine = amplitude * np.sin(rate * time + phase)
            position += sine
            velocity += rate * amplitude * np.cos(rate * time + phase)
            acceleration -= rate * rate * sine
        return position, velocity, acceleration


def make_reference(settings: ReferenceSettings, name: str = "x") -> Reference:
    """Build the reference of one axis.

    Args:
        settings: the axis's ``stage.reference``.
        name: the axis, for error sentences.

    Returns:
        The motion.

    Raises:
        ConfigurationError: if a multi_sine's lists do not match, a stroke is zero, or a file cannot be used.
    """
    if settings.kind == "sine":
        return Sines(np.array([settings.amplitude]), np.array([settings.frequency]), np.zeros(1))
    if settings.kind == "topic":
        return FollowedReference()
    if settings.kind == "multi_sine":
        return _multi_sine(settings, name)
    if settings.kind == "point_to_point":
        return _point_to_point(settings, name)
    return _from_file(settings, name)


def _multi_sine(settings: ReferenceSettings, name: str) -> Sines:
    counts = {len(settings.amplitudes), len(settings.frequencies), len(settings.phases or settings.frequencies)}
    if len(counts) != 1 or 0 in counts:
        raise ConfigurationError(
            [
                f"{name}.stage.reference: a multi_sine needs amplitudes and frequencies of one length (and phases, or"
                f" none), got {len(settings.amplitudes)}, {len(settings.frequencies)} and {len(settings.phases)}; give"
                " one entry per sine"
            ]
        )
    phases = np.array(settings.phases or [0.0] * len(settings.frequencies))
    return Sines(np.array(settings.amplitudes), np.array(settings.frequencies), phases)


def _point_to_point(settings: ReferenceSettings, name: str) -> PiecewiseCubic:
    if settings.amplitude == 0.0:
        raise ConfigurationError(
            [f"{name}.stage.reference.amplitude = 0 leaves a point_to_point move no way to go; give it a stroke"]
        )
    return back_and_forth(settings.amplitude, settings.velocity, settings.acceleration, settings.jerk, settings.dwell)


def _from_file(settings: ReferenceSettings, name: str) -> PiecewiseCubic:
    if not settings.file:
        raise ConfigurationError(
            [f"{name}.stage.reference.file is empty; name a CSV with the columns time [s] and position [m; rad]"]
        )
    return read_reference_file(
        Path(settings.file),
        settings.interpolation,
        velocity=settings.velocity,
        acceleration=settings.acceleration,
        jerk=settings.jerk,
    )
