"""Effects beside each other: what one absorbs of another, rivals compared again, effects that are screened low."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from workflow_case import AXIS, evaluation_of, record

from sgms_observer.diagnosis import pruning, workflow
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.candidates import MIN_REDUCTION_SHARE, Candidate, finish_fit
from sgms_observer.diagnosis.criteria import Criteria, at_least, at_most
from sgms_observer.diagnosis.decision import GAP_WHILE_OTHERS_ARE_MISSING, HELD_OUT_GAP, Decision, decide
from sgms_observer.diagnosis.diagnosis import Diagnosis, FitState, Options, Round, accepted_candidates
from sgms_observer.diagnosis.evaluation import EvaluationData, evidence_of
from sgms_observer.diagnosis.fit import Refit, RefitSetup
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import EffortLag, motion_of
from sgms_observer.diagnosis.result import by_name
from sgms_observer.diagnosis.sliding import sliding_shares
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

OPTIONS = Options(workers=1, band=25.0)
OFFSET, SPRING = EffectSettings("offset", (1.5,)), EffectSettings("spring", (20.0, 0.0))
NAMES = ("offset", "asymmetric_coulomb", "spring")
MODEL = Model.of(AXIS)


def diagnosed(monkeypatch: pytest.MonkeyPatch, hidden: tuple[EffectSettings, ...], names: tuple[str, ...]) -> Diagnosis:
    """Return the diagnosis of two recordings with hidden effects, where only a few names are searched."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: names)
    one, other = (record(hidden, seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    return workflow.diagnose([one], [other], AXIS, OPTIONS)


@dataclass(frozen=True)
class Search:
    """A diagnosis of an offset and a spring, and what its rivals are compared again with.

    Attributes:
        found: the diagnosis.
        state: after its search.
        rounds: of its search.
    """

    found: Diagnosis
    state: FitState
    rounds: tuple[Round, ...]


@pytest.fixture(scope="module")
def search() -> Search:
    calls: list[tuple[FitState, tuple[Round, ...]]] = []

    def compare(state: FitState, rounds: tuple[Round, ...], *others: Any) -> tuple[FitState, tuple[Round, ...]]:
        calls.append((state, rounds))
        return pruning.compared_again(state, rounds, *others)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workflow, "compared_again", compare)
        found = diagnosed(patch, (OFFSET, SPRING), NAMES)
    [(state, rounds)] = calls
    return Search(found, state, rounds)


def test_a_spring_beside_an_offset_has_a_stiffness_but_no_rest_position(search: Search) -> None:
    """The offset absorbs the rest position; the spring was dropped with it and a changed contact took its place."""
    assert [item.name for item in accepted_candidates(search.found.rounds)] == ["offset", "spring"]
    answer: Answer = answer_of(search.found, AXIS, OPTIONS)
    values = {item.settings.name: by_name(item.settings.name, item.settings.values) for item in answer.effects}
    assert values["offset"]["force"] == pytest.approx(1.5, rel=0.05)
    assert values["spring"]["stiffness"] == pytest.approx(20.0, rel=0.05)
    assert not answer.changed


class NamedEvidence:
    """Evidence that only knows whether its fit has the offset."""

    def __init__(self, fit: Refit) -> None:
        self.offset = float("offset" in [item.name for item in fit.effects])

    def weighted(self, _shares: object) -> NamedEvidence:
        """Return the same evidence."""
        return self


def compared(
    z_score: float, state: FitState, rounds: tuple[Round, ...], listed: list[str], options: Options
) -> tuple[FitState, tuple[Round, ...]]:
    """Return what the rivals lead to where the offset predicts better than its rival by a z-score: only that counts."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(EvaluationData, "is_gap_closed", lambda *_: True)
        patch.setattr(pruning, "evidence_of", lambda fit, _: NamedEvidence(fit))
        patch.setattr(pruning, "z_score_between", lambda one, other, _: z_score * (one.offset - other.offset))
        return pruning.compared_again(state, rounds, listed, options)


@pytest.mark.parametrize(
    "z_score, first",
    [(-10.0, "asymmetric_coulomb"), (-1.0, "asymmetric_coulomb"), (0.0, "offset"), (1.0, "offset"), (10.0, "offset")],
)
def test_a_rival_that_predicts_better_beside_the_later_effects_takes_the_place(
    search: Search, z_score: float, first: str
) -> None:
    assert [item.name for item in accepted_candidates(search.rounds)] == ["offset", "spring"]
    state, rounds = compared(z_score, search.state, search.rounds, [], OPTIONS)
    assert [item.name for item in accepted_candidates(rounds)] == [first, "spring"]
    assert {item.name for item in state.current.effects} == {first, "spring"}
    other = {"offset": "asymmetric_coulomb", "asymmetric_coulomb": "offset"}[first]
    [(name, test)] = rounds[0].comparisons.items()
    assert (name, test.value, test.passed) == (other, abs(z_score), abs(z_score) >= Criteria().min_z_score)


@pytest.mark.parametrize("z_score, first", [(-1.0, "offset"), (-10.0, "asymmetric_coulomb")])
def test_a_rival_that_was_surely_worse_takes_the_place_only_where_it_is_surely_better(
    search: Search, z_score: float, first: str
) -> None:
    """What was accepted later imitates the difference: changed elements beside a wrong mass, that of a gain."""
    before, *others = search.rounds
    state, rounds = search.state, (replace(before, worse=frozenset(before.comparisons)), *others)
    hardly_better = -1.0 if first == "offset" else 1.0
    for value in (z_score, hardly_better):  # a search that removed an effect compares again
        state, rounds = compared(value, state, rounds, [], OPTIONS)
        assert [item.name for item in accepted_candidates(rounds)] == [first, "spring"]


def test_what_was_surely_worse_is_known_from_the_round_of_an_effect(search: Search) -> None:
    for item in search.rounds:
        assert item.worse == {name for name, test in item.comparisons.items() if test.passed}


def test_a_diagnosis_goes_on_with_the_rival_that_took_the_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """The rivals are compared once: what takes the place stays to the end.

    This rival explains less, and moves the spring's rest position to the end of its range, which does not count here.
    """
    calls: list[tuple[FitState, tuple[Round, ...]]] = []

    def compare(*arguments: Any) -> tuple[FitState, tuple[Round, ...]]:
        calls.append(compared(-10.0, *arguments))
        return calls[-1]

    monkeypatch.setattr(workflow, "compared_again", compare)
    monkeypatch.setattr(pruning, "within_range", lambda item, *_: at_most(item.name, "at an end", 0.0, 0.0))
    diagnosed(monkeypatch, (OFFSET, SPRING), NAMES)
    [(_, rounds)] = calls
    assert [item.name for item in accepted_candidates(rounds)] == ["asymmetric_coulomb", "spring"]


def test_a_dead_zone_is_fitted_although_the_coulomb_force_absorbs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The screening cannot exclude it, however much more another effect closes."""
    cogging = EffectSettings("cogging", (1.5, 0.004, 0.3, 0.0, 0.0))
    found = diagnosed(monkeypatch, (cogging, EffectSettings("actuator_dead_zone", (0.4,))), (
        "cogging", "spring", "offset", "actuator_dead_zone",
    ))  # fmt: skip
    screenings = found.rounds[0].screenings
    least = MIN_REDUCTION_SHARE * max(item.chi2_reduction for item in screenings.values())
    assert screenings["actuator_dead_zone"].chi2_reduction < least
    assert "actuator_dead_zone" in [item.candidate.name for item in found.rounds[0].decisions]
    assert "actuator_dead_zone" in [item.name for item in accepted_candidates(found.rounds)]


def test_a_sample_counts_by_the_share_of_the_contact_that_slides() -> None:
    """Two forces are compared while the contact slides, and the two kinds of recordings have each their own shares."""
    learn, judge = (motion_of(record((OFFSET,), seed=seed, duration=12.0)) for seed in (1, 2))
    truth = MODEL.with_effects((OFFSET,))
    evaluation = evaluation_of([learn], truth, [judge])
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    evidence = evidence_of(setup.fit((OFFSET,)), evaluation)
    shares = sliding_shares(truth, evaluation)
    assert [len(share) for share in shares] == [len(block) for block in evidence.all]
    found = evidence.weighted(shares)
    assert (len(found.fit), len(found.held_out)) == (len(evidence.fit), len(evidence.held_out))
    for motion, parts in ((learn, shares[: len(evidence.fit)]), (judge, shares[len(evidence.fit) :])):
        share = np.concatenate(parts)
        time = np.linspace(0.0, float(motion.time[-1]), len(share))
        speed = np.interp(time, motion.time, np.abs(motion.velocity))
        rests = (time % 6.0 > 5.4) & (time % 6.0 < 5.9)
        assert share[rests].max() < 0.1 and share[speed > 0.01].mean() > 0.9
    np.testing.assert_allclose(np.concatenate(found.all), np.concatenate(evidence.all) * np.concatenate(shares))


def test_beside_another_contact_law_the_faster_half_of_the_sliding_samples_counts() -> None:
    """Without the offset the model leaves more than noise. There is no held-out recording."""
    learn = motion_of(record((OFFSET,), seed=1, duration=12.0))
    truth = MODEL.with_effects((OFFSET,))
    evaluation = evaluation_of([learn], truth)
    right, wrong = (np.concatenate(sliding_shares(model, evaluation)) for model in (truth, MODEL))
    assert len(right) == len(wrong)
    speed = np.abs(learn.thinned(learn.velocity))
    speed = np.interp(np.linspace(0.0, 1.0, len(wrong)), np.linspace(0.0, 1.0, len(speed)), speed)
    assert 0.35 < wrong.mean() / right.mean() < 0.65
    assert wrong[speed < np.quantile(speed, 0.5)].max() == 0.0 and wrong[speed > np.quantile(speed, 0.7)].min() == 1.0


def test_a_dead_zone_that_is_not_there_has_no_width() -> None:
    """Its width may be zero, so it has no logarithm; by its logarithm it stayed above zero with an error of nothing."""
    evaluation = evaluation_of([motion_of(record(seed=seed, duration=12.0)) for seed in (1, 2)], MODEL)
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    found = setup.fit((EffectSettings("actuator_dead_zone", (0.2,)),))
    [width], [error] = found.effects[0].values, found.standard_errors().values()
    assert 0.0 <= width < 0.02 and (width == 0.0 or width < 3.0 * error)


def test_an_effect_below_the_noise_has_a_name_where_the_evidence_is_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its gap is not closable in per cent: the noise is as large. Its z-scores count, as for every other effect."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("cogging", "spring", "offset"))
    small = (EffectSettings("cogging", (0.018, 0.005, 0.3, 0.0, 0.0)),)
    options = Options(workers=1)
    answer = answer_of(workflow.diagnose([record(small, 1)], [record(small, 2)], AXIS, options), AXIS, options)
    assert options.criteria.is_noise(answer.gap.before, answer.gap.noise) and answer.gap.closure is None
    assert [item.settings.name for item in answer.effects] == ["cogging"]
    assert answer.effects[0].settings.values[1] == pytest.approx(0.005, rel=0.01)


ASYMMETRY = EffectSettings("asymmetric_coulomb", (0.2,))


@pytest.mark.parametrize(
    ("hidden", "known", "rival", "adds"),
    [((ASYMMETRY,), ASYMMETRY, OFFSET, False), ((OFFSET, SPRING), OFFSET, SPRING, True)],
)
def test_a_rival_of_what_was_added_adds_something_while_the_contact_slides(
    hidden: tuple[EffectSettings, ...], known: EffectSettings, rival: EffectSettings, adds: bool
) -> None:
    """Beside an asymmetry an offset adds a force at rest only, where contact laws differ."""
    motion = motion_of(record(hidden, duration=12.0, period=0.004))
    evaluation = evaluation_of((motion,), MODEL.with_effects(hidden))
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    before, after = (finish_fit(setup, setup.fit(effects)) for effects in ((known,), (known, rival)))
    candidate = Candidate(rival.name, setup, after, 1)
    found = decide(candidate, before, evidence_of(before, evaluation), evaluation, is_rival=True)
    (test,) = [one for one in found.tests if one.name.startswith("z-score beside its rival")]
    assert test.passed == adds
    alone = decide(candidate, before, evidence_of(before, evaluation), evaluation)
    assert not [one for one in alone.tests if one.name == test.name]


@pytest.mark.parametrize("is_rest_known", [True, False])
def test_a_small_difference_decides_only_where_the_model_leaves_noise(
    is_rest_known: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A contact of another law makes an offset and an asymmetry differ. Half a standard error is enough here."""
    evaluation = FitState.evaluation
    share = 1.0 if is_rest_known else 0.1

    def with_floor(state: FitState, options: Options) -> EvaluationData:
        found = evaluation(state, options)
        return replace(found, floor=share * found.floor)

    monkeypatch.setattr(FitState, "evaluation", with_floor)
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "asymmetric_coulomb"))
    hidden = (ASYMMETRY, EffectSettings("frictional_lag", (20.0, 5.0e-6)))
    one, other = (record(hidden, seed=seed, duration=16.0, period=0.004) for seed in (1, 2))
    found = workflow.diagnose([one], [other], AXIS, replace(OPTIONS, criteria=Criteria(min_z_score=0.5)))
    (item,) = [item for item in found.rounds if item.accepted and item.accepted.candidate.settings]
    (test,) = item.comparisons.values()
    assert test.passed == is_rest_known == test.name.startswith("z-score")
    assert len(item.alternatives) == (not is_rest_known)


def weakened(value: float) -> Callable[..., Decision]:
    """Return ``decide`` with another z-score of the held-out gap, without an effect, of the effects that are first."""

    def decided(item: Candidate, before: Refit, *others: Any) -> Decision:
        found = decide(item, before, *others)
        tests = tuple(
            at_least(test.of, test.name, value, test.threshold) if test.name == HELD_OUT_GAP else test
            for test in found.tests
        )
        return found if before.effects or item.settings is None else replace(found, tests=tests)

    return decided


@pytest.mark.parametrize(
    "value, is_predictable, names",
    [(1.0, True, ["offset", "spring"]), (1.0, False, []), (-2.0, True, [])],
)
def test_an_effect_whose_gap_another_one_hides_is_added_and_tested_again_in_the_end(
    monkeypatch: pytest.MonkeyPatch, value: float, is_predictable: bool, names: list[str]
) -> None:
    monkeypatch.setattr(workflow, "decide", weakened(value))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    monkeypatch.setattr(workflow, "_is_predictable", lambda *_: is_predictable)
    found = diagnosed(monkeypatch, (OFFSET, SPRING), NAMES)
    assert [item.name for item in accepted_candidates(found.rounds)] == names
    tests = [test for item in found.rounds for test in item.tests if test.of == "offset"]
    assert any(test.name == GAP_WHILE_OTHERS_ARE_MISSING for test in tests) == bool(names)
    assert any(test.name == "gap beside the others: z-score" and test.passed for test in tests) == bool(names)


@pytest.mark.parametrize("z_score, first", [(-10.0, "asymmetric_coulomb"), (10.0, "offset")])
def test_an_effect_that_the_file_lists_is_a_rival_too(search: Search, z_score: float, first: str) -> None:
    """Files of ``sgms identify`` list an offset: beside a wrong name for one, it was no alternative."""
    given = EffectSettings("asymmetric_coulomb", effect("asymmetric_coulomb").defaults)
    setup = replace(search.state.setup, held_effects=frozenset({given.name}), file_effects=(given,))
    state = replace(search.state, setup=setup, current=setup.fit((given, *search.state.current.effects)))
    _, rounds = compared(z_score, state, search.rounds, [], OPTIONS)
    assert [item.name for item in accepted_candidates(rounds)] == [first, "spring"]
    assert rounds[0].comparisons.keys() == {"offset", "asymmetric_coulomb"} - {first}


def test_the_result_of_another_search_is_preferred_only_where_it_predicts_no_worse(search: Search) -> None:
    without = search.found.file_state
    assert workflow.is_preferred(search.state, without, OPTIONS)
    assert not workflow.is_preferred(without, search.state, OPTIONS)


def test_results_are_compared_each_with_the_lags_that_it_was_fitted_with(search: Search) -> None:
    """A search that keeps a lag of the effort does not lend it to the other one, nor borrow the other one's."""
    right, options = search.state, OPTIONS
    late = tuple(EffortLag((lag.values[0] + 3.0,)) for lag in right.lags)
    held = right.recordings.held_out([EffortLag((lag.values[0] + 3.0,)) for lag in right.lags])
    wrong = replace(right, fit_motions=right.recordings.motions(late), held_out_motions=held)
    wrong = wrong.refitted(wrong.current)
    assert wrong.evaluation(options).rms(wrong.current.model) > 1.5 * right.evaluation(options).rms(right.current.model)
    assert workflow.is_preferred(right, wrong, options)
    assert not workflow.is_preferred(wrong, right, options)


def test_wide_elements_are_tried_where_a_changed_contact_leaves_more_than_noise(
    search: Search, monkeypatch: pytest.MonkeyPatch
) -> None:
    of_offset = search.rounds[0].accepted
    assert of_offset is not None
    change = replace(of_offset, candidate=replace(of_offset.candidate, name="changed contact law"))
    changed = (replace(search.rounds[0], accepted=change),)
    refused = (replace(search.rounds[0], accepted=None),)
    for is_closed in (True, False):
        monkeypatch.setattr(EvaluationData, "is_gap_closed", lambda *_, closed=is_closed: closed)
        assert workflow.may_need_wide_elements(search.state, changed, OPTIONS) != is_closed
        assert workflow.may_need_wide_elements(search.state, refused, OPTIONS)
        assert not workflow.may_need_wide_elements(search.state, search.rounds, OPTIONS)
