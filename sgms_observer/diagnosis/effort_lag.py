"""When the effort acts: held until the next sample, or at its stamp. A tenth of a sample is nobody's."""

from __future__ import annotations

import numpy as np

from sgms_observer.diagnosis.fit import Refit, WhitenedData
from sgms_observer.diagnosis.motion import delayed

MIN_HELD_LAG = 0.25
"""An effort that comes less than this late, in samples, is not held."""
MAX_STAMP_ERROR = 0.12
"""Stamps are no better than this, in samples; a larger lag is an actuator delay."""
MIN_CHI2_REDUCTION = 20.0
"""Squared residual, in units of the noise, that moving the effort has to take."""


def fitted_effort_lag(data: WhitenedData, found: Refit, lag: float, stated_lag: float) -> float:
    """Return how late the effort arrives, in samples, when it is what the settings say or earlier.

    An effort that acts earlier than one that is held can act is not held. A lag beyond that is left for the catalogue's
    ``actuator_delay``.

    Args:
        judged: recordings as read with ``lag``.
        found: refit of the nominal model.
        lag: the lag they were read with.
        stated_lag: the lag of the settings; an effort that was taken to come earlier, and does not, goes back to it.
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
