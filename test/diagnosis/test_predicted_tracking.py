"""The tracking error predicted beside a diagnosis is the one that the loop then has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.diagnose import predict_tracking
from sgms_observer.diagnosis.compensation_check import check_compensation
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.evidence import improvement
from sgms_observer.diagnosis.tracking import MAX_RATIO, PredictedTracking, TrackingError
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.units import Units
from sim_plant.record import StageRecord
from sim_plant.stage import SimulatedStage

CONFIG = Path(__file__).parents[2] / "config" / "compensation.yaml"
PERIOD = 1.0e-3
COUNT = 4000
BAND = 100.0
BLOCK = Criteria().block
COGGING = EffectSettings("cogging", (1.0, 2.0e-4, 0.3, 0.0, 0.0))


def _given() -> AxisSettings:
    """Return an axis whose file does not know of the stage's cogging."""
    axis = load_settings(CONFIG).axes[0]
    return replace(
        axis,
        filter=replace(axis.filter, window=9.0e-3),
        estimator=replace(axis.estimator, correction_every=2),
        compensation=replace(axis.compensation, enabled=False, look_ahead=1.5 * PERIOD),
        stage_friction=axis.friction,
        stage_effects=(COGGING,),
    )


def _augmented(axis: AxisSettings) -> AxisSettings:
    return replace(axis, effects=(COGGING,))


def _recorded(axis: AxisSettings, has_reference: bool = True) -> tuple[Recording, StageRecord]:
    """Return what a bag of the stage holds, and the truth."""
    run = SimulatedStage(axis, PERIOD).step(COUNT)
    samples = run.samples
    reference = samples.reference_position if has_reference else np.full(COUNT, np.nan)
    return Recording("simulated", PERIOD, samples.position, samples.effort, reference), run


def _in_the_loop(axis: AxisSettings) -> TrackingError:
    """Return the tracking error of the stage with the observer in the loop."""
    observer = AxisObserver(replace(axis, compensation=replace(axis.compensation, enabled=True)), PERIOD)
    run, _ = SimulatedStage(axis, PERIOD).step_answered(COUNT, lambda one: float(observer.step(one).compensation[-1]))
    return TrackingError.of((run.position - run.reference_position)[500:])


def test_the_prediction_is_what_the_loop_does() -> None:
    given = _given()
    record, _ = _recorded(given)
    predicted = predict_tracking(record, given, _augmented(given), BAND)
    assert predicted is not None and predicted.recorded is not None
    assert predicted.without.rms == pytest.approx(predicted.recorded.rms, rel=0.1)
    for found, axis in ((predicted.given, given), (predicted.augmented, _augmented(given))):
        real = _in_the_loop(axis)
        assert found.rms == pytest.approx(real.rms, rel=0.15)
        assert found.peak == pytest.approx(real.peak, rel=0.2)
    assert predicted.augmented.rms < 0.6 * predicted.given.rms < 0.6 * predicted.without.rms
    assert predicted.caution(Units()) == ""


def _with_bandwidth(axis: AxisSettings, bandwidth: float) -> AxisSettings:
    """Return the axis with another controller in its file."""
    return replace(axis, stage=replace(axis.stage, controller=replace(axis.stage.controller, bandwidth=bandwidth)))


@pytest.mark.parametrize(("share", "mass_in_file"), [(1.0, 1.0), (0.0, 1.0), (1.0, 0.7)])
def test_the_controller_is_the_one_that_the_recording_shows(share: float, mass_in_file: float) -> None:
    """The machine damps the tracking error, or the measured velocity alone as cascaded loops do."""
    given = _given()
    stage, controller = SimulatedStage(given, PERIOD), given.stage.controller
    gain = 2.0 * controller.damping_ratio * 2.0 * np.pi * controller.bandwidth * given.mass
    plain = SimulatedStage(given, PERIOD).step(COUNT).samples.reference_position
    run = stage.step(COUNT, (share - 1.0) * gain * np.gradient(plain, PERIOD))
    samples = run.samples
    record = Recording("simulated", PERIOD, samples.position, samples.effort, samples.reference_position)
    file = replace(_with_bandwidth(given, 40.0), mass=mass_in_file * given.mass)
    predicted = predict_tracking(record, file, _augmented(given), BAND)
    assert predicted is not None and predicted.recorded is not None and predicted.controller is not None
    found = predicted.controller.settings
    assert found.bandwidth == pytest.approx(controller.bandwidth, rel=0.15)
    assert found.damping_ratio == pytest.approx(controller.damping_ratio, rel=0.3)
    assert predicted.without.rms == pytest.approx(predicted.recorded.rms, rel=0.1)
    assert predicted.caution(Units()) == ""
    assert "the controller that the recording shows (bandwidth " in predicted.sentence(Units())


def test_a_controller_that_the_recording_does_not_show_is_reported() -> None:
    """The effort holds a compensation that no linear controller makes."""
    given = _given()
    observer = AxisObserver(replace(_augmented(given), compensation=replace(given.compensation, enabled=True)), PERIOD)
    run, _ = SimulatedStage(given, PERIOD).step_answered(COUNT, lambda one: float(observer.step(one).compensation[-1]))
    samples = run.samples
    record = Recording("simulated", PERIOD, samples.position, samples.effort, samples.reference_position)
    predicted = predict_tracking(record, _with_bandwidth(given, 40.0), _augmented(given), BAND)
    assert predicted is not None and predicted.controller is None
    assert "stage.controller of the file is not the controller of the recording" in predicted.caution(Units())


