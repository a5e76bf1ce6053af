"""Writing bags: read back by the independent implementations; nothing half-written; alive after SIGKILL."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
import yaml
from bag_samples import JOINT_STATE, START, STEP, read_with_rosbags, recorded_messages

from sgms_observer.bags.bag_folder import find_files
from sgms_observer.bags.message_types import DIAGNOSTICS, describe_type
from sgms_observer.bags.reader import read_joint_states, read_samples
from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import DataError, RecordingError

STORAGES = ("mcap", "sqlite3")


def write_table(path: Path, storage: str = "mcap", count: int = 3000) -> np.ndarray:
    """Write position and effort in blocks and a third topic message by message; return the stamps."""
    stamps = START + np.arange(count, dtype=np.int64) * STEP
    with BagWriter(path, storage) as writer:
        for first in range(0, count, 1000):
            part = slice(first, first + 1000)
            writer.write_joint_states("position", stamps[part], ("x",), position=np.arange(count)[part] * 1e-6)
            writer.write_joint_states("control_effort", stamps[part], ("x",), effort=np.sin(np.arange(count)[part]))
            for topic, log_ns, data in recorded_messages(3)[::2]:
                writer.write("/other" + topic, JOINT_STATE, log_ns + first * STEP, data)
    return stamps


@pytest.mark.parametrize("storage", STORAGES)
def test_rosbags_reads_what_is_written(tmp_path: Path, storage: str) -> None:
    typesys = pytest.importorskip("rosbags.typesys")
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    stamps = write_table(tmp_path / "bag", storage)
    with rosbag2.Reader(tmp_path / "bag") as reader:
        assert (reader.message_count, reader.start_time, reader.end_time) == (6009, stamps[0], stamps[-1] + 1)
        digest = store.hash_rihs01(JOINT_STATE)
        for connection in reader.connections:
            assert (connection.msgtype, connection.digest) == (JOINT_STATE, digest)
            assert connection.msgdef.data.startswith("std_msgs/Header header")
            (qos,) = connection.ext.offered_qos_profiles
            assert (qos.depth, qos.reliability.name, qos.durability.name) == (2000, "RELIABLE", "VOLATILE")
            assert connection.msgcount == (9 if connection.topic == "/other/position" else 3000)
        effort = []
        last = 0
        for connection, log_ns, data in reader.messages():
            assert log_ns >= last
            last = log_ns
            if connection.topic == "/control_effort":
                message = store.deserialize_cdr(data, JOINT_STATE)
                assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == log_ns
                effort.append(message.effort[0])
    np.testing.assert_array_equal(effort, np.sin(np.arange(3000)))
    with BagReader(tmp_path / "bag") as bag:
        assert list(bag.messages()) == read_with_rosbags(tmp_path / "bag")
        assert bag.warnings == ()


def test_the_mcap_reference_library_reads_what_is_written(tmp_path: Path) -> None:
    mcap = pytest.importorskip("mcap.reader")
    write_table(tmp_path / "bag")
    with (tmp_path / "bag" / "bag_0.mcap").open("rb") as file:
        reader = mcap.make_reader(file, validate_crcs=True)
        found = [(channel.topic, message.log_time, message.data) for _, channel, message in reader.iter_messages()]
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
    assert summary.statistics.message_count == len(found) == 6009
    assert found == read_with_rosbags(tmp_path / "bag")


def test_definitions_and_hashes_are_those_of_jazzy() -> None:
    typesys = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    for name in (JOINT_STATE, DIAGNOSTICS):
        known = describe_type(name)
        assert known.digest == store.hash_rihs01(name)
        assert known.definition.split() == store.generate_msgdef(name, ros_version=2)[0].split()
    assert describe_type("std_msgs/msg/String").digest == store.hash_rihs01("std_msgs/msg/String")
    assert describe_type("my_msgs/msg/Nowhere").definition == ""


def test_metadata_has_what_rosbag2_asks_for(tmp_path: Path) -> None:
    write_table(tmp_path / "bag")
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["relative_file_paths"] == ["bag_0.mcap"]
    assert information["duration"] == {"nanoseconds": 2999 * STEP}
    assert information["starting_time"] == {"nanoseconds_since_epoch": START}
    assert information["message_count"] == information["files"][0]["message_count"] == 6009
    topic = information["topics_with_message_count"][0]["topic_metadata"]
    assert topic["offered_qos_profiles"][0]["reliability"] == "reliable"
    assert "&" not in (tmp_path / "bag" / "metadata.yaml").read_text(), "no YAML anchors"


@pytest.mark.parametrize("storage", STORAGES)
def test_what_is_written_is_read_back(tmp_path: Path, storage: str) -> None:
    stamps = START + np.arange(100, dtype=np.int64) * STEP
    table = np.arange(200.0).reshape(100, 2)
    with BagWriter(tmp_path / "bag", storage) as writer:
        writer.write_joint_states("friction_elements", stamps, ("x/1", "x/2"), position=table, effort=table + 0.5)
        writer.add_topic("silent", JOINT_STATE)
        assert writer.counts == {"/friction_elements": 100, "/silent": 0}
    states = read_joint_states(tmp_path / "bag", "friction_elements")
    assert states.names == ("x/1", "x/2")
    np.testing.assert_array_equal(states.stamp_ns, stamps)
    np.testing.assert_array_equal(states.effort, table + 0.5)
    assert np.isnan(states.velocity).all()
    assert read_joint_states(tmp_path / "bag", "silent").stamp_ns.size == 0


def test_a_long_recording_is_whole_whatever_the_system_makes_of_advice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What was written 32 MB before is let go from memory; a file system may refuse the advice."""
    stamps = START + STEP * np.arange(400_000, dtype=np.int64)
    advice = []

    def refuse(_file: int, first: int, length: int, _what: int) -> None:
        advice.append((first, length))
        raise OSError("no advice here")

    monkeypatch.setattr(os, "posix_fadvise", refuse, raising=False)
    with BagWriter(tmp_path / "bag") as bag:
        bag.write_joint_states("position", stamps, ("x",), position=1e-9 * np.arange(stamps.size))
    size = next((tmp_path / "bag").glob("*.mcap")).stat().st_size
    assert advice and all(first == 0 and 0 < length < size - 30_000_000 for first, length in advice)
    assert np.array_equal(read_joint_states(tmp_path / "bag", "position").stamp_ns, stamps)


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    write_table(tmp_path / "bag", count=10)
    before = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
    with pytest.raises(RecordingError, match="exists already and is not overwritten"):
        BagWriter(tmp_path / "bag")
    (tmp_path / "file").write_text("mine")
    with pytest.raises(RecordingError, match="exists already"):
        BagWriter(tmp_path / "file")
    (tmp_path / "next.partial").mkdir()
    with pytest.raises(RecordingError, match="interrupted recording"):
        BagWriter(tmp_path / "next", keep_on_failure=True)
    with pytest.raises(RecordingError, match="cannot be written"):
        BagWriter(tmp_path / "file" / "bag")
    with pytest.raises(RecordingError, match="choose one of mcap, sqlite3"):
        BagWriter(tmp_path / "other", "csv")
    assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() == before
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["bag", "file", "next.partial"]


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("keep", [False, True])
def test_a_failure_leaves_nothing_under_the_final_name(tmp_path: Path, storage: str, keep: bool) -> None:
    with pytest.raises(RuntimeError), BagWriter(tmp_path / "bag", storage, keep_on_failure=keep) as writer:
        for topic, log_ns, data in recorded_messages(50):
            writer.write(topic, JOINT_STATE, log_ns, data)
        writer.flush()
        assert [entry.name for entry in tmp_path.iterdir()] == ["bag.partial" if keep else "bag.unfinished"]
        raise RuntimeError
    assert [entry.name for entry in tmp_path.iterdir()] == (["bag.partial"] if keep else [])
    if keep:
        assert sum(block.stamp_ns.size for block in read_samples(tmp_path / "bag.partial", "x")) == 50
        with pytest.raises(RecordingError, match=r"bag\.partial holds an interrupted recording, give that"):
            find_files(tmp_path / "bag")


