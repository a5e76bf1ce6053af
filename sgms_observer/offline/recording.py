"""A recording prepared for identification and diagnosis: evenly sampled, finite, without gaps.

Irregular stamps are brought to an even grid by a cubic through the samples. Where the stamps stray and the samples do
not, the samples are the grid. Equal and backward stamps are dropped. Pauses cut the recording into pieces; pieces that
are too short are left out. An angle that wraps is unwrapped; other jumps of the position cut. Notes report these
changes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from sgms_observer.arrays import Floats
from sgms_observer.errors import DataError
from sgms_observer.observer.pairing import PairingCounts
from sgms_observer.observer.samples import Samples
from sgms_observer.offline.effort_range import MIN_Z_SCORE, effort_limits
from sgms_observer.offline.encoder import encoder_step, position_noise, white_noise, without_unit_rounding
from sgms_observer.offline.held_samples import updates_of
from sgms_observer.offline.jumps import MAX_PAUSE, later_stamps, without_jumps
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import Scales

MIN_SAMPLES = 200
"""Samples of a piece that is worth learning from."""
MIN_RATE = 20.0
"""Lowest sample rate [Hz]; the interface supports 20 Hz to 20 kHz."""
MAX_END = 0.1
"""Longest end of a recording without set-points that is filled [s]; figures of tracking leave out the first 0.5 s."""
_RATE_TOLERANCE = 0.98  # of MIN_RATE: a clock that runs slow
_MAX_STRAY = 0.02  # share of the period by which a stamp may stray before the signals are interpolated
_MAX_UNEVEN = 0.01  # share of the period by which a pause may differ from it in an even recording
_MAX_TRIMMED = 10  # samples at either end that are dropped if only their pauses are uneven
_BLOCK = 20  # samples of a block in which the noise of two readings is compared: longer than what one sample reaches
_MAX_SURE = 0.4  # periods; how many periods a pause holds is not sure where it is farther from a whole number
_COUNTED = 50  # samples of a block whose mean shows whether samples are missing before it
_MIN_BLOCKS = 8  # of a short piece
_MAX_WANDER = 0.5  # periods; a missing sample makes a step of one, jitter of half a period spreads 1000 means by 0.45
_COHERENT = 128  # samples of the first blocks of which the spectrum is searched
_MAX_RATE_RATIO = 1.9  # of the rate to the mean rate where samples are missing; twice the rate is a peak too
_MIN_POWER = 4.0  # of the spectral peak over that of stamps without a rate
_RATES = 40  # quarters of a period by which the rough rate may be off over a whole piece


@dataclass(frozen=True)
class Recording:
    """One evenly sampled piece of a recording, in SI units.

    Attributes:
        name: name of the recording.
        period: time between two samples [s].
        position: measured position [m or rad], shape (n,).
        effort: effort of the actuator [N or N m], shape (n,).
        reference_position: set-point [m or rad], shape (n,); NaN where there is none; None for none at all.
        start: stamp of the first sample [s].
        other_position: position of another axis of the same recording [m or rad], shape (n,), or None.
        recorded_step: step of the positions' grid as they were recorded [m or rad]; None finds it in ``position``.
        recorded_limits: limits of the efforts as they were recorded [N or N m]; None finds them in ``effort``.
        recorded_noise: noise of the positions of the whole piece [m or rad]; None finds it in ``position``.
        recorded_travel: range of the positions of the piece that it was cut from [m or rad]; None: it was not cut.
    """

    name: str
    period: float
    position: Floats
    effort: Floats
    reference_position: Floats | None = None
    start: float = 0.0
    other_position: Floats | None = None
    recorded_step: float | None = None
    recorded_limits: tuple[float, float] | None = None
    recorded_noise: float | None = None
    recorded_travel: float | None = None

    def __len__(self) -> int:
        return len(self.position)

    @property
    def time(self) -> Floats:
        """Time of each sample from the first one [s], shape (n,)."""
        return np.arange(len(self), dtype=np.float64) * self.period

    @property
    def duration(self) -> float:
        """Length [s]."""
        return len(self) * self.period

    @cached_property
    def encoder_step(self) -> float:
        """Step of the grid the encoder counts on; 0 where none shows [m or rad]."""
        return encoder_step(self.position) if self.recorded_step is None else self.recorded_step

    @cached_property
    def effort_limits(self) -> tuple[float, float]:
        """Limits beyond which the log shows no effort [N or N m]; infinite where there are none."""
        return effort_limits(self.effort) if self.recorded_limits is None else self.recorded_limits

    @cached_property
    def position_noise(self) -> float:
        """Standard deviation of the white part of the position: noise and the encoder's steps [m or rad]."""
        given = self.recorded_noise
        return position_noise(self.position, self.encoder_step) if given is None else given

    @property
    def whole_reference(self) -> Floats | None:
        """Set-point at every sample [m or rad], or None where samples between the first and the last one lack theirs.

        A recording that starts between two messages lacks the set-points of its ends: at most ``MAX_END`` of each
        is filled with the nearest one.
        """
        given = self.reference_position
        known = np.flatnonzero(np.isfinite(given)) if given is not None else np.zeros(0, dtype=np.int64)
        if given is None or len(known) == 0 or known[-1] - known[0] + 1 > len(known):
            return None
        if max(known[0], len(given) - 1 - known[-1]) * self.period > MAX_END:
            return None
        return np.asarray(given[np.clip(np.arange(len(given)), known[0], known[-1])], dtype=np.float64)

    @property
    def samples(self) -> Samples:
        """Return the samples as an observer gets them, with the set-points of ``whole_reference``."""
        stamp = np.round(self.time * 1e9).astype(np.int64)
        nothing, reference = np.full(len(self), np.nan), self.whole_reference
        return Samples(stamp, self.position, self.effort, nothing if reference is None else reference, nothing)

    def with_more_noise(self, seed: int) -> Recording:
        """Return the recording with as much noise again on its position.

        Args:
            seed: of the noise.
        """
        noise = np.random.default_rng(seed).normal(0.0, self.position_noise, len(self))
        return replace(self, position=self.position + noise, recorded_noise=None)

    def shifted(self, offset: float) -> Recording:
        """Return the recording with its origin of the position elsewhere.

        Args:
            offset: is added to positions and set-points [m or rad].
        """
        reference = None if self.reference_position is None else self.reference_position + offset
        step = self.encoder_step  # of the positions as they were recorded
        return replace(self, position=self.position + offset, reference_position=reference, recorded_step=step)

    def parts(self, first: Sequence[int], travel: float) -> list[Recording]:
        """Return the parts of the piece, which share its encoder step, its noise and its limits of the effort.

        Args:
            first: number of the first sample of each part but the first one, ascending; the piece itself without any.
            travel: range of the positions of the piece [m or rad].
        """
        if not len(first):
            return [self]
        known = replace(
            self,
            recorded_step=self.encoder_step,
            recorded_limits=self.effort_limits,
            recorded_noise=self.position_noise,
            recorded_travel=travel,
        )
        return [known.part(a, b) for a, b in pairwise([0, *first, len(self)])]

    def continues(self, before: Recording) -> bool:
        """Return whether the piece begins one sample after another piece ends.

        Args:
            before: the other piece.
        """
        pause = self.start - before.start - before.duration
        return self.name == before.name and abs(pause) < 0.5 * self.period

    def part(self, first: int, last: int) -> Recording:
        """Return some of the samples.

        Args:
            first: number of the first one.
            last: number after the last one.
        """
        cut = slice(first, last)
        reference, other = (
            None if values is None else values[cut] for values in (self.reference_position, self.other_position)
        )
        return replace(
            self, position=self.position[cut], effort=self.effort[cut], reference_position=reference,
            other_position=other, start=self.start + first * self.period,
        )  # fmt: skip


