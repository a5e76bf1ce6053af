"""The next experiment."""

from __future__ import annotations

from collections.abc import Sequence

from sgms_observer.diagnosis.diagnosis import Diagnosis
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.named import Named
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.units import Units

_NO_PLACE = ("time", "time, along the motion")
"""Coordinates that no motion can stay at."""


def next_experiment(
    verdict: str,
    named: Sequence[Named],
    located: Sequence[Located],
    diagnosis: Diagnosis,
    units: Units,
    is_explained: bool,
    has_disturbance: bool,
) -> str | None:
    """Return one sentence on what to record next, or None.

    Args:
        verdict: the verdict.
        named: the named effects.
        located: coordinates over which the residual varies.
        diagnosis: the diagnosis.
        units: units of the axis.
        is_explained: whether the model explains most of the effort.
        has_disturbance: whether a force acts that does not repeat.
    """
    if verdict == "cannot_tell":
        if diagnosis.is_poor:
            sentence = diagnosis.warnings[0]
        elif diagnosis.is_contact_hidden:
            sentence = "record the position with a finer encoder, the motor's for example"
        elif is_explained:
            sentence = "record more motion to learn from: slow and fast strokes both ways, with reversals and rests"
        else:
            sentence = "identify the axis first, or record more motion"
        return sentence[0].upper() + sentence[1:] + "."
    if verdict == "ambiguous":
        for item in named:
            if item.alternatives:
                names = ", ".join(item.alternatives)
                return f"To tell {item.settings.name} from {names}, record: {effect(item.settings.name).excitation}."
    if verdict == "unknown_effect" and has_disturbance:
        return (
            "Record the same motion twice, and once more after changing one thing at a time (cables, compressed air,"
            " supply): what differs at the same place and time comes from outside."
        )
    if verdict == "unknown_effect" and located:
        where = next((item for item in located if item.is_in_a_range and item.coordinate not in _NO_PLACE), None)
        if where is None:
            return (
                f"The residual changes with {located[0].coordinate} over its whole range: record the same motion again"
                " after changing one thing at a time (load, temperature, cables)."
            )
        return (
            f"Record slow repeated motion that stays at {where.coordinate} {where.low:.3g} to {where.high:.3g}"
            f" {units.of(where.unit)}, and the same motion again after changing one thing at a time (load, temperature,"
            " cables)."
        )
    if verdict == "no_effect" and diagnosis.rounds:
        screenings = {
            name: screening for name, screening in diagnosis.rounds[0].screenings.items() if screening.trials > 0
        }
        weakest = min(screenings, key=lambda name: screenings[name].independent_share, default=None)
        if weakest is not None:
            return (
                f"These recordings are least sensitive to {weakest}. To test for it, record:"
                f" {effect(weakest).excitation}."
            )
    return None
