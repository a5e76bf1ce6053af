"""The plants as a whole: independence, repeatability, sizes of what is hidden, and what the owner knows."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import fields, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from sgms_observer.bags.reader import read_joint_states
from sgms_observer.jit import HAS_NUMBA
from sgms_observer.settings.load import load_settings
from sim_plant.plants.effects import KINDS, MAP_POINTS, menu, random_shape
from sim_plant.plants.machine import PLANTS, Machine, draw, draw_plant
from sim_plant.plants.motion import KINDS as MOTIONS
from sim_plant.plants.motion import make_motion
from sim_plant.plants.owner import OFF, nominal_model, write_yaml
from sim_plant.plants.recording import Recording, force_size, hidden_in, record, write_bag

pytestmark = pytest.mark.skipif(not HAS_NUMBA, reason="hundreds of thousands of steps in plain Python")
FORBIDDEN = ("formulas", "effects", "friction", "discrepancy", "diagnosis", "observer", "estimators", "offline")
SHARE = 0.2
DURATION = 8.0  # s
RELATIVE_TO_LEVEL = ("asymmetry", "tight_spot", "thermal", "dwell", "direction_and_place")
"""Shares of the sliding force itself, which lies between Coulomb and static force."""


@cache
def machine_of(name: str, seed: int = 1) -> Machine:
    return draw_plant(name, seed)


@cache
def recording_of(name: str, effect: str, kind: str = "rich", seed: int = 1) -> Recording:
    return record(machine_of(name), (effect,) if effect else (), SHARE, seed, kind, DURATION)


def test_imports_nothing_of_the_catalogue() -> None:
    code = (
        "import sys, pkgutil, importlib, sim_plant.plants as b\n"
        "[importlib.import_module(f'sim_plant.plants.{m.name}') for m in pkgutil.iter_modules(b.__path__)]\n"
        "used = [m.split('.')[:2] for m in sys.modules]\n"
        f"bad = [m for m in used for f in {FORBIDDEN!r} if m == ['sgms_observer', f] and f != 'observer']\n"
        "bad += [m for m in sys.modules if m.startswith('sim_plant.') and not m.startswith('sim_plant.plants')]\n"
        "sys.exit(str(bad) if bad else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", PLANTS)
def test_every_plant_follows_its_reference(name: str) -> None:
    machine = machine_of(name)
    for kind in MOTIONS:
        one = recording_of(name, "", kind)
        assert one.time.size == round(DURATION * machine.log_rate)
        assert np.max(np.abs(one.reference - one.position)) < 0.03 * machine.half_stroke
        assert np.max(np.abs(one.position)) < 1.05 * machine.half_stroke
        steps = one.position / machine.resolution
        assert steps == pytest.approx(np.rint(steps), abs=1.0e-3)
        assert np.max(np.abs(one.hidden_force)) == 0.0
    assert 2.0 * np.std(one.effort) > machine.coulomb_force


def test_the_plants_span_what_they_have_to() -> None:
    machines = [draw_plant(name, seed) for name in PLANTS for seed in range(20)]
    forces, encoders = [m.coulomb_force for m in machines], [m.resolution for m in machines]
    assert min(forces) <= 0.2 and max(forces) >= 800.0
    assert min(encoders) <= 1.0e-9 and max(encoders) >= 1.0e-4
    assert {m.log_rate for m in machines} >= {100.0, 1000.0, 10_000.0}
    assert min(m.loop_rate for m in machines) == 1000.0 and max(m.loop_rate for m in machines) == 20_000.0
    assert {m.is_held for m in machines} == {m.is_rotary for m in machines} == {True, False}
    assert {m.controller[2] > 0.0 for m in machines} == {True, False}
    assert {m.noise_corner > 0.0 for m in machines} == {True, False}
    assert len({m.law for m in machines}) >= 4
    for m in machines:
        assert m.every * m.log_rate == pytest.approx(m.loop_rate)
        assert m.resolution < 1.0e-3 * m.half_stroke


def test_the_same_seed_gives_the_same_recording() -> None:
    machine = machine_of("lugre")
    first = recording_of("lugre", "pulses")
    again = record(draw_plant("lugre", 1), ("pulses",), SHARE, 1, "rich", DURATION)
    other = record(machine, ("pulses",), SHARE, 2, "rich", DURATION)
    assert np.array_equal(first.position, again.position) and np.array_equal(first.effort, again.effort)
    assert not np.array_equal(first.position, other.position)
    assert not np.array_equal(draw(1, "lugre").curve, draw(2, "lugre").curve)


def test_what_is_hidden_hangs_on_neither_motion_nor_noise() -> None:
    learning = recording_of("robot_joint", "gravity")
    judging = recording_of("robot_joint", "gravity", "steps", 9)
    assert np.array_equal(learning.hidden.p, judging.hidden.p)
    maps = [recording_of("lugre", "force_map", kind).hidden.force_map for kind in MOTIONS]
    assert np.array_equal(*maps)
    both = hidden_in(machine_of("lugre"), ("cogging", "offset"), SHARE)
    alone = hidden_in(machine_of("lugre"), ("cogging",), SHARE)
    assert both.figures["cogging"] == alone.figures["cogging"]


def test_motions_are_smooth_and_start_anywhere() -> None:
    machine = machine_of("lugre")
    starts = []
    for seed in range(6):
        for kind in MOTIONS:
            motion = make_motion(machine, kind, DURATION, np.random.default_rng(seed))
            starts.append(motion.position[0] / machine.half_stroke)
            assert abs(motion.velocity[0]) < 1.0e-3 * machine.speed
            assert np.max(np.abs(motion.position)) <= machine.half_stroke * 1.001
            assert np.max(np.abs(motion.velocity)) <= machine.speed * 1.01
            assert np.max(np.abs(motion.acceleration)) <= machine.acceleration * 1.05
            jerk = np.max(np.abs(np.diff(motion.acceleration))) * machine.loop_rate
            assert jerk < 200.0 * machine.acceleration  # no jump of the acceleration
    assert np.ptp(starts) > 0.5
    with pytest.raises(ValueError, match="'sine' is unknown; use one of rich, steps"):
        make_motion(machine, "sine", 1.0, np.random.default_rng(0))


@pytest.mark.parametrize("effect", [name for name in KINDS if name not in ("gravity", "gain")])
def test_effects_have_their_size(effect: str) -> None:
    machine = machine_of("lugre")
    level = machine.curve[1] / machine.coulomb_force if effect in RELATIVE_TO_LEVEL else 1.0
    if effect == "asymmetry":  # just after a reversal the larger side's force is counted by the smaller side's factor
        level *= (1.0 + SHARE) / (1.0 - SHARE)
    share = force_size(recording_of("lugre", effect), machine) / machine.coulomb_force
    assert 0.55 * SHARE < share < 1.3 * SHARE * level


def test_gravity_and_gain_have_their_size() -> None:
    machine = machine_of("robot_joint")
    one = recording_of("robot_joint", "gravity")
    assert force_size(one, machine) == pytest.approx(SHARE * machine.coulomb_force, rel=0.15)
    weight, angle = one.hidden.p[28], one.hidden.p[29]
    torque = weight * np.sin(one.position + angle)
    assert one.hidden_force == pytest.approx(torque, abs=0.02 * weight)
    gain = recording_of("lugre", "gain")
    assert gain.hidden.figures == {"gain": {"gain": 1.0 - SHARE}}
    assert np.std(gain.hidden_force) / np.std(gain.effort) == pytest.approx(SHARE, rel=0.05)


def test_the_balance_of_forces_closes() -> None:
    """Effort = mass times acceleration + friction, with what is hidden in both."""
    machine = replace(machine_of("bouc_wen"), effort_noise=0.0, force_noise=0.0)
    for effect in ("", "cogging", "force_map", "hysteretic_spring", "quadratic"):
        one = record(machine, (effect,) if effect else (), SHARE, 1, "rich", 6.0)
        mean_effort = one.effort if machine.is_held else 0.5 * (one.effort + np.roll(one.effort, -1))
        inertia = machine.mass * np.diff(one.true_velocity) * machine.log_rate
        rest = (mean_effort[:-1] - inertia - one.friction[:-1])[5:-5]
        assert np.sqrt(np.mean(rest**2)) < 0.02 * machine.coulomb_force


def test_maps_have_neither_mean_nor_slope() -> None:
    for seed in range(5):
        shape = random_shape(np.random.default_rng(seed))
        x = np.linspace(-1.2, 1.2, MAP_POINTS)
        inside = np.abs(x) <= 1.0
        assert np.max(np.abs(shape)) == pytest.approx(1.0)
        assert np.polyfit(x[inside], shape[inside], 1) == pytest.approx([0.0, 0.0], abs=1.0e-9)


def test_rotary_effects_need_a_rotary_machine() -> None:
    assert "gravity" in menu(machine_of("robot_joint")) and "gravity" not in menu(machine_of("lugre"))
    with pytest.raises(ValueError, match="'gravity' is unknown on this machine"):
        record(machine_of("lugre"), ("gravity",), duration=1.0)


@pytest.mark.parametrize("name", PLANTS)
def test_the_owner_is_off_by_five_percent_at_most(name: str, tmp_path: Path) -> None:
    machine = machine_of(name)
    fit, file = nominal_model(machine, 0.0), nominal_model(machine)
    for one in fields(fit):
        right, wrong = getattr(fit, one.name), getattr(file, one.name)
        if one.name == "fraction":  # normalised again
            assert wrong == pytest.approx(right, rel=2.2 * OFF, abs=1.0e-9)
        elif one.name != "model":
            assert wrong == pytest.approx(right, rel=OFF * 1.0001)
    assert fit.mass == machine.mass and fit.viscous == machine.viscous
    assert fit.coulomb_force == pytest.approx(machine.coulomb_force, rel=0.1)
    assert fit.static_force == pytest.approx(machine.curve[1], rel=0.1)
    write_yaml(tmp_path / "axis.yaml", machine, with_joint_type=False)
    axis = load_settings(tmp_path / "axis.yaml").axes[0]
    assert axis.mass == file.mass
    write_yaml(tmp_path / "turns.yaml", machine)
    tree = yaml.safe_load((tmp_path / "turns.yaml").read_text(encoding="utf-8"))["/**"]["ros__parameters"]["x"]
    assert tree.get("joint_type") == ("revolute" if machine.is_rotary else None)


def test_a_bag_holds_what_was_logged_and_nothing_else(tmp_path: Path) -> None:
    one = recording_of("slow_log", "cogging")
    write_bag(tmp_path / "rich", one)
    position, effort = (read_joint_states(tmp_path / "rich", topic) for topic in ("/position", "/control_effort"))
    assert np.array_equal(np.asarray(position.position)[:, 0], one.position)
    assert np.array_equal(np.asarray(effort.effort)[:, 0], one.effort)
    assert np.diff(position.stamp_ns) == pytest.approx(1.0e7, abs=1.0)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rich"]
    assert sorted(path.name for path in (tmp_path / "rich").iterdir()) == ["metadata.yaml", "rich_0.mcap"]
