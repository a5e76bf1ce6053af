"""Errors of a demonstration in numbers and words: estimated friction against the truth, tracking, late messages."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from sgms_observer.report.recorded import RECOVERY
from sgms_observer.settings.units import Units

SCHEMA = 1
MIN_RECORDED_SHARE = 0.95
"""Share of the samples that have an estimate, below which the figures do not stand for the whole run."""

MAX_CLEAR_PEAK = 0.9
"""Largest tracking error apart from late compensations over the largest of all, below which the late ones decide it."""


@dataclass(frozen=True)
class Half:
    """Errors over one half of the run.

    Attributes:
        samples: how many there are.
        friction_rms: rms of estimated minus true friction [N].
        friction_share: the same as a share of the true friction's range.
        coverage: share of the samples whose truth lies within two standard deviations.
        tracking_rms: rms of true position minus set-point [m].
        tracking_peak: the largest of it [m].
        late_share: share of the samples whose compensation came after the time it was made for; NaN if not known.
        clear_rms: rms of the tracking error apart from those, and from what followed them [m].
        clear_peak: the largest of it [m].
    """

    samples: int
    friction_rms: float
    friction_share: float
    coverage: float
    tracking_rms: float
    tracking_peak: float
    late_share: float
    clear_rms: float
    clear_peak: float


def axis_result(without: Half, with_it: Half, same: int, compared: int) -> dict[str, Any]:
    """Return one axis of result.json: friction errors without compensation, tracking errors in SI units.

    Args:
        without: errors of the half without compensation.
        with_it: errors of the half with it.
        same: live estimates that the replay reproduces exactly.
        compared: live estimates.
    """
    return {
        "friction_rms": without.friction_rms,
        "friction_nrmse": without.friction_share,
        "tracking": {
            "rms_before": without.tracking_rms,
            "rms_after": with_it.tracking_rms,
            "peak_before": without.tracking_peak,
            "peak_after": with_it.tracking_peak,
        },
        "late_share": None if math.isnan(with_it.late_share) else with_it.late_share,
        "replay_equal": same,
        "replay_total": compared,
    }


def result_of(axes: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Return the content of result.json from each axis's name and ``axis_result``."""
    return {"schema": SCHEMA, "axes": axes}


def change(before: float, after: float) -> str:
    """Return how an error changed, in words."""
    if before > 0.0 and round(after / before, 1) == 1.0:
        return "about the same"
    if after <= before:
        return f"{before / after:.1f}x smaller" if after > 0.0 else "gone"
    return f"{after / before:.1f}x larger" if before > 0.0 else "new"


def headline(axis: str, without: Half, with_it: Half, units: Units) -> str:
    """Return the outcome in one sentence: friction error, rms and peak of the tracking error, and late messages.

    Args:
        axis: its name.
        without: errors of the half without compensation.
        with_it: errors of the half with it.
        units: of the axis.
    """
    largest = max(without.tracking_peak, with_it.tracking_peak)
    sizes = [
        f"{word} {change(before, after)}"
        f" ({units.readable(before, largest=largest)} to {units.readable(after, largest=largest)})"
        for word, before, after in (
            ("rms", without.tracking_rms, with_it.tracking_rms),
            ("peak", without.tracking_peak, with_it.tracking_peak),
        )
    ]
    if math.isnan(with_it.late_share):
        late = "the recording does not tell which messages came late"
    else:
        late = f"{100.0 * with_it.late_share:.3g} % of the compensation messages came late"
    return (
        f"axis {axis}: friction estimated to {100.0 * without.friction_share:.2f} % of its range; tracking error with"
        f" compensation: {', '.join(sizes)}; {late}"
    )


def missing_warnings(axis: str, share: float) -> list[str]:
    """Return a warning where many samples have no estimate: nothing is known of what happened then.

    Args:
        axis: its name.
        share: of the samples of the run that have an estimate [-].
    """
    if share >= MIN_RECORDED_SHARE:
        return []
    return [
        f"Warning: axis {axis}: only {100.0 * share:.0f} % of the samples have an estimate; the friction figures are"
        " about those alone. Stop other programs and run the demonstration again."
    ]


def late_warnings(axis: str, without: Half, with_it: Half, units: Units) -> list[str]:
    """Return a warning where late compensations decide the largest tracking error; arguments as of ``headline``.

    They decide it where the peak without them is below ``MAX_CLEAR_PEAK`` of the peak. Where the two are almost equal,
    the error would be about as large with every compensation in time, so that another run would not help. Where the
    peak without them is not known (NaN), they decide it too.
    """
    if not with_it.late_share > 0.0 or with_it.clear_peak >= MAX_CLEAR_PEAK * with_it.tracking_peak:
        return []
    peak = units.readable(with_it.tracking_peak, largest=max(without.tracking_peak, with_it.tracking_peak))
    return [
        f"Warning: axis {axis}: the largest tracking error with compensation, {peak}, follows a compensation that came"
        " late. Stop other programs and run the demonstration again."
    ]


def on_the_way(without: Half, with_it: Half, units: Units) -> str:
    """Return a sentence about late compensations, if the recording shows them; arguments as of ``headline``."""
    readable = readable_errors(without, with_it, units)
    if math.isnan(with_it.late_share):
        return "the recording does not tell which compensations came in time"
    if with_it.late_share == 0.0:
        return "every compensation came in time"
    late = f"{100 * with_it.late_share:.3g} % of the samples got a compensation late"
    if math.isnan(with_it.clear_rms):
        return (
            f"{late}. Late messages came so often that the error without them cannot be given. Stop other programs and"
            " run again"
        )
    return (
        f"{late}; apart from these and {1e3 * RECOVERY:.0f} ms after each: {readable(with_it.clear_rms)} rms,"
        f" {readable(with_it.clear_peak)} peak: rms {change(without.tracking_rms, with_it.clear_rms)},"
        f" peak {change(without.tracking_peak, with_it.clear_peak)}"
    )


def readable_errors(without: Half, with_it: Half, units: Units) -> Callable[[float], str]:
    """Return a function that formats tracking errors with one prefix; arguments as of ``headline``."""
    return partial(units.readable, largest=max(without.tracking_peak, with_it.tracking_peak))