@dataclass(frozen=True)
class Recordings(Sequence[Recording]):
    """The pieces of one recording or of several, in order of time.

    Attributes:
        pieces: the pieces.
        notes: sentences about what was dropped, interpolated or left out.
        samples_per_update: number of recorded samples for one of the pieces: a slow bus repeats positions.
    """

    pieces: tuple[Recording, ...]
    notes: tuple[str, ...] = field(default=())
    samples_per_update: int = 1

    def __getitem__(self, index):  # type: ignore[no-untyped-def]
        return self.pieces[index]

    def __len__(self) -> int:
        return len(self.pieces)

    def __iter__(self) -> Iterator[Recording]:
        return iter(self.pieces)

    def __add__(self, more: Recordings) -> Recordings:
        return Recordings(self.pieces + more.pieces, self.notes + more.notes)


def read_recordings(
    path: str | Path, axis: AxisSettings, other: AxisSettings | None = None, *, topics: Mapping[str, str] | None = None
) -> Recordings:
    """Read the pieces of a bag, in SI units.

    Args:
        path: the bag.
        axis: the axis that is identified or diagnosed.
        other: another axis of the same recording, or None.
        topics: names of ``position``, ``control_effort`` and ``reference`` where they differ.

    Raises:
        RecordingError: the bag cannot be read.
        DataError: it holds nothing to learn from.
    """
    wanted = {entry.name: entry.scales for entry in (axis, other) if entry is not None}
    samples, notes = samples_of_bag(path, wanted, topics)
    second = samples[other.name] if other is not None else None
    found = recordings_from_samples(samples[axis.name], Path(path).name, second, axis.units.position)
    pieces = tuple(_without_unit_of_log(piece) for piece in found)
    return replace(found, pieces=pieces, notes=(*notes, *found.notes))


