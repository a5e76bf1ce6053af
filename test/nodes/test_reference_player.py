"""``sgms excite --publish``: starts where the table stands, and comes to rest when it is interrupted."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from program import PATIENCE
from ros_graph import ONE_AXIS, Graph, wait_until

from sgms_observer.bags.cdr import JointStateEncoder, decode_joint_state
from sgms_observer.nodes.reference_player import braking

ROOT = Path(__file__).resolve().parents[2]


@settings(deadline=None)
@given(
    velocity=st.floats(-1.0, 1.0), acceleration=st.floats(0.05, 100.0), period=st.sampled_from([1e-4, 1e-3, 1e-2])
)
def test_braking_ends_at_rest_within_the_deceleration(velocity: float, acceleration: float, period: float) -> None:
    _position, velocities = braking(0.0, velocity, acceleration, period)
    assert velocities[-1] == 0.0
    steps = np.abs(np.diff(np.concatenate([[velocity], velocities])))
    assert np.max(steps) <= acceleration * period * (1.0 + 1e-9) + 1e-15


def test_it_starts_where_the_table_stands_and_brakes_when_interrupted(graph: Graph, tmp_path: Path) -> None:
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    graph.listen("reference")
    command = [sys.executable, "-m", "sgms_observer.cli.main", "excite", "--config", str(tmp_path / "axis.yaml")]
    process = subprocess.Popen(
        [*command, "--publish", "--acceleration", "0.05"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
    )
    try:
        send = graph.publisher("position")
        encode = JointStateEncoder(("x",), ("position",)).encode

        def is_moving() -> bool:
            send(encode(1, [0.3]))
            return any(decode_joint_state(message)[3][0] > 1e-4 for message in graph.messages["reference"][-5:])

        wait_until(is_moving, "a reference in motion")
        process.send_signal(signal.SIGINT)
        output, _errors = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    states = [decode_joint_state(message) for message in graph.messages["reference"]]
    velocities = np.array([state[3][0] for state in states])
    assert process.returncode == 0
    assert "brought to rest" in output
    assert states[0][2][0] == 0.3
    assert velocities[-1] == 0.0
    assert np.max(np.abs(np.diff(velocities))) <= 0.05 * 1e-3 * 1.02
