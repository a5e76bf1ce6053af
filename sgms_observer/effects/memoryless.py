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


def is_memoryless(entry: Effect) -> bool:
    """Return whether an effect of the catalogue is a force or a factor on the sliding force without state."""
    is_force_or_factor = entry.place in (Place.ADDED_FORCE, Place.LEVEL_FACTOR)
    return is_built_in(entry.name) and is_force_or_factor and entry.advance is None


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
