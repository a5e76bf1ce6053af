"""SIGINT, SIGTERM and SIGKILL at random times: no traceback, no half a bag under its name, recordings readable."""

from __future__ import annotations

import random
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from program import PATIENCE, is_of_ours, start_program
from ros_graph import ONE_AXIS, Graph, wait_until

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.reader import read_samples
from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.errors import SgmsError

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
SEED = 31


def sgms(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """Start a command."""
    return start_program("sgms_observer", arguments, folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with settings and a recording of five minutes."""
    folder = tmp_path_factory.mktemp("source")
    (folder / "axis.yaml").write_text(ONE_AXIS)
    count = 300_000
    stamps = 10**9 + np.arange(count, dtype=np.int64) * 1_000_000
    with BagWriter(folder / "source") as bag:
        bag.write_joint_states("position", stamps, ("x",), position=1e-3 * np.sin(0.01 * np.arange(count)))
        bag.write_joint_states("control_effort", stamps, ("x",), effort=4.0 * np.sign(np.cos(0.01 * np.arange(count))))
    return folder


@pytest.mark.parametrize("number", SIGNALS)
@pytest.mark.parametrize("command", [("simulate", "--duration", "3000"), ("replay", "source")], ids=lambda c: c[0])
def test_a_command_is_stopped(command: tuple[str, ...], number: signal.Signals, source: Path, tmp_path: Path) -> None:
    print(f"seed {SEED}")
    chance = random.Random(SEED + number + len(command))
    for delay in (chance.uniform(0.0, 0.4), chance.uniform(0.4, 3.0)):
        out = tmp_path / f"{delay:.3f}"
        process = sgms(source, *command, "--config", "axis.yaml", "--out", str(out))
        time.sleep(delay)
        process.send_signal(number)
        _, errors = process.communicate(timeout=PATIENCE)
        has_ended = process.returncode == 0  # replay may have been faster
        assert has_ended or process.returncode in (130, 143, -number), errors
        assert not is_of_ours(errors), errors
        if has_ended or out.exists():  # the signal may meet a process that has only to leave
            with BagReader(out) as bag:
                assert bag.warnings == () and any(bag.messages())


@pytest.mark.parametrize("number", SIGNALS)
def test_a_recording_is_readable_up_to_the_last_second(number: signal.Signals, graph: Graph, tmp_path: Path) -> None:
    chance = random.Random(SEED + number)
    process = sgms(tmp_path, "record", "position", "control_effort", "--out", "bag")
    encoders = {
        "position": JointStateEncoder(("x",), ("position",)),
        "control_effort": JointStateEncoder(("x",), ("effort",)),
    }
    try:
        publish = {topic: graph.publisher(topic) for topic in encoders}

        def is_recorded() -> bool:  # a recorder that was killed before may still count as a subscriber
            assert process.poll() is None, process.communicate()
            stamp = time.time_ns()
            for topic, encoder in encoders.items():
                publish[topic](encoder.encode(stamp, (1.0,)))
            try:
                return any(True for _ in read_samples(tmp_path / "bag.partial", "x", 1e-3))
            except SgmsError:
                return False  # nothing in it yet

        wait_until(is_recorded, "the recorder to record")
        seconds = chance.uniform(1.5, 3.0)
        begun = latest = time.time_ns()
        count = longest_wait = 0
        while latest < begun + seconds * 1e9 or count < 600:
            before, latest, count = latest, time.time_ns(), count + 1
            longest_wait = max(longest_wait, latest - before)  # as long this machine lets a process wait
            for topic, encoder in encoders.items():
                publish[topic](encoder.encode(latest, (1.0,)))
            time.sleep(1e-3)
        process.send_signal(number)
        _, errors = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert "Traceback" not in errors
    path = tmp_path / ("bag.partial" if number == signal.SIGKILL else "bag")
    assert process.returncode == (-number if number == signal.SIGKILL else 0)
    blocks = list(read_samples(path, "x", 1e-3))
    stamps = np.concatenate([block.stamp_ns for block in blocks])
    assert latest - stamps[-1] < 1_000_000_000 + 2 * longest_wait
    assert len(stamps) > 300
    with BagReader(path) as bag:
        assert sum(1 for _ in bag.messages(("/position",))) >= len(stamps)