def samples_of_bag(
    path: str | Path, axes: Mapping[str, Scales], topics: Mapping[str, str] | None, needs_effort: bool = True
) -> tuple[dict[str, Samples], tuple[str, ...]]:
    """Return the samples of axes in the order of their stamps, and a note where the messages came in another order.

    A recorder or a network may hand on a message after a later one. Where stamps step back by more than a second, two
    motions may have the same stamps: nothing is sorted then, and the note counts what is lost.

    Args:
        path: the bag.
        axes: names of the axes with their factors from the messages to SI.
        topics: names of ``position``, ``control_effort`` and ``reference`` where they differ.
        needs_effort: refuse a recording without efforts.

    Raises:
        RecordingError: the bag cannot be read.
    """
    from sgms_observer.bags.reader import BagSamples

    def read(is_sorted: bool) -> tuple[dict[str, Samples], list[PairingCounts]]:
        blocks: dict[str, list[Samples]] = {name: [] for name in axes}
        source = BagSamples(path, axes, topics=topics, needs_effort=needs_effort, is_sorted=is_sorted)
        for name, samples in source:
            blocks[name].append(samples)
        return {name: join_samples(found) for name, found in blocks.items()}, list(source.counts.values())

    samples, counts = read(is_sorted=False)
    late = sum(one.late for one in counts)
    if any(one.clock_resets or one.stream_resets for one in counts):
        return samples, (f"{Path(path).name}: {_loss_by_resets(counts)}",)
    if not late:
        return samples, ()
    del samples  # before the recording is read again
    values = "one value" if late == 1 else f"{late} values"
    return read(is_sorted=True)[0], (
        f"{Path(path).name}: {values} of position, control_effort or reference came after a later one; all were sorted"
        " by their stamps; where there are many, check for two publishers of one topic",
    )


def _loss_by_resets(counts: Sequence[PairingCounts]) -> str:
    """Return what was lost where stamps step back by more than a second."""
    resets = max(one.clock_resets + one.stream_resets for one in counts)  # axes share their topics
    losses = (
        (sum(one.late for one in counts), "values that came after a later one and were dropped"),
        (sum(one.missing_efforts for one in counts), "positions without a control_effort of the same time"),
        (sum(one.unmatched_efforts for one in counts), "control_efforts without a position of the same time"),
        (sum(one.unmatched_references for one in counts), "references without a position of the same time"),
    )
    return "; ".join((
        f"the stamps of a topic step back by more than a second {'once' if resets == 1 else f'{resets} times'}, so that"
        " no message was sorted",
        *(f"{text}: {count}" for count, text in losses if count),
        "check the clock, and the driver for single wrong stamps",
    ))  # fmt: skip


