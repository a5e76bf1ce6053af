"""Reads recordings as the observer wants them: samples per axis, or one topic's JointStates as arrays."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.bags.blocks import JointStates, MessageBlock, Pattern, decode_joint_states
from sgms_observer.bags.source import INPUTS, BagReader, find_topic, needed_inputs
from sgms_observer.errors import RecordingError
from sgms_observer.observer.block_pairing import Messages, in_order_of_stamps, push_block
from sgms_observer.observer.pairing import Pairing, PairingCounts
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.units import UNSCALED, ScaledAxes, Scales, scales_by_axis

# A recorder on a busy machine writes one topic seconds after another. Waiting costs nothing here, and gives the samples
# that the observer saw.
_HOLD = 60.0  # s
_MOST_WAITING = 2**18
_STEPS = 10  # steps of the stamps that the sample period is taken from, at least
_BLOCKS = 20  # blocks that are looked at for them, at most
_UNKNOWN_PERIOD = 1.0e-3  # s, for a recording of a single sample


class BagSamples:
    """The samples of some axes of a recording: an iterator over (axis, block of samples).

    Args:
        path: the bag.
        axes: entries of ``name`` that are wanted, with their factors from the messages to SI (``Settings.scales``);
            names alone are those of axes whose messages are in SI.
        sample_period: nominal time between two samples [s]; None takes the median of the recording's start.
        topics: names of ``position``, ``control_effort`` and ``reference`` where they differ; position and
            control_effort may be the same topic, and are if the bag has ``joint_states`` and no ``position``.
        needs_effort: refuse a recording without efforts.
        is_sorted: take messages that came after later ones of their topic in the order of their stamps, all in memory.
            Otherwise they are left out, as the observer does.

    Attributes:
        span_ns: times of the first and the last message of the recording [ns].

    Raises:
        RecordingError: the bag cannot be read or lacks a topic; the iteration raises it if an axis is not in it.
    """

    def __init__(
        self,
        path: str | Path,
        axes: ScaledAxes,
        sample_period: float | None = None,
        *,
        topics: Mapping[str, str] | None = None,
        needs_effort: bool = True,
        is_sorted: bool = False,
    ) -> None:
        self._is_sorted = is_sorted
        self._bag = BagReader(path)
        try:
            self._topics = needed_inputs(self._bag, topics or {}, INPUTS[:2] if needs_effort else INPUTS[:1])
        except BaseException:
            self._bag.close()
            raise
        self.span_ns = self._bag.span_ns
        self._axes = scales_by_axis(axes)
        self._period = sample_period
        self._pairings: dict[str, Pairing] = {}
        self._seen: dict[str, int] = {}  # names in the position topic
        self._malformed = 0
        self._patterns: dict[str, list[Pattern]] = {}

    @property
    def counts(self) -> dict[str, PairingCounts]:
        """Return what became of the messages of each axis so far."""
        return {axis: pairing.counts for axis, pairing in self._pairings.items()}

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return sentences about what could not be read or paired; complete after the iteration."""
        sentences = list(self._bag.warnings)
        if self._malformed:
            sentences.append(f"{self._malformed} messages of {self._bag.path} are no JointState; they were not used")
        for axis, pairing in self._pairings.items():
            sentences += [f"{axis}: {sentence}" for sentence in pairing.counts.sentences()]
        return tuple(sentences)

    def refuse_unknown_axes(self) -> None:
        """Raise if no position of the bag has the name of an axis; call it before the iteration.

        It reads the first positions only, or all of them where an axis is not among the first.

        Raises:
            RecordingError: an axis is not in the bag.
        """
        topic = self._topics["position"] or ""
        names: dict[str, None] = {}
        patterns: list[Pattern] = []
        for block in self._bag.blocks((topic,)):
            groups, _ = decode_joint_states(block, block.of_topic(topic), patterns)
            names.update(dict.fromkeys(name for group in groups for name in group.names))
            if names.keys() >= self._axes.keys():
                return
        for axis in self._axes:
            if axis not in names:
                self._bag.close()
                raise self._unknown_axis(axis, list(names))

    def __iter__(self) -> Iterator[tuple[str, Samples]]:
        """Yield axis and samples, in order of time for each axis."""
        wanted = tuple(dict.fromkeys(topic for topic in self._topics.values() if topic))
        waiting: list[dict[str, list[JointStates]]] = []
        with self._bag:
            for block in self._bag.blocks(wanted):
                waiting.append({topic: self._decode(block, topic) for topic in wanted})
                if self._is_sorted or (not self._pairings and not self._start(waiting)):
                    continue
                for decoded in waiting:
                    yield from self._pair(decoded)
                waiting.clear()
            if waiting:
                self._start(waiting, is_all=True)
            if self._is_sorted:
                waiting = [_joined(waiting)]
            while waiting:
                yield from self._pair(waiting.pop(0))
            for axis, pairing in self._pairings.items():
                pairing.flush()
                while (samples := pairing.pop()) is not None:
                    yield axis, samples
            self._check_axes()

    def _decode(self, block: MessageBlock, topic: str) -> list[JointStates]:
        groups, bad = decode_joint_states(block, block.of_topic(topic), self._patterns.setdefault(topic, []))
        self._malformed += bad
        if topic == self._topics["position"]:
            for group in groups:
                for name in group.names:
                    self._seen[name] = self._seen.get(name, 0) + group.row.size
        return groups

    def _pair(self, decoded: Mapping[str, list[JointStates]]) -> Iterator[tuple[str, Samples]]:
        """Push one block's messages and yield what is complete."""
        for axis, pairing in self._pairings.items():
            inputs = [_select(decoded.get(self._topics[name] or "", []), axis, name) for name in INPUTS]
            push_block(pairing, *(in_order_of_stamps(inputs) if self._is_sorted else inputs))
            while (samples := pairing.pop()) is not None:
                yield axis, samples

    def _start(self, waiting: Sequence[Mapping[str, list[JointStates]]], is_all: bool = False) -> bool:
        """Make the pairings once the blocks that wait show the sample period; return whether they do."""
        period = self._period
        if period is None:
            topic = self._topics["position"] or ""
            groups = [group for decoded in waiting for group in decoded[topic] if set(self._axes) & set(group.names)]
            steps = np.diff(np.sort(np.concatenate([group.stamp_ns for group in groups]))) if groups else np.empty(0)
            steps = steps[steps > 0]
            if steps.size < _STEPS and len(waiting) < _BLOCKS and not is_all:
                return False
            period = float(np.median(steps)) * 1e-9 if steps.size else _UNKNOWN_PERIOD
        self._pairings = {
            axis: Pairing(period, scales, hold=_HOLD, most=_MOST_WAITING) for axis, scales in self._axes.items()
        }
        return True

    def _check_axes(self) -> None:
        """Raise if an axis had no sample at all."""
        for axis in self._axes:
            if axis in self._pairings and self._pairings[axis].counts.samples:
                continue
            topic = self._topics["position"]
            if axis in self._seen:
                raise RecordingError(
                    f"{topic} in {self._bag.path} has no usable position of axis {axis}; record it again"
                )
            raise self._unknown_axis(axis, list(self._seen))

    def _unknown_axis(self, axis: str, names: Sequence[str]) -> RecordingError:
        """Return the error about an axis that no position has, with the first names of the topic."""
        held = ", ".join(ascii(name)[1:-1] for name in names[:10]) or "no joint"
        return RecordingError(
            f"{self._topics['position']} in {self._bag.path} holds {held}, not axis {axis}; name the axis as the bag"
            " does"
        )


