"""The effects of the YAML are compensated where the axis will be, not where it was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.settings.axis import (
    AxisSettings,
    CompensationSettings,
    ControllerSettings,
    EffectSettings,
    EncoderSettings,
    EstimatorSettings,
    FrictionSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sim_plant.record import join_records
from sim_plant.table import SimulatedTable

PERIOD = 5e-4
COGGING = EffectSettings("cogging", (1.5, 2e-3, 0.3, 0.0, 0.0))
TIGHT = EffectSettings("position_dependent_friction", (0.5, 4e-3, 1e-3))


def _axis(effect: EffectSettings, known: bool, look_ahead: float) -> AxisSettings:
    stage = StageSettings(
        controller=ControllerSettings(feedforward_mass=0.7),
        reference=ReferenceSettings(amplitude=5e-3, frequency=2.0),
        encoder=EncoderSettings(resolution=1e-8, noise=5e-9),
        force_noise=0.1,
    )
    return AxisSettings(
        stage=stage,
        stage_friction=FrictionSettings(),  # S-GMS like the model: its level follows the place at once
        stage_effects=(effect,),
        effects=(effect,) if known else (),
        estimator=EstimatorSettings(correction_every=4),
        compensation=CompensationSettings(enabled=True, gain=1.0, look_ahead=look_ahead),
    )


def _tracking_rms(axis: AxisSettings, delay: int, enabled: bool = True) -> float:
    """Return the rms tracking error [m] when a compensation acts ``delay`` samples after its sample."""
    axis = replace(axis, compensation=replace(axis.compensation, enabled=enabled))
    table = SimulatedTable(Settings(axes=(axis,), sample_period=PERIOD))
    observer = AxisObserver(axis, PERIOD)
    forces, records = [0.0] * delay, []
    for k in range(2600):
        records.append(table.step(1, [forces[k]])[0])
        forces.append(float(observer.step(records[-1].samples).compensation[-1]))
    record = join_records(records)
    error = (record.position - record.reference_position)[600:]
    return float(np.sqrt(np.mean(error**2)))


@pytest.mark.parametrize("effect", [COGGING, TIGHT], ids=["cogging", "tight_spot"])
def test_an_effect_in_the_model_is_compensated_as_if_it_were_not_there(effect: EffectSettings) -> None:
    """The rest of the error, of friction and controller, is that of a stage without the effect."""
    known, unknown = _axis(effect, True, 1.5 * PERIOD), _axis(effect, False, 1.5 * PERIOD)
    with_it, without_it = _tracking_rms(known, 1), _tracking_rms(unknown, 1)
    floor = _tracking_rms(replace(unknown, stage_effects=()), 1)
    assert with_it - floor < 0.3 * (without_it - floor)
    assert without_it < _tracking_rms(known, 1, enabled=False)


def test_a_long_way_to_the_actuator_is_bridged_for_effects_too() -> None:
    """At 63 mm/s the axis crosses a third of the cogging's pitch in the 10 ms that the force is on its way."""
    delay = 20
    ahead = _tracking_rms(_axis(COGGING, True, delay * PERIOD), delay)
    late = _tracking_rms(_axis(COGGING, True, 0.0), delay)
    nothing = _tracking_rms(_axis(COGGING, True, 0.0), delay, enabled=False)
    assert ahead < 0.4 * nothing
    assert ahead < 0.3 * late
