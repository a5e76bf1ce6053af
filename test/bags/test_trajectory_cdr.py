"""JointTrajectory as bytes: the same as ROS reads and writes, and whatever else comes is an error in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgms_observer.bags.trajectory_cdr import FIELDS, decode_trajectory, encode_trajectory
from sgms_observer.errors import DataError

STAMP = 1_700_000_000_000_000_123


def _values(names: Sequence[str], fields: Sequence[str], count: int) -> dict[str, np.ndarray]:
    draw = np.random.default_rng(count + len(names))
    return {field: draw.normal(size=(count, len(names))) for field in fields}


@pytest.mark.parametrize("names", [["x"], ["x", "yy"], ["an axis"], ["abc", "d", "e"]])
@pytest.mark.parametrize("fields", [(), ("effort",), ("positions", "velocities"), FIELDS])
@pytest.mark.parametrize("count", [0, 1, 2, 50])
def test_ros_reads_what_is_written_and_it_comes_back(names: list[str], fields: tuple[str, ...], count: int) -> None:
    serialization = pytest.importorskip("rclpy.serialization")
    messages = pytest.importorskip("trajectory_msgs.msg")
    values, times = _values(names, fields, count), STAMP + np.arange(count) * 1_000_003
    written = encode_trajectory(STAMP, names, times, values)
    message = serialization.deserialize_message(written, messages.JointTrajectory)
    assert message.joint_names == names and len(message.points) == count
    for row, point in enumerate(message.points):
        assert point.time_from_start.sec * 10**9 + point.time_from_start.nanosec == row * 1_000_003
        for field in FIELDS:
            assert list(getattr(point, field)) == (values[field][row].tolist() if field in fields else [])
    for data in (written, serialization.serialize_message(message)):
        found = decode_trajectory(data)
        assert found.names == tuple(names) and found.stamp_ns == STAMP and found.time_ns.tolist() == times.tolist()
        assert all(np.array_equal(found.values[field], values[field]) for field in fields)


def test_points_of_different_lengths_lose_the_field_and_keep_the_others() -> None:
    serialization = pytest.importorskip("rclpy.serialization")
    messages = pytest.importorskip("trajectory_msgs.msg")
    points = [messages.JointTrajectoryPoint(positions=[float(k)], effort=[1.0] * (k % 2)) for k in range(5)]
    message = messages.JointTrajectory(joint_names=["x"], points=points)
    found = decode_trajectory(serialization.serialize_message(message))
    assert found.values["positions"][:, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert found.values["effort"].shape[1] == 0 and found.stamp_ns == 0


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_cut_or_changed_bytes_are_read_or_refused(data: st.DataObject) -> None:
    good = encode_trajectory(STAMP, ["x"], STAMP + np.arange(4) * 10**6, _values(["x"], ("effort",), 4))
    message = bytearray(good[: data.draw(st.integers(0, len(good)))])
    for _ in range(data.draw(st.integers(0, 4)) if message else 0):
        message[data.draw(st.integers(0, len(message) - 1))] = data.draw(st.integers(0, 255))
    try:
        found = decode_trajectory(bytes(message))
    except DataError as error:
        assert str(error).endswith("it was not used")
    else:
        assert all(len(values) == len(found.time_ns) for values in found.values.values())


def test_what_does_not_fit_is_a_sentence() -> None:
    with pytest.raises(DataError, match="does not fit a ROS time"):
        encode_trajectory(2**63, ["x"], np.zeros(0, np.int64), {})
    with pytest.raises(DataError, match="fields of shapes"):
        encode_trajectory(STAMP, ["x"], np.array([STAMP]), {"effort": np.zeros((2, 1))})
