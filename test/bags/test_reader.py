"""Reading bags: what rosbags wrote, in every storage and compression; what is broken, as far as it goes."""

from __future__ import annotations

import random
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from bag_samples import JOINT_STATE, START, STEP, positions, read_with_rosbags, recorded_messages, write_with_rosbags
from fresh_file import write_fresh

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.mcap_records import MAGIC, Op, record, text, text_map
from sgms_observer.bags.reader import BagSamples, read_joint_states, read_samples
from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import RecordingError

COUNT = 500


def read(path: Path) -> list[tuple[str, int, bytes]]:
    """Read all messages of a bag."""
    with BagReader(path) as bag:
        return list(bag.messages())


def check_samples(path: Path, count: int = COUNT) -> None:
    """Check that a bag gives the samples of ``recorded_messages``."""
    blocks = list(read_samples(path, "x"))
    np.testing.assert_array_equal(np.concatenate([block.stamp_ns for block in blocks]), START + np.arange(count) * STEP)
    np.testing.assert_array_equal(np.concatenate([block.position for block in blocks]), positions(count))
    np.testing.assert_array_equal(np.concatenate([block.effort for block in blocks]), np.arange(float(count)))


@pytest.mark.parametrize(
    ("storage", "compression"),
    [("mcap", "none"), ("mcap", "storage"), ("mcap", "message"), ("mcap", "file"),
     ("sqlite3", "none"), ("sqlite3", "message"), ("sqlite3", "file")],
)  # fmt: skip
def test_reads_what_rosbags_wrote(tmp_path: Path, storage: str, compression: str) -> None:
    messages = recorded_messages(COUNT)
    path = write_with_rosbags(tmp_path / "bag", messages, storage, compression)
    assert read(path) == messages == read_with_rosbags(path)
    check_samples(path)
    with BagReader(path) as bag:
        assert bag.warnings == ()
        assert bag.span_ns == (messages[0][1], messages[-1][1])
        assert list(bag.messages(("/position",))) == messages[::2]


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_messages_come_in_order_of_time_as_in_rosbags(tmp_path: Path, storage: str) -> None:
    """Topic after topic in the file, in several chunks, as converters write it."""
    messages = recorded_messages(20_000)
    path = write_with_rosbags(tmp_path / "bag", messages[::2] + messages[1::2], storage)
    assert read(path) == messages == read_with_rosbags(path)
    check_samples(path, 20_000)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_packed_files_are_found_without_metadata(tmp_path: Path, storage: str) -> None:
    path = write_with_rosbags(tmp_path / "bag", recorded_messages(COUNT), storage, "file")
    (path / "metadata.yaml").unlink()
    check_samples(path)
    (packed,) = path.iterdir()
    packed.write_bytes(packed.read_bytes()[:-100])
    attempt(path)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_metadata_is_not_needed(tmp_path: Path, storage: str) -> None:
    path = write_with_rosbags(tmp_path / "bag", recorded_messages(COUNT), storage)
    check_samples(next(file for file in path.iterdir() if file.name != "metadata.yaml"))
    for content in (
        "",
        "{",
        "rosbag2_bagfile_information: 3",
        "- 1",
        "\x00\x07",
        "rosbag2_bagfile_information: {relative_file_paths: 5}",
    ):
        (path / "metadata.yaml").write_text(content)
        check_samples(path)
    (path / "metadata.yaml").unlink()
    check_samples(path)
    with BagReader(path) as bag:
        assert any("metadata.yaml" in warning for warning in bag.warnings)


def test_a_bag_of_several_files_is_read_in_order(tmp_path: Path) -> None:
    messages = recorded_messages(COUNT)
    first = write_with_rosbags(tmp_path / "bag", messages[:600])
    second = write_with_rosbags(tmp_path / "second", messages[600:])
    shutil.copy(second / "second.mcap", first / "zz.mcap")
    metadata = first / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("  - bag.mcap\n", "  - bag.mcap\n  - zz.mcap\n"))
    assert read(first) == messages
    (first / "zz.mcap").unlink()
    with BagReader(first) as bag:
        assert list(bag.messages()) == messages[:600]
        assert any("zz.mcap" in warning for warning in bag.warnings)


