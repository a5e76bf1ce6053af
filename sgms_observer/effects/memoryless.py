"""Effects without state along a whole recording at once, by their formulas over numpy.

That takes a third of the time of the compiled switch, which goes from sample to sample. A test holds the two together.
"""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.effects.catalogue import is_built_in
from sgms_observer.effects.effect import Effect, Place
from sgms_observer.formulas import vectorised

ROUNDED_OTHERWISE = ("nonlinear_viscous", "position_dependent_friction", "stribeck")
"""Effects without state whose exponential or power numpy and the compiled switch round differently. A fit on another
contact law amplifies the last bit, so these keep the switch where results are compared."""


def is_same_over_arrays(entry: Effect) -> bool:
    """Return whether numpy computes an effect along a recording to the same bits as the compiled switch.

    Args:
        entry: the effect. It has no state and is a force or a factor on the sliding force.
    """
    is_force_or_factor = entry.place in (Place.ADDED_FORCE, Place.LEVEL_FACTOR)
    has_state = entry.advance is not None
    return is_built_in(entry.name) and is_force_or_factor and not has_state and entry.name not in ROUNDED_OTHERWISE


def output_along(entry: Effect, values: Sequence[float], signals: Mapping[str, Floats]) -> Floats:
    """Return the force [N] or the factor on the sliding force [-] of a memoryless effect at each sample, shape (n,).

    Args:
        entry: the effect.
        values: of its parameters.
        signals: its inputs by the names in ``effect.INPUTS``, shape (n,) each; none of these formulas
            needs ``h`` or ``level``.
    """
    formula = getattr(vectorised(entry.output.__module__), entry.output.__name__)
    known = {**signals, "p": values}
    return np.broadcast_to(formula(*(known[key] for key in inspect.signature(formula).parameters)), signals["q"].shape)
