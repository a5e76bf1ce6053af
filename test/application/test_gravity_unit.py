"""A joint that carries a load shows its type and the unit of its angle."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.bag_info import inspect_bag
from sgms_observer.arrays import Floats
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.cli.main import main

PERIOD = 5.0e-3
TIME = PERIOD * np.arange(6000)
TURNS, DEGREES = "set joint_type: revolute", "multiply position_scale by 0.01745329252"


def _joint(load: float, spring: float = 0.0) -> tuple[Floats, Floats]:
    """Return angle [rad] and torque [N m] of a joint that carries a load [N m] or turns a spring [N m/rad]."""
    angle = -0.3 + 0.9 * np.sin(0.9 * TIME) + 0.25 * np.sin(2.3 * TIME) + 0.1 * np.sin(5.1 * TIME)
    velocity = np.gradient(angle, PERIOD)
    torque = 14.0 * np.gradient(velocity, PERIOD) + 20.0 * velocity + 13.0 * np.tanh(velocity / 1e-3)
    torque += load * np.sin(angle + 0.4) + spring * angle
    return angle, torque + np.random.default_rng(1).normal(0.0, 1.0, len(TIME))


def _warnings(folder: Path, position: Floats, effort: Floats, joint_type: str | None) -> list[str]:
    """Return what ``sgms info`` warns of."""
    stamps = np.rint((1.0 + TIME) * 1e9).astype(np.int64)
    write_table(Table(stamps, position, effort, None, None, ()), folder / "bag", "x")
    (axis,) = inspect_bag(folder / "bag", {}, None, joint_type).axes
    return list(axis.warnings)


@pytest.mark.parametrize(
    ("scale", "joint_type", "expected"),
    [
        (1.0, "revolute", ""),
        (1.0, "prismatic", TURNS),
        (1.0, None, TURNS),
        (180.0 / math.pi, "revolute", DEGREES),
        (180.0 / math.pi, None, DEGREES),
    ],
)
def test_gravity_shows_type_and_unit(tmp_path: Path, scale: float, joint_type: str | None, expected: str) -> None:
    angle, torque = _joint(110.0)
    warnings = _warnings(tmp_path, scale * angle, torque, joint_type)
    remedies = [text for text in (TURNS, DEGREES) if any(text in warning for warning in warnings)]
    assert remedies == ([expected] if expected else [])


@pytest.mark.parametrize("amplitude", [0.6, 1.2, 3.0])
def test_a_cogging_is_no_gravity_over_revolutions(tmp_path: Path, amplitude: float) -> None:
    """Six pole pairs make six cycles a turn, about as gravity over an angle in revolutions would."""
    time = PERIOD * np.arange(6_000)
    angle = amplitude * np.sin(2.0 * time) + 0.2 * np.sin(7.0 * time)
    rate = np.gradient(angle, PERIOD)
    torque = 0.05 * np.gradient(rate, PERIOD) + 0.3 * np.tanh(rate / 0.01) + np.sin(6.0 * angle)
    assert not any("gravity" in warning for warning in _warnings(tmp_path, angle, torque, "revolute"))


@pytest.mark.parametrize("force", ["parabola", "cable"])
def test_an_even_force_along_a_stroke_is_no_gravity_of_a_joint(tmp_path: Path, force: str) -> None:
    time = PERIOD * np.arange(6_000)
    place = 0.8 * np.sin(2.0 * time) + 0.2 * np.sin(7.0 * time)
    rate = np.gradient(place, PERIOD)
    even = 80.0 * place**2 if force == "parabola" else 60.0 * np.maximum(place, 0.0)
    effort = 12.0 * np.gradient(rate, PERIOD) + 4.0 * np.tanh(rate / 0.01) + even
    assert not any(TURNS in warning for warning in _warnings(tmp_path, place, effort, "prismatic"))


@pytest.mark.parametrize(("load", "spring"), [(0.0, 0.0), (0.0, 80.0)])
@pytest.mark.parametrize("scale", [1.0, 180.0 / math.pi])
@pytest.mark.parametrize("joint_type", ["prismatic", "revolute"])
def test_no_load_and_a_spring_show_neither(
    tmp_path: Path, load: float, spring: float, scale: float, joint_type: str
) -> None:
    angle, torque = _joint(load, spring)
    warnings = _warnings(tmp_path, scale * angle, torque, joint_type)
    assert not any(text in warning for warning in warnings for text in (TURNS, DEGREES))


def test_init_check_and_identify_warn_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    angle, torque = _joint(110.0)
    _warnings(tmp_path, np.rad2deg(angle), torque, "revolute")
    bag, config = str(tmp_path / "bag"), str(tmp_path / "start.yaml")
    assert main(["init", bag, "--out", config, "--joint-type", "revolute"]) == 0
    assert DEGREES in capsys.readouterr().err
    assert main(["check", config, bag]) == 1
    assert DEGREES in capsys.readouterr().err
    main(["identify", bag, "--config", config, "--out", str(tmp_path / "out.yaml"), "--elements", "1"])
    assert DEGREES in capsys.readouterr().err


def test_info_says_that_its_balance_holds_gravity(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _warnings(tmp_path, *_joint(110.0), "revolute")
    for joint_type, is_there in (("revolute", True), ("prismatic", False)):
        assert main(["info", str(tmp_path / "bag"), "--joint-type", joint_type]) == 0
        assert ("with gravity A sin q + B cos q: mass" in capsys.readouterr().out) == is_there


def test_a_mass_below_zero_is_a_doubt_where_a_spring_could_be_the_cause(tmp_path: Path) -> None:
    phase = 2.0 * np.pi * 2.0 * TIME
    position = 5e-3 * np.sin(phase)
    velocity, acceleration = np.gradient(position, PERIOD), -((4.0 * np.pi) ** 2) * position
    effort = 3.0 * acceleration + 4.0 * np.tanh(velocity / 1e-4) + 4000.0 * position
    warnings = _warnings(tmp_path, position, effort, "prismatic")
    assert any("the mass comes out below zero, -2" in warning for warning in warnings)