def test_the_leftover_of_a_killed_process_is_replaced_but_not_another_process_s_work(tmp_path: Path) -> None:
    (tmp_path / "bag.unfinished").mkdir()
    (tmp_path / "bag.unfinished" / "bag_0.mcap").write_bytes(b"half")
    with BagWriter(tmp_path / "bag") as writer:
        with pytest.raises(RecordingError, match="is being written by another process"):
            BagWriter(tmp_path / "bag")
        writer.add_topic("position", JOINT_STATE)
    assert [entry.name for entry in tmp_path.iterdir()] == ["bag"]


@pytest.mark.parametrize("storage", STORAGES)
def test_a_full_disk_is_told_in_one_sentence(tmp_path: Path, storage: str) -> None:
    """A limit on the size of files stands for the full disk: the kernel refuses the write in the same place."""
    code = f"""
        import resource, signal, sys
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
        import numpy as np
        from sgms_observer.bags.writer import BagWriter
        from sgms_observer.errors import RecordingError
        try:
            with BagWriter(sys.argv[1], {storage!r}) as writer:
                for i in range(100):
                    stamps = np.arange(1000) + 1000 * i
                    writer.write_joint_states("position", stamps, ("x",), position=np.zeros(1000))
        except RecordingError as error:
            print(error)
            sys.exit(3)
    """
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] in (resource.RLIM_INFINITY, 2**63 - 1)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "SGMS_OBSERVER_NO_NUMBA": "1"}
    command = [sys.executable, "-c", textwrap.dedent(code), str(tmp_path / "bag")]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=60)
    assert done.returncode == 3, done.stderr
    assert "bag cannot be written" in done.stdout and done.stdout.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_write_that_fails_at_the_end_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", refuse)
    with pytest.raises(RecordingError, match="No space left on device"):
        write_table(tmp_path / "bag", count=10)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write into read-only folders")
