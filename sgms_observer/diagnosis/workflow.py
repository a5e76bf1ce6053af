"""The workflow: refit the file, add the hypothesis that predicts best what it was not fitted to, and repeat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis import audit
from sgms_observer.diagnosis.candidates import LAST_STEPS, MOST_COMPARED, Candidate, effect_candidates, to_the_end
from sgms_observer.diagnosis.contact_start import contact_start
from sgms_observer.diagnosis.coordinates import is_law, is_like_contact
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least
from sgms_observer.diagnosis.decision import (
    CHANGED,
    Court,
    Decision,
    alternatives,
    apart,
    changed_refits,
    decide,
    evidence_of,
)
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import Freedom, Refit, Refits, judged_as, judged_with
from sgms_observer.diagnosis.gap import noise_floors, residuals, rms, weighted
from sgms_observer.diagnosis.learnt import LEARNT_NAMES
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import BAND, HELD, Motion, motion_of
from sgms_observer.diagnosis.screen import Look, Screen
from sgms_observer.diagnosis.timing import NOT_HELD, timing
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.catalogue import names as catalogue_names
from sgms_observer.errors import DataError
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings

Report = Callable[[str, float], None]
Floats = NDArray[np.float64]

STEPS = 6
"""Steps of a fit from a point that was not fitted to these recordings,"""
AGAIN = 4
"""and of one after the noise was fitted anew."""
READ_OFF = ("quantisation", *LEARNT_NAMES)
"""Effects that are read off the data, or made of them, and not searched."""


@dataclass(frozen=True)
class Options:
    """How to run.

    Attributes:
        tolerance: largest relative error of the file's values that its owner expects.
        seed: of all chance.
        workers: threads.
        band: residuals are judged below this frequency [Hz]; 0 chooses it from rate and encoder.
        criteria: thresholds of every test.
        excluded: hypotheses that are not tried.
    """

    tolerance: float = 0.05
    seed: int = 1
    workers: int = 2
    band: float = 0.0
    criteria: Criteria = field(default_factory=Criteria)
    excluded: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Recordings:
    """Recordings as they are read now.

    Attributes:
        records: to learn from.
        holdouts: to judge on; may be empty.
        stated_lag: how late the settings say the effort arrives, in samples.
        lag: how late it is taken to arrive, in samples.
        band: residuals are judged below this frequency [Hz].
    """

    records: tuple[Recording, ...]
    holdouts: tuple[Recording, ...]
    stated_lag: float
    lag: float
    band: float

    def motions(self) -> tuple[Motion, ...]:
        """Return the recordings to learn from, filtered."""
        return tuple(motion_of(record, self.lag, self.band) for record in self.records)

    def held_out(self) -> tuple[Motion, ...]:
        """Return the recordings to judge on, filtered."""
        return tuple(motion_of(record, self.lag, self.band) for record in self.holdouts)


@dataclass(frozen=True)
class State:
    """Estimate of an axis and its recordings.

    Attributes:
        recordings: as they are read now.
        learn: recordings to learn from, filtered.
        held: held-out recordings, filtered.
        refits: how the model is fitted: noise, freedom, effects of the file that keep their values.
        current: the fit.
    """

    recordings: Recordings
    learn: tuple[Motion, ...]
    held: tuple[Motion, ...]
    refits: Refits
    current: Refit

    def refitted(self, start: Refit, steps: int) -> State:
        """Return the state fitted on from ``start``, with the noise that this one leaves."""
        refits = replace(self.refits, judged=judged_with(self.learn, start.model))
        return replace(self, refits=refits, current=refits.of(start.effects, start.logs, steps))

    def timed(self) -> State:
        """Return the state with the effort at the time that the recordings show."""
        state = self
        for _ in range(2):
            lag = timing(state.refits.judged, state.current, state.recordings.lag, state.recordings.stated_lag)
            if lag == state.recordings.lag:
                break
            recordings = replace(state.recordings, lag=lag)
            state = replace(state, recordings=recordings, learn=recordings.motions(), held=recordings.held_out())
            state = state.refitted(state.current, AGAIN)
        return state

    def court(self, options: Options, first: Model | None = None) -> Court:
        """Return the recordings that evidence is taken from.

        Args:
            options: how to run.
            first: model of the file refitted within its tolerance; the current one if None.
        """
        judged = self.refits.judged
        judge = self.held or self.learn
        held = judged_as(self.held, judged, self.current.model)
        own = held if self.held else judged
        weightings = own.weights, own.gap_weights
        floor, reported_floor = noise_floors(judge, self.current.model, judged.noise, options.seed, *weightings)
        left = residuals(first or self.current.model, judge)
        gap, reported_gap = (rms(weighted(left, weights)) for weights in weightings)
        return Court(
            self.learn, judge, judged, held, floor, gap, reported_floor, reported_gap, options.criteria, options.seed
        )


@dataclass(frozen=True)
class Round:
    """One pass through the loop.

    Attributes:
        looks: first look at every effect.
        decisions: hypotheses that were fitted to the end, the best predicting first.
        accepted: the one that was added, or None.
        alternatives: names that the data do not tell from it.
    """

    looks: dict[str, Look]
    decisions: tuple[Decision, ...]
    accepted: Decision | None
    alternatives: tuple[str, ...]


@dataclass(frozen=True)
class Diagnosis:
    """Everything the run decided.

    Attributes:
        nominal: the given model without its effects.
        own: the effects it was given with.
        found: state after the refit within the tolerance.
        state: state with everything that was accepted.
        before: refit of the model with its own elements.
        after: the same with everything that was accepted.
        after_refits: how the latter was fitted.
        rounds: passes through the loop.
        court: recordings that evidence was taken from, with the noise that is left in the end.
        resolution: coarser encoder step than the settings say [its unit], or None.
        notes: sentences about the recordings.
        warnings: what must not be overlooked.
        is_poor: whether the recordings cannot show anything.
        tests: tests of the whole model.
        explains_all: whether what was accepted leaves no share of the gap that would count as predictable.
    """

    nominal: Model
    own: tuple[EffectSettings, ...]
    found: State
    state: State
    before: Refit
    after: Refit
    after_refits: Refits
    rounds: tuple[Round, ...]
    court: Court
    resolution: float | None
    notes: tuple[str, ...] = field(default=())
    warnings: tuple[str, ...] = field(default=())
    is_poor: bool = False
    tests: tuple[Test, ...] = field(default=())
    explains_all: bool = True

    @property
    def accepted(self) -> list[Round]:
        """Return the rounds that added an effect that is named.

        One that describes nothing but another contact law is a name only where all is explained with it; else it is a
        changed value of the file.
        """
        added = [(item, item.accepted.candidate) for item in self.rounds if item.accepted]
        return [item for item, one in added if one.settings is not None and one.name not in self.bent]

    @property
    def changes(self) -> frozenset[str]:
        """Return the hypotheses on values of the file that were added."""
        added = [item.accepted.candidate for item in self.rounds if item.accepted]
        return frozenset(one.name for one in added if one.settings is None)

    @property
    def bent(self) -> frozenset[str]:
        """Return the effects that were added and are not named."""
        added = {item.accepted.candidate.name for item in self.rounds if item.accepted}
        return frozenset(name for name in added if is_law(name) and not self.explains_all)


def diagnose(
    records: Sequence[Recording],
    holdouts: Sequence[Recording],
    axis: AxisSettings,
    options: Options,
    report: Report = lambda text, share: None,
) -> Diagnosis:
    """Find what the model of an axis misses.

    Args:
        records: recordings to learn from.
        holdouts: recordings to judge on; parts of the first ones in turn if empty.
        axis: settings with the nominal model.
        options: how to run.
        report: called with what is being done and the share that is done.

    Raises:
        DataError: the recordings cannot be judged at all.
    """
    report("audit", 0.0)
    stated_lag = HELD if axis.filter.effort_is_held else 0.0
    band = options.band or BAND
    recordings = Recordings(tuple(records), tuple(holdouts), stated_lag, stated_lag, band)
    learn, held = recordings.motions(), recordings.held_out()
    if not learn:
        raise DataError("no recording is long enough to learn from; record at least 3 s without a pause")
    audited = audit.audit(learn, axis)
    nominal, own = replace(Model.of(axis), effects=()), own_effects(axis)
    report("refit of the file within its tolerance", 0.03)
    fine = nominal.refined()
    refits = Refits(
        judged_with(learn, fine.with_effects(own)), fine, options.tolerance,
        held=frozenset(item.name for item in own), workers=options.workers,
    )  # fmt: skip
    state = State(recordings, learn, held, refits, refits.of(own, None, STEPS))
    state = state.refitted(state.current, AGAIN).timed()
    state = narrowed(state.refitted(state.current, AGAIN), options)
    warnings = list(audited.warnings)
    if axis.filter.effort_is_held and state.recordings.lag < NOT_HELD:
        warnings.append("the effort is not held between samples; set filter.effort_is_held to false")
    found = state
    rounds: tuple[Round, ...] = ()
    if not audited.is_poor:
        state, rounds = _search(state, own, options, report)
        state, rounds = _pruned(state, rounds, options)
    report("refit of the file's own elements", 0.85)
    before, after, after_refits = _as_written(found, state, nominal)
    court = state.court(options)
    return Diagnosis(
        nominal, own, found, state, before, after, after_refits, tuple(rounds), court, audited.resolution,
        audited.notes, tuple(warnings), audited.is_poor,
        explains_all=court.explains_all(state.current.model, found.current.model),
    )  # fmt: skip


def narrowed(state: State, options: Options) -> State:
    """Return the state with elements as near to the file as its other values, unless those further off predict better.

    Few elements approximate a continuous contact, so their best values may lie far from those of the file. Where the
    contact follows another law, though, elements that are free fit what that law leaves and predict worse. Samples
    where the contact sticks may count less in the fit than in the reported gap, so that the gap has to agree.

    Args:
        state: with elements that may move further.
        options: how to run.
    """
    narrow = replace(state, refits=replace(state.refits, freedom=Freedom(is_narrow=True)))
    narrow = narrow.refitted(narrow.current, STEPS)
    court = narrow.court(options)
    earlier, later = evidence_of(narrow.current, court), evidence_of(state.current, court)
    pair = (earlier.held, later.held) if court.has_held_out else (earlier.all, later.all)
    is_sure = improvement(*pair).z_score > options.criteria.min_z_score
    wide_gap, narrow_gap = (
        rms(weighted(residuals(one.current.model, court.judge), court.gap_weights)) for one in (state, narrow)
    )
    return state if is_sure and wide_gap <= narrow_gap else narrow


def _search(
    state: State, own: Sequence[EffectSettings], options: Options, report: Report
) -> tuple[State, tuple[Round, ...]]:
    """Add one hypothesis after another, as long as one passes every test."""
    rounds: list[Round] = []
    names = [name for name in catalogue_names() if name not in READ_OFF and name not in options.excluded]
    changed = [name for name in CHANGED if name not in options.excluded]
    most = options.criteria.max_effects + len(changed)
    first = state.current.model
    for number in range(most):
        share = 0.1 + 0.7 * number / most
        report(f"first look at {len(names)} effects", share)
        refits, current = state.refits, to_the_end(state.refits, state.current)  # as many steps as the hypotheses get
        state = replace(state, current=current)
        court = state.court(options, first)
        if rounds and court.is_closed(current.model):
            break
        earlier = evidence_of(current, court)
        screen = Screen(refits.judged, current, options.tolerance, refits.freedom, names, options.workers)
        report("full fits", share + 0.02)
        listed = effect_candidates(refits, screen, current, options.workers, MOST_COMPARED)
        listed += [changed_candidate(refits, current, name) for name in changed if is_possible(refits, name)]
        decisions = [decide(item, current, earlier, court) for item in listed if item.refit.cost < current.cost]
        decisions.sort(key=lambda item: -item.improvement.fall)
        best = chosen(decisions, court, [item.name for item in own])
        if best is None or sum(item.accepted is not None for item in rounds) >= most:
            rounds.append(Round(screen.looks, tuple(decisions), None, ()))
            break
        item = best.candidate
        rounds.append(
            Round(screen.looks, tuple(decisions), best, alternatives(best, decisions, options.criteria))
        )
        refits = replace(item.refits, judged=refits.judged, workers=options.workers)
        state = replace(state, refits=refits, current=item.refit)
        state = state.refitted(state.current, STEPS).timed()
        names = [name for name in names if name != best.candidate.name]
        changed = [name for name in changed if name != best.candidate.name]
        if sum(item.candidate.settings is not None for item in (r.accepted for r in rounds) if item) >= (
            options.criteria.max_effects
        ):
            break
    return state, tuple(rounds)


def chosen(decisions: Sequence[Decision], court: Court, listed: Sequence[str] = ()) -> Decision | None:
    """Return the hypothesis to add, or None where none passes every test.

    Of effects that the data do not tell apart it is one that the file lists: that a known value moved is the simplest.

    Args:
        decisions: the best predicting first.
        court: recordings that evidence was taken from.
        listed: effects of the file.
    """
    passed = [item for item in decisions if item.passed]
    if not passed:
        return None
    best = _preferred(passed, court)
    known = [item for item in passed if item.candidate.name in listed]
    if best.candidate.settings is None:
        return best
    return next((item for item in known if apart(best, item) <= court.criteria.min_z_score), best)


def _preferred(passed: Sequence[Decision], court: Court) -> Decision:
    """Return the hypothesis that predicts best, in the order in which names may be believed.

    An effect that leaves nothing above the floor explains all there is with its few values. Else no file has the
    contact exactly right: an effect that a contact may look like waits until it surely predicts better than every
    change of the contact that passes, or until none passes any more. Any other effect goes before a change of the
    contact that moves more values and does not surely predict better, unless another effect does. An effect that
    describes nothing but another contact law comes last.

    Args:
        passed: hypotheses that passed every test, the best predicting first.
        court: recordings that evidence was taken from.
    """
    most = court.criteria.min_z_score
    bent = [item for item in passed if is_law(item.candidate.name)]
    others = [item for item in passed if item not in bent]
    effects = [item for item in others if item.candidate.settings is not None]
    if not court.is_noise(court.first_gap):
        for item in (*effects, *bent):
            if court.is_closed(item.candidate.refit.model):
                return item
    if not others:
        return bent[0]
    changes = [item for item in others if item.candidate.settings is None]
    waiting = [
        item for item in effects
        if is_like_contact(item.candidate.name) and any(apart(item, change) <= most for change in changes)
    ]  # fmt: skip
    best = next((item for item in effects if apart(item, others[0]) > most), others[0])
    if best in waiting:
        best = changes[0]
    if best.candidate.settings is None:
        for item in effects:
            is_simpler = item.candidate.parameter_count < best.candidate.parameter_count
            is_beaten = any(apart(other, item) > most for other in (best, *effects))
            if item not in waiting and is_simpler and not is_beaten:
                return item
    return best


def is_possible(refits: Refits, name: str) -> bool:
    """Return whether values of the file can still be let go."""
    if name == CHANGED[0]:
        return not refits.freedom.friction
    if name == CHANGED[1]:
        return not refits.freedom.elements
    if name == CHANGED[3]:
        return not refits.freedom.elements or refits.nominal.relaxation == 0.0
    return refits.nominal.friction.model != "gms" and not refits.nominal.is_sharp


def changed_candidate(refits: Refits, current: Refit, name: str) -> Candidate:
    """Return the hypothesis that values of the owner's file changed.

    Args:
        refits: so far.
        current: fit so far.
        name: one of ``CHANGED``.
    """
    free = changed_refits(refits, name)
    is_same = free.nominal.parameter_names() == refits.nominal.parameter_names() and not free.freedom.elements
    start = current.logs if is_same else contact_start(free, current.effects)
    return Candidate(name, free, free.of(current.effects, start, LAST_STEPS), 1)


def _pruned(state: State, rounds: Sequence[Round], options: Options) -> tuple[State, tuple[Round, ...]]:
    """Leave each effect out once: what predicts no worse without it goes.

    Args:
        state: with everything that was accepted.
        rounds: passes so far.
        options: how to run.
    """
    kept = list(rounds)
    named = [item for item in rounds if item.accepted and item.accepted.candidate.settings is not None]
    if len(named) < 2:
        return state, tuple(kept)
    for item in named[:-1]:
        assert item.accepted is not None
        name = item.accepted.candidate.name
        court = state.court(options)
        full = evidence_of(to_the_end(state.refits, state.current), court)
        effects = tuple(one for one in state.current.effects if one.name != name)
        without = state.refits.of(effects, state.current.logs, LAST_STEPS)
        gain = improvement(evidence_of(without, court).all, full.all)
        test = at_least(name, "z-score beside the other effects", gain.z_score, options.criteria.min_z_score)
        place = kept.index(item)
        decision = replace(item.accepted, tests=(*item.accepted.tests, test))
        if test.passed:
            kept[place] = replace(item, accepted=decision)
            continue
        listed = tuple(decision if one.candidate.name == name else one for one in item.decisions)
        kept[place] = replace(item, accepted=None, decisions=listed)
        state = state.refitted(without, AGAIN)
    return state, tuple(kept)


def _as_written(found: State, state: State, nominal: Model) -> tuple[Refit, Refit, Refits]:
    """Return the fits with the owner's own elements, without and with what was accepted.

    Args:
        found: state after the refit within the tolerance.
        state: state with everything that was accepted.
        nominal: the model as it is given.

    Returns:
        The fit before, the fit after, and how the latter was fitted.
    """
    first = replace(found.refits, nominal=nominal, judged=judged_with(found.learn, found.current.model))
    before = first.of(found.current.effects, None, LAST_STEPS)
    if state is found:
        return before, before, first
    fine = state.refits.nominal
    later = replace(nominal, is_sharp=fine.is_sharp, relaxation=fine.relaxation)
    if state.refits.freedom.elements:
        later = fine
    last = replace(state.refits, nominal=later)
    starts: list[Floats | None] = [None]
    if later.parameter_names() == nominal.parameter_names():
        starts.append(before.logs)
    if later.parameter_names() == fine.parameter_names():
        starts.append(state.current.logs)
    tried = [last.of(state.current.effects, start, LAST_STEPS) for start in starts]
    return before, min(tried, key=lambda fit: fit.cost), last


def own_effects(axis: AxisSettings) -> tuple[EffectSettings, ...]:
    """Return the effects an axis already has, with all their values."""
    return tuple(EffectSettings(item.name, item.values or effect(item.name).defaults) for item in axis.effects)
