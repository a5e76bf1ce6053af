"""residual.mcap: measured and modelled effort, residual and each effect's effort, for PlotJuggler and Foxglove."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sgms_observer.bags.mcap_writer import JointStates, write_mcap
from sgms_observer.diagnosis.traces import Trace

RESIDUAL_LOG = "residual.mcap"
"""Name of the file."""


def write_residual_log(traces: Sequence[Trace], axis: str, folder: Path) -> None:
    """Write the traces, each recording under its own name, with the stamps of the recording.

    Args:
        traces: traces of the recordings that the gap is computed on.
        axis: name of the axis in the messages.
        folder: folder of the file.

    Raises:
        RecordingError: the file cannot be written; one sentence.
    """
    topics: dict[str, list[JointStates]] = {}
    latest: dict[str, int] = {}
    for trace in traces:
        stamp_ns = np.round((trace.start + trace.time) * 1e9).astype(np.int64)
        above = _namespace(trace.name, int(stamp_ns[0]), latest)
        latest[above] = int(stamp_ns[-1])
        for states in _topics_of(trace, axis, above, stamp_ns):
            topics.setdefault(states.topic, []).append(states)
    write_mcap([_joined(parts) for parts in topics.values()], folder / RESIDUAL_LOG)


def _topics_of(trace: Trace, axis: str, above: str, stamp_ns: np.ndarray) -> list[JointStates]:
    """Return the topics of one trace."""

    def states(topic: str, **fields: np.ndarray) -> JointStates:
        return JointStates(f"{above}/{topic}", stamp_ns, [axis], {key: x[:, None] for key, x in fields.items()})

    listed = [
        states("measured", position=trace.position, velocity=trace.velocity, effort=trace.effort),
        states("modelled_before", effort=trace.before),
        states("modelled", effort=trace.after),
        states("residual_before", effort=trace.residual_before),
        states("residual", effort=trace.residual),
        states("weight", effort=trace.weight),
    ]
    if trace.effects:
        effort = np.column_stack(list(trace.effects.values()))
        listed.append(JointStates(f"{above}/effects", stamp_ns, list(trace.effects), {"effort": effort}))
    if np.isfinite(trace.tracking_error).any():
        listed.append(states("tracking_error", position=trace.tracking_error))
    return listed


def _namespace(name: str, first_ns: int, latest: dict[str, int]) -> str:
    """Return the ROS namespace of a recording's topics; a second recording of that name gets a number."""
    word = re.sub(r"\W", "_", name, flags=re.ASCII) or "_"
    plain = f"/{word}" if not word[0].isdigit() else f"/_{word}"
    found, number = plain, 1
    while latest.get(found, -1) >= first_ns:
        number += 1
        found = f"{plain}_{number}"
    return found


def _joined(parts: Sequence[JointStates]) -> JointStates:
    """Return the messages of one topic from several pieces of a recording."""
    first = parts[0]
    fields = {key: np.concatenate([part.fields[key] for part in parts]) for key in first.fields}
    return JointStates(first.topic, np.concatenate([part.stamp_ns for part in parts]), first.names, fields)
