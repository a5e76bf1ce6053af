"""The exported C says what Python says, for every effect, filter, model and estimated parameter."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from c_build import COMPILERS, SANITIZED, STRICT, assert_equal, can_sanitize, exported, needs, run_vector

from sgms_observer.effects.catalogue import BUILT_IN, effect
from sgms_observer.effects.effect import Effect, EffectParameter, flat_values
from sgms_observer.settings.axis import (
    ESTIMABLE,
    AxisSettings,
    CompensationSettings,
    EffectSettings,
    EstimatorSettings,
    FilterSettings,
    FrictionSettings,
)
from sgms_observer.settings.load import load_settings

CONFIG = Path(__file__).resolve().parents[2] / "config"
pytestmark = needs("gcc", "make")

AXIS = AxisSettings(
    estimator=EstimatorSettings(kind="ekf"), compensation=CompensationSettings(enabled=True, look_ahead=1.0e-3)
)


GRID = {
    "position": (-3.0e-4, -1.0e-4, 2.0e-4),
    "velocity": (-2.0e-2, 0.0, 1.0e-2, 2.0e-2),
    "acceleration": (-5.0, 5.0),
    "load": (0.0, 2.0, 4.0),
    "time": (0.0, 0.1, 0.3),
    "travel": (0.0, 1.0e-3, 5.0e-3),
    "dwell": (0.0, 0.1),
    "rest": (0.0, 0.05, 0.2),
}


def table_over(entry: Effect, coordinates: tuple[str, ...]) -> EffectSettings:
    """Return a learnt map with a table of alternating forces."""
    grids = {name: GRID[name] for name in coordinates if name != "direction"}
    size = math.prod(2 if name == "direction" else len(grids[name]) for name in coordinates)
    values = tuple(0.1 * (1 + k) * (-1) ** k for k in range(size))
    return EffectSettings(entry.name, flat_values(entry, {"coordinates": coordinates, "values": values, **grids}))


def with_strength(entry: Effect) -> EffectSettings:
    """Return an effect that acts: every strength is different from its default."""

    if entry.lists:
        return table_over(entry, ("position", "direction"))

    def value(parameter: EffectParameter) -> float:
        wanted = 0.2 if parameter.is_strength or parameter.name in ("limit", "width") else parameter.default
        wanted = 2.5e-4 if entry.name == "actuator_delay" else wanted
        wanted = 1.0e-9 if parameter.unit == "m" and parameter.is_strength else wanted
        return min(max(wanted, parameter.minimum), parameter.maximum)

    return EffectSettings(entry.name, tuple(value(parameter) for parameter in entry.parameters))


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("name", ["paper", "table"])
def test_shipped_files_sanitized(name: str, compiler: str, tmp_path: Path) -> None:
    """One and two axes, lowpass and savgol, with the sanitizers that the issue names."""
    settings = load_settings(CONFIG / f"{name}.yaml")
    exported(tmp_path, settings.axes, sample_period=settings.sample_period)
    flags = SANITIZED if can_sanitize(compiler, tmp_path) else STRICT
    assert_equal(tmp_path, compiler, flags)
    if flags == STRICT:
        pytest.skip(f"{compiler} has no sanitizer libraries; built without them, and equal")


@pytest.mark.parametrize("entry", BUILT_IN, ids=lambda entry: entry.name)
def test_every_effect_of_the_catalogue(entry: Effect, tmp_path: Path) -> None:
    axis = replace(AXIS, effects=(with_strength(entry),))
    folder = exported(tmp_path, (axis,))
    assert_equal(folder, "gcc", "-O0 -Wall -Wextra -Werror")


@pytest.mark.parametrize(
    "coordinates",
    [
        ("direction",),
        ("velocity", "load"),
        ("direction", "acceleration"),
        ("time", "travel"),
        ("dwell", "position"),
        ("rest", "direction"),
    ],
    ids="_".join,
)
def test_a_learnt_map_over_any_coordinates(coordinates: tuple[str, ...], tmp_path: Path) -> None:
    effects = (table_over(effect("learnt_map"), coordinates),)
    assert_equal(exported(tmp_path, (replace(AXIS, effects=effects),)), "gcc", "-O0 -Wall -Wextra -Werror")


def test_all_effects_at_once_sanitized(tmp_path: Path) -> None:
    effects = tuple(with_strength(entry) for entry in BUILT_IN if entry.name != "actuator_dead_zone")
    exported(tmp_path, (replace(AXIS, effects=effects),))
    assert_equal(tmp_path, "gcc", SANITIZED if can_sanitize("gcc", tmp_path) else STRICT)


@pytest.mark.parametrize("kind", ["lowpass", "savgol", "kalman"])
@pytest.mark.parametrize("aligned", [True, False])
def test_every_filter(kind: str, aligned: bool, tmp_path: Path) -> None:
    filters = FilterSettings(kind=kind, align_effort=aligned, effort_is_held=aligned, position_noise=1e-8)
    assert_equal(exported(tmp_path, (replace(AXIS, filter=filters),)))


@pytest.mark.parametrize("reset", ["paper", "rate_independent"])
@pytest.mark.parametrize(("model", "modes"), [("sgms", "simulated"), ("gms", "simulated"), ("gms", "predicted")])
def test_every_model_with_all_parameters_estimated(model: str, modes: str, reset: str, tmp_path: Path) -> None:
    friction = FrictionSettings(model=model, reset=reset, element_damping=(2.0, 0.0, 1.0, 3.0))
    estimator = EstimatorSettings(
        kind="ekf", parameters=ESTIMABLE, parameter_walk=1e-3, outlier_nis=25.0, gms_modes=modes, correction_every=7
    )
    assert_equal(exported(tmp_path, (replace(AXIS, friction=friction, estimator=estimator),)))


def test_a_broken_vector_is_found(tmp_path: Path) -> None:
    """The shipped test can fail: one changed number among the 4000 rows is enough."""
    exported(tmp_path, (AXIS,))
    path = tmp_path / "test_vector_x.csv"
    lines = path.read_text(encoding="utf-8").splitlines()
    cells = lines[2500].split(",")
    cells[8] = repr(float(cells[8]) * (1.0 + 1e-7))
    lines[2500] = ",".join(cells)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    done = run_vector(tmp_path)
    assert done.returncode != 0
    assert "UNEQUAL x friction" in done.stdout


def test_float_is_as_near_as_seven_digits_allow(tmp_path: Path) -> None:
    exported(tmp_path, (AXIS,), "float")
    assert_equal(tmp_path)


def test_c_allocates_nothing_and_has_no_variable_of_its_own(tmp_path: Path) -> None:
    source = (exported(tmp_path, (AXIS,)) / "sgms.c").read_text(encoding="utf-8")
    assert not any(word in source for word in ("malloc", "calloc", "realloc", "while (", "goto"))
    globals_ = [line for line in source.splitlines() if line.startswith("static ") and line.endswith("{")
                and "(" not in line]  # fmt: skip
    assert globals_
    assert all(line.startswith("static const ") for line in globals_)
