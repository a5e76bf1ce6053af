"""The main job: both nodes, the recorder and the evaluation; and a recorded live run that replays to the last bit."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report
from program import PATIENCE
from ros_graph import ONE_AXIS, Graph, Start, wait_until

from sgms_observer.bags.diagnostics_cdr import decode_diagnostics
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.source import BagReader

OUTPUTS = ("friction_estimate", "friction_std", "friction_compensation", "friction_elements")
ROOT = Path(__file__).parents[2]

SHARPER = 1.02
"""As in test/compensation/test_never_worse.py, for what is later than any horizon."""


_started: list[subprocess.Popen[str]] = []


@pytest.fixture(autouse=True, scope="module")
def _no_command_is_left() -> Iterator[None]:
    """End what a failed test left running."""
    yield
    for process in _started:
        if process.poll() is None:
            process.kill()
            process.wait()


def _sgms(*arguments: str) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-m", "sgms_observer", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
    )
    _started.append(process)
    return process


def test_a_recorded_live_run_replays_to_the_last_bit(graph: Graph, start: Start, tmp_path: Path) -> None:
    """Every message of every output topic, from the very first sample on."""
    bag, again = tmp_path / "live", tmp_path / "again"
    recorder = _sgms("record", "--out", str(bag))
    yaml = ONE_AXIS.replace("estimator:", "compensation: {enabled: true}\n      estimator:")
    start("observer_node", yaml)
    stage = start("stage_node", yaml, "--ros-args", "-p", "autostart:=false", wait=False)
    assert graph.change("stage_node", 1)
    for topic, count in {"position": 2, "control_effort": 2, "reference": 2, "friction_elements": 1}.items():
        wait_until(lambda t=topic, n=count: graph.node.count_subscribers(t) >= n, f"subscribers of {topic}")
    graph.listen("friction_elements")
    time.sleep(5.0)  # the graph knows a subscription before its publisher serves it
    assert graph.change("stage_node", 3)
    graph.wait_messages("friction_elements", 2000)
    assert graph.change("stage_node", 4)
    assert stage.stop() == 0
    recorder.send_signal(signal.SIGINT)
    said, _ = recorder.communicate(timeout=PATIENCE)
    assert recorder.returncode == 0, said
    replay = _sgms("replay", str(bag), "--config", str(tmp_path / "observer_node.yaml"), "--out", str(again))
    said, _ = replay.communicate(timeout=PATIENCE)
    assert replay.returncode == 0, said
    for topic in OUTPUTS:
        live, replayed = read_joint_states(bag, topic), read_joint_states(again, topic)
        shared = np.isin(live.stamp_ns, replayed.stamp_ns)
        # The watchdog's own zeros, after the last sample, belong to no sample.
        assert np.count_nonzero(~shared) <= (10 if topic == "friction_compensation" else 0)
        rows = np.isin(replayed.stamp_ns, live.stamp_ns)
        assert np.count_nonzero(rows) >= 2000
        for field in ("position", "velocity", "effort"):
            before, after = getattr(live, field)[shared], getattr(replayed, field)[rows]
            assert np.array_equal(before, after, equal_nan=True), (topic, field)
    with BagReader(bag) as first, BagReader(again) as second:
        live_parameters = [decode_diagnostics(data) for _, _, data in first.messages(["/friction_parameters"])]
        replayed_parameters = [decode_diagnostics(data) for _, _, data in second.messages(["/friction_parameters"])]
    assert live_parameters and set(live_parameters) <= set(replayed_parameters)


@pytest.fixture(scope="module")
def demonstration(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder of a demonstration and what the command said."""
    out = tmp_path_factory.mktemp("demonstration")
    demo = _sgms("demo", "--out", str(out), "--duration", "8")
    said, _ = demo.communicate(timeout=3 * PATIENCE)
    assert demo.returncode == 0, said
    return out, said


def test_the_demonstration(demonstration: tuple[Path, str]) -> None:
    out, said = demonstration
    share = float(re.search(r"([\d.]+) % of the true", said)[1])
    assert share < 3.0
    same, compared = map(int, re.search(r"(\d+) of (\d+) live estimates", said).groups())
    assert same == compared > 5000
    in_time, late = "every compensation came in time", r"[\d.e-]+ % of the samples got a compensation late"
    assert re.search(rf"on the way +({in_time}|{late})", said)
    page = (out / "report.html").read_text()
    assert page.count("<svg") == len(list(out.glob("*.png"))) == 10 and page.count('class="plot"') == 1
    for topic in ("Friction", "Tracking", "Live run"):
        assert f"<h3>{topic}</h3>" in page
    assert (out / "bag" / "metadata.yaml").exists()
    with BagReader(out / "bag") as bag:
        messages = [(topic, stamp) for topic, stamp, _ in bag.messages(["/position", "/diagnostics"])]
    last = max(stamp for topic, stamp in messages if topic == "/position")
    # The observer goes on to send one a second: the command does not wait for them to end.
    assert sum(topic == "/diagnostics" and stamp > last for topic, stamp in messages) < 20


