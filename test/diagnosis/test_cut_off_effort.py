"""A log that cuts the effort off: what the model needs beyond the limit is no residual, and a warning says so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from workflow_case import AXIS as HELD
from workflow_case import record

from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.motion import HELD_LAG, delayed
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings, FilterSettings

AXIS = replace(HELD, filter=FilterSettings(effort_is_held=False))
COGGING = EffectSettings("cogging", (0.6, 0.01, 0.3, 0.0, 0.0))
OPTIONS = Options(workers=1, band=25.0)


def logged(seed: int, largest: float, effects: tuple[EffectSettings, ...] = ()) -> Recording:
    """Return a recording whose log shows no effort beyond a limit; the effort is not held."""
    made = record(effects, seed=seed, duration=16.0, period=0.004, scale=3.0)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(len(made))  # of the amplifier
    effort = delayed(made.effort, HELD_LAG) + noise
    return replace(made, name=f"log_{seed}", effort=np.clip(effort, -largest, largest))


def answered(largest: float, effects: tuple[EffectSettings, ...] = ()) -> Answer:
    """Return the answer on two such recordings."""
    return answer_of(
        workflow.diagnose([logged(1, largest, effects)], [logged(2, largest, effects)], AXIS, OPTIONS), AXIS, OPTIONS
    )


@pytest.fixture(autouse=True)
def few_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for a few effects, so that a run takes seconds."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "cogging", "actuator_saturation"))


@pytest.mark.parametrize(("largest", "is_told"), [(5.6, True), (1.0e3, False)])
def test_an_effort_that_the_log_cuts_off_is_no_force_from_outside(largest: float, is_told: bool) -> None:
    answer = answered(largest)
    assert answer.verdict == "no_effect" and answer.disturbance is None and answer.gap.after < 1.5
    told = [text for text in answer.warnings if "is cut off at -5.6 N and 5.6 N, which" in text]
    assert len(told) == (2 if is_told else 0)


def test_an_effect_has_its_name_and_its_size_beside_it() -> None:
    (found,) = answered(5.6, (COGGING,)).effects
    assert found.settings.name == "cogging"
    assert found.settings.values[:3] == pytest.approx(COGGING.values[:3], rel=0.05)
