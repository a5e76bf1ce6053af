"""Where the contact slides: there its force is a function of the velocity, whatever its law.

At rest, after a reversal and at low speed every contact law leaves a residual of its own. What does not depend on the
law is seen in the faster half of the sliding samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.evidence import Improvement, blocks_of, improvement, preference
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion

MAX_STICKING = 0.05
"""Largest share of the contact that sticks while it counts as sliding: 5 %, by convention."""


def slides_fast(model: Model, motions: Sequence[Motion]) -> list[Booleans]:
    """Return for each motion the faster half of the samples of residuals at which the contact slides.

    Samples at which the log cuts the effort off do not count: it shows nothing there.

    Args:
        model: simulates the contact.
        motions: the motions, if any. Their median speed while sliding divides the halves.
    """
    slides = []
    for motion in motions:
        found = predict(model, motion)
        slides.append(motion.thinned(motion.is_moving & (found.sticking <= MAX_STICKING) & found.is_shown))
    speeds = [np.abs(motion.thinned(motion.velocity)) for motion in motions]
    sliding = np.concatenate([np.zeros(0), *(speed[at] for speed, at in zip(speeds, slides, strict=True))])
    middle = float(np.median(sliding)) if len(sliding) else 0.0
    return [at & (speed >= middle) for speed, at in zip(speeds, slides, strict=True)]


def sliding_shares(model: Model, evaluation: EvaluationData) -> list[Floats]:
    """Return the share of the contact that slides at the samples of each block of ``Evidence.all``.

    Effects that another contact law cannot imitate are compared while the contact slides. Where the model leaves more
    than noise, the contact has another law than that of the file, and the faster half of the sliding samples counts.

    Args:
        model: simulates the contact.
        evaluation: the recordings.
    """
    found: list[Floats] = []
    is_contact_right = evaluation.is_gap_closed(model)
    for data in (evaluation.fit_data, evaluation.held_out_data):
        if is_contact_right:
            shares = _slides(model, data.motions)
        else:
            shares = [np.asarray(fast, dtype=np.float64) for fast in slides_fast(model, data.motions)]
        for motion, noise, share in zip(data.motions, data.noise, shares, strict=True):
            count = noise.length(len(motion.thinned(motion.time)))
            at = np.linspace(0.0, len(share) - 1.0, count)
            period = len(motion.time) * motion.period / count
            found += blocks_of(np.interp(at, np.arange(len(share)), share), period, evaluation.criteria.block)
    return found


def _slides(model: Model, motions: Sequence[Motion]) -> list[Floats]:
    """Return for each motion the share of the contact that slides at the samples of residuals.

    Samples at rest, or so slow that the encoder hardly shows the motion, do not count: they add more noise than they
    tell.
    """
    sticks = [motion.thinned(motion.stick_indicator(predict(model, motion).sticking)) for motion in motions]
    return [1.0 - np.clip(stick, 0.0, 1.0) for stick in sticks]


def fast_sliding_residual(rest: WeightedResidual, model: Model, criteria: Criteria) -> Floats | None:
    """Return the residual while the contact slides fast, or None where the recordings hardly show it [N].

    Args:
        rest: the residual.
        model: simulates the contact.
        criteria: length of a block; two of them have to be left.
    """
    fast = slides_fast(model, rest.motions)
    values = np.concatenate([residual[at] for residual, at in zip(rest.residual, fast, strict=True)])
    is_enough = len(values) * rest.motions[0].residual_period >= 2.0 * criteria.block
    return np.asarray(values, dtype=np.float64) if is_enough else None


def preference_over_logarithmic_friction(
    model: Model, known: WeightedResidual, left: WeightedResidual, others: WeightedResidual, criteria: Criteria
) -> float:
    """Return the z-score by which a model predicts better than a logarithmic friction while the contact slides fast.

    Laws of dry contacts do not all agree there: in those with rate and state the force changes with the logarithm of
    the velocity (Dieterich 1979, J. Geophysical Research 84(B5)). Such a force, beside other Coulomb and viscous
    friction, is fitted to what is left without the effects in question.

    Args:
        model: simulates the contact.
        known: residual without the effects in question, in the fitted recordings.
        left: residual with them, in the evaluated recordings.
        others: residual without them, in the evaluated recordings.
        criteria: length of a block.
    """
    strengths = _fitted_logarithmic_friction(known, slides_fast(model, known.motions))
    rival = others.minus([_along(motion) @ strengths for motion in others.motions])
    fast = [at.astype(np.float64) for at in slides_fast(model, left.motions)]
    ours, theirs = (replace(one, weights=fast).blocks(criteria.block) for one in (left, rival))
    return preference(ours, theirs)


def in_fast_sliding(name: str, share: float, criteria: Criteria) -> Test:
    """Return the test that an effect closes more than it leaves where contact laws hardly differ.

    Args:
        name: the effect, whose force is that of a mass.
        share: that it closes, see ``improvement_in_fast_sliding``.
        criteria: thresholds.
    """
    title = "share of the squared residual beside logarithmic friction, where the contact slides fast"
    return at_least(name, title, share, criteria.min_imitable_share)


def improvement_in_fast_sliding(
    model: Model, others: WeightedResidual, left: WeightedResidual, criteria: Criteria
) -> Improvement:
    """Return the improvement by an effect while the contact slides fast.

    No contact law leaves more there than a logarithmic friction (see above): what is left after the best one, fitted to
    either residual, is not of a contact.

    Args:
        model: simulates the contact.
        others: residual without the effect in question.
        left: residual with it, in the same recordings.
        criteria: length of a block.

    Returns:
        No improvement where the contact slides fast for less than two blocks.
    """
    fast = slides_fast(model, left.motions)
    if sum(map(np.count_nonzero, fast)) * left.motions[0].residual_period < 2.0 * criteria.block:
        return Improvement(0.0, 0.0, 0.0)
    weights = [at.astype(np.float64) for at in fast]
    before, after = (
        replace(_left_by_logarithmic_friction(rest, fast), weights=weights).blocks(criteria.block)
        for rest in (others, left)
    )
    return improvement(before, after)


def left_by_logarithmic_friction(rest: WeightedResidual, model: Model) -> WeightedResidual:
    """Return what the logarithmic friction leaves that fits a residual best while the contact slides fast.

    Args:
        rest: the residual.
        model: simulates the contact.
    """
    return _left_by_logarithmic_friction(rest, slides_fast(model, rest.motions))


def _left_by_logarithmic_friction(rest: WeightedResidual, fast: Sequence[Booleans]) -> WeightedResidual:
    strengths = _fitted_logarithmic_friction(rest, fast)
    return rest.minus([_along(motion) @ strengths for motion in rest.motions])


def _fitted_logarithmic_friction(rest: WeightedResidual, fast: Sequence[Booleans]) -> Floats:
    """Return the strengths of the logarithmic friction that fits a residual best, shape (3,)."""
    columns = [_along(motion)[at] for motion, at in zip(rest.motions, fast, strict=True)]
    forces = [part[at] for part, at in zip(rest.residual, fast, strict=True)]
    return np.asarray(np.linalg.lstsq(np.vstack(columns), np.concatenate(forces), rcond=None)[0], dtype=np.float64)


def _along(motion: Motion) -> Floats:
    """Return Coulomb, viscous and logarithmic friction along a motion, shape (n, 3)."""
    return logarithmic_friction(motion.thinned(motion.velocity))


def logarithmic_friction(velocity: Floats) -> Floats:
    """Return Coulomb, viscous and logarithmic friction at velocities, shape (n, 3); at rest there is none.

    Args:
        velocity: shape (n,) [m/s].
    """
    direction, speed = np.sign(velocity), np.abs(velocity)
    return np.column_stack([direction, velocity, direction * np.log(np.where(speed > 0.0, speed, 1.0))])