def read_samples(
    path: str | Path,
    axis: str,
    sample_period: float | None = None,
    *,
    scales: Scales = UNSCALED,
    topics: Mapping[str, str] | None = None,
    needs_effort: bool = True,
) -> Iterator[Samples]:
    """Read the samples of one axis, with bounded memory.

    Args:
        path: the bag.
        axis: its entry in ``name``.
        sample_period: nominal time between two samples [s]; None takes the median of the recording's start.
        scales: the axis's factors from the messages to SI (``AxisSettings.scales``).
        topics: names of ``position``, ``control_effort`` and ``reference`` where they differ.
        needs_effort: refuse a recording without efforts.

    Yields:
        Blocks of samples in SI; effort and reference are NaN where they are missing.

    Raises:
        RecordingError: the bag cannot be read, or lacks a topic or the axis.
    """
    for _, samples in BagSamples(path, {axis: scales}, sample_period, topics=topics, needs_effort=needs_effort):
        yield samples


def read_joint_states(path: str | Path, topic: str) -> JointStates:
    """Read one whole topic into memory.

    Args:
        path: the bag.
        topic: its name, with or without namespace.

    Returns:
        All messages in order; the names of all of them, with NaN where a message lacks one.

    Raises:
        RecordingError: the bag cannot be read, or lacks the topic.
    """
    with BagReader(path) as bag:
        name = find_topic(bag, topic)
        if name is None:
            raise RecordingError(f"{path} has no topic {topic}; it holds {', '.join(sorted(bag.topics)) or 'none'}")
        groups: list[JointStates] = []
        total = 0
        for block in bag.blocks((name,)):
            found, _ = decode_joint_states(block, np.arange(len(block)))
            groups += [replace(part, row=part.row + total) for part in found]
            total += len(block)
    names = tuple(dict.fromkeys(joint for group in groups for joint in group.names))
    row = np.concatenate([group.row for group in groups]) if groups else np.empty(0, np.intp)
    order = np.argsort(row, kind="stable")
    stamps = np.concatenate([group.stamp_ns for group in groups])[order] if groups else np.empty(0, np.int64)

    def columns(field: str) -> Floats:
        table = np.full((row.size, len(names)), np.nan)
        first = 0
        for group in groups:
            rows = slice(first, first + group.row.size)
            for column, joint in enumerate(group.names):
                table[rows, names.index(joint)] = getattr(group, field)[:, column]
            first += group.row.size
        return table[order]

    return JointStates(names, stamps, columns("position"), columns("velocity"), columns("effort"), row[order])