def test_mcap_without_chunks_and_index(tmp_path: Path) -> None:
    """As other recorders write it; the messages also outnumber one window of the reader."""
    messages = recorded_messages(12_000)
    parts = [MAGIC, record(Op.HEADER, text("ros2"), text("test")),
             record(Op.SCHEMA, struct.pack("<H", 7) + text(JOINT_STATE) + text("ros2msg") + text("..."))]  # fmt: skip
    channels = {"/position": 3, "/control_effort": 900}
    for topic, channel in channels.items():
        parts.append(record(Op.CHANNEL, struct.pack("<HH", channel, 7) + text(topic) + text("cdr") + text_map({})))
    for topic, log_ns, data in messages:
        parts.append(record(Op.MESSAGE, struct.pack("<HIQQ", channels[topic], 0, log_ns, log_ns) + data))
    parts += [record(Op.DATA_END, bytes(4)), record(Op.FOOTER, bytes(20)), MAGIC]
    path = tmp_path / "plain.mcap"
    path.write_bytes(b"".join(parts))
    assert read(path) == messages
    with BagReader(path) as bag:
        assert bag.warnings == ()


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_compressed_chunks_cut_anywhere_give_what_is_left(tmp_path: Path, compression: str) -> None:
    if compression == "zstd":
        zstd = pytest.importorskip("backports.zstd")
        compress = zstd.compress
    else:
        compress = pytest.importorskip("lz4.frame").compress
    messages = recorded_messages(4000)[::2]
    content = b"".join(record(Op.MESSAGE, struct.pack("<HIQQ", 1, 0, log, log) + data) for _, log, data in messages)
    packed = compress(content)
    chunk = struct.pack("<QQQI", messages[0][1], messages[-1][1], len(content), 0) + text(compression)
    head = b"".join([
        MAGIC, record(Op.HEADER, text("ros2"), text("")),
        record(Op.SCHEMA, struct.pack("<H", 1) + text(JOINT_STATE) + text("") + text("")),
        record(Op.CHANNEL, struct.pack("<HH", 1, 1) + text("/position") + text("cdr") + text_map({})),
    ])  # fmt: skip
    whole = head + record(Op.CHUNK, chunk, struct.pack("<Q", len(packed)), packed)
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole)
    assert read(path) == messages
    counts = []
    for share in (0.99, 0.5, 0.01):
        path.write_bytes(whole[: len(head) + int(share * (len(whole) - len(head)))])
        found = read(path)
        assert found == messages[: len(found)]
        counts.append(len(found))
    assert counts[0] > 0 and counts == sorted(counts, reverse=True)


def attempt(path: Path) -> int:
    """Read samples from whatever is there; return their number, 0 after the one sentence."""
    try:
        return sum(block.stamp_ns.size for block in read_samples(path, "x", 1e-3))
    except RecordingError as error:
        assert "\n" not in str(error)
        return 0


