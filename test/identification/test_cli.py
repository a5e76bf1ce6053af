"""``sgms identify`` and ``sgms excite`` as a user runs them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report

from sgms_observer.application.identify import bag_hash
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.identification.identify import IdentifyOptions, identify
from sgms_observer.identification.least_squares import fit_inverse_model
from sgms_observer.identification.report import sliding_rows
from sgms_observer.identification.trace import least_squares_traces, traces_of, unexplained_share
from sgms_observer.offline.recording import read_recordings
from sgms_observer.report.friction_pictures import stribeck_points
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


@pytest.mark.parametrize(("speed", "noise"), [(1.0, 0.05), (0.1, 5.0)])
@pytest.mark.parametrize("model", ["least_squares", "sgms"])
def test_a_start_file_without_mass_needs_recordings_that_show_it(
    tmp_path: Path, model: str, speed: float, noise: float, capsys: pytest.CaptureFixture[str]
) -> None:
    """Slow motion shows no mass: the file that was written had the 10 kg of an example."""
    time = PERIOD * np.arange(20_000)
    position = 0.05 * np.sin(np.pi * speed * time) + 0.01 * np.sin(2.0 * np.pi * 1.7 * speed * time)
    velocity = np.gradient(position, PERIOD)
    effort = 12.0 * np.gradient(velocity, PERIOD) + 30.0 * velocity + 4.0 * np.tanh(velocity / 1e-5)
    effort += np.random.default_rng(11).normal(0.0, noise, len(time))
    stamp = 1_000_000_000 + np.rint(time * 1e9).astype(np.int64)
    with BagWriter(tmp_path / "bag") as writer:
        writer.write_joint_states("position", stamp, ("x",), position=position)
        writer.write_joint_states("control_effort", stamp, ("x",), effort=effort)
    (tmp_path / "start.yaml").write_text(START.replace("      mass: 5.0\n", ""))
    out = tmp_path / "out.yaml"
    options = ["--config", str(tmp_path / "start.yaml"), "--out", str(out), "--model", model]
    code = main(["identify", str(tmp_path / "bag"), *options, *(["--elements", "1"] if model == "sgms" else [])])
    if speed == 1.0:
        assert code == 0 and load_settings(out).axes[0].mass == pytest.approx(12.0, rel=0.02)
        return
    assert code == 1 and not out.exists()
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith("x.mass must be given, as the recordings do not show it;")


def test_a_sliding_record_does_not_claim_a_stribeck_velocity(tmp_path: Path, bag: Path, start: Path) -> None:
    out = tmp_path / "out.yaml"
    assert main(["identify", str(bag), "--config", str(start), "--out", str(out), "--elements", "1"]) == 0
    line = next(line for line in out.read_text().splitlines() if "stribeck_velocity:" in line)
    assert "not identifiable" in line


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--axis", "z"], "--axis z is not in"),
        (["--cutoff", "-3"], "must be a positive number"),
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
    limits = ["--stroke", "0.01", "--centre", "0.1", "--duration", "15"]
    assert main(["excite", "--config", str(start), "--out", str(csv), *limits]) == 0
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


def test_a_report_lies_beside_the_parameter_file(
    tmp_path: Path, bag: Path, start: Path, browser: Browser, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out.yaml"
    arguments = ["identify", str(bag), "--config", str(start), "--elements", "1", "--holdout", str(bag), "--json"]
    assert main([*arguments, "--out", str(out)]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["report"] == str(tmp_path / "report.html")
    view = check_report(browser, tmp_path / "report.html", 4)
    captions = " ".join(image[2] for image in view.images)
    for word in ("modelled force", "on held-out", "over velocity", "over position"):
        assert word in captions
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    shown = ["force [N]", "residual [N]", "friction [N]", "position [mm]", "velocity [mm/s]", "rms residual [N]"]
    shown += ["Did the fit converge?", "Do the recordings show all parameters?", "May the model be used as it is?"]
    assert [text for text in shown if text not in page] == []
    assert f"{100.0 * (1.0 - result['axes']['x']['held_out']):.1f} % on held-out recordings" in page
    assert "95 % interval" in page and "Warning: x." in page
    assert list(tmp_path.glob("*.png")) == []


def test_measured_friction_of_the_report_lies_on_the_curve_of_the_axis(bag: Path, start: Path) -> None:
    axis = load_settings(start).axes[0]
    pieces = read_recordings(bag, axis)
    result = identify(pieces, axis, IdentifyOptions(count=1))
    traces = traces_of(result, axis, pieces, ())
    fit = fit_inverse_model(pieces)
    for found in (traces, least_squares_traces(fit, pieces, ())):
        velocity, friction, _spread = stribeck_points(*sliding_rows(found))
        assert len(velocity) >= 8 and velocity.min() < -0.1 and velocity.max() > 0.1
        truth = 4.0 * np.sign(velocity) + 30.0 * velocity
        fast = np.abs(velocity) > 0.02
        assert friction[fast] == pytest.approx(truth[fast], rel=0.02)
        assert found.curve(velocity[fast]) == pytest.approx(truth[fast], rel=0.03)
        assert unexplained_share(found.learnt) < 0.1
    one = traces.learnt[0]
    assert one.modelled + one.residual == pytest.approx(one.effort)
    assert unexplained_share(traces.learnt) * result.rms_effort == pytest.approx(result.rms_error, rel=0.05)


def test_nothing_is_overwritten_unless_told(
    tmp_path: Path, bag: Path, start: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["identify", str(bag), "--config", str(start), "--model", "least_squares", "--out"]
    assert main([*arguments, str(start)]) == 1
    assert f"{start} exists already and is not overwritten" in capsys.readouterr().err
    assert start.read_text() == START and not (tmp_path / "report.html").exists()
    (tmp_path / "report.html").write_text("of a diagnosis")
    assert main([*arguments, str(tmp_path / "out.yaml")]) == 0
    assert f"wrote {tmp_path / 'out.yaml'} and {tmp_path / 'out_report.html'}" in capsys.readouterr().out
    assert (tmp_path / "report.html").read_text() == "of a diagnosis"
    assert main([*arguments, str(tmp_path / "out.yaml"), "--overwrite"]) == 0
    assert (tmp_path / "report.html").read_text() == "of a diagnosis"  # the parameter file has a report of its own
    assert main([*arguments, str(start), "--overwrite"]) == 0
    assert load_settings(start).axes[0].mass == pytest.approx(12.0, rel=0.01)
    assert "Identification of axis x" in (tmp_path / "report.html").read_text(encoding="utf-8")
