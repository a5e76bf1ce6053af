"""References designed by information: inside the limits, from where the table stands, better than single motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgms_observer.errors import ConfigurationError
from sgms_observer.excitation.design import Design, Goal, spread_evenly
from sgms_observer.excitation.limits import CAUTIOUS_LIMITS, ExcitationLimits
from sgms_observer.excitation.reference import design_excitation
from sgms_observer.excitation.segments import Place, library
from sgms_observer.excitation.sensitivity import Sensitivity, contacts
from sgms_observer.settings.axis import AxisSettings, EffectSettings, FrictionSettings
from sgms_observer.settings.units import REVOLUTE

AXIS = AxisSettings(effects=(EffectSettings("offset", (0.2,)),))
JOINT = AxisSettings(
    name="elbow",
    joint_type=REVOLUTE,
    mass=1.2,
    friction=FrictionSettings(
        element_stiffness=(40.0e3, 9.0e3, 3.0e3),
        element_fraction=(0.3, 0.35, 0.35),
        element_damping=(0.0, 0.0, 0.0),
        viscous_coefficient=12.0,
        static_force=9.0,
        coulomb_force=7.5,
        stribeck_velocity=0.02,
    ),
)
LIMITS = ExcitationLimits(stroke=0.012, speed=0.03, acceleration=0.5)


def _inside(time: np.ndarray, position: np.ndarray, velocity: np.ndarray, limits: ExcitationLimits) -> None:
    period = float(time[1] - time[0])
    assert np.ptp(position) <= limits.stroke * (1.0 + 1e-9)
    assert np.max(np.abs(velocity)) <= limits.speed * (1.0 + 1e-9)
    assert np.max(np.abs(np.diff(velocity))) / period <= limits.acceleration * (1.0 + 1e-3)


@settings(deadline=None, max_examples=25)
@given(
    stroke=st.floats(1.0e-4, 0.5), speed=st.floats(1.0e-3, 1.0), acceleration=st.floats(0.01, 50.0),
    period=st.sampled_from([1e-4, 1e-3, 1e-2]), start=st.floats(-0.5, 0.5), friction=st.floats(0.01, 100.0),
)  # fmt: skip
def test_every_segment_is_inside_the_limits_and_comes_back(
    stroke: float, speed: float, acceleration: float, period: float, start: float, friction: float
) -> None:
    limits = ExcitationLimits(stroke, speed, acceleration)
    axis = replace(AXIS, friction=replace(AXIS.friction, coulomb_force=4.0 * friction, static_force=4.5 * friction))
    place = Place.of(axis, limits, start * stroke, 0.0)
    for segment, velocity in library(place, limits, period, 20.0):
        position = place.home + period * np.cumsum(velocity)
        _inside(period * np.arange(2), position, np.concatenate([[0.0], velocity]), limits)
        assert position.min() >= -0.5 * stroke * (1.0 + 1e-9) and position.max() <= 0.5 * stroke * (1.0 + 1e-9)
        assert position[-1] == pytest.approx(place.home, abs=1e-3 * limits.smallest), segment.name
        assert velocity[-1] == 0.0


@pytest.mark.parametrize("rate", [100.0, 1000.0, 4000.0])
@pytest.mark.parametrize("asked", [("identify",), ("cogging", "position_dependent_friction")])
def test_a_reference_keeps_limits_time_and_start(rate: float, asked: tuple[str, ...]) -> None:
    made = design_excitation(AXIS, LIMITS, asked, start=0.105, seconds=20.0, rate=rate, centre=0.102)
    _inside(made.time, made.position, made.velocity, LIMITS)
    assert made.position.min() >= 0.096 - 1e-9 and made.position.max() <= 0.108 + 1e-9
    assert made.position[0] == 0.105 and made.position[-1] == pytest.approx(0.105, abs=1e-12)
    assert made.velocity[0] == made.velocity[-1] == 0.0
    assert 12.0 < made.time[-1] <= 20.0
    assert made.time[1] == pytest.approx(1.0 / rate)
    assert [part.start for part in made.sections[1:]] == pytest.approx([part.end for part in made.sections[:-1]])
    assert made.sections[-1].end == pytest.approx(made.time[-1])
    shares = {**made.expected, **made.efficiency}
    assert set(asked) <= {"identify", *shares} and all(share > 0.0 for share in shares.values())
    assert "starting and ending at 105 mm" in made.summary[0] and "mm/s" in made.summary[0]


def test_the_default_hides_nothing_that_the_joint_can_show() -> None:
    made = design_excitation(JOINT, CAUTIOUS_LIMITS[REVOLUTE], seconds=30.0, rate=200.0)
    assert {"mass", "coulomb_force", "static_force", "element_stiffness[3]"} <= set(made.expected)
    assert {"gravity", "cogging", "position_dependent_friction", "backlash"} <= set(made.efficiency)
    assert min(made.efficiency.values()) > 0.05 and made.expected["mass"] < 0.1
    assert np.ptp(made.position) > 0.8 * CAUTIOUS_LIMITS[REVOLUTE].stroke
    assert "rad/s^2" in made.summary[0]


def test_an_effect_of_the_file_is_not_hidden_by_itself() -> None:
    joint = replace(JOINT, effects=(EffectSettings("gravity", (20.0, 0.3, 1.0)),))
    made = design_excitation(
        joint, CAUTIOUS_LIMITS[REVOLUTE], ("gravity", "asymmetric_coulomb"), seconds=15.0, rate=200.0
    )
    assert set(made.efficiency) == {"gravity", "asymmetric_coulomb"} and not made.hidden


def test_what_is_bound_to_place_gets_the_stroke_and_what_is_not_does_not() -> None:
    placed = design_excitation(AXIS, LIMITS, ("cogging", "position_dependent_friction"), seconds=20.0)
    contact = design_excitation(AXIS, LIMITS, ("presliding",), seconds=20.0)
    assert np.ptp(placed.position) > 0.95 * LIMITS.stroke
    covered = [np.mean(np.abs(one.position) > 0.1 * LIMITS.stroke) for one in (placed, contact)]
    assert covered[0] > 3.0 * covered[1]


def test_a_design_beats_each_single_motion_and_uses_the_time() -> None:
    """Two quantities, three segments: the best single one shows one quantity only."""
    information = np.array([np.diag([1.0, 0.0]), np.diag([0.0, 1.0]), np.diag([0.3, 0.3])])
    every, ones = np.ones((2, 2), dtype=bool), np.ones(2)
    goal = Goal(("a", "b"), information, np.zeros((3, 2, 0)), 1e-6 * np.eye(2), np.eye(2), every, ones, True, 1.0)
    design = Design([goal], np.array([1.0, 1.0, 1.0]), 10.0)
    choice = design.choose()
    assert choice.counts.tolist() == [5, 5, 0]
    assert choice.efficiency[0] == pytest.approx([0.5, 0.5], rel=1e-3)
    assert spread_evenly(choice.counts) == [0, 1] * 5


def test_information_of_a_quantity_is_what_its_rivals_leave() -> None:
    """The Schur complement, against the inverse; an error of the prediction adds the square of what it shifts."""
    rng = np.random.default_rng(4)
    root = rng.normal(size=(4, 4))
    matrix = root @ root.T
    mask = np.array([[True, True, False, True]])
    bias = rng.normal(size=(1, 4, 1))
    kept = np.linalg.inv(matrix[np.ix_([0, 1, 3], [0, 1, 3])])
    shift = float(kept[0] @ bias[0, [0, 1, 3], 0])
    for error, columns in ((kept[0, 0], bias[..., :0]), (kept[0, 0] + shift**2, bias)):
        goal = Goal(("a",), matrix[None], columns, np.zeros((4, 4)), np.eye(4)[:1], mask, np.ones(1), False, 1.0)
        assert goal.left(np.ones(1))[0] == pytest.approx(1.0 / error)


def test_columns_are_derivatives_of_the_effort() -> None:
    time = 1e-3 * np.arange(4000)
    position = 2e-3 * (1.0 - np.cos(2.0 * np.pi * time)) + 3e-6 * np.sin(2.0 * np.pi * 7.0 * time)
    contact = contacts(AXIS.friction, 1e-7)[0]
    base = Sensitivity(AXIS, contact, position, 1e-3)
    found = base.parameters()
    step = 1e-4
    moved = {
        "mass": (replace(AXIS, mass=AXIS.mass * (1.0 + step)), contact.friction),
        "viscous_coefficient": (
            replace(AXIS, friction=replace(AXIS.friction, viscous_coefficient=20.0 * (1.0 + step))), contact.friction,
        ),
        "stribeck_velocity": (AXIS, replace(contact.friction, stribeck_velocity=1e-3 * (1.0 + step))),
        "element_stiffness[2]": (
            AXIS, replace(contact.friction, element_stiffness=(12.0e6, 2.5e6 * (1.0 + step), 0.71e6, 0.79e6)),
        ),
        "coulomb_force": (
            AXIS, replace(contact.friction, coulomb_force=4.0 * (1.0 + step), static_force=4.5 * (1.0 + step)),
        ),
    }  # fmt: skip
    for name, (axis, friction) in moved.items():
        other = Sensitivity(axis, replace(contact, friction=friction), position, 1e-3)
        column = base.rows(other.effort - base.effort) / step
        chosen = [name] if name != "coulomb_force" else [f"element_force[{i}]" for i in range(1, 5)]
        expected = found.columns[:, [found.names.index(one) for one in chosen]].sum(axis=1)
        assert np.linalg.norm(column - expected) < 0.02 * np.linalg.norm(expected), name


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        (("coging",), "--for coging is neither"),
        (("cross_axis_coupling",), "the other axis has to move"),
        (("gravity",), "ask for offset"),
    ],
)
def test_a_question_without_answer_is_one_sentence(asked: tuple[str, ...], says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        design_excitation(AXIS, LIMITS, asked, seconds=20.0)


@pytest.mark.parametrize(
    ("given", "says"),
    [({"seconds": 2.0}, "too short"), ({"rate": 5.0}, "at least 20 Hz"), ({"start": 0.02, "centre": 0.0}, "outside")],
)
def test_impossible_requests_are_refused(given: dict[str, float], says: str) -> None:
    with pytest.raises(ConfigurationError, match=says):
        design_excitation(AXIS, LIMITS, **given)  # type: ignore[arg-type]


def test_the_same_request_gives_the_same_reference() -> None:
    first, second = (design_excitation(AXIS, LIMITS, ("stribeck",), seconds=15.0) for _ in range(2))
    assert np.array_equal(first.position, second.position)
