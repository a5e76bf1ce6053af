"""Position offset between recordings: an axis that is not homed has another position origin in each recording.

Nothing that depends on the position can be judged on such a recording as it is. Where a ripple of the fitted recordings
surely tells the offset, the recording is judged with its positions shifted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar

from sgms_observer.diagnosis.diagnosis import Diagnosis, FitState
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
    """Return the position offset within half a pitch for which the residual is smallest [m].

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
    offsets = np.linspace(-0.5 * pitch, 0.5 * pitch, OFFSETS_PER_PITCH, endpoint=False)
    return float(offsets[int(np.argmin([_squared_residual(model, motion, offset, count) for offset in offsets]))])


def _squared_residual(model: Model, motion: Motion, offset: float, count: int | None = None) -> float:
    """Return the sum of the squared residual with an offset of the position, of the first ``count`` samples [N^2]."""
    shifted = with_position_offset(motion, offset)
    return float(np.sum(np.square(shifted.low_pass(predict(model, shifted).residual)[:count])))


@dataclass(frozen=True)
class Shift:
    """Offset of the position of a held-out recording.

    Attributes:
        place: index of the recording among the held-out ones.
        name: of the recording.
        offset: added to its positions, it fits what was learnt from the others best of those within half a pitch [m].
        pitch: the offset is known within multiples of this length [m].
    """

    place: int
    name: str
    offset: float
    pitch: float

    def warning(self, units: Units) -> str:
        """Return what the recording says, and what to do."""
        pitch = units.readable(self.pitch)
        return (
            f"the positions of {self.name} fit with {units.readable(self.offset)} added, up to multiples of {pitch}. It"
            " was judged so: effects of the position that do not repeat within"
            f" {pitch} cannot be judged on {self.name}. If the axis was not homed before each recording, home it"
        )


def shifts_in(diagnosis: Diagnosis) -> tuple[Shift, ...]:
    """Return the sure offsets of held-out recordings.

    Args:
        diagnosis: with the recordings as they are. Its final model counts first: a model of the search lacks what was
            added later. A wrong position may also have refused an effect that is periodic in the position. Of the
            hypotheses with one that the final model has not, the best fit in the first round that has one counts.
    """
    evaluation, final = diagnosis.evaluation, diagnosis.written.after
    found = position_shifts(final.model, evaluation)
    if found:
        return found
    has = {item.name for item in final.effects} - diagnosis.written.setup.held_effects
    for item in diagnosis.rounds:
        candidates = [one.candidate for one in item.decisions if one.candidate.name not in has]
        refused = [one.refit for one in candidates if one.settings and pitch_of([one.settings]) is not None]
        if refused:
            return position_shifts(min(refused, key=lambda fit: fit.cost).model, evaluation)
    return ()


def position_shifts(model: Model, evaluation: EvaluationData) -> tuple[Shift, ...]:
    """Return the sure offsets of held-out recordings.

    Args:
        model: model with an effect that is periodic in the position.
        evaluation: the recordings.
    """
    criteria, found = evaluation.criteria, []
    pitch = pitch_of(model.effects)
    if pitch is None or not evaluation.has_held_out:
        return ()
    for place, (motion, weights) in enumerate(zip(evaluation.motions, evaluation.weights, strict=True)):
        here = weights * motion.low_pass(predict(model, motion).residual)
        closable = float(here @ here) - evaluation.floor**2 * float(weights @ weights)
        if closable <= 0.0:
            continue
        offset = _refined(model, motion, position_offset(model, motion), pitch / OFFSETS_PER_PITCH)
        shifted = with_position_offset(motion, offset)
        after = weights * shifted.low_pass(predict(model, shifted).residual)
        gain = improvement(*(in_blocks([part], [motion], criteria.block) for part in (here, after)))
        if gain.z_score > criteria.z_score_of(OFFSETS_PER_PITCH) and gain.decrease > MIN_CLOSED_SHARE * closable:
            found.append(Shift(place, motion.name, offset, pitch))
    return tuple(found)


def _refined(model: Model, motion: Motion, offset: float, step: float) -> float:
    """Return the offset with the smallest residual within a step of another one [m]."""
    ends = (offset - step, offset + step)
    return float(minimize_scalar(lambda at: _squared_residual(model, motion, at), bounds=ends, method="bounded").x)


def with_shifted_positions(state: FitState, shifts: Sequence[Shift]) -> FitState:
    """Return the state with offsets added to the positions of held-out recordings."""
    holdouts = list(state.recordings.holdouts)
    for shift in shifts:
        holdouts[shift.place] = holdouts[shift.place].shifted(shift.offset)
    recordings = replace(state.recordings, holdouts=tuple(holdouts))
    return replace(
        state, recordings=recordings, held_out_motions=recordings.held_out([one.lag for one in state.held_out_motions])
    )
