"""Recordings with the noise and weights that whiten their residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.contact_slopes import contact_slopes
from sgms_observer.diagnosis.model import (
    Model,
    hidden_friction_drop,
    most_hidden_friction_drop,
    predict,
    unknown_initial_friction,
)
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.noise import Noise, UnknownFriction, fit_noise, largest_noise, with_extra_variance_of

MIN_NOISE_SHARE = 1.0e-3
"""Smallest rms noise of a measured force, as a share of the effort."""


@dataclass(frozen=True)
class WhitenedData:
    """Recordings with the noise and weights that whiten their residuals.

    Attributes:
        motions: recordings.
        noise: noise of each recording.
        weights: weights of the residuals of each recording.
    """

    motions: tuple[Motion, ...]
    noise: tuple[Noise, ...]
    weights: tuple[Floats, ...]

    def whitened(self, series: Sequence[Floats]) -> Floats:
        """Return whitened columns of all recordings.

        Args:
            series: for each recording a series at the working rate, shape (n,), or several, shape (columns, n).

        Returns:
            Shape (residuals,) or (residuals, columns).
        """
        parts = [
            noise.whitened(motion.low_pass(values).T, weights)
            for motion, noise, weights, values in zip(self.motions, self.noise, self.weights, series, strict=True)
        ]
        return np.concatenate(parts)

    def residual(self, model: Model) -> Floats:
        """Return the whitened residual of a model."""
        return self.whitened([predict(model, motion).residual for motion in self.motions])

    def residuals(self, models: Sequence[Model]) -> Floats:
        """Return the whitened residual of each model, shape (n, models), with one pass of the filters for all."""
        return self.whitened([
            np.array([predict(model, motion).residual for model in models]) for motion in self.motions
        ])  # fmt: skip

    def contact_slopes(self, nominal: Model, logs: Floats) -> Floats:
        """Return the whitened derivatives with respect to the parameters of the contact, see ``contact_slopes``."""
        return self.whitened([contact_slopes(nominal, logs, motion) for motion in self.motions])


def data_with_own_noise(motions: Sequence[Motion], model: Model) -> WhitenedData:
    """Return recordings with the noise fitted to the residual of a model."""
    unknown = [_unknown(model, motion) for motion in motions]
    noises = [
        fit_noise(
            motion.low_pass(predict(model, motion).residual), one, motion.residual_period, motion.band,
            MIN_NOISE_SHARE * float(np.std(motion.effort)),
        )
        for motion, one in zip(motions, unknown, strict=True)
    ]  # fmt: skip
    return _whitened_data(motions, noises, unknown)


def data_with_noise_of(motions: Sequence[Motion], data: WhitenedData, model: Model) -> WhitenedData:
    """Return recordings with the noise of other recordings, and with their own extra variances where they are larger.

    Args:
        motions: recordings; may be empty.
        data: the other recordings; the largest of their noises is used, with the largest extra variance at rest.
        model: model that computes where the contact sticks; the extra variances are those of its residual.
    """
    rest_variance = max(one.rest_variance for one in data.noise)
    noise = replace(largest_noise(data.noise), rest_variance=rest_variance)
    unknown = [_unknown(model, motion) for motion in motions]
    noises = [
        with_extra_variance_of(
            motion.low_pass(predict(model, motion).residual), replace(noise, period=motion.residual_period), one
        )
        for motion, one in zip(motions, unknown, strict=True)
    ]
    return _whitened_data(motions, noises, unknown)


def _whitened_data(
    motions: Sequence[Motion], noises: Sequence[Noise], unknown: Sequence[UnknownFriction]
) -> WhitenedData:
    """Return recordings with their noise and the weights that follow from it."""
    weights = tuple(noise.weights(one) for noise, one in zip(noises, unknown, strict=True))
    return WhitenedData(tuple(motions), tuple(noises), weights)


def _unknown(model: Model, motion: Motion) -> UnknownFriction:
    """Return what a recording does not tell of the friction; the model computes where the contact sticks."""
    return UnknownFriction(
        motion.thinned(motion.stick_indicator(predict(model, motion).sticking)),
        motion.thinned(_hidden_square(model, motion)),
        motion.thinned(most_hidden_friction_drop(model.friction, motion) ** 2 / 3.0),
    )


def _hidden_square(model: Model, motion: Motion) -> Floats:
    """Return the mean square of the friction that the recording does not determine [N^2].

    That is the force hidden by the encoder resolution, uniformly distributed from zero, and that of the unknown state
    at the start, uniformly distributed around zero.
    """
    drop, width = hidden_friction_drop(model.friction, motion), unknown_initial_friction(model.friction, motion)
    return np.asarray(drop**2 / 3.0 + width**2 / 12.0)
