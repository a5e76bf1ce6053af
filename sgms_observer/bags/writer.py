"""Writes rosbag2 folders: nothing appears under the final name before it is complete."""

from __future__ import annotations

import fcntl
import os
import shutil
import sqlite3
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from sgms_observer.arrays import Ints
from sgms_observer.bags.bag_folder import METADATA, STORAGES, dump_metadata, refuse_existing_bag, take_place
from sgms_observer.bags.mcap_writer import McapWriter
from sgms_observer.bags.message_types import JOINT_STATE, MessageType, describe_type
from sgms_observer.bags.rows import MessageRows, joint_state_rows
from sgms_observer.bags.sqlite_storage import SqliteWriter
from sgms_observer.errors import DataError, RecordingError
from sgms_observer.whole_file import file_in_the_way

PARTIAL = ".partial"  # a recording, worth keeping if it is interrupted
UNFINISHED = ".unfinished"  # what can be made again; a leftover of a killed process is replaced
_FLUSH_PERIOD = 0.5  # s


class _Storage(Protocol):
    """What a storage file can do."""

    def add_topic(self, topic: str, kind: MessageType) -> int: ...
    def write(self, channel: int, log_ns: int, data: bytes) -> None: ...
    def write_rows(self, channel: int, log_ns: Ints, messages: MessageRows) -> None: ...
    def flush(self) -> None: ...
    def close(self, metadata: str) -> None: ...
    def abort(self) -> None: ...


