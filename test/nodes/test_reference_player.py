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
from program import PATIENCE, start_program
from ros_graph import ONE_AXIS, Graph, Start, decode_joint_state, wait_until

from sgms_observer.bags.cdr import JointStateEncoder
from sgms_observer.bags.trajectory_cdr import decode_trajectory
from sgms_observer.compensation.horizon import EVERY
from sgms_observer.nodes.horizons import AHEAD, decode_horizons
from sgms_observer.nodes.set_points import braking

ROOT = Path(__file__).resolve().parents[2]
STATE, COMMAND = "/axis/joint_states", "/axis/command"


@settings(deadline=None)
@given(velocity=st.floats(-1.0, 1.0), acceleration=st.floats(0.05, 100.0), period=st.sampled_from([1e-4, 1e-3, 1e-2]))
def test_braking_ends_at_rest_within_the_deceleration(velocity: float, acceleration: float, period: float) -> None:
    _position, velocities = braking(0.0, velocity, acceleration, period)
    assert velocities[-1] == 0.0
    steps = np.abs(np.diff(np.concatenate([[velocity], velocities])))
    assert np.max(steps) <= acceleration * period * (1.0 + 1e-9) + 1e-15


def test_it_starts_where_the_table_stands_and_brakes_when_interrupted(graph: Graph, tmp_path: Path) -> None:
    """Its topics have other names. A busy machine may be too late: it comes to rest as well, and is started again."""
    (tmp_path / "axis.yaml").write_text(ONE_AXIS)
    graph.listen(COMMAND)
    for _ in range(10):
        graph.messages[COMMAND].clear()
        code, said = _interrupted_in_motion(graph, tmp_path)
        wait_until(lambda: decode_joint_state(graph.messages[COMMAND][-1])[3][0] == 0.0, "the rest at the end")
        states = [decode_joint_state(message) for message in graph.messages[COMMAND]]
        velocities = np.array([state[3][0] for state in states])
        assert states[0][2][0] == 0.3
        assert velocities[-1] == 0.0
        assert np.max(np.abs(np.diff(velocities))) <= 0.05 * 1e-3 * 1.02
        if code == 0:
            break
        assert code == 1 and "the machine was busy" in said and said.count("\n") == 1, said
    assert code == 0 and "brought to rest" in said


def test_the_motion_is_told_ahead_and_the_observer_compensates_ahead(
    graph: Graph, start: Start, tmp_path: Path
) -> None:
    """The stage follows ``reference``, the observer gives a horizon along what is told ahead of it."""
    mine = ONE_AXIS.replace("stage: {", "compensation: {enabled: true}\n      stage: {reference: {kind: topic}, ")
    graph.listen("reference", "reference_horizon", "compensation_horizon")
    start("stage_node", mine)
    start("observer_node", mine)
    graph.meet("observer_node")
    excited = start_program(
        "sgms_observer", ["excite", "--config", "stage_node.yaml", "--publish", "--duration", "8"], tmp_path,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    )  # fmt: skip
    said, _ = excited.communicate(timeout=PATIENCE)
    assert excited.returncode == 0, said
    states = [decode_joint_state(message) for message in graph.messages["reference"]]
    sent = {state[0]: (state[2][0], state[3][0]) for state in states}
    span = (max(sent) - min(sent)) * 1e-9
    told = [decode_trajectory(message) for message in graph.messages["reference_horizon"]]
    assert len(told) > 0.5 * span / EVERY
    for ahead in told:
        positions, velocities = ahead.values["positions"][:, 0], ahead.values["velocities"][:, 0]
        inside = [i for i, stamp in enumerate(ahead.time_ns.tolist()) if stamp in sent]
        assert all(sent[int(ahead.time_ns[i])] == (positions[i], velocities[i]) for i in inside)
        assert inside and (ahead.time_ns[-1] - ahead.time_ns[0]) * 1e-9 > AHEAD
    forces = [decode_horizons(message)["x"].effort for message in graph.messages["compensation_horizon"]]
    acting = sum(np.abs(force).max() > 0.5 for force in forces)
    assert acting > 0.5 * span / EVERY, f"{acting} of {len(forces)} horizons with a force in {span:g} s"


def _interrupted_in_motion(graph: Graph, folder: Path) -> tuple[int, str]:
    """Play a reference, interrupt it when it moves fast; return exit code and what was said last."""
    command = [sys.executable, "-m", "sgms_observer.cli.main", "excite", "--config", str(folder / "axis.yaml")]
    process = subprocess.Popen(
        [
            *command,
            "--publish",
            "--acceleration",
            "0.05",
            "--topic",
            f"position={STATE}",
            "--topic",
            f"reference={COMMAND}",
        ],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
    )
    try:
        send = graph.publisher(STATE)
        encode = JointStateEncoder(("x",), ("position",)).encode

        def is_moving() -> bool:
            send(encode(1, [0.3]))
            moves = any(decode_joint_state(message)[3][0] > 1e-4 for message in graph.messages[COMMAND][-5:])
            return moves or process.poll() is not None

        wait_until(is_moving, "a reference in motion")
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    return process.returncode, errors if process.returncode else output
