"""The blind plant is physics: it dissipates, does not drift, converges, balances, and owes nothing to the catalogue."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.signal import butter, filtfilt

from sgms_observer.jit import HAS_NUMBA
from sim_plant.blind import kernel, menu, slots
from sim_plant.blind.case import chance, make_scene, recording_noise
from sim_plant.blind.hidden_effect import Around, Hidden
from sim_plant.blind.kernel import carry, sliding_curve
from sim_plant.blind.owner import nominal_model, reduce_contact, virgin_curve
from sim_plant.blind.recording import NOISE_SHARE, coloured_noise, measured_size, record
from sim_plant.blind.stage import HELD_OUT, PERIOD, draw_stage, held_out_motion, rich_motion

needs_numba = pytest.mark.skipif(not HAS_NUMBA, reason="millions of steps in plain Python")
FORBIDDEN = ("formulas", "effects", "friction", "diagnosis", "observer", "estimators")


def contact_path(travel: np.ndarray, seed: int = 1, speed: float = 1.0e-3) -> tuple[np.ndarray, float]:
    """Return the contact's force after each small move of ``travel`` [m], and its sliding level."""
    stage = draw_stage(chance(seed, 1))
    springs, shares = stage.springs, np.array(stage.shares)
    loads, modes = np.zeros(springs.size), np.zeros(springs.size, dtype=np.bool_)
    level = stage.coulomb_force
    force, before, last = [], 0.0, 0.0
    for place in travel:
        step = place - before
        if step * last < 0.0:
            modes[:] = False
        force.append(carry(loads, modes, springs, shares, step, abs(step) / speed, level, stage.attraction))
        before, last = place, step
    return np.array(force), level


