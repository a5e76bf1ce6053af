"""The lag of the effort: an effort that is held, that is not held, and both in one recording."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from workflow_case import AXIS, record

from sgms_observer.diagnosis.answer import answer_of
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.diagnosis import MAX_REFITS, FitState, Options, Recordings
from sgms_observer.diagnosis.effort_lag import (
    MAX_STAMP_ERROR,
    changes_of_lag,
    fitted_effort_lags,
    notes_on_changes,
    with_real_changes,
)
from sgms_observer.diagnosis.fit import RefitSetup, refit
from sgms_observer.diagnosis.gap import WeightedResidual, halves, residuals
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import HELD_LAG, EffortLag, delayed, motion_of
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import load_settings
from sim_plant.stage import SimulatedStage

MODEL = Model.of(AXIS)
ROOT = Path(__file__).parents[2]
CLOSE, NEAR = 0.03, 0.5 * MAX_STAMP_ERROR
"""Tolerances of a lag in samples: alone, and beside a change, whose time is found to half a second."""
AS_STATED = EffortLag()


def needs(lag: float, source: Recording | None = None) -> Recording:
    """Return a recording whose effort has some lag [samples]."""
    held = source or record()
    return replace(held, effort=delayed(held.effort, HELD_LAG - lag))


def lags_of(*recordings: Recording, start: EffortLag = AS_STATED, stated: float = HELD_LAG) -> tuple[float, ...]:
    """Return the lags that a diagnosis fits to recordings of a stage that has the model's own values."""
    lags = (start,) * len(recordings)
    for _ in range(MAX_REFITS):
        motions = tuple(motion_of(source, lag) for source, lag in zip(recordings, lags, strict=True))
        data = data_with_own_noise(motions, MODEL)
        lags = fitted_effort_lags(data, refit(data, MODEL, 0.05), stated)
    return tuple(value for lag in lags for value in lag.values)


def changes_in(source: Recording, lag: EffortLag = AS_STATED) -> tuple[float, ...]:
    """Return the times at which the lag of the effort changes in a recording that is read with a lag [s]."""
    motion = motion_of(source, lag)
    data = data_with_own_noise((motion,), MODEL)
    rest = WeightedResidual((motion,), residuals(MODEL, [motion]), data.weights)
    return changes_of_lag(rest, 0, HELD_LAG, Criteria())


def early_but(*is_late: tuple[float, float]) -> Recording:
    """Return a recording whose effort has a lag of 0.1 samples but between these times, where it is held [s]."""
    held, early = record(), needs(0.1)
    time = held.period * np.arange(len(held))
    late = np.any([(first <= time) & (time < last) for first, last in is_late], axis=0)
    return replace(held, effort=np.where(late, held.effort, early.effort))


@pytest.mark.parametrize("lag", [0.0, 0.1, 0.3, HELD_LAG, HELD_LAG + 0.05])
def test_a_lag_up_to_that_of_a_held_effort_is_fitted(lag: float) -> None:
    assert lags_of(needs(lag)) == pytest.approx((lag,), abs=CLOSE)


def test_a_larger_lag_is_left_to_a_delay() -> None:
    assert lags_of(needs(0.9)) == (HELD_LAG,)


def test_an_effort_before_its_stamp_acts_at_it() -> None:
    assert lags_of(needs(-0.4)) == (0.0,)


def test_an_effort_taken_for_early_goes_back_to_what_the_settings_say() -> None:
    early = EffortLag((0.0,))
    assert lags_of(record(), start=early) == pytest.approx((HELD_LAG,), abs=CLOSE)
    assert lags_of(record(), start=early, stated=0.0) == (0.0,)  # late, where nobody said held: a delay


def test_each_recording_has_its_own_lag() -> None:
    assert lags_of(needs(0.1), record(seed=2)) == pytest.approx((0.1, HELD_LAG), abs=CLOSE)


@pytest.mark.parametrize(("stiffness", "lag"), [(0.8, 0.0), (0.8, 0.3), (1.25, 0.1)])
def test_a_file_with_another_stiffness_does_not_move_the_lag(stiffness: float, lag: float) -> None:
    """The noise is that of a wrong file at first, in which a change of the lag is not sure yet."""
    source = needs(lag)
    friction = replace(MODEL.friction, element_stiffness=tuple(stiffness * k for k in MODEL.friction.element_stiffness))
    file = replace(MODEL, friction=friction)
    recordings = Recordings((source,), (), HELD_LAG, 100.0)
    motions = recordings.motions()
    setup = RefitSetup(data_with_own_noise(motions, file), file, 0.05)
    state = FitState(recordings, motions, (), setup, setup.fit(())).converged().with_fitted_lags()
    assert state.lags[0].values == pytest.approx((lag,), abs=CLOSE)


