"""Scores one result against the truth. Every equivalence of names is stated here, none anywhere else."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

NAMING = ("effect_found", "ambiguous")
NINETY_PERCENT = 1.6448536269514722
"""Standard deviations of a two-sided 90 % interval."""
CLOSABLE = 1.1
"""There is something to close where the gap before is at least this multiple of the floor (the definition of the
gap)."""

CATALOGUE_NAME = {
    "cogging": "cogging",
    "asymmetry": "asymmetric_coulomb",
    "offset": "offset",
    "tight_spot": "position_dependent_friction",
    "spring": "spring",
    "mass": "mass_error",
    "quadratic": "quadratic_drag",
    "thermal": "thermal_drift",
    "delay": "actuator_delay",
    "gain": "actuator_gain",
    "dead_zone": "actuator_dead_zone",
    "deadzone": "actuator_dead_zone",
    "flexible_mode": "flexible_mode",
    "flex": "flexible_mode",
    "dwell": "dwell_breakaway",
    "vibration": "periodic_disturbance",
    "gravity": "gravity",
}
"""The catalogue's name of each hidden effect; an effect that is not here lies outside of the catalogue.

An asymmetry of the Coulomb force is an offset while the machine slides; the dwells tell them apart, so the two are NOT
taken for each other. Nor are viscous names taken for Coulomb ones."""

TRUE_OF_THE_CONTACT = {
    "lugre": {"frictional_lag", "presliding"},
    "elasto_plastic": {"frictional_lag", "presliding"},
    "bouc_wen": {"presliding"},
    "leuven": {"frictional_lag", "presliding"},
    "rate_state": {"frictional_lag", "presliding", "dwell_breakaway", "stribeck", "nonlinear_viscous"},
    "maxwell_slip": {"presliding"},
}
"""Names that tell a property which the contact law has and the owner's four elements lack.

They count as false alarms like every other name. A second figure says how many false alarms are of this kind."""

PART_OF = {
    "hysteretic_spring": {"spring"},
    "direction_and_place": {"position_dependent_friction", "position_periodic_friction"},
}
"""Names that describe a part of an effect outside of the catalogue; beside a remainder that is told or learnt they are
not wrong. A force map has neither mean nor slope, so no name describes a part of it."""

FIGURE_NAMES = {
    "share": ("share",),
    "amplitude": ("amplitude", "torque"),
    "force": ("force",),
    "stiffness": ("stiffness",),
    "coefficient": ("coefficient",),
    "pitch": ("pitch",),
    "frequency": ("frequency",),
    "delay": ("delay",),
    "gain": ("gain",),
    "width": ("width",),
    "mass": ("mass",),
    "time_constant": ("time_constant",),
}
"""A true figure, and the catalogue's names for it; absent ones are skipped."""
NOT_COMPARABLE = {("flexible_mode", "mass"), ("flex", "mass")}
"""Only the frequency of a flexible mode means the same on both sides."""
UNSIGNED = ("amplitude",)


@dataclass(frozen=True)
class Score:
    """What one case says.

    Attributes:
        plant: plant.
        effect: hidden effect; empty for nothing.
        is_inside: whether the catalogue has a name for it.
        is_repeatable: whether another recording shows it the same way.
        is_small: 5 % instead of 10-25 %.
        has_failed: whether the workflow ended without a result.
        verdict: the workflow's.
        first: first name, or the verdict where it names nothing.
        is_right_first: whether the first name is the right one.
        is_in_set: whether the right name is among the names and their alternatives.
        is_wrong: whether it claims, without reserve, something that is not there.
        is_alarm: whether it says that something is hidden.
        is_borne_out: whether it names nothing, but what it learnt shrinks the held-out gap by more than its interval.
        is_of_contact: whether all names tell a true property of the contact law.
        is_told_unknown: whether it says that a predictable share has no name.
        not_shrunk: how many names came though the held-out gap did not shrink.
        is_unsure: whether names came though the gap shrank by less than the interval of the gap after.
        closure: closed share of the closable gap; None where nothing is closable.
        closure_by_maps: the same of the learnt maps, of the gap that the names leave.
        before, after, floor: gap [% of rms effort]; None without.
        is_above_noise: whether the hidden force in the held-out recording is larger than the noise of the result.
        covered: of each comparable parameter, whether its 90 % interval holds the truth.
        seconds: computing time of one process [s].
        memory: largest resident memory [MB].
    """

    plant: str
    effect: str
    is_inside: bool
    is_repeatable: bool
    is_small: bool
    has_failed: bool
    verdict: str
    first: str
    is_right_first: bool
    is_in_set: bool
    is_wrong: bool
    is_alarm: bool
    is_borne_out: bool
    is_of_contact: bool
    is_told_unknown: bool
    not_shrunk: int
    is_unsure: bool
    closure: float | None
    closure_by_maps: float | None
    before: float | None
    after: float | None
    floor: float | None
    is_above_noise: bool
    covered: tuple[bool, ...]
    seconds: float
    memory: float


