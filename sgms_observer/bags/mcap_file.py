"""One MCAP file with JointStates, whole or not at all: what PlotJuggler and Foxglove open as it is."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.mcap_writer import McapWriter
from sgms_observer.bags.message_types import JOINT_STATE, describe_type
from sgms_observer.bags.metadata import dump_metadata
from sgms_observer.bags.rows import joint_state_rows
from sgms_observer.errors import RecordingError


@dataclass(frozen=True)
class JointStates:
    """Messages of one topic.

    Attributes:
        topic: full name.
        stamp_ns: sample times [ns], shape (n,).
        names: k entries of each message.
        fields: ``position`` [m or rad], ``velocity`` [per s] and ``effort`` [N or N m], as far as there are any, shape
            (n, k).
    """

    topic: str
    stamp_ns: NDArray[np.int64]
    names: Sequence[str]
    fields: dict[str, NDArray[np.float64]]


def write_mcap(topics: Sequence[JointStates], path: Path) -> None:
    """Write a file; one of that name is replaced.

    Args:
        topics: what it holds.
        path: the file.

    Raises:
        RecordingError: it cannot be written; one sentence.
    """
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    kind = describe_type(JOINT_STATE)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.unlink(missing_ok=True)
        writer = McapWriter(partial)
        try:
            for states in topics:
                channel = writer.add_topic(states.topic, kind)
                if states.stamp_ns.size:
                    rows = joint_state_rows(states.stamp_ns, states.names, states.fields)
                    writer.write_rows(channel, states.stamp_ns, rows)
            stamps = np.concatenate([states.stamp_ns for states in topics])
            counts = {states.topic: (kind, states.stamp_ns.size) for states in topics}
            writer.close(dump_metadata("mcap", path.name, int(stamps.min()), int(stamps.max()), counts))
        except BaseException:
            writer.abort()
            raise
        os.replace(partial, path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise RecordingError(f"{path} cannot be written: {reason}; make room or choose another folder") from None
    finally:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
