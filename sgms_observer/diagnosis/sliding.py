"""Where the contact slides: there its force is a function of the velocity, whatever its law.

At rest, after a reversal and at low speed every contact law leaves a residual of its own. What does not depend on the
law is seen in the faster half of the sliding samples.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.evidence import blocks_of
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.uncertainty import series_length

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

MAX_STICKING = 0.05
"""Largest share of the contact that sticks while it counts as sliding."""


def slides_fast(model: Model, motions: Sequence[Motion]) -> list[Flags]:
    """Return for each motion the faster half of the samples of residuals at which the contact slides.

    Args:
        model: simulates the contact.
        motions: the motions, if any. Their median speed while sliding divides the halves.
    """
    slides = [
        motion.thinned(motion.is_moving & (predict(model, motion).stick_indicator <= MAX_STICKING))
        for motion in motions
    ]
    speeds = [np.abs(motion.thinned(motion.velocity)) for motion in motions]
    sliding = [value for speed, at in zip(speeds, slides, strict=True) for value in speed[at].tolist()]
    middle = float(np.median(sliding)) if sliding else 0.0
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
    for data in (evaluation.fit_data, evaluation.held_out_data):
        fast = None if evaluation.is_gap_closed(model) else slides_fast(model, data.motions)
        for place, (motion, noise) in enumerate(zip(data.motions, data.noise, strict=True)):
            share = 1.0 - np.clip(motion.thinned(predict(model, motion).stick_indicator), 0.0, 1.0)
            if fast is not None:
                share = fast[place].astype(np.float64)
            count = series_length(motion, noise)
            at = np.linspace(0.0, len(share) - 1.0, count)
            period = len(motion.time) * motion.period / count
            found += blocks_of(np.interp(at, np.arange(len(share)), share), period, evaluation.criteria.block)
    return found
