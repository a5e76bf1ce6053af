"""JointState and DiagnosticArray as bytes: against ROS's own serializer, against rosbags, and against garbage."""

from __future__ import annotations

import array
import contextlib
import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgms_observer.bags.cdr import JointStateDecoder, JointStateEncoder
from sgms_observer.bags.diagnostics_cdr import DiagnosticStatus, decode_diagnostics, encode_diagnostics
from sgms_observer.errors import DataError

JOINT_STATE = "sensor_msgs/msg/JointState"
names_of_axes = st.lists(
    st.text(st.characters(blacklist_characters="\0", blacklist_categories=("Cs",)), max_size=6), max_size=4
)
stamps = st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1)
floats = st.floats(allow_nan=False)
decode_joint_state = JointStateDecoder().decode


@st.composite
def joint_states(
    draw: st.DrawFn,
) -> tuple[int, tuple[str, ...], tuple[float, ...], tuple[float, ...], tuple[float, ...], str]:
    """Draw stamp, names, position, velocity, effort (each full, empty or of a wrong length) and frame."""
    names = tuple(draw(names_of_axes))
    size = st.sampled_from([0, len(names), len(names) + 1])
    fields = [tuple(draw(st.lists(floats, min_size=n, max_size=n))) for n in (draw(size), draw(size), draw(size))]
    return draw(stamps), names, fields[0], fields[1], fields[2], draw(st.sampled_from(["", "a", "base_link"]))


def ros_bytes(
    stamp_ns: int,
    names: tuple[str, ...],
    position: tuple[float, ...],
    velocity: tuple[float, ...],
    effort: tuple[float, ...],
    frame: str,
) -> bytes:
    """Serialize with rclpy and Fast DDS, tail and uninitialised padding included."""
    pytest.importorskip("rclpy")
    from rclpy.serialization import serialize_message
    from sensor_msgs.msg import JointState

    message = JointState()
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    message.header.frame_id = frame
    message.name = list(names)
    message.position = array.array("d", position)
    message.velocity = array.array("d", velocity)
    message.effort = array.array("d", effort)
    return bytes(serialize_message(message))


@cache
def typestore() -> Any:
    """Return rosbags' message types; making them takes 10 ms."""
    rosbags = pytest.importorskip("rosbags.typesys")
    return rosbags.get_typestore(rosbags.Stores.ROS2_JAZZY)


@settings(max_examples=1000, deadline=None)
@given(joint_states())
def test_reads_what_ros_serializes(state: tuple) -> None:
    assert decode_joint_state(ros_bytes(*state)) == state[:5]


def test_reads_the_uninitialised_tail_of_fast_dds() -> None:
    message = ros_bytes(7, ("x",), (1.5,), (), (), "")
    assert len(message) > 52, "Fast DDS no longer appends a tail; this test has lost its point"
    with pytest.raises(Exception, match="mismatch"):
        typestore().deserialize_cdr(message, JOINT_STATE)
    assert decode_joint_state(message) == (7, ("x",), (1.5,), (), ())


@settings(max_examples=300, deadline=None)
@given(state=joint_states(), noise=st.binary(min_size=64, max_size=64), tail=st.binary(max_size=16))
def test_padding_and_tail_are_never_looked_at(state: tuple, noise: bytes, tail: bytes) -> None:
    stamp, names, position, _, _, frame = state
    position = tuple(float(i) for i, _ in enumerate(names))
    message = bytearray(JointStateEncoder(names, ("position",), frame).encode(stamp, position))
    covered = np.zeros(len(message), bool)
    at = 12
    for text in (frame, None, *names):
        at += -at % 4
        if text is None:
            covered[at : at + 4] = True
            at += 4
            continue
        size = 4 + len(text.encode()) + 1
        covered[at : at + size] = True
        at += size
    at += -at % 4
    covered[at : at + 4] = True
    at += 4
    if names:
        at += (4 - at) % 8
    covered[at:] = True
    covered[:12] = True
    for i in np.flatnonzero(~covered):
        message[i] = noise[i % 64]
    decoder = JointStateDecoder()
    clean = JointStateEncoder(names, ("position",), frame).encode(stamp, position)
    assert decoder.decode(clean) == decoder.decode(bytes(message) + tail) == (stamp, names, position, (), ())
    assert len(decoder._layouts) == 1


