"""The exported FMU is valid and moves as ``sgms simulate`` does."""

from __future__ import annotations

import copy
import math
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from c_build import needs

from sgms_observer.effects.learnt_map import LearntMap
from sgms_observer.export import fmu_target
from sgms_observer.export.fmu_target import write_fmu
from sgms_observer.export.fmu_variables import base_exponents
from sgms_observer.settings.axis import (
    AxisSettings,
    EffectSettings,
    EncoderSettings,
    FrictionSettings,
    ReferenceSettings,
    Settings,
    StageSettings,
)
from sim_plant.reference import make_reference
from sim_plant.stage import SimulatedStage

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed: pip install fmpy")
pytestmark = needs("cc")

TOLERANCE = 1e-6
NAMES = ("position", "velocity", "acceleration", "measured_position", "control_effort", "friction", "effect_force")
EFFECTS = (
    EffectSettings("cogging", (1.4, 0.01, 0.3, 0.2, 0.1)),
    EffectSettings("thermal_drift", (0.2, 0.5, 0.5, 0.01)),
    EffectSettings("actuator_delay", (2.5e-4,)),
    EffectSettings("encoder_interpolation_error", (1e-7, 2e-5, 0.0)),
)
#: What a diagnosis adds to a file, in kinds of its own: a table, states of an attached mass, a change of the mass.
DIAGNOSED = (
    LearntMap(("position", "direction"), ((-2e-3, 0.0, 2e-3), (-1, 1)), (-0.9, 0.4, 0.2, 0.7, -0.5, 1.1)).settings(),
    EffectSettings("flexible_mode", (1.5, 60.0, 0.05)),
    EffectSettings("mass_error", (-0.8,)),
)
STAGE = StageSettings(
    reference=ReferenceSettings(kind="sine", amplitude=2e-3, frequency=5.0), encoder=EncoderSettings(resolution=1e-9)
)
AXES = {
    "gms": AxisSettings(friction=FrictionSettings(model="gms"), stage=STAGE),
    "sgms_with_effects": AxisSettings(stage=STAGE, effects=EFFECTS),
    "as_diagnosed": AxisSettings(stage=STAGE, effects=DIAGNOSED),
    "revolute": AxisSettings(joint_type="revolute", stage=STAGE, effects=(EffectSettings("spring", (5.0, 0.0)),)),
}


def quiet(axis: AxisSettings) -> AxisSettings:
    """Return the axis without noise, which the FMU leaves to the simulation tool."""
    stage = axis.stage
    encoder = replace(stage.encoder, noise=0.0)
    return replace(axis, stage=replace(stage, force_noise=0.0, disturbance_noise=0.0, encoder=encoder))


def reference_of(axis: AxisSettings, tick: float, count: int) -> np.ndarray:
    """Return the reference at every tick as an input of the FMU."""
    time = np.arange(count) * tick
    columns = ("time", "reference_position", "reference_velocity", "reference_acceleration")
    table = np.zeros(count, dtype=[(name, "f8") for name in columns])
    for name, values in zip(columns, (time, *make_reference(axis.stage.reference).at(time)), strict=True):
        table[name] = values
    return table


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", AXES)
@pytest.mark.parametrize("sample_period", [1e-4, 1e-3])
def test_it_is_valid_and_equal_to_simulate(name: str, fmi: int, sample_period: float, tmp_path: Path) -> None:
    from fmpy.validation import validate_fmu

    axis = quiet(AXES[name])
    path = tmp_path / "stage.fmu"
    write_fmu(Settings(axes=(axis,), sample_period=sample_period), axis, fmi, path)
    assert validate_fmu(str(path)) == []
    stage = SimulatedStage(axis, sample_period)
    constants = stage.parts.constants
    samples = round(0.2 / sample_period)
    truth = stage.step(samples)
    ticks = samples * constants.ticks_per_sample
    given = reference_of(axis, constants.tick, ticks)
    out = fmpy.simulate_fmu(
        str(path), start_time=0.0, stop_time=given["time"][-1], step_size=constants.tick,
        output_interval=constants.tick, input=given, output=list(NAMES),
    )  # fmt: skip
    shown = out[:: constants.ticks_per_sample][:samples]
    assert len(shown) == samples
    for column in ("position", "velocity", "measured_position", "friction"):
        expected = getattr(truth, column)
        assert np.max(np.abs(shown[column] - expected)[1:]) <= TOLERANCE * np.max(np.abs(expected)), column
    effort = out["control_effort"][1 :: constants.ticks_per_sample]  # known one tick after the sample
    expected = truth.control_effort[: len(effort)]
    assert len(effort) >= samples - 1
    assert np.max(np.abs(effort - expected)) <= TOLERANCE * np.max(np.abs(expected))
    assert np.max(np.abs(truth.position)) > 1e-3


@pytest.mark.parametrize("left_out", range(len(DIAGNOSED)), ids=lambda place: DIAGNOSED[place].name)
def test_each_effect_of_the_diagnosis_moves_the_stage_by_more_than_the_tolerance(left_out: int) -> None:
    """Otherwise the equality above would say nothing of it."""
    axis = quiet(AXES["as_diagnosed"])
    without = replace(axis, effects=tuple(effect for k, effect in enumerate(DIAGNOSED) if k != left_out))
    here, there = (SimulatedStage(one, 1e-3).step(200).position for one in (axis, without))
    assert np.max(np.abs(here - there)) > 100.0 * TOLERANCE * np.max(np.abs(here))


