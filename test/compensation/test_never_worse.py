"""A compensation that comes late, in bunches or not at all makes the largest tracking error at most 1 or 3 % larger."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import late_network
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from late_network import Trouble, largest_error

from sgms_observer.nodes.pace import DueForces
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
SECONDS = 0.7
LATEST = 0.2  # s


def _troubles(seconds: float, has_silence: bool) -> st.SearchStrategy[list[Trouble]]:
    """Return what may happen to the messages in a run of this length [s], and whether it may last to the end."""
    begin, length = st.floats(0.0, seconds), st.floats(0.0, LATEST)
    return st.lists(
        st.builds(
            Trouble,
            begin=begin,
            length=length | st.just(seconds) if has_silence else length,
            delay=st.floats(0.0, LATEST),
            jitter=st.sampled_from([0.0, 2.0e-3, 2.0e-2, LATEST]),
            lost=st.sampled_from([0.0, 0.1, 0.5, 1.0]),
        )
        | st.builds(Trouble, begin=begin, length=length, is_bunched=st.just(True)),
        min_size=1,
        max_size=5,
    )


TROUBLES, WITH_SILENCE = (_troubles(SECONDS, has_silence) for has_silence in (False, True))

MOTIONS = ("sine", "move", "sine with effects")
EFFECTS = (
    EffectSettings("cogging", (0.8, 1.0e-4, 0.3, 0.2, 0.1)),
    EffectSettings("position_dependent_friction", (0.4, 5.0e-5, 8.0e-5)),
    EffectSettings("asymmetric_coulomb", (0.15,)),
)


def _axis(motion: str) -> AxisSettings:
    """Return the demonstration's axis; a longer look-ahead than 3 ms knows too little of a short move."""
    axis = load_settings(ROOT / "config" / "demo.yaml").axes[0]
    if motion == "sine":
        return axis
    if motion == "sine with effects":
        return replace(axis, effects=EFFECTS)
    reference = replace(axis.stage.reference, kind="point_to_point", amplitude=5.0e-3, dwell=0.05)
    stage = replace(axis.stage, reference=reference)
    return replace(axis, stage=stage, compensation=replace(axis.compensation, look_ahead=3.0e-3))


SHARPER = 1.01
"""A compensation that is lost at a reversal leaves an axis that does not lag: it breaks away at a lower speed of the
set-point, with less help of the controller's damping, and errs more than one that always lagged. With all messages
lost from some moment on it was up to 0.7 % more, for a timeout of 20, 50 and 100 ms alike, so no other fading helps:
the force that would help is in a message that is not there. It was no more in 570 random runs of delays, jitter,
losses and bunches."""


SHARPER_HELD = 1.03
"""The same with a load. What a controller with integral action holds may be the compensation of a reversal, where the
friction is largest: the axis then has to break away from there."""

LOADED_MOTIONS = ("sine", "move")
LOADED_SECONDS, LOADED_SETTLE = 3.0, 1.0  # s: the joint's first move, its dwell and the reversal


def _loaded(motion: str, force: float) -> AxisSettings:
    """Return the demonstration's axis with a constant force, and a controller with integral action that carries it."""
    axis = _axis(motion)
    controller = replace(axis.stage.controller, integral_rate=20.0)
    return replace(
        axis, effects=(EffectSettings("offset", (force,)),), stage=replace(axis.stage, controller=controller)
    )


@cache
def _loaded_without(motion: str, force: float) -> float:
    """Return the largest error of ``_loaded`` without compensation [m]."""
    return largest_error(_loaded(motion, force), SECONDS, is_compensated=False)


def _joint_error(troubles: list[Trouble] | None, is_known_ahead: bool = False, seed: int = 0) -> float:
    """Return the largest error of the shipped joint under gravity [rad]; without compensation for no list."""
    found = load_settings(ROOT / "config" / "joint.yaml")
    return largest_error(
        found.axes[0], LOADED_SECONDS, troubles or (), is_compensated=troubles is not None,
        is_known_ahead=is_known_ahead, seed=seed, period=found.sample_period, settle=LOADED_SETTLE,
    )  # fmt: skip


@cache
def _joint_without() -> float:
    """Return the largest error of the joint without compensation [rad]."""
    return _joint_error(None)


@cache
def _without(motion: str) -> float:
    """Return the largest error without compensation [m]."""
    return largest_error(_axis(motion), SECONDS, is_compensated=False)


@pytest.mark.parametrize("motion", MOTIONS)
@settings(max_examples=30, deadline=None)
@given(troubles=TROUBLES, seed=st.integers(0, 1000))
def test_single_values_make_the_peak_hardly_larger_than_none(motion: str, troubles: list[Trouble], seed: int) -> None:
    """Nobody knows what a message that is missing said."""
    assert largest_error(_axis(motion), SECONDS, troubles, seed=seed) <= SHARPER * _without(motion)


@pytest.mark.parametrize("motion", MOTIONS)
@settings(max_examples=15, deadline=None)
@given(troubles=TROUBLES, seed=st.integers(0, 1000))
def test_a_horizon_is_never_worse_than_none(motion: str, troubles: list[Trouble], seed: int) -> None:
    assert largest_error(_axis(motion), SECONDS, troubles, is_known_ahead=True, seed=seed) <= _without(motion)


