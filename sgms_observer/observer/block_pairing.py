"""Recorded messages paired in blocks: the same samples and counts as pushing them one by one, at array speed."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.observer.pairing import CLOCK_RESET_NS, Pairing, Stream
from sgms_observer.observer.samples import Samples

_NOT_YET = np.iinfo(np.int64).max


@dataclass(frozen=True)
class Messages:
    """n messages of one topic about one axis, in the order of their arrival.

    Attributes:
        stamp_ns: stamps [ns], shape (n,).
        order: place of each message in the recording, ascending, shape (n,).
        first: position or effort [topic units], shape (n,).
        second: velocity of the reference [topic units], shape (n,); unused otherwise.
    """

    stamp_ns: Ints
    order: Ints
    first: Floats
    second: Floats

    @classmethod
    def none(cls) -> Messages:
        """Return no messages."""
        return cls(np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0), np.empty(0))


@dataclass(frozen=True)
class _Queue:
    """Queue of a stream before any sample is completed, and the counts of rejected messages."""

    stamp_ns: Ints
    arrival: Ints
    first: Floats
    second: Floats
    late: int
    duplicates: int
    invalid: int


def in_order_of_stamps(inputs: Sequence[Messages]) -> list[Messages]:
    """Return the messages of each topic as if they had come in the order of their stamps.

    Args:
        inputs: positions, efforts and set-points of one axis.
    """
    stamps = np.concatenate([messages.stamp_ns for messages in inputs])
    place = np.empty(stamps.size, np.int64)
    place[np.argsort(stamps, kind="stable")] = np.arange(stamps.size)  # of equal stamps the position comes first
    ends = np.cumsum([messages.stamp_ns.size for messages in inputs])
    found = []
    for messages, order in zip(inputs, np.split(place, ends[:-1]), strict=True):
        rows = np.argsort(messages.stamp_ns, kind="stable")
        found.append(Messages(messages.stamp_ns[rows], order[rows], messages.first[rows], messages.second[rows]))
    return found


def push_block(pairing: Pairing, position: Messages, effort: Messages, reference: Messages) -> None:
    """Push a block of recorded messages.

    Args:
        pairing: pairing of the axis; pop the samples from it afterwards.
        position: positions [topic units].
        effort: efforts [topic units].
        reference: set-points and their velocities [topic units].
    """
    if not _push_at_once(pairing, position, effort, reference):
        _push_one_by_one(pairing, position, effort, reference)


def _push_one_by_one(pairing: Pairing, position: Messages, effort: Messages, reference: Messages) -> None:
    """Push in the order of arrival; where one message carries position and effort, the position comes first."""
    streams = (position, effort, reference)
    order = np.concatenate([stream.order for stream in streams])
    which = np.repeat([0, 1, 2], [stream.stamp_ns.size for stream in streams])
    row = np.concatenate([np.arange(stream.stamp_ns.size) for stream in streams])
    lists = [(stream.stamp_ns.tolist(), stream.first.tolist(), stream.second.tolist()) for stream in streams]
    sequence = np.lexsort((which, order))
    for kind, i in zip(which[sequence].tolist(), row[sequence].tolist(), strict=True):
        stamps, first, second = lists[kind]
        if kind == 0:
            pairing.push_position(stamps[i], first[i])
        elif kind == 1:
            pairing.push_effort(stamps[i], first[i])
        else:
            pairing.push_reference(stamps[i], first[i], second[i])
    pairing.cut()


def _push_at_once(pairing: Pairing, position: Messages, effort: Messages, reference: Messages) -> bool:
    """Pair with array operations if the result is the same as one by one; return whether it was."""
    for stream, messages in ((pairing.effort, effort), (pairing.reference, reference)):
        if not stream.is_awaited and (messages.stamp_ns.size or stream.queue):
            return False  # its first message changes which streams are awaited
    queues = [
        _accept(stream, messages, number)
        for number, (stream, messages) in enumerate(
            ((pairing.position, position), (pairing.effort, effort), (pairing.reference, reference))
        )
    ]
    p, e, r = queues
    if p is None or e is None or r is None:
        return False  # a clock was reset
    earliest = p.stamp_ns - pairing.tolerance_ns
    latest = p.stamp_ns + pairing.tolerance_ns
    ready = p.arrival.copy()
    matches = []
    for queue, stream in ((e, pairing.effort), (r, pairing.reference)):
        partner = np.searchsorted(queue.stamp_ns, earliest)
        has_spoken = partner < queue.stamp_ns.size
        at = np.where(has_spoken, partner, 0)
        if queue.stamp_ns.size:
            is_match = has_spoken & (queue.stamp_ns[at] <= latest)
            if stream.is_awaited:
                ready = np.maximum(ready, np.where(has_spoken, queue.arrival[at], _NOT_YET))
        else:
            is_match = has_spoken
            if stream.is_awaited:
                ready = np.full_like(ready, _NOT_YET)
        if np.any(np.diff(partner[is_match]) == 0):
            return False  # one message would serve two positions
        matches.append((partner, is_match))
    ready = np.maximum.accumulate(ready)
    if _waits_too_long(ready, p.arrival, pairing.reference_limit):
        return False
    for queue in (e, r):
        # A message leaves the queue when the first position after it is complete.
        user = np.searchsorted(earliest, queue.stamp_ns, side="right")
        gone = np.full(queue.stamp_ns.size, _NOT_YET)
        gone[user < ready.size] = ready[user[user < ready.size]]
        if _waits_too_long(gone, queue.arrival, pairing.limit):
            return False
    _commit(pairing, p, e, r, int(np.searchsorted(ready, _NOT_YET)), matches)
    return True


def _waits_too_long(gone: Ints, arrival: Ints, limit: int) -> bool:
    """Return whether more than ``limit`` messages would ever wait at once."""
    return bool(np.any(gone[:-limit] > arrival[limit:])) if arrival.size > limit else False


def _accept(stream: Stream, messages: Messages, number: int) -> _Queue | None:
    """Return the queue with the accepted messages added, or None if a clock was reset."""
    finite = np.isfinite(messages.first)
    if number == 2:
        finite &= ~np.isinf(messages.second)
    stamps = messages.stamp_ns[finite]
    before = np.maximum.accumulate(np.concatenate([[max(stream.last_ns, -(2**62))], stamps]))[:-1]
    if np.any(stamps < before - CLOCK_RESET_NS):
        return None
    new = stamps > before
    waiting = np.array(stream.queue, dtype="i8, f8, f8") if stream.queue else np.empty(0, "i8, f8, f8")
    return _Queue(
        np.concatenate([waiting["f0"], stamps[new]]),
        np.concatenate([np.full(waiting.size, -1, np.int64), 3 * messages.order[finite][new] + number]),
        np.concatenate([waiting["f1"], messages.first[finite][new]]),
        np.concatenate([waiting["f2"], messages.second[finite][new]]),
        int(np.count_nonzero(stamps < before)),
        int(np.count_nonzero(stamps == before)),
        int(np.count_nonzero(~finite)),
    )


def _commit(
    pairing: Pairing, p: _Queue, e: _Queue, r: _Queue, done: int, matches: list[tuple[NDArray[np.intp], Booleans]]
) -> None:
    """Complete the first ``done`` positions; the others continue to wait."""
    columns = []
    counts = pairing.counts
    for queue, stream, (partner, is_match) in ((e, pairing.effort, matches[0]), (r, pairing.reference, matches[1])):
        used = is_match[:done]
        for values in (queue.first, queue.second):
            column = np.full(done, np.nan)
            column[used] = values[partner[:done][used]]
            columns.append(column)
        left = 0
        if done:
            left = int(partner[done - 1] + is_match[done - 1])
        if done < p.stamp_ns.size:
            left = int(partner[done])
        unmatched = left - int(np.count_nonzero(used))
        if stream is pairing.effort:
            counts.missing_efforts += done - int(np.count_nonzero(used))
            counts.unmatched_efforts += unmatched
        else:
            counts.unmatched_references += unmatched
        _keep(stream, queue, left)
    _keep(pairing.position, p, done)
    counts.samples += done
    for queue in (p, e, r):
        counts.late += queue.late
        counts.duplicates += queue.duplicates
        counts.invalid += queue.invalid
    if done:
        pairing.cut()
        pairing.ready.append(Samples(p.stamp_ns[:done], p.first[:done], columns[0], columns[2], columns[3]))


def _keep(stream: Stream, queue: _Queue, first: int) -> None:
    """Set the queue of a stream to the messages from ``first`` on."""
    if queue.stamp_ns.size:
        stream.last_ns = max(stream.last_ns, int(queue.stamp_ns[-1]))
    rest = slice(first, None)
    stream.queue = deque(
        zip(queue.stamp_ns[rest].tolist(), queue.first[rest].tolist(), queue.second[rest].tolist(), strict=True)
    )
