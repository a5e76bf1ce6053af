"""What a diagnosis advises: the smallest effects these recordings would have shown, and what to record next."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.diagnosis.decide import ALARM_GAIN, alarm_threshold
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.tolerance import OUTSIDE
from sgms_observer.diagnosis.workflow import Diagnosis
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings


@dataclass(frozen=True)
class Named:
    """One effect of the answer.

    Attributes:
        settings: with its parameters.
        std_error: of each parameter.
        confidence: that it is this one and no alternative.
        alternatives: names the recordings cannot tell from it.
        gap_before, gap_after: before and after it was added [%].
    """

    settings: EffectSettings
    std_error: tuple[float, ...]
    confidence: float
    alternatives: tuple[str, ...]
    gap_before: float
    gap_after: float


def detectable(found: Diagnosis, tolerance: float) -> dict[str, float]:
    """Return the smallest size of each effect that these recordings would have shown.

    Sizes are peaks (2.5 times rms) as a share of the Coulomb force; for ``mass_error`` and ``actuator_gain`` a share of
    mass and gain. What the nominal parameters can take of an effect is not seen.
    """
    first = found.rounds[0].screen
    calibration = found.calibration
    count = len(first.residual)
    noise = float(np.mean([item.rms for item in first.judged.noise])) / found.nominal.friction.coulomb_force
    sizes = {}
    for name, listed in first.columns.items():
        if not listed:
            sizes[name] = 1.0
            continue
        needed = max(ALARM_GAIN, calibration.mean[name] + alarm_threshold(name, calibration) * calibration.spread[name])
        kept = float(np.median([item.kept for item in listed]))
        sizes[name] = float(min(9.99, 2.5 * noise * math.sqrt(needed / count) / max(kept, 1e-3)))
    sizes["mass_error"] = OUTSIDE * tolerance
    sizes["actuator_gain"] = 1.7 * tolerance
    return dict(sorted(sizes.items()))


def next_experiment(verdict: str, named: Sequence[Named], told: Sequence[Located], found: Diagnosis) -> str | None:
    """Return one sentence on what to record next, or None."""
    if verdict == "cannot_tell":
        return found.notes[-1][0].upper() + found.notes[-1][1:] + "."
    if verdict == "ambiguous":
        for item in named:
            if item.alternatives:
                names = ", ".join(item.alternatives)
                return f"To tell {item.settings.name} from {names}, record: {effect(item.settings.name).excitation}."
    if verdict == "unknown_effect" and found.unhomed:
        return f"{found.unhomed[0]}."
    if verdict == "unknown_effect" and told:
        where = told[0]
        return (
            f"Record slow repeated motion that stays at {where.coordinate} {where.low:.3g} to {where.high:.3g}"
            f" {where.unit}, and the same motion again after changing one thing at a time (load, temperature, cables)."
        )
    if verdict == "no_effect":
        weakest = max(
            found.rounds[0].screen.columns, key=lambda name: detectable(found, 0.05).get(name, 0.0), default=None
        )
        if weakest is not None:
            return f"Least visible here is {weakest}; to see less of it, record: {effect(weakest).excitation}."
    return None
