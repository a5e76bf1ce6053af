"""The observer of one axis as C: its constants, what it remembers, and the translated step."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Floats
from sgms_observer.compensation.feedforward_kernel import VERDICT
from sgms_observer.compensation.motion_ahead import AHEAD_WIDTH, MEMORY_SIZE
from sgms_observer.effects.catalogue import effect, is_built_in
from sgms_observer.effects.compiled import SCRATCH, CompiledEffects
from sgms_observer.effects.user_kernels import user_step_lines
from sgms_observer.estimators import memory as at
from sgms_observer.export.program import Program, Source, source_of
from sgms_observer.export.sample import observe_sample
from sgms_observer.export.values import (
    FIELD_OFFSET,
    INT,
    LONG,
    NONE,
    REAL,
    Array,
    Record,
    Scalar,
    Struct,
    Value,
    number,
    real_text,
)
from sgms_observer.filters import layout
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.status import Status

COUNTERS = {
    layout.HAS_PREVIOUS: "has_previous",
    layout.STAMP_HIGH: "stamp_high",
    layout.STAMP_LOW: "stamp_low",
    layout.COUNT: "count",
    layout.SEEN_HIGH: "seen_high",
    layout.SEEN_LOW: "seen_low",
}
"""Entries of the filter's state that count or hold stamps: whole numbers in C, so that float loses none of them."""

OTHER_MOTION = ("other_velocity", "other_acceleration", "other_velocity_ahead", "other_acceleration_ahead")
"""Members of the input that an axis with ``cross_axis_coupling`` needs."""

_HEADER = {at.COUNT: "count", at.SAMPLES: "samples", at.EKF_NEXT: "ekf_next", at.STARTED: "started"}
_FIRST_CHANGING = at.X_HAT


@dataclass
class Memory:
    """What a C program keeps: constants of the file, and members of its state.

    Attributes:
        prefix: what every global name begins with.
        constants: name to entries of each constant array.
        members: name to declaration of each member of the state.
        starts: name to entries of each member that does not start at zero.
    """

    prefix: str
    constants: dict[str, tuple[Scalar, NDArray[Any]]] = field(default_factory=dict)
    members: dict[str, str] = field(default_factory=dict)
    starts: dict[str, NDArray[Any]] = field(default_factory=dict)

    def constant(self, name: str, data: NDArray[Any], binds: bool = False, selects: bool = False) -> Value:
        """Return a constant array of the file.

        Args:
            name: its name after the prefix.
            data: its entries.
            binds: functions are written for it.
            selects: the translator decides what it selects.
        """
        kind = INT if data.dtype.kind == "i" else REAL
        label = f"{self.prefix}_{name}"
        self.constants[label] = (kind, data)
        return Value(label, Array(kind, data.shape), data=data, binds=binds, selects=selects, is_stable=True)

    def member(
        self, name: str, shape: tuple[int, ...], start: NDArray[Any] | None = None, kind: Scalar = REAL
    ) -> Value:
        """Return an array in the state.

        Args:
            name: its name.
            shape: its lengths.
            start: what it starts with; zeros without.
            kind: type of its entries.
        """
        array = Array(kind, shape)
        self.members[name] = f"{public(kind)} {name}[{max(array.size, 1)}]"
        if start is not None and np.any(start != 0.0):
            self.starts[name] = start
        return Value(f"state->{name}", array, is_stable=True)


def public(kind: Scalar) -> str:
    """Return a type's name in the header."""
    return "sgms_real" if kind is REAL else kind.c


def constant_text(name: str, kind: Scalar, data: NDArray[Any]) -> str:
    """Return the definition of a constant array."""
    flat = data.ravel()
    parts = [real_text(float(value)) if kind is REAL else str(int(value)) for value in flat] or ["0"]
    rows = [", ".join(parts[i : i + 6]) for i in range(0, len(parts), 6)]
    return f"static const {kind.c} {name}[{max(len(flat), 1)}] = {{\n    " + ",\n    ".join(rows) + "\n};"


def estimator_record(memory: Memory, flat: Floats) -> Record:
    """Return the estimator's memory as a structure: what changes are members, what does not are constants."""
    constants = {
        index: number(float(flat[index])) for index in range(at.HEADER) if index not in _HEADER and index < at.COUNT
    }
    fields = {}
    for place, name in enumerate(at.NAMES):
        values = getattr(at.Memory(flat), name)
        if place < _FIRST_CHANGING:
            selects = place == at.KINDS
            constants[FIELD_OFFSET + place] = memory.constant(name, values.copy(), binds=True, selects=selects)
        else:
            fields[place] = (name, Array(REAL, values.shape))
    entries = {index: (name, REAL) for index, name in _HEADER.items()}
    return Record(f"{memory.prefix}_estimator", entries, fields, constants)


def filter_record(memory: Memory, size: int) -> Record:
    """Return the filter's state as a structure."""
    entries = {index: (name, LONG) for index, name in COUNTERS.items()}
    return Record(f"{memory.prefix}_filter", entries, {}, {}, (size,))


