"""Faults that blind cases and the plainest use have shown, each by itself."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from workflow_case import AXIS, FRICTION, PERIOD, evaluation_of, record

from sgms_observer.diagnosis.candidates import Candidate, finish_fit, first_fit
from sgms_observer.diagnosis.contact import element_friction
from sgms_observer.diagnosis.decision import decide, range_tests
from sgms_observer.diagnosis.evaluation import evidence_of
from sgms_observer.diagnosis.fit import Freedom, RefitSetup, refit
from sgms_observer.diagnosis.model import COULOMB, STATIC, STRIBECK_VELOCITY, Model, compensated_for_hold, predict
from sgms_observer.diagnosis.motion import fast_length, motion_of
from sgms_observer.diagnosis.ranges import plausible_range
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.diagnosis.sliding_force import start_logs, total_force_logs
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.formulas.effects import flexible_mode_next
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings

MODEL = Model.of(AXIS)


def test_each_way_has_its_own_level_and_flicker_at_rest_stays_at_one() -> None:
    sides = (1.2, 0.8)
    travel = np.concatenate([np.full(400, 2e-6), np.full(800, -2e-6)])
    level = np.full(len(travel), 4.0)
    friction, _ = element_friction(FRICTION, np.zeros(len(travel)), travel, PERIOD, level, sides)
    assert friction[399] == pytest.approx(4.8, rel=0.03)
    assert friction[-1] == pytest.approx(-3.2, rel=0.03)
    flicker = np.concatenate([np.full(400, 2e-6), np.tile([-1e-9, 1e-9], 1000)])
    friction, _ = element_friction(FRICTION, np.zeros(len(flicker)), flicker, PERIOD, np.full(len(flicker), 4.0), sides)
    assert friction[-1] == pytest.approx(friction[399], rel=0.04)  # what S-GMS itself loses


def test_a_sharp_contact_has_the_level_of_now_and_loses_nothing_to_and_fro() -> None:
    travel = np.full(600, 2e-7)
    level = np.where(np.arange(600) < 500, 4.0, 3.0)
    sharp, _ = element_friction(FRICTION, np.zeros(600), travel, PERIOD, level, (1.0, 1.0), True)
    slow, _ = element_friction(FRICTION, np.zeros(600), travel, PERIOD, level)
    assert sharp[500] == pytest.approx(3.0, rel=0.03)
    assert slow[500] > 3.3
    flicker = np.concatenate([np.full(400, 2e-6), np.tile([-1e-8, 1e-8], 3000)])
    level = np.full(len(flicker), 4.0)
    sharp, _ = element_friction(FRICTION, np.zeros(len(flicker)), flicker, PERIOD, level, (1.0, 1.0), True)
    assert sharp[-1] == pytest.approx(sharp[401], abs=1e-9)


def test_offset_and_asymmetric_coulomb_are_told_apart_after_the_full_refit() -> None:
    for name, value in (("offset", 0.6), ("asymmetric_coulomb", 0.15)):
        hidden = EffectSettings(name, (value,))
        motion = motion_of(record((hidden,)))
        data = data_with_own_noise((motion,), MODEL)
        before = refit(data, MODEL, 0.05)
        columns = Screen(data, before, 0.05, Freedom(), ()).nominal_columns
        setup = RefitSetup(data, MODEL, 0.05)
        taken = {}
        for start in (EffectSettings("offset", (0.5,)), EffectSettings("asymmetric_coulomb", (0.1,))):
            taken[start.name] = finish_fit(setup, first_fit(setup, before, start, columns))
        best = min(taken, key=lambda key: taken[key].cost)
        assert best == name
        assert taken[best].effects[0].values[0] == pytest.approx(value, rel=0.05)


def test_a_small_value_of_a_parameter_with_a_wide_range_is_not_at_its_end() -> None:
    travel = float(np.sum(np.abs(np.diff(motion_of(record()).position))))
    wear = EffectSettings("wear_step", (0.2, 0.5 * travel, 0.02 * travel))
    motion = motion_of(record((wear,)))
    data = data_with_own_noise((motion,), MODEL)
    before = refit(data, MODEL, 0.05)
    columns = Screen(data, before, 0.05, Freedom(), ()).nominal_columns
    assert 0.02 * travel < 1e-9 * 1e7  # the width lies within a billionth of its range from zero
    setup = RefitSetup(data, MODEL, 0.05)
    found = Candidate("wear_step", setup, first_fit(setup, before, wear, columns), 1)
    (test,) = range_tests(found)
    assert test.passed and test.value == 0.0


def test_a_spring_does_not_rest_far_outside_the_stroke() -> None:
    motion = motion_of(record(duration=6.0))
    low, high = plausible_range("spring", "rest_position", (motion,), MODEL)
    stroke = np.ptp(motion.position)
    assert high - low == pytest.approx(2.0 * stroke)


def test_a_missing_element_is_part_of_the_level_its_owner_measured() -> None:
    logs = np.zeros(len(MODEL.parameter_names()))
    logs[[COULOMB, STATIC]] = np.log([0.8, 0.84])
    seen = total_force_logs(logs, MODEL, (EffectSettings("presliding", (0.8, 1e-4)),))
    assert seen[[COULOMB, STATIC]] == pytest.approx(0.0, abs=1e-9)
    assert np.array_equal(total_force_logs(logs, MODEL, ()), logs)


def test_a_load_behind_play_takes_its_share_of_the_level_its_owner_measured() -> None:
    start = EffectSettings("backlash", (4e-5, 0.2, 2e-6))
    moved = start_logs(np.zeros(len(MODEL.parameter_names())), MODEL, start)
    assert np.exp(moved[[COULOMB, STATIC]]) == pytest.approx(0.8)
    assert total_force_logs(moved, MODEL, (start,)) == pytest.approx(0.0, abs=1e-12)


def test_missing_elements_remember_a_large_motion_through_small_ones() -> None:
    position = np.concatenate([np.linspace(0.0, 4e-4, 300), 4e-4 - 1e-5 * np.sin(np.linspace(0.0, 120.0, 3000))])
    motion = motion_of(Recording("test", PERIOD, position, np.zeros(len(position))))
    with_it = MODEL.with_effects([EffectSettings("presliding", (1.0, 1e-4))])
    force = predict(MODEL, motion).residual - predict(with_it, motion).residual
    assert force[310] == pytest.approx(1.0, abs=0.25)
    assert np.mean(force[-400:]) == pytest.approx(np.mean(force[400:800]), abs=0.05)


def test_a_name_needs_its_share_of_the_gap() -> None:
    hidden = EffectSettings("offset", (0.6,))
    motion = motion_of(record((hidden,), duration=8.0))
    truth = MODEL.with_effects([hidden])
    evaluation = evaluation_of((motion,), truth)
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    plain = setup.fit(())
    earlier = evidence_of(plain, evaluation)
    shares, outcomes = {}, {}
    for force in (0.6, 0.3, 0.005):
        effects = (EffectSettings("offset", (force,)),)
        found = setup.fit(effects, None, [(0, 0)])  # it keeps its value
        tests = {
            test.name: test for test in decide(Candidate("offset", setup, found, 1), plain, earlier, evaluation).tests
        }
        share = tests["share of the closable squared gap"]
        shares[force], outcomes[force] = share.value, share.passed
    assert shares[0.6] == pytest.approx(1.0, abs=0.1)
    assert shares[0.6] > shares[0.3] > shares[0.005]
    assert outcomes == {0.6: True, 0.3: True, 0.005: False}


def test_residuals_have_a_length_that_transforms_fast() -> None:
    for count in (7450, 12993, 4999):
        found = fast_length(count)
        assert 0.97 * count < found <= count
        for prime in (2, 3, 5, 7, 11):
            while found % prime == 0:
                found //= prime
        assert found == 1


def test_a_ringing_mass_is_driven_as_by_the_acceleration_itself() -> None:
    values = EffectSettings("flexible_mode", (0.5, 48.0, 0.03))
    omega, ratio = 2.0 * np.pi * values.values[1], values.values[2]

    def rate(t: float, s: np.ndarray) -> list[float]:
        return [s[1], -np.sin(omega * t) - 2.0 * ratio * omega * s[1] - omega**2 * s[0]]

    t = PERIOD * np.arange(400)
    exact = solve_ivp(rate, (0.0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-10, atol=1e-14).y[0]
    far = {}
    for name, drive in (("weighted", compensated_for_hold(np.sin(omega * t))), ("end", np.sin(omega * t))):
        state, seen = (0.0, 0.0), []
        for a in drive:
            state = flexible_mode_next(a, PERIOD, state, values.values)
            seen.append(state[0])
        far[name] = np.abs(np.array(seen) - exact).max() / np.abs(exact).max()
    assert far["weighted"] < 2e-3
    assert far["end"] > 0.1


def test_a_missing_element_is_found_where_the_others_have_bent_to_stand_in_for_it() -> None:
    fine, motion = MODEL.with_split_elements(), motion_of(record((EffectSettings("presliding", (1.6, 3e-5)),)))
    data = data_with_own_noise((motion,), fine)
    shifted_fit = refit(data, fine, 0.05)
    data = data_with_own_noise((motion,), shifted_fit.model)
    assert np.abs(shifted_fit.logs[STRIBECK_VELOCITY + 1 :]).max() > 0.5
    columns = Screen(data, shifted_fit, 0.05, Freedom(), ()).nominal_columns
    setup = RefitSetup(data, fine, 0.05)
    found = finish_fit(setup, first_fit(setup, shifted_fit, EffectSettings("presliding", (0.6, 2e-4)), columns))
    assert found.effects[0].values == pytest.approx((1.6, 3e-5), rel=0.25)
