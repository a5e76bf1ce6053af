"""Writes sqlite3 files as rosbag2 reads them (schema version 4)."""

from __future__ import annotations

import sqlite3
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.message_types import MessageType
from sgms_observer.bags.metadata import dump_qos
from sgms_observer.bags.rows import MessageRows

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

    def write_rows(self, channel: int, log_ns: NDArray[np.int64], messages: MessageRows) -> None:
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
