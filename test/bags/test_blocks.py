"""Decoding many messages at once gives what decoding each of them gives."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgms_observer.bags import mcap_records
from sgms_observer.bags.blocks import MessageBlock, decode_joint_states
from sgms_observer.bags.cdr import JointStateDecoder, JointStateEncoder
from sgms_observer.bags.rows import encode_joint_states
from sgms_observer.errors import DataError

decode_joint_state = JointStateDecoder().decode


def block_of(messages: list[bytes]) -> MessageBlock:
    """Return messages of one topic as a block."""
    length = np.array([len(message) for message in messages], np.int64)
    zeros = np.zeros(length.size, np.int64)
    data = np.frombuffer(b"".join(messages), np.uint8)
    return MessageBlock(("/position",), zeros, zeros, data, np.cumsum(length) - length, length)


@st.composite
def message(draw: st.DrawFn) -> bytes:
    """Draw a message of one of several layouts, whole or damaged."""
    names = draw(st.sampled_from([("x",), ("y",), ("x", "y"), ("y", "x"), ()]))
    fields = draw(st.sampled_from([("position",), ("effort",), ("position", "velocity", "effort")]))
    encoder = JointStateEncoder(names, fields, draw(st.sampled_from(["", "base"])))
    values = [draw(st.lists(st.floats(), min_size=len(names), max_size=len(names))) for _ in fields]
    data = bytearray(encoder.encode(draw(st.integers(-(2**60), 2**60)), *values))
    damage = draw(st.integers(0, 9))
    if damage == 0:
        return draw(st.binary(max_size=80))
    if damage == 1:
        data[draw(st.integers(0, len(data) - 1))] = draw(st.integers(0, 255))
    if damage == 2:
        del data[draw(st.integers(0, len(data))) :]
    return bytes(data) + draw(st.sampled_from([b"", b"\xff" * 8, b"\x01" * 16]))


def padded(values: tuple[float, ...], count: int) -> list[float | None]:
    """Return one entry per name, None for NaN or nothing."""
    return [None if index >= len(values) or math.isnan(values[index]) else values[index] for index in range(count)]


@settings(max_examples=1000, deadline=None)
@given(st.lists(message(), max_size=30))
def test_blocks_are_decoded_as_single_messages_are(messages: list[bytes]) -> None:
    expected = {}
    for row, data in enumerate(messages):
        try:
            stamp, names, *fields = decode_joint_state(data)
        except DataError:
            continue
        expected[row] = (stamp, names, *[padded(values, len(names)) for values in fields])
    groups, bad = decode_joint_states(block_of(messages), np.arange(len(messages)))
    found = {}
    for group in groups:
        assert np.all(np.diff(group.row) > 0)
        for i, row in enumerate(group.row.tolist()):
            fields = [
                padded(tuple(table[i].tolist()), len(group.names))
                for table in (group.position, group.velocity, group.effort)
            ]
            found[row] = (int(group.stamp_ns[i]), group.names, *fields)
    assert found == expected
    assert bad == len(messages) - len(expected)


@given(
    stamps=st.lists(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1), max_size=5),
    names=st.sampled_from([("x",), ("x", "yy"), ()]),
    chosen=st.sets(st.sampled_from(["position", "velocity", "effort"])),
)
def test_blocks_are_encoded_as_single_messages_are(stamps: list[int], names: tuple[str, ...], chosen: set[str]) -> None:
    fields = {
        name: np.arange(len(stamps) * len(names), dtype=float).reshape(len(stamps), len(names))
        for name in ("position", "velocity", "effort")
        if name in chosen
    }
    rows = encode_joint_states(np.array(stamps, np.int64), names, fields, "f")
    encoder = JointStateEncoder(names, tuple(fields), "f")
    assert [row.tobytes() for row in rows] == [
        encoder.encode(stamp, *[values[i] for values in fields.values()]) for i, stamp in enumerate(stamps)
    ]


def test_fields_of_another_shape_are_refused() -> None:
    with pytest.raises(DataError, match="shape"):
        encode_joint_states(np.zeros(3, np.int64), ("x",), {"position": np.zeros((2, 1))})
    with pytest.raises(DataError, match="ROS time"):
        encode_joint_states(np.full(1, 2**62), ("x",), {"position": np.zeros((1, 1))})


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(0, 255), st.binary(max_size=20)), max_size=20), st.binary(max_size=30))
def test_records_are_found_with_and_without_numba(records: list[tuple[int, bytes]], rest: bytes) -> None:
    data = b"".join(mcap_records.RECORD_HEAD.pack(op, len(content)) + content for op, content in records) + rest
    found = mcap_records.find_records(np.frombuffer(data, np.uint8))
    plain = mcap_records.find_in_python(data)
    for one, other in zip(found, plain, strict=True):
        np.testing.assert_array_equal(one, other)
    assert found[0].tolist()[: len(records)] == [op for op, _ in records]
