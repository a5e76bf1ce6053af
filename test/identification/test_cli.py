"""``sgms identify`` and ``sgms excite`` as a user runs them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.identification.answer import bag_hash
from sgms_observer.settings.load import load_settings

PERIOD = 1.0e-3
START = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 5.0
      friction: {static_force: 2.5, coulomb_force: 2.0}
"""


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    """Return a bag of an axis with 12 kg, 30 N s/m, 4 N and -0.7 N."""
    time = PERIOD * np.arange(20_000)
    position = 0.05 * np.sin(np.pi * time) + 0.01 * np.sin(2.0 * np.pi * 1.7 * time)
    velocity = np.gradient(position, PERIOD)
    effort = 12.0 * np.gradient(velocity, PERIOD) + 30.0 * velocity + 4.0 * np.tanh(velocity / 1e-5) - 0.7
    effort += np.random.default_rng(11).normal(0.0, 0.05, len(time))
    stamp = 1_000_000_000 + np.rint(time * 1e9).astype(np.int64)
    with BagWriter(tmp_path / "bag") as writer:
        writer.write_joint_states("position", stamp, ("x",), position=position)
        writer.write_joint_states("control_effort", stamp, ("x",), effort=effort)
    return tmp_path / "bag"


@pytest.fixture
def start(tmp_path: Path) -> Path:
    """Return a parameter file to start from."""
    (tmp_path / "start.yaml").write_text(START)
    return tmp_path / "start.yaml"


@pytest.mark.parametrize("model", ["least_squares", "sgms"])
def test_identify_writes_a_file_with_provenance(
    tmp_path: Path, bag: Path, start: Path, model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.yaml"
    options = [] if model == "least_squares" else ["--elements", "1"]
    assert main(["identify", str(bag), "--config", str(start), "--out", str(out), "--model", model, *options]) == 0
    axis = load_settings(out).axes[0]
    assert axis.mass == pytest.approx(12.0, rel=0.01)
    assert axis.friction.viscous_coefficient == pytest.approx(30.0, rel=0.05)
    assert axis.friction.coulomb_force == pytest.approx(4.0, rel=0.03)
    assert axis.effects[0].name == "offset"
    assert axis.effects[0].values[0] == pytest.approx(-0.7, abs=0.05)
    text = out.read_text()
    assert bag_hash(bag) in text
    assert "95 %" in text
    assert "mass" in capsys.readouterr().out


def test_a_sliding_record_does_not_claim_a_stribeck_velocity(tmp_path: Path, bag: Path, start: Path) -> None:
    out = tmp_path / "out.yaml"
    assert main(["identify", str(bag), "--config", str(start), "--out", str(out), "--elements", "1"]) == 0
    line = next(line for line in out.read_text().splitlines() if "stribeck_velocity:" in line)
    assert "not shown" in line


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--axis", "z"], "--axis z is not in"),
        (["--cutoff", "-3"], "must be positive"),
        (["--cutoff", "400"], "choose a cutoff below"),
    ],
)
def test_errors_are_one_sentence(
    tmp_path: Path, bag: Path, start: Path, arguments: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.yaml"
    assert main(["identify", str(bag), "--config", str(start), "--out", str(out), *arguments]) != 0
    error = capsys.readouterr().err
    assert says in error
    assert "Traceback" not in error
    assert not out.exists()


def test_excite_writes_what_the_stage_reads(tmp_path: Path, start: Path) -> None:
    csv = tmp_path / "reference.csv"
    assert main(["excite", "--config", str(start), "--out", str(csv), "--stroke", "0.01", "--centre", "0.1"]) == 0
    table = np.loadtxt(csv, delimiter=",", skiprows=1)
    assert np.allclose(np.diff(table[:, 0]), PERIOD)
    assert table[0, 1] == table[-1, 1] == 0.1
    assert np.ptp(table[:, 1]) <= 0.01


@pytest.mark.parametrize("option", [["--stroke", "-1"], ["--speed", "0"], ["--acceleration", "nan"]])
def test_impossible_limits_are_refused(
    tmp_path: Path, start: Path, option: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["excite", "--config", str(start), "--out", str(tmp_path / "a.csv"), *option]) != 0
    assert option[0][2:] in capsys.readouterr().err
    assert not (tmp_path / "a.csv").exists()