@pytest.mark.parametrize("is_known_ahead", [False, True])
@pytest.mark.parametrize("force", [2.0, -6.0])
@pytest.mark.parametrize("motion", LOADED_MOTIONS)
@settings(max_examples=8, deadline=None)
@given(troubles=WITH_SILENCE, seed=st.integers(0, 1000))
@example(troubles=[Trouble(0.0, SECONDS, delay=0.1875)], seed=0)
@example(troubles=[Trouble(0.181, 0.081, delay=0.032, lost=1.0), Trouble(0.288, 0.188, 0.143, LATEST, 0.1)], seed=44)
@example(
    troubles=[
        Trouble(0.0928, 0.164, 0.1407, 2.0e-3, lost=1.0),
        Trouble(0.628, 0.097, is_bunched=True),
        Trouble(0.0025, 0.0983, is_bunched=True),
    ],
    seed=29,
)
def test_a_constant_force_makes_the_peak_hardly_larger_than_none(
    motion: str, force: float, is_known_ahead: bool, troubles: list[Trouble], seed: int
) -> None:
    """Of 2 N, which is less than the friction, nothing is held; of 6 N the load is."""
    axis = _loaded(motion, force)
    error = largest_error(axis, SECONDS, troubles, is_known_ahead=is_known_ahead, seed=seed)
    bound = SHARPER_HELD if abs(force) > axis.friction.static_force else SHARPER
    assert error <= bound * _loaded_without(motion, force)


@pytest.mark.parametrize("is_known_ahead", [False, True])
@settings(max_examples=10, deadline=None)
@given(troubles=_troubles(LOADED_SECONDS, has_silence=True), seed=st.integers(0, 1000))
def test_the_joint_under_gravity_has_a_peak_hardly_larger_than_none(
    is_known_ahead: bool, troubles: list[Trouble], seed: int
) -> None:
    assert _joint_error(troubles, is_known_ahead, seed) <= SHARPER_HELD * _joint_without()


LOSSES_OF_THE_JOINT = [Trouble(1.0 + 0.25 * k, 0.12, lost=1.0) for k in range(8)]


def test_dropped_at_once_a_load_would_be_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check can fail: faded as friction is, the weight of the joint comes and goes in steps."""
    assert _joint_error(LOSSES_OF_THE_JOINT) <= _joint_without()
    monkeypatch.setattr(late_network, "due_forces", _all_as_friction)
    assert _joint_error(LOSSES_OF_THE_JOINT) > 1.1 * _joint_without()


def _all_as_friction(axis: AxisSettings, period: float) -> DueForces:
    """Return what applies the compensation as if it held no load."""
    return DueForces(axis.compensation.look_ahead, axis.compensation.timeout, period, 0.5 * period)


@pytest.mark.parametrize("motion", ["sine", "move"])
@settings(max_examples=10, deadline=None)
@given(
    troubles=st.lists(
        st.builds(
            Trouble,
            begin=st.integers(0, 1).map(lambda place: 0.2 + 0.25 * place),
            length=st.floats(0.0, LATEST),
            is_bunched=st.just(True),
        ),
        min_size=1,
        max_size=2,
        unique_by=lambda trouble: trouble.begin,
    )
)
def test_bunches_of_a_fifth_of_a_second_do_not_reach_the_axis(motion: str, troubles: list[Trouble]) -> None:
    """All that is sent within 0.2 s comes together at the end, while the horizon before it reaches."""
    assert largest_error(_axis(motion), SECONDS, troubles, is_known_ahead=True) < 0.5 * _without(motion)


def test_delays_below_the_look_ahead_change_nothing_at_all() -> None:
    quiet = largest_error(_axis("sine"), SECONDS, is_known_ahead=True)
    late = [Trouble(0.2, 0.3, delay=5e-3), Trouble(0.6, 0.1, delay=13e-3)]
    assert largest_error(_axis("sine"), SECONDS, late, is_known_ahead=True) == quiet


def test_an_overtaken_message_does_not_take_the_place_of_a_newer_one() -> None:
    """All that was sent in 50 ms comes 0.18 s later, between newer messages."""
    late = [Trouble(0.18, 0.05, delay=0.177)]
    assert largest_error(_axis("sine"), SECONDS, late) < 0.9 * _without("sine")


def test_held_over_a_reversal_it_would_be_worse(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check can fail: the same messages, applied as they come, make the largest error larger."""
    late = [Trouble(0.0, SECONDS, delay=0.03)]
    monkeypatch.setattr(DueForces, "_single", _as_it_comes)
    assert largest_error(_axis("sine"), SECONDS, late) > 1.2 * _without("sine")


def _as_it_comes(due: DueForces, stamp: int) -> float:
    """Return the latest value that came [N]."""
    while due._waiting and due._waiting[0][0] <= stamp:
        due._due_ns, due._force = due._waiting.popleft()
    return due._force
