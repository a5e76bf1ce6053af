"""What a diagnosis says to the outside: result.json and augmented.yaml."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from sgms_observer.diagnosis.advice import Named, detectable, next_experiment
from sgms_observer.diagnosis.decide import NAMING, Round
from sgms_observer.diagnosis.fit import Refit, Refits
from sgms_observer.diagnosis.gap import Gap, measure
from sgms_observer.diagnosis.locate import Located, locate
from sgms_observer.diagnosis.model import MASS, STATIC, Model
from sgms_observer.diagnosis.uncertainty import with_shape
from sgms_observer.diagnosis.workflow import Diagnosis, Options
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings, Settings
from sgms_observer.settings.write import write_settings
from sgms_observer.whole_file import write_text


@dataclass(frozen=True)
class Answer:
    """The whole answer.

    Attributes:
        verdict: see docs/discrepancy.md.
        gap: before and after.
        effects: what was found.
        located: where the nominal model disagrees, significant coordinates only.
        all_located: every coordinate.
        located_after: the same coordinates as ``located``, with the effects in the model; empty when there are none.
        detectable: smallest size each effect would have been seen at, as a share of the Coulomb force.
        next_experiment: one sentence, or None.
        model: the model after.
        diagnosis: everything else.
    """

    verdict: str
    gap: Gap
    effects: tuple[Named, ...]
    located: tuple[Located, ...]
    all_located: tuple[Located, ...]
    located_after: tuple[Located, ...]
    detectable: dict[str, float]
    next_experiment: str | None
    model: Model
    diagnosis: Diagnosis


def answer_of(found: Diagnosis, options: Options) -> Answer:
    """Turn a diagnosis into an answer, judged on held-out data.

    Args:
        found: the diagnosis.
        options: as it was run.
    """
    verdict, after = found.verdict, found.after
    before_model, after_model = found.before.model, after.model
    accepted = [step for step in found.rounds if step.accepted]
    extra = _extra(found)
    if verdict in ("unknown_effect", "cannot_tell"):
        after_model, accepted, extra = before_model, [], []
    if extra and found.deviation is not None:
        before_model, after_model = _with_deviation(found, options)
    stages = [_stage(after_model, found, count) for count in range(1, len(accepted))]
    gap = measure(found, before_model, after_model, stages, options.seed)
    if accepted and gap.after > gap.before:
        verdict, after_model, accepted = "unknown_effect", before_model, []
        gap = measure(found, before_model, before_model, [], options.seed)
    named = _named(after, accepted, gap, found, options.tolerance) + extra
    base = gap.residual_before
    everywhere = locate(base, gap.motions, options.seed)
    is_alarm = verdict not in ("no_effect", "cannot_tell")
    told = [item for item in everywhere if item.p_value < 0.02][:4] if is_alarm else []
    afterwards = {item.coordinate: item for item in locate(gap.residual_after, gap.motions, options.seed)}
    told_after = [afterwards[item.coordinate] for item in told] if named else []
    return Answer(
        verdict, gap, tuple(named), tuple(told), tuple(everywhere), tuple(told_after),
        detectable(found, options.tolerance), next_experiment(verdict, named, told, found), after_model, found,
    )  # fmt: skip


def _stage(model: Model, found: Diagnosis, count: int) -> Model:
    """Return the model after its first ``count`` new effects."""
    return replace(model, effects=model.effects[: len(found.own) + count])


def _extra(found: Diagnosis) -> list[Named]:
    """Return effects that were not found by the residual: mass, gain, encoder grid."""
    listed = []
    if found.deviation is not None and found.verdict in NAMING:
        item = found.deviation
        settings = EffectSettings(item.name, (item.value,))
        listed.append(Named(settings, (item.std_error,), 0.9, item.alternatives, 0.0, 0.0))
    if found.resolution is not None:
        settings = EffectSettings("quantisation", (found.resolution,))
        listed.append(Named(settings, (0.005 * found.resolution,), 0.99, (), 0.0, 0.0))
    return listed


def _with_deviation(found: Diagnosis, options: Options) -> tuple[Model, Model]:
    """Return the nominal model inside its owner's tolerance, and the model with the mass or gain error in it."""
    item = found.deviation
    assert item is not None
    logs = found.after.logs.copy()
    clipped = logs.copy()
    clipped[: STATIC + 2] = np.clip(clipped[: STATIC + 2], -options.tolerance, options.tolerance)
    before = found.nominal.shifted(clipped).with_effects(found.after.effects)
    effects = (*found.after.effects, EffectSettings(item.name, (item.value,)))
    start = logs.copy()
    if item.name == "mass_error":
        start[MASS] = 0.0
    else:
        start[: STATIC + 1] += math.log(item.value)
    fixed = [(i, j) for i, one in enumerate(effects) for j in range(len(one.values))]
    return before, Refits(found.judged, found.nominal, options.tolerance).of(effects, start, 4, fixed).model


