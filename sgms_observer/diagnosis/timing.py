"""When the effort acts: held until the next sample, or at its stamp. A tenth of a sample is nobody's."""

from __future__ import annotations

import numpy as np

from sgms_observer.diagnosis.fit import Judged, Refit
from sgms_observer.diagnosis.motion import later

NOT_HELD = 0.25
"""An effort that comes less than this late, in samples, is not held."""
NOBODYS = 0.12
"""Stamps are no better than this, in samples; a larger lag is an actuator delay."""
SURE = 20.0
"""Squared residual, in units of the noise, that moving the effort has to take."""


def timing(judged: Judged, found: Refit, lag: float, stated_lag: float) -> float:
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
    for motion in judged.motions:
        samples = step / motion.step
        moved.append(later(motion.effort, samples) - motion.effort)
    column = judged.whitened(moved) / step
    rows = len(column)
    nominal = found.jacobian[:rows]
    basis = np.linalg.qr(nominal)[0]
    left = column - basis @ (basis.T @ column)
    size = float(left @ left)
    if size <= 0.0:
        return lag
    late = -float(left @ found.residual) / size
    if late * late * size < SURE:
        return lag
    if lag < NOT_HELD <= min(lag + late, stated_lag):
        return stated_lag
    if lag >= NOT_HELD and lag + late < NOT_HELD:
        return 0.0
    return lag + late if abs(late) < NOBODYS else lag
