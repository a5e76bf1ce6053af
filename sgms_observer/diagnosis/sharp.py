"""Which contact the recordings show: the S-GMS equation of the settings, or Maxwell-slip elements without smoothing.

S-GMS rounds the change between sticking and slipping so that an estimator can differentiate it. Its elements lose a
little force with every to and fro, and follow the Stribeck curve over a distance. On a contact that does neither, both
leave a residual at rest and after small motions that is larger than the noise, and that no effect explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sgms_observer.diagnosis.fit import Refit, Refits
from sgms_observer.diagnosis.gate import SURE, sureness
from sgms_observer.diagnosis.motion import Motion

STEPS = 6
"""Steps of the fit with the sharp contact; it starts at the other one's solution."""


def sharpened(refits: Refits, found: Refit, unseen: Sequence[Motion]) -> Refit | None:
    """Return the refit with the sharp contact where it leaves clearly less here and not more there, else None.

    In doubt the owner's equation stays.

    Args:
        refits: to the recordings to learn from, of the model with the elements that tests use.
        found: the refit so far, effects included.
        unseen: recordings to judge on; those to learn from if empty.
    """
    fine, motions = refits.nominal, refits.judged.motions
    if fine.friction.model == "gms" or fine.is_sharp:
        return None
    sharp = replace(refits, nominal=replace(fine, is_sharp=True)).of(found.effects, found.logs, STEPS)
    is_sure = sureness(found.model, sharp.model, motions) > SURE
    return sharp if is_sure and sureness(found.model, sharp.model, unseen or motions) >= 0.0 else None