def test_mcap_truncated_at_every_byte(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    with BagWriter(path) as writer:
        for i, (topic, log_ns, data) in enumerate(recorded_messages(6)):
            writer.write(topic, JOINT_STATE, log_ns, data)
            if i % 4 == 3:
                writer.flush()
    whole = (path / "bag_0.mcap").read_bytes()
    (path / "metadata.yaml").unlink()
    found = []
    data = range(whole.find(b"\x06"), whole.rfind(b"\x0f") + 20)  # chunks, to the end of the data; the rest in steps
    assert len(data) > 1000
    for size in [size for size in range(len(whole) + 1) if size in data or size % 7 == 0 or len(whole) - size < 50]:
        write_fresh(path / "bag_0.mcap", whole[:size])
        found.append(attempt(path))
    assert found[-1] == 6
    assert found == sorted(found), "a longer file may not give fewer samples"
    assert set(found) == set(range(7)), "every sample counts as soon as it is whole"


def test_sqlite_truncated_at_any_byte(tmp_path: Path) -> None:
    path = write_with_rosbags(tmp_path / "bag", recorded_messages(40), "sqlite3")
    file = path / "bag.db3"
    whole = file.read_bytes()
    print(f"{len(whole)} bytes")
    for size in range(len(whole)):
        write_fresh(file, whole[:size])
        attempt(file)
        if size % 64 == 0:
            attempt(path)  # most of this is the reading of metadata.yaml, which only names the file
    file.write_bytes(whole)
    assert attempt(path) == 40


@pytest.mark.parametrize(("storage", "cases"), [("mcap", 1000), ("sqlite3", 300)])
def test_damage_anywhere_gives_samples_or_one_sentence(tmp_path: Path, storage: str, cases: int) -> None:
    path = write_with_rosbags(tmp_path / "bag", recorded_messages(20), storage)
    file = next(entry for entry in path.iterdir() if entry.name != "metadata.yaml")
    whole = file.read_bytes()
    (path / "metadata.yaml").unlink()
    chance = random.Random(6)
    print("seed 6")
    for _ in range(cases):
        damaged = bytearray(whole)
        for _ in range(chance.randint(1, 4)):
            damaged[chance.randrange(len(damaged))] = chance.choice([0, 1, 0x7F, 0xFF, chance.randrange(256)])
        write_fresh(file, damaged)
        attempt(path)
    file.write_bytes(whole)
    assert attempt(path) == 20


def test_a_damaged_chunk_is_left_out_and_told(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    messages = recorded_messages(30)
    with BagWriter(path) as writer:
        for i, (topic, log_ns, data) in enumerate(messages):
            writer.write(topic, JOINT_STATE, log_ns, data)
            if i % 20 == 19:
                writer.flush()
    file = path / "bag_0.mcap"
    whole = bytearray(file.read_bytes())
    whole[whole.find(struct.pack("<d", 15 * 1e-6))] ^= 1
    file.write_bytes(whole)
    with BagReader(path) as bag:
        assert list(bag.messages()) == messages[:20] + messages[40:]
        assert sum("damaged chunk" in warning for warning in bag.warnings) == 1


def test_joint_states_carry_position_and_effort(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    stamps = START + np.arange(100, dtype=np.int64) * STEP
    table = np.arange(200.0).reshape(100, 2)
    with BagWriter(path) as writer:
        writer.write_joint_states("/robot/joint_states", stamps, ("y", "x"), position=table, effort=-table)
    found: dict[str, list] = {"x": [], "y": []}
    samples = BagSamples(path, ("x", "y"), 1e-3)
    for axis, block in samples:
        found[axis].append(block)
    assert samples.warnings == ()
    for axis, column in (("x", 1), ("y", 0)):
        np.testing.assert_array_equal(np.concatenate([block.position for block in found[axis]]), table[:, column])
        np.testing.assert_array_equal(np.concatenate([block.effort for block in found[axis]]), -table[:, column])
    states = read_joint_states(path, "joint_states")
    assert states.names == ("y", "x")
    np.testing.assert_array_equal(states.position, table)
    assert np.isnan(states.velocity).all()


def test_axes_may_come_in_messages_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    with BagWriter(path) as writer:
        for i in range(50):
            for axis, offset in (("x", 0.0), ("y", 100.0)):
                for topic, field in (("position", "position"), ("control_effort", "effort")):
                    data = JointStateEncoder((axis,), (field,)).encode(START + i * STEP, (offset + i,))
                    writer.write(topic, JOINT_STATE, START + i * STEP, data)
    for axis, offset in (("x", 0.0), ("y", 100.0)):
        blocks = list(read_samples(path, axis))
        np.testing.assert_array_equal(np.concatenate([block.effort for block in blocks]), offset + np.arange(50.0))
    states = read_joint_states(path, "position")
    assert states.names == ("x", "y")
    assert np.isnan(states.position[::2, 1]).all()


def test_topics_are_found_with_namespace_or_by_their_new_name(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    stamps = START + np.arange(10, dtype=np.int64) * STEP
    with BagWriter(path) as writer:
        for place in ("/a", "/b"):
            writer.write_joint_states(f"{place}/position", stamps, ("x",), position=np.ones(10))
        writer.write_joint_states("/a/control_effort", stamps, ("x",), effort=np.ones(10))
        writer.write_joint_states("/a/set_point", stamps, ("x",), position=np.ones(10), velocity=np.zeros(10))
    with pytest.raises(RecordingError, match="several topics called position: /a/position, /b/position"):
        list(read_samples(path, "x"))
    (block,) = read_samples(path, "x", topics={"position": "/a/position", "reference": "set_point"})
    assert block.position.size == 10


def test_what_is_missing_is_told_in_one_sentence(tmp_path: Path) -> None:
    stamps = START + np.arange(10, dtype=np.int64) * STEP
    path = tmp_path / "bag"
    with BagWriter(path) as writer:
        writer.write_joint_states("position", stamps, ("a", "b"), position=np.ones((10, 2)))
    with pytest.raises(RecordingError, match="no topic control_effort; it holds /position; record"):
        list(read_samples(path, "a"))
    with pytest.raises(RecordingError, match="holds a, b, not axis x"):
        list(read_samples(path, "x", needs_effort=False))
    assert sum(block.position.size for block in read_samples(path, "a", needs_effort=False)) == 10
    with pytest.raises(RecordingError, match="does not exist"):
        list(read_samples(tmp_path / "none", "x"))
    (tmp_path / "folder").mkdir()
    with pytest.raises(RecordingError, match="is no bag"):
        list(read_samples(tmp_path / "folder", "x"))
    (tmp_path / "folder" / "a.mcap").write_bytes(b"")
    with pytest.raises(RecordingError, match="is empty"):
        list(read_samples(tmp_path / "folder", "x"))
    with BagWriter(tmp_path / "silent") as writer:
        writer.add_topic("position", JOINT_STATE)
        writer.add_topic("control_effort", JOINT_STATE)
    with pytest.raises(RecordingError, match="no joint, not axis x"):
        list(read_samples(tmp_path / "silent", "x"))
    other = write_with_rosbags(tmp_path / "other", [("/position", START, bytes(60))], kind="sensor_msgs/msg/Imu")
    with pytest.raises(RecordingError, match="sensor_msgs/msg/Imu; sensor_msgs/msg/JointState is needed"):
        list(read_samples(other, "x"))
    (tmp_path / "log.txt").write_text("")
    with pytest.raises(RecordingError, match="give a rosbag2 folder"):
        list(read_samples(tmp_path / "log.txt", "x"))
