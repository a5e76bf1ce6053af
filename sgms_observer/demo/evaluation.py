"""What a recorded run shows: errors of the estimate, and of the tracking without and with compensation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.source import BagReader
from sgms_observer.errors import DataError, RecordingError
from sgms_observer.report.run_pictures import Run

Floats = NDArray[np.float64]
_SETTLING = 0.15  # share of each part that is left to settle


@dataclass(frozen=True)
class Part:
    """Errors over a part of the run.

    Attributes:
        start: [s].
        end: [s].
        friction_rms: of estimate - truth [N].
        friction_nrmse: the same over the range of the truth [%].
        coverage: share of the samples at which the two-sigma band holds the truth.
        tracking_rms: [m].
        tracking_peak: [m].
    """

    start: float
    end: float
    friction_rms: float
    friction_nrmse: float
    coverage: float
    tracking_rms: float
    tracking_peak: float


@dataclass(frozen=True)
class Evaluation:
    """A run and its figures.

    Attributes:
        run: everything on the stamps of the estimates.
        off: without compensation, settled.
        on: with it, settled; None where it never was on.
        messages: messages per topic.
    """

    run: Run
    off: Part
    on: Part | None
    messages: dict[str, int]


def load_run(bag: Path, axis: str) -> Run:
    """Bring a recording onto the stamps of its estimates.

    Args:
        bag: the recording.
        axis: name of the axis.

    Returns:
        The run; arrays of NaN for topics that the bag lacks.

    Raises:
        RecordingError: the bag cannot be read or holds no estimates.
    """
    estimate = read_joint_states(bag, "friction_estimate")
    column = _column_of(estimate.names, axis, bag)
    stamps = estimate.stamp_ns

    def on_stamps(topic: str, field: str) -> Floats:
        try:
            states = read_joint_states(bag, topic)
        except RecordingError:
            return np.full(len(stamps), np.nan)
        values = getattr(states, field)
        if axis not in states.names or not values.size:
            return np.full(len(stamps), np.nan)
        at = np.searchsorted(states.stamp_ns, stamps)
        at = np.minimum(at, len(states.stamp_ns) - 1)
        found: Floats = np.where(states.stamp_ns[at] == stamps, values[at, states.names.index(axis)], np.nan)
        return found

    return Run(
        time=(stamps - stamps[0]) * 1e-9,
        position=on_stamps("position", "position"),
        velocity=estimate.velocity[:, column],
        reference=on_stamps("reference", "position"),
        friction=estimate.effort[:, column],
        friction_std=on_stamps("friction_std", "effort"),
        truth=on_stamps("friction_true", "effort"),
        compensation=on_stamps("friction_compensation", "effort"),
    )


def evaluate(bag: Path, axis: str) -> Evaluation:
    """Evaluate a recorded run.

    Args:
        bag: the recording.
        axis: name of the axis.

    Raises:
        RecordingError: the bag cannot be read or holds no estimates.
        DataError: it is too short, or without set-point or true friction.
    """
    run = load_run(bag, axis)
    if len(run.time) < 100 or not run.has_truth or not np.isfinite(run.reference).any():
        raise DataError(f"{bag} is too short or lacks friction_true or reference; record the whole demonstration")
    driven = np.flatnonzero(np.abs(run.compensation) > 0.0)
    switch = float(run.time[driven[0]]) if driven.size else float(run.time[-1])
    with BagReader(bag) as reader:
        messages = dict.fromkeys(reader.topics, 0)
        for block in reader.blocks(tuple(reader.topics)):
            for topic in messages:
                messages[topic] += len(block.of_topic(topic))
    off = _part(run, 0.0, switch)
    on = _part(run, switch, float(run.time[-1])) if driven.size else None
    return Evaluation(run, off, on, messages)


def _column_of(names: tuple[str, ...], axis: str, bag: Path) -> int:
    """Return an axis's column."""
    if axis not in names:
        raise RecordingError(f"{bag} holds estimates of {', '.join(names)}, not of axis {axis}; name one of them")
    return names.index(axis)


def _part(run: Run, start: float, end: float) -> Part:
    """Return the errors of a part, without its first ``_SETTLING``."""
    settled = run.between(start + _SETTLING * (end - start), end)
    error = settled.friction - settled.truth
    known = np.isfinite(error)
    tracking = settled.position - settled.reference
    tracking = tracking[np.isfinite(tracking)]
    if not known.any() or not tracking.size:
        raise DataError(f"nothing can be compared between {start:.1f} s and {end:.1f} s; record for longer")
    rms = float(np.sqrt(np.mean(error[known] ** 2)))
    return Part(
        start=start,
        end=end,
        friction_rms=rms,
        friction_nrmse=100.0 * rms / float(np.ptp(settled.truth[known])),
        coverage=float(np.mean(np.abs(error[known]) <= 2.0 * settled.friction_std[known])),
        tracking_rms=float(np.sqrt(np.mean(tracking**2))),
        tracking_peak=float(np.abs(tracking).max()),
    )
