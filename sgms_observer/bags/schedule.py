"""When each message of a recording is due, read ahead so that playing never waits for the disk."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator, Sequence
from types import TracebackType

from sgms_observer.bags.source import BagReader

Due = tuple[list[float], list[int], list[bytes]]

_BLOCKS_AHEAD = 4


class Schedule:
    """Reads a recording in a thread of its own, as a context manager and iterator.

    Yields blocks of due times since the first message [s], numbers of topics, and messages.

    Args:
        bag: the recording, open.
        topics: names to read; a topic's number is its place here.
        rate: how much faster than recorded [-].
    """

    def __init__(self, bag: BagReader, topics: Sequence[str], rate: float) -> None:
        self._bag = bag
        self._topics = tuple(topics)
        self._rate = rate
        self._queue: queue.Queue[Due | BaseException | None] = queue.Queue(_BLOCKS_AHEAD)
        self._is_stopped = threading.Event()
        self._thread = threading.Thread(target=self._read, name="reading ahead", daemon=True)

    def __enter__(self) -> Schedule:
        """Start to read."""
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop reading."""
        self._is_stopped.set()
        while self._thread.is_alive():
            try:
                self._queue.get(timeout=0.05)
            except queue.Empty:
                continue

    def __iter__(self) -> Iterator[Due]:
        """Yield blocks in order of time."""
        while (item := self._queue.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item

    def _read(self) -> None:
        try:
            start: int | None = None
            for block in self._bag.blocks(self._topics):
                if start is None:
                    start = int(block.log_ns[0])
                due = (block.log_ns - start) * (1e-9 / self._rate)
                content = block.data.tobytes()
                places = zip(block.start.tolist(), block.length.tolist(), strict=True)
                messages = [content[first : first + length] for first, length in places]
                self._queue.put((due.tolist(), block.topic.tolist(), messages))
                if self._is_stopped.is_set():
                    return
            self._queue.put(None)
        except BaseException as error:
            self._queue.put(error)
