"""An effort that is stamped late acts before its stamp, which no machine does: it is read earlier, and told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from workflow_case import AXIS, record, rich_position

from sgms_observer.application.axis_draft import FRACTIONS, AxisDraft
from sgms_observer.application.init import InitOptions, init
from sgms_observer.bags.conversion import Table, write_table
from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import answer_of
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.effort_lag import MAX_STAMP_ERROR
from sgms_observer.diagnosis.late_stamps import lag_in_fast_sliding, late_stamps
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import HELD_LAG, delayed
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import load_settings
from sim_plant.plants.machine import draw_plant
from sim_plant.plants.recording import record as recorded

PERIOD, DURATION, BAND = 0.004, 12.0, 25.0
OPTIONS = Options(workers=1, band=BAND)
MODEL = Model.of(AXIS)
SOFT = 3.0e-3
"""Slip deflection that the softest element of a wrong file has [m]."""


def stamped(late: float, seed: int = 1, name: str = "log", duration: float = DURATION) -> Recording:
    """Return a recording whose effort is stamped late by some samples, without a reference."""
    made = record(seed=seed, duration=duration, period=PERIOD)
    return replace(made, name=name, effort=delayed(made.effort, late))


def with_reference(source: Recording, seed: int = 1) -> Recording:
    """Return a recording that has the set-points of its motion."""
    return replace(source, reference_position=rich_position(len(source) * PERIOD, seed, PERIOD))


def with_force(source: Recording) -> Recording:
    """Return a recording with a force of 0.5 N rms that wanders within a tenth of a second."""
    white = np.random.default_rng(3).standard_normal(len(source))
    force = np.convolve(white, np.hanning(25), mode="same")
    return replace(source, effort=source.effort + 0.5 * force / np.std(force))


def samples_in(*recordings: Recording, model: Model = MODEL) -> list[float]:
    """Return by how many samples the effort of recordings is stamped late, where that is sure."""
    return [item.samples for item in late_stamps(recordings, model, HELD_LAG, BAND, Criteria())]


@pytest.mark.parametrize("late", [0.0, 1.0, 3.0])
def test_a_diagnosis_reads_a_late_effort_earlier(late: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "spring", "actuator_delay"))
    pair = stamped(late, name="learn"), stamped(late, seed=2, name="judge")
    answer = answer_of(workflow.diagnose(pair[:1], pair[1:], AXIS, OPTIONS), AXIS, OPTIONS)
    assert answer.verdict == "no_effect" and answer.gap.after < 1.5
    told = [text for text in answer.warnings if "acts before its stamp" in text]
    assert len(told) == (2 if late else 0)
    assert not any("the effort is not held" in text for text in answer.warnings)
    assert all(lag.values == pytest.approx((HELD_LAG,), abs=0.1) for lag in answer.diagnosis.final_state.lags)
    read, true = answer.diagnosis.final_state.recordings.holdouts[0], stamped(0.0, seed=2)
    assert np.sqrt(np.mean((read.effort - true.effort)[10:-10] ** 2)) < 0.1 * np.std(true.effort)


@pytest.mark.parametrize("late", [-3.0, -1.0, 0.0])
def test_an_effort_that_acts_at_its_stamp_or_after_it_stays(late: float) -> None:
    assert samples_in(stamped(late), with_reference(stamped(late))) == []


def test_a_dead_zone_is_no_lag() -> None:
    """It jumps where the effort changes its sign, and so does the effect of a lag: it was 0.37 samples."""
    machine = draw_plant("lugre", 3)
    friction = replace(
        AXIS.friction, element_stiffness=(machine.curve[1] / machine.distance,), element_fraction=(1.0,),
        element_damping=(0.0,), viscous_coefficient=machine.viscous, static_force=machine.curve[1],
        coulomb_force=machine.curve[0], stribeck_velocity=machine.curve[2],
    )  # fmt: skip
    model = Model.of(replace(AXIS, mass=machine.mass, friction=friction))
    lags = []
    for hidden in ((), ("dead_zone",)):
        made = recorded(machine, hidden, 0.15, 7, "steps", 30.0)
        log = Recording("steps", 1.0 / machine.log_rate, made.position, made.effort, reference_position=made.reference)
        found = lag_in_fast_sliding([log], model, 100.0, Criteria())
        assert found is not None
        lags.append(found[0])
    assert lags[0] == pytest.approx(lags[1], abs=MAX_STAMP_ERROR)


def test_pieces_of_one_log_have_one_lag() -> None:
    whole = stamped(2.0)
    (joint,) = samples_in(whole.part(0, 1500), whole.part(1500, len(whole)))
    assert joint == pytest.approx(samples_in(whole)[0], abs=0.05)


def test_beside_another_force_the_response_to_the_reference_shows_the_lag() -> None:
    """A lag that closes little is believed only where the controller cannot make it."""
    source = with_force(stamped(2.0))
    assert samples_in(source) == []
    assert samples_in(with_reference(source)) == pytest.approx([1.5], abs=0.3)


def test_a_delay_of_the_file_may_be_the_error() -> None:
    delayed = MODEL.with_effects([EffectSettings("actuator_delay", (3.0 * PERIOD,))])
    assert samples_in(stamped(0.0), model=delayed) == []


@pytest.mark.parametrize("duration", [6.0, 12.0])
def test_a_spring_that_the_file_lacks_makes_no_lag(duration: float) -> None:
    """In six seconds hardly any block slides fast: they tell no lag, whatever their scatter says."""
    source = record((EffectSettings("spring", (300.0, 0.0)),), seed=2, duration=duration, period=PERIOD)
    source = with_reference(source, seed=2)
    assert samples_in(source) == []
    lag = lag_in_fast_sliding([source], MODEL, BAND, Criteria())
    assert lag is None if duration < 12.0 else lag == (pytest.approx(HELD_LAG, abs=0.1), pytest.approx(0.0, abs=0.1))


def test_elements_that_are_too_soft_make_no_lag() -> None:
    """Where the softest one still gives way, its friction changes with the motion, as with a lag."""
    draft = AxisDraft("x", "prismatic", static=5.0, largest_deflection=SOFT)
    friction = replace(MODEL.friction, element_stiffness=draft.element_stiffness, element_fraction=FRACTIONS)
    soft = replace(MODEL, friction=replace(friction, element_damping=(0.0,) * 4))
    source = with_reference(stamped(HELD_LAG, seed=3, duration=48.0), seed=3)  # the effort is measured, not held
    lag = lag_in_fast_sliding([source], soft, BAND, Criteria())
    assert lag is not None and lag[0] + 3.0 * lag[1] < -MAX_STAMP_ERROR
    assert samples_in(source, model=soft) == []


@pytest.mark.parametrize("is_held", [True, False])
@pytest.mark.parametrize("has_reference", [True, False])
def test_a_first_file_says_whether_the_effort_is_held(is_held: bool, has_reference: bool, tmp_path: Path) -> None:
    """Without a reference nothing is sure, and the file says what most drives do."""
    made = with_reference(stamped(0.0))
    effort = made.effort if is_held else delayed(made.effort, HELD_LAG)
    reference = made.reference_position if has_reference else None
    stamps = (np.arange(len(made)) * PERIOD * 1e9).astype(np.int64)
    velocity = None if reference is None else np.gradient(reference, PERIOD)
    write_table(Table(stamps, made.position, effort, reference, velocity, ()), tmp_path / "bag", "x")
    init(str(tmp_path / "bag"), str(tmp_path / "start.yaml"), None, {}, InitOptions())
    (axis,) = load_settings(tmp_path / "start.yaml").axes
    assert axis.filter.effort_is_held is (is_held or not has_reference)


@pytest.mark.parametrize("has_effort", [True, False])
def test_a_reference_that_stands_still_and_a_bag_without_effort_tell_nothing(has_effort: bool, tmp_path: Path) -> None:
    made = stamped(0.0)
    still = np.zeros(len(made))
    effort = delayed(made.effort, HELD_LAG) if has_effort else None
    stamps = (np.arange(len(made)) * PERIOD * 1e9).astype(np.int64)
    write_table(Table(stamps, made.position, effort, still, still, ()), tmp_path / "bag", "x")
    init(str(tmp_path / "bag"), str(tmp_path / "start.yaml"), None, {}, InitOptions())
    (axis,) = load_settings(tmp_path / "start.yaml").axes
    assert axis.filter.effort_is_held
