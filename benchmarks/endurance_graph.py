"""A long run over the live graph: one process publishes, one observes, one listens; compared with replay's numbers."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import numpy as np
from endurance_memory import Memory

from sgms_observer.bench.problem import AMPLITUDE, FREQUENCY, PERIOD, make_problem
from sgms_observer.bench.process import write_config
from sgms_observer.cli.compile import compile_or_warn
from sgms_observer.cli.progress import Progress
from sgms_observer.nodes.conductor import Conductor, prepare_graph
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.load import load_settings

RATE = round(1.0 / PERIOD)  # Hz
TOPIC = "friction_estimate"
ARRIVAL = 5.0  # s in which what is on its way arrives


def over_the_graph(seconds: float, folder: Path) -> dict[str, Any]:
    """Publish in one process, observe in another, listen in a third; compare every estimate with replay's.

    Args:
        seconds: how long [s].
        folder: for parameter file, logs and what was heard.

    Returns:
        What was measured.
    """
    compile_or_warn()
    prepare_graph()
    config = write_config(folder, "mhe")
    sent_file, heard_file = folder / "sent.npy", folder / "heard.npz"
    count = round(seconds * RATE)
    with Conductor(folder / "logs") as conductor, Progress("over the graph", seconds) as progress:
        conductor.start("observer_node", "sgms_observer.nodes.observer_node", ["--config", str(config)])
        listener = ["--out", str(heard_file), TOPIC]
        conductor.start("listener", "sgms_observer.bench.listener", listener)
        conductor.wait_active("observer_node")
        conductor.wait_subscribers({TOPIC: 1})
        memory = Memory(conductor.process_id("observer_node"))
        publisher = ["--count", str(count), "--rate", str(RATE), "--out", str(sent_file)]
        conductor.start("publisher", "sgms_observer.bench.publisher", publisher)
        start = time.monotonic()
        while not sent_file.exists():
            memory.look()
            progress.show(min(seconds, time.monotonic() - start))
            conductor.watch()
            time.sleep(1.0)
        time.sleep(ARRIVAL)
        for name in ("listener", "publisher", "observer_node"):
            conductor.stop(name)
    stamps = np.load(sent_file)[0]
    with np.load(heard_file) as topics:
        heard_stamps, _, heard_bits = topics[TOPIC]
    expected = expected_friction(config, stamps)
    _, wanted, got = np.intersect1d(stamps, heard_stamps, return_indices=True)
    heard = heard_bits.view(np.float64)[got]
    return {
        "seconds": seconds,
        "sent": count,
        "lost": count - int(wanted.size),
        "numbers_that_differ_from_replay": int(np.count_nonzero(expected[wanted] != heard)),
        "largest_difference_n": float(np.abs(expected[wanted] - heard).max(initial=0.0)),
        "memory_mb": memory.figures(),
    }


def expected_friction(config: Path, stamps: np.ndarray) -> np.ndarray:
    """Return the friction [N] that replay estimates at each sample of the publisher.

    Args:
        config: the parameter file of the node.
        stamps: of the samples [ns].
    """
    size = round(1.0 / (FREQUENCY * PERIOD))
    place = np.arange(stamps.size) % size
    effort = make_problem(windows=size // 10).effort[size : 2 * size][place]
    position = (AMPLITUDE * np.sin(2.0 * np.pi * np.arange(size) / size))[place]
    nothing = np.full(stamps.size, np.nan)
    settings = load_settings(config)
    observer = AxisObserver(settings.axes[0], settings.sample_period)
    parts = []
    for first in range(0, stamps.size, RATE):
        columns = (column[first : first + RATE] for column in (stamps, position, effort, nothing, nothing))
        parts.append(observer.step(Samples(*columns)).friction)
    return np.concatenate(parts)
