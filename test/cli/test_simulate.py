"""``sgms simulate``: what it writes, prints and refuses."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from sgms_observer.bags.reader import read_joint_states, read_samples
from sgms_observer.cli.main import main
from sgms_observer.settings.load import load_settings
from sim_plant.table import SimulatedTable

REPOSITORY = Path(__file__).resolve().parents[2]

TWO_AXES = """
/**:
  ros__parameters:
    axes: [x, y]
    sample_period: 1.0e-3
    publish_every: 3
    x:
      mass: 3.0
      stage:
        seed: 7
        force_noise: 0.05
        encoder: {resolution: 1.0e-8, noise: 5.0e-9}
    y:
      mass: 5.0
      stage:
        reference: {kind: point_to_point, amplitude: 0.002, dwell: 0.05}
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "two.yaml"
    path.write_text(TWO_AXES, encoding="utf-8")
    return path


def simulate(config: Path, bag: Path, *more: str) -> int:
    return main(["simulate", "--config", str(config), "--out", str(bag), "--duration", "1.5", *more])


def test_bag_holds_what_the_stage_does(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert simulate(config, tmp_path / "bag") == 0
    said = capsys.readouterr()
    assert "1500 samples of x, y, 1.5 s; seeds x: 7, y: 1" in said.out
    assert "6000 messages" in said.out and "times real time" in said.out
    x, y = SimulatedTable(load_settings(config), 1_000_000_000).step(1500)
    for number, record in enumerate((x, y)):
        blocks = list(read_samples(tmp_path / "bag", "xy"[number], 1e-3))
        for field in ("stamp_ns", "position", "effort", "reference_position", "reference_velocity"):
            read = np.concatenate([getattr(block, field) for block in blocks])
            assert_array_equal(read, getattr(record.samples, field), err_msg=field)
        truth = read_joint_states(tmp_path / "bag", "friction_true")
        assert_array_equal(truth.effort[:, number], record.friction)
        assert_array_equal(truth.position[:, number], record.position)
        assert_array_equal(truth.velocity[:, number], record.velocity)


def test_seed_of_the_command_line_wins_and_repeats(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, seed in (("a", "5"), ("b", "5"), ("c", "6")):
        assert simulate(config, tmp_path / name, "--seed", seed, "--storage", "sqlite3") == 0
    assert "seeds x: 5, y: 5" in capsys.readouterr().out
    a, b, c = (read_joint_states(tmp_path / name, "position").position for name in "abc")
    assert_array_equal(a, b)
    assert not np.array_equal(a, c)


def test_observer_in_the_loop_writes_its_topics(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert simulate(config, tmp_path / "bag", "--observe") == 0
    assert "N rms off the truth" in capsys.readouterr().out
    estimate = read_joint_states(tmp_path / "bag", "friction_estimate")
    truth = read_joint_states(tmp_path / "bag", "friction_true")
    assert_array_equal(estimate.stamp_ns, truth.stamp_ns[::3])
    error = (estimate.effort - truth.effort[::3])[100:, 0]
    assert error.std() < 0.5 * truth.effort[:, 0].std()
    elements = read_joint_states(tmp_path / "bag", "friction_elements")
    assert elements.names == ("x/1", "x/2", "x/3", "x/4", "y/1", "y/2", "y/3", "y/4")
    total = elements.effort[:, :4].sum(axis=1)
    assert np.abs(total).max() > 2.0
    assert not read_joint_states(tmp_path / "bag", "friction_compensation").effort.any()
    assert (read_joint_states(tmp_path / "bag", "friction_std").effort[100:] > 0.0).all()


def test_compensation_is_compared_with_the_same_stage_without_it(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    switched_on = "      mass: 3.0\n      compensation: {enabled: true, look_ahead: 1.5e-3}\n"
    config.write_text(TWO_AXES.replace("      mass: 3.0\n", switched_on), encoding="utf-8")
    assert simulate(config, tmp_path / "off") == 0
    without = re.findall(r"([\d.]+ um rms, [\d.]+ um peak)", capsys.readouterr().out)
    assert simulate(config, tmp_path / "on", "--observe") == 0
    x, y = [line for line in capsys.readouterr().out.splitlines() if "tracking error" in line]
    assert f"without compensation {without[0]}" in x
    assert f"tracking error {without[1]}; without compensation {without[1]}: 1.0 and 1.0 times as large" in y
    table = SimulatedTable(load_settings(config), 1_000_000_000)
    record = table.step(1500)[0]
    error = (record.position - record.reference_position)[500:]  # the first half second does not count
    assert without[0].startswith(f"{1e6 * np.sqrt(np.mean(error**2)):.3g} um rms")


@pytest.mark.parametrize(
    "arguments", [("--duration", "0"), ("--duration", "soon"), ("--seed", "-1"), ("--seed", "1.5")]
)
def test_senseless_numbers_are_refused(config: Path, tmp_path: Path, arguments: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit) as stop:
        simulate(config, tmp_path / "bag", *arguments)
    assert stop.value.code == 2
    assert not (tmp_path / "bag").exists()


def test_failure_leaves_one_sentence_and_no_bag(config: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_text(TWO_AXES.replace("amplitude: 0.002", "amplitude: 0.0"), encoding="utf-8")
    answer = subprocess.run(
        [sys.executable, "-m", "sgms_observer", "simulate", "--config", str(tmp_path / "bad.yaml"),
         "--out", str(tmp_path / "bag")],
        cwd=REPOSITORY, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert answer.returncode == 1
    assert "y.stage.reference.amplitude" in answer.stderr and "Traceback" not in answer.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.yaml", "two.yaml"]


def test_existing_bag_is_not_overwritten(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "bag").mkdir()
    assert simulate(config, tmp_path / "bag") == 1
    assert "exists already" in capsys.readouterr().err
