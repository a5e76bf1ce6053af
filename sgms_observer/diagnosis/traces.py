"""Traces: measured and modelled signals below the band, for the report and residual.mcap."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.arrays import Booleans, Floats
from sgms_observer.diagnosis.answer import Answer
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.offline.recording import Recording

SLIDING = 0.01
"""Largest stick indicator of a sliding axis: the last element has slipped."""
RINGING = 2.0
"""Smallest distance of a sliding row from a sticking one, in periods of the band: the transient of the low-pass."""


@dataclass(frozen=True)
class Trace:
    """Measured and modelled signals of one recording or a half of it, below the band; arrays of shape (n,).

    Attributes:
        name: name of the recording.
        start: stamp of the first sample of the recording [s].
        time: time of each row since then [s].
        position, velocity: motion [m or rad, per s].
        effort: measured effort [N or N m].
        before: effort predicted by the file refitted within its tolerance [N or N m].
        after: effort predicted by the final model [N or N m].
        effects: change of the modelled effort by each effect of that model [N or N m].
        friction: measured effort minus the effort of mass and effects [N or N m].
        is_sliding: whether friction depends on the velocity alone.
        tracking_error: position minus set-point [m or rad]; NaN if no set-point was recorded.
        weight: weight of each row in the gap [-].
    """

    name: str
    start: float
    time: Floats
    position: Floats
    velocity: Floats
    effort: Floats
    before: Floats
    after: Floats
    effects: dict[str, Floats]
    friction: Floats
    is_sliding: Booleans
    tracking_error: Floats
    weight: Floats

    @property
    def residual_before(self) -> Floats:
        """Return the residual of the file refitted within its tolerance."""
        return self.effort - self.before

    @property
    def residual(self) -> Floats:
        """Return the residual of the final model."""
        return self.effort - self.after

    @property
    def modelled_friction(self) -> Floats:
        """Return the friction that the model predicts."""
        return self.friction - self.residual


def traces_of(answer: Answer) -> tuple[Trace, ...]:
    """Return the traces of the recordings that the gap is computed on.

    Args:
        answer: answer of the diagnosis.
    """
    recordings = answer.diagnosis.final_state.recordings
    records = recordings.holdouts or tuple(record for record in recordings.records for _half in range(2))
    both = zip(answer.residual_before, answer.residual_after, strict=True)
    return tuple(
        _trace(record, motion, answer.model, before, after, weight)
        for record, motion, (before, after), weight in zip(records, answer.motions, both, answer.weights, strict=True)
    )


def _trace(record: Recording, motion: Motion, model: Model, before: Floats, after: Floats, weight: Floats) -> Trace:
    """Return one trace."""
    whole = predict(model, motion)
    effects = {}
    for item in model.effects:
        others = replace(model, effects=tuple(one for one in model.effects if one.name != item.name))
        effects[item.name] = motion.low_pass(predict(others, motion).residual - whole.residual)
    effort = motion.low_pass(motion.effort)
    friction = whole.friction + model.friction.viscous_coefficient * motion.velocity
    time = motion.thinned(motion.time)
    return Trace(
        motion.name, record.start, time, motion.thinned(motion.position), motion.thinned(motion.velocity), effort,
        effort - before, effort - after, effects, motion.low_pass(friction) + after,
        _is_sliding(motion, motion.stick_indicator(whole.sticking)), _tracking_error(record, time),
        weight,
    )  # fmt: skip


def _is_sliding(motion: Motion, stick_indicator: Floats) -> Booleans:
    """Return the rows where the axis slides and has slid for some periods of the band."""
    width = max(1, int(RINGING / motion.band / motion.period))
    sticks = np.convolve(stick_indicator > SLIDING, np.ones(2 * width + 1), mode="same")
    slides: Booleans = motion.thinned(sticks) < 0.5
    return slides


def _tracking_error(record: Recording, time: Floats) -> Floats:
    """Return position minus set-point as recorded, at the rows of a trace."""
    if record.reference_position is None:
        return np.full(len(time), np.nan)
    error = record.position - record.reference_position
    place = np.clip(np.round(time / record.period).astype(np.int64), 0, len(error) - 1)
    return np.asarray(error[place], dtype=np.float64)
