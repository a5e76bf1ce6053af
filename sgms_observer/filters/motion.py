"""Filtered motion: one row per sample, and the names of its columns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sgms_observer.arrays import Booleans, Floats

PERIOD, POSITION, VELOCITY, ACCELERATION, EFFORT, STEP_VELOCITY = range(6)
PRESENT_POSITION, PRESENT_VELOCITY, PRESENT_ACCELERATION = range(6, 9)
IS_READY, IS_RESTART, IS_REJECTED, IS_JUMP, IS_DENSE, ELAPSED = range(9, 15)
LEAD = 15  # lead velocities, then as many lead periods


def row_width(delay_samples: int) -> int:
    """Return the number of columns of a row.

    Args:
        delay_samples: samples from the row's instant to its sample.
    """
    return LEAD + 2 * delay_samples


class Motion(NamedTuple):
    """Filtered motion of n samples; row i was returned with sample i and belongs to the *instant* ``delay`` before it.

    Args:
        table: one row per sample, columns as named in this module [SI units], shape (n, width).
        delay_samples: samples from a row's instant to its sample, L.
    """

    table: Floats
    delay_samples: int

    @property
    def period(self) -> Floats:
        """Time from the previous row's instant to this one's [s]; 0 where a sample was rejected."""
        return self.table[:, PERIOD]

    @property
    def position(self) -> Floats:
        """Position at the instant [m]."""
        return self.table[:, POSITION]

    @property
    def velocity(self) -> Floats:
        """Velocity at the instant [m/s]."""
        return self.table[:, VELOCITY]

    @property
    def acceleration(self) -> Floats:
        """Acceleration at the instant [m/s^2]."""
        return self.table[:, ACCELERATION]

    @property
    def effort(self) -> Floats:
        """Effort at the instant, weighted as the acceleration where ``align_effort`` [N]; NaN where samples miss it."""
        return self.table[:, EFFORT]

    @property
    def step_velocity(self) -> Floats:
        """Mean velocity over ``period`` [m/s]: times the period it is the travel, which is what moves an element."""
        return self.table[:, STEP_VELOCITY]

    @property
    def present_position(self) -> Floats:
        """Best causal position at the sample itself [m]."""
        return self.table[:, PRESENT_POSITION]

    @property
    def present_velocity(self) -> Floats:
        """Best causal velocity at the sample itself [m/s]."""
        return self.table[:, PRESENT_VELOCITY]

    @property
    def present_acceleration(self) -> Floats:
        """Best causal acceleration at the sample itself [m/s^2]."""
        return self.table[:, PRESENT_ACCELERATION]

    @property
    def is_ready(self) -> Booleans:
        """Whether the row is an estimate: the window is full and the sample was good."""
        return self.table[:, IS_READY] > 0.5

    @property
    def is_restart(self) -> Booleans:
        """Whether the filter restarted at this sample: a pause, a clock that was set back, or a jump."""
        return self.table[:, IS_RESTART] > 0.5

    @property
    def is_jump(self) -> Booleans:
        """Whether it restarted because the position jumped, by more than ``jump_speed`` allows."""
        return self.table[:, IS_JUMP] > 0.5


def known_motion(period: Floats, velocity: Floats, acceleration: Floats) -> Motion:
    """Rows for a motion that is known rather than measured: no delay, always ready.

    Args:
        period: time since the previous sample [s], shape (n,).
        velocity: velocity at each sample, and over the step that ends there [m/s], shape (n,).
        acceleration: acceleration at each sample [m/s^2], shape (n,).

    Returns:
        Motion whose positions are the travel since the first sample's predecessor [m].
    """
    table = np.zeros((len(period), LEAD))
    table[:, PERIOD] = table[:, ELAPSED] = period
    table[:, POSITION] = table[:, PRESENT_POSITION] = np.cumsum(velocity * period)
    table[:, VELOCITY] = table[:, STEP_VELOCITY] = table[:, PRESENT_VELOCITY] = velocity
    table[:, ACCELERATION] = table[:, PRESENT_ACCELERATION] = acceleration
    table[:, IS_READY] = 1.0
    return Motion(table, 0)