def test_beside_burning_processes_it_is_not_worse(tmp_path: Path) -> None:
    """Two busy processes for each core: messages are late by tens of milliseconds, and the horizon bridges that."""
    burning = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True)
        for _ in range(2 * (os.cpu_count() or 1))
    ]
    try:
        demo = _sgms("demo", "--out", str(tmp_path / "demo"), "--duration", "8")
        bag = tmp_path / "demo" / "bag"  # has this name once nothing runs live any more
        wait_until(lambda: bag.exists() or demo.poll() is not None, "the end of the recording", 3 * PATIENCE)
    finally:
        for process in burning:
            process.kill()
            process.wait()
    said, _ = demo.communicate(timeout=3 * PATIENCE)
    assert demo.returncode == 0, said
    tracking = json.loads((tmp_path / "demo" / "result.json").read_text())["axes"]["x"]["tracking"]
    assert tracking["peak_after"] <= SHARPER * tracking["peak_before"], said


def test_an_observer_that_is_behind_is_waited_for(tmp_path: Path) -> None:
    """It sleeps over the end of the motion, for less than the 5 s after which the others would forget it."""
    out = tmp_path / "demo"
    demo = _sgms("demo", "--out", str(out), "--duration", "6")
    assert demo.stdout is not None
    begun = next((line for line in demo.stdout if line.startswith("running for")), None)
    assert begun is not None and demo.poll() is None, "it did not start"
    time.sleep(5.5)
    children = Path(f"/proc/{demo.pid}/task/{demo.pid}/children").read_text().split()
    (observer,) = (int(child) for child in children if "observer_node" in Path(f"/proc/{child}/cmdline").read_text())
    os.kill(observer, signal.SIGSTOP)
    time.sleep(4.3)
    os.kill(observer, signal.SIGCONT)
    said, _ = demo.communicate(timeout=3 * PATIENCE)
    assert demo.returncode == 0, said
    with BagReader(out / "bag") as bag:
        ends = {topic: arrived for topic, arrived, _ in bag.messages(["/position", "/friction_estimate"])}
    assert ends["/friction_estimate"] > ends["/position"] + 10**9, "it was not behind, so this shows nothing"
    positions, estimates = (read_joint_states(out / "bag", topic) for topic in ("position", "friction_estimate"))
    missing = ~np.isin(positions.stamp_ns, estimates.stamp_ns)
    assert not missing[positions.stamp_ns >= estimates.stamp_ns[0]].any()


def test_the_demonstration_writes_its_figures(demonstration: tuple[Path, str]) -> None:
    """result.json has the keys that other programs read, and the headline says the same."""
    out, said = demonstration
    result = json.loads((out / "result.json").read_text())
    assert result.keys() == {"schema", "axes"} and result["schema"] == 1 and result["axes"].keys() == {"x"}
    found = result["axes"]["x"]
    assert found.keys() == {
        "friction_rms", "friction_nrmse", "tracking", "late_share", "replay_equal", "replay_total",
    }  # fmt: skip
    assert found["tracking"].keys() == {"rms_before", "rms_after", "peak_before", "peak_after"}
    assert 0.0 < found["friction_nrmse"] < 0.03 and found["friction_rms"] > 0.0
    assert found["replay_equal"] == found["replay_total"] > 5000
    assert 0.0 <= found["late_share"] <= 1.0
    change = r"([\d.]+|about the same)(?:x (\w+))? \("
    headline = re.search(rf"^axis x: friction estimated to ([\d.]+) % .*rms {change}.*peak {change}"
                         r".*; ([\d.e-]+) % of the compensation messages came late$", said, re.MULTILINE)  # fmt: skip
    assert headline is not None, said
    share, rms, rms_way, peak, peak_way, late = headline.groups()
    tracking = found["tracking"]
    assert float(share) == pytest.approx(100.0 * found["friction_nrmse"], abs=0.006)
    assert float(late) == pytest.approx(100.0 * found["late_share"], rel=0.01)
    for times, way, kind in ((rms, rms_way, "rms"), (peak, peak_way, "peak")):
        ratio = tracking[f"{kind}_before"] / tracking[f"{kind}_after"]
        if way is None:
            assert times == "about the same" and ratio == pytest.approx(1.0, abs=0.06)
            continue
        assert (way == "smaller") == (ratio >= 1.0)
        assert float(times) == pytest.approx(max(ratio, 1.0 / ratio), abs=0.06)
    assert headline.group(0)[1:] in (out / "report.html").read_text()


def test_report_of_the_demonstration_reads_well(demonstration: tuple[Path, str], browser: Browser) -> None:
    check_report(browser, demonstration[0] / "report.html", 9)


def test_a_demonstration_that_is_killed_leaves_no_node_behind(tmp_path: Path) -> None:
    demo = _sgms("demo", "--out", str(tmp_path), "--duration", "1000")
    try:
        recorded = tmp_path / "bag.partial"
        wait_until(lambda: recorded.exists() or demo.poll() is not None, "the demonstration to record")
        children = Path(f"/proc/{demo.pid}/task/{demo.pid}/children").read_text().split()
        assert len(children) == 3
    finally:
        demo.kill()
        demo.communicate()
    for child in children:
        wait_until(lambda pid=child: _is_dead(pid), f"the end of process {child}")


def _is_dead(process: str) -> bool:
    """Return whether a process is gone, or has ended and only waits for somebody to ask how."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


def test_a_demonstration_without_a_usable_file_is_a_sentence(tmp_path: Path) -> None:
    for arguments in (("--config", "/no/such.yaml"), ("--duration", "-1")):
        demo = _sgms("demo", "--out", str(tmp_path), *arguments)
        said, _ = demo.communicate(timeout=PATIENCE)
        assert demo.returncode == 1 and len(said.splitlines()) == 1, said
