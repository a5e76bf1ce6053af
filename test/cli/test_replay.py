"""``sgms replay``: three threads and no difference in what comes out."""

import os
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.replay import in_own_thread
from sgms_observer.bags.reader import BagSamples
from sgms_observer.bags.source import BagReader
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.observer.all_axes import AllAxes

_CONFIG = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-4
    x:
      mass: 5.0
      estimator: {kind: ekf}
"""


def test_items_come_in_order_and_the_thread_ends() -> None:
    before = threading.active_count()
    with in_own_thread(range(50), 2) as taken:
        assert list(taken) == list(range(50))
    assert threading.active_count() == before


def test_an_error_in_the_thread_is_raised_behind_the_items_before_it() -> None:
    def items():
        yield 1
        raise OSError("gone")

    found = []
    with in_own_thread(items(), 2) as taken, pytest.raises(OSError, match="gone"):
        for item in taken:
            found.append(item)
    assert found == [1]
    with in_own_thread(items(), 2) as taken:
        assert next(taken) == 1  # the error behind it is nobody's any more


def test_the_thread_begins_before_it_is_asked_and_stops_with_its_consumer() -> None:
    made, has_begun = [], threading.Event()

    def items():
        for number in range(10**6):
            made.append(number)
            has_begun.set()
            yield number

    before = threading.active_count()
    with in_own_thread(items(), 2) as taken:
        assert has_begun.wait(10.0)
        assert next(taken) == 0
    assert threading.active_count() == before
    assert len(made) < 10


def _messages(bag: Path) -> dict[str, list[tuple[int, bytes]]]:
    found: dict[str, list[tuple[int, bytes]]] = {}
    with BagReader(bag) as reader:
        for topic, stamp, message in reader.messages():
            found.setdefault(topic, []).append((stamp, message))
    return found


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("replay")
    (folder / "config.yaml").write_text(_CONFIG)
    arguments = ["simulate", "--config", str(folder / "config.yaml"), "--out", str(folder / "recorded")]
    assert main([*arguments, "--duration", "1.5"]) == 0
    return folder


def _replay(folder: Path, out: str, *more: str) -> dict[str, list[tuple[int, bytes]]]:
    arguments = ["replay", str(folder / "recorded"), "--config", str(folder / "config.yaml"), "--out"]
    assert main([*arguments, str(folder / out), *more]) == 0
    return _messages(folder / out)


def test_both_storages_get_the_same_messages_and_twice_the_same(recording: Path) -> None:
    first = _replay(recording, "first")
    assert len(first["/friction_estimate"]) == 15_000
    assert _replay(recording, "second") == first
    assert _replay(recording, "third", "--storage", "sqlite3") == first


def test_a_bag_in_sqlite_is_replayed_too(recording: Path) -> None:
    config, out = str(recording / "config.yaml"), recording / "again"
    bag = recording / "estimates"
    first = ["replay", str(recording / "recorded"), "--config", config, "--out", str(bag), "--storage", "sqlite3"]
    assert main(first) == 0
    renamed = ["--topic", "position=/friction_estimate", "--topic", "control_effort=/friction_estimate"]
    assert main(["replay", str(bag), "--config", config, "--out", str(out), *renamed]) == 0
    assert len(_messages(out)["/friction_estimate"]) == 15_000


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_an_axis_that_the_bag_lacks_is_refused_before_the_first_sample(
    tmp_path: Path, storage: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The observer ran over the whole bag, with progress, and only then refused it. A name may come later."""
    stamps = 10**9 + 100_000 * np.arange(2000)
    with BagWriter(tmp_path / "bag", storage) as bag:
        for axis, rows in (("y", slice(0, 1500)), ("x", slice(1500, None))):
            zeros = np.zeros(len(stamps[rows]))
            bag.write_joint_states("position", stamps[rows], (axis,), position=zeros)
            bag.write_joint_states("control_effort", stamps[rows], (axis,), effort=zeros)
    config = tmp_path / "table.yaml"
    config.write_text(_CONFIG.replace("[x]", "[x, table]").rstrip() + "\n    table: {mass: 5.0}\n")
    blocks = []
    monkeypatch.setattr(AllAxes, "step", lambda _, block: blocks.append(block))
    arguments = ["replay", str(tmp_path / "bag"), "--config", str(config), "--out", str(tmp_path / "out")]
    assert main(arguments) == 1
    sentence = f"/position in {tmp_path / 'bag'} holds y, x, not axis table; name the axis as the bag does"
    assert sentence in capsys.readouterr().err
    assert not blocks and not (tmp_path / "out").exists()
    BagSamples(tmp_path / "bag", ["x", "y"]).refuse_unknown_axes()


def test_messages_are_the_same_without_numba(tmp_path: Path) -> None:
    """The compiled loops over bytes and their numpy twins write and read the same."""
    script = f"""
import numpy as np, sys
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.writer import BagWriter
stamps = np.arange(1, 3001, dtype=np.int64) * 1_234_567_891 // 3
rng = np.random.default_rng(5)
with BagWriter(sys.argv[1]) as bag:
    for topic, names in (("a", ("x",)), ("b", ("x", "a longer name"))):
        given = dict(position=rng.normal(size=(3000, len(names))), effort=rng.normal(size=(3000, len(names))))
        bag.write_joint_states(topic, stamps, names, **given)
        bag.write(topic, "sensor_msgs/msg/JointState", 5, {bytes([0, 1, 0, 0, *range(1, 9), *bytes(20)])!r})
for topic in ("a", "b"):
    states = read_joint_states(sys.argv[1], topic)
    np.savez(sys.argv[1] + topic, states.stamp_ns, states.position, states.velocity, states.effort)
"""
    content = []
    for number, value in enumerate(("", "1")):
        bag = tmp_path / str(number) / "bag"
        bag.parent.mkdir()
        environment = {**os.environ, "SGMS_OBSERVER_NO_NUMBA": value}
        subprocess.run([sys.executable, "-c", script, str(bag)], check=True, env=environment)
        content.append([path.read_bytes() for path in sorted(bag.parent.rglob("*")) if path.is_file()])
    assert content[0] == content[1]
