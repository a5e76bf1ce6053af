"""10 kHz over the graph, one process per node: what is lost, and how long from a sample to its estimate."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.bench.process import seconds_used
from sgms_observer.bench.scene import write_config

_RATE = 10_000  # Hz
_LOOK = 1.0  # s between two looks at a process
_IDLE = 0.05  # share of a core below which it has nothing left to do
_LONGEST_WAIT = 60.0  # s


def time_live(folder: Path, seconds: float, publish_every: int = 1) -> dict[str, Any]:
    """Publish samples from one process, observe in another, listen in a third.

    Args:
        folder: for parameter file, logs and times.
        seconds: how long to publish [s].
        publish_every: samples from one published estimate to the next.

    Returns:
        The entries of ``live`` in the JSON file.

    Raises:
        DataError: a process ended too early.
    """
    from sgms_observer.nodes.conductor import Conductor, prepare_graph

    prepare_graph()
    config = write_config(folder, "mhe", publish_every)
    sent_file, heard_file = folder / "sent.npy", folder / "heard.npy"
    count = round(seconds * _RATE)
    with Conductor(folder / "logs") as conductor:
        observer = ["--ros-args", "--params-file", str(config)]
        conductor.start("observer_node", "sgms_observer.nodes.observer_node", observer)
        listener = ["--topic", "friction_estimate", "--out", str(heard_file)]
        conductor.start("listener", "sgms_observer.nodes.bench_listener", listener)
        conductor.wait_active("observer_node")
        conductor.wait_subscribers({"friction_estimate": 1})
        publisher = ["--count", str(count), "--out", str(sent_file)]
        used = seconds_used(conductor.process_id("observer_node"))
        conductor.start("publisher", "sgms_observer.nodes.bench_publisher", publisher)
        conductor.wait(sent_file.exists, "the publisher to send everything")
        share = (seconds_used(conductor.process_id("observer_node")) - used) / (count / _RATE)
        _wait_until_idle(conductor.process_id("observer_node"))
        _wait_until_idle(conductor.process_id("listener"))
        conductor.stop("listener")
        conductor.stop("publisher")
        conductor.stop("observer_node")
    sent, heard = np.load(sent_file), np.load(heard_file)
    wanted = sent[:, ::publish_every]
    _, place, arrived = np.intersect1d(wanted[0], heard[0], return_indices=True)
    latency = (heard[1, arrived] - wanted[1, place]) * 1e-3
    p50, p99 = np.percentile(latency, (50.0, 99.0)) if latency.size else (np.nan, np.nan)
    late50, late99 = np.percentile((sent[1] - sent[0]) * 1e-3, (50.0, 99.0))
    return {
        "rate_hz": _RATE,
        "sent": int(wanted.shape[1]),
        "lost": int(wanted.shape[1] - place.size),
        "latency_us": {"p50": round(float(p50), 1), "p99": round(float(p99), 1)},
        "cpu_share": round(share, 3),
        "seconds": seconds,
        "publisher_late_us": {"p50": round(float(late50), 1), "p99": round(float(late99), 1)},
    }


def _wait_until_idle(process_id: int) -> None:
    """Wait until a process has worked off what is on its way."""
    end = time.monotonic() + _LONGEST_WAIT
    before = -1.0
    while time.monotonic() < end:
        now = seconds_used(process_id)
        if now - before < _IDLE * _LOOK:
            return
        before = now
        time.sleep(_LOOK)
