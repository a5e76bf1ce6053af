"""A recording prepared for identification: filtered, at the rate of the simulation of the model.

Both sides of the force balance pass the same zero-phase low-pass. There is no filter delay, and the noise of the
acceleration stays small. The friction is driven by a position with a wider bandwidth, so that it follows fast
reversals, while the noise of the acceleration, which a stiff element could imitate, is removed from the balance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.errors import DataError
from sgms_observer.filters.zero_phase import zero_phase
from sgms_observer.identification.effect_terms import EffectForce, EffectTerms
from sgms_observer.offline.recording import Recording

MOTION_OVER_BALANCE = 2.5
"""Corner of the low-pass on the position that drives the friction, over the corner of the balance."""

MIN_PERIODS = 80.0
"""Shortest recording, in periods of the cutoff."""

_ORDER = 4
_COLUMNS = 16  # that are filtered at once
_WORKING_RATE = 10.0  # samples of the driving position per period of its corner
_ROW_RATE = 8.0  # rows of the balance per period of its corner
_BORDER = 4.0  # of the filter's time constants 1/cutoff dropped at either end
MAX_SAMPLES_AT_ONCE = 2**19
"""Samples at the working rate that a search runs over, and that are filtered whole; longer logs are cut."""
_SAMPLES_OF_PART = 2**16  # samples at the working rate after which a longer log is cut at the next long stroke
_TRAVEL_OVER_DEFLECTION = 3.0  # slip deflections of one-way travel after which the unknown initial state has no effect
BUILD_UP_SHARE = 0.05
"""Largest slip deflection of an element over the travel: a friction that builds up over more is a spring, or gravity"""


@dataclass(frozen=True)
class Prepared:
    """One recording, filtered: the driving position at the working rate, the balance in fewer rows.

    Attributes:
        name: name of the recording.
        period: working period [s].
        position: position that drives the friction [m], at the working rate.
        sections: second-order sections of the balance's low-pass at the working rate.
        stride: working samples per row.
        time: of each row [s], from 0.
        velocity: of each row [m/s].
        acceleration: of each row [m/s^2].
        effort: spline through the filtered effort [N] over time [s].
        usable: rows away from the filter's borders.
        effects: force of the file's effects along the motion, at the working rate.
        noise: standard deviation of the white part of the recorded position [m].
        travel: range of the position of the piece that this part was cut from, or of its own [m].
        unit: of the position, for sentences.
    """

    name: str
    period: float
    position: Floats
    sections: Floats
    stride: int
    time: Floats
    velocity: Floats
    acceleration: Floats
    effort: CubicSpline
    usable: Booleans
    effects: EffectForce
    noise: float
    travel: float
    unit: str = "m"

    def low_pass(self, values: Floats) -> Floats:
        """Return the rows of signals at the working rate, through the balance's zero-phase low-pass."""
        if values.ndim == 2 and values.shape[1] > _COLUMNS:  # the filter copies its input several times
            return np.hstack([self.low_pass(values[:, k : k + _COLUMNS]) for k in range(0, values.shape[1], _COLUMNS)])
        return np.asarray(zero_phase(self.sections, values)[:: self.stride])

    def settled(self, slip_deflection: float) -> Booleans:
        """Return the usable rows after the elements have forgotten their initial state.

        Args:
            slip_deflection: largest deflection at which an element slips [m].
        """
        far = np.flatnonzero(_travel_since_reversal(self.position)[1] > _TRAVEL_OVER_DEFLECTION * slip_deflection)
        mask = self.usable.copy()
        mask[: (int(far[0]) // self.stride + 1 if len(far) else len(mask))] = False
        return mask

    def is_sliding(self, slip_deflection: float, clear: float) -> Booleans:
        """Return the rows where every element slips and no reversal is near.

        Args:
            slip_deflection: largest deflection at which an element slips [m].
            clear: time to the nearest reversal, in which the low-pass rings [s].
        """
        run = np.concatenate(([0.0], _travel_since_reversal(self.position)[1]))
        turns = np.flatnonzero(np.diff(np.sign(np.diff(self.position)))) + 1
        near = np.zeros(len(run) + 1)
        width = int(np.ceil(clear / self.period))
        np.add.at(near, np.maximum(turns - width, 0), 1.0)
        np.add.at(near, np.minimum(turns + width + 1, len(run)), -1.0)
        is_clear = np.cumsum(near)[:-1] == 0.0
        return np.asarray((is_clear & (run > _TRAVEL_OVER_DEFLECTION * slip_deflection))[:: self.stride])


def _travel_since_reversal(position: Floats) -> tuple[Ints, Floats]:
    """Return the sample of the last reversal before each step, and the travel since it after the step [m]."""
    way = np.sign(np.diff(position))
    turning = np.concatenate(([True], way[1:] != way[:-1]))
    since = np.maximum.accumulate(np.where(turning, np.arange(len(turning)), 0))
    return since, np.asarray(np.abs(position[1:] - position[since]))


def _prepare(recording: Recording, cutoff: float, terms: EffectTerms, first: float) -> Prepared:
    """Return a recording that began at time ``first``, filtered and resampled to the working rate."""
    motion_cutoff = MOTION_OVER_BALANCE * cutoff
    _check(recording, cutoff, motion_cutoff)
    noise, travel = recording.position_noise, recording.recorded_travel
    recording = _upsampled(recording, _WORKING_RATE * motion_cutoff)
    rate = 1.0 / recording.period
    transforming = CompiledEffects(terms.transforming, recording.period)
    motion_filter = _low_pass(motion_cutoff, rate)
    both = np.concatenate([motion_filter, _low_pass(cutoff, rate)])
    measured = transforming.corrected_position(recording.position)
    effort = transforming.arrived_effort(recording.effort, transforming.initial_state())
    position = zero_phase(motion_filter, measured)
    step = max(1, int(rate / (_WORKING_RATE * motion_cutoff) + 1e-6))
    period = recording.period * step
    stride = max(1, int(1.0 / (_ROW_RATE * cutoff * period) + 1e-6))
    smooth = zero_phase(both, measured)
    velocity: Floats = np.gradient(smooth) / recording.period
    acceleration: Floats = np.gradient(velocity) / recording.period
    keep = slice(None, None, step * stride)
    time = np.asarray(period * stride * np.arange(len(smooth[keep])))
    border = int(np.ceil(_BORDER / cutoff / (period * stride)))
    usable = np.zeros(len(time), dtype=bool)
    usable[border:-border] = True
    driving = np.ascontiguousarray(position[::step])
    other = recording.other_position
    other = None if other is None else np.asarray(zero_phase(motion_filter, other)[::step])
    return Prepared(
        name=recording.name,
        period=period,
        position=driving,
        sections=np.concatenate([_low_pass(motion_cutoff, 1.0 / period), _low_pass(cutoff, 1.0 / period)]),
        stride=stride,
        time=time,
        velocity=velocity[keep],
        acceleration=acceleration[keep],
        effort=CubicSpline(time, zero_phase(both, effort)[keep]),
        usable=usable,
        effects=EffectForce(
            CompiledEffects(terms.fitted, period),
            period,
            driving,
            np.ascontiguousarray(zero_phase(motion_filter, effort)[::step]),
            other,
            first,
        ),
        noise=noise,
        travel=float(np.ptp(driving)) if travel is None else travel,
        unit=terms.unit,
    )


def _check(recording: Recording, cutoff: float, motion_cutoff: float) -> None:
    """Raise an error if the recording is too slowly sampled for its low-passes."""
    rate = 1.0 / recording.period
    if motion_cutoff >= 0.45 * rate:
        raise DataError(
            f"{recording.name} is sampled at {rate:.4g} Hz; choose a cutoff below {0.18 * rate:.4g} Hz,"
            f" not {cutoff:.4g} Hz"
        )


def prepare_all(recordings: Sequence[Recording], cutoff: float, terms: EffectTerms) -> list[Prepared]:
    """Filter all recordings; time begins with the first piece of each name.

    Args:
        recordings: evenly sampled pieces.
        cutoff: corner of the balance's low-pass [Hz].
        terms: effects of the parameter file.

    Raises:
        DataError: if a recording is too slowly sampled.
    """
    begun: dict[str, float] = {}
    for recording in recordings:
        begun[recording.name] = min(recording.start, begun.get(recording.name, recording.start))
    return [_prepare(piece, cutoff, terms, piece.start - begun[piece.name]) for piece in recordings]


def parts_of_long(recordings: Sequence[Recording], cutoff: float, terms: EffectTerms) -> list[list[Recording]]:
    """Return the parts into which each piece is cut so that filters and simulation need little memory at once.

    Only a log longer than ``MAX_SAMPLES_AT_ONCE`` samples in all is cut. A part begins with unknown elements, as a
    piece after a pause does. So each part but the first begins with a stroke after which every element slips, and costs
    no more than this stroke. A piece without such strokes stays whole, as all pieces do under effects with a memory.

    Args:
        recordings: evenly sampled pieces.
        cutoff: corner of the balance's low-pass [Hz].
        terms: effects of the balance.
    """
    samples = [piece.duration * _working_rate(piece.period, cutoff) for piece in recordings]
    if sum(samples) <= MAX_SAMPLES_AT_ONCE or any(effect(item.name).initial_state for item in terms.fitted):
        return [[piece] for piece in recordings]
    return [_cut(piece, cutoff, math.ceil(n / _SAMPLES_OF_PART)) for piece, n in zip(recordings, samples, strict=True)]


def _cut(recording: Recording, cutoff: float, count: int) -> list[Recording]:
    """Return about ``count`` parts of a piece, each of which but the first begins with a long stroke.

    A stroke is long that makes the softest element slip which the search allows. Where no stroke is so long, the
    longest ones have to do: a stroke of half of the longest one is long then.
    """
    if count <= 1:
        return [recording]
    _check(recording, cutoff, MOTION_OVER_BALANCE * cutoff)
    low_pass = _low_pass(MOTION_OVER_BALANCE * cutoff, 1.0 / recording.period)
    position = np.asarray(zero_phase(low_pass, recording.position))
    since, run = _travel_since_reversal(position)
    travel = float(np.ptp(position))
    enough = min(_TRAVEL_OVER_DEFLECTION * BUILD_UP_SHARE * travel, 0.5 * float(run.max()))
    strokes = np.unique(since[run > enough])
    shortest = len(recording) // count
    first: list[int] = []
    while True:
        place = int(np.searchsorted(strokes, (first[-1] if first else 0) + shortest))
        if place == len(strokes) or strokes[place] > len(recording) - shortest // 2:
            return recording.parts(first, travel)
        first.append(int(strokes[place]))


def _working_rate(period: float, cutoff: float) -> float:
    """Return the rate of the simulation [Hz]: that of the samples, upsampled or thinned to a whole ratio."""
    wanted = _WORKING_RATE * MOTION_OVER_BALANCE * cutoff
    rate = max(1, math.ceil(wanted * period - 1e-6)) / period
    return rate / max(1, int(rate / wanted + 1e-6))


def _upsampled(recording: Recording, rate: float) -> Recording:
    """Return the recording at a rate of at least ``rate`` [Hz], by band-limited interpolation.

    At 1 kHz, reversals within a sample and central differences at the corner of the balance would have errors of some
    per cent.
    """
    times = math.ceil(rate * recording.period - 1e-6)
    if times <= 1:
        return recording
    keep = (len(recording) - 1) * times + 1

    def upsampled(values: Floats) -> Floats:
        return np.asarray(signal.resample_poly(values, times, 1, padtype="line"))[:keep]

    other = recording.other_position
    return replace(
        recording,
        period=recording.period / times,
        position=upsampled(recording.position),
        effort=upsampled(recording.effort),
        reference_position=None,
        other_position=None if other is None else upsampled(other),
    )


def _low_pass(cutoff: float, rate: float) -> Floats:
    """Return the second-order sections of the low-pass."""
    return np.asarray(signal.butter(_ORDER, 2.0 * cutoff / rate, output="sos"))
