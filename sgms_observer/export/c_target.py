"""The observer as a folder of C: header, source, Makefile, test and test vector."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from sgms_observer.compensation.feedforward_kernel import ENABLED, OUTPUT
from sgms_observer.estimators import block
from sgms_observer.export import vector
from sgms_observer.export.axis_program import AxisProgram, constant_text, record_text, translate_axis
from sgms_observer.export.lines import wrapped
from sgms_observer.export.pieces import body_text, fill, functions_text
from sgms_observer.export.translator import Translator
from sgms_observer.export.values import REAL
from sgms_observer.filters import motion as row_of
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.status import Status

TOLERANCE = 1e-9
"""Largest difference to Python over the largest magnitude of a column, in double."""

FLOAT_TOLERANCE = 5e-2
"""The same in float: the type has seven digits, of which differences of positions lose some."""

FLOAT_VALUES = {"SGMS_TOLERANCE": 1.0e-7}
"""Constants that float needs otherwise: the S-GMS step ends where no better ratio can be told apart."""

NAME = "sgms"
"""Name of header and source, and beginning of every public name."""


def with_ekf(axis: AxisSettings) -> tuple[AxisSettings, list[str]]:
    """Return the axis with an EKF, and a warning where the YAML asks for an MHE."""
    if axis.estimator.kind == "ekf":
        return axis, []
    sentence = (
        f"Warning: {axis.name}.estimator.kind is {axis.estimator.kind}, and C has the EKF only; the EKF with the same"
        " settings is exported. Set kind: ekf to see in Python what the C code will say."
    )
    return replace(axis, estimator=replace(axis.estimator, kind="ekf")), [sentence]


def prefix_of(axis: AxisSettings, count: int) -> str:
    """Return what the C names of an axis begin with.

    Args:
        axis: the axis.
        count: of exported axes; a single one needs no name of its own.
    """
    return NAME if count == 1 else f"{NAME}_{re.sub(r'[^0-9a-zA-Z_]', '_', axis.name)}"


def c_files(settings: Settings, axes: Sequence[AxisSettings], real: str) -> tuple[dict[str, str], list[str]]:
    """Return the files of the C folder and warnings.

    Args:
        settings: of the YAML.
        axes: which of its axes.
        real: ``double`` or ``float``.
    """
    program = Translator(dict(FLOAT_VALUES))
    warnings: list[str] = []
    parts, entries, files = [], [], {}
    for axis in axes:
        own, sentences = with_ekf(axis)
        warnings += sentences
        own = replace(own, compensation=replace(own.compensation, enabled=True))
        prefix = prefix_of(axis, len(axes))
        samples = vector.vector_samples(own, settings.sample_period)
        columns = vector.columns_of(AxisObserver(own, settings.sample_period).step(samples))
        part = translate_axis(program, AxisObserver(own, settings.sample_period), prefix)
        parts.append(part)
        entries.append(_entry(part, axis, settings.sample_period, columns))
        files[entries[-1]["vector"]] = vector.vector_text(samples, columns)
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
    interface = fill("interface.c", **common, row=row, result=result, output_at=OUTPUT, enabled_at=ENABLED)
    body = body_text(program, functions, constants, wanted) + "\n" + interface
    return {
        f"{NAME}.h": fill("header.h", **common, statuses=list(Status)),
        f"{NAME}.c": re.sub(r"\n{3,}", "\n\n", fill("source.c", **common, body=body)),
        "test.c": fill(
            "test.c", **common, tolerance=TOLERANCE, float_tolerance=FLOAT_TOLERANCE, rows=vector.ROWS,
            columns=max(len(entry["columns"]) for entry in entries),
        ),
        "Makefile": fill("Makefile", **common),
    }  # fmt: skip
