"""An effect fitted alone where drifting parameters hide it, and effects that a fitted noise hides."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from workflow_case import AXIS, evaluation_of, record

from sgms_observer.diagnosis import pruning, workflow
from sgms_observer.diagnosis.candidates import Candidate
from sgms_observer.diagnosis.criteria import at_least
from sgms_observer.diagnosis.decision import HELD_OUT_GAP, decide
from sgms_observer.diagnosis.diagnosis import FitState, Options, Round, accepted_candidates
from sgms_observer.diagnosis.evaluation import EvaluationData, evidence_of
from sgms_observer.diagnosis.fit import RefitSetup
from sgms_observer.diagnosis.gap import residuals
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.effects.learnt_map import LearntMap
from sgms_observer.settings.axis import EffectSettings

OFFSET, SPRING = EffectSettings("offset", (0.4,)), EffectSettings("spring", (20.0, 0.0))
NOTHING = replace(OFFSET, values=(0.0,))
BLIND = 1.0e-4
"""Weight of samples that the evidence hardly counts."""


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


def test_where_drift_hides_the_gap_the_effect_counts_alone(evaluation: EvaluationData) -> None:
    """The fit of all values errs where the evidence is blind; the gap as reported is not."""
    setup = RefitSetup(evaluation.fit_data, Model.of(AXIS), 0.05)
    before = setup.fit(())
    drifted = setup.fit((OFFSET,))
    grid, force = np.linspace(0.0, 12.0, 25), np.zeros(25)
    force[8:11] = 4.0
    drift = LearntMap.zero(("time",), (tuple(grid.tolist()),), 1.0e-7).filled(force).settings()
    erring = drifted.model.with_effects((drift,))
    right, wrong = (residuals(model, evaluation.motions)[0] for model in (drifted.model, erring))
    weights = np.where(np.abs(wrong - right) > 0.01, BLIND, 1.0)
    evaluation = replace(evaluation, held_out_data=replace(evaluation.held_out_data, weights=(weights,)))
    candidate = Candidate("offset", setup, replace(drifted, model=erring), 1)
    earlier = evidence_of(before, evaluation)
    found = decide(candidate, before, earlier, evaluation)
    assert found.passed and not np.array_equal(candidate.refit.logs, before.logs)
    assert np.array_equal(found.candidate.refit.logs, before.logs)
    # Where the effect fails another test, too, it is not tried alone.
    weak = replace(evaluation, criteria=replace(evaluation.criteria, min_closed_share=2.0))
    failed = decide(candidate, before, earlier, weak)
    assert failed.candidate.refit.logs is candidate.refit.logs
    assert HELD_OUT_GAP in [test.name for test in failed.tests if not test.passed]


@pytest.mark.parametrize("hidden", [EffectSettings("actuator_gain", (0.8,)), EffectSettings("mass_error", (1.2,))])
def test_within_the_tolerance_of_the_file_nothing_is_missing(
    hidden: EffectSettings, monkeypatch: pytest.MonkeyPatch
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
    assert item.tests[-1].name == test.name and item.tests[-1].value < 0.0


@pytest.mark.parametrize("is_hidden_by_drift", [True, False])
def test_the_written_model_keeps_the_values_whose_drift_would_hide_the_gap(
    is_hidden_by_drift: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset",))
    monkeypatch.setattr(workflow, "CHANGE_HYPOTHESES", ())
    masses: list[float] = []

    def reported_rms(_: EvaluationData, model: Model) -> float:
        """Return a gap that shrinks by the effect, and grows if the mass moves beside it."""
        if not model.effects:
            masses.append(model.mass)
        moved = is_hidden_by_drift and [model.mass] != masses[-1:]
        return 1.0 - 0.5 * len(model.effects) + 2.0 * moved

    monkeypatch.setattr(EvaluationData, "reported_rms", reported_rms, raising=True)
    monkeypatch.setattr(EvaluationData, "best_for_gap", lambda _, __, fit: fit)  # which does not know the gap above
    one, other = (record((OFFSET,), seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    fits = workflow.diagnose([one], [other], AXIS, Options(workers=1, band=25.0)).written
    assert [item.name for item in fits.after.effects] == ["offset"]
    assert np.array_equal(fits.after.logs, fits.before.logs) is is_hidden_by_drift
    assert fits.errors[0, 0] > 0.0


@pytest.mark.parametrize(
    "is_sure, is_predictable, goes_on", [(True, False, True), (False, True, True), (False, False, False)]
)
def test_noise_does_not_end_the_search_where_it_holds_an_effect(
    monkeypatch: pytest.MonkeyPatch, is_sure: bool, is_predictable: bool, goes_on: bool
) -> None:
    """With the gap within the noise the search goes on only if another effect than the added one surely predicted, as
    the spring does here, or a regression predicts a part of the rest."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "spring"))
    monkeypatch.setattr(EvaluationData, "is_gap_closed", lambda *_: True)
    if not is_sure:
        monkeypatch.setattr(workflow, "_leaves_a_sure_prediction", lambda *_: False)
    if not is_predictable:
        monkeypatch.setattr(workflow, "_is_predictable", lambda *_: False)
    hidden = (EffectSettings("offset", (1.5,)), SPRING)
    one, other = (record(hidden, seed=seed, duration=12.0, period=0.004) for seed in (1, 2))
    found = workflow.diagnose([one], [other], AXIS, Options(workers=1, band=25.0))
    assert (len(accepted_candidates(found.rounds)) > 1) is goes_on


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
