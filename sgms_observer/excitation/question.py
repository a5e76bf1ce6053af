"""The question to a reference: parameters of the force balance, every effect, or certain effects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from sgms_observer.effects import catalogue
from sgms_observer.effects.catalogue import effect, is_built_in
from sgms_observer.effects.effect import Effect, EffectParameter
from sgms_observer.errors import ConfigurationError
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.segments import Place
from sgms_observer.settings.axis import AxisSettings, EffectSettings

IDENTIFY = "identify"
DIAGNOSE = "diagnose"
DEFAULT = (IDENTIFY, DIAGNOSE)

NO_REFERENCE_SHOWS = {
    "cross_axis_coupling": "the other axis has to move",
    "periodic_disturbance": "any motion shows it",
    "quantisation": "the position shows it directly",
    "mass_error": "it is the mass, which is identified",
    "actuator_gain": "only a known mass or force shows it",
    "actuator_saturation": "only efforts up to the actuator's limit show it",
    "learnt_map": "it is fitted to the residual",
    "learnt_map_2": "it is fitted to the residual",
    "learnt_map_3": "it is fitted to the residual",
}
"""Effects that no choice of the reference makes detectable, and the reason."""
_OVER_TIME = ("thermal_drift", "wear_step")
WEAK = 0.01
"""Strength of an effect whose size is not known."""
_BELOW_BAND = 0.6  # frequency of a flexible mode over the band
_CENTERS = (0.3, 0.75, 0.05, 0.95)  # over the stroke: an effect of the position may be anywhere, also at its ends


@dataclass(frozen=True)
class Question:
    """What a reference is asked for.

    Attributes:
        parameters: whether all parameters of the force balance are asked for.
        effects: names of the effects that are asked for.
        is_everything: whether these are all effects of the catalogue.
    """

    parameters: bool
    effects: tuple[str, ...]
    is_everything: bool

    @staticmethod
    def of(asked: Sequence[str], axis: AxisSettings) -> Question:
        """Check the question of the user.

        Args:
            asked: ``identify``, ``diagnose``, names of effects; empty for ``DEFAULT``.
            axis: settings.

        Raises:
            ConfigurationError: an unknown name, or an effect that no reference makes detectable.
        """
        wanted = list(dict.fromkeys(asked)) or list(DEFAULT)
        known = [name for name in catalogue.names() if name not in NO_REFERENCE_SHOWS]
        named = [name for name in wanted if name not in (IDENTIFY, DIAGNOSE)]
        faults = []
        for name in named:
            if name in NO_REFERENCE_SHOWS:
                faults.append(
                    f"--for {name}: no choice of this axis's reference helps ({NO_REFERENCE_SHOWS[name]}); leave it out"
                )
            elif name not in known:
                faults.append(
                    f"--for {name} is neither {IDENTIFY}, {DIAGNOSE} nor an effect of the catalogue; use some of"
                    f" {', '.join(known)}"
                )
            elif not is_possible(name, axis):
                faults.append(f"--for {name}: on a prismatic axis it is the offset; ask for offset")
        if faults:
            raise ConfigurationError(faults)
        everything = DIAGNOSE in wanted
        effects = [name for name in known if is_possible(name, axis)] if everything else named
        return Question(IDENTIFY in wanted, tuple(effects), everything)

    def rivals(self, name: str) -> tuple[str, ...]:
        """Return the rivals of an effect: the other asked effects, or all similar ones."""
        if not self.is_everything and len(self.effects) > 1:
            return tuple(other for other in self.effects if other != name)
        return tuple(other for other in effect(name).confusable_with if other not in NO_REFERENCE_SHOWS)


def is_possible(name: str, axis: AxisSettings) -> bool:
    """Return whether an effect is a separate one on this type of joint."""
    return name != "gravity" or axis.units.is_revolute


def shapes(
    name: str, axis: AxisSettings, place: Place, limits: ExcitationLimits, band: float, seconds: float,
    strength: float = WEAK,
) -> list[EffectSettings]:  # fmt: skip
    """Return instances of an effect: with the shape in the file, or with typical shapes within the limits.

    Args:
        name: the effect.
        axis: settings.
        place: window and home of the motion.
        limits: stroke, speed and acceleration that the table may use.
        band: efforts are compared below this frequency [Hz].
        seconds: time of the whole reference [s].
        strength: over the Coulomb force, the mass or another quantity that the effect changes [-].
    """
    entry = effect(name)
    listed = next((item.values for item in axis.effects if item.name == name and item.values), None)
    names = {parameter.name for parameter in entry.parameters}
    variants = len(_CENTERS) if "center" in names else 2 if names & {"phase", "angle", "pitch"} else 1
    out = []
    for variant in range(variants):
        values = []
        for number, parameter in enumerate(entry.parameters):
            if listed is not None and not parameter.is_strength and parameter.name not in ("phase", "angle"):
                value = listed[number]
            elif parameter.is_strength and parameter.name != "attraction_rate":
                is_first = not any(other.is_strength for other in entry.parameters[:number])
                value = _strength(parameter, axis, strength) if is_first else 0.0
            else:
                value = _shape_value(parameter, variant, axis, place, limits, band, seconds)
            values.append(min(max(float(value), parameter.minimum), parameter.maximum))
        lists = entry.defaults[len(values) :]
        out.append(EffectSettings(name, (*values, *lists)))
    if any(p.name == "pitch" for p in entry.parameters):  # each pitch as sine and cosine
        out = [_turned(entry, item, angle) for item in out for angle in (0.0, 0.5 * math.pi)]
    return out


def _strength(parameter: EffectParameter, axis: AxisSettings, strength: float) -> float:
    """Return a strength in the unit of a parameter."""
    sizes = {"N": axis.friction.coulomb_force, "kg": axis.mass, "s": 0.01, "m": 1.0e-6}
    return strength * sizes.get(parameter.unit, 1.0)


def _turned(entry: Effect, settings: EffectSettings, angle: float) -> EffectSettings:
    """Return a sine with another phase."""
    values = [
        angle if parameter.name == "phase" else value
        for parameter, value in zip(entry.parameters, settings.values, strict=False)
    ]
    return EffectSettings(entry.name, tuple(values))


def _shape_value(
    parameter: EffectParameter, variant: int, axis: AxisSettings, place: Place, limits: ExcitationLimits, band: float,
    seconds: float,
) -> float:  # fmt: skip
    """Return a typical value of a shape parameter of an effect, within the limits."""
    stroke, presliding_range = place.high - place.low, 0.5 * place.presliding
    travel = 0.25 * limits.speed * seconds
    second = variant % 2
    typical = {
        "pitch": stroke / (2.3, 7.7)[second],
        "phase": 0.5 * math.pi * second,
        "angle": 0.5 * math.pi * second,
        "rest_position": 0.5 * (place.low + place.high),
        "center": place.low + _CENTERS[variant] * stroke,
        "reference_velocity": limits.speed,
        "peak_velocity": 0.3 * limits.speed,
        "velocity": min(5.0 * place.stribeck_velocity, 0.5 * limits.speed),
        "distance": 3.0 * presliding_range,
        "memory_distance": 3.0 * presliding_range,
        "gap": 3.0 * presliding_range,
        "stop": 0.1 * presliding_range,
        "dwell_time": 0.3,
        "attraction_rate": axis.friction.coulomb_force / 0.02,
        "frequency": _BELOW_BAND * band,
        "time_constant": seconds / 3.0,
        "motion_share": 0.0,
        "travel": 0.5 * travel,
    }
    if parameter.name == "width":
        return 0.01 * travel if parameter.acts_on == "travel" else 0.1 * stroke
    return typical.get(parameter.name, parameter.default)


def over_time(name: str) -> bool:
    """Return whether an effect grows with the time or the travel since the start, for any motion."""
    return name in _OVER_TIME and is_built_in(name)