def _without_unit_of_log(piece: Recording) -> Recording:
    """Return a piece rounded so that the unit of its log does not change its last bits."""
    step = piece.encoder_step
    noise = step / math.sqrt(12.0) if step > 0.0 else white_noise(piece.position)
    reference, other = (
        None if values is None else without_unit_rounding(values, noise)
        for values in (piece.reference_position, piece.other_position)
    )
    of_effort = white_noise(piece.effort)
    low, high = without_unit_rounding(np.array(piece.effort_limits), of_effort).tolist()
    return replace(
        piece, position=without_unit_rounding(piece.position, noise), reference_position=reference,
        effort=without_unit_rounding(piece.effort, of_effort), other_position=other, recorded_limits=(low, high),
    )  # fmt: skip


def recordings_from_samples(
    samples: Samples, name: str, other: Samples | None = None, unit: str = "m or rad"
) -> Recordings:
    """Cut a block of samples into evenly sampled pieces.

    Args:
        samples: recorded samples of one axis, in SI units.
        name: name of the recording.
        other: recorded samples of another axis, or None.
        unit: of the positions, for the notes.

    Returns:
        Pieces between pauses and jumps of the position, each long enough to learn from, in order of time, and notes.

    Raises:
        DataError: if nothing usable is left.
    """
    updates = at_rate_of_changes(samples, name)
    continuous = without_jumps(updates.samples, name, unit)
    samples, cuts = continuous.samples, continuous.cuts_ns
    notes = [note for note in (updates.note, *continuous.notes) if note]
    if other is not None:
        of_other = without_jumps(other, f"{name}, other axis", "m or rad")
        other, cuts = of_other.samples, np.sort(np.concatenate((cuts, of_other.cuts_ns)))
        notes += of_other.notes
    good = np.isfinite(samples.position) & np.isfinite(samples.effort)
    stamp = samples.stamp_ns[good]
    if len(stamp) < MIN_SAMPLES:
        raise DataError(
            f"{name} holds {len(stamp)} samples with both position and control_effort; identification needs at least"
            f" {MIN_SAMPLES}: record both topics"
        )
    keep = later_stamps(stamp)
    if not np.all(keep):
        notes.append(f"{name}: {int(np.sum(~keep))} of {len(keep)} samples with duplicate or backward stamps dropped")
    seconds = (stamp[keep] - stamp[0]) * 1e-9
    signals = [values[good][keep] for values in (samples.position, samples.effort, samples.reference_position)]
    step, limits = encoder_step(signals[0]), effort_limits(signals[1])
    pauses = np.diff(seconds)
    typical = float(np.median(pauses))
    whole = pauses <= MAX_PAUSE * typical
    period = mean_period(pauses[whole], typical)
    if period * MIN_RATE * _RATE_TOLERANCE > 1.0:
        raise DataError(
            f"{name} is sampled at {1.0 / period:.3g} Hz; record position and control_effort at {MIN_RATE:g} Hz or more"
        )
    whole &= np.diff(np.searchsorted(cuts, stamp[keep], side="right")) == 0
    edges = [0, *(np.flatnonzero(~whole) + 1).tolist(), len(seconds)]
    spans = [(a, b) for a, b in pairwise(edges) if b - a >= MIN_SAMPLES]
    by = "pauses and jumps of the position" if len(cuts) else "pauses"
    if not spans:
        jumps = "".join(f"; {note}" for note in continuous.notes)
        raise DataError(
            f"{name} is broken by {by} into pieces shorter than {MIN_SAMPLES} samples; record it again{jumps}"
        )
    if skipped := len(edges) - 1 - len(spans):
        lost = len(seconds) - sum(b - a for a, b in spans)
        one = skipped == 1
        pieces_are = f"1 piece between {by} holds" if one else f"{skipped} pieces between {by} hold"
        notes.append(
            f"{name}: {pieces_are} fewer than {MIN_SAMPLES} samples and {'was' if one else 'were'} skipped"
            f" ({lost} sample{'' if lost == 1 else 's'})"
        )
    origin = float(stamp[0]) * 1e-9
    pieces, readings = [], []
    for a, b in spans:
        reading = _even_reading(period, seconds[a:b], [values[a:b] for values in signals])
        readings.append(reading)
        position, effort, reference = reading.signals
        piece = Recording(
            name, reading.period, position, effort, reference, origin + reading.start, recorded_step=step,
            recorded_limits=limits,
        )  # fmt: skip
        if other is not None:
            piece = replace(piece, other_position=_other_position(piece, other, reading, origin))
        pieces.append(piece)
    notes += _notes_on_stamps(name, readings)
    return Recordings(tuple(pieces), tuple(notes), updates.count)


