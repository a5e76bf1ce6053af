"""Identification of a simulated table: its own noise and encoder, its own truth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from program import load_script
from table_case import FRICTION

from sgms_observer.errors import DataError
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.reference import Excitation, design_excitation
from sgms_observer.identification.answer import identification_answer
from sgms_observer.identification.identify import Identification, IdentifyOptions, identify
from sgms_observer.identification.problem import ELEMENTS, RELAXATION, Parameters
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.offline.recording import Recording, recordings_from_samples
from sgms_observer.settings.axis import (
    AxisSettings,
    ControllerSettings,
    EffectSettings,
    EncoderSettings,
    FrictionSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.write import write_settings
from sim_plant.closed_loop import ClosedLoop
from sim_plant.table import SimulatedTable

PERIOD = 2.5e-4
TRUE = AxisSettings(
    mass=10.0,
    friction=FRICTION,
    effects=(EffectSettings("offset", (-0.4,)),),
    stage=StageSettings(
        controller=ControllerSettings(feedforward_mass=0.7),
        encoder=EncoderSettings(resolution=1.0e-8, noise=5.0e-9),
        force_noise=0.05,
    ),
)
START = AxisSettings(
    mass=6.0,
    friction=FrictionSettings(
        element_stiffness=(4.0e6,),
        element_fraction=(1.0,),
        element_damping=(0.0,),
        static_force=3.5,
        coulomb_force=3.0,
        stribeck_velocity=5.0e-3,
    ),
)


def _record(
    reference: ReferenceSettings, duration: float, seed: int = 3, period: float = PERIOD, true: AxisSettings = TRUE
) -> tuple[Recording, ...]:
    axis = replace(true, stage=replace(true.stage, reference=reference, seed=seed))
    table = SimulatedTable(Settings(axes=(axis,), sample_period=period), 1_000_000_000)
    return recordings_from_samples(table.step(round(duration / period))[0].samples, "simulated")


@cache
def _designed(period: float) -> Excitation:
    """Return the reference that all tables of a period follow: 30 s, half of what ``sgms excite`` takes by itself."""
    return design_excitation(START, ExcitationLimits(0.01, 0.05, 1.0), ("identify",), seconds=30.0, rate=1.0 / period)


def _excited(folder: Path, period: float, seed: int = 3, true: AxisSettings = TRUE) -> tuple[Recording, ...]:
    """Let a table follow the designed reference."""
    reference = _designed(period)
    csv = folder / "reference.csv"
    np.savetxt(csv, np.column_stack([reference.time, np.round(reference.position, 12)]), delimiter=",", fmt="%.12g")
    return _record(ReferenceSettings(kind="file", file=str(csv)), float(reference.time[-1]), seed, period, true)


@pytest.fixture(scope="module", params=[PERIOD, 1.0e-3], ids=["4 kHz", "1 kHz"])
def period(request: pytest.FixtureRequest) -> float:
    return float(request.param)


@pytest.fixture(scope="module")
def result(period: float, tmp_path_factory: pytest.TempPathFactory) -> Identification:
    recorded = _excited(tmp_path_factory.mktemp("excite"), period)
    return identify(recorded, START, IdentifyOptions(largest_count=3))


def _truth() -> Parameters:
    friction = TRUE.friction
    scalars = np.array([10.0, 30.0, -0.4, PERIOD / 2, 1.3, 2.0e-3, friction.attraction_rate / 4.0, 0.0])
    return Parameters(scalars, np.array(friction.element_stiffness), 4.0 * np.array(friction.element_fraction))


def test_held_out_error_finds_the_number_of_elements(result: Identification) -> None:
    assert result.parameters.count == 2


def test_what_is_told_to_be_shown_is_within_five_percent(result: Identification) -> None:
    names = result.parameters.names()
    estimate, true = result.parameters.vector(), _truth().vector()
    told = [
        j for j in range(len(names)) if result.confidence.is_identifiable[j] and names[j] not in ("delay", "offset")
    ]
    assert {"mass", "viscous_coefficient", "stribeck_ratio"} <= {names[j] for j in told}
    assert sum(j >= ELEMENTS for j in told) >= 3
    for j in told:
        assert estimate[j] == pytest.approx(true[j], rel=0.05), names[j]


def test_intervals_hold_the_truth(result: Identification) -> None:
    estimate, true = result.parameters.vector(), _truth().vector()
    width = result.confidence.half_width
    estimated = [j for j in range(len(true)) if np.isfinite(width[j])]
    inside = [abs(estimate[j] - true[j]) <= width[j] for j in estimated]
    assert np.mean(inside) >= 0.8


def test_force_error_on_another_recording_is_at_the_floor_of_the_truth(
    result: Identification, period: float, tmp_path: Path
) -> None:
    """The same reference with other noise: within 10 % of what noise and model leave to the true parameters."""
    judged = _excited(tmp_path, period, seed=77)
    force_error = load_script("benchmarks/identification.py").force_error
    floor = force_error(judged, _truth(), START, "sgms", result.cutoff)
    assert force_error(judged, result.parameters, START, "sgms", result.cutoff) <= 1.10 * floor


def test_no_element_damping_is_claimed_where_there_is_none(result: Identification) -> None:
    """The bound that is told instead holds the truth, and is worth telling."""
    assert result.parameters.scalars[RELAXATION] == 0.0
    assert RELAXATION in result.frozen
    assert 0.0 < result.relaxation < 2.0e-3


@pytest.mark.parametrize("lasting", [1.0e-3])
def test_element_damping_is_found_where_it_is(lasting: float, tmp_path: Path) -> None:
    friction = TRUE.friction
    damping = tuple(lasting * kappa for kappa in friction.element_stiffness)
    true = replace(TRUE, friction=replace(friction, element_damping=damping))
    shown: list[float] = []
    found = identify(_excited(tmp_path, PERIOD, true=true), START, IdentifyOptions(count=2), shown.append)
    assert len(shown) > 4 and shown == sorted(shown) and shown[0] == 0.0 and shown[-1] < 1.0
    value, width = found.parameters.scalars[RELAXATION], found.confidence.half_width[RELAXATION]
    assert abs(value - lasting) <= max(width, 0.05 * lasting)
    changes = identification_answer(found, START, PERIOD).changes
    assert changes["friction.element_damping"] == pytest.approx(value * found.parameters.kappa, rel=1e-5)


def test_the_answer_makes_a_valid_axis_with_remarks(result: Identification) -> None:
    answer = identification_answer(result, START, PERIOD)
    assert sum(answer.changes["friction.element_fraction"]) == pytest.approx(1.0, abs=1e-9)
    assert answer.changes["friction.static_force"] >= answer.changes["friction.coulomb_force"]
    assert answer.changes["effects.offset.force"] == pytest.approx(-0.4, abs=0.02)
    assert "95 %" in answer.remarks["mass"]
    assert {row.name for row in answer.rows} >= {"mass", "delay", "friction.element_stiffness[1]"}


def test_the_answer_compensates(result: Identification, period: float, tmp_path: Path) -> None:
    """The whole way: the file that identification writes, loaded as it is, makes the table follow better."""
    settings = Settings(axes=(START,), sample_period=period)
    answer = identification_answer(result, START, period)
    path = tmp_path / "identified.yaml"
    every = max(1, round(2e-3 / period))
    changes = {**answer.changes, "compensation.enabled": True, "estimator.correction_every": every}
    write_settings(settings, path, {START.name: changes}, {})
    found = load_settings(path).axes[0]
    stage = replace(TRUE.stage, mass=TRUE.mass, reference=ReferenceSettings())
    axis = replace(found, stage=stage, stage_friction=TRUE.friction, stage_effects=TRUE.effects)
    sizes = []
    for has_feedback in (True, False):
        table = SimulatedTable(Settings(axes=(axis,), sample_period=period))
        record = ClosedLoop(table, [AxisObserver(axis, period).step], has_feedback).step(round(1.0 / period))[0][0]
        error = (record.position - record.reference_position)[record.time > 0.3]
        sizes.append(float(np.sqrt(np.mean(error**2))))
    assert sizes[0] < sizes[1] / 5.0


def test_a_recording_without_reversals_says_so() -> None:
    still = _record(ReferenceSettings(kind="sine", amplitude=1.0e-9, frequency=1.0), 3.0)
    with pytest.raises(DataError, match=r"moves by|never slide"):
        identify(still, START)


def test_one_fast_stroke_does_not_claim_the_presliding_stiffness() -> None:
    fast = _record(ReferenceSettings(kind="sine", amplitude=5.0e-3, frequency=4.0), 4.0)
    found = identify(fast, START, IdentifyOptions(count=2))
    estimate, true = found.parameters.vector(), _truth().vector()
    for j in range(len(true)):
        if found.confidence.is_identifiable[j] and found.parameters.names()[j] not in ("delay", "offset"):
            assert estimate[j] == pytest.approx(true[j], rel=0.05), found.parameters.names()[j]
    assert not np.all(found.confidence.is_identifiable[ELEMENTS:])
