"""Facts about one axis of a recording: rate, jitter, gaps, range, encoder step, efforts, rough force balance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import signal

from sgms_observer.application.effort_cut_off import cut_effort_warnings
from sgms_observer.application.force_balance import ForceBalance, fit_force_balance
from sgms_observer.application.gravity_unit import GravityUnit, gravity_unit
from sgms_observer.arrays import Floats, Ints
from sgms_observer.bags.source import TopicSurvey
from sgms_observer.errors import DataError
from sgms_observer.observer.pairing import MAX_LAG
from sgms_observer.offline.encoder import encoder_step
from sgms_observer.offline.jumps import MAX_PAUSE
from sgms_observer.offline.recording import Recordings, mean_period, recordings_from_samples, samples_of_bag
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import REVOLUTE

_MAX_PAIRED = 0.1  # share of the positions whose effort has their stamp by chance
_GAP = 1.5  # periods; in a longer pause at least one sample is missing
_SPEED_RATE_SHARE = 0.05
"""Corner of the low-pass before the peak speed, over the sample rate."""
_MIN_REVERSAL = 0.02
"""Share of the range; a shorter travel back is no reversal."""
_MIN_SLOWER = 1.5  # of the period of the efforts to that of the positions; half a sample more than jitter makes
_REVERSAL_STEPS = 5.0  # encoder steps; a shorter travel back is no reversal


@dataclass(frozen=True)
class AxisFacts:
    """Facts about one axis of a recording, in SI units.

    Attributes:
        name: the axis.
        samples: positions with different stamps.
        duration: from the first to the last [s].
        period: mean time between two positions [s]; 0 if unknown.
        effort_period: mean time between two samples that have an effort [s]; that of the positions if unknown.
        jitter: standard deviation of that time without gaps [s].
        gaps: pauses longer than one and a half periods.
        longest_gap: longest pause [s].
        duplicate_stamps: messages with the stamp of the one before.
        backward_stamps: messages with an earlier stamp than the one before.
        position_range: smallest and largest position, unwrapped where an angle wraps [m or rad].
        stroke: largest range of one piece [m or rad].
        recorded_range: range of the positions as they were recorded [m or rad].
        encoder_step: step of the grid of the positions [m or rad]; 0 where there is none.
        position_noise: white noise and steps of the position, standard deviation [m or rad].
        peak_speed: largest speed, low-passed [m/s or rad/s].
        reversals: changes of direction.
        effort_range: smallest and largest effort [N or N m]; NaN where there is none.
        effort_rms: [N or N m].
        missing_efforts: share of the samples without an effort [-].
        missing_positions: messages of the axis whose position is no number.
        effort_fault: reason why efforts do not belong to positions; empty without one.
        has_reference: set-points are recorded.
        pieces: pieces between pauses that are long enough for a fit.
        balance: rough force balance, or None where it cannot be fitted.
        notes: sentences about dropped or changed samples.
        fault: reason why no model can be fitted; empty without one.
        piece_durations: of the pieces between pauses [s].
        cut_off: sentence about an effort that the log cuts off; empty without one.
        gravity: whether gravity shows, and in which unit of the angle, or None without a balance.
    """

    name: str
    samples: int
    duration: float
    period: float
    effort_period: float
    jitter: float
    gaps: int
    longest_gap: float
    duplicate_stamps: int
    backward_stamps: int
    position_range: tuple[float, float]
    stroke: float
    recorded_range: float
    encoder_step: float
    position_noise: float
    peak_speed: float
    reversals: int
    effort_range: tuple[float, float]
    effort_rms: float
    missing_efforts: float
    missing_positions: int
    effort_fault: str
    has_reference: bool
    pieces: int
    balance: ForceBalance | None
    notes: tuple[str, ...]
    fault: str
    piece_durations: tuple[float, ...] = ()
    cut_off: str = ""
    gravity: GravityUnit | None = None

    @property
    def rate(self) -> float:
        """Samples per second [Hz]; 0 if unknown."""
        return 1.0 / self.period if self.period > 0.0 else 0.0

    @property
    def has_slow_effort(self) -> bool:
        """Whether efforts come evenly, but at a lower rate than positions."""
        return self.effort_period > _MIN_SLOWER * self.period > 0.0

    def as_json(self) -> dict[str, object]:
        """Return the facts for ``--json``."""
        return {
            "name": self.name,
            "samples": self.samples,
            "duration_s": self.duration,
            "rate_hz": self.rate,
            "jitter_s": self.jitter,
            "gaps": self.gaps,
            "longest_gap_s": self.longest_gap,
            "duplicate_stamps": self.duplicate_stamps,
            "backward_stamps": self.backward_stamps,
            "position": {
                "min": self.position_range[0],
                "max": self.position_range[1],
                "step": self.encoder_step or None,
                "peak_speed": self.peak_speed,
                "reversals": self.reversals,
            },
            "effort": {
                "min": self.effort_range[0],
                "max": self.effort_range[1],
                "rms": self.effort_rms,
                "missing_share": self.missing_efforts,
            },
            "has_reference": self.has_reference,
            "pieces": self.pieces,
            "sign": {1: "as the motion", -1: "reversed", 0: None}[self.balance.sign if self.balance else 0],
            "force_balance": self.balance.as_json() if self.balance else None,
            "notes": list(self.notes),
        }


def read_axis_facts(
    bag: str | Path,
    axis: AxisSettings,
    survey: TopicSurvey,
    topics: Mapping[str, str],
    has_gravity: bool | None = None,
    *,
    unit: str | None = None,
    effort: TopicSurvey | None = None,
) -> AxisFacts:
    """Return the facts about one axis of a recording.

    Args:
        bag: the recording.
        axis: its name, joint type and scales.
        survey: of the topic that holds its position.
        topics: names of the input topics where they differ.
        has_gravity: fit gravity of a revolute axis; None fits it on a revolute joint.
        unit: of the position in notes; None takes that of the axis.
        effort: survey of the topic that holds its effort, or None.

    Raises:
        RecordingError: the bag cannot be read or lacks a topic or the axis.
    """
    of_axes, order_notes = samples_of_bag(bag, {axis.name: axis.scales}, topics, needs_effort=False)
    samples = of_axes[axis.name]
    position, given = samples.position, samples.effort
    stamps = survey.stamps_of(axis.name)
    backward = int(np.count_nonzero(np.diff(stamps) < 0))
    pauses = np.diff(np.sort(stamps) if order_notes else stamps) * 1e-9
    forward = pauses[pauses > 0.0]
    typical = float(np.median(forward)) if forward.size else 0.0
    whole = forward[forward <= _GAP * typical]
    period = mean_period(forward[forward <= MAX_PAUSE * typical], typical) if forward.size else 0.0
    finite, driven = position[np.isfinite(position)], given[np.isfinite(given)]
    fault, recordings, effort_period = "", Recordings(()), period
    try:
        recordings = recordings_from_samples(samples, Path(bag).name, unit=unit or axis.units.position)
        effort_period = recordings[0].period / recordings.samples_per_update
    except DataError as error:
        fault = str(error)
    gravity = axis.joint_type == REVOLUTE if has_gravity is None else has_gravity
    balance = fit_force_balance(recordings, axis, gravity) if recordings else None
    step = recordings[0].encoder_step if recordings else encoder_step(finite)
    pieces = [piece.position for piece in recordings] or [finite]
    positions = np.concatenate(pieces)
    longest = max((float(np.ptp(piece)) for piece in pieces if len(piece)), default=0.0)
    travel = max(_REVERSAL_STEPS * step, _MIN_REVERSAL * longest)
    return AxisFacts(
        name=axis.name,
        samples=len(position),
        duration=float(np.ptp(stamps)) * 1e-9 if stamps.size else 0.0,
        period=period,
        effort_period=effort_period,
        jitter=float(np.std(whole)) if whole.size else 0.0,
        gaps=int(np.count_nonzero(forward > _GAP * typical)),
        longest_gap=float(forward.max()) if forward.size else 0.0,
        duplicate_stamps=int(np.count_nonzero(pauses == 0.0)),
        backward_stamps=backward,
        position_range=_range(positions),
        stroke=longest,
        recorded_range=float(np.ptp(finite)) if len(finite) else 0.0,
        encoder_step=step,
        position_noise=max((piece.position_noise for piece in recordings), default=0.0),
        peak_speed=max((_peak_speed(piece.position, piece.period) for piece in recordings), default=float("nan")),
        reversals=sum(count_reversals(piece, travel) for piece in pieces),
        effort_range=_range(driven),
        effort_rms=_rms(driven),
        missing_efforts=1.0 - driven.size / max(len(given), 1),
        missing_positions=len(stamps) - survey.filled[axis.name][0],
        effort_fault=_reason_against_pairing(axis.name, stamps, period, effort),
        has_reference=bool(np.any(np.isfinite(samples.reference_position))),
        pieces=len(recordings),
        balance=balance,
        notes=(*order_notes, *recordings.notes),
        fault=fault,
        piece_durations=tuple(piece.duration for piece in recordings),
        cut_off=next(iter(cut_effort_warnings(recordings)), ""),
        gravity=gravity_unit(recordings, balance) if balance is not None else None,
    )


def _reason_against_pairing(name: str, stamps: Ints, period: float, effort: TopicSurvey | None) -> str:
    """Return why the efforts of a topic do not belong to positions with these stamps; empty if they do."""
    if effort is None or not len(stamps):
        return ""
    if name not in effort.joints:
        joints = ", ".join(effort.joints) or "no joint"
        return f"{effort.name} holds {joints}, not {name}: give the joint one name in both topics"
    if not effort.filled[name][2]:
        return f"{effort.name} holds no number as the effort of {name}: record the effort that the actuator applies"
    given = np.sort(effort.stamps_of(name))
    after = np.clip(np.searchsorted(given, stamps), 1, max(len(given) - 1, 1))
    if len(given) < 2:
        return ""
    late, early = (given[after] - stamps) * 1e-9, (given[after - 1] - stamps) * 1e-9
    lags = np.where(np.abs(late) < np.abs(early), late, early)
    lag = float(np.median(lags))
    if np.mean(np.abs(lags) <= MAX_LAG * period) > _MAX_PAIRED or abs(lag) > period:
        return ""
    side = "after" if lag > 0.0 else "before"
    return (
        f"{effort.name} is stamped {1e3 * abs(lag):.3g} ms {side} the position, more than a quarter of the sample"
        " period: stamp both with the time of the sample"
    )


def count_reversals(position: Floats, shortest: float) -> int:
    """Return the number of reversals of the motion.

    Args:
        position: in order of time, shape (n,) [m or rad].
        shortest: shorter travels are not counted [m or rad]; at least 2 % of the range.
    """
    way = max(shortest, _MIN_REVERSAL * float(np.ptp(position))) if len(position) else 0.0
    if way <= 0.0:
        return 0
    turns = np.flatnonzero(np.diff(np.sign(np.diff(position))) != 0) + 1
    count, direction = 0, 0
    low = high = float(position[0])
    for value in (*position[turns].tolist(), float(position[-1])):
        if direction >= 0:
            high = max(high, value)
            if high - value >= way:
                count += direction > 0
                direction, low = -1, value
        if direction <= 0:
            low = min(low, value)
            if value - low >= way:
                count += direction < 0
                direction, high = 1, value
    return count


def _peak_speed(position: Floats, period: float) -> float:
    """Return the largest speed after a low-pass [m/s or rad/s]."""
    sections = signal.butter(2, 2.0 * _SPEED_RATE_SHARE, output="sos")
    smooth = signal.sosfiltfilt(sections, position)
    return float(np.max(np.abs(np.gradient(smooth, period))))


def _rms(values: Floats) -> float:
    """Return the root mean square; NaN of an empty array; scaled, so that no square overflows."""
    largest = float(np.max(np.abs(values), initial=0.0))
    if not largest:
        return 0.0 if values.size else float("nan")
    return largest * float(np.sqrt(np.mean((values / largest) ** 2)))


def _range(values: Sequence[float] | Floats) -> tuple[float, float]:
    return (float(np.min(values)), float(np.max(values))) if len(values) else (float("nan"), float("nan"))