def test_a_read_only_folder_is_told(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(RecordingError, match="Permission denied"):
        BagWriter(tmp_path / "bag")


@pytest.mark.parametrize("storage", STORAGES)
def test_a_killed_recording_is_readable_up_to_the_last_second(tmp_path: Path, storage: str) -> None:
    code = f"""
        import os, sys, time
        from sgms_observer.bags.cdr import JointStateEncoder
        from sgms_observer.bags.writer import BagWriter
        writer = BagWriter(sys.argv[1], {storage!r}, keep_on_failure=True)
        encoders = {{
            "position": JointStateEncoder(("x",), ("position",)),
            "control_effort": JointStateEncoder(("x",), ("effort",)),
        }}
        log = os.open(sys.argv[1] + ".log", os.O_CREAT | os.O_WRONLY)
        print("ready", flush=True)
        while True:
            now = time.time_ns()
            for topic, encoder in encoders.items():
                writer.write(topic, {JOINT_STATE!r}, now, encoder.encode(now, (1.0,)))
            os.pwrite(log, now.to_bytes(8, "little"), 0)
            time.sleep(0.001)
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "SGMS_OBSERVER_NO_NUMBA": "1"}
    command = [sys.executable, "-c", textwrap.dedent(code), str(tmp_path / "bag")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
    try:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
        time.sleep(2.0)
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
    assert not (tmp_path / "bag").exists()
    blocks = list(read_samples(tmp_path / "bag.partial", "x", 1e-3))
    written_ns = int.from_bytes((tmp_path / "bag.log").read_bytes(), "little")
    assert blocks[-1].stamp_ns[-1] > written_ns - 1_000_000_000
    assert sum(block.stamp_ns.size for block in blocks) > 100


def test_bad_input_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as writer:
        with pytest.raises(DataError, match="from 1970 on"):
            writer.write("a", JOINT_STATE, -1, b"")
        with pytest.raises(DataError, match="from 1970 on"):
            writer.write_joint_states("a", np.array([-1]), ("x",), position=[1.0])
        writer.write_joint_states("a", np.array([], np.int64), ("x",), position=[])
        with pytest.raises(RecordingError, match="needs another topic"):
            writer.write("a", DIAGNOSTICS, 1, b"")
    with pytest.raises(RecordingError, match="is closed"):
        writer.write("a", JOINT_STATE, 1, b"")
    assert read_joint_states(tmp_path / "bag", "a").stamp_ns.size == 0
