"""A stage that follows set-points: it rests until one comes, meets them at their stamps, and stops behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stages import paper_axis, with_reference

from sim_plant.reference import COAST, FollowedReference
from sim_plant.stage import SimulatedStage

PERIOD = 1.0e-3
MILLISECOND = 1_000_000


def sine(time: np.ndarray | float) -> np.ndarray | float:
    return 1e-3 * np.sin(4.0 * np.pi * np.asarray(time))


def test_a_stage_rests_until_a_set_point_comes_then_follows() -> None:
    stage = SimulatedStage(with_reference(paper_axis(), kind="topic"), PERIOD)
    assert stage.followed is not None
    assert not stage.step(50).reference_position.any()
    errors = []
    for k in range(50, 600):
        stamp = 10**18 + k * MILLISECOND
        stage.followed.put(stamp + 100 * MILLISECOND, float(sine((k + 50) * PERIOD)), np.nan, stamp)
        stage.followed.anchor(stamp, k * PERIOD)
        record = stage.step(1)
        if k >= 160:
            errors.append(record.reference_position[0] - sine((k - 50) * PERIOD))
            assert abs(record.position[0] - record.reference_position[0]) < 1e-5
    assert np.max(np.abs(errors)) < 1e-9


def test_the_motion_is_smooth_between_set_points() -> None:
    followed = FollowedReference()
    for k in range(60):
        followed.put(k * MILLISECOND, float(sine(k * PERIOD)), 0.0, 0)
    time = np.arange(5e-3, 50e-3, 1e-4)
    followed.anchor(5 * MILLISECOND, 5e-3)
    position, velocity, acceleration = followed.at(time)
    assert np.max(np.abs(position - sine(time))) < 1e-10
    assert np.max(np.abs(velocity - 4e-3 * np.pi * np.cos(4.0 * np.pi * time))) < 1e-6
    assert np.max(np.abs(acceleration)) < 1.1 * 16e-3 * np.pi**2


def test_it_coasts_and_then_stops_where_set_points_end() -> None:
    followed = FollowedReference()
    followed.anchor(0, 0.0)
    followed.put(0, 0.0, 0.1, 0)
    position, velocity, _ = followed.at(np.array([0.5 * COAST, 2.0 * COAST, 1.0]))
    assert position == pytest.approx([0.05 * COAST, 0.1 * COAST, 0.1 * COAST])
    assert velocity == pytest.approx([0.1, 0.0, 0.0])


def test_stamps_of_another_clock_count_from_their_arrival() -> None:
    followed = FollowedReference()
    followed.anchor(10**18, 0.0)
    followed.put(0, 2e-3, 0.0, 10**18)
    assert followed.at(np.array([0.0, 1e-3]))[0] == pytest.approx([2e-3, 2e-3])
    followed.put(5, np.nan, 0.0, 10**18)
    assert followed.at(np.array([2e-3]))[0] == pytest.approx([2e-3])


def test_distant_set_points_are_steps() -> None:
    followed = FollowedReference()
    followed.anchor(0, 0.0)
    followed.put(0, 0.0, np.nan, 0)
    followed.put(1000 * MILLISECOND, 1e-3, np.nan, 0)
    position, velocity, _ = followed.at(np.array([0.5, 0.999, 1.0, 1.5]))
    assert position == pytest.approx([0.0, 0.0, 1e-3, 1e-3])
    assert not velocity.any()


def test_a_stage_that_follows_the_topic_draws_the_same_noise() -> None:
    """The set-points come while it runs; encoder and force noise belong to the samples as ever."""
    axis = replace(paper_axis(), stage=replace(paper_axis().stage, force_noise=0.1, seed=5))
    resting = with_reference(axis, amplitude=0.0)
    followed = with_reference(axis, kind="topic")
    one, other = (SimulatedStage(each, PERIOD).step(700).control_effort for each in (resting, followed))
    assert np.array_equal(one, other)
