"""What a run of the workflow has read and believes so far: every step of the search returns another state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from sgms_observer.diagnosis.fit import Refit, Refits, judged_with
from sgms_observer.diagnosis.gate import Gate, floor_of
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.diagnosis.record import Record
from sgms_observer.diagnosis.sharp import sharpened
from sgms_observer.diagnosis.timing import timing
from sgms_observer.settings.axis import EffectSettings

STEPS = 6
"""Steps of a fit from a point that was not fitted to these recordings,"""
AGAIN = 4
"""of one after the noise was fitted anew,"""
ANEW = 3
"""of one after the effort was moved,"""
LIMITED = 9
"""and of one that a limit pushes away from where it was."""
RETIMED = 0.01
"""The effort's timing is read again once an effect is found, if it moves by this many samples."""


@dataclass(frozen=True)
class Recordings:
    """Recordings as they are read now.

    Attributes:
        records: to learn from.
        holdouts: to judge on; may be empty.
        told: how late the settings say the effort arrives, in samples.
        lag: how late it is taken to arrive, in samples.
    """

    records: tuple[Record, ...]
    holdouts: tuple[Record, ...]
    told: float
    lag: float

    @cached_property
    def motions(self) -> tuple[Motion, ...]:
        """Return the recordings to learn from, filtered."""
        return tuple(motion_of(record, self.lag) for record in self.records)

    @cached_property
    def held_out(self) -> tuple[Motion, ...]:
        """Return the recordings to judge on, filtered."""
        return tuple(motion_of(record, self.lag) for record in self.holdouts)


@dataclass(frozen=True)
class State:
    """What is believed of an axis and its recordings.

    Attributes:
        recordings: as they are read now.
        nominal: the given model without its effects.
        refits: refits of the same with more elements, weighed with the noise as it is known now.
        found: refit with the effects that the axis was given with.
        current: refit with those found so far as well.
        seed: of all chance.
        floor: rms residual that a perfect model would leave on the recordings to judge on [N].
    """

    recordings: Recordings
    nominal: Model
    refits: Refits
    found: Refit
    current: Refit
    seed: int
    floor: float = math.inf

    @property
    def gate(self) -> Gate:
        """Return the recordings to judge on with their floor."""
        return Gate(self._judging, self.floor, bool(self.recordings.holdouts))

    @property
    def _judging(self) -> tuple[Motion, ...]:
        """Return the recordings to judge on: those to learn from where there are no others."""
        return self.recordings.held_out or self.recordings.motions

    def limited(self, limit: float) -> State:
        """Return the state with a limit of the friction parameters, from before anything is found.

        Args:
            limit: see ``refit``.
        """
        state = replace(self, refits=replace(self.refits, limit=limit))
        state = state._weighed(self.refits.nominal.with_effects(self.found.effects))
        state = replace(state, current=state.refits.of(self.found.effects, self.found.logs, LIMITED))
        state = state._refitted(state.current, LIMITED)
        return replace(state._weighed(state.current.model), found=state.current)

    def with_effect(self, best: Refit) -> State:
        """Return the state after an effect was accepted: noise, timing, contact and floor are asked again.

        Args:
            best: fit with the effect.
        """
        state = self._refitted(best, STEPS)
        lag = state._lag()
        if abs(lag - state.recordings.lag) > RETIMED:
            state = state._read(lag)._refitted(state.current, AGAIN)
        sharp = state._sharpened(STEPS)
        if sharp is not state:
            state = replace(sharp, found=sharp.refits.of(self.found.effects, self.found.logs, STEPS))
        return state.with_floor()

    def with_floor(self) -> State:
        """Return the state with the floor of its model: noise fitted under a hidden effect is too loud, so it falls."""
        floor = floor_of(self._judging, self.current.model, self.refits.judged.noise, self.seed)
        return replace(self, floor=min(self.floor, floor))

    def _lag(self) -> float:
        """Return how late the effort arrives, see ``timing``."""
        return timing(self.refits.judged, self.current, self.recordings.lag, self.recordings.told)

    def _read(self, lag: float) -> State:
        """Return the state with its recordings read anew."""
        return replace(self, recordings=replace(self.recordings, lag=lag))

    def _weighed(self, model: Model) -> State:
        """Return the state with the noise that a model leaves."""
        return replace(self, refits=replace(self.refits, judged=judged_with(self.recordings.motions, model)))

    def _refitted(self, start: Refit, steps: int) -> State:
        """Return the state fitted on from ``start``, with the noise that this one leaves."""
        state = self._weighed(start.model)
        return replace(state, current=state.refits.of(start.effects, start.logs, steps))

    def _sharpened(self, steps: int) -> State:
        """Return the state with the sharp contact where the recordings show it, else this one."""
        sharp = sharpened(self.refits, self.current, self._judging)
        if sharp is None:
            return self
        fine = replace(self.refits.nominal, is_sharp=True)
        state = replace(self, nominal=replace(self.nominal, is_sharp=True), refits=replace(self.refits, nominal=fine))
        return state._refitted(sharp, steps)


def started(
    recordings: Recordings, nominal: Model, own: Sequence[EffectSettings], tolerance: float, seed: int
) -> State:
    """Return the state after the nominal model was refitted, with the contact and the timing that the recordings show.

    Args:
        recordings: as the settings say they are to be read.
        nominal: the given model without its effects.
        own: the effects it was given with.
        tolerance: largest relative error of its parameters that its owner expects.
        seed: of all chance.
    """
    fine = nominal.refined()
    refits = Refits(judged_with(recordings.motions, fine.with_effects(own)), fine, tolerance)
    first = refits.of(own, None, STEPS)
    state = State(recordings, nominal, refits, first, first, seed)._sharpened(AGAIN)
    for _ in range(2):
        lag = state._lag()
        if lag == state.recordings.lag:
            break
        state = state._read(lag)._refitted(state.current, ANEW)
    state = state._refitted(state.current, AGAIN)
    return replace(state, found=state.current)
