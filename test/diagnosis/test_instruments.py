"""A delay shows in the response to the reference; encoder noise that the controller feeds back makes none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from workflow_case import evaluation_of

from sgms_observer.diagnosis import decision
from sgms_observer.diagnosis.candidates import Candidate
from sgms_observer.diagnosis.criteria import Criteria, at_most
from sgms_observer.diagnosis.evaluation import evidence_of
from sgms_observer.diagnosis.fit import RefitSetup
from sgms_observer.diagnosis.gap import residuals
from sgms_observer.diagnosis.instruments import Share, share_in_response
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.diagnosis.sliding import slides_fast
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import load_settings
from sim_plant.plants.machine import draw_plant
from sim_plant.plants.owner import write_yaml
from sim_plant.plants.recording import record

SEED = 53006
"""A machine whose controller runs at the rate of the log, behind an encoder that limits the acceleration."""
SIZE, DELAY = 0.245, 1.4e-3
"""Largest force that a delay misses there, as a share of the Coulomb force, and that delay [s]."""


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Model:
    path = Path(tmp_path_factory.mktemp("file")) / "axis.yaml"
    write_yaml(path, draw_plant("rate_state", SEED), with_joint_type=True)
    return Model.of(load_settings(path).axes[0])


def made(delay: float) -> Recording:
    """Return a recording of the machine with its reference; no model of this package simulates it."""
    machine = draw_plant("rate_state", SEED)
    found = record(machine, ["delay"] if delay else [], SIZE * delay / DELAY, SEED, "rich", 30.0)
    return Recording("test", 1.0 / machine.log_rate, found.position, found.effort, found.reference)


def correlated(model: Model, motion: Motion) -> float:
    """Return the share of the delay by least squares without instruments."""
    late = model.with_effects([EffectSettings("actuator_delay", (DELAY,))])
    (left,), (rest,) = (residuals(one, [motion]) for one in (model, late))
    (fast,) = slides_fast(model, [motion])
    change = (left - rest)[fast]
    return float(change @ left[fast] / (change @ change))


def shared(model: Model, recording: Recording, given: np.ndarray | None) -> Share | None:
    late = model.with_effects([EffectSettings("actuator_delay", (DELAY,))])
    return share_in_response(late, model, [motion_of(recording)], [given], Criteria())


def test_noise_in_the_effort_is_no_delay(model: Model) -> None:
    recording = made(0.0)
    share = shared(model, recording, recording.whole_reference)
    assert share is not None and correlated(model, motion_of(recording)) > 0.25
    assert abs(share.value) < 3.0 * share.error < 0.25


def test_a_delay_is_all_of_it(model: Model) -> None:
    recording = made(DELAY)
    share = shared(model, recording, recording.whole_reference)
    assert share is not None and share.error < 0.1
    assert share.value == pytest.approx(1.0, abs=3.0 * share.error + 0.05)


@pytest.mark.parametrize("has_reference", [True, False])
def test_a_delay_in_the_response_is_named_beside_another_contact_law(
    model: Model, has_reference: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There a free-form regression over the coordinates of a contact predicts better: what it finds is the contact."""
    recording = made(DELAY)
    evaluation = evaluation_of([motion_of(recording)], model)
    evaluation = replace(evaluation, gap=evaluation.rms(model))
    if has_reference:
        evaluation = replace(evaluation, references=(recording.whole_reference,))
    setup = RefitSetup(evaluation.fit_data, model, 0.05)
    before, found = setup.fit(()), setup.fit((EffectSettings("actuator_delay", (DELAY,)),))
    better = at_most("actuator_delay", "share that is surely predicted better by a free-form term", 0.6, 0.1)
    monkeypatch.setattr(decision, "free_form_tests", lambda *_: [better])
    candidate = Candidate("actuator_delay", setup, found, 1)
    decided = decision.decide(candidate, before, evidence_of(before, evaluation), evaluation)
    assert decided.passed == has_reference
    assert (better in decided.tests) != has_reference


def test_without_a_reference_or_motion_it_says_nothing(model: Model) -> None:
    recording = made(0.0)
    assert shared(model, recording, None) is None
    still = replace(recording, position=np.full(len(recording), recording.position[0]))
    assert shared(model, still, recording.whole_reference) is None