def score(truth: Mapping[str, Any], run: Mapping[str, Any], small: float = 0.09) -> Score:
    """Score one case.

    Args:
        truth: as sealed.
        run: one line of the results file: ``result`` (result.json of schema 1 or 2, or None), ``seconds``, ``memory``,
            ``mass`` (refitted mass in augmented.yaml [kg], or None), ``exit_code``.
        small: sizes below this share are the small ones.
    """
    result = run.get("result") or {}
    has_failed = not result
    verdict = str(result.get("verdict", "failed"))
    entries = (result.get("effects") or []) if verdict in NAMING else []
    hidden = tuple(truth["effects"])
    right = CATALOGUE_NAME.get(hidden[0]) if hidden else None
    named = [entry["name"] for entry in entries]
    matches = [is_right(hidden[0], entry) for entry in entries] if hidden else []
    alternatives = {name for entry in entries for name in entry.get("alternatives") or ()}
    gap = result.get("gap") or {}
    before, after, floor = gap.get("before"), gap.get("after"), gap.get("floor")
    left = with_maps(gap, result.get("learnt") or ())
    is_remainder_told = result.get("remainder") in ("learnt", "unknown") or verdict == "unknown_effect"
    allowed = PART_OF.get(hidden[0], set()) if hidden and is_remainder_told else set()
    strange = [
        name for name, match in zip(named, matches or [False] * len(named), strict=True)
        if not match and name not in allowed
    ]  # fmt: skip
    contact = TRUE_OF_THE_CONTACT[truth["law"]]
    return Score(
        plant=truth["plant"],
        effect=hidden[0] if hidden else "",
        is_inside=bool(truth["is_inside"]),
        is_repeatable=bool(truth["is_repeatable"]),
        is_small=truth["size"] < small,
        has_failed=has_failed,
        verdict=verdict,
        first=named[0] if named else verdict,
        is_right_first=bool(matches and matches[0]),
        is_in_set=any(matches) or (right is not None and right in alternatives),
        is_wrong=verdict == "effect_found" and bool(strange),
        is_alarm=verdict in (*NAMING, "unknown_effect"),
        is_borne_out=not named and is_smaller(left) and not is_inside_interval(left),
        is_of_contact=bool(named) and set(named) <= contact,
        is_told_unknown=verdict == "unknown_effect" or result.get("remainder") in ("learnt", "unknown"),
        not_shrunk=sum(not has_shrunk(entry, gap) for entry in entries),
        is_unsure=bool(named) and is_inside_interval(gap),
        closure=closure(gap),
        closure_by_maps=closure(left | {"before": after}),
        before=before,
        after=after,
        floor=floor,
        is_above_noise=100.0 * truth.get("hidden_rms", [0.0])[-1] > gap.get("noise", math.inf),
        covered=tuple(
            coverage(one, truth, run.get("mass"))
            for entry, match in zip(entries, matches, strict=False)
            if match
            for one in comparable(entry, truth)
        ),
        seconds=float(run.get("seconds") or math.nan),
        memory=float(run.get("memory") or math.nan),
    )