class BagWriter:
    """A rosbag2 folder being written, as a context manager.

    The folder is called ``NAME.unfinished`` (``NAME.partial`` for a recording to keep) until it is complete; at the
    end of the ``with`` block it gets its metadata.yaml and its name. What was written longer than half a second ago
    survives the process (``flush`` helps when nothing more is written). If the block ends with an error the folder is
    removed, unless it shall be kept.

    Args:
        path: the bag's folder; must not exist, unless it may be replaced.
        storage: ``mcap`` or ``sqlite3``.
        keep_on_failure: keep ``NAME.partial`` if the block ends with an error; it is readable.
        is_overwriting: replace a bag of that name, once this one is complete.

    Attributes:
        warnings: sentences about what the bag lacks.

    Raises:
        RecordingError: the folder exists or cannot be written; ``write`` and the end of the block raise it too.
    """

    def __init__(
        self, path: str | Path, storage: str = "mcap", *, keep_on_failure: bool = False, is_overwriting: bool = False
    ) -> None:
        self.path = Path(path)
        self._partial = self.path.with_name(self.path.name + (PARTIAL if keep_on_failure else UNFINISHED))
        self._keep = keep_on_failure
        self.warnings: list[str] = []
        self._kind = storage
        self._topics: dict[str, tuple[int, MessageType]] = {}
        self._counts: dict[str, int] = {}
        self._span = (2**63 - 1, 0)
        self._flush_due = 0.0
        self._lock: int | None = None
        if storage not in STORAGES:
            raise RecordingError(f"{storage} is no storage for a bag; choose one of {', '.join(STORAGES)}")
        if not self.path.name:
            raise RecordingError(f"{path} cannot name a bag; give a folder that does not exist yet")
        refuse_existing_bag(self.path, is_overwriting)
        if keep_on_failure and self._partial.exists():
            raise RecordingError(
                f"{self._partial} holds an interrupted recording; rename it to keep it, or remove it, and start again"
            )
        with self._own_errors():
            if self._partial.exists():
                self._replace_leftover()
            self._partial.mkdir(parents=True)
            self._lock = os.open(self._partial, os.O_RDONLY)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._file_name = f"{self.path.name}_0{STORAGES[storage]}"
        self._storage: _Storage | None = None
        try:
            with self._own_errors():
                create = McapWriter if storage == "mcap" else SqliteWriter
                self._storage = create(self._partial / self._file_name)
        except RecordingError:
            self.abort()
            raise

    @property
    def counts(self) -> dict[str, int]:
        """Return the number of messages written to each topic."""
        return dict(self._counts)

    def add_topic(self, topic: str, kind: str) -> None:
        """Introduce a topic that shall be in the bag even if nothing is written to it.

        Args:
            topic: name; a leading slash is added if it lacks one.
            kind: message type such as ``sensor_msgs/msg/JointState``.
        """
        self._channel(topic, kind)

    def write(self, topic: str, kind: str, stamp_ns: int, data: bytes) -> None:
        """Write one message.

        Args:
            topic: name; a leading slash is added if it lacks one.
            kind: message type such as ``sensor_msgs/msg/JointState``.
            stamp_ns: time of the recording [ns], not negative.
            data: the message with its encapsulation (XCDR1).
        """
        name, channel = self._channel(topic, kind)
        if stamp_ns < 0:
            raise DataError(f"a message of {name} has the time {stamp_ns} ns; bags hold times from 1970 on only")
        self._counts[name] += 1
        if stamp_ns < self._span[0] or stamp_ns > self._span[1]:
            self._span = (min(self._span[0], stamp_ns), max(self._span[1], stamp_ns))
        with self._own_errors():
            self._open_storage().write(channel, stamp_ns, data)
            self._flush_if_due()

    def write_joint_states(
        self,
        topic: str,
        stamp_ns: Ints,
        names: Sequence[str],
        *,
        position: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        effort: ArrayLike | None = None,
    ) -> None:
        """Write n JointStates, recorded at their sample times; a field that is None stays empty in the messages.

        Args:
            topic: name; a leading slash is added if it lacks one.
            stamp_ns: sample times [ns], shape (n,).
            names: axes, k of them.
            position: [m], shape (n, k), or (n,) for one axis.
            velocity: [m/s], likewise.
            effort: [N], likewise.
        """
        name, channel = self._channel(topic, JOINT_STATE)
        stamps = np.asarray(stamp_ns, np.int64)
        given = {"position": position, "velocity": velocity, "effort": effort}
        fields = {
            key: np.asarray(values, np.float64).reshape(stamps.size, len(names))
            for key, values in given.items()
            if values is not None
        }
        if stamps.size == 0:
            return
        first, last = int(stamps.min()), int(stamps.max())
        if first < 0:
            raise DataError(f"a message of {name} has the time {first} ns; bags hold times from 1970 on only")
        storage = self._open_storage()
        messages = joint_state_rows(stamps, names, fields)
        self._counts[name] += stamps.size
        self._span = (min(self._span[0], first), max(self._span[1], last))
        with self._own_errors():
            storage.write_rows(channel, stamps, messages)
            self._flush_if_due()

    def flush(self) -> None:
        """Hand everything written so far to the operating system: it survives the end of this process."""
        with self._own_errors():
            self._open_storage().flush()
        self._flush_due = time.monotonic() + _FLUSH_PERIOD

    def close(self) -> None:
        """Complete the bag and give it its name."""
        topics = {name: (kind, self._counts[name]) for name, (_, kind) in self._topics.items()}
        metadata = dump_metadata(self._kind, self._file_name, *self._span, topics)
        try:
            with self._own_errors():
                self._open_storage().close(metadata)
                self._storage = None
                (self._partial / METADATA).write_text(metadata, encoding="utf-8")
                take_place(self._partial, self.path)
                self._unlock()
        except RecordingError:
            self.abort()
            raise

    def abort(self) -> None:
        """Stop without completing: the partial folder is removed, or kept if that was asked for."""
        storage, self._storage = self._storage, None
        if storage is not None:
            with suppress(OSError, sqlite3.Error):
                storage.abort()
        if not self._keep:
            shutil.rmtree(self._partial, ignore_errors=True)
        self._unlock()

    def discard(self) -> None:
        """Stop and remove the written files in any case."""
        self._keep = False
        self.abort()

    def __enter__(self) -> BagWriter:
        """Return the writer."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete the bag, or abort if the block failed."""
        if kind is None:
            self.close()
        else:
            self.abort()

    def _replace_leftover(self) -> None:
        """Remove what a killed process left; refuse if the process is alive."""
        lock = os.open(self._partial, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(self._partial)
        except BlockingIOError:
            raise RecordingError(f"{self.path} is being written by another process; give another name") from None
        finally:
            os.close(lock)

    def _unlock(self) -> None:
        lock, self._lock = self._lock, None
        if lock is not None:
            os.close(lock)

    def _open_storage(self) -> _Storage:
        if self._storage is None:
            raise RecordingError(f"{self.path} is closed; nothing more can be written")
        return self._storage

    def _channel(self, topic: str, kind: str) -> tuple[str, int]:
        known = self._topics.get(topic)
        if known is not None and known[1].name == kind:
            return topic, known[0]
        name = topic if topic.startswith("/") else "/" + topic
        if name not in self._topics:
            description = describe_type(kind)
            if not description.definition:
                self.warnings.append(
                    f"Warning: {name} is written without the definition of {kind}, because the package rosbags is not"
                    " installed or does not know that type; install it with: pip install rosbags"
                )
            with self._own_errors():
                self._topics[name] = (self._open_storage().add_topic(name, description), description)
            self._counts[name] = 0
        number, description = self._topics[name]
        if description.name != kind:
            raise RecordingError(f"{name} holds {description.name} in {self.path}; {kind} needs another topic")
        return name, number

    def _flush_if_due(self) -> None:
        now = time.monotonic()
        if now >= self._flush_due:
            if self._flush_due:
                self._open_storage().flush()
            self._flush_due = now + _FLUSH_PERIOD

    @contextmanager
    def _own_errors(self) -> Iterator[None]:
        """Say in one sentence what the operating system or sqlite refused."""
        try:
            yield
        except (OSError, sqlite3.Error) as error:
            if found := file_in_the_way(self.path, error):
                raise found from error
            reason = getattr(error, "strerror", None) or str(error)
            partial = f"what was recorded is in {self._partial}; " if self._keep and self._partial.exists() else ""
            raise RecordingError(
                f"{self.path} cannot be written: {reason}; {partial}check free space and permissions"
            ) from error
