"""A revolute axis whose topics carry degrees and a torque of its own unit and sign, on the graph."""

from __future__ import annotations

import math

import numpy as np
from ros_graph import Graph, Start, wait_until
from std_srvs.srv import Trigger

from sgms_observer.bags.cdr import decode_joint_state
from sgms_observer.nodes.engine import Engine
from sgms_observer.settings.load import load_settings

DEGREE = math.pi / 180.0
MILLISECOND = 1_000_000
JOINT = f"""/**:
  ros__parameters:
    axes: [elbow]
    sample_period: 1.0e-3
    elbow:
      joint_type: revolute
      position_scale: {DEGREE!r}
      effort_scale: -0.01
      mass: 3.0
      friction: {{element_stiffness: [4.0e3, 1.0e3], element_fraction: [0.4, 0.6], static_force: 5.0,
                 coulomb_force: 4.0, stribeck_velocity: 0.02, viscous_coefficient: 2.0}}
      stage:
        controller: {{bandwidth: 20.0}}
        reference: {{kind: sine, amplitude: 0.1, frequency: 2.0}}
        encoder: {{noise: 1.0e-6}}
        force_noise: 0.01
      filter: {{window: 8.0e-3}}
      estimator: {{kind: mhe, correction_every: 2, parameters: [kappa]}}
      compensation: {{enabled: true, gain: 0.5}}
"""


def test_stage_and_observer_speak_degrees_and_estimate_in_si(graph: Graph, start: Start, tmp_path) -> None:
    topics = ("position", "control_effort", "reference", "friction_true", "friction_estimate", "friction_compensation")
    graph.listen(*topics)
    observer = start("observer_node", JOINT)
    start("stage_node", JOINT)
    graph.wait_messages("friction_estimate", 3000)
    decoded = {topic: [decode_joint_state(data) for data in list(graph.messages[topic])] for topic in topics}
    truth = {stamp: (position[0], effort[0]) for stamp, _, position, _, effort in decoded["friction_true"]}

    shared = [(position[0], truth[stamp][0]) for stamp, _, position, *_ in decoded["position"] if stamp in truth]
    degrees, radians = np.array(shared).T
    assert np.ptp(radians) > 0.1  # it moves, so that a wrong factor shows
    assert np.abs(DEGREE * degrees - radians).max() < 1e-5

    estimates = decoded["friction_estimate"]
    gaps = np.diff([estimate[0] for estimate in estimates]) > 2 * MILLISECOND
    settling = {k for i in [0, *np.flatnonzero(gaps) + 1] for k in range(i, i + 500)}
    pairs = [
        (effort[0], truth[stamp][1])
        for k, (stamp, *_, effort) in enumerate(estimates)
        if stamp in truth and k not in settling
    ]
    assert len(pairs) > 500
    estimate, friction = np.array(pairs).T
    assert np.ptp(friction) > 6.0
    assert np.sqrt(np.mean((estimate - friction) ** 2)) < 0.1 * np.ptp(friction)

    engine = Engine(load_settings(tmp_path / "observer_node.yaml"))
    first, last = estimates[0][0], min(decoded["position"][-1][0], decoded["control_effort"][-1][0])
    for (stamp, _, position, *_), (other, *_, effort) in zip(
        *(_from(first, decoded[topic]) for topic in ("position", "control_effort")), strict=False
    ):
        assert stamp == other
        engine.intake.pairings[0].push_position(stamp, position[0])
        engine.intake.pairings[0].push_effort(stamp, effort[0])
    again = {
        int(stamp): effort[0]
        for block in engine.process().blocks
        if block.topic == "friction_estimate"
        for stamp, effort in zip(block.stamp_ns, block.values["effort"], strict=True)
    }
    assert [again[stamp] for stamp, *_ in estimates if stamp < last] == [
        effort[0] for stamp, *_, effort in estimates if stamp < last
    ]

    sentence = "friction_compensation is in N m and control_effort is not; divide it by effort_scale = -0.01"
    wait_until(lambda: sentence in observer.text(), "the sentence about the compensation's unit")
    answer = graph.call(Trigger, "/observer_node/save_parameters", Trigger.Request())
    assert answer.success, answer.message
    assert "# N m/rad; learnt by observer_node" in (tmp_path / "learnt.yaml").read_text(encoding="utf-8")


def _from(first: int, messages: list) -> list:
    """Return the messages whose stamp is not before the first one that the node estimated at."""
    return [message for message in messages if message[0] >= first]