def _joined(blocks: Sequence[Mapping[str, list[JointStates]]]) -> dict[str, list[JointStates]]:
    """Return the messages of several blocks as one block; later blocks have higher rows."""
    joined: dict[str, list[JointStates]] = {}
    first = 0
    for decoded in blocks:
        for topic, groups in decoded.items():
            joined.setdefault(topic, []).extend(replace(group, row=group.row + first) for group in groups)
        first += 1 + max((int(group.row[-1]) for groups in decoded.values() for group in groups), default=-1)
    return joined


def _select(groups: list[JointStates], axis: str, name: str) -> Messages:
    """Return one axis's part of one topic, in order of arrival."""
    parts = []
    for group in groups:
        if axis in group.names:
            column = group.names.index(axis)
            first = group.effort if name == "control_effort" else group.position
            if column >= group.filled[2 if name == "control_effort" else 0]:
                continue  # an array that the sender left empty or too short
            parts.append((group.stamp_ns, group.row, first[:, column], group.velocity[:, column]))
    if not parts:
        return Messages.none()
    stamps, rows, first, second = (
        parts[0] if len(parts) == 1 else [np.concatenate(columns) for columns in zip(*parts, strict=True)]
    )
    if len(parts) > 1:
        order = np.argsort(rows, kind="stable")
        stamps, rows, first, second = stamps[order], rows[order], first[order], second[order]
    return Messages(stamps, rows.astype(np.int64), first, second)
