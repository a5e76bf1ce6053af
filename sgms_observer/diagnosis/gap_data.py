"""The recordings that the gap of an answer is computed on, and what is left of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.diagnosis import Diagnosis, Options
from sgms_observer.diagnosis.evidence import Improvement, improvement
from sgms_observer.diagnosis.fit import WRITTEN_EVALUATIONS, Refit, RefitSetup
from sgms_observer.diagnosis.free_form import ALL, FreeForm, free_form
from sgms_observer.diagnosis.gap import WeightedResidual, effort_rms, halves, noise_floor, residuals, rms
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.whitened import WhitenedData, data_with_noise_of, data_with_own_noise


@dataclass(frozen=True)
class GapData:
    """The recordings that the gap of an answer is computed on. No reported residual is of data that was fitted to.

    Attributes:
        diagnosis: the diagnosis.
        options: its options.
        motions: held-out recordings, or halves of the fitted recordings.
        whitened: the same with the weights of their residuals.
    """

    diagnosis: Diagnosis
    options: Options
    motions: tuple[Motion, ...]
    whitened: WhitenedData

    @classmethod
    def of(cls, diagnosis: Diagnosis, options: Options) -> GapData:
        """Return the recordings for the answer of a diagnosis."""
        state = diagnosis.final_state
        motions = state.held_out_motions or tuple(half for motion in state.fit_motions for half in halves(motion))
        model = diagnosis.written.after.model
        return cls(diagnosis, options, motions, data_with_noise_of(motions, diagnosis.evaluation.fit_data, model))

    @property
    def has_held_out(self) -> bool:
        """Return whether there are held-out recordings."""
        return bool(self.diagnosis.final_state.held_out_motions)

    @cached_property
    def effort(self) -> float:
        """Return the rms measured effort [N]."""
        return effort_rms(self.motions, self.whitened.weights)

    def residuals(self, fit: Refit, setup: RefitSetup) -> tuple[Floats, ...]:
        """Return the residual of each recording [N]. Halves are predicted by a fit to the other halves.

        Args:
            fit: the model with its effects.
            setup: how it was fitted.
        """
        if self.has_held_out:
            return residuals(fit.model, self.motions)
        parts: list[Floats] = [np.zeros(0)] * len(self.motions)
        for side in (0, 1):
            data = data_with_own_noise(self.motions[side::2], fit.model)
            again = replace(setup, data=data).fit(fit.effects, fit.logs, evaluations=WRITTEN_EVALUATIONS)
            parts[1 - side :: 2] = residuals(again.model, self.motions[1 - side :: 2])
        return tuple(parts)

    def rest(self, parts: Sequence[Floats]) -> WeightedResidual:
        """Return residuals with the weights of the gap."""
        return WeightedResidual(self.motions, parts, self.whitened.weights)

    def rms(self, parts: Sequence[Floats]) -> float:
        """Return the rms of residuals with the weights of the gap [N]."""
        return self.rest(parts).rms

    def unweighted(self, parts: Sequence[Floats]) -> float:
        """Return the rms of residuals over that of the effort, with every sample counting alike."""
        ones = [np.ones(len(part)) for part in parts]
        return rms(parts) / effort_rms(self.motions, ones)

    def reduction(self, before: Sequence[Floats], after: Sequence[Floats]) -> Improvement:
        """Return by how much the gap is smaller with residuals than with others, in blocks of time."""
        block = self.options.criteria.block
        return improvement(self.rest(before).blocks(block), self.rest(after).blocks(block))

    def noise(self) -> float:
        """Return the rms residual of a perfect model, from noise and encoder alone [N]."""
        state = self.diagnosis.final_state
        weights = self.whitened if self.has_held_out else self.diagnosis.evaluation.fit_data
        return noise_floor(
            state.held_out_motions or state.fit_motions, state.current.model, state.setup.data.noise,
            self.options.seed, weights.weights,
        )  # fmt: skip

    def fitted(self, model: Model) -> WeightedResidual:
        """Return the residual of a model on the fitted recordings, with the weights of the gap."""
        motions = self.diagnosis.final_state.fit_motions
        return WeightedResidual(motions, residuals(model, motions), self.diagnosis.evaluation.fit_data.weights)

    def predictable(self, rest: WeightedResidual, model: Model) -> FreeForm | None:
        """Return what a free-form regression over all coordinates predicts of a residual, or None if not significant.

        Args:
            rest: residual of ``model``.
            model: the model.
        """
        criteria, free = self.options.criteria, self.free_form(ALL, rest, model)
        return free if free.improvement.z_score > criteria.min_z_score and free.improvement.share > 0.0 else None

    def free_form(self, names: Sequence[str], rest: WeightedResidual, model: Model) -> FreeForm:
        """Return what a free-form regression over some coordinates predicts of a residual.

        Args:
            names: the coordinates.
            rest: residual of ``model``.
            model: the model.
        """
        known = self.fitted(model) if self.has_held_out else rest
        return free_form(names, known, rest, self.options.criteria, self.options.seed)


def ratio_to_noise(gap: float, noise: float) -> float:
    """Return the ratio of gap to noise; infinite without noise."""
    return gap / noise if noise > 0.0 else math.inf
