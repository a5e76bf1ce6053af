"""``sgms record`` and ``sgms play`` as processes on the real graph."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from program import is_of_ours, start_program

from sgms_observer.bags.reader import read_samples
from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import SgmsError

pytest.importorskip("rclpy", reason="there is no ROS here")

from ros_graph import wait_until

TIME_LIMIT = 120  # s; only to end a test that hangs
COUNT = 2000


def sgms(*arguments: str | Path, folder: Path) -> subprocess.Popen[str]:
    """Start a command."""
    pipe = subprocess.PIPE
    return start_program("sgms_observer", [str(item) for item in arguments], folder, stdout=pipe, stderr=pipe)


def source_bag(path: Path) -> Path:
    """Write two seconds at 1 kHz."""
    stamps = 10**9 + np.arange(COUNT, dtype=np.int64) * 1_000_000
    with BagWriter(path) as writer:
        writer.write_joint_states("position", stamps, ("x",), position=np.arange(float(COUNT)))
        writer.write_joint_states("control_effort", stamps, ("x",), effort=-np.arange(float(COUNT)))
        writer.write_joint_states("ignored", stamps, ("x",), effort=np.zeros(COUNT))
    return path


def by_topic(path: Path) -> dict[str, list[bytes]]:
    """Return the messages of each topic in order."""
    found: dict[str, list[bytes]] = {}
    with BagReader(path) as bag:
        for topic, _, data in bag.messages():
            found.setdefault(topic, []).append(data)
    return found


def wait_recorded(path: Path, counts: dict[str, int]) -> None:
    """Wait until so many messages of each topic can be read from a recording that goes on."""

    def are_there() -> bool:
        try:
            return {topic: len(messages) for topic, messages in by_topic(path).items()} == counts
        except SgmsError:
            return False  # nothing in it yet

    wait_until(are_there, f"{counts} in {path}", TIME_LIMIT)


def play(path: Path, *arguments: str) -> str:
    """Play a bag to its end."""
    player = sgms("play", path, "--wait", "60", *arguments, folder=path.parent)
    out, errors = player.communicate(timeout=TIME_LIMIT)
    assert (player.returncode, errors) == (0, "")
    return out


@pytest.mark.parametrize(("number", "switches"), [(signal.SIGINT, []), (signal.SIGTERM, ["--json"])])
def test_what_is_played_is_recorded_byte_for_byte(tmp_path: Path, number: signal.Signals, switches: list[str]) -> None:
    source = source_bag(tmp_path / "source")
    recorder = sgms("record", "--out", tmp_path / "copy", "--storage", "mcap", *switches, folder=tmp_path)
    try:
        assert recorder.stdout is not None
        if not switches:
            assert "recording into" in recorder.stdout.readline()
            assert os.sched_getscheduler(recorder.pid) == os.SCHED_BATCH, "it would interrupt the nodes"
        assert f"played {3 * COUNT} messages" in play(source)
        wait_recorded(tmp_path / "copy.partial", {"/position": COUNT, "/control_effort": COUNT})
        recorder.send_signal(number)
        out, errors = recorder.communicate(timeout=TIME_LIMIT)
    finally:
        recorder.kill()
    assert (recorder.returncode, errors) == (0, "")
    if switches:
        counts = {"/position": COUNT, "/control_effort": COUNT}
        assert json.loads(out) == {"schema": 1, "bag": str(tmp_path / "copy"), "messages": counts, "warnings": []}
    else:
        assert f"/position: {COUNT} messages" in out
    original, copy = by_topic(source), by_topic(tmp_path / "copy")
    assert set(copy) == {"/position", "/control_effort"}
    for topic in copy:
        assert copy[topic] == original[topic]
    assert not (tmp_path / "copy.partial").exists()


def test_a_killed_recorder_leaves_a_readable_bag(tmp_path: Path) -> None:
    source = source_bag(tmp_path / "source")
    topics = ("position", "/control_effort", "/ignored")
    recorder = sgms("record", *topics, "--out", tmp_path / "copy", folder=tmp_path)
    try:
        assert recorder.stdout is not None
        recorder.stdout.readline()
        play(source, "--topics", "position", "control_effort")
        wait_recorded(tmp_path / "copy.partial", {"/position": COUNT, "/control_effort": COUNT})
        recorder.kill()
        recorder.communicate(timeout=TIME_LIMIT)
    finally:
        recorder.kill()
    assert not (tmp_path / "copy").exists()
    blocks = list(read_samples(tmp_path / "copy.partial", "x"))
    assert sum(block.stamp_ns.size for block in blocks) == COUNT


def test_one_sentence_and_nothing_left_when_nothing_arrives(tmp_path: Path) -> None:
    recorder = sgms("record", "--out", tmp_path / "none", "--duration", "1", folder=tmp_path)
    _, errors = recorder.communicate(timeout=TIME_LIMIT)
    assert recorder.returncode == 1
    assert errors.startswith("no message arrived") and errors.count("\n") == 1
    assert not any(path.name.startswith("none") for path in tmp_path.iterdir())


def test_a_topic_of_another_name_is_played_as_what_the_nodes_listen_to(tmp_path: Path) -> None:
    source = source_bag(tmp_path / "source")
    recorder = sgms("record", "--out", tmp_path / "copy", folder=tmp_path)
    try:
        assert recorder.stdout is not None
        recorder.stdout.readline()
        played = json.loads(play(source, "--topic", "position=/control_effort", "--json"))
        assert (played["messages"], played["stopped"]) == (2 * COUNT, False)
        wait_recorded(tmp_path / "copy.partial", {"/position": COUNT})
    finally:
        recorder.kill()
    assert by_topic(tmp_path / "copy.partial")["/position"] == by_topic(source)["/control_effort"]


@pytest.mark.parametrize("delay", [0.1, 0.5, 2.0])
def test_playing_stops_at_a_signal(tmp_path: Path, delay: float) -> None:
    player = sgms("play", source_bag(tmp_path / "source"), "--rate", "0.001", "--wait", "0", folder=tmp_path)
    time.sleep(delay)
    player.send_signal(signal.SIGINT)
    _, errors = player.communicate(timeout=TIME_LIMIT)
    assert player.returncode in (0, 130, -signal.SIGINT)  # but for 0, it came before the command had started
    assert not is_of_ours(errors), errors


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (("play", "nowhere"), "nowhere does not exist"),
        (("play", "source", "--rate", "0"), "--rate 0 must be a positive number; "),
        (
            ("play", "source", "--topics", "posture"),
            "has no topic /posture; it holds /control_effort, /ignored, /position",
        ),
        (
            ("play", "source", "--topic", "position=posture"),
            "has no topic /posture; it holds /control_effort, /ignored, /position",
        ),
        (("record", "--out", "source"), "exists already"),
    ],
)
def test_wrong_requests_get_one_sentence(tmp_path: Path, arguments: tuple[str, ...], sentence: str) -> None:
    source_bag(tmp_path / "source")
    places = [str(tmp_path / item) if item in ("nowhere", "source") else item for item in arguments]
    command = sgms(*places, folder=tmp_path)
    _, errors = command.communicate(timeout=TIME_LIMIT)
    assert command.returncode == 1
    assert sentence in errors and errors.count("\n") == 1