def _named(after: Refit, accepted: Sequence[Round], gap: Gap, found: Diagnosis, tolerance: float) -> list[Named]:
    """Return the effects that were accepted, in their order."""
    if not accepted:
        return []
    fixed = [(i, j) for i, e in enumerate(after.effects) for j in range(len(e.values)) if (i, j) not in after.free]
    refits = Refits(found.judged, found.nominal, tolerance, found.limit)
    fresh = refits.of(after.effects, after.logs, 1, fixed)  # its derivatives
    deviations = with_shape(refits, fresh, found.held_out)
    errors: dict[tuple[int, int], float] = dict(zip(fresh.free, deviations.tolist(), strict=True))
    listed = []
    for i, step in enumerate(accepted):
        index = len(found.own) + i
        settings = after.effects[index]
        std = tuple(errors.get((index, j), 0.0) for j in range(len(settings.values)))
        later = {item.listed[0].name for item in accepted[i + 1 :]}
        best = step.listed[0].taken
        others = [min(max(item.taken, 0.0), best) for item in step.listed[1:] if item.name not in later]
        doubt = sum(math.exp(-(best - other) / (8.0 + 0.02 * best)) for other in others)
        listed.append(
            Named(
                settings,
                std,
                1.0 / (1.0 + doubt),
                step.alternatives,
                gap.steps[min(i, len(gap.steps) - 2)],
                gap.steps[i + 1],
            )
        )
    return listed


def result_of(answer: Answer) -> dict[str, Any]:
    """Return the content of result.json, schema 1."""
    gap = answer.gap
    closure = gap.closure
    return {
        "schema": 1,
        "verdict": answer.verdict,
        "gap": {
            "before": gap.before,
            "after": gap.after,
            "floor": gap.floor,
            "unit": "% of rms effort",
            "on": gap.held_out,
            "closure": closure,
            "interval_after": list(gap.interval_after),
        },
        "effects": [
            {
                "name": item.settings.name,
                "parameters": _by_name(item.settings.name, item.settings.values),
                "std_error": _by_name(item.settings.name, item.std_error),
                "confidence": item.confidence,
                "alternatives": list(item.alternatives),
                "gap_before": item.gap_before or gap.before,
                "gap_after": item.gap_after or gap.after,
            }
            for item in answer.effects
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
        "detectable": answer.detectable,
        "next_experiment": answer.next_experiment,
        "notes": list(answer.diagnosis.notes),
        "candidates": [
            {item.name: item.taken for item in step.listed} for step in answer.diagnosis.rounds if step.listed
        ],
    }


def _by_name(name: str, values: Sequence[float]) -> dict[str, float]:
    """Return values by the names of an effect's parameters."""
    return {p.name: float(v) for p, v in zip(effect(name).parameters, values, strict=True)}


def changes_of(answer: Answer) -> dict[str, Any]:
    """Return the changes of an axis's settings: refitted parameters and all effects."""
    if answer.verdict in ("unknown_effect", "cannot_tell"):
        return {}
    model = answer.model
    friction = model.friction
    effects = list(model.effects)
    known = {item.name for item in effects}
    effects += [item.settings for item in answer.effects if item.settings.name not in known]
    changes: dict[str, Any] = {
        "mass": model.mass,
        "friction.viscous_coefficient": friction.viscous_coefficient,
        "friction.coulomb_force": friction.coulomb_force,
        "friction.static_force": max(friction.static_force, friction.coulomb_force),
        "friction.stribeck_velocity": friction.stribeck_velocity,
        "friction.element_stiffness": list(friction.element_stiffness),
        "friction.element_fraction": list(friction.element_fraction),
    }
    if friction.model == "gms":
        changes["friction.attraction_rate"] = friction.attraction_rate
    if effects:
        changes["effects.names"] = [item.name for item in effects]
        for item in effects:
            for key, value in _by_name(item.name, item.values or effect(item.name).defaults).items():
                changes[f"effects.{item.name}.{key}"] = value
    return changes


def write(answer: Answer, settings: Settings, axis: str, out: Path) -> None:
    """Write result.json and augmented.yaml.

    Args:
        answer: the answer.
        settings: the settings as read.
        axis: name of the axis.
        out: folder; made if need be.
    """
    write_text(json.dumps(result_of(answer), indent=1) + "\n", out / "result.json")
    head = f"sgms diagnose: {answer.verdict}; gap {answer.gap.before:.3g} -> {answer.gap.after:.3g} % of rms effort"
    write_settings(settings, out / "augmented.yaml", {axis: changes_of(answer)}, {"": head})
