"""The workflow: refit the file, then repeatedly add the hypothesis with the best prediction of other data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from sgms_observer.diagnosis import audit
from sgms_observer.diagnosis.candidates import Candidate, finish_fit, fitted_candidates
from sgms_observer.diagnosis.changed_contact import CHANGE_HYPOTHESES, can_be_freed, changed_candidate
from sgms_observer.diagnosis.criteria import Criteria, Test
from sgms_observer.diagnosis.decision import (
    SIZE_BEYOND_TOLERANCE,
    Decision,
    comparisons,
    decide,
    free_form_prediction,
    is_special_case_enough,
    preferred,
    z_score_between,
)
from sgms_observer.diagnosis.diagnosis import (
    Diagnosis,
    FitState,
    Options,
    Recordings,
    Round,
    WrittenFits,
    accepted_candidates,
)
from sgms_observer.diagnosis.effort_lag import MIN_HELD_LAG, notes_on_changes
from sgms_observer.diagnosis.evaluation import EvaluationData, evidence_of
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import Freedom, RefitSetup
from sgms_observer.diagnosis.free_form import ALL
from sgms_observer.diagnosis.homing import Shift, shifts_in, with_shifted_positions
from sgms_observer.diagnosis.late_stamps import corrected, late_stamps
from sgms_observer.diagnosis.map_fit import MAP_NAMES
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import BAND, HELD_LAG
from sgms_observer.diagnosis.pruning import (
    compared,
    compared_again,
    without_insignificant_effects,
    without_redundant_effects,
)
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.catalogue import names as catalogue_names
from sgms_observer.errors import DataError
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings

Report = Callable[[str, float], None]

LAST_SHARE = 0.85
"""Share of the work that is done when the search ends."""
NOT_SEARCHED = ("quantisation", *MAP_NAMES)
"""Effects that are not searched: the encoder resolution is measured directly, learnt maps are fitted at the end."""


@dataclass(frozen=True)
class FittedFile:
    """The file refitted within its tolerance: where every search begins.

    Attributes:
        axis: settings with the nominal model.
        audited: what the recordings can show.
        state: the fit.
        shifts: offsets that were added to the positions of held-out recordings.
    """

    axis: AxisSettings
    audited: audit.Audit
    state: FitState
    shifts: tuple[Shift, ...] = ()

    @property
    def nominal(self) -> Model:
        """Return the given model, without effects."""
        return _without_effects(self.axis)

    @property
    def known_effects(self) -> tuple[EffectSettings, ...]:
        """Return the effects of the file with all their values."""
        return file_effects(self.axis)


def _without_effects(axis: AxisSettings) -> Model:
    """Return the nominal model of an axis without the effects of its file."""
    return replace(Model.of(axis), effects=())


def fitted_file(
    records: Sequence[Recording], holdouts: Sequence[Recording], axis: AxisSettings, options: Options, report: Report
) -> FittedFile:
    """Return the file refitted to recordings.

    Args:
        records: recordings to fit.
        holdouts: held-out recordings. If empty, the evidence is cross-validated.
        axis: settings with the nominal model.
        options: options of the diagnosis.
        report: called with the current step and the completed share.

    Raises:
        DataError: a recording is too short.
    """
    report("audit", 0.0)
    stated_lag = HELD_LAG if axis.filter.effort_is_held else 0.0
    band = options.band or BAND
    known_effects = file_effects(axis)
    given = Model.of(axis).with_effects(known_effects)
    late = late_stamps([*records, *holdouts], given, stated_lag, band, options.criteria)
    recordings = Recordings(corrected(records, late), corrected(holdouts, late), stated_lag, band)
    learn, held = recordings.motions(), recordings.held_out()
    if not learn:
        raise DataError("no recording is long enough to learn from; record at least 3 s without a pause")
    audited = audit.audit(learn, axis)
    of_logs = (*audit.cut_off_warnings([*records, *holdouts], axis.units), *(one.warning(axis.units) for one in late))
    audited = replace(audited, warnings=(*audited.warnings, *of_logs))
    report("refit of the file within its tolerance", 0.03)
    fine = _without_effects(axis).with_split_elements()
    setup = RefitSetup(
        data_with_own_noise(learn, fine.with_effects(known_effects)), fine, options.tolerance,
        held_effects=frozenset(item.name for item in known_effects), file_effects=known_effects,
        workers=options.workers,
    )  # fmt: skip
    state = FitState(
        recordings, learn, held, setup, setup.fit(known_effects),
        hidden_by_encoder=audited.hidden_by_encoder,
    )  # fmt: skip
    state = state.converged().with_changes_of_lag(options.criteria)
    return FittedFile(axis, audited, choose_element_freedom(state.converged(), options))


def diagnose(
    records: Sequence[Recording],
    holdouts: Sequence[Recording],
    axis: AxisSettings,
    options: Options,
    report: Report = lambda text, share: None,
) -> Diagnosis:
    """Return the effects and changed values that the model of an axis misses.

    Args:
        records: recordings to fit.
        holdouts: held-out recordings. If empty, the evidence is cross-validated.
        axis: settings with the nominal model.
        options: options of the diagnosis.
        report: called with the current step and the completed share.

    Raises:
        DataError: a recording is too short.
    """
    return diagnose_from(fitted_file(records, holdouts, axis, options, report), options, report)


def diagnose_from(file: FittedFile, options: Options, report: Report) -> Diagnosis:
    """Return the effects and changed values that a file misses whose refit is known.

    Args:
        file: the refitted file, where the search begins.
        options: options of the diagnosis.
        report: called with the current step and the completed share.
    """
    start, audited, nominal = file, file.audited, file.nominal
    if audited.is_poor:
        report("refit of the file's own elements", LAST_SHARE)
        state, rounds, written = without_insignificant_effects(file.state, file.state, (), nominal, options)
    else:
        state, rounds, written = _search_and_prune(file.state, nominal, file.known_effects, options, report)
        if file.state.setup.freedom.has_narrow_elements and may_need_wide_elements(state, rounds, options):
            wide = replace(file, state=file.state.with_freedom(Freedom()))
            again, added, with_added = _search_and_prune(wide.state, nominal, wide.known_effects, options, report)
            has_effect = any(one.settings is not None for one in accepted_candidates(added))
            if has_effect and (not _names_of(rounds) or is_preferred(again, state, options)):
                file, state, rounds, written = wide, again, added, with_added
    warnings = list(audited.warnings)
    if file.axis.filter.effort_is_held and max(max(lag.values) for lag in state.lags) < MIN_HELD_LAG:
        warnings.append("the effort is not held between samples; set filter.effort_is_held to false")
    warnings += [shift.warning(file.axis.units) for shift in {one.name: one for one in file.shifts}.values()]
    found = Diagnosis(
        nominal, file.known_effects, file.state, state, written, rounds, state.evaluation(options), audited.resolution,
        (*audited.notes, *notes_on_changes([*state.fit_motions, *state.held_out_motions])), tuple(warnings),
        audited.is_poor,
    )  # fmt: skip
    shifts = () if start.shifts else shifts_in(found)
    if not shifts:
        return found
    shifted = with_shifted_positions(start.state, shifts)
    return diagnose_from(replace(start, state=shifted, shifts=shifts), options, report)


def may_need_wide_elements(state: FitState, rounds: Sequence[Round], options: Options) -> bool:
    """Return whether a search with narrow elements ended early.

    Which elements predict better was decided with everything in the residual that the file misses. Either nothing was
    added although an effect surely predicts, or the contact was changed and more than noise is left: narrow elements
    cannot be right then, and a changed contact may have taken the place of an effect.

    Args:
        state: state after the search.
        rounds: its rounds.
        options: options of the diagnosis.
    """
    added = accepted_candidates(rounds)
    if any(one.settings is None for one in added):
        return not state.evaluation(options).is_gap_closed(state.current.model)
    effects = [one for item in rounds for one in item.decisions if one.candidate.settings is not None]
    return not added and any(one.tests[0].passed for one in effects)


def is_preferred(state: FitState, other: FitState, options: Options) -> bool:
    """Return whether the result of one search is preferred to that of another one.

    It is if it predicts significantly better, or if it leaves only noise, which is no more than the other one leaves,
    and the other one does not predict significantly better. Both are compared in the noise of what it leaves, each with
    the lags of the effort that it was fitted with.

    Args:
        state: state after the one search, which has effects.
        other: state after the other search, which changed the contact.
        options: options of the diagnosis.
    """
    evaluation, most = state.evaluation(options), options.criteria.min_z_score
    ours, theirs = (_in_noise_of(evaluation, one) for one in (state, other))
    before, after = (
        evidence_of(finish_fit(replace(one.setup, data=where.fit_data), one.current), where).all
        for one, where in ((other, theirs), (state, ours))
    )
    least = min(evaluation.floor, theirs.rms(other.current.model))
    if replace(evaluation, floor=least).is_gap_closed(state.current.model):
        return improvement(after, before).z_score <= most
    return improvement(before, after).z_score > most


def _in_noise_of(evaluation: EvaluationData, state: FitState) -> EvaluationData:
    """Return the recordings of a state, with its lags of the effort, in the noise and with the weights of others."""
    return replace(
        evaluation,
        fit_motions=state.fit_motions,
        motions=state.held_out_motions or state.fit_motions,
        fit_data=replace(evaluation.fit_data, motions=state.fit_motions),
        held_out_data=replace(evaluation.held_out_data, motions=state.held_out_motions),
        predictions={},
    )


def _search_and_prune(
    file_state: FitState,
    nominal: Model,
    known_effects: Sequence[EffectSettings],
    options: Options,
    report: Report,
) -> tuple[FitState, tuple[Round, ...], WrittenFits]:
    """Return the state with everything that is accepted in the end, the rounds, and the fits as they are written.

    An effect may take the place of others and fail a test of the whole result only. It is removed then, and the search
    is repeated from what is left, without it: what it displaced may come back. An effect that may lie within the
    tolerance of the file stays an alternative, which cannot be added.

    Args:
        file_state: state after the refit within the tolerance.
        nominal: the given model.
        known_effects: effects of the file.
        options: options of the diagnosis.
        report: called with the current step and the completed share.
    """
    listed = [item.name for item in known_effects]
    state, rounds = _best_search(_Search((file_state,)), known_effects, options, report)
    removed: frozenset[str] = frozenset()
    small: dict[str, Test] = {}
    while True:
        state, rounds = compared_again(*without_redundant_effects(state, rounds, options), listed, options)
        accepted = _names_of(rounds)
        report("refit of the file's own elements", LAST_SHARE)
        state, rounds, written = without_insignificant_effects(file_state, state, rounds, nominal, options)
        remaining = _names_of(rounds)
        if remaining == accepted:
            return state, rounds, written
        removed |= accepted - remaining
        small |= _within_tolerance(rounds)
        effects = sum(one.settings is not None for one in accepted_candidates(rounds))
        rest = replace(
            options, excluded=options.excluded | (removed - small.keys()) | remaining,
            criteria=replace(options.criteria, max_effects=options.criteria.max_effects - effects),
        )  # fmt: skip
        found, added = _best_search(_Search((state,), earlier=rounds, small=small), known_effects, rest, report)
        rounds = (*rounds, *added)
        if not _names_of(added):
            return state, rounds, written
        state = found


def _within_tolerance(rounds: Sequence[Round]) -> dict[str, Test]:
    """Return the failed test of each effect that was removed because it may lie within the tolerance of the file."""
    tests = [test for one in rounds for test in one.tests]
    return {test.of: test for test in tests if test.name == SIZE_BEYOND_TOLERANCE and not test.passed}


def _names_of(rounds: Sequence[Round]) -> frozenset[str]:
    """Return the names of what these rounds added."""
    return frozenset(one.name for one in accepted_candidates(rounds))


def choose_element_freedom(state: FitState, options: Options) -> FitState:
    """Return the state with narrow elements, unless elements with a wider tolerance predict significantly better.

    Few elements approximate a continuous contact, so their best values may be far from those of the file. If the
    contact follows another law, wide elements fit the residual of that law and predict worse. Low frequencies have a
    lower weight in the fit than in the gap, so the gap must not grow either.

    Args:
        state: state with wide elements.
        options: options of the diagnosis.
    """
    narrow = state.with_freedom(Freedom(has_narrow_elements=True))
    evaluation = narrow.evaluation(options)
    earlier, later = evidence_of(narrow.current, evaluation), evidence_of(state.current, evaluation)
    pair = (earlier.held_out, later.held_out) if evaluation.has_held_out else (earlier.all, later.all)
    is_significant = improvement(*pair).z_score > options.criteria.min_z_score
    wide_gap, narrow_gap = (evaluation.rms(one.current.model) for one in (state, narrow))
    return state if is_significant and wide_gap <= narrow_gap else narrow


@dataclass(frozen=True)
class _Search:
    """A stepwise search.

    Attributes:
        states: the state before each round, and the one after the last.
        rounds: rounds so far.
        earlier: rounds of the search that it goes on from.
        small: failed test of each effect that may lie within the tolerance of the file. It cannot be added, but stays
            an alternative of what is added in its place.
    """

    states: tuple[FitState, ...]
    rounds: tuple[Round, ...] = ()
    earlier: tuple[Round, ...] = ()
    small: Mapping[str, Test] = field(default_factory=dict)

    @property
    def state(self) -> FitState:
        """Return the state after the last round."""
        return self.states[-1]

    @property
    def accepted(self) -> list[Candidate]:
        """Return what was added."""
        return accepted_candidates(self.rounds)

    @property
    def rivals(self) -> frozenset[str]:
        """Return the rivals of the effects that were added."""
        rounds = [item for item in (*self.earlier, *self.rounds) if item.accepted]
        return frozenset(name for item in rounds for name in item.comparisons)

    def can_go_on(self, criteria: Criteria, most: int) -> bool:
        """Return whether another round may add a hypothesis; ``most`` bounds their number."""
        if self.rounds and self.rounds[-1].accepted is None:
            return False
        effects = [item for item in self.accepted if item.settings is not None]
        return len(effects) < criteria.max_effects and len(self.accepted) < most

    def with_round(self, before: FitState, item: Round, after: FitState) -> _Search:
        """Return the search with one more round."""
        return replace(self, states=(*self.states[:-1], before, after), rounds=(*self.rounds, item))

    def until(self, number: int) -> _Search:
        """Return the search before a round."""
        return replace(self, states=self.states[: number + 1], rounds=self.rounds[:number])


def _best_search(
    start: _Search, known_effects: Sequence[EffectSettings], options: Options, report: Report
) -> tuple[FitState, tuple[Round, ...]]:
    """Return the state with everything that the search adds, and its rounds.

    The search adds one hypothesis at a time. A change of the contact has many parameters and may take the place of two
    effects, but only in part. Where such a change was preferred to an effect that passed every test, and more than
    noise is left, the search is repeated from there with effects before changes, and the preferred one counts.
    """
    listed = [item.name for item in known_effects]
    first = _search(start, listed, options, report)
    place = next((number for number, item in enumerate(first.rounds) if _preferred_change(item)), None)
    if place is None or first.state.evaluation(options).is_gap_closed(first.state.current.model):
        return first.state, first.rounds
    before, item = first.until(place), first.rounds[place]
    best = select_hypothesis(_passed_effects(item.decisions), before.state.evaluation(options), listed)
    again = _with_best(before, before.state, item, best, listed, options)
    second = _search(again, listed, options, report, has_effects_first=True)
    counts = is_preferred(second.state, first.state, options)
    return (second.state, second.rounds) if counts else (first.state, first.rounds)


def _passed_effects(decisions: Sequence[Decision]) -> list[Decision]:
    """Return the decisions on effects that passed every test."""
    return [item for item in decisions if item.passed and item.candidate.settings is not None]


def _preferred_change(item: Round) -> bool:
    """Return whether a round added a change of the file although an effect passed every test."""
    is_change = item.accepted is not None and item.accepted.candidate.settings is None
    return is_change and bool(_passed_effects(item.decisions))


def _search(
    found: _Search, listed: Sequence[str], options: Options, report: Report, has_effects_first: bool = False
) -> _Search:
    """Add hypotheses one by one, as long as one passes every test.

    Where none does and the residual is surely predictable, several effects may be missing, of which each hides in the
    gap what another one closes. The search goes on then with an effect that passes every other test.

    Args:
        found: rounds so far.
        listed: effects of the file.
        options: options of the diagnosis.
        report: called with the current step and the completed share.
        has_effects_first: whether changes of the file are added only where no effect passes.
    """
    searched = [name for name in catalogue_names() if name not in NOT_SEARCHED and name not in options.excluded]
    changes = [name for name in CHANGE_HYPOTHESES if name not in options.excluded]
    most = options.criteria.max_effects + len(changes)
    while found.can_go_on(options.criteria, most):
        added = {item.name for item in found.accepted}
        names, changed = ([name for name in one if name not in added] for one in (searched, changes))
        share = 0.1 + 0.7 * len(found.rounds) / most
        setup = found.state.setup
        current = finish_fit(setup, found.state.current)  # as many steps as for the hypotheses
        state = replace(found.state, current=current)
        evaluation = state.evaluation(options)
        if found.rounds and evaluation.is_gap_closed(current.model) and not _is_predictable(current.model, evaluation):
            predicted = _sure_predictions(found.rounds[-1]) - found.small.keys()
            names, changed = ([name for name in one if name in predicted] for one in (names, changed))
            if not names:
                return replace(found, states=(*found.states[:-1], state))
        report(f"screening of {len(names)} effects", share)
        earlier = evidence_of(current, evaluation)
        screen = Screen(
            setup.data, current, options.tolerance, setup.freedom, names, options.workers, setup.held_effects
        )
        report("full fits", share + 0.02)
        one_thread = replace(setup, workers=1)  # one hypothesis per thread
        others = [partial(changed_candidate, one_thread, current, one) for one in changed if can_be_freed(setup, one)]
        fitted = fitted_candidates(one_thread, screen, current, options.workers, others)
        decisions = [
            decide(item, current, earlier, evaluation, item.name in found.rivals).with_test(found.small.get(item.name))
            for item in fitted if item.refit.cost < current.cost
        ]  # fmt: skip
        decisions.sort(key=lambda item: -item.improvement.decrease)
        state = state.with_least_of(decisions, evaluation)
        eligible = (has_effects_first and _passed_effects(decisions)) or decisions
        bounded = state.bounded(evaluation)
        best = select_hypothesis(eligible, bounded, listed)
        if best is None:
            weaker = [item.while_others_are_missing() for item in decisions]
            hidden = select_hypothesis(weaker, bounded, listed)
            if hidden is not None and _is_predictable(current.model, evaluation):
                decisions, best = weaker, hidden
        found = _with_best(found, state, Round(screen.screenings, tuple(decisions), None, {}), best, listed, options)
    return found


def _is_predictable(model: Model, evaluation: EvaluationData) -> bool:
    """Return whether a regression surely predicts a share of the residual that is worth a name, even where the residual
    looks like noise: the noise is fitted to it."""
    criteria = evaluation.criteria
    found = free_form_prediction(ALL, model, evaluation).improvement
    return found.z_score > criteria.min_z_score and found.share > criteria.min_predictable_share


def _sure_predictions(last: Round) -> frozenset[str]:
    """Return the hypotheses that predicted significantly better than the model before a round.

    The noise is fitted to what the added one leaves, so it may contain another of them, and nothing else is missing.
    """
    assert last.accepted is not None
    return frozenset(item.candidate.name for item in last.decisions if item.tests[0].passed)


def _with_best(
    found: _Search, state: FitState, item: Round, best: Decision | None, listed: Sequence[str], options: Options
) -> _Search:
    """Return the search with a round that adds a hypothesis, or none.

    Args:
        found: rounds before.
        state: state before the round.
        item: the round.
        best: the hypothesis to add, or None.
        listed: effects of the file.
        options: options of the diagnosis.
    """
    if best is None:
        return found.with_round(state, replace(item, accepted=None, comparisons={}), state)
    item = replace(item, accepted=best, comparisons=comparisons(best, item.decisions, options.criteria))
    setup = replace(best.candidate.setup, data=state.setup.data, workers=options.workers)
    after = replace(state, setup=setup, current=best.candidate.refit)
    after, item = compared(after.refitted(after.current).with_fitted_lags(), item, listed, options)
    return found.with_round(state, item, after)


def select_hypothesis(
    decisions: Sequence[Decision], evaluation: EvaluationData, listed: Sequence[str] = ()
) -> Decision | None:
    """Return the hypothesis to add, or None if none passes every test.

    Args:
        decisions: decisions, the best predicting first.
        evaluation: evaluation data.
        listed: effects of the file.
    """
    passed = [item for item in decisions if item.passed]
    if not passed:
        return None
    best = _best_hypothesis(passed, evaluation)
    if best.candidate.settings is None:
        return best
    criteria = evaluation.criteria
    equal = [
        item for item in passed
        if z_score_between(best.evidence, item.evidence, criteria) <= criteria.min_z_score
        or is_special_case_enough(best, item, criteria)
    ]  # fmt: skip
    return preferred(best, equal, listed)


def _best_hypothesis(passed: Sequence[Decision], evaluation: EvaluationData) -> Decision:
    """Return the hypothesis that predicts best, in order of credibility.

    1. An effect that closes the gap to the floor is returned; one that only describes another contact law comes last.
    2. An effect that only describes another contact law must predict significantly better than every passing change of
       the contact, which describes it too.
    3. Any other effect is preferred to a change of the contact that moves more values, unless that change or another
       effect predicts significantly better.

    Args:
        passed: hypotheses that passed every test, the best predicting first.
        evaluation: evaluation data.
    """
    criteria, most = evaluation.criteria, evaluation.criteria.min_z_score
    effects = [item for item in passed if item.candidate.settings is not None]
    if not evaluation.is_noise(evaluation.gap):
        for item in sorted(effects, key=lambda one: one.candidate.is_contact_law):  # stable
            if evaluation.is_gap_closed(item.candidate.refit.model):
                return item
    changes = [item for item in passed if item.candidate.settings is None]
    waiting = [
        item for item in effects
        if item.candidate.is_contact_law
        and any(z_score_between(item.evidence, change.evidence, criteria) <= most for change in changes)
    ]  # fmt: skip
    first = passed[0]
    best = next((item for item in effects if z_score_between(item.evidence, first.evidence, criteria) > most), first)
    if best in waiting:
        best = changes[0]
    if best.candidate.settings is None:
        for item in effects:
            is_simpler = item.candidate.parameter_count < best.candidate.parameter_count
            is_beaten = any(
                z_score_between(other.evidence, item.evidence, criteria) > most for other in (best, *effects)
            )
            if item not in waiting and is_simpler and not is_beaten:
                return item
    return best


def file_effects(axis: AxisSettings) -> tuple[EffectSettings, ...]:
    """Return the effects of the file with all their values."""
    return tuple(EffectSettings(item.name, item.values or effect(item.name).defaults) for item in axis.effects)
