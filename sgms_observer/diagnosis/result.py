"""Output files of a diagnosis: result.json (schema 2) and augmented.yaml."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from sgms_observer.diagnosis.answer import Answer
from sgms_observer.diagnosis.compensation_check import CompensationCheck
from sgms_observer.diagnosis.contact import UNSMOOTHED_SETTLING_TIME
from sgms_observer.diagnosis.named import NOT_DETERMINED
from sgms_observer.diagnosis.tracking import PredictedTracking
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.effect import named_values
from sgms_observer.settings.axis import Settings
from sgms_observer.settings.units import Units
from sgms_observer.settings.write import settings_text
from sgms_observer.whole_file import write_text

AUGMENTED = "augmented.yaml"
SCHEMA = 2
UNIT = "% of rms effort"


def result_of(
    answer: Answer, checks: Sequence[CompensationCheck], tracking: PredictedTracking | None, units: Units
) -> dict[str, Any]:
    """Return the content of result.json.

    Args:
        answer: the answer.
        checks: errors of observer and compensation before and after.
        tracking: tracking error predicted in closed loop; None if the simulation diverges.
        units: units of the axis.
    """
    gap = answer.gap
    result: dict[str, Any] = {
        "schema": SCHEMA,
        "verdict": answer.verdict,
        "usable": answer.usable,
        "warnings": list(answer.warnings),
        "gap": {
            "given": gap.given,
            "before": gap.before,
            "after": gap.after,
            "named": gap.named,
            "predictable": gap.predictable,
            "floor": gap.floor,
            "noise": gap.noise,
            "unit": UNIT,
            "on": gap.held_out,
            "band_hz": [0.0, gap.band],
            "closure": gap.closure,
            "unweighted": {"before": gap.unweighted_before, "after": gap.unweighted_after},
            "interval_before": list(gap.interval_before),
            "interval_after": list(gap.interval_after),
        },
        "effects": [
            {
                "name": item.settings.name,
                "parameters": by_name(item.settings.name, item.settings.values),
                "std_error": by_name(item.settings.name, item.std_error),
                "undetermined": list(item.undetermined),
                "confidence": item.confidence,
                "alternatives": list(item.alternatives),
                "gap_before": gap.before if math.isnan(item.gap_before) else item.gap_before,
                "gap_after": gap.after if math.isnan(item.gap_after) else item.gap_after,
            }
            for item in answer.effects
        ],
        "learnt": [
            {
                "name": item.map.name,
                "coordinates": list(item.coordinates),
                "share": item.share,
                "sentence": item.sentence,
                "formula": item.formula.text if item.formula else None,
                "gap_after": answer.gap_with_learnt,
            }
            for item in answer.learnt
        ],
        "changed": [
            {
                "name": item.name,
                "from": item.before,
                "to": item.after,
                "std_error": item.std_error,
                "closes": item.closes,
            }
            for item in answer.changed
        ],
        "remainder": answer.remainder,
        "tests": [
            {
                "of": test.of,
                "name": test.name,
                "value": finite_or_none(test.value),
                "threshold": test.threshold,
                "passed": test.passed,
            }
            for test in answer.tests
        ],
        "located": [
            {
                "coordinate": item.coordinate,
                "from": item.low,
                "to": item.high,
                "share": item.share,
                "p_value": item.p_value,
            }
            for item in answer.located
        ],
        "feedforward": {
            "not_cancelled_before": finite_or_none(checks[0].friction_not_cancelled),
            "not_cancelled_after": finite_or_none(checks[1].friction_not_cancelled),
            "unit": f"{units.effort} rms",
            "along": checks[1].along,
            "share": checks[1].share,
        },
        "tracking_predicted": None if tracking is None else tracking.as_dict(units),
        "detectable": answer.detectable,
        "next_experiment": answer.next_experiment,
        "notes": list(answer.diagnosis.notes),
    }
    return result


def by_name(name: str, values: Sequence[float]) -> dict[str, float]:
    """Return values of an effect as a dictionary by parameter name."""
    return {p.name: float(v) for p, v in zip(effect(name).parameters, values, strict=True)}


def changes_of(answer: Answer) -> dict[str, Any]:
    """Return the changes of the settings of an axis: refitted parameters, effects and learnt maps.

    The changes are empty if held-out data confirm no result.
    """
    if not (answer.effects or answer.learnt or answer.changed or answer.verdict == "no_effect"):
        return {}
    model = answer.model
    friction = model.friction
    effects = list(model.effects)
    known = {item.name for item in effects}
    effects += [item.settings for item in answer.effects if item.settings.name not in known]
    count = len(friction.element_stiffness)
    changes: dict[str, Any] = {
        "mass": model.mass,
        "friction.viscous_coefficient": friction.viscous_coefficient,
        "friction.coulomb_force": friction.coulomb_force,
        "friction.static_force": max(friction.static_force, friction.coulomb_force),
        "friction.stribeck_velocity": friction.stribeck_velocity,
        "friction.element_stiffness": list(friction.element_stiffness),
        "friction.element_fraction": list(friction.element_fraction),
    }
    changes["friction.element_damping"] = [model.relaxation * kappa for kappa in friction.element_stiffness]
    if model.relaxation == 0.0 and count == len(answer.diagnosis.nominal.friction.element_stiffness):
        del changes["friction.element_damping"]
    if model.is_unsmoothed and friction.model != "gms":
        changes["friction.model"] = "gms"
        changes["friction.attraction_rate"] = friction.coulomb_force / UNSMOOTHED_SETTLING_TIME
    elif friction.model == "gms":
        changes["friction.model"] = "gms"
        changes["friction.attraction_rate"] = friction.attraction_rate
    if effects:
        changes["effects.names"] = [item.name for item in effects]
        for item in effects:
            entry = effect(item.name)
            for key, value in (named_values(entry, item.values or entry.defaults) or {}).items():
                changes[f"effects.{item.name}.{key}"] = list(value) if isinstance(value, tuple) else value
    return changes


def augmented_text(answer: Answer, settings: Settings, axis: str, out: Path) -> str:
    """Return the text of augmented.yaml.

    Args:
        answer: the answer.
        settings: the settings of the given file.
        axis: name of the axis.
        out: folder of the file; relative file names in it are rewritten for it.
    """
    head = f"sgms diagnose: {answer.verdict}; gap {answer.gap.before:.3g} -> {answer.gap.after:.3g} % of rms effort"
    remarks = {
        f"{axis}.effects.{item.settings.name}.{name}": f"{NOT_DETERMINED}; do not rely on it"
        for item in answer.effects
        for name in item.undetermined
    }
    return settings_text(settings, out / AUGMENTED, {axis: changes_of(answer)}, {"": head, **remarks})


def write_augmented(answer: Answer, settings: Settings, axis: str, out: Path) -> None:
    """Write augmented.yaml; arguments as ``augmented_text``, and the folder is created if it does not exist."""
    write_text(augmented_text(answer, settings, axis, out), out / AUGMENTED)


def finite_or_none(value: float) -> float | None:
    """Return a number, or None if it is not finite, for JSON."""
    return value if math.isfinite(value) else None


def write_result(
    answer: Answer, checks: Sequence[CompensationCheck], tracking: PredictedTracking | None, units: Units, out: Path
) -> None:
    """Write result.json; arguments as ``result_of``, and the folder."""
    write_text(json.dumps(result_of(answer, checks, tracking, units), indent=1) + "\n", out / "result.json")
