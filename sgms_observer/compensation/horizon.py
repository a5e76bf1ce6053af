"""Compensation horizon: the compensation of the next tenths of a second, along a reference that is known ahead.

The receiver uses the value at its own time. A late message has no effect while the message before covers that time.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.compensation.motion_ahead import advance_elements
from sgms_observer.compensation.safety import safe_output
from sgms_observer.effects.kernels import needed_command
from sgms_observer.estimators.layout import (
    MODEL_SIZE,
    OFFSET,
    VISCOUS,
    apply_parameters,
)
from sgms_observer.jit import njit

if TYPE_CHECKING:
    from sgms_observer.compensation.feedforward_kernel import ActuatorPath
    from sgms_observer.settings.axis import CompensationSettings

MIN_STEP = 1.0e-3
"""Time between two points [s]; the sample period if that is longer. The transition of friction after a reversal takes
several points."""

EVERY = 0.05
"""Sample time from one horizon to the next [s]; a horizon of the default length bridges 0.2 s without a message."""

# rows of what the kernel needs beside the motion
START, END, TRUST, TRUST_RATE, SHARE, STANDSTILL, RAW, LIMIT, SLEW, FADE, HORIZON_SIZE = range(11)


@dataclass(frozen=True)
class KnownMotion:
    """A reference that is known ahead of its time.

    Attributes:
        time_ns: times, increasing [ns], shape (n,).
        position: set-points [m], shape (n,).
        velocity: their velocities [m/s], shape (n,); between two points the position is the cubic through both.
    """

    time_ns: Ints
    position: Floats
    velocity: Floats

    @classmethod
    def of(cls, time_ns: Ints, position: Floats, velocity: Floats | None = None) -> KnownMotion | None:
        """Return the motion through received points; None if they are not a valid motion.

        Args:
            time_ns: as the attribute; points that do not increase are left out.
            position: as the attribute.
            velocity: as the attribute; None for straight lines between the points.
        """
        keep = np.isfinite(position)
        keep[1:] &= time_ns[1:] > np.maximum.accumulate(time_ns)[:-1]
        time_ns, position = time_ns[keep], position[keep]
        if len(time_ns) < 2:
            return None
        if velocity is None or not np.isfinite(velocity[keep]).all():
            return cls(time_ns, position, np.full(len(position), math.nan))
        return cls(time_ns, position, velocity[keep])

    def at(self, time_ns: Ints) -> tuple[Floats, Floats, Floats]:
        """Return position [m], velocity [m/s] and acceleration [m/s^2] at times inside the motion, each of shape (n,).

        Args:
            time_ns: times [ns], shape (n,); those outside count as its ends.
        """
        time_ns = np.clip(time_ns, self.time_ns[0], self.time_ns[-1])
        place = np.clip(np.searchsorted(self.time_ns, time_ns, side="right") - 1, 0, len(self.time_ns) - 2)
        length = (self.time_ns[place + 1] - self.time_ns[place]) * 1e-9
        share = (time_ns - self.time_ns[place]) * 1e-9 / length
        begin, end = self.position[place], self.position[place + 1]
        mean = (end - begin) / length
        if math.isnan(self.velocity[0]):
            return begin + share * (end - begin), mean, np.zeros(len(place))
        first, last = self.velocity[place] - mean, self.velocity[place + 1] - mean
        bend = (1.0 - share) * first - share * last
        position = begin + share * (end - begin) + share * (1.0 - share) * length * bend
        velocity = mean + (1.0 - 2.0 * share) * bend - share * (1.0 - share) * (first + last)
        acceleration = (-2.0 * bend - 2.0 * (1.0 - 2.0 * share) * (first + last)) / length
        return position, velocity, acceleration

    @property
    def largest_speed(self) -> float:
        """Return the largest mean speed from one point to the next [m/s]."""
        return float(np.max(np.abs(np.diff(self.position) / (np.diff(self.time_ns) * 1e-9))))

    @property
    def end_ns(self) -> int:
        """Return the time of the last point [ns]."""
        return int(self.time_ns[-1])


@dataclass(frozen=True)
class Horizon:
    """The future compensation.

    Attributes:
        time_ns: when each value is to act [ns], increasing, shape (n,).
        effort: the values [N], shape (n,); the last one of a whole horizon is zero.
    """

    time_ns: Ints
    effort: Floats

    def without_fading_end(self, settings: CompensationSettings, sample_period: float) -> Horizon:
        """Return the part that acts if every message comes in time.

        A horizon ends ``settings.horizon`` after its sample, and its last ``settings.timeout`` fades for an observer
        that has stopped: newer horizons replace that end. A horizon that is shorter than that ends with its reference
        and counts whole.

        Args:
            settings: of the axis.
            sample_period: nominal time between two samples [s].
        """
        time, first = grid_of(settings.look_ahead, settings.horizon, sample_period)
        if len(self.time_ns) < len(time) - first:
            return self
        keep = self.time_ns <= self.fades_from_ns(round(settings.timeout * 1e9))
        return Horizon(self.time_ns[keep], self.effort[keep])

    def fades_from_ns(self, timeout_ns: int) -> int:
        """Return when the end begins that acts only if the observer has stopped [ns].

        At least until the second next horizon begins every value counts: a short horizon may fade before the next one
        comes.

        Args:
            timeout_ns: time in which the end fades [ns].
        """
        return max(int(self.time_ns[-1]) - timeout_ns, int(self.time_ns[0]) + round(2.0 * EVERY * 1e9))


def grid_of(look_ahead: float, duration: float, sample_period: float) -> tuple[Floats, int]:
    """Return the times of the points after the latest sample [s], and the number of the first point of the horizon.

    Args:
        look_ahead: from the sample to the horizon's first point [s].
        duration: time from the sample to the last point of the horizon [s].
        sample_period: nominal time between two samples [s].
    """
    step = max(MIN_STEP, sample_period)
    before = math.ceil(look_ahead / step)
    inside = max(1, math.floor((duration - look_ahead) / step + 1e-9))
    way = look_ahead * np.arange(before) / max(before, 1)
    return np.concatenate([way, look_ahead + step * np.arange(inside + 1)]), before


@njit
def horizon_block(
    carried: Floats,
    carried_modes: Ints,
    model_scalars: Floats,
    model_elements: Floats,
    kinds: Floats,
    estimates: Floats,
    path: ActuatorPath,
    scalars: Floats,
    first: int,
    time: Floats,
    motion: Floats,
    effects_force: Floats,
    effects_factor: Floats,
    out: Floats,
) -> None:
    """Simulate the elements along a motion and write the compensation at each point from ``first`` on.

    Args:
        carried: element forces at the latest sample [N], not changed, shape (n_z,).
        carried_modes: slip direction of GMS elements, not changed, shape (n_z,).
        model_scalars, model_elements, kinds: as ``apply_parameters`` takes them.
        estimates: estimated parameters [SI units; kappa as share], shape (n_p,).
        path: from the command to the force.
        scalars: rows named above, shape (HORIZON_SIZE,).
        first: first row that is written.
        time: since the latest sample [s], increasing from 0, shape (n,).
        motion: set-point [m], velocity [m/s] and acceleration [m/s^2] at each time, shape (3, n).
        effects_force: force that the effects take there [N], shape (n,).
        effects_factor: their factor on the Stribeck level there [-], shape (n,).
        out: written [N], shape (n - first,).
    """
    n_z = len(carried)
    row = np.empty(MODEL_SIZE)
    bars = np.empty((3, n_z))
    unit = np.ones(len(kinds))
    forces, modes = carried.copy(), carried_modes.copy()
    apply_parameters(model_scalars, model_elements, kinds[:0], unit[:0], unit[:0], row, bars)
    if len(kinds) > 0:
        apply_parameters(model_scalars, model_elements, kinds, unit, estimates, row, bars)
    raw, output = scalars[RAW], 0.0
    for k in range(len(time)):
        factor = effects_factor[k] if effects_factor[k] > 0.0 else 1.0
        h = time[k] - time[k - 1] if k > 0 else 0.0
        if h > 0.0:
            travel = motion[0, k] - motion[0, k - 1]
            turn = motion[1, k] * motion[1, k - 1] < 0.0
            if turn:  # go to the turning point first, at constant acceleration
                part = motion[1, k - 1] / (motion[1, k - 1] - motion[1, k])
                forth = 0.5 * motion[1, k - 1] * part * h
                advance_elements(forces, modes, forth, abs(0.5 * motion[1, k - 1]), factor, row, bars)
                advance_elements(forces, modes, travel - forth, abs(0.5 * motion[1, k]), factor, row, bars)
            else:
                advance_elements(forces, modes, travel, abs(travel) / h, factor, row, bars)
        if scalars[STANDSTILL] == 0.0 or abs(motion[1, k]) > scalars[STANDSTILL]:
            raw = row[VISCOUS] * motion[1, k]
            for i in range(n_z):
                raw += forces[i]
        if k < first:
            continue
        needed = raw + row[OFFSET] + effects_force[k] + path.added_mass * motion[2, k]
        if path.kinds.shape[0] > 0:
            inertia = path.mass * motion[2, k]
            jerk = (motion[2, k] - motion[2, k - 1]) / h if h > 0.0 else 0.0
            commanded = inertia - path.mass * jerk * path.delay
            needed = needed_command(path.kinds, path.p_at, path.parameters, needed + inertia) - commanded
        trust = min(1.0, scalars[TRUST] + scalars[TRUST_RATE] * (time[k] - scalars[START]))
        left = scalars[END] - time[k]
        wanted = scalars[SHARE] * trust * needed * min(1.0, max(0.0, left / scalars[FADE]))
        if k > first:
            output = safe_output(output, wanted, h, scalars[LIMIT], scalars[SLEW])
        else:
            output = safe_output(wanted, wanted, 0.0, scalars[LIMIT], scalars[SLEW])
        out[k - first] = output
    out[len(time) - 1 - first] = 0.0
