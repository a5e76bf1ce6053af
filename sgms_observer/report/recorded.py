"""Signals of one axis out of a recording of both nodes, and which of its compensations came late."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.cdr_arrays import decode_trajectory
from sgms_observer.bags.message_types import TRAJECTORY
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.source import BagReader, find_topic
from sgms_observer.errors import DataError
from sgms_observer.observer.outgoing import HORIZON
from sgms_observer.report.lateness import Lateness, Sent, judge_lateness
from sgms_observer.settings.axis import AxisSettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SETTLE = 1.0
"""Time at the start of a run that does not count in a comparison with the simulated truth [s]."""


def signal_of(bag: Path, topic: str, axis: str) -> tuple[Ints, dict[str, Floats]]:
    """Return the stamps and fields of one axis of a topic, in the order of the stamps.

    Args:
        bag: the recording.
        topic: its name, without namespace.
        axis: name of the axis.

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
    sent = Sent(sent_ns, compensation["effort"], lead, _horizons(bag, axis.name), ahead)
    return judge_lateness(stamps, applied_ns, reference["effort"], sent)


def _horizons(bag: Path, axis: str) -> list[tuple[Ints, Floats]]:
    """Return times [ns] and values [N] of each recorded horizon of an axis; none where none was recorded."""
    found = []
    with BagReader(bag) as reader:
        topic = find_topic(reader, HORIZON, TRAJECTORY)
        for _, _, message in reader.messages([topic] if topic else []):
            horizon = decode_trajectory(message)
            if axis in horizon.names and horizon.values["effort"].shape[1] and len(horizon.time_ns):
                found.append((horizon.time_ns, horizon.values["effort"][:, horizon.names.index(axis)]))
    return found
