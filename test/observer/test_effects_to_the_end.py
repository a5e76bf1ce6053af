"""Every effect of the catalogue, from the stage to the feedforward: hidden in the stage, then put in the file.

Three runs in closed loop per effect: without it (the floor), with it in the stage alone, with it in the file as well.
In the third run the observer predicts the friction, and the feedforward tracks, as if the effect were not there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from sgms_observer.effects.catalogue import BUILT_IN
from sgms_observer.effects.learnt_map import LearntMap
from sgms_observer.observer.all_axes import AllAxes
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
from sim_plant.closed_loop import ClosedLoop
from sim_plant.table import SimulatedTable

PERIOD = 5e-4
SAMPLES, SETTLING = 2400, 600
LEFT = 0.3  # of what the effect adds to an error, at most this share is left once the file has the effect

SINE = ReferenceSettings(amplitude=5e-3, frequency=2.0)
SLOW = ReferenceSettings(amplitude=2e-4, frequency=5.0)
FAST = ReferenceSettings(amplitude=1e-3, frequency=12.0)
MOVES = ReferenceSettings(kind="point_to_point")

LEVELS = ((-6e-3, -1e-3, 2e-3, 6e-3), ())
MAPS = (
    LearntMap(("position", "direction"), LEVELS, (-0.5, 1.0, -1.5, 0.2, 1.0, 1.5, -0.3, -0.5)),
    LearntMap(("velocity",), ((-0.07, -0.03, 0.0, 0.04, 0.07),), (1.0, -0.6, 0.0, 1.0, 0.3)),
    LearntMap(("load", "direction"), ((0.0, 0.4, 0.9), ()), (0.0, 0.0, -1.0, 1.0, -1.2, 1.4)),
)


@dataclass(frozen=True)
class Case:
    """One effect and the motion that shows it.

    Attributes:
        values: of the effect, in the catalogue's order.
        reference: what the stage follows.
        bandwidth: of the controller [Hz].
        why_not_tracked: why no feedforward can act on it; empty where it can.
    """

    values: tuple[float, ...]
    reference: ReferenceSettings = SINE
    bandwidth: float = 100.0
    why_not_tracked: str = ""


CASES = {
    "cogging": Case((1.5, 2e-3, 0.3, 0.4, -0.2)),
    "spring": Case((300.0, 0.002)),
    "offset": Case((1.0,)),
    "asymmetric_viscous": Case((40.0,)),
    "nonlinear_viscous": Case((2.5, 0.6, 0.05)),
    "quadratic_drag": Case((1000.0,)),
    "eddy_current": Case((4.0, 0.04, 0.5)),
    "gravity": Case((3.0, 0.4, 150.0)),
    "periodic_disturbance": Case((0.8, 7.0, 0.1)),
    "cross_axis_coupling": Case((1.5, 10.0)),
    "presliding": Case((1.0, 2e-5)),
    "backlash": Case((1e-5, 0.3, 3e-6)),
    "mass_error": Case((2.0,), FAST),
    "flexible_mode": Case((4.0, 40.0, 0.2), FAST),
    "position_periodic_friction": Case((0.3, 2e-3, 0.4)),
    "position_dependent_friction": Case((0.5, 4e-3, 1e-3)),
    "asymmetric_coulomb": Case((0.2,)),
    "stribeck": Case((0.4, 0.01), SLOW),
    "load_dependent_friction": Case((0.3,)),
    "thermal_drift": Case((-0.4, 0.5, 0.6, 0.03)),
    "wear_step": Case((0.4, 0.02, 0.005)),
    "dwell_breakaway": Case((0.8, 0.1, 1e-3, 1e-4), MOVES),
    "frictional_lag": Case((20.0, 2e-5), SLOW),
    "learnt_map": Case(MAPS[0].settings().values),
    "learnt_map_2": Case(MAPS[1].settings().values),
    "learnt_map_3": Case(MAPS[2].settings().values),
    "actuator_gain": Case((0.8,), FAST),
    "actuator_dead_zone": Case((1.0,)),
    "actuator_delay": Case((3e-3,), bandwidth=20.0),
    "actuator_saturation": Case((12.5,), why_not_tracked="no command gives more than the actuator can"),
    "encoder_interpolation_error": Case(
        (2e-7, 2e-5, 0.5), SLOW, why_not_tracked="the controller itself follows the wrong position"
    ),
    "quantisation": Case((1e-6,), SLOW, why_not_tracked="what a grid has lost, nobody can put back"),
}


@dataclass(frozen=True)
class Errors:
    """Rms errors of one run: tracking [m], innovation [N], friction [N], position [m]."""

    tracking: float
    innovation: float
    friction: float
    position: float


def axis(case: Case, hidden: tuple[EffectSettings, ...], known: tuple[EffectSettings, ...]) -> AxisSettings:
    """Return an axis whose observer has the true friction, gain and look-ahead: what is left is the effect's."""
    return AxisSettings(
        stage=StageSettings(
            controller=ControllerSettings(bandwidth=case.bandwidth, feedforward_mass=0.7),
            reference=case.reference,
            encoder=EncoderSettings(resolution=1e-8, noise=5e-9),
            force_noise=0.1,
        ),
        stage_friction=FrictionSettings(),
        stage_effects=hidden,
        effects=known,
        estimator=EstimatorSettings(correction_every=4),
        compensation=CompensationSettings(enabled=True, gain=1.0, limit=50.0, look_ahead=1.5 * PERIOD),
    )


