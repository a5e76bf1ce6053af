"""Endurance: an hour of samples at 10 kHz through the node's own path, and ten minutes over the live graph.

    python benchmarks/endurance.py                          # all of it: about two hours
    python benchmarks/endurance.py --samples 2000000 --live 60

Three things are watched: memory (resident size, looked at all the time), samples (every one that goes in has to come
out), and numbers (every estimate has to equal, to the last bit, what replay computes from the same samples in blocks).
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.bags.blocks import encode_joint_states
from sgms_observer.bags.diagnostics_cdr import encode_diagnostics
from sgms_observer.cli.progress import Progress
from sgms_observer.nodes.engine import Engine
from sgms_observer.nodes.report import axis_entry, node_entry, parameter_entry
from sgms_observer.nodes.statistics import Growth
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.outgoing import COMPENSATION, ESTIMATE, STD
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.load import load_settings, settings_from_tree

RATE = 10_000  # Hz
PERIOD_NS = 1_000_000_000 // RATE
START_NS = 1_700_000_000_000_000_000
HOUR = 3600 * RATE  # samples
TEN_MINUTES = 600.0  # s
SEED = 11
LARGEST_STEP = 8  # samples of one turn of the node
AXIS = {
    "mass": 10.0,
    "estimator": {"kind": "mhe", "parameters": ["kappa"]},
    "compensation": {"enabled": True, "limit": 6.0},
}
COMPARED = {ESTIMATE: "friction", STD: "friction_std", COMPENSATION: "compensation"}


def resident_mb(process_id: int | None = None) -> float:
    """Return the resident memory of a process [MB]."""
    pages = int(Path(f"/proc/{process_id or 'self'}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def chunks(count: int) -> Iterator[Samples]:
    """Yield a second of samples at a time: a sine of 200 um at 5 Hz with noise, as an XY table would measure it."""
    chance = np.random.default_rng(SEED)
    for first in range(0, count, RATE):
        k = np.arange(first, min(first + RATE, count))
        phase = 2.0 * np.pi * 5.0 * (k % RATE) / RATE
        position = 200e-6 * np.sin(phase)
        velocity = 200e-6 * 10.0 * np.pi * np.cos(phase)
        friction = 4.0 * np.tanh(velocity / 2e-4)
        effort = friction - 10.0 * (10.0 * np.pi) ** 2 * position + 0.02 * chance.normal(size=k.size)
        measured = position + 5e-9 * chance.normal(size=k.size)
        yield Samples(START_NS + k * PERIOD_NS, measured, effort, position, velocity)


def through_the_node(count: int) -> dict[str, Any]:
    """Send samples as messages through the node's callbacks and compare with replay's way of the same samples.

    Args:
        count: number of samples.

    Returns:
        What was measured.
    """
    settings = settings_from_tree({"sample_period": 1.0 / RATE, "axes": ["x"], "x": AXIS})
    engine = Engine(settings)
    engine.warm_up()
    replay = AxisObserver(settings.axes[0], settings.sample_period)
    chance = np.random.default_rng(SEED + 1)
    growth = Growth()
    memory: list[float] = []
    came_out = wrong = sent = 0
    largest = 0.0
    start = time.process_time()
    in_node = 0.0
    with Progress("through the node", count) as progress:
        for samples in chunks(count):
            before = time.process_time()
            found = _turns(engine, samples, chance)
            _report(engine, growth, sent)
            in_node += time.process_time() - before
            expected = replay.step(samples)
            sent += len(samples.stamp_ns)
            came_out += len(found[ESTIMATE])
            for topic, field in COMPARED.items():
                wanted = getattr(expected, field)
                if len(found[topic]) != len(wanted):
                    wrong += abs(len(wanted) - len(found[topic]))
                    continue
                wrong += int(np.count_nonzero(found[topic] != wanted))
                largest = max(largest, float(np.abs(found[topic] - wanted).max()))
            memory.append(resident_mb())
            progress.show(sent)
    settled = memory[len(memory) // 10 :]
    return {
        "samples": sent,
        "lost": sent - came_out,
        "numbers_that_differ_from_replay": wrong,
        "largest_difference_n": largest,
        "memory_mb": {"after_a_tenth": settled[0], "at_the_end": settled[-1], "largest": max(settled)},
        "growth_mb_per_hour": _slope(settled) * 3600.0,
        "us_per_sample": in_node / sent * 1e6,
        "cpu_seconds": time.process_time() - start,
    }


def _turns(engine: Engine, samples: Samples, chance: np.random.Generator) -> dict[str, np.ndarray]:
    """Give a second of samples to the node's callbacks, a few per turn, and return what it publishes."""
    intake = engine.intake
    stamps = samples.stamp_ns
    position = encode_joint_states(stamps, ("x",), {"position": samples.position[:, None]})
    effort = encode_joint_states(stamps, ("x",), {"effort": samples.effort[:, None]})
    set_points = {"position": samples.reference_position[:, None], "velocity": samples.reference_velocity[:, None]}
    reference = encode_joint_states(stamps, ("x",), set_points)
    found: dict[str, list[np.ndarray]] = {topic: [] for topic in COMPARED}
    at = 0
    while at < len(stamps):
        end = min(len(stamps), at + int(chance.integers(1, LARGEST_STEP + 1)))
        for i in range(at, end):
            intake.reference(reference[i].tobytes())
            intake.position(position[i].tobytes())
            intake.effort(effort[i].tobytes())
        processed = engine.process()
        for block in processed.blocks:
            encode_joint_states(block.stamp_ns, block.names, dict(block.values))
            if block.topic in COMPARED:
                found[block.topic].append(block.values["effort"][:, 0].copy())
        for report in processed.reports:
            encode_diagnostics(report.stamp_ns, [parameter_entry(report)])
        at = end
    return {topic: np.concatenate(parts) for topic, parts in found.items()}