def test_the_stage_can_give_every_effort_that_was_recorded() -> None:
    """A file without a limit of the actuator has the default, which is nothing to a heavy machine."""
    given = _given()
    record, _ = _recorded(given)
    controller = replace(given.stage.controller, effort_limit=0.2 * float(np.max(np.abs(record.effort))))
    weak = replace(given, stage=replace(given.stage, controller=controller))
    for file in (weak, _with_bandwidth(weak, 40.0)):  # with the controller of the file, and with the recorded one
        predicted = predict_tracking(record, file, _augmented(given), BAND)
        assert predicted is not None and predicted.recorded is not None
        assert predicted.without.rms == pytest.approx(predicted.recorded.rms, rel=0.15)


@pytest.mark.parametrize(("limit", "fade_std"), [(0.1, 1.0e3), (2.0, 1.0e-3), (2.0, 1.0e3)])
def test_a_compensation_that_is_held_back_is_told(limit: float, fade_std: float) -> None:
    """Limits that fit another machine make its compensation small: both times in the static force."""
    given, record = _given(), _recorded(_given())[0]
    static = given.friction.static_force
    held = replace(given.compensation, limit=limit * static, fade_std=fade_std * static)
    limited = _augmented(replace(given, compensation=held))
    predicted = predict_tracking(record, limited, limited, BAND)
    assert predicted is not None
    is_whole = limit > 1.0 and fade_std > 1.0
    assert 0.8 < predicted.compensated_share < 1.2 if is_whole else predicted.compensated_share < 0.3
    share = f"gives {100.0 * predicted.compensated_share:.2g} % of the friction"
    assert share in predicted.limits_sentence(held, Units())


def test_without_a_reference_the_measured_motion_is_followed() -> None:
    given = _given()
    record, _ = _recorded(given, has_reference=False)
    predicted = predict_tracking(record, given, _augmented(given), BAND)
    assert predicted is not None and predicted.recorded is None
    assert predicted.augmented.rms < predicted.given.rms < predicted.without.rms
    assert "no reference" in predicted.caution(Units())


@pytest.mark.parametrize("ratio, is_reported", [(1.0 / MAX_RATIO + 0.01, False), (MAX_RATIO + 0.01, True), (0.5, True)])
def test_a_caution_bounds_the_ratio_of_the_errors(ratio: float, is_reported: bool) -> None:
    recorded, simulated = TrackingError(1.0e-6, 2.0e-6), TrackingError(ratio * 1.0e-6, 2.0e-6)
    predicted = PredictedTracking(simulated, simulated, simulated, recorded, 10.0)
    assert bool(predicted.caution(Units())) == is_reported


@pytest.mark.parametrize("peak, is_reported", [(3.07e-6, False), (1.43e-6, True), (6.0e-6, True)])
def test_a_caution_bounds_the_ratio_of_the_peaks_too(peak: float, is_reported: bool) -> None:
    recorded, simulated = TrackingError(1.0e-6, 3.07e-6), TrackingError(1.0e-6, peak)
    caution = PredictedTracking(simulated, simulated, simulated, recorded, 10.0).caution(Units())
    assert bool(caution) == is_reported
    if is_reported:
        assert f"a peak of 3.07 um, the simulated one without compensation {peak * 1e6:.3g} um:" in caution
        assert "the model lacks what causes the peak, stage.controller of the file" in caution


def test_the_feedforward_figure_counts_the_reference_while_it_moves() -> None:
    """Half of the recording rests; a force there is nothing that a feedforward along the reference could cancel."""
    given = _augmented(_given())
    record, _ = _recorded(given)
    assert record.reference_position is not None

    def resting(force: float) -> Recording:
        effort = np.full(COUNT, record.effort[-1])
        effort[COUNT // 4 :] += force
        ends = (record.position, record.reference_position)
        position, reference = (np.concatenate([values, np.full(COUNT, values[-1])]) for values in ends)
        whole = np.concatenate([record.effort, effort])
        return replace(record, position=position, effort=whole, reference_position=reference)

    alone, calm, pushed = (check_compensation(one, given, BAND, BLOCK) for one in (record, resting(0.0), resting(3.0)))
    assert alone.has_reference and alone.share > 0.95
    assert calm.share == pushed.share == pytest.approx(0.47, abs=0.05)
    assert pushed.friction_not_cancelled == pytest.approx(calm.friction_not_cancelled, rel=1.0e-3)
    assert not check_compensation(replace(record, reference_position=None), given, BAND, BLOCK).has_reference


def test_the_tuning_of_the_observer_does_not_hide_an_error_of_the_model() -> None:
    """An observer that trusts the measured effort follows it with any model; the feedforward may not profit from it."""
    given = _given()
    record, _ = _recorded(given)
    checks = [
        check_compensation(record, replace(given, estimator=replace(given.estimator, measurement_std=std)), BAND, BLOCK)
        for std in (1.0e-3, 10.0)
    ]
    assert checks[0].innovation != checks[1].innovation
    np.testing.assert_array_equal(*(np.concatenate(item.blocks) for item in checks))


@pytest.mark.parametrize(
    "effect", [EffectSettings("mass_error", (2.0,)), EffectSettings("flexible_mode", (2.0, 20.0, 0.05))]
)
@pytest.mark.parametrize("has_reference", [True, False])
def test_the_feedforward_of_a_moving_mass_cancels_its_force(effect: EffectSettings, has_reference: bool) -> None:
    axis = _given()
    fast = replace(axis.stage.reference, amplitude=1.0e-3, frequency=10.0)
    given = replace(axis, stage_effects=(effect,), stage=replace(axis.stage, reference=fast))
    record, _ = _recorded(given, has_reference)
    without, complete = (
        check_compensation(record, one, BAND, BLOCK) for one in (given, replace(given, effects=(effect,)))
    )
    assert complete.friction_not_cancelled < 0.5 * without.friction_not_cancelled
    assert improvement(without.blocks, complete.blocks).z_score > 3.0
