"""Jumps of a recorded position: an angle that wraps, a homing within the recording, single wrong samples.

A motion, however fast, spreads over several increments of the position, and no increment departs from the local ones by
much more than the others do. What departs far more, and alone, is a jump: the position changes by more than the axis
moves within one sample.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import median_filter

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.observer.samples import Samples
from sgms_observer.offline.encoder import encoder_step

MAX_PAUSE = 3.5
"""Longest pause within a piece of a recording, in periods."""
MIN_JUMP = 10.0
"""Smallest jump, over what increments of the motion depart from the local ones. The logs of the test machines and of
docs/real_logs.md stay below 2 at any rate and encoder, a homing or a wrap is above 1000."""
MIN_LEAP = 3.0
"""Smallest jump, over the largest increment that two successive increments share. The two halves of a motion that lasts
one sample share up to half of it."""
TURNS = (2.0 * math.pi, 360.0)
"""Periods of an angle, in radians and in degrees."""
_LOCAL = 7  # increments whose median is the local one: two wrong samples side by side make three of them wrong
_MAX_LOCAL_RATIO = 2.0 * MAX_PAUSE
"""Largest ratio of an increment to the local one that is motion: samples may be missing where the axis accelerates."""
_USUAL = 0.95
"""Quantile of the changes of the increments that is usual. A jump makes two changes, so that every fortieth sample may
jump."""
_MIN_CHANGES = 20  # of the position; fewer do not show what is usual
_MAX_WRONG = int(MAX_PAUSE) - 1  # wrong samples side by side that count as missing, as lost samples do
_MIN_WRAPS = 2  # jumps of one size; a single one is a wrap only where its size is a turn
_MIN_FILLED = 0.9
"""Smallest range of the positions over the period of a counter: it counts up to its end before it wraps."""
_MIN_TURNED = 0.5
"""Smallest range of the unwrapped positions over the period of a counter; an axis at rest that is homed has none."""
_MAX_TURN = 0.25
"""Largest share of a turn between two samples for which the direction of an angle that wraps is sure."""
_MAX_OFF = 1.0e-3
"""Largest relative difference of a jump of a counter from its range, a power of two or what its positions fill: noise
and acceleration."""
_ROUNDING = 64.0 * float(np.finfo(np.float64).eps)
_MAX_PASSES = 10  # over wraps that hide each other; two are enough for all logs of the tests
_NAMED = 5  # jumps that a note names


@dataclass(frozen=True)
class Continuous:
    """Samples without jumps of the position.

    Attributes:
        samples: the samples: unwrapped, and NaN where a single position was wrong.
        cuts_ns: stamps before which the position jumps [ns], in order of time.
        findings: what the position does, such as ``the position wraps 3 times by 6.28319 rad``.
        notes: the same as sentences, with the name of the recording and what became of the samples.
    """

    samples: Samples
    cuts_ns: Ints
    findings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def without_jumps(samples: Samples, name: str, unit: str) -> Continuous:
    """Return samples whose position is unwrapped, without single wrong positions, and the stamps of other jumps.

    Args:
        samples: recorded samples of one axis, in SI units.
        name: of the recording, for the notes.
        unit: of the position, for the notes.
    """
    given = np.flatnonzero(np.isfinite(samples.position))
    given = given[later_stamps(samples.stamp_ns[given])]
    if len(given) < _MIN_CHANGES:
        return Continuous(samples, np.empty(0, dtype=np.int64))
    stamp, position = samples.stamp_ns[given], samples.position[given]
    unwrapped, period, wraps = _unwrapped(position, stamp)
    if not wraps and len(find_jumps(position, stamp)) == 0:
        return Continuous(samples, np.empty(0, dtype=np.int64))
    found_and_done = []
    is_right = _right_samples(unwrapped, stamp)
    if not wraps and not np.all(is_right):
        unwrapped[is_right], period, wraps = _unwrapped(position[is_right], stamp[is_right])
    if wraps:
        times = "once" if wraps == 1 else f"{wraps} times"
        found_and_done.append((f"the position wraps {times} by {period:.6g} {unit}", "it was unwrapped"))
    whole, reference = samples.position.copy(), samples.reference_position
    whole[given] = np.where(is_right, unwrapped, np.nan)
    if wraps:
        reference = whole + np.remainder(reference - whole + 0.5 * period, period) - 0.5 * period
    found, sizes = _jumps(unwrapped[is_right], stamp[is_right])
    cuts = stamp[is_right][found]
    if not np.all(is_right):
        first, wrong = float(stamp[~is_right][0] - stamp[0]) * 1e-9, np.count_nonzero(~is_right)
        one = f"a single position lies far off the motion, at {first:.3f} s"
        finding = one if wrong == 1 else f"{wrong} single positions lie far off the motion, the first at {first:.3f} s"
        done = "it counts as missing" if wrong == 1 else "they count as missing"
        found_and_done.append((finding, f"{done}: check the encoder and its cable"))
    if len(found):
        listed = [
            f"{size:.4g} {unit} at {(at - stamp[0]) * 1e-9:.3f} s"
            for size, at in zip(sizes[:_NAMED].tolist(), cuts[:_NAMED].tolist(), strict=True)
        ]
        more = f" and {len(cuts) - _NAMED} times more" if len(cuts) > _NAMED else ""
        found_and_done.append(
            (
                f"the position jumps within one sample by {', '.join(listed)}{more}",
                "the recording is cut there: home the axis before a recording, and check the encoder",
            )
        )
    continuous = replace(samples, position=whole, reference_position=reference)
    notes = tuple(f"{name}: {finding}; {done}" for finding, done in found_and_done)
    return Continuous(continuous, cuts, tuple(finding for finding, _done in found_and_done), notes)


def later_stamps(stamp_ns: Ints) -> Booleans:
    """Return which stamps come after all stamps before them.

    Args:
        stamp_ns: stamps in the order they come [ns], shape (n,).
    """
    newest = np.maximum.accumulate(stamp_ns)
    return np.concatenate((np.ones(min(len(stamp_ns), 1), dtype=bool), stamp_ns[1:] > newest[:-1]))


def find_jumps(position: Floats, stamp_ns: Ints) -> Ints:
    """Return the numbers of the samples before which the position jumps, in order.

    Args:
        position: finite positions, shape (n,).
        stamp_ns: their increasing stamps [ns], shape (n,).
    """
    return _jumps(position, stamp_ns)[0]


def _jumps(position: Floats, stamp_ns: Ints) -> tuple[Ints, Floats]:
    """Return the numbers of the samples before which the position jumps, and by how much [m or rad].

    An increment is compared with the median of its neighbours. Held samples and encoder steps would hide the local
    increment, so that only changes of the position count.
    """
    nothing = np.empty(0, dtype=np.int64), np.empty(0)
    largest = float(np.max(np.abs(position), initial=0.0))
    if len(position) < _MIN_CHANGES or not largest > 0.0:
        return nothing
    pauses, increments = np.diff(stamp_ns), np.diff(position / largest)  # so that no product overflows
    at = np.flatnonzero((increments != 0.0) & (pauses <= MAX_PAUSE * float(np.median(pauses))))
    if len(at) < _MIN_CHANGES:
        return nothing
    moved = increments[at]
    usual = max(float(np.quantile(np.abs(np.diff(moved)), _USUAL)), _ROUNDING)
    departure = moved - median_filter(moved, _LOCAL, mode="mirror")
    if float(np.max(np.abs(departure))) <= MIN_JUMP * usual:
        return nothing
    found = np.flatnonzero(_stand_alone(departure, moved, max(usual, encoder_step(position) / largest)))
    around = 0.5 * (moved[np.maximum(found - 1, 0)] + moved[np.minimum(found + 1, len(moved) - 1)])
    return at[found] + 1, (moved[found] - around) * largest


def _stand_alone(departure: Floats, moved: Floats, usual: float) -> Booleans:
    """Return which increments are jumps.

    A quick motion departs from the local increment too, but in two successive increments of one direction, unless it
    starts and ends between two samples. So what two successive increments share is what the axis moves within a sample,
    and a jump is alone and larger. Of the largest shared ones, as many as there are lone increments may be wrong
    samples side by side.

    Args:
        departure: of each increment from the local one, shape (n,).
        moved: the increments, shape (n,).
        usual: how far increments depart.
    """
    local, sign = moved - departure, np.sign(departure)
    is_motion = (moved * local > 0.0) & (np.abs(moved) <= _MAX_LOCAL_RATIO * np.abs(local))
    size = np.where(is_motion, 0.0, np.abs(departure))
    padded = np.concatenate(([0.0], departure, [0.0]))
    lone = size > MIN_JUMP * np.maximum(usual, np.maximum(sign * padded[:-2], sign * padded[2:]))
    shared = np.where(moved[1:] * moved[:-1] > 0.0, np.minimum(np.abs(moved[1:]), np.abs(moved[:-1])), 0.0)
    fastest = float(np.sort(shared)[-min(int(np.count_nonzero(lone)) + 1, len(shared))])
    is_large = (size > MIN_JUMP * usual) & (size > MIN_LEAP * fastest)
    near = np.convolve(lone & is_large, np.ones(5), mode="same") > 0.5
    return np.asarray(is_large & near)


def _right_samples(position: Floats, stamp_ns: Ints) -> Booleans:
    """Return which positions are right: not one or two between a jump and the next one."""
    is_right = np.ones(len(position), dtype=bool)
    while True:
        places = np.flatnonzero(is_right)
        jumps = find_jumps(position[places], stamp_ns[places])
        back = np.flatnonzero(np.diff(jumps) <= _MAX_WRONG)
        if not len(back):
            return is_right
        for first, last in zip(jumps[back].tolist(), jumps[back + 1].tolist(), strict=True):
            is_right[places[first:last]] = False


def _unwrapped(position: Floats, stamp_ns: Ints) -> tuple[Floats, float, int]:
    """Return the unwrapped positions, the period, and how often they wrapped; the positions as they are without wraps.

    The period is a turn, or the range of a counter if nothing else jumps.
    """
    for period in TURNS:
        unwrapped = np.unwrap(position, period=period)
        if not _turns(position, unwrapped, stamp_ns, period):
            unwrapped = _without_wraps(position, stamp_ns, period)
        if wraps := _count_wraps(position, unwrapped, period):
            return unwrapped, period, wraps
    for period in _counter_range(position, _jumps(position, stamp_ns)[1]):
        unwrapped = _without_wraps(position, stamp_ns, period)
        if len(find_jumps(unwrapped, stamp_ns)) == 0 and float(np.ptp(unwrapped)) > _MIN_TURNED * period:
            return unwrapped, period, _count_wraps(position, unwrapped, period)
    return position.copy(), 0.0, 0


def _count_wraps(position: Floats, unwrapped: Floats, period: float) -> int:
    """Return how often positions wrap."""
    return int(np.count_nonzero(np.diff(np.round((unwrapped - position) / period))))


def _turns(position: Floats, unwrapped: Floats, stamp_ns: Ints, period: float) -> bool:
    """Return whether a position is an angle within one turn, of which no increment is near half a turn.

    This holds where wraps are many: at rest where the angle wraps, or at a speed of some samples per turn.
    """
    if not 0.5 * period < float(np.ptp(position)) <= period:
        return False
    pauses = np.diff(stamp_ns)
    moved = np.abs(np.diff(unwrapped))[pauses <= MAX_PAUSE * float(np.median(pauses))]
    return bool(np.all(moved < _MAX_TURN * period)) and len(find_jumps(unwrapped, stamp_ns)) == 0


def _without_wraps(position: Floats, stamp_ns: Ints, period: float) -> Floats:
    """Return the positions without the jumps of which one period leaves nothing.

    An angle that rests where it wraps may wrap back and forth in successive samples, which hide each other; those that
    are left are found when the first ones are gone.
    """
    for _ in range(_MAX_PASSES):
        jumps = find_jumps(position, stamp_ns)
        turned, turns = np.zeros(len(position)), np.round(np.diff(position)[jumps - 1] / period)
        turned[jumps] = np.where(np.abs(turns) == 1.0, -period * turns, 0.0)
        turned[find_jumps(position + np.cumsum(turned), stamp_ns)] = 0.0
        if not np.any(turned):
            break
        position = position + np.cumsum(turned)
    return position


def _counter_range(position: Floats, sizes: Floats) -> tuple[float, ...]:
    """Return the range of a counter that wraps by jumps of these sizes, where the positions fill it; else nothing."""
    if len(sizes) < _MIN_WRAPS:
        return ()
    jump, span, steps = float(np.median(np.abs(sizes))), float(np.ptp(position)), np.diff(np.unique(position))
    unit = float(np.min(steps[steps > _ROUNDING * float(np.max(np.abs(position)))]))
    likely = (unit * 2.0 ** round(math.log2(jump / unit)), span + unit, jump)
    period = next(one for one in likely if abs(one / jump - 1.0) < _MAX_OFF)
    return (period,) if _MIN_FILLED * period <= span <= period else ()
