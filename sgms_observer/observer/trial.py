"""A made-up run of an observer that calls every kernel once, so that none is compiled or loaded while samples wait."""

from __future__ import annotations

import numpy as np

from sgms_observer.compensation.horizon import KnownMotion
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples

_SAMPLES = 3000
_RATE = 40.0  # rad/s
_AMPLITUDE = 1.0e-4  # m


def run_all_kernels(observer: AxisObserver) -> None:
    """Let an observer that is of no further use step through a small motion and look ahead.

    Args:
        observer: of the axis whose kernels are wanted, with its compensation enabled.
    """
    seconds = np.arange(2 * _SAMPLES) * observer.sample_period
    stamps = np.rint(seconds * 1e9).astype(np.int64)
    position, velocity = _AMPLITUDE * np.sin(_RATE * seconds), _AMPLITUDE * _RATE * np.cos(_RATE * seconds)
    past = slice(0, _SAMPLES)
    effort = np.sign(velocity[past])
    latest = observer.step(Samples(stamps[past], position[past], effort, position[past], velocity[past]))
    observer.horizon(latest, KnownMotion(stamps, position, velocity), 1.0)
