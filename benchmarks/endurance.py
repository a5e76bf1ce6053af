"""Endurance: an hour of samples at 10 kHz through the node's own path, and ten minutes over the live graph.

    python benchmarks/endurance.py                          # all of it: about an hour
    python benchmarks/endurance.py --samples 2000000 --live 60

Three things are watched: memory (resident size, looked at all the time), samples (every one that goes in has to come
out), and numbers (every estimate has to equal, to the last bit, what replay computes from the same samples in blocks).
The exit code is 0 only if nothing was lost, nothing differs, and memory did not grow once it had settled.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from endurance_graph import over_the_graph
from endurance_memory import Memory

from sgms_observer.bags.diagnostics_cdr import encode_diagnostics, parameter_entry
from sgms_observer.bags.rows import encode_joint_states
from sgms_observer.cli.progress import Progress
from sgms_observer.nodes.engine import Engine
from sgms_observer.nodes.report import axis_entry, node_entry
from sgms_observer.nodes.statistics import Growth
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.outgoing import COMPENSATION, ESTIMATE, STD
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.load import settings_from_tree

RATE = 10_000  # Hz
PERIOD_NS = 1_000_000_000 // RATE
START_NS = 1_700_000_000_000_000_000
HOUR = 3600 * RATE  # samples
TEN_MINUTES = 600.0  # s
SEED = 11
LARGEST_STEP = 8  # samples of one turn of the node
LARGEST_GROWTH = 2.0  # MB of resident memory, from where it settled to the end
AXIS = {
    "mass": 10.0,
    "estimator": {"kind": "mhe", "parameters": ["kappa"]},
    "compensation": {"enabled": True, "limit": 6.0},
}
COMPARED = {ESTIMATE: "friction", STD: "friction_std", COMPENSATION: "compensation"}


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
    memory = Memory()
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
            memory.look()
            progress.show(sent)
    return {
        "samples": sent,
        "lost": sent - came_out,
        "numbers_that_differ_from_replay": wrong,
        "largest_difference_n": largest,
        "memory_mb": memory.figures(),
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


def main() -> int:
    """Run from the command line; the exit code is 0 only if nothing was lost, differs or grows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--samples", type=int, default=HOUR, help="samples through the node's path; 0 for none")
    add("--live", type=float, default=TEN_MINUTES, metavar="S", help="time over the graph [s]; 0 for none")
    add("--json", type=Path, metavar="FILE", help="write the figures there as well")
    args = parser.parse_args()
    result: dict[str, dict[str, Any]] = {}
    if args.samples > 0:
        result["through_the_node"] = through_the_node(args.samples)
    if args.live > 0.0:
        with tempfile.TemporaryDirectory(prefix="sgms-endurance-") as folder:
            result["over_the_graph"] = over_the_graph(args.live, Path(folder))
    for part, figures in result.items():
        print(part.replace("_", " "))
        for name, value in figures.items():
            shown = ", ".join(f"{k} {v:.1f}" for k, v in value.items()) if isinstance(value, dict) else f"{value:.8g}"
            print(f"  {name.replace('_', ' '):34s} {shown}")
    if args.json is not None:
        args.json.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    return 0 if all(is_good(figures) for figures in result.values()) else 1


def is_good(figures: dict[str, Any]) -> bool:
    """Return whether nothing was lost, nothing differs from replay, and memory stayed where it had settled."""
    memory = figures["memory_mb"]
    has_grown = memory["at_the_end"] - memory["settled"] > LARGEST_GROWTH
    return figures["lost"] == 0 and figures["numbers_that_differ_from_replay"] == 0 and not has_grown


if __name__ == "__main__":
    sys.exit(main())
