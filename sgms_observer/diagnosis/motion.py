"""Motion and effort of a recording, every signal filtered by the same zero-phase low-pass.

If the effort is held between samples, the second difference of the position at a sample depends on the mean of the
efforts before and after it: the effort has a lag of half a sample. The effort of a drive that is faster than the
recording has no lag.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from threading import Lock
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, signal

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.errors import DataError
from sgms_observer.filters.zero_phase import zero_phase
from sgms_observer.jit import njit
from sgms_observer.offline.effort_range import NO_LIMITS
from sgms_observer.offline.recording import Recording, Recordings

Scalar = TypeVar("Scalar", bound=np.generic)
Cached = TypeVar("Cached")

BAND = 100.0
"""Upper frequency of the residuals [Hz], unless rate and encoder of the recording need a lower one."""
WORKING_RATE = 10.0
"""Recordings with a higher rate than this multiple of the band are decimated to about that rate after the low-pass."""
MOTION_BAND = 2.5
"""Bandwidth of the motion as a multiple of the band: the mass resonates on the contact stiffness above the band."""
MAX_BAND_SHARE = 0.35
"""Largest ratio of band to sample rate: the low-pass needs a margin below the Nyquist frequency."""
MIN_DURATION = 3.0
"""Shortest recording that is accepted [s]."""
PLAY_HALF_WIDTH = 0.6
"""Half width of the play operator that removes encoder jitter from the motion of the contact, in encoder steps."""
CREEP_SPEED = 20.0
"""Speed below which the encoder resolution limits the prediction of the contact, in encoder steps per sample."""
HELD_LAG = 0.5
"""Lag of an effort that is held between samples, in samples."""
MAX_CACHED = 8
"""Number of cached results per motion and kind: a parameter outside the contact needs no new simulation."""
_CACHE_LOCK = Lock()  # fits in several threads share the motions
REST_SHARE = 2.0e-3
"""The stage counts as resting below this share of the 99.5 % quantile of the speed."""
_GAUSSIAN_WIDTH = math.sqrt(math.log(2.0)) / (2.0 * math.pi)
"""Standard deviation of a Gaussian low-pass in time, times its corner at -3 dB."""
EDGE_TIME = 0.1
"""Time dropped at either end for the transients of the low-pass [s]."""


@dataclass(frozen=True)
class EffortLag:
    """Lag between the stamp of an effort sample and its action: constant in each part of a recording.

    Attributes:
        values: lag of each part, in samples of the recording.
        changes: times from the start of the recording at which the next part begins [s], one less.
    """

    values: tuple[float, ...] = (HELD_LAG,)
    changes: tuple[float, ...] = ()

    def part(self, time: Floats) -> NDArray[np.intp]:
        """Return the index of the part at each time from the start of the recording [s]."""
        return np.searchsorted(self.changes, time, side="right")

    def at(self, time: Floats) -> Floats:
        """Return the lag at each time from the start of the recording [s], in samples."""
        return np.array(self.values)[self.part(time)]

    def divided(self, changes: tuple[float, ...]) -> EffortLag:
        """Return a lag that may change at these times [s]; each part has the value that this one has at its begin."""
        return EffortLag(tuple(self.at(np.array([0.0, *changes])).tolist()), changes)


@dataclass(frozen=True)
class Motion:
    """A recording at the working rate.

    Attributes:
        name: name of the recording.
        period: working period [s].
        time: [s], from 0.
        position: filtered position [m].
        velocity: filtered velocity [m/s].
        acceleration: filtered acceleration [m/s^2].
        effort: effort, hold-corrected but not filtered [N].
        first, second: displacement within the step that ends at each sample, before and after a reversal [m].
        other_velocity, other_acceleration: of the other axis; zero if there is none.
        has_other: whether there is another axis.
        thinning: factor from the working rate to the rate of residuals.
        smoothing: the low-pass of the motion at the rate of the recording.
        contact_width: standard deviation of the Gaussian low-pass of the contact's motion, in samples of the recording.
        step: factor from the rate of the recording to the working rate.
        raw: position as recorded [m].
        resolution: encoder step; 0 if none is visible [m].
        lag: lag of the effort.
        band: upper frequency of the residuals [Hz].
        effort_limits: limits beyond which the log shows no effort [N].
    """

    name: str
    period: float
    time: Floats
    position: Floats
    velocity: Floats
    acceleration: Floats
    effort: Floats
    first: Floats
    second: Floats
    other_velocity: Floats
    other_acceleration: Floats
    has_other: bool
    thinning: int
    smoothing: Floats
    contact_width: float
    step: int
    raw: Floats
    resolution: float
    lag: EffortLag = EffortLag()
    band: float = BAND
    effort_limits: tuple[float, float] = NO_LIMITS

    @property
    def is_cut_off(self) -> bool:
        """Return whether the log shows no effort beyond a limit."""
        return self.effort_limits != NO_LIMITS

    def smoothed(self, raw: Floats) -> Floats:
        """Return a position as recorded, filtered like ``position`` [m]."""
        return zero_phase(self.smoothing, raw)[:: self.step]

    def contact_motion(self, raw: Floats) -> tuple[Floats, Floats]:
        """Return ``first`` and ``second`` for another position as recorded."""
        return contact_motion(raw, self.contact_width, self.step, self.period, self.resolution)

    def low_pass(self, values: Floats) -> Floats:
        """Return ``values`` below the band, at the rate of residuals, edges dropped; shape (n,) or (k, n)."""
        return zero_phase(_band_filter(self.period, self.band), values.T)[self._residual_samples].T

    def thinned(self, values: NDArray[Scalar]) -> NDArray[Scalar]:
        """Return ``values`` at the samples of ``low_pass``."""
        return values[self._residual_samples]

    @cached_property
    def _residual_samples(self) -> slice:
        """Samples of the residuals: edges dropped, and a number that suits the fast Fourier transform."""
        drop = int(EDGE_TIME / self.period)
        count = fast_length(-(-(len(self.time) - 2 * drop) // self.thinning))
        return slice(drop, drop + count * self.thinning, self.thinning)

    def cached(self, kind: str, key: Hashable, make: Callable[[], Cached]) -> Cached:
        """Return the result of ``make``, from the cache if it holds the key.

        Args:
            kind: kind of the result; the cache holds those ``MAX_CACHED`` of each kind that were used last.
            key: everything that the result depends on beside this motion.
            make: function that computes the result.
        """
        cache: dict[Hashable, Cached] = self._cache.setdefault(kind, {})
        found = cache.get(key)
        if found is None:
            found = make()
        with _CACHE_LOCK:
            cache.pop(key, None)
            while len(cache) >= MAX_CACHED:
                cache.pop(next(iter(cache)))
            cache[key] = found
        return found

    @cached_property
    def _cache(self) -> dict[str, dict[Hashable, Any]]:
        """Results that were computed along this motion."""
        return {}

    @cached_property
    def creep(self) -> Floats:
        """Smooth indicator, 1 at speeds below ``CREEP_SPEED`` encoder steps per sample and 0 above."""
        if self.resolution <= 0.0:
            return np.zeros(len(self.time))
        slow = CREEP_SPEED * self.resolution / self.period
        square = np.square(np.square(self.velocity / slow))
        return np.asarray(np.exp(-np.minimum(square, 700.0)), dtype=np.float64)

    def stick_indicator(self, sticking: Floats) -> Floats:
        """Return 0 where the contact slides, 1 where it sticks or creeps and the encoder resolution matters.

        Args:
            sticking: share of the contact that sticks, shape (n,).
        """
        return np.maximum(sticking, self.creep)

    @cached_property
    def is_moving(self) -> Booleans:
        """Whether the speed is above ``REST_SHARE`` of its 99.5 % quantile."""
        speed = np.abs(self.velocity)
        return np.asarray(speed > REST_SHARE * float(np.quantile(speed, 0.995)), dtype=np.bool_)

    @cached_property
    def shows_no_motion(self) -> Booleans:
        """Whether the encoder shows no motion within a period of the band around each sample."""
        if self.resolution <= 0.0:
            return np.zeros(len(self.time), dtype=np.bool_)
        moves = np.abs(self.first) + np.abs(self.second) > 0.0
        return np.convolve(moves, np.ones(self._samples_of_band), mode="same") < 0.5

    @cached_property
    def hidden_periods(self) -> Floats:
        """Number of periods of the motion's low-pass in which the encoder may have hidden reversals so far, 0 for none.

        It may hide them at rest, and in the creep before and after a rest that covers at most one of its steps in such
        a period. In a faster stage a reversal within a step would be quicker than the low-pass, which the motion leaves
        out at any speed.
        """
        if self.resolution <= 0.0:
            return np.zeros(len(self.time))
        corner = _GAUSSIAN_WIDTH * self.step / (self.contact_width * self.period)
        place, width = np.cumsum(self.first + self.second), self._samples_of_band
        covered = ndimage.maximum_filter1d(place, width) - ndimage.minimum_filter1d(place, width)
        creeps = covered <= self.resolution * max(1.0, corner * (width - 1) * self.period)
        label, count = ndimage.label(creeps | self.shows_no_motion)
        has_rest = np.bincount(label, self.shows_no_motion, count + 1) > 0.0
        hides = (label > 0) & has_rest[label]
        number = np.arange(1, len(hides) + 1)
        so_far = number - np.maximum.accumulate(np.where(hides, 0, number))
        return np.where(hides, 1.0 + corner * self.period * so_far, 0.0)

    @property
    def _samples_of_band(self) -> int:
        """Number of samples in a period of the band around a sample."""
        return 2 * max(1, round(0.5 / (self.band * self.period))) + 1

    @property
    def residual_period(self) -> float:
        """Time between two residuals [s]."""
        return self.period * self.thinning


@lru_cache(maxsize=64)
def fast_length(count: int) -> int:
    """Return the largest number up to ``count`` without a prime factor above 11."""
    for number in range(count, 1, -1):
        rest = number
        for prime in (2, 3, 5, 7, 11):
            while rest % prime == 0:
                rest //= prime
        if rest == 1:
            return number
    return count


@lru_cache(maxsize=16)
def _band_filter(period: float, band: float) -> Floats:
    """Return the low-pass of residuals."""
    return np.asarray(signal.butter(4, min(2.0 * band * period * 1.1, 0.8), output="sos"), dtype=np.float64)


def long_enough(pieces: Recordings) -> Recordings:
    """Return the pieces of a recording that a diagnosis can use, with a note about the others.

    Args:
        pieces: all of one recording.

    Raises:
        DataError: no piece is long enough.
    """
    short = [piece for piece in pieces if piece.duration < MIN_DURATION]
    if not short:
        return pieces
    long = tuple(piece for piece in pieces if piece.duration >= MIN_DURATION)
    if not long:
        where = "" if len(pieces) == 1 else f" in the longest of {len(pieces)} pieces between pauses"
        raise _too_short(max(pieces, key=lambda piece: piece.duration), where)
    lost = sum(piece.duration for piece in short)
    note = (
        f"{short[0].name}: left out, because shorter than {MIN_DURATION:g} s: {len(short)} of {len(pieces)} pieces"
        f" between pauses ({lost:.3g} s)"
    )
    return Recordings(long, (*pieces.notes, note))


def _too_short(record: Recording, where: str = "") -> DataError:
    """Return the error about a recording that is too short; ``where`` follows its duration."""
    return DataError(
        f"{record.name} lasts {record.duration:.2g} s{where}; record at least {MIN_DURATION:g} s without a pause"
    )


def motion_of(record: Recording, lag: EffortLag = EffortLag(), band: float = BAND) -> Motion:
    """Return a recording filtered and decimated to the working rate.

    Args:
        record: the recording.
        lag: lag of its effort, between -1 and 1 sample.
        band: upper frequency of the residuals, lowered if the rate of the recording needs it [Hz].

    Raises:
        DataError: the recording is too short.
    """
    rate = 1.0 / record.period
    if record.duration < MIN_DURATION:
        raise _too_short(record)
    band = min(band, MAX_BAND_SHARE * rate)
    step = max(1, round(rate / (WORKING_RATE * band)))
    period = record.period * step
    effort = delayed(record.effort, lag.at(record.time))
    corner = min(MOTION_BAND * band, MAX_BAND_SHARE / period)
    if step > 1:  # anti-aliasing
        guard = signal.butter(4, 0.4 / period / (0.5 * rate), output="sos")
        effort = signal.sosfiltfilt(guard, effort)
    smooth = signal.butter(4, 2.0 * corner * record.period, output="sos")
    position = signal.sosfiltfilt(smooth, record.position)[::step]
    other_v = other_a = np.zeros(len(position))
    if record.other_position is not None:
        other = signal.sosfiltfilt(smooth, record.other_position)[::step]
        other_v = np.gradient(other, period)
        other_a = second_difference(other, period)
    velocity = np.gradient(position, period)
    resolution = record.encoder_step
    width = _GAUSSIAN_WIDTH / (corner * record.period)
    first, second = contact_motion(record.position, width, step, period, resolution)
    rest = 0.5 / (period * band * 1.25)
    return Motion(
        record.name,
        period,
        np.asarray(period * np.arange(len(position)), dtype=np.float64),
        position,
        velocity,
        second_difference(position, period),
        effort[::step],
        first,
        second,
        other_v,
        other_a,
        record.other_position is not None,
        max(1, int(rest)),
        smooth,
        width,
        step,
        record.position,
        resolution,
        lag,
        band,
        record.effort_limits,
    )


def delayed(values: Floats, samples: Floats | float) -> Floats:
    """Return a series delayed by any number of samples (advanced if negative); its ends have the value of the ends.

    Args:
        values: shape (n,).
        samples: the delay, one for all samples or one for each, shape (n,).
    """
    whole = np.trunc(samples)
    if np.any(whole):
        ends = len(values) - 1
        values = values[np.clip(np.arange(len(values)) - whole.astype(np.intp), 0, ends)]
    rest = np.asarray(samples) - whole
    late, early = np.maximum(rest, 0.0), np.maximum(-rest, 0.0)
    before, after = np.concatenate((values[:1], values[:-1])), np.concatenate((values[1:], values[-1:]))
    return np.asarray((1.0 - late - early) * values + late * before + early * after, dtype=np.float64)


@njit
def _apply_play(position: Floats, half: float, out: Floats) -> None:
    """Write the output of the play operator of half width ``half``."""
    place = position[0]
    for k in range(position.shape[0]):
        if position[k] > place + half:
            place = position[k] - half
        elif position[k] < place - half:
            place = position[k] + half
        out[k] = place


def contact_motion(raw: Floats, width: float, step: int, period: float, resolution: float) -> tuple[Floats, Floats]:
    """Return the motion of the contact: the displacement of each step before and after a reversal in it [m].

    Args:
        raw: position as recorded [m].
        width: standard deviation of the low-pass, in samples of the recording.
        step: factor from the rate of the recording to the working rate.
        period: working period [s].
        resolution: encoder step [m].
    """
    return split_at_reversals(contact_position(raw, width, step, resolution), period)


def contact_position(raw: Floats, width: float, step: int, resolution: float) -> Floats:
    """Return the position of the contact, at every ``step``-th sample [m].

    The low-pass is a Gaussian one. It has no negative weights, so that a stage that stops at once stops in the filtered
    motion too, instead of moving back a little, which would release the friction.

    Args:
        raw: position as recorded [m].
        width: standard deviation of the Gaussian, in samples of the recording.
        step: factor between the rates.
        resolution: encoder step [m].
    """
    smooth = ndimage.gaussian_filter1d(raw, width, mode="nearest")[::step]
    return without_jitter(smooth, PLAY_HALF_WIDTH * resolution)


def play_operator(position: Floats, half: float) -> Floats:
    """Return a position filtered by the play operator (hysteresis) of half width ``half`` [m], which removes jitter."""
    if half <= 0.0:
        return position
    out = np.empty_like(position)
    _apply_play(position, half, out)
    return out


def without_jitter(position: Floats, half: float) -> Floats:
    """Return a position without encoder jitter, without lag, and with its turns where they were [m].

    Forward, the play operator turns late at each reversal; backward, it turns as much too early. A lag of the motion
    would look like a delay of the effort, or like backlash. Their mean has no lag, but moves half as fast within a
    width of the operator around each turn, so that it turns ``half`` too early. This is undone.

    Args:
        position: shape (n,) [m].
        half: half width of the play operator [m].
    """
    if half <= 0.0:
        return position
    mean = 0.5 * (play_operator(position, half) + play_operator(position[::-1], half)[::-1])
    return mean + _lost_at_turns(mean, half)


def _lost_at_turns(position: Floats, most: float) -> Floats:
    """Return what a position that moves half as fast near its turns has lost of them [m].

    It is largest at the turn, up to ``most`` and up to half of the travel to the turns before and after, and falls by
    as much as the position has moved away from the turn.
    """
    step = np.diff(position)
    moving = np.flatnonzero(step)
    direction = np.sign(step[moving])
    last = np.flatnonzero(np.diff(direction)) + 1
    turns, outward = moving[last], -direction[last]  # where the position begins to move back, and out of which side
    if len(turns) == 0:
        return np.zeros_like(position)
    place = position[turns]
    travel = np.abs(np.diff(place, prepend=position[:1], append=position[-1:]))
    lost = np.minimum(most, 0.5 * np.minimum(travel[:-1], travel[1:]))
    later = np.searchsorted(turns, np.arange(len(position)))
    found = np.zeros_like(position)
    for side in (later - 1, later):
        known = (side >= 0) & (side < len(turns))
        at = side[known]
        found[known] += outward[at] * np.maximum(0.0, lost[at] - np.abs(position[known] - place[at]))
    return found


def split_at_reversals(position: Floats, period: float) -> tuple[Floats, Floats]:
    """Return the displacement of each step before and after a reversal in it, with linear velocity over the step."""
    velocity = np.gradient(position, period)
    travel = np.concatenate(([0.0], np.diff(position)))
    before = np.concatenate(([0.0], velocity[:-1]))
    turning = before * velocity < 0.0
    share = np.where(turning, before / np.where(turning, before - velocity, 1.0), 0.0)
    first = 0.5 * before * share * period
    return first, travel - first


def second_difference(position: Floats, period: float) -> Floats:
    """Return the acceleration [m/s^2]."""
    middle = (position[2:] - 2.0 * position[1:-1] + position[:-2]) / period**2
    return np.concatenate(([middle[0]], middle, [middle[-1]]))


def lowest_rate(motions: Sequence[Motion]) -> float:
    """Return the lowest sample rate of recordings [Hz]."""
    return min(motion.step / motion.period for motion in motions)
