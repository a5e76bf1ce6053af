"""Reads a bag of any storage, also a damaged one, as one stream of message blocks; lists its topics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType

import numpy as np

from sgms_observer.arrays import Ints
from sgms_observer.bags.bag_folder import find_files, unpack_file, unpack_message
from sgms_observer.bags.blocks import MessageBlock, Pattern, decode_joint_states
from sgms_observer.bags.mcap_reader import McapReader
from sgms_observer.bags.message_types import JOINT_STATE
from sgms_observer.bags.sqlite_storage import SqliteReader
from sgms_observer.errors import RecordingError

INPUTS = ("position", "control_effort", "reference")
_SINGLE_TOPIC = "joint_states"


class BagReader:
    """A bag, open for reading, as a context manager.

    Args:
        path: a rosbag2 folder (also an interrupted one without metadata.yaml), or one .mcap or .db3 file.

    Attributes:
        path: the bag.
        topics: name to message type of every topic.

    Raises:
        RecordingError: it is no bag, or nothing of it can be read.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.topics: dict[str, str] = {}
        self._files: list[McapReader | SqliteReader] = []
        self._warnings: list[str] = []
        self._stack = ExitStack()
        try:
            self._open()
        except BaseException:
            self._stack.close()
            raise

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return sentences about what could not be read; complete once all blocks were read."""
        sentences = [*self._warnings, *(sentence for file in self._files for sentence in file.warnings)]
        return tuple(dict.fromkeys(sentences))

    @property
    def span_ns(self) -> tuple[int, int]:
        """Return the times of the first and the last message as the files state them [ns]; (0, 0) if there is none."""
        spans = [span for span in (file.span_ns for file in self._files) if span[1]]
        return (min(start for start, _ in spans), max(end for _, end in spans)) if spans else (0, 0)

    def blocks(self, topics: Sequence[str] | None = None) -> Iterator[MessageBlock]:
        """Read messages in order of their time, with bounded memory.

        Args:
            topics: names to read; all if None.

        Yields:
            Blocks of at least one message, of all the topics asked for.
        """
        wanted = tuple(self.topics) if topics is None else tuple(topics)
        for file in self._files:
            for block in file.blocks(wanted):
                yield _unpack_messages(block) if self._is_packed else block

    def messages(self, topics: Sequence[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """Read messages one by one.

        Args:
            topics: names to read; all if None.

        Yields:
            Topic, time of the recording [ns] and the message's bytes.
        """
        for block in self.blocks(topics):
            content = block.data.tobytes()
            rows = zip(
                block.topic.tolist(), block.log_ns.tolist(), block.start.tolist(), block.length.tolist(), strict=True
            )
            for topic, log_ns, start, length in rows:
                yield block.topics[topic], log_ns, content[start : start + length]

    def close(self) -> None:
        """Close all files."""
        self._stack.close()

    def __enter__(self) -> BagReader:
        """Return the reader."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close all files."""
        self.close()

    def _open(self) -> None:
        found = find_files(self.path)
        self._warnings += found.warnings
        self._is_packed = found.compression == "message"
        failures = []
        for path in found.files:
            if found.compression == "file" and path.suffix == ".zstd":
                path = unpack_file(path, Path(self._stack.enter_context(TemporaryDirectory(prefix="sgms-bag-"))))
            try:
                file = McapReader(path) if path.suffix == ".mcap" else SqliteReader(path)
            except RecordingError as error:
                failures.append(str(error))
                continue
            self._stack.callback(file.close)
            self._files.append(file)
            for name, kind in file.topics.items():
                self.topics.setdefault(name, kind)
        if not self._files:
            raise RecordingError(failures[0])
        self._warnings += failures


def find_topic(bag: BagReader, name: str, kind: str = JOINT_STATE) -> str | None:
    """Find a topic by its name, with or without namespace.

    Args:
        bag: the recording.
        name: such as ``position``, which ``/position`` matches, or else the only ``/.../position``.
        kind: the type of message that it must have.

    Returns:
        The topic's full name, or None if there is none.

    Raises:
        RecordingError: the name fits several topics, or one of another type.
    """
    bare = name.lstrip("/")
    exact = "/" + bare
    found = [topic for topic in bag.topics if topic in (exact, name)]
    if not found and not name.startswith("/"):
        found = [topic for topic in bag.topics if topic.endswith(exact)]
    if len(found) > 1:
        raise RecordingError(
            f"{bag.path} holds several topics called {name}: {', '.join(found)}; name one of them in full"
        )
    if found and bag.topics[found[0]] != kind:
        raise RecordingError(
            f"{found[0]} in {bag.path} has the type {bag.topics[found[0]] or '(unknown)'}; {kind} is needed"
        )
    return found[0] if found else None


