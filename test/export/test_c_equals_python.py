"""The exported C says what Python says, for every effect, filter, model and estimated parameter."""

from __future__ import annotations

import math
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from c_build import COMPILERS, SANITIZED, STRICT, assert_equal, can_sanitize, exported, needs, run_vector

from sgms_observer.effects.catalogue import BUILT_IN, effect
from sgms_observer.effects.effect import Effect, EffectParameter, flat_values
from sgms_observer.errors import ConfigurationError
from sgms_observer.export import c_target
from sgms_observer.export.c_target import vector_samples
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import (
    ESTIMABLE,
    AxisSettings,
    CompensationSettings,
    EffectSettings,
    EstimatorSettings,
    FilterSettings,
    FrictionSettings,
    Settings,
)
from sgms_observer.settings.load import load_settings

CONFIG = Path(__file__).resolve().parents[2] / "config"
TEXT: dict[str, Any] = {"capture_output": True, "text": True, "check": False, "timeout": 120}
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
    flags = SANITIZED if can_sanitize(compiler) else STRICT
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
    assert_equal(tmp_path, "gcc", SANITIZED if can_sanitize("gcc") else STRICT)


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


@pytest.mark.parametrize("parameters", [(), ESTIMABLE])
@pytest.mark.parametrize("model", ["sgms", "gms"])
def test_one_element(model: str, parameters: tuple[str, ...], tmp_path: Path) -> None:
    """As identify writes it: loops over elements are written out, and nothing of their counters is left."""
    friction = FrictionSettings(
        model=model, element_stiffness=(1.0e6,), element_fraction=(1.0,), element_damping=(0.0,)
    )
    estimator = EstimatorSettings(kind="ekf", parameters=parameters)
    assert_equal(exported(tmp_path, (replace(AXIS, friction=friction, estimator=estimator),)))


EXTREME_STAMPS = """
#include "sgms.h"
#include <math.h>
#include <stdlib.h>
int main(void)
{
    static const int64_t stamps[] = {
        INT64_MAX, INT64_MIN, 0, INT64_MIN, INT64_MAX, INT64_MAX, INT64_MIN + 1, INT64_MIN / 2 - 1, INT64_MAX / 2 + 1,
        -INT64_MAX / 2, INT64_MAX / 2, -1, 1000000000, 1000100000
    };
    static const double kept[] = {NAN, INFINITY, -INFINITY, 1.0e300, 0.0};
    static sgms_state state;
    for (int first = 0; first < 14; first++) {
        sgms_init(&state);
        for (int i = 0; i < 14 * 5; i++) {
            const double odd = kept[i / 14];
            const sgms_input input = {
                .stamp_ns = stamps[(first + i) % 14], .position = odd, .effort = 1.0, .reference_position = odd,
                .reference_velocity = odd
            };
            sgms_output output;
            sgms_step(&state, &input, &output);
            if (!isfinite(output.compensation)) {
                return EXIT_FAILURE;
            }
        }
    }
    return EXIT_SUCCESS;
}
"""


@pytest.mark.parametrize("compiler", COMPILERS)
@pytest.mark.parametrize("kind", ["lowpass", "savgol", "kalman"])
def test_any_stamp_and_any_measurement_is_defined(kind: str, compiler: str, tmp_path: Path) -> None:
    """No sum of two stamps leaves 64 bits, and whatever a drive hands over the compensation is a number."""
    if not can_sanitize(compiler):
        pytest.skip(f"{compiler} has no sanitizer libraries")
    effects = tuple(with_strength(entry) for entry in BUILT_IN)
    exported(tmp_path, (replace(AXIS, filter=FilterSettings(kind=kind), effects=effects),))
    (tmp_path / "extreme.c").write_text(EXTREME_STAMPS, encoding="utf-8")
    program = str(tmp_path / "extreme")
    sources = [str(tmp_path / name) for name in ("extreme.c", "sgms.c")]
    undefined = [*SANITIZED.split(), "-fsanitize=float-cast-overflow"]
    built = subprocess.run([compiler, "-std=c99", *undefined, "-o", program, *sources, "-lm"], **TEXT)
    assert built.returncode == 0, built.stderr
    done = subprocess.run([program], **TEXT)
    assert done.returncode == 0, done.stderr


GAINS = """
#include "sgms.h"
#include <math.h>
#include <stdio.h>
static double largest(sgms_state *state)
{
    double found = 0.0;
    for (int k = 0; k < 20000; k++) {
        const double rate = 31.4, t = 1.0e-4 * k, q = 1.0e-3 * sin(rate * t);
        const sgms_input input = {1000000000 + 100000 * (int64_t)k, q, 0.0, q, 1.0e-3 * rate * cos(rate * t)};
        sgms_output output;
        sgms_step(state, &input, &output);
        found = k > 10000 ? fmax(found, fabs(output.compensation)) : found;
    }
    return found;
}
int main(void)
{
    static sgms_state state;
    static const double gains[] = {0.5, 2.0, -1.0, NAN, 0.0};
    sgms_init(&state);
    sgms_enable(&state, true);
    for (int i = 0; i < 5; i++) {
        sgms_set_gain(&state, gains[i]);
        sgms_reset(&state);
        printf("%.9f\\n", largest(&state));
    }
    return 0;
}
"""


def test_the_gain_is_limited_and_stays_through_a_reset(tmp_path: Path) -> None:
    off = replace(AXIS, compensation=CompensationSettings(enabled=False))
    exported(tmp_path, (off,))
    (tmp_path / "gains.c").write_text(GAINS, encoding="utf-8")
    sources = [str(tmp_path / name) for name in ("gains.c", "sgms.c")]
    built = subprocess.run(["gcc", "-std=c99", *STRICT.split(), "-o", str(tmp_path / "gains"), *sources, "-lm"], **TEXT)
    assert built.returncode == 0, built.stderr
    half, whole, negative, no_number, none = map(
        float, subprocess.run([str(tmp_path / "gains")], **TEXT).stdout.split()
    )
    assert half > 1.0  # N of 4 N Coulomb friction
    assert whole == pytest.approx(2.0 * half, rel=0.01)
    assert (negative, no_number, none) == (whole, whole, 0.0)


def test_the_latest_stamp_of_ros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A stamp of ROS has 32 bits for the seconds."""

    def late(axis: AxisSettings, sample_period: float) -> Samples:
        samples = vector_samples(axis, sample_period)
        return replace(samples, stamp_ns=samples.stamp_ns + (2**31 - 100) * 10**9)

    monkeypatch.setattr(c_target, "vector_samples", late)
    assert_equal(exported(tmp_path, (AXIS,)))


def test_axes_that_are_one_name_in_c_are_refused() -> None:
    axes = tuple(replace(AXIS, name=name) for name in ("x", "a-b", "a_b"))
    settings = Settings(axes=axes)
    with pytest.raises(ConfigurationError) as refused:
        c_target.c_files(settings, axes, "double")
    assert refused.value.sentences == (
        "axes a-b and a_b are both sgms_a_b in C; rename one of them, or export each by itself with --axis",
    )
    assert "sgms_step(" in c_target.c_files(settings, axes[1:2], "double")[0]["sgms.h"]


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
