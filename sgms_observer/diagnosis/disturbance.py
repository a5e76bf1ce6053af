"""A force that does not repeat: it acts while the contact slides fast, and nothing recorded predicts it.

The force of the contact is a function of the velocity there, Coulomb, viscous and logarithmic friction (see
``sliding``), so what these leave is no friction where it is larger than the noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import median_abs_deviation

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.criteria import Test, at_most
from sgms_observer.diagnosis.free_form import FreeForm
from sgms_observer.diagnosis.gap import noise_floor, rms
from sgms_observer.diagnosis.gap_data import GapData
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.sliding import fast_sliding_residual, left_by_logarithmic_friction, slides_fast
from sgms_observer.settings.units import Units


@dataclass(frozen=True)
class SlidingResidual:
    """The residual while the contact slides fast.

    Attributes:
        force: its rms on the recordings of the gap [N].
        over_noise: its ratio to the noise, the smaller one of fitted recordings and recordings of the gap.
        is_brief: whether it acts in a small part of the time only.
        tests: tests that it is noise. Where none is passed, it is a disturbance.
    """

    force: float
    over_noise: float
    is_brief: bool
    tests: tuple[Test, ...]

    @property
    def is_disturbance(self) -> bool:
        """Return whether a force acts that does not repeat."""
        return not any(test.passed for test in self.tests)

    def sentence(self, units: Units) -> str:
        """Return what it is in words."""
        when = "at times" if self.is_brief else "all the time"
        size = f"{self.force:.3g} {units.effort} rms ({self.over_noise:.2g} times the noise)"
        return f"a force of {size} acts {when}, and no recorded signal predicts it"


def sliding_residual(
    data: GapData, model: Model, residual: Sequence[Floats], free: FreeForm | None
) -> SlidingResidual | None:
    """Return the residual while the contact slides fast, or None where the recordings hardly show it.

    Args:
        data: recordings of the gap.
        model: the final model.
        residual: its residual in the recordings of the gap [N].
        free: significant free-form prediction of the residual, or None.
    """
    criteria, whole = data.options.criteria, data.rest(residual)
    left = whole.minus(free.predicted) if free else whole
    rests = (left_by_logarithmic_friction(rest, model) for rest in (data.fitted(model), left))
    fitted, evaluated = (fast_sliding_residual(rest, model, criteria) for rest in rests)
    if fitted is None or evaluated is None:
        return None
    parts = fitted, evaluated
    typical = [median_abs_deviation(part, scale="normal") for part in parts]
    state = data.diagnosis.final_state
    recordings = state.fit_motions, state.held_out_motions or state.fit_motions  # whole: a half may be too short
    noise = [_noise(data, model, motions) for motions in recordings]
    over_noise = min(
        rms([part]) / max(min(usual, floor), 1.0e-300) for part, usual, floor in zip(parts, typical, noise, strict=True)
    )
    force = rms([evaluated])
    return SlidingResidual(
        force, over_noise, force > criteria.max_sliding_over_noise * typical[1],
        (
            at_most(
                "model", "residual over noise, where the contact slides fast", over_noise,
                criteria.max_sliding_over_noise,
            ),
            at_most(
                "model", "share of the squared gap, where the contact slides fast", (force / whole.rms) ** 2,
                criteria.min_predictable_share,
            ),
        ),
    )  # fmt: skip


def _noise(data: GapData, model: Model, motions: Sequence[Motion]) -> float:
    """Return the rms residual of a perfect model while the contact slides fast, from noise and encoder alone [N].

    The encoder makes more noise there than at rest, where its reading does not change.
    """
    fast = [at.astype(np.float64) for at in slides_fast(model, motions)]
    noise = data.diagnosis.final_state.setup.data.noise
    return noise_floor(motions, model, noise, data.options.seed, fast)
