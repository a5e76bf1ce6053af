"""Recordings of an axis that was not homed: the ripple goes with the machine, the position does not."""

from dataclasses import replace

import pytest
from workflow_case import AXIS, record

from sgms_observer.discrepancy.fit import judged_with
from sgms_observer.discrepancy.gate import Gate, floor_of
from sgms_observer.discrepancy.homing import PLACES, pitch_of, place_of, unhomed
from sgms_observer.discrepancy.model import Model
from sgms_observer.discrepancy.motion import motion_of
from sgms_observer.settings.axis import EffectSettings

PITCH = 0.01
COGGING = EffectSettings("cogging", (0.6, PITCH, 0.3, 0.0, 0.0))
OFFSET = EffectSettings("offset", (0.6,))
RIPPLED = Model.of(AXIS).with_effects([COGGING])
LACKS = 3.7e-3


def gate_of(lacks: float, is_unseen: bool = True) -> Gate:
    """Return a gate on one recording whose positions lack so much [m]."""
    homed = record((COGGING,), seed=3, duration=12.0)
    motion = motion_of(replace(homed, position=homed.position - lacks))
    noise = judged_with((motion_of(homed),), RIPPLED).noise
    return Gate((motion,), floor_of((motion,), RIPPLED, noise, 1), is_unseen)


def test_the_ripple_tells_where_a_recording_counts_from() -> None:
    gate = gate_of(LACKS)
    for seconds in (None, 4.0):
        assert place_of(RIPPLED, gate.motions[0], seconds) == pytest.approx(LACKS, abs=0.6 * PITCH / PLACES)
    with pytest.raises(ValueError, match="nothing tells the place"):
        place_of(Model.of(AXIS), gate.motions[0])


def test_a_recording_that_counts_from_elsewhere_is_told_and_a_homed_one_is_not() -> None:
    (sentence,) = unhomed([RIPPLED], gate_of(LACKS))
    assert "3.67 mm further along: home the axis" in sentence
    assert unhomed([RIPPLED], gate_of(0.0)) == []
    assert unhomed([Model.of(AXIS).with_effects([OFFSET])], gate_of(LACKS)) == []
    assert unhomed([RIPPLED], gate_of(LACKS, is_unseen=False)) == []


def test_the_longest_pitch_counts() -> None:
    fine = EffectSettings("encoder_interpolation_error", (1e-8, 2.0e-5, 0.0))
    assert pitch_of([COGGING, fine]) == PITCH
    assert pitch_of([OFFSET]) is None
