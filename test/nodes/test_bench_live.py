"""``sgms bench``: its live runs over the graph."""

from __future__ import annotations

from pathlib import Path

import pytest

from sgms_observer.bench.live_run import time_live


def test_live_run_over_the_graph(tmp_path: Path) -> None:
    """Every sample gets its estimate; how fast is no matter here."""
    live = time_live(tmp_path, 0.5)
    assert (live["sent"], live["lost"], live["relay"]["lost"]) == (5000, 0, 0)
    for way in (live, live["relay"]):
        assert 0.0 < way["latency_us"]["p50"] <= way["latency_us"]["p99"]
    assert live["over_relay"]["p50"] == pytest.approx(
        live["latency_us"]["p50"] / live["relay"]["latency_us"]["p50"], abs=0.01
    )


def test_live_run_of_several_axes_at_another_rate(tmp_path: Path) -> None:
    live = time_live(tmp_path, 0.5, rate=1000, axes=3)
    assert (live["rate_hz"], live["sent"], live["lost"], live["relay"]["lost"]) == (1000, 500, 0, 0)
