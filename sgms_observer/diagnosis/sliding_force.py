"""Effects that are a part of the friction level: what they take, its owner has measured with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.model import COULOMB, STATIC, Model
from sgms_observer.settings.axis import EffectSettings

Floats = NDArray[np.float64]

PRESLIDING = "presliding"
BACKLASH = "backlash"
PARTS_OF_SLIDING_FORCE = (PRESLIDING, BACKLASH)
"""Effects whose force the owner's Coulomb and static force already contain."""


def owner_logs(logs: Floats, nominal: Model, effects: Sequence[EffectSettings]) -> Floats:
    """Return the logarithms as their owner would see them: what a part of the level takes, he measured with it."""
    parts = [item for item in effects if item.name in PARTS_OF_SLIDING_FORCE]
    if not parts:
        return logs
    owned = logs.copy()
    for row, force in ((COULOMB, nominal.friction.coulomb_force), (STATIC, nominal.friction.static_force)):
        sliding_force = np.exp(logs[row])
        own = sum(share_of_sliding_force(item.name, item.values, force, sliding_force) for item in parts)
        owned[row] = np.log(max(sliding_force + own, 1.0e-3))
    return owned


def start_logs(logs: Floats, nominal: Model, start: EffectSettings) -> Floats:
    """Return where a fit with one more effect starts: a part of the level leaves the level as it is."""
    moved = logs.copy()
    for row, force in ((COULOMB, nominal.friction.coulomb_force), (STATIC, nominal.friction.static_force)):
        if start.name == PRESLIDING:
            moved[row] = np.log(max(np.exp(logs[row]) - start.values[0] / force, 0.1))
        elif start.name == BACKLASH:
            moved[row] = logs[row] + np.log(1.0 - start.values[1])
    return moved


def share_of_sliding_force(name: str, values: Sequence[float], force: float, sliding_force: float) -> float:
    """Return what a part of the level takes, as a share of the owner's force.

    Args:
        name: of an effect in ``PARTS_OF_SLIDING_FORCE``.
        values: its values.
        force: the level that the owner measured [N].
        level: what is left of it beside the part, as a share [-].
    """
    return values[0] / force if name == PRESLIDING else sliding_force * values[1] / (1.0 - values[1])
