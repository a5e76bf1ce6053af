"""A force from outside does not repeat: no model predicts it, but the answer tells of it."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import workflow_case
from workflow_case import AXIS, record

from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.report import sentence
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings

Force = Callable[[int, np.random.Generator], np.ndarray]
PERIOD = 1.0 / 250.0
OPTIONS = Options(workers=1, band=25.0)
LAW = EffectSettings("frictional_lag", (20.0, 5.0e-6))


def blows(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return short blows of 3 N in both directions at random times [N]."""
    force = np.zeros(count)
    for start in rng.integers(0, count, count // 500):
        force[start : start + 12] += rng.choice([-3.0, 3.0])
    return force


def wandering(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return a force of 0.5 N rms that wanders within seconds [N]."""
    force = np.convolve(rng.standard_normal(count), np.hanning(250), mode="same")
    return np.asarray(0.5 * force / np.std(force))


def nothing(count: int, rng: np.random.Generator) -> np.ndarray:
    """Return no force [N]."""
    return np.zeros(count)


def answered(force: Force, effects: tuple[EffectSettings, ...] = ()) -> Answer:
    """Return the answer on two recordings, each with a force of its own on the stage."""
    pair = []
    for seed in (1, 2):
        made = record(effects, seed=seed, duration=16.0, period=PERIOD)
        outside = force(len(made.effort), np.random.default_rng([seed, 9]))
        pair.append(Recording(made.name, made.period, made.position, made.effort + outside))
    return answer_of(diagnose(pair[:1], pair[1:], AXIS, OPTIONS), AXIS, OPTIONS)


@pytest.fixture(autouse=True)
def few_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for a few effects, so that a run takes seconds."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "spring"))


@pytest.mark.parametrize(("force", "when"), [(blows, "at times"), (wandering, "all the time")])
def test_a_force_from_outside_is_told_and_has_no_name(force: Force, when: str) -> None:
    answer = answered(force)
    assert answer.verdict == "unknown_effect" and answer.remainder == "unknown"
    assert not answer.effects and not answer.learnt
    assert answer.disturbance is not None
    said = answer.disturbance.sentence(AXIS.units)
    assert f"acts {when}, and no recorded signal predicts it" in said
    assert said in sentence(answer, AXIS.units) and any(said in text for text in answer.warnings)
    assert answer.next_experiment is not None and "the same motion twice" in answer.next_experiment


def test_its_size_is_that_of_the_force() -> None:
    found = answered(wandering).disturbance
    assert found is not None and found.force == pytest.approx(0.5, rel=0.25)


@pytest.mark.parametrize("effects", [(), (LAW,)], ids=["nothing", "another contact law"])
def test_noise_and_another_contact_law_are_none(effects: tuple[EffectSettings, ...]) -> None:
    answer = answered(nothing, effects)
    assert answer.disturbance is None
    (noise,) = [test for test in answer.tests if test.name == "residual over noise, where the contact slides fast"]
    assert noise.passed and noise.value < 1.5


def test_an_encoder_that_is_quiet_at_rest_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the stage rests most of the time, the noise of the whole recording is less than that of the motion."""
    rich = workflow_case.rich_position

    def resting(duration: float, seed: int, period: float) -> np.ndarray:
        moving = np.diff(rich(0.2 * duration, seed, period), prepend=0.0)
        pieces = np.array_split(moving, 4)
        return np.cumsum(np.concatenate([np.concatenate((piece, np.zeros(4 * len(piece)))) for piece in pieces]))

    monkeypatch.setattr(workflow_case, "rich_position", resting)
    axis, step, pair = replace(AXIS, mass=200.0), 1.0e-6, []
    for seed in (1, 2):
        made = record(seed=seed, duration=40.0, period=PERIOD, mass=axis.mass)
        pair.append(replace(made, position=np.round(made.position / step) * step))
    answer = answer_of(diagnose(pair[:1], pair[1:], axis, OPTIONS), axis, OPTIONS)
    (noise,) = [test for test in answer.tests if test.name == "residual over noise, where the contact slides fast"]
    assert noise.passed and noise.value < 1.5


def test_halves_of_a_short_recording_have_the_noise_of_the_whole() -> None:
    """Without a held-out recording, halves are predicted. Those of 5 s are too short to be filtered on their own."""
    short = record(duration=5.0, period=PERIOD)
    answer = answer_of(diagnose([short], [], AXIS, OPTIONS), AXIS, OPTIONS)
    (noise,) = [test for test in answer.tests if test.name == "residual over noise, where the contact slides fast"]
    assert noise.passed and answer.disturbance is None


def test_it_stands_beside_a_name() -> None:
    answer = answered(wandering, (EffectSettings("offset", (1.5,)),))
    assert [item.settings.name for item in answer.effects] == ["offset"]
    assert answer.verdict == "effect_found" and answer.remainder == "unknown"


def test_where_hardly_anything_slides_nothing_is_told() -> None:
    still = record(duration=16.0, period=PERIOD, scale=1.0e-4)
    answer = answer_of(diagnose([still], [still], AXIS, OPTIONS), AXIS, OPTIONS)
    assert answer.verdict == "cannot_tell" and answer.disturbance is None
