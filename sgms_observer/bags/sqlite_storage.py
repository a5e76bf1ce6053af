"""sqlite3 files of rosbag2 (schema version 4): read in blocks, in order of time as far as intact, and written."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from sgms_observer.arrays import Ints
from sgms_observer.bags.bag_folder import dump_qos
from sgms_observer.bags.blocks import MessageBlock
from sgms_observer.bags.message_types import MessageType
from sgms_observer.bags.rows import MessageRows
from sgms_observer.errors import RecordingError

_ROWS = 8192
# Read-only leaves the file alone; a killed recorder's journal can only be rolled back by writing; a medium that
# cannot be written at all is read as it is.
_MODES = ("mode=ro", "mode=rw", "immutable=1")


class SqliteReader:
    """One .db3 file.

    Args:
        path: the file.

    Attributes:
        topics: name to message type of every topic in the file.
        warnings: sentences about what could not be read.

    Raises:
        RecordingError: it is no rosbag2 database, or it cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[str, str] = {}
        self.warnings: list[str] = []
        self._numbers: dict[int, str] = {}
        if path.stat().st_size == 0:
            raise RecordingError(f"{path} is empty; nothing was recorded into it")
        reason = ""
        for mode in _MODES:
            address = f"file:{quote(str(path.absolute()))}?{mode}"
            connection = sqlite3.connect(address, uri=True, check_same_thread=False)
            connection.text_factory = lambda data: data.decode("utf-8", "replace")
            try:
                rows = connection.execute("SELECT id, name, type FROM topics ORDER BY id").fetchall()
                connection.execute("SELECT topic_id, timestamp, data FROM messages LIMIT 1").fetchall()
            except (sqlite3.Error, OverflowError, ValueError) as error:  # ValueError: its message is no UTF-8
                connection.close()
                reason = str(error)
                continue
            self._connection = connection
            break
        else:
            raise RecordingError(f"{path} cannot be read as a rosbag2 database: {reason}; check what wrote it")
        for number, name, kind in rows:
            is_text = isinstance(name, str) and isinstance(kind, str) and name.isprintable() and kind.isprintable()
            if is_text and self.topics.setdefault(name, kind) == kind:
                self._numbers[number] = name

    @property
    def span_ns(self) -> tuple[int, int]:
        """Return the times of the first and the last message [ns]; (0, 0) if there is none."""
        try:
            rows = self._connection.execute("SELECT min(timestamp), max(timestamp) FROM messages").fetchall()
            return int(rows[0][0]), int(rows[0][1])
        except (sqlite3.Error, TypeError, ValueError):
            return 0, 0

    def close(self) -> None:
        """Close the file."""
        self._connection.close()

    def blocks(self, topics: Sequence[str]) -> Iterator[MessageBlock]:
        """Read messages in order of their time.

        Args:
            topics: which to read; ``MessageBlock.topics`` of every block.

        Yields:
            Blocks of at least one message.
        """
        index_of = {number: list(topics).index(name) for number, name in self._numbers.items() if name in topics}
        if not index_of:
            return
        places = ",".join("?" for _ in index_of)
        try:
            cursor = self._connection.execute(
                f"SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({places}) ORDER BY timestamp, id",
                list(index_of),
            )
            while rows := cursor.fetchmany(_ROWS):
                numbers, times, data = zip(*rows, strict=True)
                messages = [item if isinstance(item, bytes) else b"" for item in data]
                length = np.fromiter(map(len, messages), np.int64, len(messages))
                yield MessageBlock(
                    tuple(topics),
                    np.array([index_of[number] for number in numbers], np.int64),
                    np.array([time if isinstance(time, int) else 0 for time in times], np.int64),
                    np.frombuffer(b"".join(messages), np.uint8),
                    np.cumsum(length) - length,
                    length,
                )
        except (sqlite3.Error, OverflowError, ValueError) as error:  # ValueError: its message is no UTF-8
            self.warnings.append(f"{self.path} is damaged ({error}); the messages after the damage are missing")


_SCHEMA = """
CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL);
CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version INTEGER NOT NULL, metadata TEXT NOT NULL);
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, serialization_format TEXT NOT NULL,
    offered_qos_profiles TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,
    encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,
    data BLOB NOT NULL);
CREATE INDEX timestamp_idx ON messages (timestamp ASC);
INSERT INTO schema(schema_version, ros_distro) VALUES (4, 'jazzy');
"""
_ROWS_AT_ONCE = 10_000


class SqliteWriter:
    """One .db3 file; what was flushed survives the end of this process.

    Args:
        path: the file to create.

    Raises:
        OSError: it cannot be created.
        sqlite3.Error: it cannot be written; every other method may raise it too.
    """

    def __init__(self, path: Path) -> None:
        path.open("xb").close()
        self._connection = sqlite3.connect(path, check_same_thread=False)
        self._connection.execute("PRAGMA synchronous = OFF")
        self._connection.executescript(_SCHEMA)
        self._waiting: list[tuple[int, int, bytes]] = []
        self._topics = 0
        self._types: set[str] = set()

    def add_topic(self, topic: str, kind: MessageType) -> int:
        """Introduce a topic; return its number.

        Args:
            topic: full name.
            kind: type of its messages.
        """
        if kind.name not in self._types:
            self._types.add(kind.name)
            self._connection.execute(
                "INSERT INTO message_definitions VALUES (?, ?, ?, ?, ?)",
                (
                    len(self._types),
                    kind.name,
                    "ros2msg" if kind.definition else "unknown",
                    kind.definition,
                    kind.digest,
                ),
            )
        self._topics += 1
        self._connection.execute(
            "INSERT INTO topics VALUES (?, ?, ?, 'cdr', ?, ?)",
            (self._topics, topic, kind.name, dump_qos(), kind.digest),
        )
        self._connection.commit()
        return self._topics

    def write(self, channel: int, log_ns: int, data: bytes) -> None:
        """Add one message.

        Args:
            channel: number of the topic.
            log_ns: time of the recording [ns].
            data: the message's bytes.
        """
        self._waiting.append((channel, log_ns, data))
        if len(self._waiting) >= _ROWS_AT_ONCE:
            self.flush()

    def write_rows(self, channel: int, log_ns: Ints, messages: MessageRows) -> None:
        """Add n messages of one size.

        Args:
            channel: number of the topic.
            log_ns: times of the recording [ns], shape (n,).
            messages: the messages.
        """
        size = messages.size
        for first in range(0, log_ns.size, _ROWS_AT_ONCE):
            last = min(first + _ROWS_AT_ONCE, log_ns.size)
            joined = messages.part(first, last).to_bytes().tobytes()
            times = log_ns[first:last].tolist()
            self._waiting += [(channel, time, joined[i * size : (i + 1) * size]) for i, time in enumerate(times)]
            if len(self._waiting) >= _ROWS_AT_ONCE:
                self.flush()

    def flush(self) -> None:
        """Commit everything that waits."""
        waiting, self._waiting = self._waiting, []
        self._connection.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", waiting)
        self._connection.commit()

    def close(self, metadata: str) -> None:
        """Write what waits and close.

        Args:
            metadata: text of metadata.yaml, kept in the file too.
        """
        self.flush()
        self._connection.execute("INSERT INTO metadata(metadata_version, metadata) VALUES (9, ?)", (metadata,))
        self._connection.commit()
        self._connection.close()

    def abort(self) -> None:
        """Close the file as it was at the last flush."""
        self._connection.rollback()
        self._connection.close()
