"""A recorded bag as one stream of message blocks, whatever its storage, compression and damage."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType

import numpy as np

from sgms_observer.bags.blocks import MessageBlock
from sgms_observer.bags.compression import unpack_file, unpack_message
from sgms_observer.bags.mcap_reader import McapReader
from sgms_observer.bags.metadata import find_files
from sgms_observer.bags.sqlite_reader import SqliteReader
from sgms_observer.errors import RecordingError


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


def _unpack_messages(block: MessageBlock) -> MessageBlock:
    """Return the block with every message unpacked."""
    messages = [unpack_message(block.message(row)) for row in range(len(block))]
    length = np.fromiter(map(len, messages), np.int64, len(messages))
    data = np.frombuffer(b"".join(messages), np.uint8)
    return MessageBlock(block.topics, block.topic, block.log_ns, data, np.cumsum(length) - length, length)
