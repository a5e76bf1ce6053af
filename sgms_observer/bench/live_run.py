"""Samples over the graph, one process per node: lost samples, and the latency from a sample to its compensation.

A relay node runs beside the observer. It has the same executor, subscribes to both topics and publishes one message for
each sample, and it computes nothing. Its latency is that of middleware, executor and machine.

A publisher delivers each message to one subscriber after the other, and waking a process takes as long as an estimate.
So each run has two halves: in one the publisher serves the observer first, in the other the relay.

The publisher sends probe samples until the listener has got a message from the observer and one from the relay. Only
then it sends the samples that count: a message that is published before the listener is matched is lost.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.bench.process import RATE, seconds_used, write_config

if TYPE_CHECKING:
    from sgms_observer.nodes.conductor import Conductor

RATES = (1_000, 2_000, RATE)
"""Samples per second of the live runs [Hz]."""

RELAYED = "bench_relayed"
"""Topic of the relay."""

_COMPENSATION = "friction_compensation"
_LOOK = 1.0  # s between two checks of a process
_IDLE = 0.05  # share of a core below which a process counts as idle
_LONGEST_WAIT = 60.0  # s
_MAX_LATE_SHARE = 0.1  # of the samples that the publisher sends more than one sample period late


def time_live(
    folder: Path, seconds: float, publish_every: int = 1, rate: int = RATE, axes: int = 1
) -> tuple[dict[str, Any], list[str]]:
    """Publish samples from one process, observe in another, relay in a third, listen in a fourth.

    Args:
        folder: for parameter file, logs and times.
        seconds: how long to publish [s].
        publish_every: samples from one published estimate to the next.
        rate: samples per second [Hz].
        axes: how many there are in each message.

    Returns:
        The entries of ``live`` in the JSON file, for one rate, and the warnings. A figure of no message is None.

    Raises:
        DataError: a process ended too early, or the listener got no message of the observer or of the relay.
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
    publisher = _together([half["publisher"] for half in halves])
    figures = {
        "rate_hz": rate,
        "sent": publisher.count,
        **observer.figures(),
        "relay": relay.figures(),
        "over_relay": _ratio(observer, relay),
        "over_relay_if_first": {
            order[0]: _ratio(half["observer_node"], half["relay"]) for order, half in zip(orders, halves, strict=True)
        },
        "seconds": seconds,
        "publisher_late_us": _percentiles(publisher.delays),
        "publisher_cpu_share": publisher.figures()["cpu_share"],
    }
    return figures, _warnings(rate, {order[0]: half for order, half in zip(orders, halves, strict=True)})


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


def _warnings(rate: int, halves: Mapping[str, Mapping[str, _Way]]) -> list[str]:
    """Return one sentence for each reason why figures of a run are not valid.

    Args:
        rate: samples per second [Hz].
        halves: the process that is served first in a half, to the ways of its processes.
    """
    sentences = [
        f"the live run at {rate} Hz lost all {half[name].count} messages of {name} in the half in which {first} is"
        " served first, so the latencies and ratios of this run are not valid; repeat it with less load on the machine"
        for first, half in halves.items()
        for name in ("observer_node", "relay")
        if not half[name].delays.size
    ]
    lateness = _together([half["publisher"] for half in halves.values()]).delays
    late_share = float(np.mean(lateness > 1e6 / rate))
    if late_share > _MAX_LATE_SHARE:
        sentences.append(
            f"the publisher of the live run at {rate} Hz sent {100.0 * late_share:.0f} % of the samples more than one"
            " sample period late, so the latencies and ratios are not valid for this rate; repeat the run with less"
            " load on the machine"
        )
    return sentences


def _ratio(observer: _Way, relay: _Way) -> dict[str, float | None]:
    """Return median and 99 % of the compensation over those of the relay; None where one of the two has no message."""
    pairs = {key: (value, _percentiles(relay.delays)[key]) for key, value in _percentiles(observer.delays).items()}
    return {key: round(over / under, 2) if over and under else None for key, (over, under) in pairs.items()}


def _run(folder: Path, config: Path, count: int, rate: int, axes: int, order: Sequence[str]) -> dict[str, _Way]:
    """Publish samples to the observer and the relay, which start in the given order and are served in it."""
    from sgms_observer.nodes.conductor import Conductor

    folder.mkdir()
    sent_file, heard_file, go_file = folder / "sent.npy", folder / "heard.npz", folder / "go"
    processes = {
        "observer_node": ("sgms_observer.nodes.observer_node", ["--ros-args", "--params-file", str(config)]),
        "relay": ("sgms_observer.bench.relay", [RELAYED]),
    }
    answers = {"observer_node": _COMPENSATION, "relay": RELAYED}
    sending = ["--count", str(count), "--rate", str(rate), "--axes", str(axes), "--out", str(sent_file)]
    sending += ["--listeners", str(len(order)), "--go", str(go_file)]
    with Conductor(folder / "logs") as conductor:
        conductor.start("listener", "sgms_observer.bench.listener", ["--out", str(heard_file), *answers.values()])
        conductor.start("publisher", "sgms_observer.bench.publisher", sending)
        for name in order:
            conductor.start(name, *processes[name])
            if name == "observer_node":
                conductor.wait_active(name)
            _wait_first_message(conductor, answers[name])
        names = (*order, "publisher")
        before = {name: seconds_used(conductor.process_id(name)) for name in names}
        go_file.touch()
        conductor.wait(sent_file.exists, "the publisher to send everything")
        used = {name: seconds_used(conductor.process_id(name)) - before[name] for name in names}
        for name in (*order, "listener"):
            _wait_until_idle(conductor.process_id(name))
        for name in ("listener", "publisher", "relay", "observer_node"):
            conductor.stop(name)
    sent = np.load(sent_file)
    with np.load(heard_file) as heard:
        delays = {name: _delays(sent, heard[topic]) for name, topic in answers.items()}
    delays["publisher"] = (sent[1] - sent[0]) * 1e-3
    return {name: _Way(count, delays[name], used[name], count / rate) for name in names}


def _wait_first_message(conductor: Conductor, topic: str) -> None:
    """Wait until the listener has got a message of a topic: from then on it is matched with the topic's publisher."""
    from sgms_observer.bench.listener import first_message

    line = first_message(topic)
    conductor.wait(lambda: line in conductor.output_of("listener"), f"the listener to get a message of {topic}")


def _delays(sent: Ints, heard: Ints) -> Floats:
    """Return the time from a sample's sending to its arrival, of each that arrived [us]."""
    _, place, arrived = np.intersect1d(sent[0], heard[0], return_indices=True)
    delays: Floats = (heard[1, arrived] - sent[1, place]) * 1e-3
    return delays


def _percentiles(times: Floats) -> dict[str, float | None]:
    """Return median and 99 % of times [us]; None if there are no times."""
    if not times.size:
        return {"p50": None, "p99": None}
    p50, p99 = np.percentile(times, (50.0, 99.0))
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
