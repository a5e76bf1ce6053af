"""Parts of the workflow by themselves."""

import numpy as np
import pytest
from workflow_case import AXIS, FRICTION, PERIOD, record

from sgms_observer.discrepancy.contact import element_friction
from sgms_observer.discrepancy.fit import judged_with, refit
from sgms_observer.discrepancy.model import Model, predict
from sgms_observer.discrepancy.motion import grid_of, motion_of, without_flicker
from sgms_observer.discrepancy.name import Candidate, alternatives
from sgms_observer.discrepancy.noise import LOWEST_CORNER, Noise, fit_noise
from sgms_observer.discrepancy.record import Record
from sgms_observer.discrepancy.screen import Screen
from sgms_observer.discrepancy.tolerance import named_deviation
from sgms_observer.discrepancy.twins import calibrate, coloured
from sgms_observer.errors import DataError
from sgms_observer.settings.axis import EffectSettings


def test_grid_is_read_off_the_position() -> None:
    smooth = 1e-3 * np.sin(np.linspace(0.0, 20.0, 5000))
    assert grid_of(smooth) == 0.0
    assert grid_of(np.round(smooth / 2.5e-8) * 2.5e-8) == pytest.approx(2.5e-8, rel=1e-3)


def test_play_takes_flicker_off_and_nothing_else() -> None:
    flicker = np.tile([0.0, 1e-8], 50)
    assert np.ptp(without_flicker(flicker, 0.6e-8)[1:]) == 0.0  # settled after the first step
    travel = np.linspace(0.0, 1e-3, 1000)
    assert np.ptp(without_flicker(travel, 0.6e-8)) == pytest.approx(1e-3, rel=1e-4)


def test_a_short_or_slow_record_is_one_sentence() -> None:
    with pytest.raises(DataError, match="record at least 3 s"):
        motion_of(Record("tiny", PERIOD, np.zeros(1000), np.zeros(1000)))
    with pytest.raises(DataError, match="needs 100 Hz"):
        motion_of(Record("slow", 0.1, np.zeros(1000), np.zeros(1000)))


def test_element_friction_slides_at_its_level() -> None:
    n = 2000
    step = np.full(n, 2e-6)
    level = np.full(n, 4.0)
    friction, stiffness = element_friction(FRICTION, np.zeros(n), step, PERIOD, level)
    assert friction[-1] == pytest.approx(4.0, rel=0.03)
    assert stiffness[0] > 0.0 and stiffness[-1] == 0.0


def test_noise_is_found_again_and_whitens() -> None:
    truth = Noise(0.004, 1e-4, 25.0, 1e-5, 0.0)
    rng = np.random.default_rng(4)
    series = coloured(truth, 15000, 0.004, rng)
    found = fit_noise(series, np.zeros(len(series)), 0.004)
    assert found.rms == pytest.approx(truth.rms, rel=0.1)
    white = found.whitened(series, np.ones(len(series)))
    assert float(white @ white) / len(white) == pytest.approx(1.0, abs=0.15)
    assert found.corner >= LOWEST_CORNER


def test_refit_finds_parameters_within_tolerance() -> None:
    motion = motion_of(record())
    model = Model(5.0 * 1.04, FRICTION)
    judged = judged_with((motion,), model)
    found = refit(judged, model, 0.05, iterations=5)
    assert found.model.mass == pytest.approx(5.0, rel=0.01)
    assert found.model.friction.coulomb_force == pytest.approx(4.0, rel=0.01)


def test_first_look_ranks_the_true_effect_first_and_twins_do_not_alarm() -> None:
    hidden = EffectSettings("spring", (20.0, 0.0))
    motion = motion_of(record((hidden,)))
    model = Model.of(AXIS)
    judged = judged_with((motion,), model)
    found = refit(judged, model, 0.05, iterations=4)
    screen = Screen(judged, found, 0.05, ("spring", "quadratic_drag", "stribeck", "thermal_drift"))
    gains = screen.gains()
    assert max(gains, key=lambda name: gains[name][0]) == "spring"
    calibration = calibrate(screen, 1, 2)
    assert calibration.standardised("spring", gains["spring"][0]) > 10.0 * calibration.largest.max()
    again = calibrate(screen, 1, 1)
    assert np.array_equal(calibration.largest, again.largest)  # whatever the number of workers


def test_mass_and_gain_are_named_from_the_parameters() -> None:
    model = Model.of(AXIS)
    motion = motion_of(record(mass=5.0))
    judged = judged_with((motion,), model)
    plain = refit(judged, model, 0.05, iterations=3)
    assert named_deviation(model, plain, 0.05) is None
    heavy = Model(4.4, FRICTION)
    deviation = named_deviation(heavy, refit(judged, heavy, 0.05, iterations=5), 0.05)
    assert deviation is not None and deviation.name == "mass_error"
    assert deviation.value == pytest.approx(0.6, rel=0.1)
    logs = np.zeros(len(heavy.parameter_names()))
    logs[:4] = np.log(1.0 / 0.85)
    weak = model.shifted(-logs)
    deviation = named_deviation(weak, refit(judged, weak, 0.05, iterations=6), 0.05)
    assert deviation is not None and deviation.name == "actuator_gain"
    assert deviation.value == pytest.approx(0.85, abs=0.03)


def test_alternatives_need_to_come_close() -> None:
    motion = motion_of(record(duration=6.0))
    model = Model.of(AXIS)
    any_fit = refit(judged_with((motion,), model), model, 0.05, iterations=0)
    taken = {
        "offset": 1000.0,
        "cogging": 995.0,
        "asymmetric_coulomb": 970.0,
        "quadratic_drag": 970.0,
        "stribeck": 700.0,
    }
    listed = [Candidate(name, any_fit, value, ()) for name, value in taken.items()]
    assert alternatives(listed, 0.0) == ("cogging", "asymmetric_coulomb")  # the second is easily taken for an offset
    assert alternatives(listed, 1000.0) == ("cogging", "asymmetric_coulomb", "quadratic_drag")
    at_end = [listed[0], Candidate("asymmetric_coulomb", any_fit, 999.0, ("share",))]
    assert alternatives(at_end, 0.0) == ()


def test_residual_of_the_truth_is_noise() -> None:
    motion = motion_of(record())
    residual = motion.low_pass(predict(Model.of(AXIS), motion).residual)
    assert float(np.std(residual)) < 0.02 * FRICTION.coulomb_force
