"""Reads sqlite3 files of rosbag2 in blocks, in order of time, as far as they are intact."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from urllib.parse import quote

import numpy as np

from sgms_observer.bags.blocks import MessageBlock
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
            self.warnings.append(f"{self.path} is damaged ({error}); the messages behind the damage are missing")
