"""Kinds of parameters in the catalogue's entries, each with its unit and the recorded quantity that bounds it."""

from __future__ import annotations

import math

from sgms_observer.effects.effect import EffectParameter


def strength(
    name: str, unit: str, description: str, minimum: float = -1.0e4, maximum: float = 1.0e4, acts_on: str = ""
) -> EffectParameter:
    """Declare a parameter that is zero without the effect."""
    return EffectParameter(name, unit, 0.0, minimum, maximum, description, is_strength=True, acts_on=acts_on)


def share(description: str, minimum: float = -0.95, maximum: float = 3.0) -> EffectParameter:
    """Declare a strength given as a share of the friction."""
    return strength("share", "-", description, minimum, maximum)


def length(
    name: str,
    default: float,
    minimum: float,
    maximum: float,
    description: str,
    acts_on: str = "position",
    may_end: bool = False,
) -> EffectParameter:
    """Declare a place on the axis, or a distance along it [m]."""
    return EffectParameter(name, "m", default, minimum, maximum, description, acts_on=acts_on, may_end=may_end)


def speed(name: str, default: float, minimum: float, maximum: float, description: str) -> EffectParameter:
    """Declare a velocity [m/s]."""
    return EffectParameter(name, "m/s", default, minimum, maximum, description, acts_on="velocity")


def duration(
    name: str, default: float, minimum: float, maximum: float, description: str, may_end: bool = False
) -> EffectParameter:
    """Declare a time [s]."""
    return EffectParameter(name, "s", default, minimum, maximum, description, acts_on="time", may_end=may_end)


def frequency(minimum: float, description: str) -> EffectParameter:
    """Declare a frequency [Hz]."""
    return EffectParameter("frequency", "Hz", 50.0, minimum, 5.0e3, description, acts_on="rate")


def pitch(description: str) -> EffectParameter:
    """Declare a period in position [m]."""
    return length("pitch", 0.01, 1.0e-6, 10.0, f"period in position, for instance {description}")


def phase(description: str, name: str = "phase") -> EffectParameter:
    """Declare an angle [rad] of either sign, one turn at most."""
    return EffectParameter(name, "rad", 0.0, -2.0 * math.pi, 2.0 * math.pi, description)
