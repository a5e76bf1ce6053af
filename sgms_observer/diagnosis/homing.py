"""Position offset between recordings: an axis that is not homed has another position origin in each recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.evidence import improvement, in_blocks
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units

PITCH = "pitch"
OFFSETS_PER_PITCH = 60
"""Number of offsets that are tried over one pitch."""
MIN_CLOSED_SHARE = 0.5
"""Smallest share of the closable squared residual that an offset removes in a recording that is not homed."""


def pitch_of(effects: Sequence[EffectSettings]) -> float | None:
    """Return the longest pitch of the effects that are periodic in the position [m], or None."""
    pitches = [
        value
        for item in effects
        for parameter, value in zip(effect(item.name).parameters, item.values, strict=False)  # a table has more values
        if parameter.name == PITCH
    ]
    return max(pitches, default=None)


def with_position_offset(motion: Motion, offset: float) -> Motion:
    """Return a motion with an offset added to its positions.

    Args:
        motion: the recording.
        offset: the offset [m].
    """
    return replace(motion, position=motion.position + offset, raw=motion.raw + offset)


def position_offset(model: Model, motion: Motion, seconds: float | None = None) -> float:
    """Return the position offset within one pitch for which the residual is smallest [m].

    Args:
        model: friction and effects, one of them periodic in the position.
        motion: the recording.
        seconds: length of the beginning of the recording that counts; all of it if None.

    Raises:
        ValueError: no effect of the model is periodic in the position.
    """
    pitch = pitch_of(model.effects)
    if pitch is None:
        raise ValueError("no effect of the model is periodic in the position; the position offset is not identifiable")
    count = None if seconds is None else round(seconds / motion.residual_period)

    def error(offset: float) -> float:
        shifted = with_position_offset(motion, offset)
        return float(np.sum(np.square(shifted.low_pass(predict(model, shifted).residual)[:count])))

    offsets = np.linspace(0.0, pitch, OFFSETS_PER_PITCH, endpoint=False)
    return float(offsets[int(np.argmin([error(offset) for offset in offsets]))])


def homing_warnings(models: Sequence[Model], evaluation: EvaluationData, units: Units) -> list[str]:
    """Return a warning for each held-out recording that has a position offset.

    Args:
        models: fitted models. The first with an effect that is periodic in the position counts.
        evaluation: the recordings.
        units: units of the axis.
    """
    rippled = [model for model in models if pitch_of(model.effects) is not None]
    if not rippled or not evaluation.has_held_out:
        return []
    model, criteria = rippled[0], evaluation.criteria
    warnings = []
    for motion, weights in zip(evaluation.motions, evaluation.weights, strict=True):
        here = weights * motion.low_pass(predict(model, motion).residual)
        closable = float(here @ here) - evaluation.floor**2 * len(here)
        if closable <= 0.0:
            continue
        offset = position_offset(model, motion)
        shifted = with_position_offset(motion, offset)
        after = weights * shifted.low_pass(predict(model, shifted).residual)
        gain = improvement(*(in_blocks([part], [motion], criteria.block) for part in (here, after)))
        if gain.z_score > criteria.z_score_of(OFFSETS_PER_PITCH) and gain.decrease > MIN_CLOSED_SHARE * closable:
            warnings.append(
                f"the position of {motion.name} seems shifted by {units.readable(offset)}. If the axis was not homed"
                f" before each recording, home it; position-dependent effects cannot be judged on {motion.name}"
            )
    return warnings
