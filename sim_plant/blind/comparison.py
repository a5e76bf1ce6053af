"""Parameters that mean the same here and in the catalogue, and how far the found ones are from the truth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

NINETY_PERCENT = 1.6448536269514722
"""Standard deviations of a two-sided 90 % interval."""

COMPARABLE: dict[str, tuple[str, ...]] = {
    "cogging": ("pitch", "amplitude"),
    "position_periodic_friction": ("pitch", "share"),
    "spring": ("stiffness",),
    "offset": ("force",),
    "asymmetric_coulomb": ("share",),
    "asymmetric_viscous": ("coefficient",),
    "quadratic_drag": ("coefficient",),
    "periodic_disturbance": ("frequency", "amplitude"),
    "cross_axis_coupling": ("inertia",),
    "actuator_delay": ("delay",),
    "actuator_gain": ("gain",),
    "actuator_saturation": ("limit",),
    "actuator_dead_zone": ("width",),
    "flexible_mode": ("frequency", "mass"),
    "backlash": ("gap", "share"),
    "encoder_interpolation_error": ("pitch", "amplitude"),
    "quantisation": ("resolution",),
    "wear_step": ("share", "travel"),
}
"""Catalogue parameters with a true value; for bent shapes it is the straight line of least squares through them."""

UNSIGNED = ("amplitude",)
"""Parameters whose sign is a matter of phase."""
ONE_AT_REST = ("gain",)
"""Parameters whose effect vanishes at 1: the error counts against what differs from 1."""


@dataclass(frozen=True)
class ParameterScore:
    """One found parameter.

    Attributes:
        effect: catalogue name.
        parameter: its parameter.
        error: distance from the truth as a share of it.
        is_covered: whether the 90 % interval holds the truth; None without a standard error.
    """

    effect: str
    parameter: str
    error: float
    is_covered: bool | None


def compare(
    effect: str, found: Mapping[str, float], std_error: Mapping[str, float | None], truth: Mapping[str, float]
) -> list[ParameterScore]:
    """Return one score per comparable parameter of ``effect``.

    Args:
        effect: catalogue name.
        found: parameters of the result.
        std_error: their standard errors, where given.
        truth: the sealed figures.
    """
    scores = []
    for name in COMPARABLE.get(effect, ()):
        if name not in found or name not in truth:
            continue
        value, true = found[name], truth[name]
        if name in UNSIGNED or (effect, name) == ("position_periodic_friction", "share"):
            value, true = abs(value), abs(true)
        unit = abs(true - 1.0) if name in ONE_AT_REST else abs(true)
        spread = std_error.get(name)
        covered = abs(value - true) <= NINETY_PERCENT * spread if spread is not None else None
        scores.append(ParameterScore(effect, name, abs(value - true) / unit, covered))
    return scores
