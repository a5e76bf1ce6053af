"""Rotary joints, gravity and other effects of the start file, reversed efforts and models that must not be used."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli.main import main
from sgms_observer.errors import DataError
from sgms_observer.identification.answer import identification_answer, least_squares_answer
from sgms_observer.identification.identify import Identification, IdentifyOptions, identify
from sgms_observer.identification.least_squares import fit_inverse_model
from sgms_observer.identification.problem import DELAY, MASS, RHO, V_S, VISCOUS, ElementShape, unit_elements
from sgms_observer.identification.trace import traces_of, unexplained_share
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, FrictionSettings
from sgms_observer.settings.load import load_settings, settings_from_tree

PERIOD = 5.0e-3
TIME = PERIOD * np.arange(6000)
INERTIA, VISCOUS_FRICTION, COULOMB, AMPLITUDE, ANGLE, OFFSET = 14.0, 20.0, 13.0, 110.0, 0.4, -0.8
QUICK = IdentifyOptions(count=1)


def _turning(amplitude: float = AMPLITUDE, seed: int = 1, offset: float = OFFSET) -> tuple[np.ndarray, np.ndarray]:
    """Return angle [rad] and torque [N m] of a joint under gravity."""
    angle = -0.3 + 0.9 * np.sin(0.9 * TIME) + 0.25 * np.sin(2.3 * TIME) + 0.1 * np.sin(5.1 * TIME)
    velocity = np.gradient(angle, PERIOD)
    torque = INERTIA * np.gradient(velocity, PERIOD) + VISCOUS_FRICTION * velocity
    torque += COULOMB * np.tanh(velocity / 1e-3)
    torque += amplitude * np.sin(angle + ANGLE) + offset
    return angle, torque + np.random.default_rng(seed).normal(0.0, 1.0, len(TIME))


def _axis(**own: object) -> AxisSettings:
    friction = {"static_force": 9.0, "coulomb_force": 8.0, "stribeck_velocity": 1.0e-2}
    tree = {"joint_type": "revolute", "mass": 5.0, "friction": friction, **own}
    return settings_from_tree({"axes": ["x"], "x": tree}).axes[0]


def _gravity(result: Identification) -> tuple[float, float]:
    names = result.terms.names
    values = result.parameters.effects.values
    return values[names.index("gravity.amplitude")], values[names.index("gravity.angle")]


def test_a_joint_gets_gravity_although_its_file_has_none() -> None:
    angle, torque = _turning()
    axis = _axis()
    result = identify([Recording("joint", PERIOD, angle, torque)], axis, QUICK)
    amplitude, phase = _gravity(result)
    assert amplitude == pytest.approx(AMPLITUDE, rel=0.02)
    assert phase == pytest.approx(ANGLE, abs=0.02)
    assert result.parameters.scalars[MASS] == pytest.approx(INERTIA, rel=0.05)
    assert result.parameters.scalars[VISCOUS] == pytest.approx(VISCOUS_FRICTION, rel=0.1)
    assert float(result.parameters.level.sum()) == pytest.approx(COULOMB, rel=0.1)
    changes = identification_answer(result, axis, PERIOD).changes
    assert changes["effects.names"] == ["offset", "gravity"]
    assert changes["effects.gravity.ratio"] == 1.0
    unseen = Recording("again", PERIOD, *_turning(seed=2))
    assert unexplained_share(traces_of(result, axis, (), [unseen]).held_out) < 0.05


def test_a_joint_without_gravity_gets_none() -> None:
    angle, torque = _turning(amplitude=0.0)
    axis = _axis()
    result = identify([Recording("joint", PERIOD, angle, torque)], axis, QUICK)
    assert "effects.gravity.amplitude" not in identification_answer(result, axis, PERIOD).changes


@pytest.mark.parametrize("stiffness", [40.0, -40.0])
def test_an_axis_gets_a_spring_although_its_file_has_none(stiffness: float) -> None:
    """The spring was a friction that slips after half of the stroke, and the Coulomb force 50 % too large."""
    position, force = _turning(amplitude=0.0)
    force = force + stiffness * position
    axis = _axis(joint_type="prismatic")
    result = identify([Recording("axis", PERIOD, position, force)], axis, IdentifyOptions(count=2))
    assert float(result.parameters.level.sum()) == pytest.approx(COULOMB, rel=0.05)
    answer = identification_answer(result, axis, PERIOD)
    changes = answer.changes
    assert "spring" in changes["effects.names"]
    row = next(row for row in answer.rows if row.name == "effects.spring.stiffness")
    assert abs(row.value - stiffness) <= row.half_width < 2.0
    middle = 0.5 * (position.min() + position.max())
    assert changes["effects.spring.rest_position"] == pytest.approx(middle, abs=0.01)
    at_middle = stiffness * changes["effects.spring.rest_position"] + OFFSET
    assert changes["effects.offset.force"] == pytest.approx(at_middle, abs=0.5)
    assert not any("rest_position" in one for one in answer.warnings)


def test_an_axis_without_a_spring_gets_none() -> None:
    position, force = _turning(amplitude=0.0)
    axis = _axis(joint_type="prismatic")
    answer = identification_answer(identify([Recording("axis", PERIOD, position, force)], axis, QUICK), axis, PERIOD)
    assert not any("spring" in name for name in (*answer.changes, *answer.remarks))


@pytest.mark.parametrize(("stated", "largest"), [(0.01, 0.05), (0.15, 0.15)])
def test_no_element_slips_later_than_friction_or_the_start_file(stated: float, largest: float) -> None:
    """This one slips after 0.4 of the stroke."""
    position, force = _turning(amplitude=0.0)
    stroke = float(np.ptp(position))
    shape = ElementShape.of(FrictionSettings(), "sgms")
    force = force + 20.0 * unit_elements(position, PERIOD, np.array([0.4 * stroke]), shape)[:, 0]
    one = {"element_stiffness": [9.0 / (stated * stroke)], "element_fraction": [1.0], "element_damping": [0.0]}
    friction = {"static_force": 9.0, "coulomb_force": 8.0, "stribeck_velocity": 1.0e-2, **one}
    axis = _axis(joint_type="prismatic", friction=friction, effects={"names": ["spring"]})
    result = identify([Recording("axis", PERIOD, position, force)], axis, IdentifyOptions(count=2))
    slip = float(result.parameters.slip_deflection.max()) / stroke
    assert 0.9 * largest <= slip <= 1.0001 * largest


@pytest.mark.parametrize("model", ["gms", "least_squares"])
@pytest.mark.parametrize(("offset", "listed"), [(OFFSET, []), (0.0, []), (0.0, ["offset"])])
def test_an_offset_is_written_where_it_is_significant_or_listed(model: str, offset: float, listed: list[str]) -> None:
    axis = _axis(effects={"names": listed})
    learn = Recording("joint", PERIOD, *_turning(offset=offset))
    if model == "least_squares":
        changes = least_squares_answer(
            fit_inverse_model([learn], cutoff=40.0, is_revolute=True), axis, is_opposed=False
        ).changes
    else:
        changes = identification_answer(identify([learn], axis, QUICK), axis, PERIOD).changes
    assert ("effects.offset.force" in changes) == bool(offset or listed)


def test_effects_of_the_file_are_fitted_with_intervals_shapes_included() -> None:
    angle, torque = _turning()
    torque = torque + 6.0 * np.sin(2.0 * np.pi * angle / 0.2 + 0.5)
    listed = {"names": ["cogging", "gravity"], "cogging": {"amplitude": 1.0, "pitch": 0.199, "phase": 0.0},
              "gravity": {"amplitude": 50.0, "angle": 0.0}}  # fmt: skip
    axis = _axis(effects=listed)
    result = identify([Recording("joint", PERIOD, angle, torque)], axis, QUICK)
    values = dict(zip(result.terms.names, result.parameters.effects.values, strict=True))
    first = result.parameters.first_effect
    width = dict(zip(result.terms.names, result.confidence.half_width[first:], strict=True))
    for name, true in (("cogging.amplitude", 6.0), ("cogging.pitch", 0.2), ("gravity.amplitude", AMPLITUDE)):
        assert values[name] == pytest.approx(true, rel=0.05), name
        assert abs(values[name] - true) <= max(width[name], 0.01 * true), name
    assert math.isinf(width["gravity.ratio"]) and values["gravity.ratio"] == 1.0


def test_what_the_motion_cannot_tell_apart_stays_with_a_warning() -> None:
    angle, torque = _turning(amplitude=0.0)
    listed = {"names": ["gravity"], "gravity": {"amplitude": 3.0}}
    axis = _axis(joint_type="prismatic", effects=listed)  # its gravity is a constant, as the offset is
    answer = identification_answer(identify([Recording("axis", PERIOD, angle, torque)], axis, QUICK), axis, PERIOD)
    assert "effects.gravity.amplitude" not in answer.changes
    warning = next(one for one in answer.warnings if "gravity.amplitude" in one)
    said = "Warning: x.effects.gravity.amplitude is not identifiable from this recording; 3 N of the"
    assert warning.startswith(said)


def test_a_reversed_effort_is_turned_round_and_told() -> None:
    angle, torque = _turning()
    axis = _axis()
    result = identify([Recording("joint", PERIOD, angle, -torque)], axis, QUICK)
    assert result.is_opposed and not result.is_usable
    answer = identification_answer(result, axis, PERIOD)
    assert answer.changes["effort_scale"] == -1.0
    assert answer.changes["mass"] == pytest.approx(INERTIA, rel=0.05)
    assert "effort_scale: -1" in answer.warnings[0]


def test_a_negative_delay_is_never_identified() -> None:
    angle, torque = _turning()
    late = np.concatenate((np.full(6, torque[0]), torque[:-6]))  # stamped 30 ms too late
    axis = _axis()
    result = identify([Recording("joint", PERIOD, angle, late)], axis, QUICK)
    assert result.parameters.scalars[DELAY] == 0.0
    answer = identification_answer(result, axis, PERIOD)
    assert "compensation.look_ahead" not in answer.changes
    assert any("negative delay, which is impossible" in one for one in answer.warnings)


def test_the_interval_of_a_mass_counts_a_delay_at_its_bound_as_unknown() -> None:
    """Each 1 ms of delay changes the mass by 0.2 kg. With the delay at exactly 0 s, its interval was +- 0.034 kg."""
    angle = 0.9 * np.sin(0.9 * TIME) + 0.25 * np.sin(2.3 * TIME)
    velocity = np.gradient(angle, PERIOD)
    torque = INERTIA * np.gradient(velocity, PERIOD) + 200.0 * velocity + COULOMB * np.tanh(velocity / 1e-3)
    late = np.interp(TIME - 1.0e-3, TIME, torque) + np.random.default_rng(3).normal(0.0, 1.0, len(TIME))
    result = identify([Recording("axis", PERIOD, angle, late)], _axis(joint_type="prismatic"), QUICK)
    assert result.parameters.scalars[DELAY] == 0.0 and DELAY in result.frozen
    assert result.confidence.half_width[MASS] > 200.0 * 4.0e-4
    assert math.isinf(result.confidence.half_width[DELAY])


@pytest.fixture
def bags(tmp_path: Path) -> Path:
    """Return a folder with the same joint in radians and in degrees, and an effort that is noise."""
    angle, torque = _turning()
    noise = np.random.default_rng(5).normal(0.0, 10.0, len(TIME)) + torque * 0.1
    stamp = 1_000_000_000 + np.rint(TIME * 1e9).astype(np.int64)
    for name, position, effort in (("rad", angle, torque), ("deg", np.rad2deg(angle), torque), ("noise", angle, noise)):
        with BagWriter(tmp_path / name) as writer:
            writer.write_joint_states("position", stamp, ("x",), position=position)
            writer.write_joint_states("control_effort", stamp, ("x",), effort=effort)
    for name, scale in (("rad", 1.0), ("deg", math.pi / 180.0)):
        (tmp_path / f"{name}.yaml").write_text(
            "# the owner's head line\n/**:\n  ros__parameters:\n    axes: [x]\n    x:\n"
            "      # measured on a scale\n      mass: 5.0  # kg m^2, weighed\n"
            f"      joint_type: revolute\n      position_scale: {scale!r}\n"
            "      friction: {static_force: 9.0, coulomb_force: 8.0, stribeck_velocity: 0.01}\n"
        )
    return tmp_path


def _identify(folder: Path, bag: str, config: str, *more: str) -> int:
    given = ["identify", str(folder / bag), "--config", str(folder / f"{config}.yaml"), "--elements", "1"]
    return main([*given, "--out", str(folder / f"{bag}_out.yaml"), *more])


def test_degrees_give_the_answer_of_radians(bags: Path) -> None:
    assert _identify(bags, "rad", "rad") == 0
    assert _identify(bags, "deg", "deg") == 0
    one, other = (load_settings(bags / f"{name}_out.yaml").axes[0] for name in ("rad", "deg"))
    assert other.mass == pytest.approx(one.mass, rel=1e-4)
    assert other.friction.coulomb_force == pytest.approx(one.friction.coulomb_force, rel=1e-4)
    assert other.friction.element_stiffness == pytest.approx(one.friction.element_stiffness, rel=1e-3)


def test_json_comments_and_no_overwriting(bags: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _identify(bags, "rad", "rad", "--json", "--holdout", str(bags / "rad")) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["usable"] and result["axes"]["x"]["held_out"] < 0.05
    assert result["axes"]["x"]["parameters"]["mass"]["value"] == pytest.approx(INERTIA, rel=0.05)
    text = (bags / "rad_out.yaml").read_text()
    assert "# the owner's head line" in text and "# measured on a scale" in text and "# kg m^2, weighed" in text
    assert _identify(bags, "rad", "rad") == 1
    assert "--overwrite" in capsys.readouterr().err
    assert _identify(bags, "rad", "rad", "--overwrite", "--model", "least_squares") == 0


def test_a_model_that_explains_little_warns_and_ends_with_3(bags: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _identify(bags, "noise", "rad") == 3
    said = capsys.readouterr().err
    assert "Warning: x: the model is unusable" in said and "unexplained" in said


def test_a_constant_load_hides_no_bad_model() -> None:
    """The share of the rms effort fell to 1 % below a load of 1000 N m, and the model of noise was usable."""
    angle, torque = _turning()
    noise = 1000.0 + np.random.default_rng(5).normal(0.0, 10.0, len(TIME)) + torque * 0.1
    axis = _axis()
    result = identify([Recording("load", PERIOD, angle, noise)], axis, QUICK)
    assert result.unexplained < 0.02 and result.unexplained_variation > 0.5 and not result.is_usable
    warnings = identification_answer(result, axis, PERIOD).warnings
    assert any("of the rms torque about its mean is unexplained" in warning for warning in warnings)


def test_one_reversal_is_refused(tmp_path: Path) -> None:
    angle = np.where(TIME < 15.0, 0.05 * TIME, 1.5 - 0.05 * TIME)
    with pytest.raises(Exception, match="reverses once"):
        identify([Recording("once", PERIOD, angle, np.sign(np.gradient(angle)))], _axis(), QUICK)


@pytest.mark.parametrize("command", ["identify", "diagnose"])
def test_the_other_axis_is_the_one_that_the_observer_follows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    """Of three axes the one that ``coupled_axis`` names, not the first other one."""
    start = tmp_path / "start.yaml"
    start.write_text(
        """/**:
  ros__parameters:
    axes: [x, y, z]
    z: {mass: 10.0, coupled_axis: y, effects: {names: [cross_axis_coupling]}}
"""
    )
    asked: list[str] = []

    def read(bag: str, axis: AxisSettings, other: AxisSettings, **_options: object) -> None:
        asked.append(other.name)
        raise DataError("enough is known")

    (tmp_path / "bag").write_bytes(b"")
    monkeypatch.setattr(f"sgms_observer.application.{command}.read_recordings", read)
    options = ["--config", str(start), "--out", str(tmp_path / "out"), "--axis", "z"]
    assert main([command, str(tmp_path / "bag"), *options]) != 0
    assert asked == ["y"]


def test_a_piece_too_short_for_one_of_the_filters_is_skipped() -> None:
    angle, torque = _turning()
    whole = Recording("joint", PERIOD, angle, torque)
    pieces = [whole.part(0, 3800), whole.part(3900, 5900)]  # 19 s and 10 s; the lower of two corners needs 11.3 s
    options = IdentifyOptions(count=1, cutoff=10.0)
    result = identify(pieces, _axis(), options)
    expected = "1 of 2 pieces between pauses are shorter than 11.3 s and were skipped (10 of 29 s)"
    assert result.notes == (expected,)
    assert result.parameters.scalars[MASS] == pytest.approx(INERTIA, rel=0.1)
    assert len(traces_of(result, _axis(), pieces, ()).learnt) == 1
    with pytest.raises(DataError, match=r"joint has no piece of 11.3 s without a pause"):
        identify(pieces[1:], _axis(), options)


def test_a_static_force_at_the_coulomb_force_leaves_that_its_interval() -> None:
    """Friction falls towards rest. The ratio was 5 at a Stribeck velocity below all speeds, with ``+- inf`` at both."""
    angle, torque = _turning()
    velocity = np.gradient(angle, PERIOD)
    torque -= 0.4 * COULOMB * np.exp(-((velocity / 0.5) ** 2)) * np.tanh(velocity / 1e-3)
    axis = _axis(friction={"static_force": 30.0, "coulomb_force": 8.0, "stribeck_velocity": 0.3})
    result = identify([Recording("joint", PERIOD, angle, torque)], axis, QUICK)
    assert (result.parameters.scalars[RHO], result.parameters.scalars[V_S]) == (1.0, 0.3)
    answer = identification_answer(result, axis, PERIOD)
    widths = {row.name: row.half_width for row in answer.rows}
    assert widths["friction.coulomb_force"] < 0.2 * COULOMB
    assert widths["friction.static_force"] == widths["friction.coulomb_force"]
    assert not any("+- inf" in text for text in (*answer.warnings, *answer.remarks.values()))
