"""The values of the file that predict the gap as reported best."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from workflow_case import AXIS, evaluation_of, record

from sgms_observer.diagnosis.diagnosis import Options, WrittenFits
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.final_model import final_model
from sgms_observer.diagnosis.fit import RefitSetup
from sgms_observer.diagnosis.gap_data import GapData
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.uncertainty import RecordingEstimates
from sgms_observer.settings.axis import EffectSettings

OFFSET = EffectSettings("offset", (0.4,))
BLIND = 1.0e-4
"""Weight of samples that the evidence hardly counts."""
STIFF = replace(AXIS.friction, element_stiffness=tuple(3.0 * one for one in AXIS.friction.element_stiffness))
"""A contact three times as stiff as that of the recordings."""


@pytest.fixture(scope="module")
def evaluation() -> EvaluationData:
    """Return the evidence of two recordings with an offset, blind where the contact sticks."""
    learn, judge = (motion_of(record((OFFSET,), seed=seed, duration=12.0)) for seed in (1, 2))
    found = evaluation_of([learn], Model.of(AXIS).with_effects((OFFSET,)), [judge])

    def blind_at_rest(motion: object, weights: np.ndarray) -> np.ndarray:
        moves = np.abs(motion.thinned(motion.velocity)) > 2.0e-3  # type: ignore[attr-defined]
        return np.where(moves, weights, BLIND)

    fit, held = (
        replace(data, weights=tuple(map(blind_at_rest, data.motions, data.weights)))
        for data in (found.fit_data, found.held_out_data)
    )
    return replace(found, fit_data=fit, held_out_data=held)


def test_values_that_the_evidence_hardly_shows_are_fitted_to_the_gap(evaluation: EvaluationData) -> None:
    setup = RefitSetup(evaluation.fit_data, replace(Model.of(AXIS), friction=STIFF), 0.05)
    found = setup.fit((OFFSET,))
    best = evaluation.best_for_gap(setup, found)
    assert best.effects == found.effects  # what an effect is, the evidence says
    assert evaluation.reported_rms(best.model) < 0.9 * evaluation.reported_rms(found.model)
    assert best.jacobian.shape == found.jacobian.shape and best.free == found.free  # intervals as before


def test_values_that_predict_the_gap_stay(evaluation: EvaluationData) -> None:
    """Without a sure gain that is worth a name, and without recordings to judge it on, the evidence decides."""
    setup = RefitSetup(evaluation.fit_data, Model.of(AXIS), 0.05)
    found = setup.fit((OFFSET,))
    assert evaluation.best_for_gap(setup, found) is found
    stiff = replace(setup, nominal=replace(Model.of(AXIS), friction=STIFF))
    wrong = stiff.fit((OFFSET,))
    alone = replace(evaluation, held_out_data=replace(evaluation.held_out_data, motions=()))
    assert alone.best_for_gap(stiff, wrong) is wrong


def test_models_that_are_compared_in_the_gap_both_have_the_values_for_it(evaluation: EvaluationData) -> None:
    """Values of the evidence on one side only, and what they leave at rest counts as closed by an effect."""
    setup = RefitSetup(evaluation.fit_data, replace(Model.of(AXIS), friction=STIFF), 0.05)
    small = (replace(OFFSET, values=(0.3,)),)
    fitted, none = setup.fit((OFFSET,)), RecordingEstimates.none()
    written = WrittenFits(fitted, evaluation.best_for_gap(setup, fitted), fitted, setup, none, none, none)
    of_gap, of_evidence = (
        evaluation.reported_rms(one.with_effects(small, evaluation).model)
        for one in (written, replace(written, after=fitted))
    )
    assert of_gap**2 < (1.0 - evaluation.criteria.min_closed_share) * of_evidence**2


def test_the_gap_as_reported_is_tested_with_its_own_weights(evaluation: EvaluationData) -> None:
    """Values that predict it better may predict what the evidence counts worse."""
    setup = RefitSetup(evaluation.fit_data, replace(Model.of(AXIS), friction=STIFF), 0.05)
    found = setup.fit((OFFSET,))
    other = (replace(OFFSET, values=(0.41,)),)  # N; it predicts a sliding contact worse than 0.4 does
    best = evaluation.best_for_gap(setup, found)
    best = replace(best, effects=other, model=replace(best.model, effects=other))
    state = SimpleNamespace(
        fit_motions=evaluation.fit_motions, held_out_motions=evaluation.motions, current=found, setup=setup
    )
    written = SimpleNamespace(before=found, after=best, setup=setup)
    run: Any = SimpleNamespace(
        final_state=state, file_state=state, written=written, nominal=setup.nominal, accepted=[], rounds=()
    )
    data = GapData(run, Options(), evaluation.motions, evaluation.held_out_data)
    final = final_model(data, None)
    (shrinks,) = [test for test in final.tests if test.name == "gap as reported: z-score"]
    assert data.reduction(final.before, final.after).z_score < 0.0 < shrinks.threshold < shrinks.value
    assert final.fit is best
