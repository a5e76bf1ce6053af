"""Pairing by stamp: the same samples whatever the interleaving, one by one or in blocks; bounded and recovering."""

from __future__ import annotations

import math
import re
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgms_observer.observer.block_pairing import Messages, push_block
from sgms_observer.observer.pairing import Pairing, PairingCounts
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.units import Scales

PERIOD = 1.0e-3
STEP = 1_000_000
SECOND = 1_000_000_000
NAN = math.nan

Event = tuple[int, int, float, float]  # stream, stamp, first value, second value


def drain(pairing: Pairing) -> list[Samples]:
    """Pop everything that is ready."""
    blocks = []
    while (samples := pairing.pop()) is not None:
        blocks.append(samples)
    return blocks


def rows(blocks: list[Samples]) -> list[tuple]:
    """Return the samples as tuples that compare NaN as equal."""
    table = []
    for block in blocks:
        assert np.all(np.diff(block.stamp_ns) > 0)
        columns = (block.stamp_ns, block.position, block.effort, block.reference_position, block.reference_velocity)
        table += [tuple(None if value != value else value for value in row) for row in zip(*columns, strict=True)]
    return table


def push(pairing: Pairing, events: list[Event]) -> None:
    """Push one by one."""
    for stream, stamp, first, second in events:
        if stream == 0:
            pairing.push_position(stamp, first)
        elif stream == 1:
            pairing.push_effort(stamp, first)
        else:
            pairing.push_reference(stamp, first, second)


def messages(events: list[Event], stream: int) -> Messages:
    """Return one stream of a list of events as a block."""
    mine = [
        (stamp, order, first, second) for order, (kind, stamp, first, second) in enumerate(events) if kind == stream
    ]
    columns = list(zip(*mine, strict=True)) or [(), (), (), ()]
    return Messages(
        np.array(columns[0], np.int64),
        np.array(columns[1], np.int64),
        np.array(columns[2], float),
        np.array(columns[3], float),
    )


