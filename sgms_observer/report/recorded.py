"""Signals of one axis out of a recording of both nodes, and which of its compensations came late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.bags.message_types import TRAJECTORY
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.source import BagReader, find_topic
from sgms_observer.bags.trajectory_cdr import decode_trajectory
from sgms_observer.compensation.horizon import Horizon
from sgms_observer.errors import DataError
from sgms_observer.observer.outgoing import HORIZON
from sgms_observer.settings.axis import AxisSettings

RECOVERY = 0.05
"""Recovery time of the axis after a late compensation [s]: several time constants of the controller."""

_SAME = 1.0e-9  # N

SETTLE = 1.0
"""Time at the start of a run that does not count in a comparison with the simulated truth [s]."""


@dataclass(frozen=True)
class Lateness:
    """Lateness of each sample.

    Attributes:
        is_known: whether the recording tells what was applied.
        is_late: where something else was applied than what was meant for that time, shape (n,).
        is_clear: where nothing was late and nothing had been for ``RECOVERY``, shape (n,).
    """

    is_known: bool
    is_late: Booleans
    is_clear: Booleans


@dataclass(frozen=True)
class Sent:
    """Compensation that was sent to the stage.

    Attributes:
        stamp_ns: stamps of the single values [ns], increasing, shape (m,).
        force: the single values [N], shape (m,).
        lead: time from a single value's stamp to its action [s].
        horizons: of each horizon the part that acts if every message comes in time.
        ahead: time from a sample to the one at which the stage reads a horizon for it [s].
    """

    stamp_ns: Ints
    force: Floats
    lead: float
    horizons: Sequence[Horizon] = ()
    ahead: float = 0.0

    def holds(self, time_ns: Ints, applied: Floats) -> Booleans:
        """Return whether each applied force is the one that was sent for its time, shape (n,).

        Args:
            time_ns: samples, increasing [ns], shape (n,).
            applied: forces at them [N], shape (n,).
        """
        place = np.searchsorted(self.stamp_ns + round(self.lead * 1e9), time_ns, side="right") - 1
        meant = np.where(place >= 0, self.force[np.maximum(place, 0)], 0.0)
        found: Booleans = np.abs(applied - meant) <= _SAME
        read_ns = time_ns + round(self.ahead * 1e9)
        for horizon in self.horizons:
            begin = horizon.time_ns[0]
            rows = slice(*np.searchsorted(read_ns, [begin, horizon.time_ns[-1] + 1]))
            since, times = (read_ns[rows] - begin).astype(float), (horizon.time_ns - begin).astype(float)
            value = np.interp(since, times, horizon.effort)
            found[rows] |= np.abs(applied[rows] - value) <= _SAME
        return found


def judge_lateness(stamp_ns: Ints, applied_ns: Ints, applied: Floats, sent: Sent) -> Lateness:
    """Compare the applied compensation with the one that was sent for that time.

    Args:
        stamp_ns: the samples to judge [ns], shape (n,).
        applied_ns: samples at which the stage said what it applied, increasing [ns].
        applied: what it applied [N], NaN where it did not say.
        sent: what was sent to it.
    """
    count = len(stamp_ns)
    nothing = Lateness(False, np.zeros(count, bool), np.ones(count, bool))
    if not len(sent.stamp_ns) or not np.isfinite(applied).any():
        return nothing
    was_late = np.isfinite(applied) & ~sent.holds(applied_ns, applied)
    is_late = np.isin(stamp_ns, applied_ns[was_late])
    late_ns = applied_ns[was_late]
    before = np.searchsorted(late_ns, stamp_ns, side="right") - 1
    since = stamp_ns - late_ns[np.maximum(before, 0)] if len(late_ns) else np.zeros(count, np.int64)
    has_been = (before >= 0) & (since < round(RECOVERY * 1e9))
    return Lateness(True, is_late, ~has_been)


def signal_of(bag: Path, topic: str, axis: str) -> tuple[Ints, dict[str, Floats]]:
    """Return the stamps and fields of one axis of a topic, in the order of the stamps.

    Raises:
        RecordingError: the bag lacks the topic.
        DataError: the topic holds nothing of the axis.
    """
    states = read_joint_states(bag, topic)
    if axis not in states.names or not states.stamp_ns.size:
        raise DataError(f"{topic} in {bag} holds nothing of axis {axis}; see the logs beside it")
    column = states.names.index(axis)
    stamps, rows = np.unique(states.stamp_ns, return_index=True)
    fields = {name: getattr(states, name)[rows, column] for name in ("position", "velocity", "effort")}
    return stamps, fields


def recorded_lateness(bag: Path, axis: AxisSettings, stamps: Ints, sample_period: float) -> Lateness:
    """Return whether each sample of the stage got its compensation in time.

    Args:
        bag: the recording of both nodes.
        axis: what it was recorded with.
        stamps: samples to judge [ns].
        sample_period: time between two samples [s].
    """
    applied_ns, reference = signal_of(bag, "reference", axis.name)
    sent_ns, compensation = signal_of(bag, "friction_compensation", axis.name)
    lead = max(0.0, axis.compensation.look_ahead - axis.stage.actuation_delay)
    ahead = axis.stage.actuation_delay + 0.5 * sample_period
    horizons = [one.without_fading_end(axis.compensation, sample_period) for one in _horizons(bag, axis.name)]
    sent = Sent(sent_ns, compensation["effort"], lead, horizons, ahead)
    return judge_lateness(stamps, applied_ns, reference["effort"], sent)


def _horizons(bag: Path, axis: str) -> list[Horizon]:
    """Return each recorded horizon of an axis; none where none was recorded."""
    found = []
    with BagReader(bag) as reader:
        topic = find_topic(reader, HORIZON, TRAJECTORY)
        for _, _, message in reader.messages([topic] if topic else []):
            horizon = decode_trajectory(message)
            if axis in horizon.names and horizon.values["effort"].shape[1] and len(horizon.time_ns):
                found.append(Horizon(horizon.time_ns, horizon.values["effort"][:, horizon.names.index(axis)]))
    return found