def other_axis() -> AxisSettings:
    """Return the axis whose motion is felt by coupling."""
    other = axis(Case(()), (), ())
    faster = ReferenceSettings(amplitude=3e-3, frequency=5.0)
    return replace(other, name="y", stage=replace(other.stage, reference=faster))


def errors(*axes: AxisSettings) -> Errors:
    """Run axes with their observers in the loop and return the errors of the first."""
    table, observers = SimulatedTable(Settings(axes=axes, sample_period=PERIOD)), AllAxes(axes, PERIOD)
    steps = observers.step if observers.is_coupled else [observer.step for observer in observers.observers]
    records, estimates = ClosedLoop(table, steps).step(SAMPLES)
    record, estimate = records[0], estimates[0]

    def rms(error: np.ndarray) -> float:
        return float(np.sqrt(np.nanmean(error[SETTLING:] ** 2)))

    return Errors(
        rms(record.position - record.reference_position),
        rms(estimate.innovation),
        rms(estimate.friction - record.friction),
        rms(estimate.position - record.position),
    )


@cache
def floor(reference: ReferenceSettings, bandwidth: float) -> Errors:
    """Return the errors of a stage without any effect."""
    return errors(axis(Case((), reference, bandwidth), (), ()))


@cache
def hidden_and_known(name: str) -> tuple[Errors, Errors]:
    """Return the errors with the effect in the stage alone, and in the file as well."""
    case, effect = CASES[name], (EffectSettings(name, CASES[name].values),)
    others = (other_axis(),) if name == "cross_axis_coupling" else ()
    return errors(axis(case, effect, ()), *others), errors(axis(case, effect, effect), *others)


def three(name: str, of: Callable[[Errors], float]) -> tuple[float, float, float]:
    """Return an error without the effect, with it in the stage alone, and with it in the file as well."""
    return of(floor(CASES[name].reference, CASES[name].bandwidth)), *map(of, hidden_and_known(name))


def left_of(name: str, of: Callable[[Errors], float]) -> float:
    """Return the share of what an effect adds to an error that is left once the file has the effect."""
    least, hidden, known = three(name, of)
    assert hidden > 1.2 * least, "the effect does not show in this motion"
    return (known - least) / (hidden - least)


def test_every_effect_has_a_case() -> None:
    assert set(CASES) == {entry.name for entry in BUILT_IN}


@pytest.mark.parametrize("name", [name for name in CASES if name != "quantisation"])
def test_the_observer_predicts_as_if_the_effect_were_not_there(name: str) -> None:
    assert left_of(name, lambda found: found.innovation) < LEFT
    least, hidden, known = three(name, lambda found: found.friction)
    assert known - least < max(LEFT * (hidden - least), 0.3 * least)  # forces beside the friction hardly move it


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if not case.why_not_tracked])
def test_the_feedforward_tracks_as_if_the_effect_were_not_there(name: str) -> None:
    assert left_of(name, lambda found: found.tracking) < LEFT


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.why_not_tracked])
def test_what_no_feedforward_can_act_on_is_not_made_worse(name: str) -> None:
    hidden, known = hidden_and_known(name)
    assert known.tracking < 1.05 * hidden.tracking


def test_the_position_behind_a_wrong_encoder_is_found() -> None:
    assert left_of("encoder_interpolation_error", lambda found: found.position) < LEFT


def test_a_known_grid_changes_nothing_that_is_estimated() -> None:
    hidden, known = hidden_and_known("quantisation")
    assert hidden == known
