"""Where the contact slides is a matter of the contact, not of the encoder."""

from __future__ import annotations

import numpy as np
from workflow_case import AXIS, PERIOD, rich_position

from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.sliding import slides_fast
from sgms_observer.offline.recording import Recording

MODEL = Model.of(AXIS)
FINE, COARSE = 1.0e-8, 5.0e-6
"""Encoder steps [m]; of the coarse one the axis passes fewer than 20 in a sample, most of the time."""


def where_it_slides_fast(step: float) -> np.ndarray:
    position = np.round(rich_position(20.0, seed=1) / step) * step
    (fast,) = slides_fast(MODEL, [motion_of(Recording("test", PERIOD, position, np.zeros(len(position))))])
    return fast


def test_a_coarse_encoder_does_not_make_the_contact_stick() -> None:
    fine, coarse = (where_it_slides_fast(step) for step in (FINE, COARSE))
    assert np.mean(fine) > 0.25
    assert np.mean(fine != coarse) < 0.1
