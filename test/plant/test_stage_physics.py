"""The simulated stage obeys mechanics: energy, static friction, stiffness, step-size convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from stages import paper_axis, stored_energy, under_open_loop, with_controller, work_of_effort

from sgms_observer.arrays import Floats
from sim_plant.stage import SimulatedStage

MODELS = pytest.mark.parametrize("model", ["gms", "sgms"])


def ramp_and_hold(force: float, samples: int) -> Floats:
    return np.concatenate([np.linspace(0.0, force, 5000), np.full(samples - 5000, force)])


@MODELS
def test_sticking_stage_without_damping_keeps_its_energy(model: str) -> None:
    axis = under_open_loop(paper_axis(model, {"viscous_coefficient": 0.0}))
    force = 0.1  # N; the stiffest element gets at most 2 * 0.75 * 0.1 N of its 0.27 N
    record = SimulatedStage(axis, 1e-4).step(20000, force)
    energy = stored_energy(axis, record)
    np.testing.assert_allclose(energy, force * record.position, rtol=0.0, atol=1e-9 * energy.max())
    omega = np.sqrt(sum(axis.friction.element_stiffness) / axis.mass)
    crossings = np.flatnonzero(np.diff(np.sign(record.velocity - 1e-12)) != 0)
    assert len(crossings) == pytest.approx(omega / np.pi * 2.0, rel=0.01)


@MODELS
@pytest.mark.parametrize("friction", [{}, {"static_force": 4.0}, {"element_damping": (10.0, 10.0, 5.0, 5.0)}])
def test_friction_takes_energy_at_every_instant(model: str, friction: dict[str, object]) -> None:
    axis = paper_axis(model, friction)
    record = SimulatedStage(axis, 1e-4).step(10000)
    dissipated = work_of_effort(record) - np.diff(stored_energy(axis, record))
    assert dissipated.min() >= 0.0
    way = np.abs(np.diff(record.position)).sum()
    assert 0.9 * 4.0 * way < dissipated.sum() < 1.2 * 4.5 * way


@MODELS
def test_static_friction_holds_without_drift(model: str) -> None:
    axis = under_open_loop(paper_axis(model))
    record = SimulatedStage(axis, 1e-4).step(100_000, ramp_and_hold(3.5, 100_000))
    settled = record.position[40_000:]
    assert np.ptp(settled) < 1e-13
    assert abs(record.velocity[-1]) < 1e-15
    assert record.friction[-1] == pytest.approx(3.5, abs=1e-9)


@MODELS
def test_force_above_breakaway_moves_it(model: str) -> None:
    axis = under_open_loop(paper_axis(model))
    record = SimulatedStage(axis, 1e-4).step(20_000, ramp_and_hold(4.6, 20_000))
    terminal = (4.6 - axis.friction.coulomb_force) / axis.friction.viscous_coefficient
    assert record.position[-1] > 1e-3
    assert 0.2 * terminal < record.velocity[-1] < terminal


@MODELS
def test_finer_steps_converge(model: str) -> None:
    def run(substeps: int) -> Floats:
        return SimulatedStage(paper_axis(model, substeps=substeps), 1e-4).step(4000).friction

    truth = run(400)
    error = {n: float(np.sqrt(np.mean((run(n) - truth) ** 2))) for n in (1, 10, 100)}
    assert error[10] < error[1] / 5.0
    assert error[100] < error[10] / 5.0
    assert error[10] < 1e-3  # N, a hundredth of the paper's measurement noise


@MODELS
@pytest.mark.parametrize("scale", [1.0, 1e4])
def test_stable_at_any_stiffness_with_the_coarsest_step(model: str, scale: float) -> None:
    axis = paper_axis(model, substeps=1)
    stiffness = tuple(scale * kappa for kappa in axis.friction.element_stiffness)
    axis = replace(axis, friction=replace(axis.friction, element_stiffness=stiffness))
    record = SimulatedStage(axis, 1e-4).step(20_000)
    assert np.abs(record.friction).max() < 1.1 * axis.friction.static_force + 20.0 * np.abs(record.velocity).max()
    assert np.abs(record.position - record.reference_position).max() < 2e-5


@MODELS
def test_balance_of_forces(model: str) -> None:
    axis = paper_axis(model, substeps=100)
    record = SimulatedStage(axis, 1e-4).step(4000)
    balance = record.effort_applied - axis.mass * record.acceleration - record.friction
    step = 1e-6  # s, of the integration; friction moves on by half of it at most at the elements' full stiffness
    bound = 0.5 * step * np.abs(record.velocity).max() * sum(axis.friction.element_stiffness) + 1e-9
    assert np.abs(balance).max() < bound


def test_sgms_and_gms_stages_agree_but_for_the_frictional_lag() -> None:
    gms = SimulatedStage(paper_axis("gms", {"attraction_rate": 1e6}), 1e-4).step(6000)
    sgms = SimulatedStage(paper_axis("sgms", {"smoothing_gamma": 1e4}), 1e-4).step(6000)
    assert np.sqrt(np.mean((gms.friction - sgms.friction) ** 2)) < 0.02 * np.ptp(gms.friction)


def test_integral_action_holds_at_the_limit() -> None:
    axis = with_controller(paper_axis("sgms"), integral_rate=20.0, effort_limit=2.0)  # cannot break away
    record = SimulatedStage(axis, 1e-4).step(20_000)
    assert np.abs(record.control_effort).max() <= 2.0
    freed = SimulatedStage(with_controller(axis, effort_limit=50.0), 1e-4)
    assert np.abs(freed.step(20_000).position).max() == pytest.approx(2.0e-4, rel=0.02)
