"""Typical sizes of the signals of one axis, which scale bounds and steps of the search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.errors import DataError
from sgms_observer.identification.prepared import Prepared

MIN_STEPS_OF_TRAVEL = 20.0
"""Travel over the smallest slip deflection that can be seen, below which nothing can be identified."""
_NOISES = 1.5
"""Smallest slip deflection over the position noise: an element that slips earlier looks like a step."""
_FINEST = 1.0e-7
"""The same over the travel, for recordings without noise; it bounds the size of the problem."""
_LARGEST_SHARE = 0.05  # of the travel: a friction that builds up over more is a spring, or gravity


@dataclass(frozen=True)
class Scales:
    """Typical sizes.

    Attributes:
        effort: rms effort [N].
        velocity: rms velocity [m/s].
        top_velocity: largest velocity [m/s].
        acceleration: rms acceleration [m/s^2].
        travel: longest travel within one piece [m].
        smallest: smallest slip deflection above the position noise [m].
        period: longest sample period of the simulation [s].
    """

    effort: float
    velocity: float
    top_velocity: float
    acceleration: float
    travel: float
    smallest: float
    period: float

    @property
    def largest(self) -> float:
        """Largest slip deflection of the search [m]."""
        return max(_LARGEST_SHARE * self.travel, 10.0 * self.smallest)

    @property
    def mass(self) -> float:
        """Mass that would need all of the effort [kg]."""
        return self.effort / self.acceleration

    @property
    def viscous(self) -> float:
        """Viscous coefficient that would need all of the effort [N s/m]."""
        return self.effort / self.velocity


def scales_of(data: Sequence[Prepared]) -> Scales:
    """Return the typical sizes of prepared recordings.

    Args:
        data: prepared recordings.

    Raises:
        DataError: if the axis hardly moves, or the effort is zero.
    """
    travel = max(float(np.ptp(piece.position)) for piece in data)
    noise = min(piece.noise for piece in data)
    smallest = max(_NOISES * noise, _FINEST * travel)
    if not travel >= MIN_STEPS_OF_TRAVEL * smallest or travel <= 0.0:
        raise DataError(
            f"the axis moves by {travel:.2g} {data[0].unit} only, {travel / max(noise, 1e-300):.3g} times the noise and"
            f" resolution of its position ({noise:.2g} {data[0].unit}); identification needs sliding and reversals:"
            " record longer strokes, or use a finer encoder"
        )
    effort = _rms([piece.effort(piece.time)[piece.usable] for piece in data])
    if not effort > 0.0:
        raise DataError("control_effort is zero throughout; record the effort that drives the axis")
    velocities = [piece.velocity[piece.usable] for piece in data]
    return Scales(
        effort,
        _rms(velocities),
        max(float(np.max(np.abs(values), initial=0.0)) for values in velocities),
        _rms([piece.acceleration[piece.usable] for piece in data]),
        travel,
        smallest,
        max(piece.period for piece in data),
    )


def _rms(parts: Sequence[np.ndarray]) -> float:
    """Return the root of the mean square over all parts."""
    return float(np.sqrt(np.mean(np.concatenate(list(parts)) ** 2)))