def find_inputs(bag: BagReader, names: Mapping[str, str]) -> dict[str, str | None]:
    """Return the topic of a bag for each input of the observer, None where there is none.

    Args:
        bag: the recording.
        names: names of ``position``, ``control_effort`` and ``reference`` where they differ.

    Raises:
        RecordingError: a name fits several topics, or one of another type, or is that of no input.
    """
    unknown = set(names) - set(INPUTS)
    if unknown:
        raise RecordingError(
            f"{', '.join(sorted(unknown))} is no input of the observer; rename {', '.join(INPUTS)} only"
        )
    found = {name: find_topic(bag, names.get(name, name)) for name in INPUTS}
    if not names and found["position"] is None and (single := find_topic(bag, _SINGLE_TOPIC)):
        found["position"] = found["control_effort"] = single
    return found


def needed_inputs(bag: BagReader, names: Mapping[str, str], needed: Sequence[str] = ()) -> dict[str, str | None]:
    """Return the topics as of ``find_inputs``; an input that is needed or that the user named must be there.

    Args:
        bag: the recording.
        names: names of ``position``, ``control_effort`` and ``reference`` where they differ.
        needed: inputs that must be there.

    Raises:
        RecordingError: as of ``find_inputs``, or such an input is not there.
    """
    found = find_inputs(bag, names)
    for key in dict.fromkeys((*needed, *names)):
        if found[key] is None:
            raise missing_topic(bag, names.get(key, key), key)
    return found


def missing_topic(bag: BagReader, name: str, key: str) -> RecordingError:
    """Return the error about a topic that a bag lacks, with what it holds and how the user says which of it is meant.

    Args:
        bag: the recording.
        name: the topic.
        key: the input that it would be: ``position``, ``control_effort`` or ``reference``.
    """
    held = ", ".join(sorted(bag.topics)) or "no topic at all"
    others = set(INPUTS) - {key}
    fitting = sorted(
        topic for topic, kind in bag.topics.items() if kind == JOINT_STATE and topic.rpartition("/")[2] not in others
    )
    same_name = next((topic for topic in fitting if key in topic.split("/")), "")
    remedy = f"record {key} as {JOINT_STATE}"
    if same_name:
        remedy = f"name it with --topic {key}={same_name}"
    elif fitting:
        remedy = f"if one of them is the {key}, name it with --topic {key}=TOPIC; otherwise {remedy}"
    return RecordingError(f"{bag.path} has no topic {name}; it holds {held}; {remedy}")


def _unpack_messages(block: MessageBlock) -> MessageBlock:
    """Return the block with every message unpacked."""
    messages = [unpack_message(block.message(row)) for row in range(len(block))]
    length = np.fromiter(map(len, messages), np.int64, len(messages))
    data = np.frombuffer(b"".join(messages), np.uint8)
    return MessageBlock(block.topics, block.topic, block.log_ns, data, np.cumsum(length) - length, length)


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
    stamp_ns: dict[tuple[str, ...], Ints]
    filled: dict[str, tuple[int, int, int]]
    malformed: int

    def stamps_of(self, joint: str) -> Ints:
        """Return the stamps of the messages that name a joint [ns]; in order of time where their layouts differ.

        Args:
            joint: its name.
        """
        found = [stamps for names, stamps in self.stamp_ns.items() if joint in names]
        if len(found) == 1:
            return found[0]
        return np.sort(np.concatenate(found)) if found else np.empty(0, np.int64)

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
        stamps: dict[str, dict[tuple[str, ...], list[Ints]]] = {name: {} for name in kinds}
        filled: dict[str, dict[str, Ints]] = {name: {} for name in kinds}
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
        filled_of = {joint: (int(a), int(b), int(c)) for joint, (a, b, c) in filled[name].items()}
        joints = tuple(filled_of)
        topics.append(TopicSurvey(name, kinds[name], counts[name], joints, joined, filled_of, malformed[name]))
    return tuple(topics), warnings
