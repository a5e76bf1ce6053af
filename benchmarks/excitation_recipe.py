"""The fixed recipe that ``sgms excite`` followed before it designed by information: the baseline of its benchmark.

Four kinds of motion, each for the parameters only it can show: nested reversals from far below the presliding distance
upwards (stiffness distribution), slow traverses at log-spaced speeds (Stribeck curve), fast ones (viscous friction),
and moves at the acceleration limit (mass). Dwells in between show offset and noise.
"""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.excitation.limits import ExcitationLimits, Track
from sgms_observer.settings.axis import AxisSettings

_REVERSALS = 10  # amplitudes of the nested reversals
_CYCLES = 3  # of each amplitude
_REVERSAL_FREQUENCY = 4.0  # Hz
_SMALL_FREQUENCY = 2.0  # Hz, for reversals below the presliding distance
_SPEEDS = 10  # traverses, log-spaced
_SLOWEST_SHARE = 0.01  # slowest traverse over the Stribeck velocity
_SLOWEST_TIME = 3.0  # longest traverse in one direction [s]
_FAST_MOVES = 6
_DWELL = 0.25  # s


def build_recipe(axis: AxisSettings, limits: ExcitationLimits, period: float) -> Floats:
    """Build the recipe for one axis.

    Args:
        axis: the start settings: only the order of magnitude of presliding distance and Stribeck velocity is used.
        limits: what the table may do.
        period: time between two samples of the reference [s].

    Returns:
        The positions of the reference around 0, inside the limits [m], shape (n,).
    """
    friction = axis.friction
    fractions = np.array(friction.element_fraction)
    deflection = fractions * friction.static_force / np.array(friction.element_stiffness)
    presliding = min(2.0 * float(np.max(deflection)), 0.1 * limits.stroke)
    half = 0.5 * limits.stroke
    track = Track(period, limits, -half, half, 0.0)
    track.dwell(2.0 * _DWELL)
    _reversals(track, presliding, half)
    _traverses(track, presliding, half, friction.stribeck_velocity)
    _fast(track, half)
    return np.asarray(period * np.cumsum(np.concatenate([np.zeros(1), track.motion()])))


def _reversals(track: Track, presliding: float, half: float) -> None:
    """Add nested reversals, after sliding far enough that every element is at its limit."""
    largest = min(3.0 * presliding, 0.4 * half)
    slow = min(track.limits.speed, 50.0 * presliding)
    for _ in range(2):
        track.move(min(10.0 * presliding, 0.9 * half), slow, track.limits.acceleration)
        track.dwell(_DWELL)
        for amplitude in np.geomspace(largest, track.limits.smallest, _REVERSALS):
            frequency = _REVERSAL_FREQUENCY if 2.0 * amplitude > presliding else _SMALL_FREQUENCY
            track.cycles(float(amplitude), _CYCLES, frequency)
        track.dwell(_DWELL)
        track.move(-min(10.0 * presliding, 0.9 * half), slow, track.limits.acceleration)
        track.dwell(_DWELL)


def _traverses(track: Track, presliding: float, half: float, stribeck_velocity: float) -> None:
    """Add traverses forth and back from creep to full speed."""
    slowest = max(_SLOWEST_SHARE * stribeck_velocity, 4.0 * presliding / _SLOWEST_TIME)
    slowest = min(slowest, 0.1 * track.limits.speed)
    for speed in np.geomspace(slowest, track.limits.speed, _SPEEDS):
        ramps = 0.5 * math.pi * float(speed) ** 2 / track.limits.acceleration
        reach = min(max(4.0 * presliding, 0.3 * float(speed) + ramps), 2.0 * half)
        for side in (0.5, -0.5):
            track.move(side * reach, float(speed), track.limits.acceleration)
            track.dwell(0.4 * _DWELL)


def _fast(track: Track, half: float) -> None:
    """Add moves at the acceleration limit, of several lengths."""
    longest = min(half, 0.5 * math.pi * track.limits.speed**2 / track.limits.acceleration)
    for share in np.geomspace(1.0, 0.1, _FAST_MOVES):
        for side in (1.0, -1.0):
            track.move(side * 0.5 * share * longest, track.limits.speed, track.limits.acceleration)
    track.move(0.0, track.limits.speed, track.limits.acceleration)
    track.dwell(2.0 * _DWELL)
