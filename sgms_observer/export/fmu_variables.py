"""What an FMU of the simulated stage lets a simulation tool see and set, with its units."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.units import Units
from sim_plant.stage import StageParts

_BASE = {
    "m": {"m": 1},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Hz": {"s": -1},
}


def base_exponents(unit: str) -> dict[str, int]:
    """Return the exponent of each base unit in a unit such as ``N s/m``.

    Args:
        unit: factors separated by spaces; what follows the first slash is below it.
    """
    found: dict[str, int] = {}
    for part, sign in zip(re.split("/", unit, maxsplit=1), (1, -1), strict=False):
        for word in re.split(r"[ /()]+", part.strip()):
            match = re.fullmatch(r"([A-Za-z]+)(?:\^(-?\d+))?", word)
            if match is None or match[1] not in _BASE:
                continue
            for base, exponent in _BASE[match[1]].items():
                found[base] = found.get(base, 0) + sign * exponent * int(match[2] or 1)
    return {base: exponent for base, exponent in found.items() if exponent}


FIXED_SHAPE = ("actuator_delay", "mass_error", "flexible_mode", "learnt_map", "learnt_map_2", "learnt_map_3")
"""Effects whose values also set the size of a memory, the moving mass or the shape of a table: constants of the FMU."""


@dataclass(frozen=True)
class Variable:
    """A real variable of the FMU.

    Attributes:
        name: as the tool shows it.
        place: member of the C structure.
        causality: ``input``, ``output`` or ``parameter``.
        variability: ``continuous``, ``discrete``, ``fixed`` or ``tunable``.
        unit: SI unit, or empty.
        description: one sentence.
        start: value at the start; None for an output.
    """

    name: str
    place: str
    causality: str
    variability: str
    unit: str
    description: str
    start: float | None = None


def _input(name: str, unit: str, description: str, start: float = 0.0) -> Variable:
    return Variable(name, f"in_{name}", "input", "continuous", unit, description, start)


def _output(name: str, unit: str, description: str) -> Variable:
    return Variable(name, f"out_{name}", "output", "continuous", unit, description)


def _tunable(name: str, place: str, unit: str, description: str, start: float) -> Variable:
    return Variable(name, place, "parameter", "tunable", unit, description, float(start))


def stage_variables(parts: StageParts, names: tuple[str, ...], units: Units, start: float) -> list[Variable]:
    """Return the real variables of a stage.

    Args:
        parts: of the stage.
        names: of its effects.
        units: of the axis.
        start: position at the start [m].
    """
    of = units.of
    q, v, a, f = units.position, units.velocity, units.acceleration, units.effort
    variables = [
        _input("reference_position", q, "set-point of the stage's own controller", start),
        _input("reference_velocity", v, "its velocity"),
        _input("reference_acceleration", a, "its acceleration"),
        _input("effort", f, "added to the controller's effort; without controller all of the effort"),
        _input("disturbance", f, "force on the moving mass that no sensor sees"),
    ]
    if "cross_axis_coupling" in names:
        variables += [
            _input("other_velocity", v, "velocity of the other axis"),
            _input("other_acceleration", a, "acceleration of the other axis"),
        ]
    variables += [
        _output("position", q, "true position"),
        _output("velocity", v, "true velocity"),
        _output("acceleration", a, "mean acceleration over the last integration step"),
        _output("measured_position", q, "what the encoder shows"),
        _output("control_effort", f, "effort that the controller sent in the last tick; without it the input"),
        _output("friction", f, "friction force"),
        _output("effect_force", f, "force of the effects that add one"),
        Variable("initial_position", "start_position", "parameter", "fixed", q, "position at the start", start),
        _tunable("mass", "constants.mass", of("kg"), "moving mass with what the effects add", parts.constants.mass),
        _tunable("encoder_resolution", "constants.resolution", q, "encoder step; 0 for none",
                 parts.constants.resolution),
    ]  # fmt: skip
    return variables + _friction(parts, of) + _controller(parts, of, f) + _effects(parts, names, of)


def _friction(parts: StageParts, of: object) -> list[Variable]:
    """Return the parameters of the friction model."""
    assert callable(of)
    friction = parts.friction
    found = [
        _tunable(f"friction.{name}", f"friction.{place}", of(unit), text, getattr(friction, place))
        for name, place, unit, text in (
            ("viscous_coefficient", "viscous", "N s/m", "viscous coefficient"),
            ("static_force", "static_force", "N", "static force"),
            ("coulomb_force", "coulomb_force", "N", "Coulomb force"),
            ("stribeck_velocity", "stribeck_velocity", "m/s", "Stribeck velocity"),
            ("attraction_rate", "attraction_rate", "N/s", "attraction rate of a GMS model"),
        )
    ]
    for name, place, unit in (
        ("element_stiffness", "stiffness", "N/m"),
        ("element_fraction", "fraction", ""),
        ("element_damping", "damping", "N s/m"),
    ):
        values = np.asarray(getattr(friction, place))
        found += [
            _tunable(f"friction.{name}[{i + 1}]", f"friction.{place}[{i}]", of(unit) if unit else "",
                     f"{name.replace('_', ' ')} of element {i + 1}", values[i])
            for i in range(len(values))
        ]  # fmt: skip
    return found


def _controller(parts: StageParts, of: object, effort: str) -> list[Variable]:
    """Return the parameters of the controller."""
    assert callable(of)
    return [
        _tunable(f"controller.{name}", f"gains.{name}", unit, text, getattr(parts.gains, name))
        for name, unit, text in (
            ("position_gain", of("N/m"), "effort per position error"),
            ("velocity_gain", of("N s/m"), "effort per velocity error"),
            ("integral_gain", f"{of('N/m')}/s", "effort per integral of the position error"),
            ("acceleration_gain", of("kg"), "effort per reference acceleration"),
            ("limit", effort, "largest effort"),
        )
    ]


def _effects(parts: StageParts, names: tuple[str, ...], of: object) -> list[Variable]:
    """Return the parameters of the effects."""
    assert callable(of)
    found = []
    for number, name in enumerate(names):
        entry = effect(name)
        place = int(parts.effects.p_at[number])
        label = name if names.count(name) == 1 else f"{name}_{number + 1}"
        for offset, parameter in enumerate(entry.parameters):
            if name not in FIXED_SHAPE:
                unit = "" if parameter.unit == "-" else of(parameter.unit)
                found.append(
                    _tunable(f"effects.{label}.{parameter.name}", f"effects.parameters[{place + offset}]", unit,
                             parameter.description, parts.effects.parameters[place + offset])
                )  # fmt: skip
    return found
