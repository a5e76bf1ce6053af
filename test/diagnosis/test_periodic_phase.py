"""A force that is periodic in time has another phase in every recording: nobody starts a pump with the recording."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from workflow_case import AXIS, record

from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.compensation_check import check_compensation
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.model import Model, predict, with_phases_of
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings

PERIOD = 1.0 / 250.0
OPTIONS = Options(workers=1, band=25.0)
AMPLITUDE, FREQUENCY = 0.3, 3.3


def pump(phase: float) -> EffectSettings:
    return EffectSettings("periodic_disturbance", (AMPLITUDE, FREQUENCY, phase))


def made(phase: float, seed: int, *others: EffectSettings) -> Recording:
    return record((pump(phase), *others), seed=seed, duration=12.0, period=PERIOD)


def answered(records: list[Recording], holdouts: list[Recording]) -> Answer:
    return answer_of(diagnose(records, holdouts, AXIS, OPTIONS), AXIS, OPTIONS)


@pytest.fixture(autouse=True)
def few_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for a few effects, so that a run takes seconds."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("periodic_disturbance", "cogging", "offset"))


@pytest.mark.parametrize("learnt_from", [(0.4,), (0.4, 3.0)], ids=["one recording", "two recordings"])
def test_it_is_found_though_the_phase_differs(learnt_from: tuple[float, ...]) -> None:
    answer = answered([made(phase, seed) for seed, phase in enumerate(learnt_from)], [made(0.4 + math.pi, 7)])
    (named,) = answer.effects
    amplitude, frequency, phase = named.settings.values
    assert named.settings.name == "periodic_disturbance" and answer.verdict == "effect_found"
    assert amplitude == pytest.approx(AMPLITUDE, rel=0.1) and frequency == pytest.approx(FREQUENCY, rel=1.0e-3)
    assert math.remainder(phase - learnt_from[0], 2.0 * math.pi) == pytest.approx(0.0, abs=0.2)
    assert answer.gap.after < 1.2 * answer.gap.noise
    assert any("the phase of periodic_disturbance" in text for text in answer.warnings)


def test_a_recording_without_it_is_no_evidence_for_it() -> None:
    still = record((), seed=7, duration=12.0, period=PERIOD)
    assert not answered([made(0.4, 1)], [still]).effects


def test_behind_an_effort_path_it_is_the_phase_of_the_force() -> None:
    """The effort leads the force by the delay: 0.41 rad in 20 ms at 3.3 Hz."""
    path = (EffectSettings("actuator_gain", (0.8,)), EffectSettings("actuator_delay", (0.02,)))
    motion = motion_of(made(1.0, 1, *path))
    model = with_phases_of(replace(Model.of(AXIS), effects=(*path, pump(-2.0))), motion)
    expected = 1.0 - 2.0 * math.pi * FREQUENCY * 0.02
    assert model.effects[-1].values == pytest.approx((AMPLITUDE, FREQUENCY, expected), abs=0.1)
    assert model.effects[:-1] == path


def test_settings_do_not_fix_the_phase() -> None:
    motion = motion_of(made(1.0, 1))
    one, other = (predict(replace(Model.of(AXIS), effects=(pump(phase),)), motion).residual for phase in (0.0, 2.0))
    np.testing.assert_allclose(one, other, atol=1.0e-9)


def test_the_feedforward_is_judged_with_the_phase_of_the_recording() -> None:
    found = made(1.0, 1)
    right, wrong, none = (
        check_compensation(found, replace(AXIS, effects=effects), 25.0, 0.5).friction_not_cancelled
        for effects in ((pump(1.0),), (pump(1.0 + math.pi),), ())
    )
    assert right == pytest.approx(wrong)
    assert math.sqrt(none**2 - right**2) == pytest.approx(AMPLITUDE / math.sqrt(2.0), rel=0.1)
