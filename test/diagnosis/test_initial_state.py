"""The state of the contact at the start of a recording is unknown, until the motion has wiped it out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from workflow_case import AXIS, record

from sgms_observer.diagnosis.contact import element_friction
from sgms_observer.diagnosis.model import Model, stribeck, unknown_initial_friction
from sgms_observer.diagnosis.motion import motion_of, split_at_reversals
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.settings.axis import FrictionSettings

MAXWELL_SLIP = replace(FrictionSettings(), model="gms", static_force=4.0, coulomb_force=4.0, attraction_rate=1.0e5)


@given(swings=st.lists(st.floats(-3.0e-5, 3.0e-5), min_size=2, max_size=6))
def test_two_histories_differ_by_no_more_than_is_unknown(swings: list[float]) -> None:
    """The widest difference: the contact came to its start fully loaded from above, or from below."""
    period = 1.0e-3
    turns = np.concatenate(([0.0], swings))
    way = np.interp(np.arange(1000 * len(turns)) / 1000.0, np.arange(len(turns)), turns)
    first = np.full(400, 1.0e-6)  # slips every element
    friction = []
    for side in (1.0, -1.0):
        position = np.concatenate((np.cumsum(side * first) - side * 4.0e-4, way))
        parts = split_at_reversals(position, period)
        level = stribeck(MAXWELL_SLIP, position, period)
        friction.append(element_friction(MAXWELL_SLIP, *parts, period, level)[0][len(first) :])
    motion = replace(motion_of(record(duration=4.0)), position=way, velocity=np.gradient(way, period))
    left = unknown_initial_friction(MAXWELL_SLIP, motion)
    difference = np.abs(friction[0] - friction[1])
    assert np.all(np.diff(left) <= 1e-9) and left[-1] == 0.0
    assert np.all(difference <= left + difference[-1] + 0.02 * MAXWELL_SLIP.coulomb_force)


def test_the_first_samples_count_less_until_the_contact_has_slipped() -> None:
    motion = motion_of(record(duration=8.0))
    stroke, level = float(np.ptp(motion.position)), AXIS.friction.static_force
    contact = replace(
        AXIS.friction, element_stiffness=(level / stroke,), element_fraction=(1.0,), element_damping=(0.0,)
    )
    covered = np.maximum.accumulate(motion.position) - np.minimum.accumulate(motion.position)
    share = motion.thinned(covered) / stroke
    (weights,) = data_with_own_noise([motion], replace(Model.of(AXIS), friction=contact)).weights
    assert share[0] < 0.5 and share[-1] == 1.0
    assert weights[0] == weights.min() < 0.8 and weights[-1] == 1.0
    assert np.all(weights[share < 0.9] < 1.0)


@pytest.mark.parametrize("returns_after", [1000, 40])
def test_a_lagging_contact_starts_anywhere_between_static_and_coulomb_force(returns_after: int) -> None:
    """One history crept at the static force, the other slid fast at the Coulomb force; both slide on, then return."""
    contact = replace(MAXWELL_SLIP, coulomb_force=2.0, attraction_rate=40.0)
    period, slow, fast = 1.0e-3, 0.05 * MAXWELL_SLIP.stribeck_velocity, 50.0 * MAXWELL_SLIP.stribeck_velocity
    velocity = np.where(np.arange(1000) < returns_after, fast, -fast)
    way = period * np.cumsum(velocity)
    friction = []
    for speed in (slow, fast):
        history = np.full(8000, speed * period)
        position = np.concatenate((np.cumsum(history) - np.sum(history), way))
        parts = split_at_reversals(position, period)
        level = stribeck(contact, position, period)
        friction.append(element_friction(contact, *parts, period, level)[0][len(history) :])
    motion = replace(motion_of(record(duration=4.0)), position=way, velocity=velocity)
    left = unknown_initial_friction(contact, motion)
    difference = np.abs(friction[0] - friction[1])
    assert difference.max() > 0.9 * (contact.static_force - contact.coulomb_force)
    assert np.all(difference <= left + 0.02 * contact.coulomb_force)


def test_the_friction_lag_of_a_recording_from_rest_is_known() -> None:
    contact = replace(MAXWELL_SLIP, coulomb_force=2.0, attraction_rate=40.0)
    motion = motion_of(record(duration=4.0))
    resting = replace(motion, velocity=np.concatenate((np.zeros(10), motion.velocity[10:])))
    lagging = replace(contact, model="gms")
    assert np.array_equal(
        unknown_initial_friction(lagging, resting), unknown_initial_friction(replace(contact, model="sgms"), resting)
    )