def test_beside_a_delay_the_lag_stays() -> None:
    """A delay of the model is a lag of all recordings: one of the two would take the place of the other."""
    source = needs(0.2)
    recordings = Recordings((source,), (), HELD_LAG, 100.0)
    motions = recordings.motions()
    setup = RefitSetup(data_with_own_noise(motions, MODEL), MODEL, 0.05)
    alone, beside = (
        FitState(recordings, motions, (), setup, setup.fit(effects)).converged().with_fitted_lags()
        for effects in ((), (EffectSettings("actuator_delay", (1.0e-4,)),))
    )
    assert alone.lags[0].values != (HELD_LAG,)
    assert beside.lags[0].values == (HELD_LAG,)


@pytest.mark.parametrize("read_with", [AS_STATED, EffortLag((0.0,)), EffortLag((0.2, 0.4), (7.0,))])
def test_a_change_of_the_lag_is_found_where_it_is(read_with: EffortLag) -> None:
    assert changes_in(record(), read_with) == ()
    assert changes_in(needs(0.1), read_with) == ()
    both = early_but((9.0, np.inf))
    changes = changes_in(both, read_with)
    assert changes == pytest.approx((9.0,), abs=0.6)
    assert lags_of(both, start=read_with.divided(changes)) == pytest.approx((0.1, HELD_LAG), abs=NEAR)


def test_every_change_of_the_lag_is_found() -> None:
    both = early_but((6.0, 13.0))
    changes = changes_in(both)
    assert changes == pytest.approx((6.0, 13.0), abs=0.6)
    assert lags_of(both, start=AS_STATED.divided(changes)) == pytest.approx((0.1, HELD_LAG, 0.1), abs=NEAR)
    motion = replace(motion_of(both), lag=EffortLag((0.1, 0.5, 0.1), (6.0, 13.0)))
    (note,) = notes_on_changes([motion])
    assert note.endswith("until 6.0 s the effort acts 0.10 samples after its stamp, then 0.50 (until 13.0 s), 0.10")


def test_a_second_with_another_lag_does_not_move_the_place_of_a_change() -> None:
    """The second scatters the lag of the blocks on its side."""
    assert changes_in(early_but((9.0, 15.0), (16.0, np.inf))) == pytest.approx((9.0,), abs=0.6)


def test_a_lag_divided_again_keeps_its_values() -> None:
    lag = EffortLag((0.1, 0.5), (9.0,))
    assert lag.divided((4.0, 12.0)) == EffortLag((0.1, 0.1, 0.5), (4.0, 12.0))
    assert lag.divided(()) == EffortLag((0.1,))


def test_a_change_within_an_error_of_the_stamps_is_none() -> None:
    near, far = EffortLag((0.4, 0.5), (9.0,)), EffortLag((0.1, 0.5), (9.0,))
    assert with_real_changes([near, far]) == (EffortLag((0.45,)), far)


@pytest.mark.parametrize("hidden", [("wear_step", (0.3, 9.0, 0.1)), ("cogging", (0.6, 2e-3, 0.3, 0.0, 0.0))])
def test_what_the_model_misses_is_no_change_of_the_lag(hidden: tuple[str, tuple[float, ...]]) -> None:
    assert changes_in(record((EffectSettings(*hidden),))) == ()


def test_a_stage_with_a_fast_loop_whose_compensation_is_switched_on_misses_nothing() -> None:
    axis = load_settings(ROOT / "config" / "demo.yaml").axes[0]
    period, count = 5.0e-4, 16_000
    cycle = round(1.0 / (axis.stage.reference.frequency * period))
    parts, compensation = [], np.zeros(count)
    for _run in range(4):  # each learns from the one before, until the compensation is as good as an observer's
        stage = SimulatedStage(axis, period)
        parts = [stage.step(count), stage.step(count, compensation)]
        friction = parts[-1].element_force[-cycle:].sum(axis=1)
        compensation = np.tile(0.475 * (friction + np.roll(friction, -1)), count // cycle)
    position, effort = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("measured_position", "control_effort")
    )
    source = Recording("demo", period, position, effort, recorded_step=axis.stage.encoder.resolution)
    options = Options(band=160.0)
    found = diagnose([source], [], axis, options)
    (lag,) = found.final_state.lags
    assert lag.changes == pytest.approx((count * period,), abs=1.0)
    assert lag.values[0] < lag.values[-1] - 0.2
    assert any("the effort acts" in note for note in found.notes)
    assert answer_of(found, axis, options).verdict == "no_effect"


def test_halves_of_a_decimated_recording_hold_their_part_of_the_raw_position() -> None:
    motion = motion_of(record(), band=20.0)
    assert motion.step > 1
    with_error = MODEL.with_effects([EffectSettings("encoder_interpolation_error", (2e-7, 2e-5, 0.0))])
    whole = residuals(with_error, [motion])[0]
    parts = residuals(with_error, halves(motion))
    edge = round(1.0 / motion.residual_period)
    assert parts[0][edge : len(parts[0]) - edge] == pytest.approx(whole[edge : len(parts[0]) - edge], abs=0.02)
    assert [len(one.raw) for one in halves(motion)] == [len(one.time) * motion.step for one in halves(motion)]