def _report(engine: Engine, growth: Growth, now: int) -> None:
    """Do what the node does once a second for its diagnostics."""
    counts, pairing = engine.intake.counts, engine.intake.pairings[0].counts
    new = growth.take("messages", counts)
    entries = [node_entry("node", engine.axes, "active", counts, new, engine.clock.take(), 0, 1.0)]
    entries.append(axis_entry("node", "x", engine.statistics[0], pairing, growth.take("x", pairing), 1.0))
    engine.statistics[0].start_anew()
    encode_diagnostics(now, entries)


def _slope(values: list[float]) -> float:
    """Return the slope of a line through values, per step."""
    return float(np.polyfit(np.arange(len(values)), values, 1)[0]) if len(values) > 2 else 0.0


def over_the_graph(seconds: float, folder: Path) -> dict[str, Any]:
    """Publish in one process, observe in another, listen in a third; compare every estimate with replay's.

    Args:
        seconds: how long [s].
        folder: for parameter file, logs and what was heard.

    Returns:
        What was measured.
    """
    from sgms_observer.bench.problem import AMPLITUDE, FREQUENCY, PERIOD, make_problem
    from sgms_observer.bench.scene import write_config
    from sgms_observer.nodes.conductor import Conductor, prepare_graph

    prepare_graph()
    config = write_config(folder, "mhe")
    sent_file, heard_file = folder / "sent.npy", folder / "heard.npy"
    count = round(seconds * RATE)
    memory: list[float] = []
    with Conductor(folder / "logs") as conductor, Progress("over the graph", seconds) as progress:
        conductor.start("observer_node", "sgms_observer.nodes.observer_node", ["--config", str(config)])
        conductor.start("listener", __file__, ["--listen", str(heard_file)])
        conductor.wait_active("observer_node")
        conductor.wait_subscribers({"friction_estimate": 1})
        conductor.start("publisher", "sgms_observer.nodes.bench_publisher", ["--count", str(count), "--out", str(sent_file)])  # noqa: E501
        start = time.monotonic()
        while not sent_file.exists():
            memory.append(resident_mb(conductor.process_id("observer_node")))
            progress.show(time.monotonic() - start)
            conductor.check()
            time.sleep(1.0)
        time.sleep(5.0)  # what is on its way arrives
        conductor.stop("listener")
        conductor.stop("publisher")
        conductor.stop("observer_node")
    stamps = np.load(sent_file)[0]
    heard_stamps, heard = np.load(heard_file)
    heard_stamps = heard_stamps.view(np.int64)
    size = round(1.0 / (FREQUENCY * PERIOD))
    k = np.arange(count) % size
    effort = make_problem(windows=size // 10).effort[size : 2 * size][k]
    nothing = np.full(count, np.nan)
    position = (AMPLITUDE * np.sin(2.0 * np.pi * np.arange(size) / size))[k]
    settings = load_settings(config)
    observer = AxisObserver(settings.axes[0], settings.sample_period)
    expected = np.concatenate([
        observer.step(Samples(*(column[first : first + RATE] for column in (stamps, position, effort, nothing, nothing)))).friction  # noqa: E501
        for first in range(0, count, RATE)
    ])  # fmt: skip
    common, wanted, got = np.intersect1d(stamps, heard_stamps, return_indices=True)
    settled = memory[len(memory) // 5 :]
    return {
        "seconds": seconds,
        "sent": count,
        "lost": count - int(common.size),
        "numbers_that_differ_from_replay": int(np.count_nonzero(expected[wanted] != heard[got])),
        "largest_difference_n": float(np.abs(expected[wanted] - heard[got]).max(initial=0.0)),
        "memory_mb": {"after_a_fifth": settled[0], "at_the_end": settled[-1], "largest": max(settled)},
        "growth_mb_per_hour": _slope(settled) * 3600.0,
    }


def listen(out: Path) -> None:
    """Keep stamp and friction of every estimate until told to stop, then write them to a file, shape (2, n)."""
    import rclpy
    from rclpy.executors import ExternalShutdownException
    from rclpy.task import Future

    from sgms_observer.nodes.spin import make_executor
    from sgms_observer.nodes.topics import subscribe
    from sgms_observer.nodes.transport import use_shipped_transport

    use_shipped_transport()
    rclpy.init(args=[])
    node = rclpy.create_node("endurance_listener")
    kept = bytearray()

    def take(message: bytes) -> None:
        kept.extend(message[4:12])
        kept.extend(message[-8:])  # the effort of the only axis ends the message

    subscribe(node, "friction_estimate", take)
    executor = make_executor()
    executor.add_node(node)
    never: Future[None] = Future()
    try:
        while rclpy.ok():
            executor.spin_until_future_complete(never, timeout_sec=3600.0)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parts = np.frombuffer(bytes(kept), np.dtype([("sec", "<i4"), ("nanosec", "<u4"), ("friction", "<f8")]))
    stamps = parts["sec"].astype(np.int64) * 1_000_000_000 + parts["nanosec"]
    np.save(out, np.stack([stamps.view(np.float64), parts["friction"]]))
    rclpy.try_shutdown()


def main() -> int:
    """Run from the command line; the exit code is 0 only if nothing was lost, differs or grows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--samples", type=int, default=HOUR, help="samples through the node's path; 0 for none")
    parser.add_argument("--live", type=float, default=TEN_MINUTES, metavar="S", help="time over the graph [s]; 0 for none")  # noqa: E501
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there as well")
    parser.add_argument("--listen", type=Path, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.listen is not None:
        listen(args.listen)
        return 0
    result: dict[str, Any] = {}
    if args.samples > 0:
        result["through_the_node"] = through_the_node(args.samples)
    if args.live > 0.0:
        with tempfile.TemporaryDirectory(prefix="sgms-endurance-") as folder:
            result["over_the_graph"] = over_the_graph(args.live, Path(folder))
    for part, figures in result.items():
        print(part.replace("_", " "))
        for name, value in figures.items():
            shown = ", ".join(f"{k} {v:.1f}" for k, v in value.items()) if isinstance(value, dict) else f"{value:.6g}"
            print(f"  {name.replace('_', ' '):34s} {shown}")
    if args.json is not None:
        args.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    is_good = all(f["lost"] == 0 and f["numbers_that_differ_from_replay"] == 0 for f in result.values())
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
