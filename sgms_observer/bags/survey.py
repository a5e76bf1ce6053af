"""What a bag holds, topic by topic, read once with bounded memory: counts, joints, stamps, filled fields."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.blocks import Pattern, decode_joint_states
from sgms_observer.bags.message_types import JOINT_STATE
from sgms_observer.bags.source import BagReader


@dataclass(frozen=True)
class TopicSurvey:
    """What one topic holds.

    Attributes:
        name: the topic.
        kind: its message type.
        messages: number of messages.
        joints: names in its JointStates, in the order they come.
        stamp_ns: names in a message to the stamps of all messages with these names [ns], in the order they come.
        filled: joint to how many messages hold its position, velocity and effort as finite numbers.
        malformed: messages that are no JointState though the topic says so.
    """

    name: str
    kind: str
    messages: int
    joints: tuple[str, ...]
    stamp_ns: dict[tuple[str, ...], NDArray[np.int64]]
    filled: dict[str, tuple[int, int, int]]
    malformed: int

    def stamps_of(self, joint: str) -> NDArray[np.int64]:
        """Return the stamps of the messages that name a joint [ns]; in order of time where their layouts differ.

        Args:
            joint: its name.
        """
        own = [stamps for names, stamps in self.stamp_ns.items() if joint in names]
        if len(own) == 1:
            return own[0]
        return np.sort(np.concatenate(own)) if own else np.empty(0, np.int64)

    @property
    def rate(self) -> float:
        """Messages per second from the first stamp to the last [Hz]; 0 where no stamps say so."""
        ends = [(int(stamps.min()), int(stamps.max())) for stamps in self.stamp_ns.values() if stamps.size]
        if not ends:
            return 0.0
        span = max(last for _, last in ends) - min(first for first, _ in ends)
        return (self.messages - 1) / (span * 1e-9) if span > 0 else 0.0


def survey_bag(path: str | Path) -> tuple[tuple[TopicSurvey, ...], tuple[str, ...]]:
    """Return what each topic of a bag holds, by name, and sentences about what could not be read.

    Args:
        path: the bag.

    Raises:
        RecordingError: it is no bag, or nothing of it can be read.
    """
    with BagReader(path) as bag:
        kinds = dict(bag.topics)
        counts = dict.fromkeys(kinds, 0)
        malformed = dict.fromkeys(kinds, 0)
        stamps: dict[str, dict[tuple[str, ...], list[NDArray[np.int64]]]] = {name: {} for name in kinds}
        filled: dict[str, dict[str, NDArray[np.int64]]] = {name: {} for name in kinds}
        patterns: dict[str, list[Pattern]] = {name: [] for name in kinds}
        for block in bag.blocks():
            for name in block.topics:
                rows = block.of_topic(name)
                counts[name] += rows.size
                if kinds[name] != JOINT_STATE or not rows.size:
                    continue
                groups, bad = decode_joint_states(block, rows, patterns[name])
                malformed[name] += bad
                for group in groups:
                    stamps[name].setdefault(group.names, []).append(group.stamp_ns)
                    finite = [
                        np.isfinite(field).sum(axis=0) for field in (group.position, group.velocity, group.effort)
                    ]
                    for joint, column in zip(group.names, np.transpose(finite), strict=True):
                        filled[name][joint] = filled[name].get(joint, np.zeros(3, np.int64)) + column
        warnings = bag.warnings
    topics = []
    for name in sorted(kinds):
        joined = {names: np.concatenate(parts) for names, parts in stamps[name].items()}
        own = {joint: (int(a), int(b), int(c)) for joint, (a, b, c) in filled[name].items()}
        topics.append(TopicSurvey(name, kinds[name], counts[name], tuple(own), joined, own, malformed[name]))
    return tuple(topics), warnings