def mean_period(pauses: Floats, typical: float) -> float:
    """Return the period over half of the recording, the median of all halves [s].

    A coarse clock biases the median pause; a few wrong stamps bias the mean. Where stamps stray by more, single pauses
    do not show how many periods they hold: the samples are counted, or, where some are missing, the spectrum of the
    stamps is searched.

    Args:
        pauses: between samples, shape (n,) [s].
        typical: about the period [s].
    """
    whole = np.maximum(np.round(pauses / typical), 1.0)
    seconds = np.concatenate(([0.0], np.cumsum(pauses)))
    if 4 * np.count_nonzero(np.abs(pauses / typical - whole) > _MAX_SURE) > _RATES:
        return _counted_period(seconds) or _spectral_period(seconds) or typical
    counts = np.concatenate(([0.0], np.cumsum(whole)))
    half = len(seconds) // 2
    return float(np.median((seconds[half:] - seconds[: len(seconds) - half]) / (counts[half:] - counts[:-half])))


def _counted_period(seconds: Floats) -> float:
    """Return the mean period [s] where no sample is missing; otherwise 0.

    A missing sample moves all later ones by a period, jitter moves none but its own: means over blocks tell them apart.
    """
    period, start = (float(value) for value in np.polyfit(np.arange(len(seconds)), seconds, 1))
    off = seconds - start - period * np.arange(len(seconds))
    blocks = np.array_split(off, max(_MIN_BLOCKS, len(seconds) // _COUNTED))
    wander = np.array([float(np.mean(block)) for block in blocks])
    return period if float(np.ptp(wander)) < _MAX_WANDER * period else 0.0


def _spectral_period(seconds: Floats) -> float:
    """Return the period [s] at the peak of the spectrum of the stamps; 0 where they have none.

    Stamps that stray are coherent over a few samples within a wide band of rates, and over many within a narrow one, so
    that the rate is refined with growing blocks.
    """
    slowest, shortest = float(np.mean(np.diff(seconds))), min(_COHERENT, len(seconds))
    length = shortest
    rates = np.arange(_RATE_TOLERANCE, _MAX_RATE_RATIO, 0.25 / length) / slowest
    while True:
        blocks = seconds[: len(seconds) // length * length].reshape(-1, length)
        power = [float(np.mean(np.abs(np.mean(np.exp(-2.0j * np.pi * rate * blocks), axis=1)) ** 2)) for rate in rates]
        best = float(rates[int(np.argmax(power))])
        if length == shortest and max(power) < _MIN_POWER / length:
            return 0.0
        if length * 8 > len(seconds):
            return 1.0 / best
        rates = best + np.arange(-16, 17) / (32.0 * length * slowest)
        length *= 8


@dataclass(frozen=True)
class _Reading:
    """One piece on an even grid.

    Attributes:
        period: time between two samples [s].
        start: time of its first sample [s].
        signals: position, effort and reference.
        stray: by how many periods stamps stray at most.
        even_times: stamps of its samples, and the even times at which they were taken [s]; None where the signals were
            read at their stamps.
        missing: times of the samples between others that the log lacks [s].
    """

    period: float
    start: float
    signals: Sequence[Floats]
    stray: float
    even_times: tuple[Floats, Floats] | None = None
    missing: Floats = field(default_factory=lambda: np.empty(0))


def _even_reading(period: float, seconds: Floats, signals: Sequence[Floats]) -> _Reading:
    """Return one piece on an even grid, interpolated only where its stamps stray or samples are missing.

    The stamps may be wrong rather than the times of the samples: a logger stamps on arrival what a drive sampled
    evenly. Stamps are believed unless the position is surely smoother without them.
    """
    seconds, signals = _without_odd_ends(seconds, signals, period)
    count = round(float(seconds[-1] - seconds[0]) / period) + 1
    grid = seconds[0] + period * np.arange(count)
    start = float(seconds[0])
    if count == len(seconds):
        number, line = np.arange(float(count)), grid
    else:
        number = _sample_numbers((seconds - start) / period)
        line = np.polyval(np.polyfit(number, seconds, 1), number)
    stray = float(np.max(np.abs(line - seconds))) / period
    if float(np.max(np.abs(np.diff(seconds) - period))) <= _MAX_UNEVEN * period:  # a clock whose rate drifts
        stray, number = 0.0, np.arange(float(len(seconds)))
    missing = _missing_numbers(number)
    if stray <= _MAX_STRAY and not len(missing):
        return _Reading(period, start, [np.ascontiguousarray(values, dtype=np.float64) for values in signals], stray)
    at_grid = _interpolated(seconds, signals, np.clip(grid, seconds[0], seconds[-1]))
    stamped = _Reading(period, start, at_grid, stray, missing=start + period * missing)
    is_counted = _counted_period(seconds) > 0.0
    number = np.arange(float(len(seconds))) if is_counted else _sample_numbers((seconds - start) / period)
    if np.any(np.diff(number) < 1.0):
        return stamped
    even = _interpolated(number, signals, np.arange(number[-1] + 1.0))
    if not _is_significantly_smoother(even[0], stamped.signals[0]):
        return stamped
    period, begin = (float(value) for value in np.polyfit(number, seconds, 1))
    stray = float(np.max(np.abs(seconds - begin - period * number))) / period
    lacking = begin + period * _missing_numbers(number)
    return _Reading(period, begin, even, stray, (seconds, begin + period * number), lacking)


def _missing_numbers(number: Floats) -> Floats:
    """Return the numbers between the first and the last one that are not there."""
    return np.setdiff1d(np.arange(number[-1] + 1.0), number)


def _sample_numbers(periods: Floats) -> Floats:
    """Return the numbers of evenly taken samples from their inexact times, from 0.

    The rate of the samples is where the spectrum of their times has its peak, so that missing samples and single wrong
    times do not shift it.

    Args:
        periods: times of the samples from the first one, in rough periods, shape (n,).
    """
    rates = 1.0 + np.arange(-_RATES, _RATES + 1) / (4.0 * periods[-1])
    spectrum = [np.sum(np.exp(-2.0j * np.pi * rate * periods)) for rate in rates]
    best = int(np.argmax(np.abs(spectrum)))
    phase = -float(np.angle(spectrum[best])) / (2.0 * np.pi)
    number = np.round(rates[best] * periods - phase)
    return np.asarray(number - number[0], dtype=np.float64)


def _interpolated(times: Floats, signals: Sequence[Floats], wanted: Floats) -> list[Floats]:
    """Return position and effort by a cubic through the samples, and the reference by straight lines."""
    position, effort = (np.asarray(CubicSpline(times, values)(wanted)) for values in signals[:2])
    return [position, effort, np.interp(wanted, times, signals[2])]


def _is_significantly_smoother(position: Floats, other: Floats) -> bool:
    """Return whether third differences of a position are surely smaller than those of another reading of it.

    Those of a smooth motion are small, and what wrong times add to a motion is not smooth. Their rms is compared in
    blocks of time. The standard error of the decrease follows from its scatter, so that no single block decides. Where
    two stamps nearly agree, a cubic through them makes a few blocks so rough that the scatter hides all others: then
    the number of smoother blocks decides.
    """
    count = min(len(position), len(other)) - 3
    blocks = np.arange(0, count, _BLOCK)
    ours, theirs = (
        np.sqrt(np.add.reduceat(np.square(np.diff(values, 3)[:count]), blocks)) for values in (position, other)
    )
    decrease = theirs - ours
    return any(
        float(np.sum(values)) > MIN_Z_SCORE * float(np.linalg.norm(values)) for values in (decrease, np.sign(decrease))
    )


def _notes_on_stamps(name: str, readings: Sequence[_Reading]) -> list[str]:
    """Return sentences about the pieces whose stamps stray, and about samples that are missing."""
    notes = []
    for believes in (True, False):
        some = [one for one in readings if (one.even_times is None) is believes]
        stray = max((one.stray for one in some), default=0.0)
        missing = [float(time) for one in some for time in one.missing]
        if stray > _MAX_STRAY:
            rate = 1.0 / some[0].period
            how = "the positions show that the samples were taken evenly, at"
            how = "the signals were interpolated at" if believes else how
            notes.append(f"{name}: stamps stray by up to {stray:.2g} periods; {how} {rate:.6g} Hz")
        if len(missing) == 1:
            notes.append(f"{name}: one sample is missing, at {missing[0]:.3f} s; it was interpolated")
        elif missing:
            first = f"the first at {missing[0]:.3f} s"
            notes.append(f"{name}: {len(missing)} samples are missing, {first}; they were interpolated")
    return notes


def _without_odd_ends(seconds: Floats, signals: Sequence[Floats], period: float) -> tuple[Floats, Sequence[Floats]]:
    """Return the samples without a few at either end, if only these have uneven pauses."""
    uneven = np.flatnonzero(np.abs(np.diff(seconds) - period) > _MAX_UNEVEN * period)
    early, late = uneven[uneven < _MAX_TRIMMED], uneven[uneven >= len(seconds) - 1 - _MAX_TRIMMED]
    if not len(uneven) or len(early) + len(late) < len(uneven):
        return seconds, signals
    cut = slice(int(early[-1]) + 1 if len(early) else 0, int(late[0]) + 1 if len(late) else None)
    return seconds[cut], [values[cut] for values in signals]


def _other_position(piece: Recording, other: Samples, reading: _Reading, origin: float) -> Floats | None:
    """Return the other axis's position at the samples of a piece.

    Args:
        piece: the piece.
        other: samples of the other axis.
        reading: how the piece was read. Where its stamps are not believed, those of the other axis are moved alike.
        origin: stamp from which the times of the reading count [s].
    """
    good = np.isfinite(other.position)
    if not np.any(good):
        return None
    times = other.stamp_ns[good] * 1e-9 - origin
    if reading.even_times is not None:
        stamps, even = reading.even_times
        times += np.interp(times, stamps, even - stamps)
    return np.asarray(np.interp(reading.start + piece.time, times, other.position[good]))


def join_samples(blocks: Sequence[Samples]) -> Samples:
    """Return consecutive blocks as one; without any block, an empty one.

    Args:
        blocks: in the order of time.
    """
    if not blocks:
        nothing = np.empty(0)
        return Samples(np.empty(0, dtype=np.int64), nothing, nothing, nothing, nothing)
    return Samples(
        *(np.concatenate([getattr(block, name) for block in blocks]) for name in Samples.__dataclass_fields__)
    )


@dataclass(frozen=True)
class Updates:
    """Samples whose position is an update.

    Attributes:
        samples: the samples.
        count: number of recorded samples from one update to the next.
        note: sentence about what was left out; empty where nothing was.
    """

    samples: Samples
    count: int = 1
    note: str = ""


def at_rate_of_changes(samples: Samples, name: str) -> Updates:
    """Return samples with each repeated position left out.

    Args:
        samples: recorded samples of one axis.
        name: name of the recording.

    Raises:
        DataError: the positions change too seldom for an identification.
    """
    rows = np.flatnonzero(np.isfinite(samples.position))
    if len(rows) < MIN_SAMPLES:
        return Updates(samples)
    position, pauses = samples.position[rows], np.diff(samples.stamp_ns[rows])
    typical = float(np.median(pauses))
    if typical <= 0.0 or np.any(pauses < 0):
        return Updates(samples)
    number = np.concatenate(([0], np.cumsum(np.round(pauses / typical)))).astype(np.int64)
    count, update_rows = updates_of(number, position, encoder_step(position))
    if count == 1:
        return Updates(samples)
    rate = 1.0e9 / (count * typical)
    if rate < MIN_RATE:
        raise DataError(
            f"the position of {name} changes at {rate:.3g} Hz only; record a position that is updated at"
            f" {MIN_RATE:g} Hz or more"
        )
    updated = Samples(*(getattr(samples, one)[rows[update_rows]] for one in Samples.__dataclass_fields__))
    note = (
        f"{name}: the position changes with one sample in {count} only; position and effort were read at {rate:.6g} Hz"
    )
    return Updates(updated, count, note)
