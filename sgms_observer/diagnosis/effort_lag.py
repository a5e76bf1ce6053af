"""Lag between the stamp of an effort sample and its action: half a sample if the effort is held, else none."""

from __future__ import annotations

import numpy as np

from sgms_observer.diagnosis.fit import Refit, WhitenedData
from sgms_observer.diagnosis.motion import delayed

MIN_HELD_LAG = 0.25
"""Smallest lag of a held effort, in samples."""
MAX_STAMP_ERROR = 0.12
"""Largest lag that counts as an error of the stamps, in samples; a larger lag is an actuator delay."""
MIN_CHI2_REDUCTION = 20.0
"""Smallest decrease of the whitened squared residual for which the lag is changed."""


def fitted_effort_lag(data: WhitenedData, found: Refit, lag: float, stated_lag: float) -> float:
    """Return the lag of the effort that fits the recordings, in samples, at most about the lag of the settings.

    An effort with less lag than ``MIN_HELD_LAG`` is not held. A larger lag than that of the settings is left to the
    effect ``actuator_delay``.

    Args:
        data: recordings, read with ``lag``.
        found: refit of the nominal model.
        lag: lag that the recordings were read with.
        stated_lag: lag of the settings. The lag returns to it if the recordings do not show an earlier effort.
    """
    step = 0.1
    moved = []
    for motion in data.motions:
        samples = step / motion.step
        moved.append(delayed(motion.effort, samples) - motion.effort)
    column = data.whitened(moved) / step
    rows = len(column)
    nominal = found.jacobian[:rows]
    basis = np.linalg.qr(nominal)[0]
    left = column - basis @ (basis.T @ column)
    size = float(left @ left)
    if size <= 0.0:
        return lag
    late = -float(left @ found.residual) / size
    if late * late * size < MIN_CHI2_REDUCTION:
        return lag
    if lag < MIN_HELD_LAG <= min(lag + late, stated_lag):
        return stated_lag
    if lag >= MIN_HELD_LAG and lag + late < MIN_HELD_LAG:
        return 0.0
    return lag + late if abs(late) < MAX_STAMP_ERROR else lag
