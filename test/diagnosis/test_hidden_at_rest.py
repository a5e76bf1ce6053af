"""At rest an encoder's grid hides how far the contact went back: what the effort does there says nothing of a model."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from workflow_case import AXIS, evaluation_of, record, rich_position

from sgms_observer.diagnosis.answer import verdict_of
from sgms_observer.diagnosis.candidates import Candidate, finish_fit, with_free_effect
from sgms_observer.diagnosis.criteria import at_least, at_most
from sgms_observer.diagnosis.decision import hidden_contact_tests
from sgms_observer.diagnosis.diagnosis import Options, accepted_candidates
from sgms_observer.diagnosis.evaluation import evidence_of
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.fit import RefitSetup
from sgms_observer.diagnosis.gap import residuals, rms, weighted
from sgms_observer.diagnosis.map_fit import FittedMap
from sgms_observer.diagnosis.model import (
    Model,
    friction_drop_after_reversal,
    hidden_by_encoder,
    most_hidden_friction_drop,
)
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.diagnosis.noise import UnknownFriction, fit_noise, largest_noise
from sgms_observer.diagnosis.whitened import data_with_noise_of, data_with_own_noise
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings, EncoderSettings, StageSettings

COGGING = EffectSettings("cogging", (0.8, 0.011, 0.4, 0.0, 0.0))
OFFSET = EffectSettings("offset", (1.0,))
MODEL = Model.of(AXIS)
COARSE = 2.0e-6  # m; the force falls by 80 % of the Coulomb force when the contact goes back by as much
SECONDS = 18.0
STEP = 1.0e-6  # m; encoder step of a creeping stage
MEMORY = 0.2  # s in which the effort at rest falls, as an integrator lets it


def resting(step: float, is_released: bool) -> Motion:
    """Return a motion with rests on an encoder, in which a ripple is hidden; its effort may fall while it rests."""
    found = record((COGGING,), duration=SECONDS)
    position, effort = rich_position(SECONDS, seed=1), found.effort.copy()
    if is_released:
        moves = np.abs(np.gradient(position, found.period)) > 1.0e-6
        rested = np.arange(len(position)) - np.maximum.accumulate(np.where(moves, np.arange(len(position)), 0))
        effort *= 0.3 + 0.7 * np.exp(-rested * found.period / MEMORY)
    position = np.round(position / step) * step
    return motion_of(Recording("resting", found.period, position, effort, recorded_step=step))


@pytest.mark.parametrize("is_released", [False, True])
def test_samples_at_rest_count_little_where_they_scatter(is_released: bool) -> None:
    """They do on a coarse grid, and on a fine one where the effort falls although the stage does not move."""
    motion = resting(COARSE, is_released=is_released)
    (weights,) = data_with_own_noise((motion,), MODEL).weights
    still, fast = (motion.thinned(one) for one in (motion.shows_no_motion, np.abs(motion.velocity) > 5.0e-3))
    assert 0.05 < np.mean(still) < 0.5
    assert np.median(weights[still]) < 0.5 * np.median(weights[fast])
    fine = resting(1.0e-11, is_released=is_released)
    assert fine.resolution == 1.0e-11 and np.any(fine.shows_no_motion)
    (weights,) = data_with_own_noise((fine,), MODEL).weights
    assert (np.median(weights[fine.thinned(fine.shows_no_motion)]) > 0.5) is not is_released


def creeping(rate: float, period: float = 0.001, rest: float = 0.5) -> Motion:
    """Return a motion that slides for four seconds, rests, creeps for three at a rate [encoder steps/s], and slides."""
    time = np.arange(0.0, 11.0, period)
    creeps = (time > 4.0) & (time < 7.0)
    speed = np.where(creeps, np.where(time > 4.0 + rest, rate * STEP, 0.0), 0.02 * np.sin(np.pi * time))
    position = np.round(np.cumsum(speed) * period / STEP) * STEP
    return motion_of(Recording("creeping", period, position, np.sign(speed)))


@pytest.mark.parametrize(("period", "corner"), [(0.001, 250.0), (0.002, 175.0), (0.004, 87.5)])
@pytest.mark.parametrize(("share", "is_hidden"), [(0.0, True), (0.2, True), (0.6, True), (2.0, False)])
def test_an_encoder_hides_reversals_of_a_stage_that_creeps_out_of_a_rest(
    share: float, is_hidden: bool, period: float, corner: float
) -> None:
    """In creep of a step per period of the low-pass the force of a stage may fall although it moves forward."""
    motion = creeping(share * corner, period)
    creeps = (motion.time > 4.7) & (motion.time < 6.8)
    assert np.mean(motion.hidden_periods[creeps] > 0.0) == pytest.approx(float(is_hidden), abs=0.1)
    assert not np.any(motion.hidden_periods[np.abs(motion.velocity) > 0.015])


@pytest.mark.parametrize("rate", [150.0, 200.0])
def test_a_slow_scan_without_a_rest_counts_in_full(rate: float) -> None:
    motion = creeping(rate, rest=0.0)
    scans = (motion.time > 4.2) & (motion.time < 6.8)
    assert not np.any(motion.shows_no_motion[scans]) and not np.any(motion.hidden_periods[scans])


def test_reversals_add_up_while_they_are_hidden() -> None:
    motion = creeping(0.0)
    first, last = (int(np.searchsorted(motion.time, at)) for at in (4.1, 6.9))
    lasted = motion.hidden_periods[last] - motion.hidden_periods[first]
    assert lasted == pytest.approx(2.8 * 250.0)
    friction = MODEL.friction
    one = friction_drop_after_reversal(friction, 1.2 * STEP)
    most = most_hidden_friction_drop(friction, motion)
    assert most[first] == pytest.approx(min(one * motion.hidden_periods[first], 2.0 * friction.static_force))
    assert np.all(most[motion.hidden_periods == 0.0] == 0.0) and np.max(most) <= 2.0 * friction.static_force


@pytest.mark.parametrize("weight", ["measured", "1", "most"])
def test_samples_in_which_reversals_are_hidden_count_as_much_less_as_they_scatter_more(weight: str) -> None:
    """Several reversals add up to more than one of them, and at most to all of them."""
    rng = np.random.default_rng(1)
    count, place = 8000, np.arange(8000) % 800
    there = place >= 400
    residual = np.where(there, 0.08 * (-1.0) ** (np.arange(count) // 800), 0.0) + 0.05 * rng.standard_normal(count)
    most = np.where(there, {"measured": 1.0, "1": 0.0, "most": 0.01}[weight], 0.0) ** 2
    unknown = UnknownFriction(there * 1.0, np.zeros(count), most)
    noise = fit_noise(residual, unknown, 0.005, 50.0)
    weights = noise.weights(replace(unknown, stick_indicator=np.zeros(count)))  # what the encoder hides alone
    assert np.all(weights[(place > 50) & (place < 350)] == 1.0)
    averaged = 0.05 / np.sqrt(10.0)  # rms of the noise over the averaging time; its median is 0.67 of that
    expected = {"measured": 0.67 * averaged / 0.08, "1": 1.0, "most": 1.0 / np.hypot(1.0, 0.01 / averaged)}[weight]
    assert np.median(weights[place == 600]) == pytest.approx(expected, rel=0.25)


def test_a_short_rest_tells_no_variance() -> None:
    rng = np.random.default_rng(1)
    there = (np.arange(4000) > 2000) & (np.arange(4000) < 2040)
    residual = rng.standard_normal(4000) + 9.0 * there
    unknown = UnknownFriction(there * 1.0, np.zeros(4000), there * 1.0)
    assert fit_noise(residual, unknown, 0.005, 50.0).rest_variance == 0.0


def test_what_is_judged_has_the_variances_of_any_recording_that_shows_them() -> None:
    rests, moves = resting(COARSE, is_released=True), creeping(0.0)
    loud = replace(moves, effort=moves.effort + 5.0 * np.random.default_rng(1).standard_normal(len(moves.effort)))
    data = data_with_own_noise((rests, loud), MODEL)
    assert largest_noise(data.noise) is data.noise[1] and data.noise[0].rest_variance > data.noise[1].rest_variance
    assert data_with_noise_of((rests,), data, MODEL).noise[0].rest_variance == data.noise[0].rest_variance


def test_the_rests_of_a_recording_tell_what_recordings_without_rests_do_not() -> None:
    """Fitted recordings that hardly rest leave the rests of a held-out one their full weight otherwise."""
    rests, moves = resting(COARSE, is_released=True), resting(1.0e-11, is_released=False)
    data, own = data_with_own_noise((moves,), MODEL), data_with_own_noise((rests,), MODEL)
    assert data.noise[0].rest_variance < 0.1 * own.noise[0].rest_variance
    held_out = data_with_noise_of((rests,), data, MODEL)
    assert held_out.noise[0].rest_variance == own.noise[0].rest_variance
    assert held_out.noise[0].stick_variance == max(own.noise[0].stick_variance, data.noise[0].stick_variance)
    assert held_out.noise[0].rms == data.noise[0].rms
    still, fast = (rests.thinned(one) for one in (rests.shows_no_motion, np.abs(rests.velocity) > 5.0e-3))
    assert np.median(held_out.weights[0][still]) < 0.5 * np.median(held_out.weights[0][fast])


def test_the_fall_after_a_reversal_is_masings() -> None:
    friction = MODEL.friction
    whole = sum(friction.element_stiffness)
    assert friction_drop_after_reversal(friction, 1.0e-9) == pytest.approx(1.0e-9 * whole)
    assert friction_drop_after_reversal(friction, 1.0) == pytest.approx(2.0 * friction.static_force)
    # the stiffest element has slipped, the others have not
    reach = 2.0 * friction.element_fraction[0] * friction.static_force / friction.element_stiffness[0]
    after = reach * whole + reach * (whole - friction.element_stiffness[0])
    assert friction_drop_after_reversal(friction, 2.0 * reach) == pytest.approx(after)


def test_a_ripple_closes_the_gap_although_the_effort_falls_at_rest() -> None:
    motion = resting(COARSE, is_released=True)
    (weights,) = data_with_own_noise((motion,), MODEL).weights
    plain, rippled = (residuals(model, (motion,)) for model in (MODEL, MODEL.with_effects([COGGING])))
    alike = rms(rippled) / rms(plain)
    told = rms(weighted(rippled, (weights,))) / rms(weighted(plain, (weights,)))
    assert told**2 < 0.5 < alike**2  # more than half of the squared gap, or less


def test_an_encoder_hides_the_contact_from_half_a_reversal_on() -> None:
    friction = MODEL.friction
    step = 2.0 * friction.element_fraction[0] * friction.static_force / friction.element_stiffness[0]
    motion = replace(resting(COARSE, is_released=False), resolution=step)
    lost = step * sum(friction.element_stiffness) / friction.static_force
    assert hidden_by_encoder(friction, [motion, replace(motion, resolution=0.0)]) == pytest.approx(lost)


@pytest.mark.parametrize("step", [1.0e-8, 4.0e-6])
def test_what_a_contact_can_imitate_has_a_name_only_where_the_encoder_shows_the_contact(step: float) -> None:
    axis = replace(AXIS, stage=StageSettings(encoder=EncoderSettings(resolution=step)))
    hidden = (EffectSettings("offset", (1.0,)), EffectSettings("quadratic_drag", (100.0,)))
    recordings = [record(hidden, seed=seed, duration=12.0, period=0.004) for seed in (1, 2)]
    one, other = (replace(item, position=np.round(item.position / step) * step) for item in recordings)
    found = diagnose([one], [other], axis, Options(workers=1, band=25.0))
    is_shown = step == 1.0e-8
    names = [item.name for item in accepted_candidates(found.accepted)]
    assert names == (["offset", "quadratic_drag"] if is_shown else ["offset"])
    assert found.is_contact_hidden is not is_shown
    assert any("too coarse for the contact" in text for text in found.warnings) is not is_shown


@pytest.mark.parametrize(
    "hidden, name, is_listed",
    [((), "position_dependent_friction", False), ((COGGING,), "cogging", False), ((OFFSET,), "offset", True)],
)
def test_behind_a_coarse_encoder_an_effect_also_has_to_improve_another_contact_law(
    hidden: tuple[EffectSettings, ...], name: str, is_listed: bool
) -> None:
    """A smaller Coulomb force than that of the file is no friction that is smaller nearly everywhere.

    A file that lists the effect with no size changes nothing: the other contact law is fitted with that size.
    """
    learn, judge = (motion_of(record(hidden, seed=seed, duration=12.0, period=0.004)) for seed in (1, 2))
    friction = MODEL.friction
    file = replace(
        MODEL,
        friction=replace(
            friction, coulomb_force=1.3 * friction.coulomb_force, static_force=1.3 * friction.static_force
        ),
    )
    shown = evaluation_of([learn], MODEL.with_effects(hidden), [judge])
    listed = (EffectSettings(name, (0.0,)),) if is_listed else ()
    held = RefitSetup(shown.fit_data, file, 0.05, held_effects=frozenset(one.name for one in listed))
    held = replace(held, file_effects=listed)
    before = finish_fit(held, held.fit(listed))
    start = hidden[0] if hidden else EffectSettings(name, (-0.2, 0.0, 0.03))
    setup = with_free_effect(held, name)
    item = Candidate(name, setup, finish_fit(setup, setup.fit((start,), before.logs)), 1)
    assert improvement(evidence_of(before, shown).all, evidence_of(item.refit, shown).all).z_score > 3.0
    assert hidden_contact_tests(item, before, shown) == []
    (test,) = hidden_contact_tests(item, before, replace(shown, hidden_by_encoder=1.5))
    assert test.of == name and test.passed is bool(hidden)


@pytest.mark.parametrize(
    "is_hidden, is_learnt, verdict",
    [(True, False, "cannot_tell"), (True, True, "unknown_effect"), (False, False, "unknown_effect")],
)
def test_a_rest_that_a_hidden_contact_may_make_is_no_unknown_effect(
    is_hidden: bool, is_learnt: bool, verdict: str
) -> None:
    found: Any = SimpleNamespace(is_poor=False, is_contact_hidden=is_hidden)
    rest, whole = at_most("model", "rest", 1.0, 0.1), at_most("model", "whole", 0.1, 0.3)
    assert verdict_of(found, (), rest, is_learnt, whole, ()) == verdict


def test_a_rest_that_another_contact_law_may_make_is_no_unknown_effect() -> None:
    found: Any = SimpleNamespace(is_poor=False, is_contact_hidden=False)
    rest, whole = at_most("model", "rest", 1.0, 0.1), at_most("model", "whole", 0.1, 0.3)
    beyond = [
        at_least("model", "better than over the coordinates of a contact", z_score, 3.0) for z_score in (2.9, 3.1)
    ]
    verdicts = [verdict_of(found, (), rest, False, whole, (), [one]) for one in beyond]
    assert verdicts == ["cannot_tell", "unknown_effect"]
    assert verdict_of(found, (), rest, True, whole, (), [beyond[0]]) == "unknown_effect"  # a learnt map closes it


def test_a_map_over_the_coordinates_of_a_contact_may_be_the_hidden_contact() -> None:
    def is_of_contact(*coordinates: str) -> bool:
        return FittedMap(Mock(), coordinates, Mock(), 0.2, "a force", Mock()).is_of_contact

    def is_beyond(*coordinates: str, is_hidden: bool = False) -> bool:
        return FittedMap(Mock(), coordinates, Mock(), 0.2, "a force", Mock()).is_beyond_contact(is_hidden)

    assert is_beyond("position") and is_beyond("load", "direction") and is_beyond("position", is_hidden=True)
    assert not (is_beyond("velocity") or is_beyond("rest") or is_beyond("load", "direction", is_hidden=True))
    assert is_of_contact("load", "direction") and is_of_contact("velocity") and is_of_contact("rest", "direction")
    assert not is_of_contact("position", "direction") and not is_of_contact("time", "direction")