def record_text(record: Record) -> str:
    """Return the definition of a structure with the members that the program uses."""
    lines = [f"    {public(kind)} {name};" for name, kind in record.entries.values() if name in record.used]
    lines += [
        f"    {public(kind.item)} {name}[{max(kind.size, 1)}];"
        for name, kind in record.fields.values()
        if name in record.used
    ]
    if record.tail is not None and "at" in record.used:
        lines.append(f"    sgms_real at[{record.tail[0]}];")
    return "typedef struct {\n" + "\n".join(lines) + f"\n}} {record.name};"


def user_value(effects: CompiledEffects) -> Value:
    """Return the users' own effects as one function to translate, or None in Python's sense without any."""
    users = [effect(name) for name in effects.names if not is_built_in(name)]
    if not users:
        return NONE
    lines, formulas = user_step_lines(users)
    tree = ast.parse("\n".join(lines)).body[0]
    assert isinstance(tree, ast.FunctionDef)
    source = Source("user_step", "the effects of your own", "Advance an effect of the user's own.", formulas, tree)
    return Value("user", None, const=source)


@dataclass
class AxisProgram:
    """The translated observer of one axis.

    Attributes:
        observer: what was translated.
        memory: its constants and its state.
        records: structures of filter and estimator.
        call: the call of the translated step; it reads ``state``, ``input``, ``stamp_ns`` and the locals.
        locals: name to length of the arrays that the call needs.
    """

    observer: AxisObserver
    memory: Memory
    records: tuple[Record, ...]
    call: str
    locals: dict[str, int]


def translate_axis(program: Program, observer: AxisObserver, prefix: str) -> AxisProgram:
    """Translate the observer of one axis."""
    memory = Memory(prefix)
    effects, filters, estimator = observer.effects, observer.differentiator, observer.estimator
    compensator = observer.compensator
    n_z, n_p = estimator.sizes.n_z, estimator.sizes.n_p
    width = 5 + 3 * n_z + 2 * n_p
    records = filter_record(memory, len(filters.state)), estimator_record(memory, estimator.flat)
    room = {"results": width, "ahead": AHEAD_WIDTH, "force": 1, "factor": 1, "scratch": SCRATCH}

    def local(name: str, shape: tuple[int, ...]) -> Value:
        return Value(name, Array(REAL, shape), is_stable=True)

    path_memory = compensator.path
    path = Struct("actuator_path_struct", (), {
        "kinds": memory.constant("path_kinds", path_memory.kinds, binds=True, selects=True),
        "p_at": memory.constant("path_parameters_at", path_memory.p_at, binds=True, selects=True),
        "parameters": memory.constant("path_parameters", path_memory.parameters, binds=True),
        "delay": number(path_memory.delay),
        "mass": number(path_memory.mass),
        "added_mass": number(path_memory.added_mass),
    })  # fmt: skip
    start = compensator.state[: VERDICT + len(Status)]
    arguments = [
        memory.constant("filter_config", filters.config, binds=True),
        Value("state->filter", records[0]),
        memory.member("motion", (1, len(filters.row))),
        memory.constant("effect_kinds", effects.kinds, binds=True, selects=True),
        memory.constant("effect_parameters_at", effects.p_at, binds=True, selects=True),
        memory.constant("effect_states_at", effects.s_at, binds=True, selects=True),
        memory.constant("effect_parameters", effects.parameters),
        memory.member("effect_state", effects.initial_state().shape, effects.initial_state()),
        memory.member("effect_state_ahead", effects.initial_state().shape, effects.initial_state()),
        user_value(effects),
        local("scratch", (SCRATCH,)),
        Value("state->estimator", records[1]),
        local("results", (1, width)),
        memory.constant("model_scalars", estimator.model.scalars),
        memory.constant("model_elements", estimator.model.elements),
        memory.constant("estimated", estimator.parameters.kinds, binds=True, selects=True),
        Value(f"{prefix}_path", path, binds=True),
        memory.member("feedforward", start.shape, start),
        memory.member("carried", (n_z,)),
        memory.member("carried_modes", (n_z,), kind=INT),
        memory.member("set_points", (MEMORY_SIZE,)),
        local("ahead", (1, AHEAD_WIDTH)),
        local("force", (1,)),
        local("factor", (1,)),
        Value("&output->compensation", Array(REAL, (1,)), 90, is_stable=True),
        memory.member("clock", (2,), kind=LONG),
        number(bool(effects.has_force_or_level)),
        number(float(filters.delay)),
        Value("stamp_ns", LONG),
        Value("input->position", REAL),
        Value("input->effort", REAL),
        Value("&input->reference_position", Array(REAL, (1,)), 90, is_stable=True),
        Value("&input->reference_velocity", Array(REAL, (1,)), 90, is_stable=True),
        *(Value(f"input->{name}", REAL) for name in OTHER_MOTION),
    ]
    source = source_of(observe_sample)
    assert source is not None
    function = program.function(source, arguments)
    texts = [
        f"&{item.text}" if isinstance(item.type, Record) else item.text
        for parameter, item in zip(function.parameters, arguments, strict=True)
        if parameter.is_used
    ]
    return AxisProgram(observer, memory, records, f"{function.name}({', '.join(texts)})", room)
