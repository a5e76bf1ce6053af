"""Look-ahead: the set-point extrapolated to when a compensation acts, and the element forces along that motion."""

from __future__ import annotations

import math

from sgms_observer.arrays import Floats, Ints
from sgms_observer.estimators.interval import advance_at_level, level_at
from sgms_observer.estimators.layout import GAMMA, PAPER_RESET, RESET, STRIBECK
from sgms_observer.filters.motion import ACCELERATION as FILTERED_ACCELERATION
from sgms_observer.filters.motion import ELAPSED, PRESENT_POSITION, PRESENT_VELOCITY
from sgms_observer.jit import njit

_SLOWEST = 1.0e-12  # speed at which a motion counts as at rest on the Stribeck curve [m/s]

# columns of what is looked ahead: SI units; the first is 1 where there is a set-point, TRAVEL is that since the last
# sample (NaN at the first) apart from what counts as noise, and what is ahead holds ``look_ahead`` later
HAS_REFERENCE, SET_VELOCITY, TRAVEL, ACCELERATION, JERK, AHEAD_POSITION, AHEAD_VELOCITY, AHEAD_ACCELERATION = range(8)
AHEAD_WIDTH = 8

# what is remembered from sample to sample
(
    LAST_POSITION, LAST_VELOCITY, LAST_CHANGE, LAST_JERK, BEFORE_LAST_JERK, HAS_LAST,
    GOOD_POSITION, GOOD_VELOCITY, GOOD_ACCELERATION, SLACK, MEMORY_SIZE,
) = range(11)  # fmt: skip

_ABSURD = 1.0e9  # SI units; what is larger is not looked at

_ALIKE = 0.4  # of two differences that agree, the smaller one's least share of the larger


@njit
def advance_elements(
    forces: Floats, modes: Ints, displacement: float, speed: float, factor: float, scalars: Floats, elements: Floats
) -> None:
    """Move every element along ``displacement``, in place.

    Args:
        forces: element forces [N], changed in place.
        modes: slip direction of GMS elements, changed in place; unused by S-GMS.
        displacement: signed travel of the step [m].
        speed: speed at which the Stribeck curve is read and the travel is made [m/s].
        factor: the effects' factor on the Stribeck level [-].
        scalars: model scalars.
        elements: rows kappa, nu, sigma.
    """
    if displacement == 0.0 or not math.isfinite(displacement):
        return
    rate = max(speed, _SLOWEST)
    velocity = math.copysign(rate, displacement)
    gain = scalars[GAMMA]
    if scalars[RESET] == PAPER_RESET:
        gain *= rate / scalars[STRIBECK]
    advance_at_level(
        scalars, elements, forces, modes, velocity, displacement / velocity, level_at(scalars, rate, factor), gain
    )


@njit
def velocity_after(velocity: float, acceleration: float, jerk: float, time: float) -> float:
    """Return the velocity [m/s] after ``time`` [s] at constant jerk."""
    return velocity + (acceleration + 0.5 * jerk * time) * time


@njit
def travel_after(velocity: float, acceleration: float, jerk: float, time: float) -> float:
    """Return the travel [m] after ``time`` [s] at constant jerk."""
    return (velocity + (0.5 * acceleration + jerk * time / 6.0) * time) * time


@njit
def turning_times(velocity: float, acceleration: float, jerk: float, end: float) -> tuple[float, float]:
    """Return when the velocity passes through zero before ``end`` [s], in order; ``end`` where it does not.

    Args:
        velocity: velocity now [m/s].
        acceleration: acceleration now [m/s^2].
        jerk: constant jerk [m/s^3].
        end: the times after it do not count [s].
    """
    discriminant = acceleration * acceleration - 2.0 * jerk * velocity
    if not discriminant > 0.0:
        return end, end
    # q avoids the cancellation of -a +- sqrt(a^2 - 2 j v); the roots are q / (j / 2) and v / q
    q = -0.5 * (acceleration + math.copysign(math.sqrt(discriminant), acceleration))
    first = velocity / q if q != 0.0 else end
    second = 2.0 * q / jerk if jerk != 0.0 else end
    if not 0.0 < first < end:
        first = end
    if not 0.0 < second < end:
        second = end
    return min(first, second), max(first, second)


@njit
def preview_elements(
    forces: Floats,
    modes: Ints,
    velocity: float,
    acceleration: float,
    jerk: float,
    look_ahead: float,
    factor: float,
    scalars: Floats,
    elements: Floats,
) -> float:
    """Move the elements through the next ``look_ahead`` seconds at constant jerk, in place.

    The travel between two reversals is one step.

    Args:
        forces: element forces [N], changed in place.
        modes: slip direction of GMS elements, changed in place.
        velocity: velocity now [m/s].
        acceleration: acceleration now [m/s^2].
        jerk: jerk over the look-ahead [m/s^3].
        look_ahead: time to bridge [s].
        factor: the effects' factor on the Stribeck level [-].
        scalars: model scalars.
        elements: rows kappa, nu, sigma.

    Returns:
        Velocity at the end [m/s].
    """
    first, second = turning_times(velocity, acceleration, jerk, look_ahead)
    begin, behind = 0.0, 0.0
    if first < look_ahead:
        travel = travel_after(velocity, acceleration, jerk, first)
        advance_elements(forces, modes, travel, abs(travel) / first, factor, scalars, elements)
        begin, behind = first, travel
        if second < look_ahead:
            travel = travel_after(velocity, acceleration, jerk, second)
            speed = abs(travel - behind) / (second - begin)
            advance_elements(forces, modes, travel - behind, speed, factor, scalars, elements)
            behind = travel
    ahead = velocity_after(velocity, acceleration, jerk, look_ahead)
    travel = travel_after(velocity, acceleration, jerk, look_ahead)
    advance_elements(forces, modes, travel - behind, abs(ahead), factor, scalars, elements)
    return ahead


