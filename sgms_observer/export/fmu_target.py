"""The simulated stage with its effects as an FMU: C sources, a library for this machine, modelDescription.xml."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer import __version__
from sgms_observer.effects.compiled import SCRATCH
from sgms_observer.effects.kernels import measured_position
from sgms_observer.errors import ConfigurationError
from sgms_observer.export.axis_program import Memory, constant_text, user_value
from sgms_observer.export.fmu_variables import Variable, base_exponents, stage_variables
from sgms_observer.export.lines import wrapped
from sgms_observer.export.program import c_name, snake, source_of
from sgms_observer.export.translator import Translator, body_text, fill, functions_text, struct_text
from sgms_observer.export.values import INT, LONG, REAL, Array, Struct, Value, number
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.whole_file import write_bytes
from sim_plant.kernel import RECORDED, quantised, run_samples
from sim_plant.stage import SimulatedStage

MEASURED, FRICTION, EFFECT = range(3)
ENDS = 3

_PREFIX = "stage"
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden")


def stage_tick(
    constants: Any,
    friction: Any,
    effects: Any,
    user: Any,
    gains: Any,
    memory: Any,
    tick: int,
    tick_plan: Any,
    sample_plan: Any,
    effort: Any,
    other: Any,
    recorded: Any,
    element_force: Any,
    ends: Any,
) -> None:
    """Move the stage by one tick of its controller.

    Args:
        constants, friction, effects, user, gains, memory: as for ``run_samples``, with one tick per sample.
        tick: number of ticks since the start.
        tick_plan: reference and encoder noise of the tick, shape (4, 1).
        sample_plan: noise of the recorded effort and disturbance [N], shape (2, 1).
        effort: added to the controller's effort [N], shape (1,).
        other: velocity [m/s] and acceleration [m/s^2] of the other axis.
        recorded, element_force: written: what was at the tick's start.
        ends: written: measured position [m], friction [N] and force of the effects [N] at its end, shape (ENDS,).
    """
    run_samples(
        constants, friction, effects, user, gains, memory, tick, 0, tick_plan, sample_plan, effort, other, recorded,
        element_force,
    )  # fmt: skip
    position = memory.motion[0]
    if effects.kinds.shape[0] > 0:
        position = measured_position(effects.kinds, effects.p_at, effects.parameters, position)
    ends[MEASURED] = quantised(position, constants.resolution)
    total = friction.viscous * memory.motion[1] + memory.motion[3]
    for i in range(memory.force.shape[0]):
        total += memory.force[i]
    ends[FRICTION] = total
    ends[EFFECT] = memory.motion[4]


def _struct(memory: Memory, instance: Any, fixed: Sequence[str] = ()) -> Struct:
    """Return a NamedTuple as a C structure; what is fixed becomes constants of the file."""
    fields: list[tuple[str, Any]] = []
    bound: dict[str, Value] = {}
    for name, value in zip(instance._fields, instance, strict=True):
        if isinstance(value, np.ndarray):
            if name in fixed:
                bound[name] = memory.constant(name, value, binds=True, selects=True)
            else:
                fields.append((name, Array(INT if value.dtype.kind == "i" else REAL, value.shape)))
        elif isinstance(value, bool) or name in fixed:
            bound[name] = number(value)
        else:
            fields.append((name, REAL))
    return Struct(f"{snake(type(instance).__name__)}_struct", tuple(fields), bound)


def _stage_source(settings: Settings, axis: AxisSettings, fmi: int) -> tuple[str, list[Variable], float]:
    """Return the C source of the FMU of FMI version ``fmi``, its real variables, and the time between two ticks [s]."""
    stage = SimulatedStage(axis, settings.sample_period)
    parts = stage.parts
    constants = parts.constants._replace(ticks_per_sample=1)
    program, memory = Translator(), Memory(_PREFIX)
    structs = [
        _struct(memory, constants, ("tick", "substeps", "ticks_per_sample", "delay_substeps")),
        _struct(memory, parts.friction),
        _struct(memory, parts.effects, ("kinds", "p_at", "s_at")),
        _struct(memory, parts.gains),
        _struct(memory, parts.memory),
    ]
    names = ("constants", "friction", "effects", "gains", "memory")
    members = {name: Value(f"stage->{name}", struct) for name, struct in zip(names, structs, strict=True)}
    members["gains"] = Value("gains", structs[3])

    def local(name: str, shape: tuple[int, ...]) -> Value:
        return Value(name, Array(REAL, shape), is_stable=True)

    elements = len(parts.memory.force)
    arguments = [
        members["constants"], members["friction"], members["effects"], user_value(parts.compiled_effects),
        members["gains"], members["memory"], Value("stage->tick", LONG), local("tick_plan", (4, 1)),
        local("sample_plan", (2, 1)), local("effort", (1,)), local("other", (2,)), local("recorded", (1, RECORDED)),
        local("element_force", (1, elements)), local("ends", (ENDS,)),
    ]  # fmt: skip
    source = source_of(stage_tick)
    assert source is not None
    for struct in structs:
        program.structs[struct.name] = struct
    function = program.function(source, arguments)
    texts = [
        f"&{item.text}" if isinstance(item.type, Struct) else item.text
        for parameter, item in zip(function.parameters, arguments, strict=True)
        if parameter.is_used
    ]
    call = f"{function.name}({', '.join(texts)})"
    functions = functions_text(program, [call])
    tables = [constant_text(name, kind, data) for name, (kind, data) in memory.constants.items()]
    start = float(parts.memory.motion[0])
    variables = stage_variables(parts, parts.compiled_effects.names, axis.units, start)
    has_effects = bool(structs[2].fields and parts.memory.effect_state.size)
    body = body_text(program, functions, tables, functions + call + "".join(item.name for item in structs))
    values = {
        "axis": axis.name,
        "tick": repr(float(constants.tick)),
        "call": "\n".join(wrapped(f"        {call}")).strip(),
        "is_effort": "memory" in call,
        "variables": variables,
        "elements": max(elements, 1),
        "effect_state": [repr(float(value)) for value in parts.compiled_effects.initial_state()] if has_effects else [],
        "members": [f"{struct.name} {name}" for name, struct in zip(names, structs, strict=True)],
        "missing_structs": [struct_text(item) for item in structs if f"}} {item.name};" not in body],
        "velocity_keep": repr(float(parts.gains.velocity_keep)),
        "period": repr(float(parts.gains.period)),
        "smoothing": [
            (name, repr(float(getattr(parts.friction, name))))
            for name in ("smoothing_lambda", "smoothing_zeta", "smoothing_gamma")
        ],
        "hidden_parameters": [repr(float(value)) for value in parts.effects.parameters],
        "is_coupled": stage.is_coupled,
        "recorded": RECORDED,
        "ends": ENDS,
        "scratch": SCRATCH,
    }
    text = fill("stage.c", body=body, **values) + fill(f"fmi{fmi}.c", token=_token(body), **values)
    return text, variables, float(constants.tick)


def _token(text: str) -> str:
    """Return the identifier of this FMU."""
    digest = hashlib.sha256(f"{__version__}{text}".encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def write_fmu(settings: Settings, axis: AxisSettings, fmi: int, path: Path) -> tuple[str, ...]:
    """Write the FMU of one axis and return the names of the files in it.

    Args:
        settings: of the YAML.
        axis: the axis.
        fmi: version, 2 or 3.
        path: of the FMU.

    Raises:
        ConfigurationError: no C compiler, or a stage that cannot be exported.
        RecordingError: the file cannot be written.
    """
    model = f"sgms_{c_name(axis.name)}"
    axis = replace(axis, stage=replace(axis.stage, force_noise=0.0, disturbance_noise=0.0))
    source, variables, tick = _stage_source(settings, axis, fmi)
    token = source.split('#define STAGE_TOKEN "', 1)[1].split('"', 1)[0]
    units = {item.unit: base_exponents(item.unit) for item in variables if item.unit}
    units.setdefault("s", base_exponents("s"))
    description = fill(
        f"modelDescription{fmi}.xml", model=model, token=token, variables=variables, units=units, tick=repr(tick),
        axis=axis.name, outputs=[item for item in variables if item.causality == "output"],
    )  # fmt: skip
    folder, suffix = _binary_place(fmi)
    files: dict[str, bytes] = {
        "modelDescription.xml": description.encode(),
        f"sources/{model}.c": source.encode(),
        f"binaries/{folder}/{model}{suffix}": _compiled(source, model, suffix),
    }
    if fmi == 3:
        files["sources/buildDescription.xml"] = fill("buildDescription.xml", model=model).encode()
    with tempfile.TemporaryDirectory() as room:
        packed = Path(room) / "packed.fmu"
        with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in files.items():
                archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content)
        write_bytes(packed.read_bytes(), path)
    return tuple(files)


def _binary_place(fmi: int) -> tuple[str, str]:
    """Return folder and suffix of a library for this machine, as FMI names them."""
    machine = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}.get(
        platform.machine().lower(), platform.machine()
    )
    if sys.platform.startswith("linux"):
        return (f"{machine}-linux" if fmi == 3 else "linux64" if machine == "x86_64" else f"{machine}-linux"), ".so"
    if sys.platform == "darwin":
        return (f"{machine}-darwin" if fmi == 3 else "darwin64"), ".dylib"
    raise ConfigurationError([f"sgms export builds FMUs on Linux and macOS, not on {sys.platform}; export there"])


def _compiled(source: str, model: str, suffix: str) -> bytes:
    """Return the library, built with the machine's C compiler."""
    compiler = os.environ.get("CC", "cc")
    if shutil.which(compiler) is None:
        raise ConfigurationError([f"an FMU needs a C compiler and there is no {compiler}; install gcc, or set CC"])
    with tempfile.TemporaryDirectory() as room:
        file, library = Path(room) / f"{model}.c", Path(room) / f"{model}{suffix}"
        file.write_text(source, encoding="utf-8")
        command = [compiler, *_FLAGS, "-o", str(library), str(file), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            first = (done.stderr.strip().splitlines() or ["it printed nothing"])[0]
            raise ConfigurationError([f"{compiler} could not build the FMU: {first}; set CC to another C compiler"])
        return library.read_bytes()
