"""The user's own motion, from a recording with the topic ``reference`` or from a CSV."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.reader import read_joint_states
from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.settings.axis import AxisSettings

Floats = NDArray[np.float64]


def own_rows(path: Path, axis: AxisSettings) -> tuple[Floats, Floats]:
    """Return times [s] and set-points [m] of a motion.

    Args:
        path: a bag with ``reference``, or a CSV with the columns time [s] and position [SI units].
        axis: the axis.

    Raises:
        ConfigurationError: the bag has no reference of the axis.
        RecordingError: it cannot be read.
    """
    if path.suffix == ".csv":
        try:
            rows = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)
        except (OSError, ValueError) as error:
            raise RecordingError(f"{path} cannot be read: {error}; give a CSV as sgms excite writes it") from None
        return rows[:, 0], rows[:, 1]
    states = read_joint_states(path, "reference")
    if axis.name not in states.names or not states.stamp_ns.size:
        raise ConfigurationError([f"{path} has no reference of axis {axis.name}; record one with the topic reference"])
    stamps, rows_of = np.unique(states.stamp_ns, return_index=True)
    position = axis.position_scale * states.position[rows_of, states.names.index(axis.name)]
    known = np.isfinite(position)
    return (stamps[known] - stamps[0]) * 1e-9, position[known]
