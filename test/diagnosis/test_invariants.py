"""What must hold of every diagnosis, whatever recording and parameter file it is given."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from workflow_case import AXIS, record

from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.compensation_check import CompensationCheck
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.result import result_of
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.effects.catalogue import effect
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings

PERIOD = 1.0 / 250.0
SECONDS = 12.0
OPTIONS = Options(workers=1, band=25.0)
CRITERIA = Criteria()
SEARCHED = (
    "cogging", "spring", "offset", "asymmetric_coulomb", "stribeck", "quadratic_drag", "flexible_mode", "actuator_gain",
    "actuator_dead_zone", "actuator_saturation", "mass_error", "periodic_disturbance",
)  # fmt: skip
"""Effects that are looked for here: of every kind that once ended at a bound, beyond the data or above the rate."""
COGGING = EffectSettings("cogging", (0.6, 0.01, 0.3, 0.0, 0.0))
OFFSET = EffectSettings("offset", (0.6,))


@pytest.fixture(autouse=True)
def few_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for a dozen effects, so that a run takes seconds."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: SEARCHED)


def made(effects: tuple[EffectSettings, ...] = (), seed: int = 1) -> Recording:
    """Return a short recording at a low rate."""
    return record(effects, seed=seed, duration=SECONDS, period=PERIOD)


def answered(learn: Recording, axis: AxisSettings = AXIS, held: tuple[Recording, ...] = ()) -> Answer:
    """Return the answer on one recording."""
    return answer_of(diagnose([learn], held, axis, OPTIONS), axis, OPTIONS)


def check(answer: Answer, learn: Recording) -> None:
    """Hold an answer to the invariants.

    Args:
        answer: of a diagnosis.
        learn: the recording it learnt from.
    """
    result = result_of(answer, (CompensationCheck(1.0, 1.0), CompensationCheck(1.0, 1.0)), None, AXIS.units)
    json.loads(json.dumps(result, allow_nan=False))  # numbers that every reader of JSON knows
    gap = answer.gap
    named = [item for item in answer.effects if item.settings.name != "quantisation"]
    whole = next(test for test in answer.tests if test.name == "share of the effort that is unexplained")
    rest = next(test for test in answer.tests if test.name == "surely predictable share of the residual")
    if named:
        assert gap.after < gap.before
        (shrinks,) = [test for test in answer.tests if test.name == "gap of the written model: z-score"]
        assert shrinks.passed and shrinks.value >= CRITERIA.interval_z_score
        assert answer.verdict in ("effect_found", "ambiguous")
        for item in named:
            agrees = [
                test for test in answer.tests
                if test.of == item.settings.name and test.name == "strength over its scatter between recordings"
            ]  # fmt: skip
            assert agrees and all(test.passed for test in agrees)
    if answer.verdict == "no_effect":
        assert not named and rest.passed and whole.passed and answer.disturbance is None
    rate = 1.0 / learn.period
    most = float(np.max(np.abs(learn.effort)))
    for item in named:
        strengths = [
            (abs(value - parameter.default), error)
            for parameter, value, error in zip(
                effect(item.settings.name).parameters, item.settings.values, item.std_error, strict=True
            )
            if parameter.is_strength
        ]
        assert any(size >= CRITERIA.interval_z_score * error for size, error in strengths), "none of it is possible"
        for parameter, value in zip(effect(item.settings.name).parameters, item.settings.values, strict=True):
            assert math.isfinite(value)
            is_whole_range = parameter.unit == "rad" or value == parameter.default
            for end in (parameter.minimum, parameter.maximum):
                assert is_whole_range or not math.isfinite(end) or abs(value - end) > 1e-6 * abs(end)
            if parameter.name == "frequency":
                assert value <= CRITERIA.max_rate_share * rate
            if item.settings.name in ("actuator_dead_zone", "actuator_saturation") and parameter.unit == "N":
                assert value < most
            if parameter.name == "pitch":
                assert value < float(np.ptp(learn.position))
    is_unusable = gap.unweighted_after > 100.0 * CRITERIA.max_unexplained
    assert is_unusable == (not whole.passed) == any(text.startswith("unusable model: ") for text in answer.warnings)
    assert not (is_unusable and answer.usable)
    names = {(test["of"], test["name"]) for test in result["tests"]}
    for number in answer.diagnosis.rounds:
        for decision in number.decisions:
            assert decision.tests, "a hypothesis without a test"
            for test in number.tests_of(decision):
                assert math.isfinite(test.value) and math.isfinite(test.threshold)
                assert (test.of, test.name) in names
            if number.accepted is decision:
                assert decision.passed
                told = {test.name.rpartition(" ")[2] for test in number.tests_of(decision) if not test.passed}
                assert told == set(number.alternatives)
    assert 0.0 <= gap.noise <= gap.floor + 1e-9 <= gap.after + 2e-9
    if answer.verdict == "unknown_effect" and answer.disturbance is None:  # the same share in verdict and gap
        assert gap.predictable > 0.0
    if answer.verdict == "cannot_tell" and answer.diagnosis.is_poor:
        assert answer.warnings and not answer.usable and not named


def constant(source: Recording) -> Recording:
    """Return a recording in which nothing moves."""
    return replace(source, position=np.full(len(source), 0.01), effort=np.full(len(source), 1.0))


def still_position(source: Recording) -> Recording:
    """Return a recording whose encoder stands while the effort goes on."""
    return replace(source, position=np.full(len(source), 0.01))


def saturated(source: Recording) -> Recording:
    """Return a recording whose effort was cut off."""
    limit = 0.6 * float(np.max(np.abs(source.effort)))
    return replace(source, effort=np.clip(source.effort, -limit, limit))


def shuffled(source: Recording) -> Recording:
    """Return a recording whose efforts come in any order."""
    return replace(source, effort=np.random.default_rng(5).permutation(source.effort))


def mixed(source: Recording) -> Recording:
    """Return a recording of two machines, one after the other."""
    other = made((OFFSET, EffectSettings("spring", (60.0, 0.0))), seed=1)
    half = len(source) // 2
    return replace(source, effort=np.concatenate([source.effort[:half], 1.5 * other.effort[half:]]))


def noise(source: Recording) -> Recording:
    """Return a recording whose effort is noise."""
    return replace(source, effort=np.random.default_rng(6).normal(0.0, 3.0, len(source)))


def noise_all(source: Recording) -> Recording:
    """Return a recording that is noise altogether."""
    rng = np.random.default_rng(7)
    return replace(source, position=rng.normal(0.0, 1e-3, len(source)), effort=rng.normal(0.0, 3.0, len(source)))


@pytest.mark.parametrize(
    "spoil", [constant, still_position, saturated, shuffled, mixed, noise, noise_all], ids=lambda item: item.__name__
)
def test_a_recording_that_means_ill_gets_no_name_that_it_does_not_earn(spoil: Callable[[Recording], Recording]) -> None:
    learn = spoil(made((COGGING,)))
    answer = answered(learn)
    check(answer, learn)
    if spoil in (constant, still_position):
        assert answer.verdict == "cannot_tell" and not answer.usable
    if spoil in (shuffled, noise, noise_all):
        assert not answer.effects and answer.verdict in ("cannot_tell", "unknown_effect")
        assert not answer.usable


@pytest.mark.parametrize("effects", [(), (OFFSET,)])
def test_an_effort_of_the_wrong_sign_is_told_and_not_repaired(effects: tuple[EffectSettings, ...]) -> None:
    right = made(effects)
    learn = replace(right, effort=-right.effort)
    answer = answered(learn)
    check(answer, learn)
    assert answer.verdict == "cannot_tell" and not answer.usable
    assert any("effort_scale" in text for text in answer.warnings)
    assert not any("effort_scale" in text for text in diagnose([right], (), AXIS, OPTIONS).warnings)


@st.composite
def parameter_files(draw: st.DrawFn) -> AxisSettings:
    """Draw a parameter file: an owner's, near or far, with any number of elements and either model."""
    count = draw(st.integers(1, 4))
    factor = st.floats(-1.0, 1.0).map(lambda power: 3.0**power)
    near = st.floats(0.95, 1.05)
    friction = AXIS.friction
    coulomb = friction.coulomb_force * draw(st.one_of(near, factor))
    listed = draw(st.sampled_from([(), (OFFSET,), (EffectSettings("spring", (5.0, 0.0)),)]))
    return replace(
        AXIS,
        mass=AXIS.mass * draw(near),
        effects=listed,
        friction=replace(
            friction,
            model=draw(st.sampled_from(["sgms", "gms"])),
            element_stiffness=tuple(3.0e6 * draw(factor) / 2.0**i for i in range(count)),
            element_fraction=(1.0 / count,) * count,
            element_damping=(0.0,) * count,
            viscous_coefficient=friction.viscous_coefficient * draw(factor),
            coulomb_force=coulomb,
            static_force=coulomb * draw(st.floats(1.0, 1.4)),
        ),
    )


@settings(
    max_examples=5,
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(parameter_files(), st.sampled_from([(), (COGGING,), (OFFSET,)]), st.integers(0, 99), st.booleans())
def test_any_file_and_any_recording(
    axis: AxisSettings, hidden: tuple[EffectSettings, ...], seed: int, has_held_out: bool
) -> None:
    learn = made(hidden, seed=seed)
    held = (made(hidden, seed=seed + 1),) if has_held_out else ()
    answer = answered(learn, axis, held)
    check(answer, learn)
    assert answer.gap.held_out == ("held-out" if has_held_out else "cross-validated")
    if not has_held_out:
        assert all(item.confidence <= 0.9 for item in answer.effects if item.settings.name != "quantisation")
