"""Effects that carry a part of the sliding force: the Coulomb force of the file includes their force."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.model import COULOMB, STATIC, Model
from sgms_observer.settings.axis import EffectSettings

PRESLIDING = "presliding"
BACKLASH = "backlash"
PARTS_OF_SLIDING_FORCE = (PRESLIDING, BACKLASH)
"""Effects whose force is included in the Coulomb and static force of the file."""


def total_force_logs(logs: Floats, nominal: Model, effects: Sequence[EffectSettings]) -> Floats:
    """Return the logarithms with Coulomb and static force of contact and effects together, as the file states them."""
    parts = [item for item in effects if item.name in PARTS_OF_SLIDING_FORCE]
    if not parts:
        return logs
    total = logs.copy()
    for row, force in ((COULOMB, nominal.friction.coulomb_force), (STATIC, nominal.friction.static_force)):
        contact = np.exp(logs[row])
        effects_share = sum(share_of_sliding_force(item.name, item.values, force, contact) for item in parts)
        total[row] = np.log(max(contact + effects_share, 1.0e-3))
    return total


def start_logs(logs: Floats, nominal: Model, start: EffectSettings) -> Floats:
    """Return the start of a fit with one more effect. The total sliding force of contact and effect stays the same."""
    moved = logs.copy()
    for row, force in ((COULOMB, nominal.friction.coulomb_force), (STATIC, nominal.friction.static_force)):
        if start.name == PRESLIDING:
            moved[row] = np.log(max(np.exp(logs[row]) - start.values[0] / force, 0.1))
        elif start.name == BACKLASH:
            moved[row] = logs[row] + np.log(1.0 - start.values[1])
    return moved


def share_of_sliding_force(name: str, values: Sequence[float], force: float, contact: float) -> float:
    """Return the force of an effect as a share of the sliding force of the file.

    Args:
        name: effect in ``PARTS_OF_SLIDING_FORCE``.
        values: its values.
        force: sliding force of the file [N].
        contact: share of it that the contact carries [-].
    """
    return values[0] / force if name == PRESLIDING else contact * values[1] / (1.0 - values[1])
