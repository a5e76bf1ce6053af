"""Recordings of an axis that was not homed: the ripple goes with the machine, the position does not."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
from workflow_case import AXIS, evaluation_of, record

from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import answer_of
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.homing import OFFSETS_PER_PITCH, pitch_of, position_offset, position_shifts, shifts_in
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.units import Units

PITCH = 0.01
COGGING = EffectSettings("cogging", (0.6, PITCH, 0.3, 0.0, 0.0))
OFFSET = EffectSettings("offset", (0.6,))
RIPPLED = Model.of(AXIS).with_effects([COGGING])
LACKS = 3.7e-3
UNITS = Units()


def evaluation(lacks: float, is_unseen: bool = True) -> EvaluationData:
    """Return evaluation data with one recording whose positions lack so much [m]."""
    homed = record((COGGING,), seed=3, duration=12.0)
    motion = motion_of(replace(homed, position=homed.position - lacks))
    return evaluation_of((motion_of(homed),) if is_unseen else (motion,), RIPPLED, (motion,) if is_unseen else ())


def test_the_ripple_tells_where_a_recording_counts_from() -> None:
    motion = evaluation(LACKS).motions[0]
    for seconds in (None, 4.0):
        assert position_offset(RIPPLED, motion, seconds) == pytest.approx(LACKS, abs=0.6 * PITCH / OFFSETS_PER_PITCH)
    with pytest.raises(ValueError, match="offset is not identifiable"):
        position_offset(Model.of(AXIS), motion)


def test_a_recording_that_counts_from_elsewhere_is_told_and_a_homed_one_is_not() -> None:
    (shift,) = position_shifts(RIPPLED, evaluation(LACKS))
    assert shift.offset == pytest.approx(LACKS, abs=0.1 * PITCH / OFFSETS_PER_PITCH) and shift.pitch == PITCH
    assert "fit with 3.69 mm added, up to multiples of" in shift.warning(UNITS)
    (back,) = position_shifts(RIPPLED, evaluation(PITCH - 1e-3))
    assert back.offset == pytest.approx(-1e-3, abs=0.1 * PITCH / OFFSETS_PER_PITCH)
    assert position_shifts(RIPPLED, evaluation(0.0)) == ()
    assert position_shifts(Model.of(AXIS).with_effects([OFFSET]), evaluation(LACKS)) == ()
    assert position_shifts(RIPPLED, evaluation(LACKS, is_unseen=False)) == ()


def test_the_scale_of_the_weights_does_not_count() -> None:
    found = evaluation(LACKS)
    low = tuple(0.01 * part for part in found.weights)
    low_data = replace(found.held_out_data, weights=low)
    (shift,) = position_shifts(RIPPLED, replace(found, held_out_data=low_data))
    assert shift.offset == pytest.approx(LACKS, abs=0.1 * PITCH / OFFSETS_PER_PITCH)


@pytest.mark.parametrize("lacks", [0.0, LACKS])
def test_a_ripple_has_its_name_where_the_held_out_recording_counts_from_elsewhere(
    lacks: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "cogging"))
    learn, homed = (record((COGGING,), seed=seed, duration=12.0, period=0.004) for seed in (1, 3))
    judge = replace(homed, name="elsewhere", position=homed.position - lacks, reference_position=homed.position - lacks)
    options = Options(workers=1, band=25.0)
    answer = answer_of(workflow.diagnose([learn], [judge], AXIS, options), AXIS, options)
    assert answer.verdict == "effect_found"
    (found,) = answer.effects
    assert found.settings.values[:3] == pytest.approx(COGGING.values[:3], rel=0.03)
    told = [text for text in answer.warnings if text.startswith("the positions of elsewhere fit with")]
    assert len(told) == (lacks > 0.0)
    (judged,) = answer.diagnosis.final_state.recordings.holdouts
    assert judged.reference_position is not None
    assert judged.position == pytest.approx(homed.position, abs=0.005 * PITCH)
    assert judged.reference_position == pytest.approx(homed.position, abs=0.005 * PITCH)


@pytest.mark.parametrize("is_in_final", [False, True])
def test_a_ripple_that_its_wrong_place_refused_tells_the_shift(is_in_final: bool) -> None:
    """Another ripple of the final model does not hide it; a ripple of the final model itself counts before it."""
    fine = EffectSettings("encoder_interpolation_error", (1e-8, 2.0e-5, 0.0))
    names = {item.name: SimpleNamespace(name=item.name, settings=item, refit=None) for item in (COGGING, fine)}
    names["cogging"].refit = SimpleNamespace(model=RIPPLED, cost=1.0)
    effects = (COGGING, fine) if is_in_final else (fine,)
    after = SimpleNamespace(model=Model.of(AXIS).with_effects(effects), effects=effects)
    written = SimpleNamespace(after=after, setup=SimpleNamespace(held_effects=frozenset[str]()))
    rounds = [SimpleNamespace(decisions=[SimpleNamespace(candidate=names["cogging"])])]
    for lacks, count in ((LACKS, 1), (0.0, 0)):
        diagnosis: Any = SimpleNamespace(evaluation=evaluation(lacks), written=written, rounds=rounds)
        assert len(shifts_in(diagnosis)) == count


def test_the_longest_pitch_counts() -> None:
    fine = EffectSettings("encoder_interpolation_error", (1e-8, 2.0e-5, 0.0))
    assert pitch_of([COGGING, fine]) == PITCH
    assert pitch_of([OFFSET]) is None