def test_a_coarser_communication_step_follows_the_reference_in_between(tmp_path: Path) -> None:
    axis = quiet(AXES["gms"])
    path = tmp_path / "stage.fmu"
    write_fmu(Settings(axes=(axis,)), axis, 3, path)
    given = reference_of(axis, 1e-4, 4000)
    found = []
    for step in (1, 5):
        table = given[::step]
        found.append(fmpy.simulate_fmu(
            str(path), stop_time=0.39, step_size=step * 1e-4, output_interval=1e-3, input=table, output=["position"],
        )["position"])  # fmt: skip
    assert np.max(np.abs(found[0] - found[1])) < 1e-7


def test_parameters_act_and_state_can_be_restored(tmp_path: Path) -> None:
    """More Coulomb friction slows a mass that an effort alone moves; a restored state gives the same future."""
    axis = quiet(AxisSettings(stage=STAGE))
    path = tmp_path / "stage.fmu"
    write_fmu(Settings(axes=(axis,)), axis, 3, path)
    travelled = []
    for level in (4.0, 6.0):
        values = {"controlled": False, "friction.coulomb_force": level, "friction.static_force": level + 0.5}
        given = np.array([(0.0, 10.0), (1.0, 10.0)], dtype=[("time", "f8"), ("effort", "f8")])
        out = fmpy.simulate_fmu(
            str(path), stop_time=0.2, step_size=1e-4, output_interval=1e-2, start_values=values, input=given,
            output=["position", "control_effort"],
        )  # fmt: skip
        assert out["control_effort"][-1] == pytest.approx(10.0)
        travelled.append(out["position"][-1])
    rise = 0.5  # s, the mass over the viscous coefficient; (10 - 4) N drive it towards 0.3 m/s
    assert travelled[0] == pytest.approx(0.3 * (0.2 - rise * (1.0 - math.exp(-0.2 / rise))), rel=0.03)
    assert travelled[1] < 0.8 * travelled[0]

    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path), str(tmp_path / "unpacked"))
    model = fmpy.instantiate_fmu(folder, description)
    references = {item.name: item.valueReference for item in description.modelVariables}
    model.enterInitializationMode()
    model.exitInitializationMode()
    model.setFloat64([references["reference_position"]], [1e-3])
    for k in range(100):
        model.doStep(k * 1e-4, 1e-4)
    state = model.getFMUState()
    futures = []
    for _ in range(2):
        model.setFMUState(state)
        for k in range(100, 200):
            model.doStep(k * 1e-4, 1e-4)
        futures.append(model.getFloat64([references["position"]])[0])
    model.freeFMUState(state)
    model.terminate()
    model.freeInstance()
    assert futures[0] == futures[1] != 0.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_state_in_bytes_goes_on_as_it_was(fmi: int, tmp_path: Path) -> None:
    path = tmp_path / "stage.fmu"
    axis = AXES["sgms_with_effects"]
    write_fmu(Settings(axes=(axis,)), axis, fmi, path)
    description = fmpy.read_model_description(str(path))
    folder = fmpy.extract(str(path), str(tmp_path / "unpacked"))
    model = fmpy.instantiate_fmu(folder, description)
    references = {item.name: item.valueReference for item in description.modelVariables}
    get, put = (model.getReal, model.setReal) if fmi == 2 else (model.getFloat64, model.setFloat64)
    word = "FMUstate" if fmi == 2 else "FMUState"
    model.enterInitializationMode()
    model.exitInitializationMode()
    put([references["reference_position"]], [1e-3])
    for k in range(100):
        model.doStep(k * 1e-4, 1e-4)
    state = getattr(model, f"get{word}")()
    kept = getattr(model, f"serialize{word}")(state)
    getattr(model, f"free{word}")(state)
    futures = []
    for _ in range(2):
        state = getattr(model, "deSerializeFMUstate" if fmi == 2 else "deserializeFMUState")(kept)
        getattr(model, f"set{word}")(state)
        getattr(model, f"free{word}")(state)
        for k in range(100, 200):
            model.doStep(k * 1e-4, 1e-4)
        futures.append(get([references["position"]])[0])
    model.freeInstance()
    assert futures[0] == futures[1] != 0.0
    with pytest.raises(Exception, match="nstantiate"):
        fmpy.instantiate_fmu(folder, replace_token(description))


def replace_token(description: Any) -> Any:
    """Return a description with the token of another FMU."""
    other = copy.copy(description)
    other.guid = other.instantiationToken = "another"
    return other


def test_the_two_versions_share_what_they_have_in_common() -> None:
    """No body of a function stands in the templates of both."""
    bodies = []
    for name in ("fmi2.c.j2", "fmi3.c.j2"):
        text = (Path(fmu_target.__file__).parent / "templates" / name).read_text(encoding="utf-8")
        text = re.sub(r"fmi[23]", "fmi", text)
        found = set(re.findall(r"\n\{\n(.*?)\n\}\n", text, re.DOTALL))
        bodies.append({body for body in found if body.count("\n") > 1})
    assert bodies[0] & bodies[1] == set()


def test_sources_are_inside_and_the_same_export_gives_the_same_text(tmp_path: Path) -> None:
    axis = AXES["sgms_with_effects"]
    texts = []
    for name in ("a.fmu", "b.fmu"):
        write_fmu(Settings(axes=(axis,)), axis, 3, tmp_path / name)
        with zipfile.ZipFile(tmp_path / name) as archive:
            assert any(item.startswith("binaries/") for item in archive.namelist())
            texts.append((archive.read("sources/sgms_x.c"), archive.read("modelDescription.xml")))
    assert texts[0] == texts[1]


def test_units_as_base_exponents() -> None:
    assert base_exponents("N s/m") == {"kg": 1, "s": -1}
    assert base_exponents("kg m^2") == {"kg": 1, "m": 2}
    assert base_exponents("m/s^2") == {"m": 1, "s": -2}
