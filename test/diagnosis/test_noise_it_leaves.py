"""A large and brief effect of the fitted recording alone: the noise that it leaves tells the values of the file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from workflow_case import AXIS, FRICTION, record

from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import answer_of
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.motion import HELD_LAG, delayed
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import FilterSettings

WRONG = replace(FRICTION, coulomb_force=1.04 * FRICTION.coulomb_force, static_force=1.04 * FRICTION.static_force)
FILE = replace(AXIS, friction=WRONG, filter=FilterSettings(effort_is_held=False))
OPTIONS = Options(workers=1, band=25.0)
LIMIT = 22.5


def logged(seed: int, scale: float, is_limited: bool = False) -> Recording:
    """Return a recording of a drive, whose commands beyond its limit wind up."""
    made = record(seed=seed, duration=16.0, period=0.004, scale=scale)
    effort = delayed(made.effort, HELD_LAG)
    wound_up = np.random.default_rng(seed).uniform(1000.0, 3000.0, len(effort)) * (np.abs(effort) > LIMIT)
    return replace(made, effort=effort + np.sign(effort) * wound_up * is_limited)


@pytest.mark.parametrize("is_limited", [False, True])
def test_a_limit_that_no_held_out_recording_reaches_has_its_name_where_it_corrects_the_file(
    is_limited: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "actuator_saturation"))
    learn, judge = logged(1, 4.0, is_limited), logged(2, 2.0)
    assert np.max(np.abs(judge.effort)) < LIMIT < np.max(np.abs(learn.effort))
    answer = answer_of(workflow.diagnose([learn], [judge], FILE, OPTIONS), FILE, OPTIONS)
    assert answer.gap.after < 1.5
    assert [item.settings.name for item in answer.effects] == (["actuator_saturation"] if is_limited else [])
    for item in answer.effects:
        assert item.settings.values == pytest.approx((LIMIT,), rel=0.05)
