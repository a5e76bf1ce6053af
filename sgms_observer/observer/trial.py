"""Warm-up of an observer: a synthetic run that calls every kernel once, so that it is compiled before live samples."""

from __future__ import annotations

import numpy as np

from sgms_observer.compensation.horizon import KnownMotion
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples

_SAMPLES = 3000
_RATE = 40.0  # rad/s
_AMPLITUDE = 1.0e-4  # m


def run_all_kernels(observer: AxisObserver) -> None:
    """Run an observer over a small synthetic motion and look ahead. Its state is not usable afterwards.

    Args:
        observer: observer of the axis whose kernels are compiled, with its compensation enabled.
    """
    seconds = np.arange(2 * _SAMPLES) * observer.sample_period
    stamps = np.rint(seconds * 1e9).astype(np.int64)
    position, velocity = _AMPLITUDE * np.sin(_RATE * seconds), _AMPLITUDE * _RATE * np.cos(_RATE * seconds)
    past = slice(0, _SAMPLES)
    effort = np.sign(velocity[past])
    latest = observer.step(Samples(stamps[past], position[past], effort, position[past], velocity[past]))
    observer.horizon(latest, KnownMotion(stamps, position, velocity), 1.0)
