"""Samples over the graph, one process per node: what is lost, and how long from a sample to its compensation.

A relay runs beside the observer: a node with the same executor that takes in both topics and gives out one message for
each sample, with nothing computed. What it takes is what the middleware, the executor and the machine take.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bench.process import RATE, seconds_used, write_config

RATES = (1_000, 2_000, RATE)
"""Samples per second of the live runs [Hz]."""

RELAYED = "bench_relayed"
"""Topic of the relay."""

_COMPENSATION = "friction_compensation"
_LOOK = 1.0  # s between two looks at a process
_IDLE = 0.05  # share of a core below which it has nothing left to do
_LONGEST_WAIT = 60.0  # s


def time_live(folder: Path, seconds: float, publish_every: int = 1, rate: int = RATE, axes: int = 1) -> dict[str, Any]:
    """Publish samples from one process, observe in another, relay in a third, listen in a fourth.

    Args:
        folder: for parameter file, logs and times.
        seconds: how long to publish [s].
        publish_every: samples from one published estimate to the next.
        rate: samples per second [Hz].
        axes: how many there are in each message.

    Returns:
        The entries of ``live`` in the JSON file, for one rate.

    Raises:
        DataError: a process ended too early.
    """
    from sgms_observer.nodes.conductor import Conductor, prepare_graph

    prepare_graph()
    config = write_config(folder, "mhe", publish_every, rate, axes)
    sent_file, heard_file = folder / f"sent_{rate}.npy", folder / f"heard_{rate}.npz"
    count = round(seconds * rate)
    with Conductor(folder / f"logs_{rate}") as conductor:
        observer = ["--ros-args", "--params-file", str(config)]
        conductor.start("observer_node", "sgms_observer.nodes.observer_node", observer)
        conductor.start("relay", "sgms_observer.bench.relay", [RELAYED])
        listener = ["--out", str(heard_file), _COMPENSATION, RELAYED]
        conductor.start("listener", "sgms_observer.bench.listener", listener)
        conductor.wait_active("observer_node")
        conductor.wait_subscribers({_COMPENSATION: 1, RELAYED: 1, "position": 2, "control_effort": 2})
        sending = ["--count", str(count), "--rate", str(rate), "--axes", str(axes), "--out", str(sent_file)]
        sending += ["--listeners", "2"]
        used = {name: seconds_used(conductor.process_id(name)) for name in ("observer_node", "relay")}
        conductor.start("publisher", "sgms_observer.bench.publisher", sending)
        conductor.wait(sent_file.exists, "the publisher to send everything")
        used = {name: seconds_used(conductor.process_id(name)) - before for name, before in used.items()}
        publisher = seconds_used(conductor.process_id("publisher"))
        for name in ("observer_node", "relay", "listener"):
            _wait_until_idle(conductor.process_id(name))
        for name in ("listener", "publisher", "relay", "observer_node"):
            conductor.stop(name)
    sent = np.load(sent_file)
    with np.load(heard_file) as heard:
        own = _received(sent, heard[_COMPENSATION], used["observer_node"] * rate / count)
        relay = _received(sent, heard[RELAYED], used["relay"] * rate / count)
    ratio = {key: round(own["latency_us"][key] / relay["latency_us"][key], 2) for key in ("p50", "p99")}
    late = _percentiles((sent[1] - sent[0]) * 1e-3)
    return {
        "rate_hz": rate,
        "sent": count,
        **own,
        "relay": relay,
        "over_relay": ratio,
        "seconds": seconds,
        "publisher_late_us": late,
        "publisher_cpu_share": round(publisher * rate / count, 3),
    }


def _received(sent: NDArray[np.int64], heard: NDArray[np.int64], cpu_share: float) -> dict[str, Any]:
    """Return what became of the samples on one way: lost ones, and the time from a sample's sending to its arrival."""
    _, place, arrived = np.intersect1d(sent[0], heard[0], return_indices=True)
    return {
        "lost": int(sent.shape[1] - place.size),
        "latency_us": _percentiles((heard[1, arrived] - sent[1, place]) * 1e-3),
        "cpu_share": round(cpu_share, 3),
    }


def _percentiles(times: NDArray[np.float64]) -> dict[str, float]:
    """Return median and 99 % of times [us]."""
    p50, p99 = np.percentile(times, (50.0, 99.0)) if times.size else (np.nan, np.nan)
    return {"p50": round(float(p50), 1), "p99": round(float(p99), 1)}


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
