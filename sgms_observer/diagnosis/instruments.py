"""How much of an effect the response to the reference shows, with the reference as instrument.

A controller feeds encoder noise and disturbances back into the effort, so that a residual and the rate of the effort
correlate where there is no delay. The reference correlates with neither.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.gap import residuals
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.sliding import logarithmic_friction, slides_fast
from sgms_observer.effects.catalogue import effect


@dataclass(frozen=True)
class Share:
    """Share of an effect that the response to the reference shows.

    Attributes:
        value: 1 for all of it [-].
        error: its standard error, by its scatter between blocks of time [-].
    """

    value: float
    error: float

    def least(self, criteria: Criteria) -> float:
        """Return the smallest likely share."""
        return self.value - criteria.interval_z_score * self.error

    def counted(self, criteria: Criteria) -> float:
        """Return the share itself where its 90 % interval cannot hold both none and all of the effect, else its upper
        end: then the response tells nothing against the effect."""
        half_width = criteria.interval_z_score * self.error
        return self.value if 2.0 * half_width < 1.0 else self.value + half_width


def delay_in_response(model: Model, name: str, evaluation: EvaluationData) -> Share | None:
    """Return the share of a delay that the response to the reference shows, or None where nothing shows it.

    Args:
        model: the model with it.
        name: the effect; None is returned for one that is no delay.
        evaluation: the recordings.
    """
    if not effect(name).is_delay or not evaluation.references:
        return None
    others = replace(model, effects=tuple(one for one in model.effects if one.name != name))
    return share_in_response(model, others, evaluation.motions, evaluation.references, evaluation.criteria)


def is_shown(in_response: Share | None, criteria: Criteria) -> bool:
    """Return whether the response to the reference surely shows a delay, which no contact makes.

    Args:
        in_response: share of the delay that the response shows, or None.
        criteria: thresholds.
    """
    return in_response is not None and in_response.least(criteria) >= criteria.min_imitable_share


def or_in_response(test: Test, in_response: Share | None, criteria: Criteria) -> Test:
    """Return a test that another contact law could fail or feign; where it fails, that the response to the reference
    surely shows the delay, which no contact makes.

    Args:
        test: of a delay, or of another effect.
        in_response: share of the delay that the response to the reference shows, or None.
        criteria: thresholds.
    """
    if test.passed or in_response is None:
        return test
    title = "smallest likely share of the delay in the response to the reference"
    return at_least(test.of, title, in_response.least(criteria), criteria.min_imitable_share)


def share_in_response(
    with_it: Model, others: Model, motions: Sequence[Motion], references: Sequence[Floats | None], criteria: Criteria
) -> Share | None:
    """Return the share of an effect that the response to the reference shows while the contact slides fast.

    The residual without the effect is fitted with the change that the effect makes, a mass, a spring, a constant, and
    Coulomb, viscous and logarithmic friction, by two-stage least squares.

    Args:
        with_it: the model with the effect.
        others: the same without it.
        motions: the recordings.
        references: set-points of each recording as recorded [m], or None.
        criteria: length of a block.

    Returns:
        None where no recording has a reference, or the contact slides fast for less than two blocks.

    Source: Janot, Vandanjon, Gautier 2014, IEEE Transactions on Control Systems Technology 22(1).
    """
    known = [(motion, given) for motion, given in zip(motions, references, strict=True) if given is not None]
    fast = slides_fast(with_it, [motion for motion, _ in known])
    parts = [_columns(with_it, others, *pair, at) for pair, at in zip(known, fast, strict=True)]
    length = round(criteria.block / known[0][0].residual_period) if known else 1
    count = sum(len(residual) for residual, _, _ in parts) // length
    if count < 2:
        return None
    residual, columns, instruments = (np.concatenate(part)[: count * length] for part in zip(*parts, strict=True))
    return Share(*first_strength(residual, columns, instruments, length))


def first_strength(residual: Floats, columns: Floats, instruments: Floats, length: int) -> tuple[float, float]:
    """Return the strength of the first column and its standard error, by its scatter between blocks.

    Two-stage least squares; where the instruments are the columns, ordinary least squares.

    Args:
        residual: whole blocks of it, shape (n,).
        columns: shape (n, k).
        instruments: shape (n, at least k).
        length: number of samples of a block.
    """
    explained = instruments @ np.linalg.lstsq(instruments, columns, rcond=None)[0]
    strengths = np.linalg.lstsq(explained, residual, rcond=None)[0]
    scores = (explained * (residual - columns @ strengths)[:, None]).reshape(len(residual) // length, length, -1)
    inverse = np.linalg.pinv(explained.T @ explained)
    return float(strengths[0]), float(np.linalg.norm(scores.sum(axis=1) @ inverse[0]))


def _columns(
    with_it: Model, others: Model, motion: Motion, given: Floats, fast: Booleans
) -> tuple[Floats, Floats, Floats]:
    """Return residual, columns of its fit and their instruments where the contact slides fast: (n,), (n, 7), (n, 8)."""
    (left,), (rest,) = (residuals(model, [motion]) for model in (others, with_it))
    columns = np.column_stack([left - rest, forces_beside(motion)])
    return left[fast], columns[fast], instruments_of(motion, given)[fast]


def forces_beside(motion: Motion) -> Floats:
    """Return the forces that are fitted beside a lag: mass, friction, spring and a constant, shape (n, 6).

    What the model lacks of them would look like a lag where the recording is short.

    Args:
        motion: the recording.
    """
    friction = logarithmic_friction(motion.thinned(motion.velocity))
    spring = motion.thinned(motion.position)
    return np.column_stack([motion.low_pass(motion.acceleration), friction, spring, np.ones(len(spring))])


def instruments_of(motion: Motion, given: Floats) -> Floats:
    """Return what the reference makes of the forces beside a lag, and of the derivatives of acceleration, shape (n, 8).

    Args:
        motion: the recording.
        given: its set-points as recorded [m].
    """
    velocity = np.gradient(motion.smoothed(given)[: len(motion.time)], motion.period)
    place = motion.thinned(given[: len(motion.time)])
    instruments = [logarithmic_friction(motion.thinned(velocity)), np.column_stack([place, np.ones(len(place))])]
    derivative = velocity
    for _ in ("acceleration", "jerk", "snap"):
        derivative = np.gradient(derivative, motion.period)
        instruments.append(motion.low_pass(derivative / max(float(np.std(derivative)), 1.0e-300))[:, None])
    return np.hstack(instruments)
