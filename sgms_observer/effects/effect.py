"""Definition of an effect: a named term with parameters, units, bounds and source."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from string import Formatter
from typing import Any, TypeVar

from sgms_observer.arrays import Floats
from sgms_observer.errors import ConfigurationError

Values = TypeVar("Values", float, Floats)

INPUTS = ("q", "v", "a", "t", "u", "h", "level", "v2", "a2")
"""Names of arguments of a formula: position [m], velocity [m/s], acceleration [m/s^2], time since the first sample [s],
effort [N], time step [s], Stribeck level [N], velocity and acceleration of the other axis."""


COORDINATES = (
    "position",
    "direction",
    "velocity",
    "acceleration",
    "time",
    "effort",
    "time since reversal",
    "distance since reversal",
    "dwell",
)
"""Coordinates of a free-form term that can imitate an effect."""

QUANTITIES = ("position", "velocity", "acceleration", "effort", "time", "travel", "rate")
"""Recorded quantities that bound a parameter; ``travel`` is the distance covered, ``rate`` the sampling rate."""


class Place(Enum):
    """Place where an effect acts; the values are the texts for the user."""

    ADDED_FORCE = "a force added to the friction"
    LEVEL_FACTOR = "a factor on the Stribeck level"
    EFFORT_PATH = "the way of the effort to the mass"
    MEASURED_POSITION = "the measured position"
    PLANT = "the moving masses"


@dataclass(frozen=True)
class EffectSettings:
    """One effect of the catalogue (or of the user's own) with the values of its parameters.

    Attributes:
        name: of the effect.
        values: in the catalogue's order, each in its parameter's unit [SI]; empty for the defaults.
    """

    name: str
    values: tuple[float, ...] = ()


@dataclass(frozen=True)
class EffectParameter:
    """One parameter of an effect.

    Attributes:
        name: key in the YAML.
        unit: SI unit, or ``-``.
        default: value without an entry in the YAML [``unit``]; the default of a strength switches the effect off.
        minimum: smallest physical value [``unit``].
        maximum: largest physical value [``unit``].
        description: one sentence for people.
        is_strength: whether the effect vanishes with this parameter (otherwise it shapes the effect).
        prismatic_default: default value on a prismatic axis [``unit``]; None where it is ``default``.
        acts_on: recorded quantity out of ``QUANTITIES`` whose range bounds a value that a recording can show: a pitch
            is not longer than the stroke, a limit not above the effort. Empty where none does.
        may_end: whether a fitted value may lie at an end of the range, because a part of the effect is absent there.
            Elsewhere a value at an end means that the recordings do not show the parameter.
        vanishes_at_infinity: whether the effect vanishes as this strength grows, as a lag does with its rate. Then a
            small effect is proportional to the reciprocal.
    """

    name: str
    unit: str
    default: float
    minimum: float
    maximum: float
    description: str
    is_strength: bool = False
    prismatic_default: float | None = None
    acts_on: str = ""
    may_end: bool = False
    vanishes_at_infinity: bool = False

    def __post_init__(self) -> None:
        """Check the range.

        Raises:
            ConfigurationError: when the default is outside of it, or ``acts_on`` is no recorded quantity.
        """
        if self.acts_on not in ("", *QUANTITIES):
            raise ConfigurationError(
                [
                    f"effect parameter {self.name}: acts_on = {self.acts_on!r} must be one of {', '.join(QUANTITIES)};"
                    " choose one"
                ]
            )
        if not self.minimum <= self.default <= self.maximum:
            raise ConfigurationError(
                [
                    f"effect parameter {self.name}: default {self.default} is outside {self.minimum}..{self.maximum};"
                    " widen the range"
                ]
            )

    def linear(self, values: Values) -> Values:
        """Return values that a small effect is proportional to: the reciprocals if it vanishes at infinity.

        Args:
            values: of the parameter [``unit``].
        """
        return 1.0 / values if self.vanishes_at_infinity else values

    def linear_error(self, values: Values, errors: Values) -> Values:
        """Return the standard errors of ``linear`` values.

        Args:
            values: of the parameter [``unit``].
            errors: their standard errors [``unit``].
        """
        return errors / values**2 if self.vanishes_at_infinity else errors


@dataclass(frozen=True)
class EffectList:
    """A parameter of an effect that is a list: a table, a grid, or words.

    Attributes:
        name: key in the YAML.
        unit: SI unit of each entry, or ``-``.
        default: entries without an entry in the YAML [``unit``].
        minimum: smallest physical entry [``unit``].
        maximum: largest physical entry [``unit``].
        description: one sentence for people.
        choices: the allowed words of a list of words; the formula gets their numbers. Empty for a list of numbers.
    """

    name: str
    unit: str
    default: tuple[float, ...] | tuple[str, ...]
    minimum: float
    maximum: float
    description: str
    choices: tuple[str, ...] = ()


@dataclass(frozen=True)
class Effect:
    """One effect of the catalogue, or of the user's own.

    Attributes:
        name: the name of the field, as in the YAML.
        place: where it acts.
        parameters: in the order of the formula's ``p``.
        equation: for people.
        signature: its form in a residual.
        excitation: motion that a recording needs to show it.
        confusable_with: names of effects that can look the same in a recording.
        reference: where the model comes from.
        output: formula; its argument names are taken from ``INPUTS``, ``s`` and ``p``.
        advance: formula of the next state, or None without state.
        initial_state: state at the start [SI units, as ``advance`` returns them].
        lists: parameters that are lists. They follow the others in ``p``, each as its length and then its entries.
        list_faults: returns one sentence per fault that the lists have together, or None where there is no rule; gets
            the lists by name, and the effect's path in the YAML.
        coordinates: some of ``COORDINATES``, over which a free-form term could imitate it; empty where none could, as
            for effects of the other axis, in the frequency or on the effort.
        inverse: formula of the command for a force, or of the true position for a measured one.
        added_mass: mass that it adds to the model's own, as a multiple of its first parameter [-].
        is_delay: whether it delays the effort by its first parameter [s].
        special_case_of: effect that equals this one at some values of its shape, or empty; it is no alternative.
        is_contact_law: whether it only describes another contact law than that of the file.
        question: question of a report about it, parameters in braces (``Is there a {pitch} pitch?``); empty for a
            question with its name.
    """

    name: str
    place: Place
    parameters: tuple[EffectParameter, ...]
    equation: str
    signature: str
    excitation: str
    confusable_with: tuple[str, ...]
    reference: str
    output: Callable[..., Any]
    advance: Callable[..., Any] | None = None
    initial_state: tuple[float, ...] = ()
    lists: tuple[EffectList, ...] = ()
    list_faults: Callable[[Mapping[str, tuple[Any, ...]], str], list[str]] | None = None
    coordinates: tuple[str, ...] = ()
    inverse: Callable[..., Any] | None = None
    added_mass: float = 0.0
    is_delay: bool = False
    question: str = ""
    special_case_of: str = ""
    is_contact_law: bool = False

    def __post_init__(self) -> None:
        """Check names and formula arguments.

        Raises:
            ConfigurationError: one sentence per fault.
        """
        faults = []
        if not self.name.isidentifier():
            faults.append(f"effect name {self.name!r} must be a word of letters, digits and _; rename it")
        keys = [*(item.name for item in self.parameters), *(item.name for item in self.lists)]
        if len(set(keys)) < len(keys):
            faults.append(f"effect {self.name} has two parameters of one name; rename one")
        for formula in (self.output, self.advance):
            if formula is None:
                continue
            strange = [name for name in inspect.signature(formula).parameters if name not in (*INPUTS, "s", "p")]
            if strange and self.place is not Place.EFFORT_PATH:
                faults.append(
                    f"effect {self.name}: formula argument {strange[0]!r} is unknown;"
                    f" use some of {', '.join(INPUTS)}, s, p"
                )
        unknown = [name for name in self.coordinates if name not in COORDINATES]
        if unknown:
            faults.append(
                f"effect {self.name}: coordinate {unknown[0]!r} is unknown; use some of {', '.join(COORDINATES)}"
            )
        if (self.advance is None) != (not self.initial_state):
            faults.append(f"effect {self.name} has only one of advance and initial_state; give both, or neither")
        if faults:
            raise ConfigurationError(faults)

    @property
    def defaults(self) -> tuple[float, ...]:
        """Return the default values, as the formula's ``p`` has them."""
        return flat_values(self, {})

    @property
    def waves(self) -> tuple[tuple[int, int], ...]:
        """Return the indices (strength, angle) of each sine: an angle belongs to the last strength before it."""
        found, last = [], -1
        for place, parameter in enumerate(self.parameters):
            if parameter.is_strength:
                last = place
            elif parameter.unit == "rad" and last >= 0:
                found.append((last, place))
        return tuple(found)

    def asked(self, values: Mapping[str, str]) -> str:
        """Return the question that a report asks about the effect.

        Args:
            values: its parameters by name, with their units. Without one that the question needs, it has the name only.
        """
        needed = {name for _, name, _, _ in Formatter().parse(self.question) if name}
        if self.question and needed <= values.keys():
            return self.question.format(**values)
        return f"Is there {self.name.replace('_', ' ')}?"

    def parameter(self, name: str) -> EffectParameter:
        """Return one parameter.

        Args:
            name: its key in the YAML.

        Raises:
            ConfigurationError: when there is none of that name.
        """
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        names = ", ".join(parameter.name for parameter in self.parameters)
        raise ConfigurationError([f"effect {self.name} has no parameter {name}; use one of {names}"])

    def check(self, values: tuple[float, ...], where: str) -> list[str]:
        """Return one sentence per value that breaks its range.

        Args:
            values: as the formula's ``p`` has them [each in its unit].
            where: path in the YAML, for instance ``x.effects``.
        """
        named = named_values(self, values)
        if named is None:
            return [
                f"{where}.{self.name} has {len(values)} values, the catalogue has {len(self.defaults)}; name them all"
            ]
        faults = [
            f"{where}.{self.name}.{parameter.name} = {value:g} {parameter.unit} must be between"
            f" {parameter.minimum:g} and {parameter.maximum:g} {parameter.unit}; correct it"
            for parameter, value in zip(self.parameters, values, strict=False)
            if not parameter.minimum <= value <= parameter.maximum
        ]
        if self.list_faults is not None:
            faults += self.list_faults({item.name: named[item.name] for item in self.lists}, f"{where}.{self.name}")
        return faults


def flat_values(entry: Effect, named: Mapping[str, Any]) -> tuple[float, ...]:
    """Return the values of an effect in the order of its formula: numbers, then each list as length and entries.

    Args:
        entry: the effect.
        named: parameter's name to its value or entries; what is left out has its default.
    """
    flat = [float(named.get(parameter.name, parameter.default)) for parameter in entry.parameters]
    for item in entry.lists:
        entries = named.get(item.name, item.default)
        flat.append(float(len(entries)))
        flat.extend(float(item.choices.index(word) if item.choices else word) for word in entries)
    return tuple(flat)


def named_values(entry: Effect, values: Sequence[float]) -> dict[str, Any] | None:
    """Return an effect's values by the names of its parameters: the reverse of ``flat_values``.

    Args:
        entry: the effect.
        values: as ``flat_values`` returns them [SI]; empty for the defaults.

    Returns:
        Numbers and tuples by name; None for values that are not those of this effect.
    """
    if not values:
        values = flat_values(entry, {})
    place = len(entry.parameters)
    if len(values) < place:
        return None
    named: dict[str, Any] = {p.name: values[i] for i, p in enumerate(entry.parameters)}
    for item in entry.lists:
        end = place + 1 + int(values[place]) if place < len(values) else len(values) + 1
        if end > len(values):
            return None
        entries = tuple(values[place + 1 : end])
        named[item.name] = tuple(item.choices[int(number)] for number in entries) if item.choices else entries
        place = end
    return named if place == len(values) else None