@njit
def _agreed(first: float, second: float) -> float:
    """Return the smaller in magnitude of two numbers that agree, and 0 for those that do not or are not finite."""
    small, large = min(abs(first), abs(second)), max(abs(first), abs(second))
    if not (first * second > 0.0 and small >= _ALIKE * large and large < math.inf):
        return 0.0
    return math.copysign(small, first)


@njit
def _usable(value: float, instead: float) -> float:
    """Return a number limited in magnitude, so that later sums stay finite."""
    return value if abs(value) < _ABSURD else instead


@njit
def beyond_slack(slack: float, travel: float, width: float) -> tuple[float, float]:
    """Return the part of a travel that leaves a play of ``width`` to either side, and the place in the play then.

    Args:
        slack: place in the play before [m].
        travel: of the set-point [m].
        width: half the play [m]; 0 lets every travel pass.
    """
    place = slack + travel
    inside = min(max(place, -width), width)
    return place - inside, inside


@njit
def look_ahead_block(
    memory: Floats,
    look_ahead: float,
    standstill: float,
    set_point_standstill: float,
    motion: Floats,
    reference_position: Floats,
    reference_velocity: Floats,
    out: Floats,
) -> None:
    """Look ahead sample by sample; ``memory`` evolves in place.

    Args:
        memory: of the sample before, shape (MEMORY_SIZE,); zeros at the start.
        look_ahead: time to bridge [s].
        standstill: speed below which an axis without set-point counts as resting [m/s].
        set_point_standstill: speed of a set-point up to which its changes may be noise [m/s].
        motion: ``Motion.table``.
        reference_position: set-point [m], NaN where there is none, shape (n,).
        reference_velocity: its velocity [m/s], NaN where there is none, shape (n,).
        out: written, shape (n, AHEAD_WIDTH).
    """
    for k in range(motion.shape[0]):
        h = motion[k, ELAPSED]
        position, velocity = reference_position[k], reference_velocity[k]
        follows = memory[HAS_LAST] > 0.5 and h > 0.0
        travel = position - memory[LAST_POSITION] if follows else math.nan
        is_difference = not math.isfinite(velocity)
        if is_difference:
            velocity = travel / h if h > 0.0 else math.nan
        set_velocity = velocity
        has_reference = math.isfinite(velocity)
        acceleration = jerk = change = new_jerk = 0.0
        if has_reference:
            if follows and math.isfinite(memory[LAST_VELOCITY]):
                change = (velocity - memory[LAST_VELOCITY]) / h
                # the mean over the last step, brought to its end by half a step of jerk
                acceleration = _agreed(change, memory[LAST_CHANGE])
                new_jerk = (change - memory[LAST_CHANGE]) / h
                jerk = _agreed(_agreed(new_jerk, memory[LAST_JERK]), memory[BEFORE_LAST_JERK])
                if acceleration == change:
                    acceleration += 0.5 * jerk * h
            if is_difference and _agreed(velocity, memory[LAST_VELOCITY]) == 0.0:
                set_velocity = 0.0
            if not math.isfinite(travel):
                travel = velocity * h
            width = 0.0 if abs(velocity) > set_point_standstill else set_point_standstill * h
            if math.isfinite(travel):
                travel, slack = beyond_slack(memory[SLACK], travel, width)
                memory[SLACK] = slack
            start = position if math.isfinite(position) else motion[k, PRESENT_POSITION]
            ahead_acceleration = acceleration + jerk * look_ahead
        else:
            velocity = set_velocity = motion[k, PRESENT_VELOCITY]
            start = motion[k, PRESENT_POSITION]
            ahead_acceleration = motion[k, FILTERED_ACCELERATION]
        is_resting = not has_reference and not abs(velocity) > standstill
        moved = 0.0 if is_resting else travel_after(set_velocity, acceleration, jerk, look_ahead)
        memory[GOOD_POSITION] = _usable(start + moved, memory[GOOD_POSITION])
        memory[GOOD_VELOCITY] = _usable(
            velocity_after(set_velocity, acceleration, jerk, look_ahead), memory[GOOD_VELOCITY]
        )
        memory[GOOD_ACCELERATION] = _usable(ahead_acceleration, memory[GOOD_ACCELERATION])
        out[k, HAS_REFERENCE] = 1.0 if has_reference else 0.0
        out[k, SET_VELOCITY] = set_velocity
        out[k, TRAVEL] = travel
        out[k, ACCELERATION] = acceleration
        out[k, JERK] = jerk
        out[k, AHEAD_POSITION] = memory[GOOD_POSITION]
        out[k, AHEAD_VELOCITY] = memory[GOOD_VELOCITY]
        out[k, AHEAD_ACCELERATION] = memory[GOOD_ACCELERATION]
        memory[LAST_POSITION] = position
        memory[LAST_VELOCITY] = velocity if has_reference else math.nan
        memory[LAST_CHANGE] = change
        memory[BEFORE_LAST_JERK] = memory[LAST_JERK]
        memory[LAST_JERK] = new_jerk
        memory[HAS_LAST] = 1.0
