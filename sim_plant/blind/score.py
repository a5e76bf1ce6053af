"""Scores one result of ``sgms diagnose`` against the sealed truth: everything a case can say for the tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

VERDICTS = ("no_effect", "effect_found", "ambiguous", "unknown_effect", "cannot_tell")
NAMING = ("effect_found", "ambiguous")
"""Verdicts that carry a name."""
WORSE = 1.001
"""A held-out gap counts as worse when it grows by more than this factor (rounding in the result)."""
CLOSABLE = 1.1
"""There is something to close where the gap before is at least this multiple of the floor."""

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


@dataclass(frozen=True)
class CaseScore:
    """What one case says.

    Attributes:
        effects: what was hidden; empty for nothing.
        is_inside: whether the catalogue knows all of it.
        size: share of the Coulomb force.
        verdict: the workflow's.
        named: names it reports, in its order.
        reported: names and their alternatives.
        first_set: the first name and its alternatives.
        closure: share of the closable gap closed on held-out data; None where nothing is closable or nothing named.
        is_worse: whether the held-out gap grew.
        parameters: one entry per comparable parameter of a rightly named effect.
        seconds: computing time on one core per 60 s of recording; None where not measured.
    """

    effects: tuple[str, ...]
    is_inside: bool
    size: float
    verdict: str
    named: tuple[str, ...]
    reported: frozenset[str]
    first_set: frozenset[str]
    closure: float | None
    is_worse: bool
    parameters: tuple[ParameterScore, ...]
    seconds: float | None

    @property
    def first(self) -> str:
        """Return the first name, or the verdict where there is none."""
        return self.named[0] if self.named and self.verdict in NAMING else self.verdict

    @property
    def is_alarm(self) -> bool:
        """Return whether it says that something is hidden."""
        return self.verdict in (*NAMING, "unknown_effect")

    @property
    def is_confidently_wrong(self) -> bool:
        """Return whether it claims, without reserve, an effect that is not there."""
        return self.verdict == "effect_found" and any(name not in self.effects for name in self.named)


def score_case(
    truth: dict[str, Any],
    result: dict[str, Any],
    floor: float | None = None,
    seconds: float | None = None,
    refitted_mass: float | None = None,
) -> CaseScore:
    """Score one result.

    Args:
        truth: as opened from the seal.
        result: as in result.json.
        floor: held-out gap with the true effect known, in the result's unit; the result's own floor where None.
        seconds: computing time per 60 s of recording.
        refitted_mass: mass in augmented.yaml [kg]; a mass error counts from the owner's mass, which is off as well, so
            that only the sum of both is compared.

    Raises:
        ValueError: when the result has no verdict the schema knows.
    """
    verdict = result.get("verdict")
    if verdict not in VERDICTS:
        raise ValueError(f"result.json says verdict {verdict!r}; the schema knows {', '.join(VERDICTS)}")
    effects = tuple(truth["effects"])
    entries = result.get("effects") or []
    named = tuple(entry["name"] for entry in entries)
    sets = [frozenset((entry["name"], *entry.get("alternatives", ()))) for entry in entries]
    gap = result.get("gap") or {}
    before, after = gap.get("before"), gap.get("after")
    floor = gap.get("floor") if floor is None else floor
    parameters = [
        score
        for entry in entries
        if entry["name"] in effects and verdict in NAMING
        for score in compare(
            entry["name"],
            with_refitted_mass(entry, truth, refitted_mass),
            entry.get("std_error") or {},
            (truth.get("parameters") or {}).get(entry["name"], {}),
        )
    ]
    return CaseScore(
        effects=effects,
        is_inside=bool(truth["is_inside"]),
        size=float(truth["size"]),
        verdict=verdict,
        named=named if verdict in NAMING else (),
        reported=frozenset().union(*sets) if verdict in NAMING else frozenset(),
        first_set=sets[0] if sets and verdict in NAMING else frozenset(),
        closure=closure(before, after, floor) if effects else None,
        is_worse=before is not None and after is not None and after > WORSE * before,
        parameters=tuple(parameters),
        seconds=seconds,
    )


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


def with_refitted_mass(entry: dict[str, Any], truth: dict[str, Any], mass: float | None) -> dict[str, float]:
    """Return an entry's parameters; a mass error is moved onto the true mass without it."""
    found: dict[str, float] = dict(entry.get("parameters") or {})
    if entry["name"] == "mass_error" and "mass" in found and mass is not None:
        found["mass"] += mass - truth["stage"]["mass"]
    return found


def closure(before: float | None, after: float | None, floor: float | None) -> float | None:
    """Return (before - after) / (before - floor), the closed share of the gap; None where nothing is closable."""
    if before is None or after is None or floor is None or before < CLOSABLE * floor:
        return None
    return (before - after) / (before - floor)


def read_result(folder: Path) -> dict[str, Any]:
    """Return result.json of a folder written by ``sgms diagnose``."""
    result: dict[str, Any] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return result
