"""The smallest size of each effect that the recordings of a diagnosis would show."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis import search
from sgms_observer.diagnosis.decision import MAX_LAG_WITHOUT_DELAY, needs_visible_contact, shortest_lag
from sgms_observer.diagnosis.diagnosis import Diagnosis, Options
from sgms_observer.diagnosis.evaluation import EvaluationData, Evidence, evidence_of
from sgms_observer.diagnosis.evidence import in_blocks, whitened_blocks
from sgms_observer.diagnosis.fit import Refit
from sgms_observer.diagnosis.gap import weighted
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion, lowest_rate
from sgms_observer.diagnosis.screen import Screening
from sgms_observer.settings.axis import EffectSettings

LARGEST = 9.99
"""Largest size that is stated, times the Coulomb force: these recordings would hardly show the effect."""
SIZES_OF_VALUES = ("mass_error", "actuator_gain")
"""Effects whose size is a share of a value of the file: smaller ones lie within its tolerance."""


@dataclass(frozen=True)
class Change:
    """Change of the residual by an effect of unit size that the fitted parameters do not absorb.

    Attributes:
        evidence: the change in the blocks of the evidence.
        peak: largest force of the effect in the recordings, below the band [N].
    """

    evidence: Evidence
    peak: float


def detectable(diagnosis: Diagnosis, options: Options) -> dict[str, float]:
    """Return the smallest peak of each effect that is expected to pass the tests of its size.

    These are the tests of the prediction, of the held-out gap, of the closed share and of the lag of a delay, for the
    effect beside the final model. Tests of its shape, and other effects that imitate it, may ask for more. Peaks are
    shares of the Coulomb force. For ``mass_error`` and ``actuator_gain`` the tolerance is returned, a share of mass and
    gain.

    Args:
        diagnosis: the diagnosis.
        options: options of the diagnosis.
    """
    sizes = dict.fromkeys(SIZES_OF_VALUES, options.tolerance)
    if not diagnosis.rounds:
        return sizes
    fit, evaluation = diagnosis.final_state.current, diagnosis.evaluation
    left, rest = evidence_of(fit, evaluation), Rest.of(fit, evaluation)
    for name, screening in diagnosis.rounds[0].screenings.items():
        shown = None if name in sizes or screening.trials == 0 else _shown(name, screening, fit, evaluation)
        if shown is not None:
            change = _change(shown, rest, evaluation)
            size = max(_smallest(name, change, left, screening.trials, evaluation), _shortest(shown, evaluation))
            peak = size * change.peak / diagnosis.nominal.friction.coulomb_force
            sizes[name] = LARGEST if math.isnan(peak) else min(LARGEST, peak)
    return dict(sorted(sizes.items()))


def _shown(name: str, screening: Screening, fit: Refit, evaluation: EvaluationData) -> EffectSettings | None:
    """Return the effect with the best shape of its screening, or any shape where none reduced the residual."""
    listed = [item.shape for _, item in screening.best[:1]] or search.shapes(name, evaluation.fit_motions, fit.model)
    return listed[len(listed) // 2].columns()[0] if listed else None


@dataclass(frozen=True)
class Rest:
    """What a fit leaves, and which part of a change it would absorb.

    Attributes:
        model: the fitted model.
        learnt, held_out: residual of each recording at the working rate [N].
        basis: orthonormal columns of what the fitted parameters absorb, with prior rows, shape (rows, k).
    """

    model: Model
    learnt: list[Floats]
    held_out: list[Floats]
    basis: Floats

    @staticmethod
    def of(fit: Refit, evaluation: EvaluationData) -> Rest:
        """Return what a fit leaves of the recordings."""
        learnt = _residuals(fit.model, evaluation.fit_data.motions)
        held_out = _residuals(fit.model, evaluation.held_out_data.motions)
        return Rest(fit.model, learnt, held_out, linalg.orth(fit.jacobian))

    def not_absorbed(self, change: Floats) -> Floats:
        """Return the part of a whitened change of the fitted recordings that the fitted parameters do not absorb."""
        return np.asarray(change - (self.basis @ (self.basis[: len(change)].T @ change))[: len(change)])


def _residuals(model: Model, motions: Sequence[Motion]) -> list[Floats]:
    """Return the residual of a model in each recording at the working rate [N]."""
    return [predict(model, motion).residual for motion in motions]


def _change(item: EffectSettings, rest: Rest, evaluation: EvaluationData) -> Change:
    """Return the change of the residual by an effect beside a fit."""
    model, length = rest.model.with_effects([item]), evaluation.criteria.block
    data, unseen = evaluation.fit_data, evaluation.held_out_data

    def changes(motions: Sequence[Motion], before: Sequence[Floats]) -> list[Floats]:
        return [one - other for one, other in zip(_residuals(model, motions), before, strict=True)]

    learnt, held_out = changes(data.motions, rest.learnt), changes(unseen.motions, rest.held_out)
    whole = data.whitened(learnt)
    left = rest.not_absorbed(whole)
    share = float(np.linalg.norm(left)) / max(float(np.linalg.norm(whole)), 1.0e-300)
    force = [motion.low_pass(one) for motion, one in zip(evaluation.motions, held_out or learnt, strict=True)]
    parts = [share * part for part in weighted(force, evaluation.weights)]
    evidence = Evidence(
        whitened_blocks(left, data, length),
        whitened_blocks(share * unseen.whitened(held_out), unseen, length) if held_out else [],
        in_blocks(parts, evaluation.motions, length),
    )
    peaks = [np.max(np.abs(motion.low_pass(one))) for motion, one in zip(data.motions, learnt, strict=True)]
    return Change(evidence, float(max(peaks)))


def _smallest(name: str, change: Change, left: Evidence, trials: int, evaluation: EvaluationData) -> float:
    """Return the smallest size that is expected to predict surely better and to close enough of the gap.

    Args:
        name: the effect.
        change: change of the residual at unit size.
        left: evidence of the model without the effect.
        trials: number of shapes that were screened.
        evaluation: the recordings.
    """
    criteria = evaluation.criteria
    needed = [size_with_z_score(criteria.z_score_of(trials), change.evidence.all, left.all)]
    if evaluation.has_held_out:
        needed.append(size_with_z_score(criteria.interval_z_score, change.evidence.force, left.force))
    needed.append(_size_with_share(criteria.min_closed_share, evaluation.closable, change))
    if needs_visible_contact(name):
        needed.append(_size_with_share(criteria.min_imitable_share, evaluation.closable_above_floor, change))
    return max(needed)


def _size_with_share(share: float, closable: float, change: Change) -> float:
    """Return the size that closes a share of the gap; the effect itself adds to the gap.

    Args:
        share: of the closable squared gap.
        closable: squared gap without the effect, summed over the weighted samples [N^2].
        change: change of the residual at unit size.
    """
    square = sum(float(block @ block) for block in change.evidence.force)
    return math.sqrt(share / (1.0 - share) * max(closable, 0.0) / square) if square > 0.0 else math.inf


def size_with_z_score(z_score: float, change: Sequence[Floats], left: Sequence[Floats]) -> float:
    """Return the size of an effect with an expected z-score of the improvement, see ``improvement``.

    An effect of size a adds a d to what is left, e. Without its description the square is larger by a^2 sum d d. Its
    standard error is 2 a sqrt(sum (d e)^2), of the products of each block.

    Args:
        z_score: to reach.
        change: change of each block at unit size.
        left: residual of the model without the effect, in the same blocks.
    """
    square = sum(float(one @ one) for one in change)
    products = math.sqrt(sum(float(one @ other) ** 2 for one, other in zip(change, left, strict=True)))
    return 2.0 * z_score * products / square if square > 0.0 else math.inf


def _shortest(item: EffectSettings, evaluation: EvaluationData) -> float:
    """Return the smallest multiple of a delay that exceeds what a held effort and inexact stamps make; else 0."""
    if item.name != "actuator_delay":
        return 0.0
    lag = MAX_LAG_WITHOUT_DELAY - shortest_lag(evaluation)
    return max(0.0, lag / (item.values[0] * lowest_rate(evaluation.fit_motions)))
