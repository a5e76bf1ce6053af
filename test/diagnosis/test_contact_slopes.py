"""The exact derivatives with respect to the parameters of the contact are those of the simulated prediction."""

from dataclasses import replace

import numpy as np
import pytest
from workflow_case import FRICTION, record

from sgms_observer.diagnosis.contact_slopes import contact_parameters
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.settings.axis import EffectSettings

STEP = 1.0e-5
SGMS = Model(5.0, FRICTION)
MOTION = motion_of(record(duration=10.0))
ON_FRICTION = (
    EffectSettings("position_dependent_friction", (0.2, 0.0, 0.01)), EffectSettings("asymmetric_coulomb", (0.1,)),
)  # fmt: skip
ON_PATH = (EffectSettings("actuator_dead_zone", (0.3,)), EffectSettings("actuator_gain", (1.1,)))
LAG = EffectSettings("frictional_lag", (50.0, 1.0e-5))
BACKLASH = EffectSettings("backlash", (1.0e-5, 0.1, 1.0e-6))
PERIODIC = EffectSettings("periodic_disturbance", (0.1, 5.0, 0.0))
MODELS = {
    "S-GMS": SGMS,
    "reset of the paper": replace(SGMS, friction=replace(FRICTION, reset="paper")),
    "GMS": replace(SGMS, friction=replace(FRICTION, model="gms")),
    "unsmoothed": replace(SGMS, is_unsmoothed=True),
    "element damping": replace(SGMS, relaxation=0.002),
    "static force below the Coulomb force": replace(SGMS, friction=replace(FRICTION, static_force=3.9)),
    "effects on the sliding force": replace(SGMS, effects=ON_FRICTION),
    "effects on the path of the effort": replace(SGMS, effects=ON_PATH),
    "frictional lag": replace(SGMS, effects=(LAG,)),
    "backlash, GMS": replace(SGMS, friction=replace(FRICTION, model="gms"), effects=(BACKLASH,)),
    "a phase that fits the recording": replace(SGMS, effects=(PERIODIC,)),
    "unknown elements": SGMS.with_log_spaced_elements(1.0e-7, 1.0e-3),
}


@pytest.mark.parametrize(
    ("name", "limit"), [*((one, np.inf) for one in MODELS), ("S-GMS", 5.0), ("a phase that fits the recording", 5.0)]
)
def test_the_derivatives_are_those_of_the_prediction(name: str, limit: float) -> None:
    motion = replace(MOTION, effort=np.clip(MOTION.effort, -limit, limit), effort_limits=(-limit, limit))
    model, data = MODELS[name], data_with_own_noise((motion,), MODELS[name])
    logs = np.full(len(model.parameter_names()), 0.01)
    slopes = data.contact_slopes(model, logs)
    for column, number in zip(slopes.T, contact_parameters(model), strict=True):
        step = STEP * np.eye(len(logs))[number]
        change = data.residual(model.shifted(logs + step)) - data.residual(model.shifted(logs - step))
        scale = np.linalg.norm(column) + 1.0e-3 * np.linalg.norm(slopes)
        # a dead zone, a limit and an element that slips in another sample have a kink
        most = 0.01 if limit == np.inf else 0.05
        assert np.linalg.norm(column - change / (2.0 * STEP)) < most * scale, model.parameter_names()[number]


@pytest.mark.parametrize("item", [LAG, BACKLASH])
def test_an_effect_with_a_sliding_force_of_its_own_leaves_the_elements(item: EffectSettings) -> None:
    names = SGMS.parameter_names()
    alone, beside = (
        [names[number] for number in contact_parameters(model)] for model in (SGMS, replace(SGMS, effects=(item,)))
    )
    assert beside == [one for one in names if one.startswith("element")]
    assert alone == ["coulomb_force", "static_force", "stribeck_velocity", *beside]


def test_a_phase_that_is_fitted_behind_the_path_of_the_effort_is_differentiated_numerically() -> None:
    model = replace(SGMS, effects=(PERIODIC, *ON_PATH))
    assert np.isfinite(predict(model, MOTION).residual).all()
    assert contact_parameters(model) == [] != contact_parameters(replace(SGMS, effects=(PERIODIC,)))