def is_right(hidden: str, entry: Mapping[str, Any]) -> bool:
    """Return whether an entry of the result names the hidden effect.

    Two formulas of the catalogue hold others as a special case and are taken for them there: ``nonlinear_viscous`` with
    an exponent of 2 +- 0.4 is quadratic drag; ``cogging`` with a pitch of 2 pi rad +- 10 % is gravity.

    Args:
        hidden: the effect.
        entry: of ``effects`` in the result.
    """
    parameters = entry.get("parameters") or {}
    if hidden == "quadratic" and entry["name"] == "nonlinear_viscous":
        return abs(parameters.get("exponent", 0.0) - 2.0) <= 0.4
    if hidden == "gravity" and entry["name"] == "cogging":
        return abs(parameters.get("pitch", 0.0) / (2.0 * math.pi) - 1.0) <= 0.1
    return bool(CATALOGUE_NAME.get(hidden) == entry["name"])


def has_shrunk(entry: Mapping[str, Any], gap: Mapping[str, Any]) -> bool:
    """Return whether the held-out gap shrank, with this name and with all of them.

    Args:
        entry: of ``effects`` in the result.
        gap: of the result.
    """
    first, last = entry.get("gap_before"), entry.get("gap_after")
    if first is not None and last is not None and not last < first:
        return False
    return is_smaller(gap)


def with_maps(gap: Mapping[str, Any], learnt: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return a gap whose values after are those with all learnt maps; the interval shrinks with the gap.

    Args:
        gap: of the result.
        learnt: of the result.
    """
    after = gap.get("after")
    if not learnt or not after:
        return dict(gap)
    ratio = float(learnt[-1]["gap_after"]) / after
    return {**gap, "after": ratio * after, "interval_after": [ratio * end for end in gap.get("interval_after") or ()]}


def is_smaller(gap: Mapping[str, Any]) -> bool:
    """Return whether the held-out gap is smaller after than before.

    Args:
        gap: of the result.
    """
    before, after = gap.get("before"), gap.get("after")
    return before is not None and after is not None and bool(after < before)


def is_inside_interval(gap: Mapping[str, Any]) -> bool:
    """Return whether the gap before lies inside the interval of the gap after.

    Args:
        gap: of the result.
    """
    interval, before = gap.get("interval_after"), gap.get("before")
    return bool(interval) and before is not None and before <= interval[1]


def closure(gap: Mapping[str, Any]) -> float | None:
    """Return (before - after) / (before - floor); None where nothing is closable.

    Args:
        gap: of the result.
    """
    before, after, floor = gap.get("before"), gap.get("after"), gap.get("floor")
    if before is None or after is None or floor is None or before <= CLOSABLE * floor:
        return None
    return float((before - after) / (before - floor))


def comparable(entry: Mapping[str, Any], truth: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return one small entry per parameter that has a true figure and a standard error.

    Args:
        entry: of ``effects`` in the result.
        truth: as sealed.
    """
    effect = truth["effects"][0]
    found, errors = entry.get("parameters") or {}, entry.get("std_error") or {}
    listed = []
    for figure, value in (truth.get("figures") or {}).get(effect, {}).items():
        if (effect, figure) in NOT_COMPARABLE:
            continue
        for name in FIGURE_NAMES.get(figure, ()):
            if found.get(name) is not None and errors.get(name) is not None:
                listed.append(
                    {"effect": effect, "figure": figure, "found": found[name], "error": errors[name], "true": value}
                )
                break
    return listed


def coverage(one: Mapping[str, Any], truth: Mapping[str, Any], mass: float | None) -> bool:
    """Return whether a 90 % interval holds the truth.

    Args:
        one: as from ``comparable``.
        truth: as sealed; holds the machine's own mass [kg].
        mass: refitted mass of the owner's file [kg]: a mass error counts from there.
    """
    found, true = one["found"], one["true"]
    if one["figure"] in UNSIGNED:
        found, true = abs(found), abs(true)
    if one["effect"] == "mass" and mass is not None:
        found += mass - truth["mass"]
    return bool(abs(found - true) <= NINETY_PERCENT * one["error"])
