"""Evaluation data: the recordings that the evidence of a fit is computed on, and that evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import (
    Improvement,
    fit_residuals,
    held_out_residuals,
    in_blocks,
    left_out_residuals,
)
from sgms_observer.diagnosis.fit import Refit
from sgms_observer.diagnosis.free_form import FreeForm
from sgms_observer.diagnosis.gap import residuals, weighted, weighted_rms
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.whitened import WhitenedData


@dataclass(frozen=True)
class EvaluationData:
    """Recordings that the evidence of a fit is computed on.

    Attributes:
        fit_motions: fitted recordings.
        motions: held-out recordings, or ``fit_motions`` if there are none.
        fit_data: ``fit_motions`` with their noise.
        held_out_data: held-out recordings with the noise of ``fit_data``; may be empty.
        floor: rms weighted residual of a perfect model on ``motions``, from noise and encoder [N].
        gap: rms weighted residual of the current model on ``motions`` [N].
        criteria: thresholds.
        seed: seed of the free-form regression.
        hidden_by_encoder: friction of the file that reverses within one encoder step, over the static force.
        references: set-points of each of ``motions`` as recorded [m], or None; empty where none is known.
        predictions: free-form predictions so far, by coordinates and model.
    """

    fit_motions: tuple[Motion, ...]
    motions: tuple[Motion, ...]
    fit_data: WhitenedData
    held_out_data: WhitenedData
    floor: float
    gap: float
    criteria: Criteria
    seed: int
    hidden_by_encoder: float = 0.0
    references: tuple[Floats | None, ...] = ()
    predictions: dict[tuple[tuple[str, ...], Model], FreeForm] = field(default_factory=dict, compare=False)

    @property
    def has_held_out(self) -> bool:
        """Return whether there are held-out recordings."""
        return bool(self.held_out_data.motions)

    @property
    def weights(self) -> tuple[Floats, ...]:
        """Return the weights of the samples of ``motions``: low where the residual of a stage at rest scatters more."""
        return self.held_out_data.weights if self.has_held_out else self.fit_data.weights

    def rms(self, model: Model) -> float:
        """Return the rms weighted residual of a model on ``motions`` [N]."""
        return weighted_rms(residuals(model, self.motions), self.weights)

    @property
    def closable(self) -> float:
        """Return the closable squared gap, summed over the weighted samples [N^2].

        It is the squared gap of the current model minus the squared floor. If the gap is not above the floor, the whole
        gap counts, because the noise may contain an effect.
        """
        return self._closable(0.0 if self.is_noise(self.gap) else self.floor)

    def closed_share(self, gain: Improvement) -> float:
        """Return the share of the closable squared gap that an improvement closes.

        Args:
            gain: improvement of the weighted squared residual on ``motions`` [N^2].
        """
        return gain.decrease / self.closable if self.closable > 0.0 else 0.0

    @property
    def closable_above_floor(self) -> float:
        """Return the squared gap above the squared floor, summed over the weighted samples [N^2]."""
        return self._closable(self.floor)

    def closed_share_above_floor(self, gain: Improvement) -> float:
        """Return the share of the squared gap above the squared floor that an improvement closes; argument as above."""
        return gain.decrease / self.closable_above_floor if self.closable_above_floor > 0.0 else 0.0

    def _closable(self, floor: float) -> float:
        """Return the squared gap above a squared floor, summed over the weighted samples [N^2]."""
        return (self.gap**2 - floor**2) * sum(float(np.sum(part**2)) for part in self.weights)

    def is_gap_closed(self, model: Model) -> bool:
        """Return whether the residual of a model on ``motions`` is not above the floor."""
        return self.is_noise(self.rms(model))

    def is_noise(self, residual: float) -> bool:
        """Return whether an rms weighted residual [N] is not above the floor."""
        return self.criteria.is_noise(residual, self.floor)


@dataclass(frozen=True)
class Evidence:
    """Residuals of a fit in blocks of time, on data that it was not fitted to.

    Attributes:
        fit: whitened residual of each block of the fitted recordings. Without held-out recordings, each block is
            predicted by the fit without the block.
        held_out: whitened residual of each block of the held-out recordings.
        force: weighted residual of each block of ``EvaluationData.motions`` [N].
    """

    fit: list[Floats]
    held_out: list[Floats]
    force: list[Floats]

    @property
    def all(self) -> list[Floats]:
        """Return all whitened blocks."""
        return [*self.fit, *self.held_out]

    def weighted(self, shares: Sequence[Floats]) -> Evidence:
        """Return the evidence with weighted whitened residuals.

        Args:
            shares: weights of the samples of each block of ``all``.
        """
        blocks = [block * share for block, share in zip(self.all, shares, strict=True)]
        return replace(self, fit=blocks[: len(self.fit)], held_out=blocks[len(self.fit) :])


def evidence_of(found: Refit, evaluation: EvaluationData) -> Evidence:
    """Return the evidence of a fit.

    Args:
        found: fit with derivatives at its solution.
        evaluation: the recordings.
    """
    length = evaluation.criteria.block
    fit_blocks = fit_residuals if evaluation.has_held_out else left_out_residuals
    left = residuals(found.model, evaluation.motions)
    return Evidence(
        fit_blocks(found, evaluation.fit_data, length),
        held_out_residuals(found.model, evaluation.held_out_data, length),
        in_blocks(weighted(left, evaluation.weights), evaluation.motions, length),
    )
