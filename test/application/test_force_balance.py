"""The rough force balance of ``info``, ``check`` and ``init``: presliding and springs are no negative mass."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.bag_info import inspect_bag
from sgms_observer.arrays import Floats
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.cli.main import main
from sgms_observer.diagnosis.motion import play_operator
from sgms_observer.shipped import shipped_file

RATE = 1000.0
MASS, VISCOUS, COULOMB, DEFLECTION = 3.0, 20.0, 4.0, 5.0e-6


def _doubts(folder: Path, position: Floats, effort: Floats) -> tuple[dict[str, float], list[str]]:
    """Return the values of the force balance that ``sgms info`` finds in a recording, and its doubts."""
    stamps = 10**9 + (1e9 / RATE * np.arange(len(position))).astype(np.int64)
    write_table(Table(stamps, position, effort, None, None, ()), folder / "bag", "x")
    (axis,) = inspect_bag(folder / "bag", {}, None, "prismatic").axes
    balance = axis.facts.balance
    assert balance is not None
    return {name: balance.value(name) for name in balance.names}, list(axis.warnings)


def _motion(amplitude: float, hertz: float, seconds: float = 8.0) -> tuple[Floats, Floats, Floats]:
    """Return position, velocity and acceleration of a sine."""
    phase, rate = 2.0 * np.pi * hertz * np.arange(int(RATE * seconds)) / RATE, 2.0 * np.pi * hertz
    position = amplitude * np.sin(phase)
    return position, amplitude * rate * np.cos(phase), -(rate**2) * position


def _friction(position: Floats) -> Floats:
    """Return Coulomb friction with presliding: it turns over twice the slip deflection."""
    return COULOMB * (position - play_operator(position, DEFLECTION)) / DEFLECTION


def test_the_demonstrations_bag_raises_no_doubt(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config, bag = str(shipped_file("config", "demo.yaml")), str(tmp_path / "bag")
    assert main(["simulate", "--config", config, "--out", bag, "--duration", "4", "--quiet"]) == 0
    capsys.readouterr()
    assert main(["info", bag, "--joint-type", "prismatic", "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    balance = json.loads(printed.out)["axes"][0]["force_balance"]
    assert balance["mass"]["value"] == pytest.approx(3.0, rel=0.1)
    assert balance["coulomb_force"]["value"] == pytest.approx(4.0, rel=0.05)
    assert balance["unexplained"] < 0.03


@pytest.mark.parametrize("amplitude", [100e-6, 200e-6, 1e-3, 20e-3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_mass_and_friction_are_right_however_short_the_motion(tmp_path: Path, amplitude: float, sign: float) -> None:
    position, velocity, acceleration = _motion(amplitude, 3.0)
    effort = MASS * acceleration + VISCOUS * velocity + _friction(position)
    noise = np.random.default_rng(1).normal(size=effort.size)
    values, doubts = _doubts(tmp_path, position, sign * effort + 0.05 * noise)
    assert sign * values["coulomb_force"] == pytest.approx(COULOMB, rel=0.05)
    inertia = MASS * float(np.max(np.abs(acceleration)))
    assert inertia < 0.1 * COULOMB or sign * values["mass"] == pytest.approx(MASS, rel=0.2)
    assert [doubt for doubt in doubts if "negative mass" in doubt] == []
    assert any("effort_scale: -1" in doubt for doubt in doubts) == (sign < 0.0)


def test_a_spring_on_a_single_sine_is_no_negative_mass(tmp_path: Path) -> None:
    position, velocity, acceleration = _motion(5e-3, 2.0)
    effort = MASS * acceleration + VISCOUS * velocity + _friction(position) + 4000.0 * position
    values, doubts = _doubts(tmp_path, position, effort)
    assert values["mass"] < 0.0
    assert [doubt for doubt in doubts if "negative mass" in doubt] == []


def test_an_effort_of_another_axis_raises_the_doubt(tmp_path: Path) -> None:
    """Two frequencies: no spring imitates a negative mass."""
    parts = [_motion(5e-3, 1.0), _motion(2e-3, 4.0)]
    position, velocity, acceleration = (sum(signals) for signals in zip(*parts, strict=True))
    effort = -MASS * acceleration + VISCOUS * velocity + _friction(np.asarray(position))
    _, doubts = _doubts(tmp_path, np.asarray(position), effort)
    assert any("negative mass" in doubt for doubt in doubts)


def test_a_constant_load_explains_nothing(tmp_path: Path) -> None:
    """Below a hanging load of 200 N, noise of 5 N was an effort that the motion explains to 98 %."""
    position = sum(_motion(0.02 / hertz, hertz)[0] for hertz in (0.3, 1.1))
    effort = 200.0 + np.random.default_rng(2).normal(0.0, 5.0, len(position))
    stamps = 10**9 + (1e9 / RATE * np.arange(len(position))).astype(np.int64)
    write_table(Table(stamps, position, effort, None, None, ()), tmp_path / "bag", "x")
    (axis,) = inspect_bag(tmp_path / "bag", {}, None, "prismatic").axes
    assert axis.facts.balance is not None and axis.facts.balance.unexplained > 0.9
    assert axis.usable_for == ("replay",)


def test_reversals_are_those_of_the_whole_motion(tmp_path: Path) -> None:
    """A piece between two pauses in which the axis hardly moves counts no reversals of its noise."""
    position = _motion(0.1, 0.25, 12.0)[0] + 1.0e-4 * np.sin(2.0 * np.pi * 40.0 * np.arange(12_000) / RATE)
    stamps = 10**9 + (1e9 / RATE * np.arange(len(position))).astype(np.int64)
    stamps += np.arange(len(position)) // 400 * 300_000_000
    for name, effort in (("both", np.cos(position)), ("position", np.full(len(position), np.nan))):
        write_table(Table(stamps, position, effort, None, None, ()), tmp_path / name, "x")
        (axis,) = inspect_bag(tmp_path / name, {}, None, "prismatic").axes
        assert axis.facts.reversals <= 6, name
    assert axis.facts.reversals == 6
