"""Which contact the recordings show: the S-GMS equation of the settings, or Maxwell-slip elements without smoothing.

S-GMS rounds the change between sticking and slipping so that an estimator can differentiate it. Its elements lose a
little force with every to and fro, and follow the Stribeck curve over a distance. On a contact that does neither, both
leave a residual at rest and after small motions that is larger than the noise, and that no effect explains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from sgms_observer.discrepancy.fit import Judged, Refit, refit
from sgms_observer.discrepancy.gate import SURE, sureness
from sgms_observer.discrepancy.model import Model
from sgms_observer.discrepancy.motion import Motion


def sharpened(
    judged: Judged,
    fine: Model,
    tolerance: float,
    found: Refit,
    fixed: Sequence[tuple[int, int]],
    limit: float | None,
    unseen: Sequence[Motion],
) -> Refit | None:
    """Return the refit with the sharp contact where it leaves clearly less here and not more there, else None.

    In doubt the owner's equation stays.

    Args:
        judged: recordings to learn from.
        fine: the given model with the elements that tests use.
        tolerance: of its parameters.
        found: its refit, effects included.
        fixed: parameters that keep their value, see ``refit``.
        limit: of the friction parameters, see ``refit``.
        unseen: recordings to judge on; those to learn from if empty.
    """
    if fine.friction.model == "gms" or fine.is_sharp:
        return None
    sharp = refit(judged, replace(fine, is_sharp=True), tolerance, found.effects, found.logs, fixed, 6, None, limit)
    is_sure = sureness(found.model, sharp.model, judged.motions) > SURE
    return sharp if is_sure and sureness(found.model, sharp.model, unseen or judged.motions) >= 0.0 else None