def test_imports_nothing_of_the_catalogue() -> None:
    code = (
        "import sys, pkgutil, importlib, sim_plant.blind as b\n"
        "[importlib.import_module(f'sim_plant.blind.{m.name}') for m in pkgutil.iter_modules(b.__path__)]\n"
        f"bad = [m for m in sys.modules for f in {FORBIDDEN!r} if m.split('.')[:2] == ['sgms_observer', f]]\n"
        "sys.exit(' '.join(bad) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_contact_dissipates_over_closed_cycles() -> None:
    phase = np.linspace(0.0, 6.0 * np.pi, 6001)
    for amplitude in (1.0e-7, 1.0e-6, 1.0e-5, 1.0e-4):
        travel = amplitude * np.sin(phase)
        force, _ = contact_path(travel)
        work = force[2001:] * np.diff(travel[2000:])
        assert work[:2000].sum() > 0.0  # one whole cycle after the first
        assert work[:2000].sum() == pytest.approx(work[2000:4000].sum(), rel=1.0e-3)


def test_contact_remembers_its_return_point() -> None:
    out = np.linspace(0.0, 4.0e-6, 401)
    inner = np.concatenate((out, np.linspace(4.0e-6, 3.0e-6, 101)[1:], np.linspace(3.0e-6, 4.0e-6, 101)[1:]))
    force, _ = contact_path(inner, speed=1.0e-5)
    assert force[-1] == pytest.approx(force[400], rel=1.0e-3)


def test_contact_slides_at_the_level() -> None:
    force, level = contact_path(np.linspace(0.0, 2.0e-3, 4001))
    assert force[-1] == pytest.approx(level, rel=1.0e-6)
    back, _ = contact_path(np.concatenate((np.linspace(0.0, 2.0e-3, 2001), np.linspace(2.0e-3, 0.0, 2001)[1:])))
    assert back[-1] == pytest.approx(-level, rel=1.0e-6)


def test_slip_instant_does_not_depend_on_the_step() -> None:
    fine, _ = contact_path(np.linspace(0.0, 5.0e-5, 50001))
    coarse, _ = contact_path(np.linspace(0.0, 5.0e-5, 51))
    assert coarse[1:] == pytest.approx(fine[1000::1000], rel=2.0e-3)


def test_sliding_curve_runs_from_static_to_coulomb() -> None:
    assert sliding_curve(0.0, 5.0, 4.0, 1.0e-3) == pytest.approx(5.0)
    assert sliding_curve(1.0, 5.0, 4.0, 1.0e-3) == pytest.approx(4.0)
    assert sliding_curve(1.0e-3, 5.0, 4.0, 1.0e-3) == pytest.approx(4.0 + np.exp(-1.0))


@needs_numba
def test_held_force_does_not_make_it_drift() -> None:
    stage = draw_stage(chance(3, 1))
    count = 4000
    flat, zero = np.ones(count), np.zeros(count)
    push = -0.5 * stage.static_force * np.ones(count) - 0.2 * stage.static_force * np.sin(0.05 * np.arange(count))
    out = kernel.run(
        zero, zero, zero, PERIOD, stage.mass, stage.springs, np.array(stage.shares), stage.curve,
        np.array([0.0, 0.0, 0.0, 1.0e-3, 1.0]), slots.nothing_hidden(), push, flat, flat, 100,
    )  # fmt: skip
    place = out[:, kernel.TRUE_X]
    cycle = round(2.0 * np.pi / 0.05)
    assert abs(place[-1 - cycle] - place[-1 - 10 * cycle]) < 0.02 * max(stage.slip_deflections)


@needs_numba
def test_steps_have_converged() -> None:
    stage = draw_stage(chance(4, 1))
    motion = rich_motion(stage, chance(4, 4), 8.0)
    noise = recording_noise(4, 0, motion.position.size)
    coarse = record(Hidden(stage, stage), motion, noise, chance(4, 12), steps=100)
    fine = record(Hidden(stage, stage), motion, noise, chance(4, 12), steps=400)
    assert np.sqrt(np.mean((coarse.effort - fine.effort) ** 2)) < 2.0e-3 * stage.coulomb_force


@needs_numba
@pytest.mark.parametrize("name", ["nothing", "cogging", "flexible_mode", "actuator_dead_zone", "random_walk_force"])
def test_forces_balance(name: str) -> None:
    stage = draw_stage(chance(5, 1))
    motion = rich_motion(stage, chance(5, 4), 6.0)
    hidden = Hidden(stage, stage)
    if name != "nothing":
        hidden = menu.KINDS[name].draw(stage, motion, chance(5, 20))(0.2)
    zero, flat = np.zeros(motion.position.size), np.ones(motion.position.size)
    force = hidden.force(Around(motion.time, chance(5, 6))) if hidden.force else zero
    out = kernel.run(
        motion.position, motion.velocity, motion.acceleration, PERIOD, stage.mass, stage.springs,
        np.array(stage.shares), stage.curve, stage.gains, hidden.vector(), force, flat, flat, 100,
    )  # fmt: skip
    middle_speed = np.diff(out[:, kernel.TRUE_X]) / PERIOD
    needed = stage.mass * out[:, kernel.TRUE_A] + out[:, kernel.FRICTION] + out[:, kernel.HIDDEN]
    needed[:-1] += 0.5 * (force[:-1] + force[1:]) + stage.viscous * middle_speed
    rest = (out[:, kernel.EFFORT] - needed)[:-1]
    assert np.max(np.abs(rest)) < 2.0e-3 * stage.coulomb_force
    if name == "nothing":
        assert np.max(np.abs(out[:, kernel.HIDDEN])) < 1.0e-9


@needs_numba
def test_resting_contact_does_not_climb_to_the_level_of_the_other_direction() -> None:
    """Jitter at rest must leave the force where it is, also when the directions slip at different forces."""
    stage = draw_stage(chance(3, 1))
    count = 3000
    flat, zero = np.ones(count), np.zeros(count)
    hold = -0.8 * stage.coulomb_force * np.minimum(np.arange(count) / 300.0, 1.0)
    jitter = 0.01 * stage.coulomb_force * chance(3, 2).standard_normal(count)
    places = []
    for share in (0.0, 0.15):
        vector = slots.nothing_hidden()
        vector[slots.SIDED_COULOMB_A] = share
        out = kernel.run(
            zero, zero, zero, PERIOD, stage.mass, stage.springs, np.array(stage.shares), stage.curve,
            np.array([0.0, 0.0, 0.0, 1.0e-3, 1.0]), vector, hold + jitter, flat, flat, 100,
        )  # fmt: skip
        places.append(out[:, kernel.TRUE_X])
    for place in places:
        assert abs(place[-1] - place[1000]) < 0.1 * abs(place[1000])


@needs_numba
def test_chatter_at_rest_is_small() -> None:
    for seed in (0, 2):
        track = make_scene(seed, "nothing", 0.0, 12.0).tracks[0]["x"]
        stage = draw_stage(chance(seed, 1))
        fast = filtfilt(*butter(2, 2.0 * PERIOD * 100.0, "high"), track.effort)
        still = np.abs(np.gradient(track.reference, PERIOD)) < 1.0e-9
        assert np.sqrt(np.mean(fast[still] ** 2)) < NOISE_SHARE * stage.coulomb_force


@needs_numba
def test_measured_size_is_the_wanted_one() -> None:
    for name in ("quadratic_drag", "actuator_saturation", "frictional_lag"):
        scene = make_scene(6, name, 0.15)
        size = measured_size(scene.tracks[0]["x"], scene.hidden.known.coulomb_force)
        assert size == pytest.approx(0.15, rel=0.1), name


def test_references_stay_within_the_stage() -> None:
    for seed in range(5):
        stage = draw_stage(chance(seed, 1))
        motions = [rich_motion(stage, chance(seed, 4))]
        motions += [held_out_motion(kind, stage, chance(seed, 5)) for kind in HELD_OUT]
        assert motions[0].position.size == 30000
        for motion in motions:
            assert np.max(np.abs(motion.position)) < 1.05 * stage.half_stroke, motion.kind
            assert np.max(np.abs(motion.velocity)) < 1.7 * stage.top_speed, motion.kind
            assert motion.position[:-1] + PERIOD * motion.velocity[:-1] == pytest.approx(motion.position[1:], abs=1e-12)
    with pytest.raises(ValueError, match="staircase"):
        held_out_motion("spiral", stage, chance(0))


def test_owner_is_off_by_at_most_five_percent() -> None:
    stage = draw_stage(chance(7, 1))
    shares, slip_deflections = reduce_contact(np.array(stage.shares), np.array(stage.slip_deflections))
    grid = np.geomspace(1.0e-7, 2.0e-5, 100)
    goal = virgin_curve(grid, np.array(stage.shares), np.array(stage.slip_deflections))
    alike = virgin_curve(
        grid, np.full(4, 0.25), np.quantile(np.array(stage.slip_deflections), [0.125, 0.375, 0.625, 0.875])
    )
    misfit = np.linalg.norm(virgin_curve(grid, shares, slip_deflections) - goal)
    assert misfit < np.linalg.norm(alike - goal)
    assert misfit < 0.05 * np.linalg.norm(goal)
    for seed in range(20):
        nominal = nominal_model(stage, chance(seed, 13))
        assert abs(nominal.mass / stage.mass - 1.0) <= 0.05
        assert abs(nominal.viscous / stage.viscous - 1.0) <= 0.05
        assert abs(nominal.coulomb_force / stage.coulomb_force - 1.0) <= 0.05
        assert sum(nominal.fraction) == pytest.approx(1.0, abs=1.0e-12)
        assert nominal.static_force > nominal.coulomb_force


def test_noise_has_unit_rms_and_the_colour_asked_for() -> None:
    noise = coloured_noise(200_000, 30.0, 0.2, chance(8))
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(1.0, rel=0.03)
    lag_one = float(np.mean(noise[1:] * noise[:-1]))
    assert lag_one == pytest.approx(0.8 * np.exp(-2.0 * np.pi * 30.0 * PERIOD), abs=0.03)


def test_menu_names() -> None:
    assert menu.names("nothing") == ()
    assert menu.names("cogging+offset") == ("cogging", "offset")
    assert len(menu.INSIDE) == 28
    assert all(set(pair) <= set(menu.INSIDE) for pair in menu.PAIRS)
    with pytest.raises(ValueError, match="not on the menu"):
        menu.names("gremlins")
