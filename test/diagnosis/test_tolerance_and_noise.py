"""Effects within the tolerance of the file, and effects that a fitted noise hides."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from workflow_case import AXIS, evaluation_of, record

from sgms_observer.diagnosis import pruning, workflow
from sgms_observer.diagnosis.answer import _best_unnamed, answer_of
from sgms_observer.diagnosis.candidates import Candidate
from sgms_observer.diagnosis.changed_contact import CHANGE_HYPOTHESES
from sgms_observer.diagnosis.criteria import Criteria, at_least
from sgms_observer.diagnosis.decision import SIZE_BEYOND_TOLERANCE, Decision
from sgms_observer.diagnosis.diagnosis import FitState, Options, Round, accepted_candidates
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.evidence import Improvement
from sgms_observer.diagnosis.fit import Refit, RefitSetup
from sgms_observer.diagnosis.instruments import Share
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.ranges import plausible_range
from sgms_observer.diagnosis.uncertainty import RecordingEstimates, recording_estimates
from sgms_observer.effects.catalogue import effect
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings

OFFSET, SPRING = EffectSettings("offset", (0.4,)), EffectSettings("spring", (20.0, 0.0))
NOTHING = replace(OFFSET, values=(0.0,))


@pytest.fixture(scope="module")
def evaluation() -> EvaluationData:
    """Return the evidence of two recordings with an offset."""
    learn, judge = (motion_of(record((OFFSET,), seed=seed, duration=12.0)) for seed in (1, 2))
    return evaluation_of([learn], Model.of(AXIS).with_effects((OFFSET,)), [judge])


def test_an_effect_is_fitted_beside_held_values(evaluation: EvaluationData) -> None:
    setup = RefitSetup(evaluation.fit_data, Model.of(AXIS), 0.05)
    start = np.full(len(setup.nominal.parameter_names()), 0.01)
    free, held = (setup.fit((NOTHING,), start, is_nominal_held=one) for one in (False, True))
    assert np.array_equal(held.logs, start) and not np.array_equal(free.logs, start)
    assert held.effects[0].values[0] == pytest.approx(0.4, rel=0.05)
    assert np.all(np.any(held.jacobian != 0.0, axis=0))  # intervals still know that the values of the file may be wrong


@pytest.mark.parametrize(
    "hidden, refused_by",
    [
        (EffectSettings("actuator_gain", (0.8,)), "size beyond the tolerance"),
        (EffectSettings("mass_error", (1.2,)), "gap beside the others: z-score"),
    ],
)
def test_within_the_tolerance_of_the_file_nothing_is_missing(
    hidden: EffectSettings, refused_by: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: (hidden.name,))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    one, other = (record((hidden,), seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    options = Options(workers=1, band=25.0)
    found = workflow.diagnose([one], [other], AXIS, options)
    (item,) = [item.accepted for item in found.rounds if item.accepted]
    (test,) = [test for test in item.tests if test.name.startswith("size beyond the tolerance")]
    assert item.candidate.name == hidden.name and test.value > test.threshold

    state = found.final_state
    state = replace(state, setup=replace(state.setup, tolerance=0.5))  # the same fit, of an owner who knows less
    rounds = pruning.without_insignificant_effects(found.file_state, state, found.rounds, found.nominal, options)[1]
    (item,) = [item for number in rounds for item in number.decisions if item.candidate.name == hidden.name]
    assert not any(number.accepted for number in rounds)
    assert item.tests[-1].name.startswith(refused_by) and item.tests[-1].value < 0.0


def test_what_may_be_within_the_tolerance_remains_a_rival(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gain that is refused for its size has no name. What takes its place is not sure either."""
    small = at_least("actuator_gain", SIZE_BEYOND_TOLERANCE, 1.0, 1.645)
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("actuator_gain", "mass_error"))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    hidden = (EffectSettings("mass_error", (1.2,)),)
    one, other = (record(hidden, seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    options = Options(workers=1, band=25.0)
    found = workflow.diagnose([one], [other], AXIS, options)
    search = workflow._search(
        workflow._Search((found.file_state,), small={small.of: small}), (), options, lambda *_: None
    )
    rounds = [item for item in search.rounds if item.accepted]
    assert [item.accepted.candidate.name for item in rounds if item.accepted] == ["mass_error"]
    (gain,) = [item for item in rounds[0].decisions if item.candidate.name == "actuator_gain"]
    assert rounds[0].accepted and gain.is_possible_beside(rounds[0].accepted)
    assert gain.tests[-1] is small and gain.may_be_within_tolerance and not gain.passed
    assert "actuator_gain" in rounds[0].comparisons
    assert workflow._within_tolerance(search.rounds) == {"actuator_gain": small}


@pytest.mark.parametrize("is_small", [False, True])
def test_what_may_be_within_the_tolerance_is_nothing_unknown(is_small: bool) -> None:
    """A gain that is refused for its size may predict a share of the residual: the file's values may, too."""
    small = at_least("actuator_gain", SIZE_BEYOND_TOLERANCE, 1.0, 1.645)
    predicts = at_least("actuator_gain", "z-score on data not fitted to", 9.0, 3.0)
    candidate: Any = SimpleNamespace(name="actuator_gain", settings=EffectSettings("actuator_gain", (1.04,)))
    nothing: Any = None
    gain = Improvement(0.3, 9.0, 1.0)
    item = Decision(candidate, nothing, gain, gain, (predicts,)).with_test(small if is_small else None)
    found: Any = SimpleNamespace(
        final_state=SimpleNamespace(held_out_motions=(1,)), rounds=(Round({}, (item,), None, {}),)
    )
    assert _best_unnamed(found, Criteria()) is (None if is_small else item)


@pytest.mark.parametrize(("share", "angle", "named"), [(0.96, 0.43, []), (0.8, 0.4, ["gravity"])])
def test_a_listed_effect_within_the_tolerance_is_no_finding(
    share: float, angle: float, named: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """An arm whose owner knows the gravity to 5 %: what is left of it looks like a spring or a cogging."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("gravity", "spring", "cogging", "offset"))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    hidden = EffectSettings("gravity", (20.0, 0.4, 1.0))
    axis = replace(
        AXIS, mass=0.1, joint_type="revolute", effects=(EffectSettings("gravity", (20.0 * share, angle, 1.0)),)
    )
    one, other = (record((hidden,), seed, 12.0, mass=0.1, period=0.004, scale=50.0) for seed in (1, 2))
    options = Options(workers=1, band=25.0)
    answer = answer_of(workflow.diagnose([one], [other], axis, options), axis, options)
    assert [item.settings.name for item in answer.effects] == named
    assert bool(answer.changed) is bool(named)
    (gravity,) = [item for item in answer.model.effects if item.name == "gravity"]
    assert gravity.values[:2] == pytest.approx((20.0, 0.4), rel=0.01)


def test_a_shape_that_the_stroke_does_not_determine_has_no_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("cogging",))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    hidden = EffectSettings("cogging", (0.8, 0.02, 0.3, 0.0, 0.0))
    one, other = (record((hidden,), seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    found = workflow.diagnose([one], [other], AXIS, Options(workers=1, band=25.0))
    (item,) = [item.accepted for item in found.rounds if item.accepted]
    (test,) = [test for test in item.tests if test.name.startswith("90 % interval of a pitch")]
    assert test.passed and 0.0 < test.value < 0.1

    def with_wide_pitch(*arguments: Any) -> RecordingEstimates:
        estimates = recording_estimates(*arguments)
        stroke = float(np.ptp(one.position))
        is_pitch = [effect("cogging").parameters[j].name == "pitch" for _, j in estimates.free]
        of_pitch = (0.4 * stroke) ** 2 * np.eye(len(estimates.values))
        return replace(
            estimates, covariances=np.where(np.array(is_pitch)[:, None, None], of_pitch, estimates.covariances)
        )

    monkeypatch.setattr(pruning, "recording_estimates", with_wide_pitch)
    arguments = found.file_state, found.final_state, found.rounds, found.nominal, Options(workers=1, band=25.0)
    rounds = pruning.without_insignificant_effects(*arguments)[1]
    (tests,) = [item.tests for number in rounds for item in number.decisions if item.candidate.name == "cogging"]
    assert not any(number.accepted for number in rounds)
    assert tests[-1].name == test.name and tests[-1].value == pytest.approx(2.0 * 1.645 * 0.4, rel=0.01)


def test_a_tight_spot_lies_within_the_stroke() -> None:
    """Beyond its end it is a slope, and wider than the stroke another Coulomb force."""
    motion = motion_of(record(duration=12.0))
    low, high = float(motion.position.min()), float(motion.position.max())
    ranges = [
        plausible_range("position_dependent_friction", name, [motion], Model.of(AXIS)) for name in ("center", "width")
    ]
    assert ranges == [(low, high), (0.0, 0.5 * (high - low))]


@pytest.mark.parametrize(
    ("share", "error", "is_named"), [(1.0, 0.001, True), (0.55, 0.001, False), (0.41, 0.23, False), (0.41, 0.4, True)]
)
def test_what_the_response_shows_of_a_delay_has_to_exceed_the_lag_of_a_held_effort(
    share: float, error: float, is_named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second share is less than what a held effort and inexact stamps make. So is the third, of a lead screw that
    has no delay: its interval ends at 0.79. The last one tells nothing: the response could hold none or all of it."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("actuator_delay",))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    monkeypatch.setattr(pruning, "delay_in_response", lambda *_: Share(share, error))
    hidden = EffectSettings("actuator_delay", (8.0e-4,))
    one, other = (record((hidden,), seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    axis = replace(AXIS, filter=replace(AXIS.filter, effort_is_held=True))
    found = workflow.diagnose([one], [other], axis, Options(workers=1, band=25.0))
    assert [one.name for one in accepted_candidates(found.rounds)] == (["actuator_delay"] if is_named else [])


@pytest.mark.parametrize(
    "is_significant, is_predictable, goes_on", [(True, False, True), (False, True, True), (False, False, False)]
)
def test_noise_does_not_end_the_search_where_it_holds_an_effect(
    monkeypatch: pytest.MonkeyPatch, is_significant: bool, is_predictable: bool, goes_on: bool
) -> None:
    """With the gap within the noise the search goes on only if another effect than the added one surely predicted, as
    the spring does here, or a regression predicts a part of the rest."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "spring"))
    monkeypatch.setattr(EvaluationData, "is_gap_closed", lambda *_: True)
    if not is_significant:
        monkeypatch.setattr(workflow, "_sure_predictions", lambda *_: frozenset())
    if not is_predictable:
        monkeypatch.setattr(workflow, "_is_predictable", lambda *_: False)
    hidden = (EffectSettings("offset", (1.5,)), SPRING)
    one, other = (record(hidden, seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    found = workflow.diagnose([one], [other], AXIS, Options(workers=1, band=25.0))
    assert (len(accepted_candidates(found.rounds)) > 1) is goes_on


@pytest.mark.parametrize("changes", [set(), {"changed friction"}])
def test_in_the_noise_only_what_predicted_is_looked_for(monkeypatch: pytest.MonkeyPatch, changes: set[str]) -> None:
    """Behind the cogging of a noisy joint a delay, a mode and a mass error were named: no contact had to compete."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "spring", "cogging"))
    monkeypatch.setattr(EvaluationData, "is_gap_closed", lambda *_: True)
    monkeypatch.setattr(workflow, "_is_predictable", lambda *_: False)
    sure, fitted, tried = workflow._sure_predictions, workflow.changed_candidate, list[str]()
    monkeypatch.setattr(workflow, "_sure_predictions", lambda last: sure(last) - {*CHANGE_HYPOTHESES} | changes)

    def noted(setup: RefitSetup, before: Refit, name: str) -> Candidate:
        tried.append(name)
        return fitted(setup, before, name)

    monkeypatch.setattr(workflow, "changed_candidate", noted)
    hidden = (EffectSettings("offset", (1.5,)), SPRING)
    one, other = (record(hidden, seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    found = workflow.diagnose([one], [other], AXIS, Options(workers=1, band=25.0))
    assert [set(item.screenings) for item in found.rounds[:2]] == [{"offset", "spring", "cogging"}, {"spring"}]
    assert "spring" in {one.name for one in accepted_candidates(found.rounds)}
    assert {name for name in tried if tried.count(name) > 1} == changes


def test_after_an_effect_is_removed_the_search_goes_on_without_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "asymmetric_coulomb"))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    monkeypatch.setattr(workflow._Search, "can_go_on", lambda search, *_: not search.rounds)  # one effect at a time

    def without_offset(found: FitState, state: FitState, rounds: tuple[Round, ...], *others: Any) -> Any:
        """Remove the offset in the end, as a failed test does."""
        failed = at_least("offset", "a test of the whole result", 0.0, 1.0)
        rounds = tuple(item.with_test(failed) if added(item) == "offset" else item for item in rounds)
        state = state if any(item.accepted for item in rounds) else found
        return pruning.without_insignificant_effects(found, state, rounds, *others)

    monkeypatch.setattr(workflow, "without_insignificant_effects", without_offset)
    one, other = (record((OFFSET,), seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    found = workflow.diagnose([one], [other], AXIS, Options(workers=1, band=25.0))
    assert [sorted(item.screenings) for item in found.rounds] == [
        ["asymmetric_coulomb", "offset"],
        ["asymmetric_coulomb"],
    ]
    assert [added(item) for item in found.rounds] == ["", "asymmetric_coulomb"]


def added(item: Round) -> str:
    """Return what a round added."""
    return item.accepted.candidate.name if item.accepted else ""


def test_an_unexplained_force_at_rest_takes_no_name_away(monkeypatch: pytest.MonkeyPatch) -> None:
    """More than a third of the effort stays unexplained, but nothing of it while the contact slides."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "spring"))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    one, other = (_with_force_at_rest(seed) for seed in (1, 2))
    options = Options(workers=1, band=50.0)
    answer = answer_of(workflow.diagnose([one], [other], AXIS, options), AXIS, options)
    (named,) = answer.effects
    assert named.settings.name == "spring" and named.settings.values[0] == pytest.approx(60.0, rel=0.05)
    assert answer.gap.unweighted_after > 100.0 * options.criteria.max_unexplained and not answer.usable
    assert any(text.startswith("unusable model: ") for text in answer.warnings)


def _with_force_at_rest(seed: int) -> Recording:
    """Return a recording with a spring, and a random force in the rests of ``rich_position``.

    Its encoder is so fine that it hides no reversal there.
    """
    found = record((EffectSettings("spring", (60.0, 0.0)),), seed=seed, duration=24.0, period=0.002)
    time = found.period * np.arange(len(found)) % 6.0
    rests = np.clip(np.minimum((time - 5.25) * 20.0, (5.95 - time) * 20.0), 0.0, 1.0)
    white = np.random.default_rng([seed, 9]).normal(0.0, 12.0, len(found))
    force = np.convolve(white, np.full(8, 8.0**-0.5), "same")
    return replace(found, effort=found.effort + rests * force, recorded_step=1.0e-11)
