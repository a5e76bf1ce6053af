"""A recording as a rosbag2 folder with the topics that the diagnosis reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sgms_observer.bags.writer import BagWriter
from sim_plant.plants.recording import Recording

START_NS = 1_700_000_000_000_000_000


def write_bag(path: Path, recording: Recording) -> None:
    """Write position, control_effort and reference; nothing of the truth.

    Args:
        path: folder of the bag; must not exist.
        recording: what was logged.
    """
    stamps = START_NS + np.rint(recording.time * 1.0e9).astype(np.int64)
    with BagWriter(path) as bag:
        bag.write_joint_states("position", stamps, ["x"], position=recording.position)
        bag.write_joint_states("control_effort", stamps, ["x"], effort=recording.effort)
        bag.write_joint_states(
            "reference", stamps, ["x"], position=recording.reference, velocity=recording.reference_velocity
        )
