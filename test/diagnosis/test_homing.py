"""Recordings of an axis that was not homed: the ripple goes with the machine, the position does not."""

from dataclasses import replace

import pytest
from workflow_case import AXIS, evaluation_of, record

from sgms_observer.diagnosis.evaluation import EvaluationData
from sgms_observer.diagnosis.homing import OFFSETS_PER_PITCH, homing_warnings, pitch_of, position_offset
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
    (sentence,) = homing_warnings([RIPPLED], evaluation(LACKS), UNITS)
    assert "seems shifted by 3.67 mm. If the axis was not homed" in sentence
    assert homing_warnings([RIPPLED], evaluation(0.0), UNITS) == []
    assert homing_warnings([Model.of(AXIS).with_effects([OFFSET])], evaluation(LACKS), UNITS) == []
    assert homing_warnings([RIPPLED], evaluation(LACKS, is_unseen=False), UNITS) == []


def test_the_longest_pitch_counts() -> None:
    fine = EffectSettings("encoder_interpolation_error", (1e-8, 2.0e-5, 0.0))
    assert pitch_of([COGGING, fine]) == PITCH
    assert pitch_of([OFFSET]) is None
