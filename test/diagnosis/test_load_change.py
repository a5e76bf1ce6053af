"""Recordings with different loads contradict each other: the answer says so in place of "nothing is missing"."""

from __future__ import annotations

from dataclasses import replace

import pytest
from workflow_case import AXIS, record

from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import answer_of
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.gap_data import GapData
from sgms_observer.diagnosis.load_change import other_load
from sgms_observer.diagnosis.model import Model

OPTIONS = Options(workers=1, band=25.0)
FINE = Model.of(AXIS).with_split_elements()
TITLE = "share of the squared gap that another load of the recording closes"


@pytest.mark.parametrize(("mass", "is_other"), [(5.0, False), (5.2, False), (6.5, True)])
def test_a_held_out_recording_with_another_load_is_told(
    mass: float, is_other: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("spring", "offset"))
    learn = record(seed=1, duration=12.0, period=0.004, scale=3.0)
    judge = replace(record(seed=2, duration=12.0, period=0.004, scale=3.0, mass=mass), name="with_load")
    answer = answer_of(workflow.diagnose([learn], [judge], AXIS, OPTIONS), AXIS, OPTIONS)
    told = [text for text in answer.warnings if text.startswith("the recordings disagree about the moving mass")]
    failed = [test for test in answer.tests if test.name == TITLE and not test.passed]
    assert bool(told) is bool(failed) is is_other
    assert answer.verdict == ("cannot_tell" if is_other else "no_effect")
    if is_other:
        # the same where the contact was changed, but the gap did not confirm it: the file then has other elements
        written = replace(answer.diagnosis.written, setup=replace(answer.diagnosis.written.setup, nominal=FINE))
        data = GapData.of(replace(answer.diagnosis, written=written), OPTIONS)
        load = other_load(data, written.before)
        assert load is not None and not load.test.passed
        assert "5 kg in those that were fitted, 6.5 kg in with_load" in told[0]
        assert not answer.disturbance


def test_recordings_of_the_same_name_are_told_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two bags of different folders may have one name; only one of them has another load."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("spring", "offset"))
    learn, alike, other = (
        record(seed=seed, duration=12.0, period=0.004, scale=3.0, mass=mass)
        for seed, mass in ((1, 5.0), (3, 5.0), (2, 6.5))
    )
    diagnosis = workflow.diagnose([learn], [alike, other], AXIS, OPTIONS)
    load = other_load(GapData.of(diagnosis, OPTIONS), diagnosis.written.before)
    assert load is not None and not load.test.passed
    assert load.mass == pytest.approx(6.5, rel=0.01)
