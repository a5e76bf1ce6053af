"""What users of the simulated stage rely on: tracking, determinism, any split, encoder, delay, several axes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from stages import paper_axis, with_controller, with_reference

from sgms_observer.settings.axis import AxisSettings, EffectSettings, EncoderSettings, Settings
from sim_plant.record import StageRecord, join_records
from sim_plant.stage import SimulatedStage
from sim_plant.table import SimulatedTable

REPOSITORY = Path(__file__).resolve().parents[2]


def assert_same(first: StageRecord, second: StageRecord) -> None:
    for field in fields(StageRecord):
        assert_array_equal(getattr(first, field.name), getattr(second, field.name), err_msg=field.name)


def noisy_axis(seed: int = 1, name: str = "x") -> AxisSettings:
    axis = paper_axis(
        "gms",
        encoder=EncoderSettings(resolution=1e-8, noise=5e-9),
        force_noise=0.05,
        disturbance_noise=0.02,
        actuation_delay=2.3e-4,
        seed=seed,
    )
    effects = (EffectSettings("cogging"), EffectSettings("thermal_drift"), EffectSettings("actuator_delay", (3.0e-4,)))
    return replace(axis, name=name, stage_effects=effects)


def static_error_bound(axis: AxisSettings, acceleration: float = 0.0) -> float:
    omega = 2.0 * np.pi * axis.stage.controller.bandwidth
    return (axis.friction.static_force + axis.mass * acceleration) / (axis.mass * omega**2)


def test_tracks_the_papers_sine_within_what_friction_costs() -> None:
    axis = paper_axis("gms")
    record = SimulatedStage(axis, 1e-4).step(20_000)
    error = np.abs(record.position - record.reference_position)[2000:]
    bound = static_error_bound(axis, 2e-4 * (2 * np.pi * 5) ** 2)
    assert error.max() < 1.2 * bound
    assert error.max() > 0.5 * axis.friction.coulomb_force / axis.friction.static_force * bound


@pytest.mark.parametrize("model", ["gms", "sgms"])
def test_returns_to_the_reference_after_each_move(model: str) -> None:
    axis = with_reference(paper_axis(model), kind="point_to_point", amplitude=0.02, dwell=0.4)
    record = SimulatedStage(axis, 1e-4).step(25_000)
    at_rest = (record.reference_velocity == 0.0) & (np.roll(record.reference_velocity, 3000) == 0.0)
    error = np.abs(record.position - record.reference_position)[at_rest]
    assert at_rest.sum() > 1000
    assert error.max() <= static_error_bound(axis)
    with_integral = SimulatedStage(with_controller(axis, integral_rate=10.0), 1e-4).step(25_000)
    assert np.abs(with_integral.position - with_integral.reference_position)[at_rest].max() < 0.1 * error.max()


@pytest.mark.parametrize("seed", [3, 11])
def test_any_split_into_steps_gives_the_same_bits(seed: int) -> None:
    whole = SimulatedStage(noisy_axis(), 1e-4).step(3000)
    stage, pieces, generator = SimulatedStage(noisy_axis(), 1e-4), [], np.random.default_rng(seed)
    print(f"seed {seed}")
    while sum(map(len, pieces)) < 3000:
        length = int(generator.choice([1, 2, 7, 511, 513]))
        pieces.append(stage.step(min(length, 3000 - sum(map(len, pieces)))))
    assert_same(whole, join_records(pieces))
    assert stage.samples_done == 3000


def test_seed_decides_every_random_number() -> None:
    first, again, other = (SimulatedStage(noisy_axis(seed), 1e-4).step(600) for seed in (1, 1, 2))
    assert_same(first, again)
    assert not np.array_equal(first.measured_position, other.measured_position)
    namesake = SimulatedStage(noisy_axis(1, "y"), 1e-4).step(600)
    assert not np.array_equal(first.control_effort, namesake.control_effort)


def test_noise_has_the_stated_size() -> None:
    axis = paper_axis("gms", encoder=EncoderSettings(noise=5e-9), force_noise=0.1)
    noisy, clean = SimulatedStage(axis, 1e-4).step(20_000), paper_axis("gms")
    position_noise = noisy.measured_position - noisy.position
    assert position_noise.std() == pytest.approx(5e-9, rel=0.03)
    assert abs(position_noise.mean()) < 5 * 5e-9 / np.sqrt(20_000)
    effort_noise = noisy.control_effort - noisy.effort_applied
    assert effort_noise.std() == pytest.approx(0.1, rel=0.03)
    quiet = SimulatedStage(clean, 1e-4).step(2000)
    assert_array_equal(quiet.control_effort, quiet.effort_applied)
    assert_array_equal(quiet.measured_position, quiet.position)


def test_encoder_shows_the_nearest_step() -> None:
    resolution = 1e-7
    record = SimulatedStage(paper_axis(encoder=EncoderSettings(resolution=resolution)), 1e-4).step(3000)
    steps = record.measured_position / resolution
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)
    assert np.abs(record.measured_position - record.position).max() <= 0.5000001 * resolution
    assert len(np.unique(record.measured_position)) > 100


def test_slower_samples_show_the_same_motion() -> None:
    fast = SimulatedStage(paper_axis("gms"), 1e-4).step(3000)
    slow = SimulatedStage(paper_axis("gms"), 1e-3).step(300)
    np.testing.assert_allclose(slow.position, fast.position[::10], rtol=0.0, atol=1e-15)
    np.testing.assert_allclose(slow.control_effort, fast.control_effort[::10], rtol=0.0, atol=1e-7)
    assert_array_equal(np.diff(slow.stamp_ns), 1_000_000)


@pytest.mark.parametrize("period", [5e-5, 2.5e-4, 3e-4, 2e-3])
def test_any_sample_period_tracks(period: float) -> None:
    axis = with_reference(paper_axis("sgms"), frequency=2.0)
    record = SimulatedStage(axis, period).step(round(1.0 / period))
    assert record.time[-1] == pytest.approx((len(record) - 1) * period)
    error = np.abs(record.position - record.reference_position)[len(record) // 10 :]
    assert error.max() < 1.2 * static_error_bound(axis, 2e-4 * (2 * np.pi * 2) ** 2)


def test_force_arrives_after_the_delay() -> None:
    record = SimulatedStage(paper_axis("gms", actuation_delay=5e-4), 1e-4).step(3000)
    assert_array_equal(record.effort_applied[5:], record.control_effort[:-5])
    assert_array_equal(record.effort_applied[:5], 0.0)


def test_compensation_enters_the_effort_within_the_limit() -> None:
    axis = with_controller(paper_axis("gms"), effort_limit=4.0)
    compensation = np.zeros(400)
    compensation[100:200], compensation[200:300] = 1e6, np.nan
    record = SimulatedStage(axis, 1e-4).step(400, compensation)
    assert_array_equal(record.control_effort[100:200], 4.0)
    assert_array_equal(record.compensation[200:300], 0.0)
    assert np.isfinite(record.position).all()
    deaf = SimulatedStage(replace(axis, stage=replace(axis.stage, accept_compensation=False)), 1e-4).step(400, 3.0)
    assert_array_equal(deaf.compensation, 0.0)
    assert_same(deaf, SimulatedStage(axis, 1e-4).step(400))


def test_right_compensation_removes_most_of_the_error() -> None:
    axis = paper_axis("gms")
    plain = SimulatedStage(axis, 1e-4).step(6000)
    helped = SimulatedStage(axis, 1e-4).step(6000, plain.friction)

    def rms(record: StageRecord) -> float:
        return float((record.position - record.reference_position)[2000:].std())

    assert rms(helped) < 0.5 * rms(plain)


def test_truth_may_differ_from_the_model() -> None:
    axis = paper_axis("gms")
    weaker = replace(axis.friction, coulomb_force=2.0, static_force=2.0)
    truth = replace(axis, stage=replace(axis.stage, mass=6.0), stage_friction=weaker)
    told, true = SimulatedStage(axis, 1e-4).step(4000), SimulatedStage(truth, 1e-4).step(4000)
    assert np.abs(true.friction).max() < 0.6 * np.abs(told.friction).max()
    steady = slice(3000, 3900)
    balance = true.effort_applied - 6.0 * true.acceleration - true.friction
    assert np.abs(balance[steady]).max() < 0.1


def test_axes_of_a_table_move_as_they_would_alone() -> None:
    axes = (noisy_axis(1, "x"), with_reference(noisy_axis(1, "y"), frequency=3.0))
    table = SimulatedTable(Settings(axes=axes), start_ns=5)
    records = table.step(700)
    assert table.names == ("x", "y")
    for axis, record in zip(axes, records, strict=True):
        assert_same(record, SimulatedStage(axis, 1e-4, start_ns=5).step(700))
    seeded = SimulatedTable(Settings(axes=axes), start_ns=5, seed=9).step(700)
    assert not np.array_equal(seeded[0].measured_position, records[0].measured_position)


def test_coupled_axis_feels_the_other_one() -> None:
    moving, resting = paper_axis("gms"), with_reference(paper_axis("gms"), amplitude=0.0)
    coupling = EffectSettings("cross_axis_coupling", (0.5, 0.0))
    axes = (replace(moving, name="x"), replace(resting, name="y", stage_effects=(coupling,)))
    x, y = SimulatedTable(Settings(axes=axes)).step(3000)
    np.testing.assert_allclose(y.effect_force[11:], 0.5 * (np.diff(x.velocity) / 1e-4)[10:], atol=0.05)
    assert np.abs(y.effect_force).max() > 0.1
    assert np.abs(y.position).max() > 0.0


def test_runs_the_same_without_numba() -> None:
    program = (
        "import json, sys; sys.path.insert(0, 'test/plant');"
        "from test_stage_behaviour import noisy_axis; from sim_plant.stage import SimulatedStage;"
        "from sgms_observer.jit import HAS_NUMBA;"
        "record = SimulatedStage(noisy_axis(), 1e-4).step(40);"
        "print(json.dumps([HAS_NUMBA, record.position.tolist(), record.friction.tolist()]))"
    )
    answer = subprocess.run(
        [sys.executable, "-c", program],
        cwd=REPOSITORY, env={**os.environ, "SGMS_OBSERVER_NO_NUMBA": "1"}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    has_numba, position, friction = json.loads(answer.stdout)
    compiled = SimulatedStage(noisy_axis(), 1e-4).step(40)
    assert not has_numba
    np.testing.assert_allclose(position, compiled.position, rtol=1e-9, atol=1e-18)
    np.testing.assert_allclose(friction, compiled.friction, rtol=1e-7, atol=1e-9)
