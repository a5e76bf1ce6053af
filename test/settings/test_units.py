"""The joint type decides the units of an axis in sentences and declared parameters; the scales are checked."""

from __future__ import annotations

import math

import pytest

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.settings.node_parameters import tree_from_parameters
from sgms_observer.settings.units import Units


def sentences_of(**own: object) -> tuple[str, ...]:
    """Return the sentences about an axis x with these settings."""
    with pytest.raises(ConfigurationError) as error:
        settings_from_tree({"axes": ["x"], "x": own})
    return error.value.sentences


@pytest.mark.parametrize(
    ("prismatic", "revolute"),
    [
        ("m", "rad"),
        ("m/s", "rad/s"),
        ("m/s^2", "rad/s^2"),
        ("m/s^3/sqrt(Hz)", "rad/s^3/sqrt(Hz)"),
        ("N", "N m"),
        ("N/s", "N m/s"),
        ("N/m", "N m/rad"),
        ("N s/m", "N m s/rad"),
        ("N s^2/m^2", "N m s^2/rad^2"),
        ("kg", "kg m^2"),
        ("Hz", "Hz"),
        ("rad", "rad"),
        ("samples", "samples"),
        ("-", "-"),
    ],
)
def test_a_unit_follows_the_joint_type(prismatic: str, revolute: str) -> None:
    assert Units("revolute").of(prismatic) == revolute
    assert Units("prismatic").of(prismatic) == prismatic


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0, "m", "0 rad"),
        (4.2e-9, "m", "4.2 nrad"),
        (1e-12, "m", "0.001 nrad"),
        (9.9999e-7, "m", "1 urad"),
        (-2.5, "m", "-2.5 rad"),
        (3.14159e-3, "m/s", "3.14 mrad/s"),
        (1234.0, "N", "1230 N m"),
        (math.nan, "m", "nan rad"),
    ],
)
def test_a_number_is_shown_with_the_prefix_that_suits_its_size(value: float, unit: str, text: str) -> None:
    assert Units("revolute").readable(value, unit) == text


def test_a_position_that_is_only_rounding_is_shown_as_zero() -> None:
    assert Units("prismatic").readable_positions(-6.62e-24, 0.004) == ["0 mm", "4 mm"]
    assert Units("prismatic").readable_positions(-1e-8, 0.004) == ["-10 nm", "4 mm"]
    assert Units("prismatic").readable_positions(0.0, 0.0) == ["0 m", "0 m"]


def test_prefixed_numbers_are_the_same_quantity() -> None:
    for size in (3.0, 2e-3, 5e-5, 4e-9):
        factor, unit = Units().prefixed(size)
        base = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "nm": 1e-9}[unit]
        assert factor * base == pytest.approx(1.0)


def test_scales_and_joint_type_are_read() -> None:
    axis = settings_from_tree({"x": {"joint_type": "revolute", "position_scale": math.pi / 180, "effort_scale": -0.01}})
    assert axis.axes[0].units == Units("revolute")
    assert (axis.axes[0].position_scale, axis.axes[0].effort_scale) == (math.pi / 180, -0.01)
    plain = settings_from_tree({"axes": ["x"], "x": {}}).axes[0]
    assert (plain.joint_type, plain.position_scale, plain.effort_scale) == ("prismatic", 1.0, 1.0)


@pytest.mark.parametrize("name", ["position_scale", "effort_scale"])
def test_a_scale_of_zero_is_refused(name: str) -> None:
    assert sentences_of(**{name: 0.0}) == (f"x.{name} = 0 must not be 0; write 1.0 for no scaling",)


def test_an_unknown_joint_type_is_refused() -> None:
    assert sentences_of(joint_type="rotary") == ("x.joint_type = 'rotary' must be prismatic or revolute; choose one",)
    assert sentences_of(joint_type=["revolute"])


def test_sentences_about_a_revolute_axis_have_its_units() -> None:
    found = sentences_of(
        joint_type="revolute",
        mass=-1.0,
        friction={"element_stiffness": [-2.0], "element_fraction": [1.0], "static_force": 1.0, "coulomb_force": 2.0},
        effects={"names": ["cogging"], "cogging": {"pitch": -1.0}},
        stage={"encoder": {"noise": -1.0}},
    )
    assert "x.mass = -1 kg m^2 must be > 0; raise it" in found
    assert "x.friction.element_stiffness = -2 N m/rad must be > 0; raise it" in found
    assert "x.friction.static_force = 1 N m must be >= coulomb_force = 2 N m; swap them or raise static_force" in found
    assert any(sentence.startswith("x.effects.cogging.pitch = -1 rad must be >= ") for sentence in found)
    assert "x.stage.encoder.noise = -1 rad must be >= 0; raise it" in found


def test_declared_parameters_of_a_node_have_the_units_of_the_joint_type() -> None:
    from sgms_observer.settings.declaration import Declared
    from sgms_observer.settings.node_parameters import declare_all

    found: dict[str, Declared] = {}

    def declare(declaration: Declared) -> object:
        assert declaration.name not in found, "declared twice"
        found[declaration.name] = declaration
        return {"axes": ["x", "z"], "x.joint_type": "revolute", "x.effects.names": ["cogging"]}.get(declaration.name)

    declare_all(declare)
    assert found["x.mass"].description.endswith("[kg m^2]")
    assert found["x.friction.static_force"].unit == "N m"
    assert found["x.stage.friction.viscous_coefficient"].unit == "N m s/rad"
    assert found["x.effects.cogging.pitch"].unit == "rad"
    assert found["z.friction.static_force"].unit == "N"
    assert {found[name].unit for name in found if name.startswith("z.") and name.endswith("_scale")} <= {"-", "N"}


def test_gravity_turns_on_a_revolute_joint_and_stands_on_a_prismatic_axis() -> None:
    for joint_type, expected in (("revolute", 1.0), ("prismatic", 0.0)):
        gravity = {"names": ["gravity"], "gravity": {"amplitude": 56.0, "angle": 0.4}}
        found = settings_from_tree({"axes": ["x"], "x": {"joint_type": joint_type, "effects": gravity}})
        assert found.axes[0].effects[0].values == (56.0, 0.4, expected)


def test_a_stage_node_without_effects_of_its_own_has_those_of_the_axis() -> None:
    """A node hands on an empty list for ``stage.effects.names``, because it has declared the parameter."""
    values = {"axes": ["x"], "x.effects.names": ["offset"], "x.effects.offset.force": 2.0, "x.stage.effects.names": []}
    (axis,) = settings_from_tree(tree_from_parameters(values)).axes
    assert axis.effects and axis.stage_effects is None
    (axis,) = settings_from_tree(tree_from_parameters({**values, "x.stage.effects.names": ["none"]})).axes
    assert axis.stage_effects == ()