@settings(max_examples=300, deadline=None)
@given(joint_states())
def test_agrees_with_rosbags_both_ways(state: tuple) -> None:
    store = typestore()
    kinds = store.types
    stamp, names, position, velocity, effort, frame = state
    header = kinds["std_msgs/msg/Header"](kinds["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9)), frame)
    message = kinds[JOINT_STATE](header, list(names), np.array(position), np.array(velocity), np.array(effort))
    for is_little in (True, False):
        data = bytes(store.serialize_cdr(message, JOINT_STATE, little_endian=is_little))
        assert decode_joint_state(data) == state[:5]
    values = tuple(float(i) for i, _ in enumerate(names))
    ours = JointStateEncoder(names, ("position", "effort"), frame).encode(stamp, values, values)
    theirs = kinds[JOINT_STATE](header, list(names), np.array(values), np.array([]), np.array(values))
    assert ours == bytes(store.serialize_cdr(theirs, JOINT_STATE))


def test_ros_reads_what_is_encoded() -> None:
    pytest.importorskip("rclpy")
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.serialization import deserialize_message
    from sensor_msgs.msg import JointState

    data = JointStateEncoder(("x", "yy"), ("velocity", "effort"), "f").encode(-5, (1.0, 2.0), (3.0, math.inf))
    message = deserialize_message(data, JointState)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (-1, 999_999_995)
    assert (list(message.name), list(message.position)) == (["x", "yy"], [])
    assert (list(message.velocity), list(message.effort)) == ([1.0, 2.0], [3.0, math.inf])
    statuses = (
        DiagnosticStatus(0, "x/kappa", "estimated", "", (("value", "1.5"), ("unit", "N/m"))),
        DiagnosticStatus(2, "x/Ω", "", "drive 7"),
    )
    array_message = deserialize_message(encode_diagnostics(3, statuses), DiagnosticArray)
    assert [entry.name for entry in array_message.status] == ["x/kappa", "x/Ω"]
    assert [(pair.key, pair.value) for pair in array_message.status[0].values] == [("value", "1.5"), ("unit", "N/m")]
    assert array_message.status[1].level == b"\x02"


@given(
    stamp=stamps,
    entries=st.lists(
        st.tuples(
            st.integers(0, 3), *[st.text(st.characters(blacklist_characters="\0", blacklist_categories=("Cs",)))] * 3,
            st.lists(st.tuples(st.just("key"), st.text("abc", max_size=5)), max_size=3),
        ),
        max_size=3,
    ),
)  # fmt: skip
def test_diagnostics_round_trip(stamp: int, entries: list) -> None:
    statuses = tuple(DiagnosticStatus(*entry[:4], tuple(entry[4])) for entry in entries)
    assert decode_diagnostics(encode_diagnostics(stamp, statuses)) == (stamp, statuses)


def decode_or_refuse(data: bytes) -> None:
    """Decode bytes behind each head; what is refused is one sentence."""
    for head in (b"", b"\x00\x01\x00\x00", b"\x00\x00\x00\x00"):
        for decode in (decode_joint_state, decode_diagnostics):
            try:
                decode(head + data)
            except DataError as error:
                assert str(error).count("\n") == 0


@settings(max_examples=1000, deadline=None)
@given(st.binary(max_size=120))
def test_any_bytes_give_a_joint_state_or_a_data_error(data: bytes) -> None:
    decode_or_refuse(data)


def test_ten_thousand_random_messages_give_a_joint_state_or_a_data_error() -> None:
    """What takes long in the test above is the drawing of examples, so most are drawn here."""
    random = np.random.default_rng(2)
    print("seed 2")
    for _ in range(10_000):
        decode_or_refuse(random.bytes(random.integers(0, 121)))


def test_damaged_messages_give_a_joint_state_or_a_data_error() -> None:
    whole = JointStateEncoder(("x", "y"), ("position", "velocity", "effort"), "base").encode(10**18, *[(1.0, 2.0)] * 3)
    diagnostics = encode_diagnostics(1, (DiagnosticStatus(1, "a", "b", "c", (("d", "e"),)),))
    random = np.random.default_rng(1)
    print("seed 1")
    for message, decode in ((whole, decode_joint_state), (diagnostics, decode_diagnostics)):
        for cut in range(len(message)):
            with pytest.raises(DataError):
                decode(message[:cut])
        for _ in range(10_000):
            damaged = bytearray(message)
            for place in random.integers(0, len(message), random.integers(1, 4)):
                damaged[place] = random.integers(0, 256)
            with contextlib.suppress(DataError):
                decode(bytes(damaged))


def test_layouts_are_kept_for_a_few_kinds_of_message_only() -> None:
    decoder = JointStateDecoder()
    for size in range(50):
        names = ("x" * size,)
        message = JointStateEncoder(names, ("position",)).encode(size, (float(size),))
        assert decoder.decode(message) == (size, names, (float(size),), (), ())
    assert len(decoder._layouts) <= 8


def test_a_stamp_outside_ros_time_is_refused() -> None:
    with pytest.raises(DataError, match="does not fit a ROS time"):
        JointStateEncoder(("x",), ("position",)).encode(2**63, (1.0,))
    with pytest.raises(DataError, match="one number per axis"):
        JointStateEncoder(("x",), ("position",)).encode(0, (1.0, 2.0))
