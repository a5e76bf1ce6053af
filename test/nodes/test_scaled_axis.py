"""A revolute axis whose topics carry degrees and a torque of its own unit and sign, on the graph."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from ros_graph import Graph, Sender, Start, decode_joint_state, wait_until
from std_srvs.srv import Trigger

from sgms_observer.nodes.engine import Engine
from sgms_observer.settings.load import load_settings

DEGREE = math.pi / 180.0
MILLISECOND = 1_000_000
START_NS = 1_700_000_000_000_000_000
SENT = 600  # samples that the test sends before the stage starts
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
      effects: {{names: [gravity], gravity: {{amplitude: 8.0, angle: 0.3}}}}
      stage:
        controller: {{bandwidth: 20.0}}
        reference: {{kind: sine, amplitude: 0.1, frequency: 2.0}}
        encoder: {{noise: 1.0e-6}}
        force_noise: 0.01
      filter: {{window: 8.0e-3}}
      estimator: {{kind: mhe, correction_every: 2, parameters: [kappa]}}
      compensation: {{enabled: true, gain: 0.5}}
"""


def test_observer_and_stage_speak_degrees_and_estimate_in_si(graph: Graph, start: Start, tmp_path: Path) -> None:
    topics = ("position", "friction_true", "friction_estimate")
    graph.listen(*topics)
    observer = start("observer_node", JOINT)
    assert _is_what_the_engine_gives(graph, tmp_path / "observer_node.yaml")

    start("stage_node", JOINT)
    graph.wait_messages("friction_true", 3000)
    graph.wait_messages("friction_estimate", SENT + 2500)
    decoded = {topic: [decode_joint_state(data) for data in list(graph.messages[topic])] for topic in topics}
    truth = {stamp: (position[0], effort[0]) for stamp, _, position, _, effort in decoded["friction_true"]}

    shared = [(position[0], truth[stamp][0]) for stamp, _, position, *_ in decoded["position"] if stamp in truth]
    degrees, radians = np.array(shared).T
    assert np.ptp(radians) > 0.1  # it moves, so that a wrong factor shows
    assert np.abs(DEGREE * degrees - radians).max() < 1e-5

    estimates = decoded["friction_estimate"][SENT:]
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

    sentence = "friction_compensation is in N m and control_effort is not; divide it by effort_scale = -0.01"
    wait_until(lambda: sentence in observer.text(), "the sentence about the compensation's unit")
    answer = graph.call(Trigger, "/observer_node/save_parameters", Trigger.Request())
    assert answer.success, answer.message
    assert "# N m/rad; learnt by observer_node" in (tmp_path / "learnt.yaml").read_text(encoding="utf-8")


def _is_what_the_engine_gives(graph: Graph, config: Path) -> bool:
    """Send samples in degrees; return whether the node's estimates are the engine's to the last bit."""
    seconds = 1.0e-3 * np.arange(SENT)
    position = 6.0 * np.sin(12.0 * seconds)
    effort = -400.0 * np.tanh(np.cos(12.0 * seconds) / 0.05)
    stamps = [START_NS + MILLISECOND * i for i in range(SENT)]
    sender = Sender(graph, ["elbow"])
    engine = Engine(load_settings(config))
    for stamp, one, other in zip(stamps, position.tolist(), effort.tolist(), strict=True):
        sender.send(stamp, [one], [other])
        engine.intake.pairings[0].push_position(stamp, one)
        engine.intake.pairings[0].push_effort(stamp, other)
    live = [decode_joint_state(data) for data in graph.wait_messages("friction_estimate", SENT)]
    block = next(block for block in engine.process().blocks if block.topic == "friction_estimate")
    fields = {"position": 2, "velocity": 3, "effort": 4}
    return all(
        np.array_equal(np.array([message[fields[name]] for message in live]), values)
        for name, values in block.values.items()
    )
