"""The court: the recordings that evidence is taken from, and what a fit predicts of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import (
    Improvement,
    fit_residuals,
    held_out_residuals,
    in_blocks,
    left_out_residuals,
)
from sgms_observer.diagnosis.fit import Refit, WhitenedData
from sgms_observer.diagnosis.gap import residuals, rms, weighted
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class EvaluationData:
    """The recordings that evidence is taken from.

    Attributes:
        learn: recordings to learn from.
        judge: recordings to judge on; the same where there are no held-out ones.
        judged: ``learn`` with their noise.
        held: held-out recordings with the noise to whiten with; none where there are none.
        floor: rms weighted residual that noise and encoder leave to a perfect model on ``judge`` [N].
        first_gap: the same of the file refitted within its tolerance, before anything was added [N].
        reported_floor, reported_gap: the same two with the weights of the gap as it is reported [N].
        criteria: thresholds.
        seed: of the free-form regression.
    """

    fit_motions: tuple[Motion, ...]
    motions: tuple[Motion, ...]
    fit_data: WhitenedData
    held_out_data: WhitenedData
    floor: float
    first_gap: float
    reported_floor: float
    reported_first_gap: float
    criteria: Criteria
    seed: int

    @property
    def has_held_out(self) -> bool:
        """Return whether there are recordings that nothing is fitted to."""
        return bool(self.held_out_data.motions)

    @property
    def weights(self) -> tuple[Floats, ...]:
        """Return the weights of the samples of ``judge``: what an encoder does not show at rest counts for little."""
        return self.held_out_data.weights if self.has_held_out else self.fit_data.weights

    @property
    def gap_weights(self) -> tuple[Floats, ...]:
        """Return the weights of the samples of ``judge`` in the gap as it is reported."""
        return self.held_out_data.gap_weights if self.has_held_out else self.fit_data.gap_weights

    def rms(self, model: Model) -> float:
        """Return the rms weighted residual of a model on ``judge`` [N]."""
        return rms(weighted(residuals(model, self.motions), self.weights))

    def closed_share(self, gap: Improvement, reported: Improvement) -> float:
        """Return the share of the closable squared gap that an improvement closes.

        Closable is what stands out of the floor in the beginning; all of it where nothing does: an effect may pass for
        noise there. Of the share with weights and that of the gap as it is reported the smaller one counts.

        Args:
            gap: fall of the weighted squared residual on ``judge`` [N^2].
            reported: the same with the weights of the gap as it is reported.
        """
        count = sum(len(motion.thinned(motion.time)) for motion in self.motions)

        def share(one: Improvement, floor: float, first: float) -> float:
            closable = (first**2 - (0.0 if self.criteria.is_noise(first, floor) else floor**2)) * count
            return one.decrease / closable if closable > 0.0 else 0.0

        return min(
            share(gap, self.floor, self.first_gap), share(reported, self.reported_floor, self.reported_first_gap)
        )

    def is_closed(self, model: Model) -> bool:
        """Return whether a model leaves nothing above the floor on ``judge``."""
        return self.is_noise(self.rms(model))

    def is_gap_explained(self, model: Model, first: Model) -> bool:
        """Return whether a model leaves no share of the squared gap of the first one that would count as predictable.

        Args:
            model: what was found.
            first: the file refitted within its tolerance.
        """
        left, closable = (self.rms(one) ** 2 - self.floor**2 for one in (model, first))
        return left <= self.criteria.min_predictable_share * closable

    def is_noise(self, residual: float) -> bool:
        """Return whether an rms weighted residual [N] does not stand out of the floor."""
        return self.criteria.is_noise(residual, self.floor)


@dataclass(frozen=True)
class Evidence:
    """What a fit predicts of data it was not fitted to.

    Attributes:
        learn: whitened residual of each block of the recordings to learn from; by the fit without the block where
            there are no held-out recordings.
        held: whitened residual of each block of the held-out recordings.
        force: weighted residual of each block of the recordings to judge on [N].
        reported: the same with the weights of the gap as it is reported.
    """

    fit: list[Floats]
    held_out: list[Floats]
    force: list[Floats]
    reported: list[Floats]

    @property
    def all(self) -> list[Floats]:
        """Return all whitened blocks."""
        return [*self.fit, *self.held_out]


def evidence_of(found: Refit, evaluation: EvaluationData) -> Evidence:
    """Return what a fit predicts of data it was not fitted to.

    Args:
        found: a fit with derivatives at its solution.
        court: the recordings.
    """
    length = evaluation.criteria.block
    learn = fit_residuals if evaluation.has_held_out else left_out_residuals
    left = residuals(found.model, evaluation.motions)
    return Evidence(
        learn(found, evaluation.fit_data, length),
        held_out_residuals(found.model, evaluation.held_out_data, length),
        in_blocks(weighted(left, evaluation.weights), evaluation.motions, length),
        in_blocks(weighted(left, evaluation.gap_weights), evaluation.motions, length),
    )
