"""The workflow: refit the file, add the hypothesis that predicts best what it was not fitted to, and repeat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from sgms_observer.diagnosis import audit
from sgms_observer.diagnosis.candidates import MOST_COMPARED, effect_candidates, to_the_end
from sgms_observer.diagnosis.changed_contact import CHANGED, changed_candidate, is_possible
from sgms_observer.diagnosis.coordinates import is_law, is_like_contact
from sgms_observer.diagnosis.court import Court, evidence_of
from sgms_observer.diagnosis.decision import Decision, alternatives, apart, decide
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import Freedom, Refits, judged_with
from sgms_observer.diagnosis.gap import residuals, rms, weighted
from sgms_observer.diagnosis.learnt import LEARNT_NAMES
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import BAND, HELD
from sgms_observer.diagnosis.pruning import pruned, significant
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.diagnosis.state import AGAIN, STEPS, Diagnosis, Options, Recordings, Round, State
from sgms_observer.diagnosis.timing import NOT_HELD
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.catalogue import names as catalogue_names
from sgms_observer.errors import DataError
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings

Report = Callable[[str, float], None]
Floats = NDArray[np.float64]

READ_OFF = ("quantisation", *LEARNT_NAMES)
"""Effects that are read off the data, or made of them, and not searched."""


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
        state, rounds = pruned(*_search(state, own, options, report), options)
    report("refit of the file's own elements", 0.85)
    state, rounds, written = significant(found, state, rounds, nominal, options)
    court = state.court(options)
    return Diagnosis(
        nominal, own, found, state, written, rounds, court, audited.resolution, audited.notes, tuple(warnings),
        audited.is_poor,
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
    for number in range(most):
        share = 0.1 + 0.7 * number / most
        report(f"first look at {len(names)} effects", share)
        refits, current = state.refits, to_the_end(state.refits, state.current)  # as many steps as the hypotheses get
        state = replace(state, current=current)
        court = state.court(options)
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

    Of effects that the data do not tell apart it is one that the file lists, because a known value that moved is the
    simplest explanation; else the one with the fewest parameters.

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
    equal = [item for item in passed if apart(best, item) <= court.criteria.min_z_score]
    return next((item for item in equal if item in known), _simplest(best, equal))


def _simplest(best: Decision, equal: Sequence[Decision]) -> Decision:
    """Return the effect with the fewest parameters of those that the data do not tell from the best one.

    Args:
        best: the effect that would be added.
        equal: hypotheses that the data do not tell from it, the best predicting first.
    """
    is_contact = is_like_contact(best.candidate.name)
    others = [
        item for item in equal
        if item.candidate.settings is not None and (is_contact or not is_like_contact(item.candidate.name))
    ]  # fmt: skip
    return min((best, *others), key=lambda item: item.candidate.parameter_count)


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
    if not court.is_noise(court.gap_so_far):
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


def own_effects(axis: AxisSettings) -> tuple[EffectSettings, ...]:
    """Return the effects an axis already has, with all their values."""
    return tuple(EffectSettings(item.name, item.values or effect(item.name).defaults) for item in axis.effects)
