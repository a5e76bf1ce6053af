"""``sgms bench``: its live runs over the graph."""

from __future__ import annotations

import json
import os
import signal
import threading
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.bench import live_run
from sgms_observer.bench.live_run import time_live
from sgms_observer.bench.process import write_config
from sgms_observer.cli.main import main
from sgms_observer.errors import DataError
from sgms_observer.nodes import conductor as conductor_module
from sgms_observer.nodes.conductor import Conductor, prepare_graph
from sgms_observer.shipped import shipped_file

_PAUSE = 12.0  # s; a relay starts, is served and ends within this time on a loaded machine


def test_live_run_over_the_graph(tmp_path: Path) -> None:
    """Every sample gets its estimate; how fast is no matter here."""
    live, _ = time_live(tmp_path, 0.5)
    assert (live["sent"], live["lost"], live["relay"]["lost"]) == (5000, 0, 0)
    for way in (live, live["relay"]):
        assert 0.0 < way["latency_us"]["p50"] <= way["latency_us"]["p99"]
    assert live["over_relay"]["p50"] == pytest.approx(
        live["latency_us"]["p50"] / live["relay"]["latency_us"]["p50"], abs=0.01
    )


def test_live_run_of_several_axes_at_another_rate(tmp_path: Path) -> None:
    live, _ = time_live(tmp_path, 0.5, rate=1000, axes=3)
    assert (live["rate_hz"], live["sent"], live["lost"], live["relay"]["lost"]) == (1000, 500, 0, 0)


def test_no_sample_is_sent_before_the_listener_hears_the_relay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A listener that is paused while the relay starts discovers it late; every message of the relay was lost.

    It is paused for longer than a participant may be silent (5 s), so the others have to be more patient: an observer
    that forgets it may find it again a second later than the relay does.
    """
    start, profile = Conductor.start, tmp_path / "patient.xml"
    shipped, lease = shipped_file("config", "fastdds.xml").read_text(encoding="utf-8"), "<sec>5</sec>"
    assert shipped.count(lease) == 1
    profile.write_text(shipped.replace(lease, "<sec>60</sec>"), encoding="utf-8")
    monkeypatch.setenv("FASTRTPS_DEFAULT_PROFILES_FILE", str(profile))

    def start_and_pause(self: Conductor, name: str, module: str, arguments: Sequence[str]) -> None:
        if name == "relay":
            listener = self.process_id("listener")
            os.kill(listener, signal.SIGSTOP)
            threading.Timer(_PAUSE, os.kill, (listener, signal.SIGCONT)).start()
        start(self, name, module, arguments)

    monkeypatch.setattr(Conductor, "start", start_and_pause)
    prepare_graph()
    config = write_config(tmp_path, "mhe", rate=1000)
    half = live_run._run(tmp_path / "half", config, 300, 1000, 1, ("observer_node", "relay"))
    assert {name: way.count - len(way.delays) for name, way in half.items()} == dict.fromkeys(half, 0)


def test_a_listener_that_hears_nothing_is_one_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(conductor_module, "_PATIENCE", 1.0)
    prepare_graph()
    listener = ["--out", str(tmp_path / "heard.npz"), live_run.RELAYED]
    with Conductor(tmp_path / "logs") as conductor:
        conductor.start("listener", "sgms_observer.bench.listener", listener)
        with pytest.raises(DataError, match="waited 1 s for the listener to get a message of bench_relayed"):
            live_run._wait_first_message(conductor, live_run.RELAYED)


def test_a_lost_half_and_a_late_publisher_are_warnings_and_null(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The JSON had NaN, which is no JSON, and no sentence said why."""

    def half_run(
        folder: Path, config: Path, count: int, rate: int, axes: int, order: Sequence[str]
    ) -> dict[str, live_run._Way]:
        is_lost = rate == 1000 and order[0] == "observer_node"
        late = np.where(np.arange(count) % 5 == 0, 1.1e6 / rate if rate == 2000 else 0.9e6 / rate, 0.0)
        delays = {
            "observer_node": np.full(count, 300.0),
            "relay": np.full(0 if is_lost else count, 200.0),
            "publisher": late,
        }
        return {name: live_run._Way(count, values, 0.1, count / rate) for name, values in delays.items()}

    monkeypatch.setattr(live_run, "_run", half_run)
    file = tmp_path / "bench.json"
    assert main(["bench", "--only", "live", "--live-seconds", "2", "--json", str(file)]) == 0

    def refuse(constant: str) -> None:
        raise AssertionError(f"{constant} is not valid JSON")

    live = json.loads(file.read_text(), parse_constant=refuse)["live"]
    lossy, late = live["rates"]
    assert lossy["relay"]["lost"] == 1000 and lossy["over_relay"] == {"p50": 1.5, "p99": 1.5}
    assert lossy["over_relay_if_first"] == {
        "observer_node": {"p50": None, "p99": None},
        "relay": {"p50": 1.5, "p99": 1.5},
    }
    warnings = [line for line in capsys.readouterr().err.splitlines() if line.startswith("Warning: ")]
    assert [line.partition(",")[0] for line in warnings] == [
        "Warning: the live run at 1000 Hz lost all 1000 messages of relay in the half in which observer_node is served"
        " first",
        "Warning: the publisher of the live run at 2000 Hz sent 20 % of the samples more than one sample period late",
    ]
    assert late["over_relay"] == live["over_relay"] == {"p50": 1.5, "p99": 1.5}


def test_figures_without_a_message_are_null() -> None:
    nothing = live_run._Way(10, np.array([]), 0.0, 1.0)
    assert nothing.figures() == {"lost": 10, "latency_us": {"p50": None, "p99": None}, "cpu_share": 0.0}
    assert live_run._ratio(nothing, nothing) == {"p50": None, "p99": None}
