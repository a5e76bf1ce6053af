"""A joint whose bag carries degrees and a torque of its own unit and sign gives the answers of one in SI."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.bags.reader import BagSamples, read_joint_states, read_samples
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.observer.block_pairing import Messages, push_block
from sgms_observer.observer.pairing import Pairing
from sgms_observer.offline.recording import read_recordings
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.units import UNSCALED, Scales

DEGREE = math.pi / 180.0
SCALES = Scales(DEGREE, -0.01)
START_NS = 1_000_000_000
JOINT = """/**:
  ros__parameters:
    axes: [elbow, "y"]
    sample_period: 1.0e-3
    elbow:
      joint_type: revolute
      mass: 1.2
      friction: {element_stiffness: [40.0e3, 9.0e3], element_fraction: [0.4, 0.6], static_force: 9.0,
                 coulomb_force: 7.5, stribeck_velocity: 0.02, viscous_coefficient: 12.0}
      filter: {window: 1.0e-2}
      estimator: {kind: ekf, correction_every: 5, measurement_std: 0.3}
      compensation: {enabled: true, look_ahead: 1.0e-3}
      stage:
        controller: {bandwidth: 10.0}
        reference: {amplitude: 0.2, frequency: 1.0}
        encoder: {resolution: 1.0e-5, noise: 2.0e-6}
        force_noise: 0.05
    y:
      mass: 5.0
"""
IN_DEGREES = JOINT.replace(
    "joint_type: revolute", f"joint_type: revolute\n      position_scale: {DEGREE!r}\n      effort_scale: -0.01"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the same run in SI and in degrees, observed while it was simulated."""
    place = tmp_path_factory.mktemp("scales")
    for name, text in (("si", JOINT), ("degrees", IN_DEGREES)):
        (place / f"{name}.yaml").write_text(text, encoding="utf-8")
        arguments = ["simulate", "--config", str(place / f"{name}.yaml"), "--out", str(place / name), "--observe"]
        assert main([*arguments, "--duration", "2"]) == 0
    return place


def test_the_simulated_stage_writes_topic_units_and_the_truth_in_si(folder: Path) -> None:
    for topic, field, factor in (
        ("position", "position", DEGREE),
        ("reference", "position", DEGREE),
        ("reference", "velocity", DEGREE),
        ("control_effort", "effort", -0.01),
        ("friction_true", "position", 1.0),
        ("friction_true", "effort", 1.0),
        ("friction_compensation", "effort", 1.0),
    ):
        si, scaled = (getattr(read_joint_states(folder / bag, topic), field) for bag in ("si", "degrees"))
        assert np.ptp(si[:, 0]) > 0.1
        np.testing.assert_allclose(factor * scaled[:, 0], si[:, 0], rtol=1e-6, atol=1e-6 * np.ptp(si[:, 0]))
        np.testing.assert_array_equal(scaled[:, 1], si[:, 1], err_msg="y has no scales")


def test_replay_of_degrees_gives_what_the_observer_gave_live_to_the_last_bit(folder: Path) -> None:
    replayed = folder / "replayed"
    arguments = ["--config", str(folder / "degrees.yaml"), "--out", str(replayed)]
    assert main(["replay", str(folder / "degrees"), *arguments]) == 0
    for topic in ("friction_estimate", "friction_std", "friction_compensation"):
        live, again = read_joint_states(folder / "degrees", topic), read_joint_states(replayed, topic)
        np.testing.assert_array_equal(again.effort, live.effort)
    si = read_joint_states(folder / "si", "friction_estimate").effort[:, 0]
    np.testing.assert_allclose(
        read_joint_states(replayed, "friction_estimate").effort[:, 0], si, rtol=0.0, atol=1e-4 * np.ptp(si)
    )


def test_samples_are_in_si_wherever_a_bag_is_read(folder: Path) -> None:
    settings = load_settings(folder / "degrees.yaml")
    elbow, y = settings.axes
    (si,) = read_recordings(folder / "si", load_settings(folder / "si.yaml").axes[0])
    (piece,) = read_recordings(folder / "degrees", elbow, y)
    np.testing.assert_allclose(piece.position, si.position, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(piece.effort, si.effort, rtol=0.0, atol=1e-4)
    assert piece.other_position is not None and np.ptp(piece.other_position) < 1e-3  # y in m, untouched
    by_all = np.concatenate([block.effort for axis, block in BagSamples(folder / "degrees", settings.scales)
                             if axis == "elbow"])  # fmt: skip
    by_one = np.concatenate([block.effort for block in read_samples(folder / "degrees", "elbow", scales=elbow.scales)])
    np.testing.assert_array_equal(by_one, by_all)
    raw = np.concatenate([block.effort for block in read_samples(folder / "degrees", "elbow")])
    np.testing.assert_array_equal(by_one, -0.01 * raw)


@pytest.mark.parametrize("scales", [UNSCALED, SCALES])
def test_blocks_and_single_messages_are_scaled_alike(scales: Scales) -> None:
    generator = np.random.default_rng(3)
    count = 500
    stamp = START_NS + 1_000_000 * np.arange(count, dtype=np.int64)
    position, effort, reference, velocity = generator.normal(size=(4, count))
    velocity[7] = np.nan
    order = 3 * np.arange(count, dtype=np.int64)
    single, block = Pairing(1e-3, scales), Pairing(1e-3, scales)
    for i in range(count):
        single.push_reference(int(stamp[i]), reference[i], velocity[i])
        single.push_position(int(stamp[i]), position[i])
        single.push_effort(int(stamp[i]), effort[i])
    push_block(
        block,
        Messages(stamp, order + 1, position, velocity),
        Messages(stamp, order + 2, effort, velocity),
        Messages(stamp, order, reference, velocity),
    )
    first, second = single.pop(), block.pop()
    assert first is not None and second is not None
    for name, signal, factor in (
        ("position", position, scales.position),
        ("effort", effort, scales.effort),
        ("reference_position", reference, scales.position),
        ("reference_velocity", velocity, scales.position),
    ):
        np.testing.assert_array_equal(getattr(first, name), factor * signal)
        np.testing.assert_array_equal(getattr(second, name), getattr(first, name))


def test_words_about_a_revolute_axis(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = str(folder / "degrees.yaml")
    assert main(["replay", str(folder / "degrees"), "--config", config, "--out", str(folder / "words")]) == 0
    elbow, y = (line for line in capsys.readouterr().out.splitlines() if " rms, NIS" in line)
    assert elbow.startswith("elbow:") and "N m rms, NIS" in elbow
    assert y.startswith("y:") and " N rms, NIS" in y
    arguments = ["simulate", "--config", config, "--out", str(folder / "said"), "--duration", "0.3"]
    assert main([*arguments, "--observe"]) == 0
    elbow, y = (line for line in capsys.readouterr().out.splitlines() if "tracking error" in line)
    assert "rad rms" in elbow and "N m rms off the truth" in elbow
    assert "m rms" in y and "rad" not in y


def test_excitation_of_a_revolute_axis_has_its_units_and_moves_the_stage(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config, csv = folder / "degrees.yaml", folder / "reference.csv"
    assert main(["excite", "--config", str(config), "--stroke", "0.3", "--duration", "15", "--out", str(csv)]) == 0
    said = capsys.readouterr().out
    assert "elbow: from -" in said and "rad/s^2" in said
    table = np.loadtxt(csv, delimiter=",", skiprows=1)
    assert 0.05 < np.ptp(table[:, 1]) <= 0.3
    assert 0.2 < np.abs(table[:, 2]).max() <= 0.5 * (1.0 + 1e-9)
    assert main(["excite", "--config", str(config), "--stroke", "1e-6", "--out", str(folder / "none.csv")]) != 0
    assert "stroke = 1 urad leaves no room for reversals from 10 urad" in capsys.readouterr().err


@pytest.mark.parametrize("model", ["least_squares", "sgms"])
def test_identification_in_degrees_is_that_in_radians(tmp_path: Path, model: str) -> None:
    seconds = 1.0e-3 * np.arange(12_000)
    position = 0.4 * np.sin(np.pi * seconds) + 0.1 * np.sin(2.0 * np.pi * 1.7 * seconds)
    position = 1.0e-5 * np.round(position / 1.0e-5)
    velocity = np.gradient(0.4 * np.sin(np.pi * seconds) + 0.1 * np.sin(2.0 * np.pi * 1.7 * seconds), 1.0e-3)
    effort = 1.2 * np.gradient(velocity, 1.0e-3) + 12.0 * velocity + 7.5 * np.tanh(velocity / 1e-4) - 0.7
    effort += np.random.default_rng(11).normal(0.0, 0.05, len(effort))
    stamp = START_NS + np.rint(1e9 * seconds).astype(np.int64)
    found = []
    start = JOINT.replace('[elbow, "y"]', "[elbow]").replace("    y:\n      mass: 5.0\n", "")
    for name, text, scales in (("si", start, UNSCALED), ("degrees", "", SCALES)):
        text = text or start.replace(
            "joint_type: revolute", f"joint_type: revolute\n      position_scale: {DEGREE!r}\n      effort_scale: -0.01"
        )
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
        with BagWriter(tmp_path / name) as bag:
            bag.write_joint_states("position", stamp, ("elbow",), position=position / scales.position)
            bag.write_joint_states("control_effort", stamp, ("elbow",), effort=effort / scales.effort)
        arguments = ["--config", str(tmp_path / f"{name}.yaml"), "--out", str(tmp_path / f"{name}_out.yaml")]
        options = [] if model == "least_squares" else ["--elements", "1"]
        assert main(["identify", str(tmp_path / name), *arguments, "--model", model, *options]) == 0
        found.append(load_settings(tmp_path / f"{name}_out.yaml").axes[0])
        remarks = (tmp_path / f"{name}_out.yaml").read_text(encoding="utf-8")
        assert "# kg m^2; +-" in remarks and "# N m s/rad; +-" in remarks and "# N m; +-" in remarks
    si, scaled = found
    assert si.mass == pytest.approx(1.2, rel=0.05)
    assert si.friction.viscous_coefficient == pytest.approx(12.0, rel=0.05)
    assert scaled.mass == pytest.approx(si.mass, rel=1e-4)
    assert scaled.friction.viscous_coefficient == pytest.approx(si.friction.viscous_coefficient, rel=1e-4)
    assert scaled.friction.coulomb_force == pytest.approx(si.friction.coulomb_force, rel=1e-4)
    assert scaled.effects[0].values[0] == pytest.approx(si.effects[0].values[0], rel=1e-3)


def test_the_same_positions_in_degrees_are_the_same_recording_to_the_last_bit(tmp_path: Path) -> None:
    generator = np.random.default_rng(8)
    step = 2.0 * np.pi / 2**20
    angle = np.round(0.3 * np.sin(2e-3 * np.arange(4000)) / step) * step
    torque = generator.normal(0.0, 2.0, 4000)
    stamp = START_NS + 1_000_000 * np.arange(4000, dtype=np.int64)
    for name, values in (("radians", angle), ("degrees", np.rad2deg(angle))):
        with BagWriter(tmp_path / name) as writer:
            writer.write_joint_states("position", stamp, ["elbow"], position=values)
            writer.write_joint_states("control_effort", stamp, ["elbow"], effort=torque)
    (first,) = read_recordings(tmp_path / "radians", AxisSettings(name="elbow"))
    (second,) = read_recordings(tmp_path / "degrees", AxisSettings(name="elbow", position_scale=np.pi / 180.0))
    assert not np.array_equal(angle, np.deg2rad(np.rad2deg(angle)))
    np.testing.assert_array_equal(second.position, first.position)
    np.testing.assert_allclose(first.position, angle, rtol=0.0, atol=0.01 * step)
