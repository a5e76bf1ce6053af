"""A compensation is applied when it was made for, whatever the way of its message took."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgms_observer.compensation.horizon import Horizon
from sgms_observer.nodes.pace import BumplessForces, DueForces, due_forces
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
MS = 1_000_000


@given(delays=st.lists(st.integers(0, 4 * MS), min_size=50, max_size=50))
def test_jitter_below_the_lead_changes_nothing(delays: list[int]) -> None:
    start = 10**12
    due = DueForces(lead=5e-3, timeout=0.05, sample_period=1e-3)
    due.at(np.array([start]))
    arrivals = np.maximum.accumulate([start + k * MS + delay for k, delay in enumerate(delays)])
    got = []
    sent = 0
    for k in range(len(delays)):
        now = start + k * MS
        while sent < len(delays) and arrivals[sent] <= now:
            due.put(start + sent * MS, float(sent), now)
            sent += 1
        got.append(float(due.at(np.array([now]))[0]))
    assert got == [max(0.0, k - 5.0) for k in range(len(delays))]


def test_the_later_a_message_the_less_it_counts_and_silence_ends_at_zero() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.at(np.array([0]))
    due.put(0, 2.0, MS)
    assert due.at(np.array([1, 2]) * MS).tolist() == [2.0, 2.0]  # in time, and held over one sample
    fading = due.at(np.arange(3, 14) * MS)
    assert np.allclose(fading, [1.8, 1.6, 1.4, 1.2, 1.0, 0.8, 0.6, 0.4, 0.2, 0.0, 0.0])
    due.put(13 * MS, 2.0, 13 * MS)
    due.put(14 * MS, 2.0, 14 * MS)
    assert np.allclose(due.at(np.array([14, 15]) * MS), [0.2, 0.4])  # what comes again comes within the timeout


def test_what_is_late_and_acts_against_the_motion_does_not_count() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.at(np.array([0]), -1)
    due.put(0, 2.0, MS)
    assert due.at(np.array([1]) * MS, -1).tolist() == [2.0]  # in time: the elements still push back
    assert due.at(np.array([3]) * MS, -1).tolist() == [0.0]


def test_a_message_that_is_later_than_the_timeout_is_not_applied() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.at(np.array([0]))
    due.put(5 * MS, 2.0, 5000 * MS)
    assert due.at(np.array([5000, 5001]) * MS).tolist() == [0.0, 0.0]


def test_what_a_newer_message_overtook_changes_nothing() -> None:
    """Applied, it would take the place of the newer one and, being late, count for nothing."""
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.at(np.array([0]))
    for k in range(20, 23):
        due.put(k * MS, 2.0, k * MS)
        assert due.at(np.array([k + 1]) * MS).tolist() == [2.0]
        due.put((k - 18) * MS, -9.0, (k + 1) * MS)
    assert due.at(np.array([24]) * MS).tolist() == [2.0]


def test_a_clock_that_was_set_back_is_followed() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.at(np.array([0]))
    due.put(500 * MS, 2.0, 500 * MS)
    assert due.at(np.array([501]) * MS).tolist() == [2.0]
    due.put(100 * MS, 3.0, 100 * MS)
    assert due.at(np.array([101]) * MS).tolist() == [3.0]


def test_stamps_of_another_clock_count_at_once() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.put(1, 3.0, 10**15)
    assert due.at(np.array([10**15])).tolist() == [3.0]


def test_what_is_not_finite_is_ignored() -> None:
    due = DueForces(lead=0.0, timeout=0.01, sample_period=1e-3)
    due.put(0, math.nan, 0)
    due.put(0, math.inf, 0)
    assert due.at(np.array([0, MS])).tolist() == [0.0, 0.0]


def test_what_is_held_over_a_reversal_is_let_go() -> None:
    """Held on, it would push the wrong way with all its force: worse than no compensation."""
    due = DueForces(lead=2e-3, timeout=0.05, sample_period=1e-3)
    due.at(np.array([0]), 1)
    for k in range(4):
        due.put(k * MS, 1.0 + k, k * MS)
    assert due.at(np.array([2, 3]) * MS, 1).tolist() == [1.0, 2.0]
    assert due.at(np.array([4]) * MS, 0).tolist() == [3.0]  # at rest nothing has turned yet
    assert due.at(np.array([5]) * MS, -1).tolist() == [4.0]  # the message for this time is there
    assert due.at(np.array([6, 7]) * MS, -1).tolist() == [4.0, 0.0]  # held over one sample; then it acts against it
    assert due.at(np.array([8]) * MS, 1).tolist() == [0.0]  # turned again, and the next message is late
    due.put(4 * MS, 6.0, 9 * MS)  # for a time before the turn
    assert due.at(np.array([9]) * MS, 1).tolist() == [0.0]
    due.put(8 * MS, 7.0, 10 * MS)
    assert due.at(np.array([10]) * MS, 1).tolist() == [pytest.approx(7.0 / 50.0)]


def _horizon(first: int, *forces: float) -> Horizon:
    return Horizon(np.arange(first, first + len(forces)) * MS, np.array(forces))


def test_a_horizon_is_read_at_the_time_of_the_sample_and_ends_at_its_last_value() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3, ahead=0.5e-3)
    due.at(np.array([0]))
    due.put_horizon(_horizon(2, 1.0, 3.0, 5.0, 0.0))
    assert due.at(np.arange(1, 7) * MS).tolist() == [0.0, 2.0, 4.0, 2.5, 0.0, 0.0]


def test_the_newest_horizon_that_has_begun_counts_and_late_ones_change_nothing() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.at(np.array([0]))
    due.put_horizon(_horizon(1, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0))
    due.put_horizon(_horizon(3, 2.0, 2.0, 2.0, 0.0))
    assert due.at(np.array([1, 2, 3]) * MS).tolist() == [1.0, 1.0, 2.0]
    due.put_horizon(_horizon(2, 9.0, 9.0, 9.0, 9.0, 0.0))
    due.put(3 * MS, 7.0, 4 * MS)
    assert due.at(np.array([4, 5, 6]) * MS).tolist() == [2.0, 2.0, 0.0]


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_horizon_that_is_not_finite_or_not_in_order_is_ignored(value: float) -> None:
    due = DueForces(lead=0.0, timeout=0.01, sample_period=1e-3)
    due.put_horizon(_horizon(0, 1.0, value, 0.0))
    due.put_horizon(Horizon(np.array([2, 1]) * MS, np.ones(2)))
    due.put_horizon(Horizon(np.zeros(0, np.int64), np.zeros(0)))
    assert due.at(np.array([0, MS])).tolist() == [0.0, 0.0]


def _bumpless() -> BumplessForces:
    due = BumplessForces(lead=1e-3, timeout=0.01, sample_period=1e-3, ahead=0.0, release=1.0, limit=9.0)
    due.at(np.array([0]))
    due.put(0, 0.0, 0)
    assert due.at(np.array([1]) * MS).tolist() == [0.0]
    return due


def test_a_held_load_makes_no_step_when_messages_stop_and_when_they_return() -> None:
    due = _bumpless()
    due.put(1 * MS, 5.0, MS)
    assert due.at(np.arange(2, 300) * MS, -1).tolist() == [5.0] * 298  # against the motion too
    due.put(300 * MS, 7.0, 300 * MS)
    due.put(301 * MS, 8.0, 301 * MS)
    assert np.allclose(due.at(np.array([301, 302]) * MS, 1), [5.004, 6.006])


def test_a_held_load_is_released_slowly_when_the_observer_is_gone() -> None:
    due = _bumpless()
    due.put(1 * MS, 5.0, MS)
    held = due.at(np.arange(2, 2000) * MS)
    assert np.max(np.abs(np.diff(held))) == pytest.approx(0.005) and held[400] == 5.0
    assert held[-1] == 0.0 and np.all(np.diff(held) <= 0.0)


def test_zero_counts_at_once_whatever_was_held() -> None:
    """The observer sends it when it is switched off, stops or gets no samples."""
    due = _bumpless()
    due.put(1 * MS, 5.0, MS)
    due.at(np.arange(2, 100) * MS)
    due.put(99 * MS, 0.0, 99 * MS)
    assert due.at(np.array([100, 101]) * MS).tolist() == [0.0, 0.0]


@given(
    values=st.lists(st.floats(-50.0, 50.0), min_size=100, max_size=100),
    missing=st.lists(st.booleans(), min_size=100, max_size=100),
)
def test_a_held_load_and_what_is_left_of_it_stay_within_the_limit(values: list[float], missing: list[bool]) -> None:
    due = _bumpless()
    for k, (value, is_missing) in enumerate(zip(values, missing, strict=True), start=1):
        if not is_missing:
            due.put(k * MS, value, k * MS)
        assert abs(due.at(np.array([k + 1]) * MS)[0]) <= 9.0


def test_the_fading_end_of_a_horizon_is_not_used_where_a_load_is_held() -> None:
    due = BumplessForces(lead=1e-3, timeout=0.05, sample_period=1e-3, ahead=0.0, release=100.0, limit=9.0)
    due.at(np.array([0]))
    due.put_horizon(Horizon(np.arange(1, 51, 49) * MS, np.zeros(2)))
    due.at(np.arange(1, 51) * MS)
    fading = np.minimum(1.0, np.arange(250, -1, -1) / 50.0)
    due.put_horizon(Horizon(np.arange(51, 302) * MS, 4.0 * fading))
    forces = due.at(np.arange(51, 700) * MS)
    assert forces.tolist() == [4.0] * 649


def test_a_horizon_that_comes_late_makes_no_step_where_a_load_is_held() -> None:
    """The one before it may be from before the compensation was switched on: zero, while the new one is not."""
    due = BumplessForces(lead=1e-3, timeout=0.05, sample_period=1e-3, ahead=0.0, release=1.0, limit=9.0)
    due.at(np.array([0]))
    due.put_horizon(Horizon(np.arange(1, 302, 300) * MS, np.zeros(2)))
    due.at(np.arange(1, 200) * MS)
    due.put_horizon(Horizon(np.arange(51, 352) * MS, np.full(301, 4.0)))
    assert np.allclose(due.at(np.array([200, 201, 202]) * MS), [0.004, 0.008, 0.012])


def test_single_values_after_a_horizon_make_no_step_where_a_load_is_held() -> None:
    """The horizon may be from before the compensation was switched on, and those in between may be lost."""
    due = _bumpless()
    due.put_horizon(Horizon(np.arange(1, 102, 100) * MS, np.zeros(2)))
    for k in range(2, 105):
        due.put((k - 1) * MS, 4.0, k * MS)
        (force,) = due.at(np.array([k]) * MS)
        assert force == pytest.approx(max(0.0, (k - 101) * 0.004))


def test_after_a_horizon_that_ended_no_old_single_value_acts() -> None:
    due = DueForces(lead=1e-3, timeout=0.01, sample_period=1e-3)
    due.at(np.array([0]))
    due.put(0, 3.0, 0)
    due.put_horizon(Horizon(np.arange(1, 42) * MS, np.linspace(3.0, 0.0, 41)))
    forces = due.at(np.arange(1, 60) * MS)
    assert np.allclose(forces[:41], np.linspace(3.0, 0.0, 41)) and not forces[41:].any()


def test_what_is_held_depends_on_the_controller_and_on_the_load() -> None:
    joint = load_settings(ROOT / "config" / "joint.yaml").axes[0]
    assert isinstance(due_forces(joint, 1e-3), BumplessForces)
    controller = replace(joint.stage.controller, integral_rate=0.0)
    assert type(due_forces(replace(joint, stage=replace(joint.stage, controller=controller)), 1e-3)) is DueForces
    light = EffectSettings("gravity", (0.9 * joint.friction.static_force, 0.3, 1.0))
    for effects in ((), (light,)):  # a held output would be wrong by more after a reversal than one without the load
        assert type(due_forces(replace(joint, effects=effects), 1e-3)) is DueForces
