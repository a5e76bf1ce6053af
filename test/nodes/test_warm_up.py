"""A node that is ready compiles nothing any more: on a busy machine that would hold it up for seconds."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from program import PATIENCE

from sgms_observer import jit

ROOT = Path(__file__).resolve().parents[2]

#: In a process of its own: in this one, other tests may have compiled what is missing.
CODE = """
import gc, sys
import numpy as np
from numba.core.dispatcher import Dispatcher
from sgms_observer.bags.rows import encode_joint_states, warm_up_encoding
from sgms_observer.nodes.engine import Engine
from sgms_observer.settings.load import load_settings
from sim_plant.table import SimulatedTable

def compiled():
    found = [item for item in gc.get_objects() if isinstance(item, Dispatcher)]
    return {f"{item.py_func.__module__}.{item.py_func.__qualname__}": len(item.overloads) for item in found}

for file in sys.argv[1:]:
    settings = load_settings(file)
    engine = Engine(settings)
    warm_up_encoding()
    engine.warm_up()
    SimulatedTable(settings).step(2)
    table = SimulatedTable(settings, 1_000_000_000)
    before = compiled()
    assert before
    for _ in range(20):
        for number, record in enumerate(table.step(100)):
            samples, pairing = record.samples, engine.intake.pairings[number]
            encode_joint_states(samples.stamp_ns, ("x",), {"effort": samples.effort[:, None]})
            for i, stamp in enumerate(samples.stamp_ns.tolist()):
                pairing.push_reference(stamp, samples.reference_position[i], samples.reference_velocity[i])
                pairing.push_position(stamp, samples.position[i])
                pairing.push_effort(stamp, samples.effort[i])
        for block in engine.process().blocks:
            encode_joint_states(block.stamp_ns, block.names, dict(block.values))
    engine.reset()
    after = compiled()
    print(*[name for name in after if after[name] != before.get(name, 0)])
"""


@pytest.mark.skipif(not jit.HAS_NUMBA, reason="without numba nothing is compiled")
def test_nothing_is_compiled_once_a_node_is_ready() -> None:
    files = [str(ROOT / "config" / f"{name}.yaml") for name in ("demo", "table", "emps")]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])}
    command = [sys.executable, "-c", CODE, *files]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == []
