"""The observer as a folder of C, with its test and test vector, and as a ROS package with a ros2_control controller."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sgms_observer.compensation.feedforward_kernel import ENABLED, GAIN, OUTPUT
from sgms_observer.errors import ConfigurationError
from sgms_observer.estimators import block
from sgms_observer.export.axis_program import AxisProgram, constant_text, record_text, translate_axis
from sgms_observer.export.lines import wrapped
from sgms_observer.export.program import c_name
from sgms_observer.export.translator import Translator, body_text, fill, functions_text
from sgms_observer.export.values import REAL
from sgms_observer.filters import motion as row_of
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.status import Status

ROWS = 4000
_CYCLES = 3.0  # of the main motion in all rows
_SPEED = 20.0  # largest speed of the main motion over the Stribeck velocity: presliding and sliding both occur
_SIDE = (0.3, 7.3)  # second motion: share of the speed, frequency over the main one

TOLERANCE = 1e-9
"""Largest difference to Python over the largest magnitude of a column, in double."""

FLOAT_TOLERANCE = 5e-2
"""The same in float: the type has seven digits, of which differences of positions lose some."""

FLOAT_VALUES = {"SGMS_TOLERANCE": 1.0e-7}
"""Constants with other values for float: the S-GMS iteration ends where float resolves no better ratio."""

NAME = "sgms"
"""Name of header and source, and beginning of every public name."""

PACKAGE = "sgms_friction_compensation"

_FILES = {
    "package.xml": "package.xml",
    "CMakeLists.txt": "CMakeLists.txt",
    f"{PACKAGE}.xml": "plugin.xml",
    "config/controllers.yaml": "controllers.yaml",
    f"include/{PACKAGE}/friction_compensation.hpp": "friction_compensation.hpp",
    "src/friction_compensation.cpp": "friction_compensation.cpp",
}


def vector_samples(axis: AxisSettings, sample_period: float) -> Samples:
    """Return a motion with reversals, and the faults that recordings have.

    The effort need not be a real stage's: any numbers will do that both sides work on. Row 1000 repeats a stamp, rows
    1500 to 1510 lack the effort, rows 2000 to 2400 the reference, and time jumps beyond ``filter.maximum_gap`` at 3000.

    Args:
        axis: settings of the axis.
        sample_period: time between two samples [s].
    """
    index = np.arange(ROWS)
    time = index * sample_period
    speed = _SPEED * axis.friction.stribeck_velocity
    rate = 2.0 * math.pi * _CYCLES / (ROWS * sample_period)
    position, velocity, acceleration = np.zeros(ROWS), np.zeros(ROWS), np.zeros(ROWS)
    for share, multiple in ((1.0, 1.0), _SIDE):
        angular = multiple * rate
        position += share * speed / angular * np.sin(angular * time)
        velocity += share * speed * np.cos(angular * time)
        acceleration -= share * speed * angular * np.sin(angular * time)
    sliding = axis.friction.coulomb_force * np.tanh(velocity / axis.friction.stribeck_velocity)
    noise = 0.01 * axis.friction.coulomb_force * np.sin(12345.678 * index)
    effort = axis.mass * acceleration + axis.friction.viscous_coefficient * velocity + sliding + noise
    stamp_ns = 1_000_000_000 + np.rint(time * 1e9).astype(np.int64)
    stamp_ns[1000] = stamp_ns[999]
    stamp_ns[3000:] += int(2e9 * axis.filter.maximum_gap)
    effort[1500:1511] = math.nan
    reference, reference_velocity = position.copy(), velocity.copy()
    reference[2000:2401] = math.nan
    reference_velocity[2000:2401] = math.nan
    return Samples(stamp_ns, position, effort, reference, reference_velocity)


def _columns_of(estimates: Estimates) -> list[tuple[str, str, np.ndarray]]:
    """Return name, member of the C output and values of each compared column, the status last."""
    single = (
        "position", "velocity", "acceleration", "friction", "friction_std", "compensation", "innovation",
        "innovation_std",
    )  # fmt: skip
    columns = [(name, name, getattr(estimates, name)) for name in single]
    many = (
        ("element_force", estimates.element_force),
        ("parameter", estimates.parameters),
        ("parameter_std", estimates.parameter_std),
    )
    for name, table in many:
        columns += [(f"{name}_{i + 1}", f"{name}[{i}]", table[:, i]) for i in range(table.shape[1])]
    return [*columns, ("status", "status", estimates.status.astype(float))]


def _vector_text(samples: Samples, columns: list[tuple[str, str, np.ndarray]]) -> str:
    """Return inputs and the columns of ``_columns_of`` as CSV, every number with all its digits."""
    inputs = ("position", "effort", "reference_position", "reference_velocity")
    head = ",".join(["stamp_ns", *inputs, *(f"python_{name}" for name, _member, _values in columns)])
    table = np.column_stack([*(getattr(samples, name) for name in inputs), *(values for *_names, values in columns)])
    rows = [
        f"{stamp}," + ",".join(f"{value:.17g}" for value in row)
        for stamp, row in zip(samples.stamp_ns, table, strict=True)
    ]
    return "\n".join([head, *rows]) + "\n"


def with_ekf(axis: AxisSettings) -> tuple[AxisSettings, list[str]]:
    """Return the axis with an EKF, and a warning where the YAML asks for an MHE."""
    if axis.estimator.kind == "ekf":
        return axis, []
    sentence = (
        f"Warning: {axis.name}.estimator.kind is {axis.estimator.kind}, and C has the EKF only; the EKF with the same"
        " settings is exported. Set kind: ekf to see in Python what the C code will say."
    )
    return replace(axis, estimator=replace(axis.estimator, kind="ekf")), [sentence]


def _prefix_of(axis: AxisSettings, count: int) -> str:
    """Return what the C names of an axis begin with; a single one (``count``) needs no name of its own."""
    return NAME if count == 1 else f"{NAME}_{c_name(axis.name)}"


def _refuse_equal_prefixes(axes: Sequence[AxisSettings]) -> None:
    """Raise if two axes would have the same C names."""
    names: dict[str, str] = {}
    for axis in axes:
        prefix = _prefix_of(axis, len(axes))
        other = names.setdefault(prefix, axis.name)
        if other != axis.name:
            raise ConfigurationError(
                [
                    f"axes {other} and {axis.name} are both {prefix} in C; rename one of them, or export each by itself"
                    " with --axis"
                ]
            )


def c_files(settings: Settings, axes: Sequence[AxisSettings], real: str) -> tuple[dict[str, str], list[str]]:
    """Return the files of the C folder and warnings.

    Args:
        settings: of the YAML.
        axes: which of its axes.
        real: ``double`` or ``float``.

    Raises:
        ConfigurationError: two axes have the same name in C, or something in the YAML cannot be exported.
    """
    _refuse_equal_prefixes(axes)
    program = Translator(dict(FLOAT_VALUES))
    warnings: list[str] = []
    parts, entries, files = [], [], {}
    for axis in axes:
        exported, sentences = with_ekf(axis)
        warnings += sentences
        exported = replace(exported, compensation=replace(exported.compensation, enabled=True))
        prefix = _prefix_of(axis, len(axes))
        samples = vector_samples(exported, settings.sample_period)
        columns = _columns_of(AxisObserver(exported, settings.sample_period).step(samples))
        part = translate_axis(program, AxisObserver(exported, settings.sample_period), prefix)
        parts.append(part)
        entries.append(_entry(part, axis, settings.sample_period, columns))
        files[entries[-1]["vector"]] = _vector_text(samples, columns)
    files.update(_sources(program, parts, entries, axes, real))
    return files, warnings


def _entry(part: AxisProgram, axis: AxisSettings, sample_period: float, columns: list[Any]) -> dict[str, Any]:
    """Return what the templates ask of one axis."""
    prefix = part.memory.prefix
    starts = part.memory.starts
    if not axis.compensation.enabled:
        starts["feedforward"][ENABLED] = 0.0
    return {
        "name": axis.name,
        "prefix": prefix,
        "sample_period": sample_period,
        "enabled": axis.compensation.enabled,
        "gain": axis.compensation.gain,
        "elements": len(axis.friction.element_stiffness),
        "parameters": axis.estimator.parameters,
        "records": "\n\n".join(record_text(record) for record in part.records),
        "members": list(part.memory.members.values()),
        "starts": [constant_text(f"{prefix}_start_{name}", REAL, data) for name, data in starts.items()],
        "copies": [(name, f"{prefix}_start_{name}", data.size) for name, data in starts.items()],
        "locals": [f"real {name}[{size}]" for name, size in part.locals.items() if name in part.call],
        "call": "\n".join(wrapped(f"    {part.call}")).strip(),
        "scales": (axis.position_scale, axis.effort_scale),
        "vector": f"test_vector_{axis.name}.csv",
        "columns": [name for name, _member, _values in columns],
        "expressions": [member for _name, member, _values in columns],
    }


def _either(units: Iterable[str]) -> str:
    """Return the unit of all axes, or the ones that they have."""
    return " or ".join(dict.fromkeys(units))


def _sources(
    program: Translator, parts: Sequence[AxisProgram], entries: list[dict[str, Any]], axes: Sequence[AxisSettings],
    real: str,
) -> dict[str, str]:  # fmt: skip
    """Return header, source, test and Makefile."""
    functions = functions_text(program, [part.call for part in parts])
    constants = [
        constant_text(name, kind, data) for part in parts for name, (kind, data) in part.memory.constants.items()
    ]
    wanted = functions + "".join(part.call for part in parts)
    plural = "axes" if len(axes) > 1 else "axis"
    common: dict[str, Any] = {
        "name": NAME,
        "title": f"Friction observer and compensation of {plural} {', '.join(axis.name for axis in axes)}.",
        "axes": entries,
        "real": real,
        "is_coupled": any("input->other_" in part.call for part in parts),
        "unit": {
            "position": _either(item.units.position for item in axes),
            "effort": _either(item.units.effort for item in axes),
        },
    }
    row = {name: getattr(row_of, name.upper()) for name in ("present_position", "present_velocity")}
    row["present_acceleration"] = row_of.PRESENT_ACCELERATION
    names = ("friction", "friction_std", "innovation", "innovation_std", "status")
    result = {name: getattr(block, name.upper()) for name in names} | {"size": block.RESULT_SIZE}
    places = {"output_at": OUTPUT, "enabled_at": ENABLED, "gain_at": GAIN}
    interface = fill("interface.c", **common, row=row, result=result, **places)
    body = body_text(program, functions, constants, wanted) + "\n" + interface
    return {
        f"{NAME}.h": fill("header.h", **common, statuses=list(Status)),
        f"{NAME}.c": re.sub(r"\n{3,}", "\n\n", fill("source.c", **common, body=body)),
        "test.c": fill(
            "test.c", **common, tolerance=TOLERANCE, float_tolerance=FLOAT_TOLERANCE, rows=ROWS,
            columns=max(len(entry["columns"]) for entry in entries),
        ),
        "Makefile": fill("Makefile", **common),
    }  # fmt: skip


def controller_files(axes: Sequence[AxisSettings], sources: Mapping[str, str], sample_period: float) -> dict[str, str]:
    """Return the files of the package.

    Args:
        axes: the exported axes.
        sources: files of the C folder; its test comes along in ``test_c``.
        sample_period: of the parameter file [s].
    """
    entries = [
        {
            "name": axis.name,
            "prefix": _prefix_of(axis, len(axes)),
            "scales": (axis.position_scale, axis.effort_scale),
            "enabled": axis.compensation.enabled,
            "gain": axis.compensation.gain,
        }
        for axis in axes
    ]
    values = {
        "package": PACKAGE,
        "name": NAME,
        "axes": entries,
        "joints": [axis.name for axis in axes],
        "rate": round(1.0 / sample_period),
    }
    files = {path: fill(f"ros2_control/{template}", **values) for path, template in _FILES.items()}
    for name, text in sources.items():
        if name in (f"{NAME}.c", f"{NAME}.h"):
            files[f"src/{name}"] = text
        files[f"test_c/{name}"] = text
    return {path: re.sub(r"\n{3,}", "\n\n", text) for path, text in files.items()}
