"""Where on the machine a recording counts its position from: an axis that is not homed begins anew each time."""

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
PLACES_PER_PITCH = 60
"""Places that are tried over one pitch."""
MIN_CLOSED_SHARE = 0.5
"""A recording counts from elsewhere when another place closes this share of its closable squared residual."""


def pitch_of(effects: Sequence[EffectSettings]) -> float | None:
    """Return the longest pitch of the effects that return with the position [m], or None where there is none."""
    pitches = [
        value
        for item in effects
        for parameter, value in zip(effect(item.name).parameters, item.values, strict=False)  # a table has more values
        if parameter.name == PITCH
    ]
    return max(pitches, default=None)


def with_position_offset(motion: Motion, offset: float) -> Motion:
    """Return a motion that counts its position from another place.

    Args:
        motion: the recording.
        place: what its positions lack [m].
    """
    return replace(motion, position=motion.position + offset, raw=motion.raw + offset)


def position_offset(model: Model, motion: Motion, seconds: float | None = None) -> float:
    """Return where within one pitch a motion counts its position from, as the model's ripple tells [m].

    Args:
        model: friction and effects; with an effect that returns with the position.
        motion: the recording.
        seconds: length of its beginning that may tell it; all of it if None.

    Raises:
        ValueError: no effect of the model returns with the position.
    """
    pitch = pitch_of(model.effects)
    if pitch is None:
        raise ValueError("no effect of the model returns with the position, so nothing tells the place")
    count = None if seconds is None else round(seconds / motion.residual_period)

    def error(offset: float) -> float:
        shifted = with_position_offset(motion, offset)
        return float(np.sum(np.square(shifted.low_pass(predict(model, shifted).residual)[:count])))

    offsets = np.linspace(0.0, pitch, PLACES_PER_PITCH, endpoint=False)
    return float(offsets[int(np.argmin([error(offset) for offset in offsets]))])


def homing_warnings(models: Sequence[Model], evaluation: EvaluationData, units: Units) -> list[str]:
    """Return a sentence for each held-out recording that counts its position from elsewhere.

    Args:
        models: fits with an effect that may return with the position.
        court: the recordings.
        units: of the axis.
    """
    rippled = [model for model in models if pitch_of(model.effects) is not None]
    if not rippled or not evaluation.has_held_out:
        return []
    model, criteria = rippled[0], evaluation.criteria
    warnings = []
    for motion, weights in zip(evaluation.motions, evaluation.weights, strict=True):
        here = weights * motion.low_pass(predict(model, motion).residual)
        offset = position_offset(model, motion)
        shifted = with_position_offset(motion, offset)
        after = weights * shifted.low_pass(predict(model, shifted).residual)
        gain = improvement(*(in_blocks([part], [motion], criteria.block) for part in (here, after)))
        closable = gain.before - evaluation.floor**2 * len(here)
        if gain.z_score > criteria.z_score_of(PLACES_PER_PITCH) and gain.decrease > MIN_CLOSED_SHARE * closable > 0.0:
            warnings.append(
                f"{motion.name} fits if it counts its position from {units.readable(offset)} further along: home the"
                " axis before each recording, or no effect that is bound to a place can be judged on it"
            )
    return warnings
