"""The named effects of an answer."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from sgms_observer.diagnosis.diagnosis import Diagnosis, Round
from sgms_observer.diagnosis.fit import Refit
from sgms_observer.diagnosis.gap import Gap
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

ONE_RECORDING_CONFIDENCE = 0.9
"""Largest confidence without a held-out recording: nothing shows that the effect appears again."""
NINETY = 1.645
"""Half width of a 90 % interval in standard errors."""
NOT_DETERMINED = "not determined by these recordings"


@dataclass(frozen=True)
class Named:
    """One named effect.

    Attributes:
        settings: the effect with its parameters.
        std_error: standard error of each parameter.
        confidence: probability that it is this effect and no alternative.
        alternatives: effects that the recordings do not distinguish from it.
        gap_before, gap_after: gap without and with it [%].
    """

    settings: EffectSettings
    std_error: tuple[float, ...]
    confidence: float
    alternatives: tuple[str, ...]
    gap_before: float
    gap_after: float

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Return the parameters whose values say nothing.

        The 90 % interval is at least as wide as the allowed range, or the standard error of a parameter that is never
        negative is larger than its value.
        """
        rows = zip(effect(self.settings.name).parameters, self.settings.values, self.std_error, strict=False)
        return tuple(
            parameter.name
            for parameter, value, error in rows
            if 2.0 * NINETY * error >= parameter.maximum - parameter.minimum
            or (parameter.minimum >= 0.0 and error > abs(value))
        )


def named_effects(
    diagnosis: Diagnosis,
    accepted: Sequence[Round],
    fit: Refit,
    gap: Gap,
    gap_without: Callable[[Sequence[str]], float],
) -> list[Named]:
    """Return the accepted effects in the order in which they reduce the gap most, each beside those before it.

    The other parameters are fitted again for each choice of effects.

    Args:
        diagnosis: the diagnosis.
        accepted: rounds that named an effect.
        fit: model with all of them.
        gap: gap before and after.
        gap_without: function that returns the gap on the same recordings without some of the effects [%].
    """
    rounds = {item.accepted.candidate.name: item for item in accepted if item.accepted}
    left, listed, last = list(rounds), list[Named](), gap.before
    while left:
        gaps = {left[0]: gap.after}
        if len(left) > 1:
            others = [[one for one in left if one != name] for name in left]
            gaps = {name: gap_without(later) for name, later in zip(left, others, strict=True)}
        name = min(gaps, key=lambda one: gaps[one])
        listed.append(_as_named(diagnosis, fit, rounds, name, last, gaps[name]))
        last = gaps[name]
        left.remove(name)
    return listed


def _as_named(
    diagnosis: Diagnosis, fit: Refit, rounds: Mapping[str, Round], name: str, before: float, after: float
) -> Named:
    """Return one accepted effect.

    Args:
        diagnosis: the diagnosis.
        fit: model with all accepted effects.
        rounds: round that accepted each effect.
        name: the effect.
        before, after: gap without and with it [%].
    """
    item = rounds[name]
    assert item.accepted is not None
    index = [one.name for one in fit.effects].index(name)
    settings = fit.effects[index]
    std = tuple(diagnosis.written.errors.get((index, j), 0.0) for j in range(len(settings.values)))
    confidence = float(np.prod([stats.norm.cdf(test.value) for test in item.comparisons.values()]))
    confidence = min(confidence, float(stats.norm.cdf(item.accepted.improvement.z_score)))
    if not diagnosis.final_state.held_out_motions:
        confidence = min(confidence, ONE_RECORDING_CONFIDENCE)
    return Named(settings, std, confidence, item.alternatives, before, after)


def measured_quantisation(diagnosis: Diagnosis) -> list[Named]:
    """Return the quantisation effect if the positions lie on a coarser grid than the settings say."""
    if diagnosis.resolution is None or diagnosis.is_poor:
        return []
    settings = EffectSettings("quantisation", (diagnosis.resolution,))
    return [Named(settings, (0.005 * diagnosis.resolution,), 0.99, (), math.nan, math.nan)]