@st.composite
def stream_events(draw: st.DrawFn, stream: int, most: int = 40) -> list[Event]:
    """Draw one topic's messages: mostly regular; some missing, late, repeated, not finite, jittering or leaping."""
    events = []
    for index in draw(st.lists(st.integers(0, most), max_size=most, unique=True).map(sorted)):
        stamp = index * STEP + draw(st.sampled_from([0, 0, 0, 1000, -1000, STEP // 4, -STEP // 4, STEP // 2]))
        value = draw(st.sampled_from([float(index)] * 8 + [NAN, math.inf]))
        events.append((stream, stamp, value, float(-index)))
        if draw(st.integers(0, 9)) == 0:
            events.append((stream, stamp - draw(st.sampled_from([0, STEP, 3 * STEP])), 1.0, 2.0))
    return events


@st.composite
def interleaved(draw: st.DrawFn, streams: list[list[Event]]) -> list[Event]:
    """Draw an order of arrival that keeps each topic's own order."""
    left = [list(stream) for stream in streams if stream]
    order = []
    while left:
        chosen = left[draw(st.integers(0, len(left) - 1))]
        order.append(chosen.pop(0))
        left = [stream for stream in left if stream]
    return order


@st.composite
def two_orders(draw: st.DrawFn) -> tuple[list[Event], list[Event]]:
    """Draw the same messages in two orders of arrival; the reference, if any, is known from the start."""
    streams = [draw(stream_events(0)), draw(stream_events(1)), draw(st.one_of(st.just([]), stream_events(2)))]
    return draw(interleaved(streams)), draw(interleaved(streams))


def fresh(events: list[Event]) -> Pairing:
    """Return a pairing that awaits the reference if one is in the events, and holds more than the events."""
    pairing = Pairing(PERIOD)
    pairing.reference.is_awaited = any(stream == 2 for stream, *_ in events)
    pairing.limit = pairing.reference_limit = 1000
    return pairing


@settings(max_examples=200, deadline=None)
@given(two_orders())
def test_the_order_of_arrival_does_not_matter(orders: tuple[list[Event], list[Event]]) -> None:
    results = []
    for order in orders:
        pairing = fresh(order)
        push(pairing, order)
        found = drain(pairing)
        pairing.flush()
        results.append((rows(found + drain(pairing)), asdict(pairing.counts)))
    assert results[0] == results[1]


@settings(max_examples=500, deadline=None)
@given(data=st.data(), limit=st.sampled_from([3, 8, 1000]), knows_reference=st.booleans())
def test_blocks_give_what_single_messages_give(data: st.DataObject, limit: int, knows_reference: bool) -> None:
    streams = [data.draw(stream_events(stream)) for stream in range(3)]
    if data.draw(st.booleans()):
        streams[2] = []
    events = data.draw(interleaved(streams))
    if data.draw(st.integers(0, 4)) == 0:  # a clock that is reset in the middle
        events = [(stream, stamp + 10_000 * STEP, first, second) for stream, stamp, first, second in events] + events
    cuts = sorted(data.draw(st.lists(st.integers(0, len(events)), max_size=4)))
    single, blocks = Pairing(PERIOD), Pairing(PERIOD)
    for pairing in (single, blocks):
        pairing.limit, pairing.reference_limit = limit, max(2, limit // 2)
        pairing.reference.is_awaited = knows_reference
    found_single, found_blocks = [], []
    for first, last in zip([0, *cuts], [*cuts, len(events)], strict=True):
        part = events[first:last]
        push(single, part)
        push_block(blocks, *[messages(part, stream) for stream in range(3)])
        found_single += drain(single)
        found_blocks += drain(blocks)
        assert rows(found_single) == rows(found_blocks)
        assert single.counts == blocks.counts
    for one, other in ((single.position, blocks.position), (single.effort, blocks.effort)):
        waiting = [[item[:2] for item in stream.queue] for stream in (one, other)]
        assert (one.last_ns, waiting[0], one.is_awaited) == (other.last_ns, waiting[1], other.is_awaited)


def test_a_reference_that_meets_no_effort_is_counted_alike_in_blocks() -> None:
    events = [(2, 0, 0.0, 0.0), (0, 1 * STEP, 1.0, NAN), (0, 40 * STEP, 40.0, NAN)]
    single, block = Pairing(PERIOD), Pairing(PERIOD)
    for part in (events[:1], events[1:]):
        push(single, part)
        push_block(block, *[messages(part, stream) for stream in range(3)])
    assert single.counts == block.counts
    assert single.counts.unmatched_references == 1


def test_one_effort_serves_one_position_in_blocks_too() -> None:
    events = [
        (0, STEP // 2, 1.0, NAN),
        (0, STEP * 3 // 4, 2.0, NAN),
        (1, STEP * 3 // 4, 3.0, NAN),
        (1, 9 * STEP, 4.0, NAN),
    ]
    single, block = Pairing(PERIOD), Pairing(PERIOD)
    push(single, events)
    push_block(block, *[messages(events, stream) for stream in range(3)])
    assert (
        rows(drain(single))
        == rows(drain(block))
        == [(STEP // 2, 1.0, 3.0, None, None), (STEP * 3 // 4, 2.0, None, None, None)]
    )


def test_whole_blocks_take_the_fast_way() -> None:
    """Regular recordings must not fall back to pushing one by one, or replay is slow."""
    pairing = Pairing(PERIOD)
    pairing.push_position = None  # type: ignore[method-assign,assignment]
    stamps = np.arange(100_000, dtype=np.int64) * STEP
    order = np.arange(stamps.size, dtype=np.int64)
    values = np.sin(stamps * 1e-9)
    block = Messages(stamps, 2 * order, values, values)
    efforts = Messages(stamps + 10, 2 * order + 1, values, values)
    push_block(pairing, block, efforts, Messages.none())
    (samples,) = drain(pairing)
    assert samples.stamp_ns.size == stamps.size
    np.testing.assert_array_equal(samples.effort, values)
    assert np.isnan(samples.reference_position).all()


def test_efforts_are_paired_by_stamp_not_by_number() -> None:
    pairing = Pairing(PERIOD)
    push(pairing, [(0, i * STEP, float(i), NAN) for i in range(6)])
    push(pairing, [(1, i * STEP + STEP // 5, 10.0 + i, NAN) for i in (0, 1, 3, 5)])
    assert rows(drain(pairing)) == [
        (0, 0.0, 10.0, None, None),
        (STEP, 1.0, 11.0, None, None),
        (2 * STEP, 2.0, None, None, None),
        (3 * STEP, 3.0, 13.0, None, None),
        (4 * STEP, 4.0, None, None, None),
        (5 * STEP, 5.0, 15.0, None, None),
    ]
    assert pairing.counts.missing_efforts == 2


def test_an_effort_that_falls_silent_stalls_nothing_and_comes_back() -> None:
    pairing = Pairing(PERIOD)
    for i in range(3000):
        pairing.push_position(i * STEP, float(i))
        if not 1000 <= i < 2000:
            pairing.push_effort(i * STEP, 1.0)
        assert len(pairing.position.queue) <= pairing.limit
    samples = rows(drain(pairing))
    assert [row[0] for row in samples] == [i * STEP for i in range(3000)]
    missing = [row[0] // STEP for row in samples if row[2] is None]
    assert missing[:1000] == list(range(1000, 2000))
    assert len(missing) - 1000 <= 1, "the effort is back, so samples must have it"


def test_no_queue_grows_when_the_position_falls_silent() -> None:
    pairing = Pairing(PERIOD)
    for i in range(10_000):
        pairing.push_effort(i * STEP, 1.0)
        pairing.push_reference(i * STEP, 1.0, 1.0)
    assert len(pairing.effort.queue) <= pairing.limit
    assert len(pairing.reference.queue) <= pairing.limit
    assert pairing.counts.unmatched_efforts == 10_000 - len(pairing.effort.queue)
    for i in range(10_000, 10_100):
        push(pairing, [(0, i * STEP, 1.0, NAN), (1, i * STEP, 2.0, NAN), (2, i * STEP, 3.0, 4.0)])
    assert rows(drain(pairing))[-1] == (10_099 * STEP, 1.0, 2.0, 3.0, 4.0)


def test_a_reference_that_stops_is_waited_for_briefly() -> None:
    pairing = Pairing(1.0e-4)
    for i in range(2000):
        pairing.push_reference(i, 1.0, 0.0) if i == 0 else None
        pairing.push_position(i * 100_000, 1.0)
        pairing.push_effort(i * 100_000, 1.0)
    assert pairing.counts.samples == 2000
    assert pairing.reference.is_awaited is False


def test_a_reset_clock_starts_a_new_block_and_pairs_again() -> None:
    pairing = Pairing(PERIOD)
    start = 10**18
    for base in (start, 0, start):
        for i in range(100):
            push(pairing, [(0, base + i * STEP, 1.0, NAN), (1, base + i * STEP, 2.0, NAN)])
    blocks = drain(pairing)
    assert [int(block.stamp_ns[0]) for block in blocks] == [start, 0] or len(blocks) == 3
    samples = rows(blocks)
    assert len(samples) == 300
    assert sum(row[2] is None for row in samples) <= 1
    assert pairing.counts.clock_resets == 1


def test_one_wild_stamp_costs_a_few_samples_only() -> None:
    for stream in (0, 1):
        pairing = Pairing(PERIOD)
        for i in range(1000):
            if i == 500:
                push(pairing, [(stream, 10**18, 1.0, NAN)])
            push(pairing, [(0, i * STEP, 1.0, NAN), (1, i * STEP, 2.0, NAN)])
        samples = rows(drain(pairing))
        good = [row for row in samples if row[0] < 10**18 and row[2] is not None]
        assert len(good) >= 995, f"stream {stream}: {len(good)}"


@settings(max_examples=300, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2),
            st.one_of(st.integers(0, 50).map(lambda i: i * STEP), st.integers(-(2**61), 2**61)),
            st.floats(),
            st.floats(),
        ),
        max_size=200,
    )
)
def test_anything_may_arrive(events: list[Event]) -> None:
    pairing = Pairing(PERIOD)
    push(pairing, events)
    pairing.flush()
    blocks = drain(pairing)
    assert sum(block.stamp_ns.size for block in blocks) == pairing.counts.samples
    for block in blocks:
        assert np.all(np.diff(block.stamp_ns) > 0)
        assert np.isfinite(block.position).all()
        assert not np.isinf(block.effort).any()
    assert all(sentence[0].isdigit() for sentence in pairing.counts.sentences())


def test_blocks_that_were_handed_out_never_change() -> None:
    pairing = Pairing(PERIOD)
    kept = []
    for i in range(20_000):
        push(pairing, [(0, i * STEP, float(i), NAN), (1, i * STEP, float(i), NAN)])
        kept += drain(pairing)
    table = rows(kept)
    assert [row[1] for row in table] == [float(i) for i in range(20_000)]


def counted(pairing: Pairing) -> dict[str, int]:
    """Return the counts that are not zero."""
    return {name: count for name, count in asdict(pairing.counts).items() if count}


def test_nothing_is_counted_before_the_first_message_nor_of_regular_ones() -> None:
    pairing = Pairing(PERIOD)
    assert set(asdict(pairing.counts).values()) == {0} and pairing.counts.sentences() == ()
    assert pairing.pop() is None and not pairing.has_samples
    start = -5 * SECOND  # a clock before 1970 is a clock too
    push(pairing, [(stream, start + i * STEP, 1.0, 2.0) for i in range(5) for stream in (1, 2, 0)])
    assert pairing.has_samples and counted(pairing) == {"samples": 5}
    assert rows(drain(pairing)) == [(start + i * STEP, 1.0, 1.0, 1.0, 2.0) for i in range(5)]
    assert not pairing.has_samples


@pytest.mark.parametrize("name", [name for name in asdict(PairingCounts()) if name != "samples"])
def test_each_trouble_is_told_in_one_sentence_with_its_count(name: str) -> None:
    (sentence,) = PairingCounts(samples=9, **{name: 3}).sentences()
    assert sentence.startswith("3 ") and len(sentence.split()) > 5


@pytest.mark.parametrize("stream", [1, 2])
@pytest.mark.parametrize(
    ("shift", "is_paired"), [(250_000, True), (250_001, False), (-250_000, True), (-250_001, False)]
)
def test_stamps_are_equal_within_a_quarter_of_a_period(stream: int, shift: int, is_paired: bool) -> None:
    pairing = Pairing(PERIOD)
    other = 3 - stream
    for i in range(4):
        push(pairing, [(other, i * STEP, 7.0, 8.0), (stream, i * STEP + shift, 1.0, 2.0), (0, i * STEP, 5.0, NAN)])
    pairing.flush()
    samples = rows(drain(pairing))[1:]
    assert len(samples) == 3
    column = {1: 2, 2: 3}[stream]
    assert [row[column] for row in samples] == [1.0 if is_paired else None] * 3
    unmatched = {1: pairing.counts.unmatched_efforts, 2: pairing.counts.unmatched_references}[stream]
    assert unmatched == (0 if is_paired else 3 + (shift < 0)), "one that is too late for its own waits for the next"


@pytest.mark.parametrize(("period", "limit"), [(1.0e-3, 500), (1.0e-2, 50), (0.1, 16), (1.0e-5, 4096)])
def test_positions_wait_half_a_second_for_a_silent_effort(period: float, limit: int) -> None:
    pairing, step = Pairing(period), round(period * SECOND)
    for i in range(limit):
        pairing.push_position(i * step, 1.0)
    assert not pairing.has_samples
    pairing.push_position(limit * step, 1.0)
    assert counted(pairing) == {"samples": limit + 1, "missing_efforts": limit + 1}
    pairing.push_position((limit + 1) * step, 1.0)
    assert pairing.counts.samples == limit + 2, "a silent effort is not waited for again"
    pairing.push_effort((limit + 1) * step, 1.0)
    pairing.push_position((limit + 2) * step, 1.0)
    assert pairing.counts.samples == limit + 2, "one that speaks is"


@pytest.mark.parametrize(("period", "limit"), [(1.0e-3, 20), (1.0e-2, 8), (1.0e-4, 163)])
def test_a_silent_reference_is_waited_for_a_fiftieth_of_a_second(period: float, limit: int) -> None:
    pairing, step = Pairing(period), round(period * SECOND)
    push(pairing, [(2, 0, 1.0, 0.0), (1, 0, 1.0, NAN), (0, 0, 1.0, NAN)])
    for i in range(1, limit + 1):
        push(pairing, [(1, i * step, 1.0, NAN), (0, i * step, 1.0, NAN)])
    assert counted(pairing) == {"samples": 1}
    push(pairing, [(1, (limit + 1) * step, 1.0, NAN), (0, (limit + 1) * step, 1.0, NAN)])
    assert counted(pairing) == {"samples": limit + 2}


def test_a_reference_waits_with_the_effort_where_both_are_silent() -> None:
    pairing = Pairing(PERIOD)
    pairing.push_reference(0, 1.0, 0.0)
    for i in range(500):
        pairing.push_position(i * STEP, 1.0)
    assert not pairing.has_samples
    pairing.push_position(500 * STEP, 1.0)
    assert counted(pairing) == {"samples": 1, "missing_efforts": 1}, "the first has its set-point"
    pairing.push_position(501 * STEP, 1.0)
    assert counted(pairing) == {"samples": 502, "missing_efforts": 502}


def test_a_reference_is_not_given_up_while_the_effort_is_waited_for() -> None:
    pairing = Pairing(PERIOD)
    for stream in (2, 1, 0):
        push(pairing, [(stream, 0, 1.0, 0.0)])
    for stream in (0, 1, 2):
        push(pairing, [(stream, i * STEP, 1.0, 0.0) for i in range(1, 100)])
    assert rows(drain(pairing)) == [(i * STEP, 1.0, 1.0, 1.0, 0.0) for i in range(100)]


def test_efforts_and_set_points_may_be_ahead() -> None:
    pairing = Pairing(PERIOD)
    for stream in (2, 1, 0):
        push(pairing, [(stream, i * STEP, float(i), 0.0) for i in range(5)])
    assert rows(drain(pairing)) == [(i * STEP, float(i), float(i), float(i), 0.0) for i in range(5)]


def test_a_reference_alone_is_waited_for_briefly_where_no_effort_comes() -> None:
    pairing = Pairing(PERIOD)
    for i in range(501):
        pairing.push_position(i * STEP, 1.0)
    assert pairing.counts.samples == 501  # the effort counts as absent now
    push(pairing, [(2, 501 * STEP, 1.0, 0.0), (0, 501 * STEP, 1.0, NAN)])
    for i in range(502, 522):
        pairing.push_position(i * STEP, 1.0)
    assert pairing.counts.samples == 502
    pairing.push_position(522 * STEP, 1.0)
    assert pairing.counts.samples == 523


@pytest.mark.parametrize(
    ("back", "counts"), [(0, "duplicates"), (1, "late"), (SECOND, "late"), (SECOND + 1, "clock_resets")]
)
def test_a_position_from_more_than_a_second_before_is_a_restarted_clock(back: int, counts: str) -> None:
    pairing = Pairing(PERIOD)
    for stream in (0, 1):
        push(pairing, [(stream, 20 * SECOND, 1.0, NAN)])
    push(pairing, [(0, 20 * SECOND - back, 2.0, NAN)])
    assert {name for name in counted(pairing) if name != "samples"} == {counts}
    pairing.flush()
    assert [row[1] for row in rows(drain(pairing)[:1])] == [1.0]
    assert pairing.counts.samples == 1 + (counts == "clock_resets")


@pytest.mark.parametrize("stream", [1, 2])
@pytest.mark.parametrize(
    ("back", "counts"), [(0, "duplicates"), (1, "late"), (SECOND, "late"), (SECOND + 1, "stream_resets")]
)
def test_so_is_an_effort_or_a_reference(stream: int, back: int, counts: str) -> None:
    pairing = Pairing(PERIOD)
    waiting = (pairing.effort, pairing.reference)[stream - 1].queue
    unmatched = ("unmatched_efforts", "unmatched_references")[stream - 1]
    push(pairing, [(stream, 20 * SECOND - STEP, 1.0, 0.0), (stream, 20 * SECOND, 1.0, 0.0)])
    push(pairing, [(stream, 20 * SECOND - back, 2.0, 0.0)])
    if counts == "stream_resets":
        assert counted(pairing) == {"stream_resets": 1, unmatched: 2} and len(waiting) == 1
    else:
        assert counted(pairing) == {counts: 1} and len(waiting) == 2


@pytest.mark.parametrize("stream", [1, 2])
def test_what_finds_no_position_is_kept_for_half_a_second(stream: int) -> None:
    pairing = Pairing(PERIOD)
    push(pairing, [(stream, i * STEP, 1.0, 0.0) for i in range(500)])
    assert counted(pairing) == {}
    push(pairing, [(stream, 500 * STEP, 1.0, 0.0)])
    assert counted(pairing) == {("unmatched_efforts", "unmatched_references")[stream - 1]: 1}


def test_a_restarted_clock_keeps_what_belongs_to_it_and_counts_the_rest() -> None:
    pairing = Pairing(PERIOD)
    old, new = 100 * SECOND, 5 * SECOND
    push(pairing, [(stream, old + i * STEP, 1.0, 2.0) for i in (0, 1) for stream in (1, 2, 0)])
    push(pairing, [(2, old + 9 * STEP, 1.0, 2.0)])  # a set-point of the time before
    push(pairing, [(1, new, 3.0, NAN), (1, new + STEP, 4.0, NAN), (1, new + SECOND, 5.0, NAN)])
    push(pairing, [(0, new, 6.0, NAN), (0, new + STEP, 7.0, NAN)])
    push(pairing, [(2, new + STEP, 8.0, 9.0)])
    blocks = drain(pairing)
    assert [int(block.stamp_ns[0]) for block in blocks] == [old, new]
    assert rows(blocks)[2:] == [(new, 6.0, 3.0, None, None), (new + STEP, 7.0, 4.0, 8.0, 9.0)]
    assert counted(pairing) == {"samples": 4, "unmatched_references": 1, "clock_resets": 1, "stream_resets": 1}
    assert list(pairing.effort.queue) == [(new + SECOND, 5.0, pairing.effort.queue[0][2])]


def test_an_effort_of_the_time_before_does_not_hold_up_a_restarted_clock() -> None:
    pairing = Pairing(PERIOD)
    push(pairing, [(1, 100 * SECOND, 1.0, NAN), (1, 100 * SECOND + STEP, 1.0, NAN), (0, 100 * SECOND, 1.0, NAN)])
    push(pairing, [(0, 5 * SECOND, 2.0, NAN), (1, 5 * SECOND, 3.0, NAN)])
    assert rows(drain(pairing))[1:] == [(5 * SECOND, 2.0, 3.0, None, None)]
    assert counted(pairing) == {"samples": 2, "unmatched_efforts": 1, "clock_resets": 1}


@pytest.mark.parametrize(("back", "is_late"), [(SECOND * 4 // 5, True), (SECOND, True), (SECOND + 1, False)])
def test_a_restarted_clock_restarts_the_effort_where_that_is_a_second_ahead(back: int, is_late: bool) -> None:
    pairing = Pairing(PERIOD)
    now = 100 * SECOND
    push(pairing, [(1, now, 1.0, NAN), (0, now, 1.0, NAN), (0, now + SECOND // 2, 1.0, NAN)])
    push(pairing, [(0, now - back, 2.0, NAN), (1, now - back, 3.0, NAN)])
    assert pairing.counts.clock_resets == 1 and pairing.counts.late == is_late
    assert len(rows(drain(pairing))) == 2 + (not is_late)


def test_a_restarted_clock_goes_on_behind_the_efforts_that_it_keeps() -> None:
    pairing = Pairing(PERIOD)
    push(pairing, [(1, 100 * SECOND, 1.0, NAN), (0, 100 * SECOND, 1.0, NAN)])
    push(pairing, [(1, 5 * SECOND + i * STEP, 1.0, NAN) for i in range(3)])
    push(pairing, [(1, 8 * SECOND, 1.0, NAN), (0, 5 * SECOND, 1.0, NAN)])
    push(pairing, [(1, 5 * SECOND + 2 * STEP, 9.0, NAN), (1, 5 * SECOND + STEP, 9.0, NAN)])
    assert (pairing.counts.duplicates, pairing.counts.late, pairing.counts.unmatched_efforts) == (1, 1, 1)
    push(pairing, [(0, 5 * SECOND + i * STEP, 1.0, NAN) for i in range(1, 4)])
    push(pairing, [(1, 5 * SECOND + 3 * STEP, 4.0, NAN)])
    assert [row[2] for row in rows(drain(pairing))] == [1.0, 1.0, 1.0, 1.0, 4.0]


def test_a_restarted_clock_hands_on_what_waits() -> None:
    pairing = Pairing(PERIOD)
    push(pairing, [(0, 100 * SECOND, 1.0, NAN), (0, 5 * SECOND, 2.0, NAN)])
    assert rows(drain(pairing)) == [(100 * SECOND, 1.0, None, None, None)]
    push(pairing, [(1, 5 * SECOND, 3.0, NAN)])
    assert rows(drain(pairing)) == [(5 * SECOND, 2.0, 3.0, None, None)]


def test_what_is_no_number_is_counted_and_left_out() -> None:
    pairing = Pairing(PERIOD)
    push(pairing, [(0, 0, NAN, NAN), (0, 0, math.inf, NAN), (1, 0, NAN, NAN), (2, 0, NAN, 1.0), (2, 0, 1.0, math.inf)])
    assert counted(pairing) == {"invalid": 5}
    push(pairing, [(2, 0, 1.0, NAN), (1, 0, 2.0, NAN), (0, 0, 3.0, NAN)])
    assert rows(drain(pairing)) == [(0, 3.0, 2.0, 1.0, None)], "the velocity of a set-point may be unknown"


def test_samples_come_in_si() -> None:
    pairing = Pairing(PERIOD, scales=Scales(position=-0.5, effort=4.0))
    push(pairing, [(2, 0, 2.0, 6.0), (1, 0, 3.0, NAN), (0, 0, 8.0, NAN)])
    assert rows(drain(pairing)) == [(0, -4.0, 12.0, -1.0, -3.0)]


def test_the_end_hands_on_what_waits_and_a_cut_begins_a_new_block() -> None:
    pairing = Pairing(PERIOD)
    push(pairing, [(1, 0, 1.0, NAN), (0, 0, 1.0, NAN)])
    pairing.cut()
    pairing.cut()
    assert pairing.has_samples
    push(pairing, [(0, STEP, 2.0, NAN)])
    assert pairing.counts.samples == 1
    pairing.flush()
    assert [block.stamp_ns.tolist() for block in drain(pairing)] == [[0], [STEP]]
    push(pairing, [(0, 2 * STEP, 3.0, NAN)])
    assert not pairing.has_samples, "after the end of a recording the next one waits for its efforts again"
    push(pairing, [(2, 3 * STEP, 0.0, 0.0), (1, 3 * STEP, 0.0, NAN)])
    assert [block.stamp_ns.tolist() for block in drain(pairing)] == [[2 * STEP]]


def test_a_prepared_sample_is_what_pop_gives_without_end() -> None:
    """Over more rows than one array holds, and each handed-out sample stays as it was."""
    pairings = [Pairing(PERIOD, Scales(2.0, -3.0)) for _ in range(2)]
    prepared, plain = [], []
    for k in range(9000):
        pairings[0].prepare()
        for pairing in pairings:
            pairing.push_position(k * STEP, k + 0.25)
            assert pairing.alone_ns is None
            pairing.push_effort(k * STEP, k + 0.5)
        if k % 4096 == 4095:  # the last row of an array goes out as a block
            assert pairings[0].alone_ns is None
            prepared += drain(pairings[0])
        else:
            assert pairings[0].alone_ns == k * STEP
            prepared.append(pairings[0].pop_alone())
        plain += drain(pairings[1])
        assert not pairings[0].has_samples
        assert pairings[0].pop() is None
    assert rows(prepared) == rows(plain)
    assert pairings[0].counts == pairings[1].counts


def test_a_sample_is_not_alone_beside_others_nor_unless_prepared_for() -> None:
    pairing = Pairing(PERIOD)

    def sample(k: int) -> None:
        pairing.push_position(k * STEP, 1.0)
        pairing.push_effort(k * STEP, 2.0)

    pairing.prepare()
    sample(0)
    sample(1)
    assert pairing.alone_ns is None  # two are complete
    drain(pairing)
    sample(2)
    assert pairing.alone_ns is None  # nobody prepared for it
    assert [block.stamp_ns.tolist() for block in drain(pairing)] == [[2 * STEP]]
    sample(3)
    pairing.cut()
    pairing.prepare()
    sample(4)
    assert pairing.alone_ns is None  # another block comes first
    assert pairing.pop() is not None
    assert pairing.alone_ns == 4 * STEP
    assert rows([pairing.pop_alone()]) == [(4 * STEP, 1.0, 2.0, None, None)]


def test_the_first_sample_needs_no_preparation_and_the_second_is_another_one() -> None:
    pairing = Pairing(PERIOD)
    for k in range(2):
        pairing.push_position(k * STEP, 1.0 + k)
        pairing.push_effort(k * STEP, 2.0)
        assert pairing.alone_ns == k * STEP
        assert rows(drain(pairing)) == [(k * STEP, 1.0 + k, 2.0, None, None)]
        pairing.prepare()


@pytest.mark.parametrize("name", [name for name in asdict(PairingCounts()) if name != "samples"])
def test_a_count_of_one_has_words_for_one(name: str) -> None:
    """It read "1 references had no position of the same time; they were not used"."""
    (sentence,) = PairingCounts(**{name: 1}).sentences()
    assert re.match("1 (position|control_effort|reference|message|time) ", sentence)
    assert not re.search(r"\b(they|were|them)\b", sentence)
