"""Samples over the graph, one process per node: lost samples, and the latency from a sample to its compensation.

A relay node runs beside the observer. It has the same executor, subscribes to both topics and publishes one message for
each sample, and it computes nothing. Its latency is that of middleware, executor and machine.

A publisher delivers each message to one subscriber after the other, and waking a process takes as long as an estimate.
So each run has two halves: in one the publisher serves the observer first, in the other the relay.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.bench.process import RATE, seconds_used, write_config

RATES = (1_000, 2_000, RATE)
"""Samples per second of the live runs [Hz]."""

RELAYED = "bench_relayed"
"""Topic of the relay."""

_COMPENSATION = "friction_compensation"
_LOOK = 1.0  # s between two checks of a process
_IDLE = 0.05  # share of a core below which a process counts as idle
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
    from sgms_observer.nodes.conductor import prepare_graph

    prepare_graph()
    config = write_config(folder, "mhe", publish_every, rate, axes)
    orders = (("observer_node", "relay"), ("relay", "observer_node"))
    halves = [
        _run(folder / f"{rate}_{order[0]}_first", config, round(0.5 * seconds * rate), rate, axes, order)
        for order in orders
    ]
    observer, relay = (_together([half[name] for half in halves]) for name in ("observer_node", "relay"))
    late = np.concatenate([half["publisher"].delays for half in halves])
    return {
        "rate_hz": rate,
        "sent": sum(half["publisher"].count for half in halves),
        **observer.figures(),
        "relay": relay.figures(),
        "over_relay": _ratio(observer, relay),
        "over_relay_if_first": {
            order[0]: _ratio(half["observer_node"], half["relay"]) for order, half in zip(orders, halves, strict=True)
        },
        "seconds": seconds,
        "publisher_late_us": _percentiles(late),
        "publisher_cpu_share": _together([half["publisher"] for half in halves]).figures()["cpu_share"],
    }


@dataclass(frozen=True)
class _Way:
    """Counts and latencies of a run in one process.

    Attributes:
        count: samples sent.
        delays: from the sending of a sample to its arrival, of each that arrived [us].
        cpu: computing time [s].
        seconds: how long samples were sent [s].
    """

    count: int
    delays: Floats
    cpu: float
    seconds: float

    def figures(self) -> dict[str, Any]:
        """Return the entries of the JSON file."""
        return {
            "lost": self.count - len(self.delays),
            "latency_us": _percentiles(self.delays),
            "cpu_share": round(self.cpu / self.seconds, 3),
        }


def _together(ways: Sequence[_Way]) -> _Way:
    """Return the two halves of a run as one."""
    return _Way(
        sum(way.count for way in ways),
        np.concatenate([way.delays for way in ways]),
        sum(way.cpu for way in ways),
        sum(way.seconds for way in ways),
    )


def _ratio(observer: _Way, relay: _Way) -> dict[str, float]:
    """Return median and 99 % of the compensation over those of the relay."""
    of_relay = _percentiles(relay.delays)
    return {key: round(value / of_relay[key], 2) for key, value in _percentiles(observer.delays).items()}


def _run(folder: Path, config: Path, count: int, rate: int, axes: int, order: Sequence[str]) -> dict[str, _Way]:
    """Publish samples to the observer and the relay, which start in the given order and are served in it."""
    from sgms_observer.nodes.conductor import Conductor

    folder.mkdir()
    sent_file, heard_file = folder / "sent.npy", folder / "heard.npz"
    processes = {
        "observer_node": ("sgms_observer.nodes.observer_node", ["--ros-args", "--params-file", str(config)]),
        "relay": ("sgms_observer.bench.relay", [RELAYED]),
    }
    sending = ["--count", str(count), "--rate", str(rate), "--axes", str(axes), "--out", str(sent_file)]
    with Conductor(folder / "logs") as conductor:
        conductor.start("listener", "sgms_observer.bench.listener", ["--out", str(heard_file), _COMPENSATION, RELAYED])
        conductor.start("publisher", "sgms_observer.bench.publisher", [*sending, "--listeners", "2"])
        conductor.wait_publishers(("position", "control_effort"))
        for number, name in enumerate(order):
            conductor.start(name, *processes[name])
            if name == "observer_node":
                conductor.wait_active(name)
            conductor.wait_subscribers({"position": number + 1, "control_effort": number + 1})
        names = (*order, "publisher")
        before = {name: seconds_used(conductor.process_id(name)) for name in names}
        conductor.wait(sent_file.exists, "the publisher to send everything")
        used = {name: seconds_used(conductor.process_id(name)) - before[name] for name in names}
        for name in (*order, "listener"):
            _wait_until_idle(conductor.process_id(name))
        for name in ("listener", "publisher", "relay", "observer_node"):
            conductor.stop(name)
    sent = np.load(sent_file)
    with np.load(heard_file) as heard:
        delays = {"observer_node": _delays(sent, heard[_COMPENSATION]), "relay": _delays(sent, heard[RELAYED])}
    delays["publisher"] = (sent[1] - sent[0]) * 1e-3
    return {name: _Way(count, delays[name], used[name], count / rate) for name in names}


def _delays(sent: Ints, heard: Ints) -> Floats:
    """Return the time from a sample's sending to its arrival, of each that arrived [us]."""
    _, place, arrived = np.intersect1d(sent[0], heard[0], return_indices=True)
    delays: Floats = (heard[1, arrived] - sent[1, place]) * 1e-3
    return delays


def _percentiles(times: Floats) -> dict[str, float]:
    """Return median and 99 % of times [us]."""
    p50, p99 = np.percentile(times, (50.0, 99.0)) if times.size else (np.nan, np.nan)
    return {"p50": round(float(p50), 1), "p99": round(float(p99), 1)}


def _wait_until_idle(process_id: int) -> None:
    """Wait until a process has processed all of its messages."""
    end = time.monotonic() + _LONGEST_WAIT
    before = -1.0
    while time.monotonic() < end:
        now = seconds_used(process_id)
        if now - before < _IDLE * _LOOK:
            return
        before = now
        time.sleep(_LOOK)
