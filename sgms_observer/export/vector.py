"""Samples that lead an observer through all it can meet, and what Python says of them."""

from __future__ import annotations

import math

import numpy as np

from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import AxisSettings

ROWS = 4000
_CYCLES = 3.0  # of the main motion in all rows
_SPEED = 20.0  # largest speed of the main motion over the Stribeck velocity: presliding and sliding both occur
_SIDE = (0.3, 7.3)  # second motion: share of the speed, frequency over the main one


def vector_samples(axis: AxisSettings, sample_period: float) -> Samples:
    """Return a motion with reversals, and the faults that recordings have.

    The effort need not be a real stage's: any numbers will do that both sides work on. Row 1000 repeats a stamp, rows
    1500 to 1510 lack the effort, rows 2000 to 2400 the reference, and time jumps beyond ``filter.maximum_gap`` at 3000.

    Args:
        axis: settings of the axis.
        sample_period: time between two samples [s].
    """
    index = np.arange(ROWS)
    time = index * sample_period
    speed = _SPEED * axis.friction.stribeck_velocity
    rate = 2.0 * math.pi * _CYCLES / (ROWS * sample_period)
    position, velocity, acceleration = np.zeros(ROWS), np.zeros(ROWS), np.zeros(ROWS)
    for share, multiple in ((1.0, 1.0), _SIDE):
        angular = multiple * rate
        position += share * speed / angular * np.sin(angular * time)
        velocity += share * speed * np.cos(angular * time)
        acceleration -= share * speed * angular * np.sin(angular * time)
    sliding = axis.friction.coulomb_force * np.tanh(velocity / axis.friction.stribeck_velocity)
    noise = 0.01 * axis.friction.coulomb_force * np.sin(12345.678 * index)
    effort = axis.mass * acceleration + axis.friction.viscous_coefficient * velocity + sliding + noise
    stamp_ns = 1_000_000_000 + np.rint(time * 1e9).astype(np.int64)
    stamp_ns[1000] = stamp_ns[999]
    stamp_ns[3000:] += int(2e9 * axis.filter.maximum_gap)
    effort[1500:1511] = math.nan
    reference, reference_velocity = position.copy(), velocity.copy()
    reference[2000:2401] = math.nan
    reference_velocity[2000:2401] = math.nan
    return Samples(stamp_ns, position, effort, reference, reference_velocity)


def columns_of(estimates: Estimates) -> list[tuple[str, str, np.ndarray]]:
    """Return name, member of the C output and values of each compared column, the status last.

    Args:
        estimates: of the samples.
    """
    single = (
        "position", "velocity", "acceleration", "friction", "friction_std", "compensation", "innovation",
        "innovation_std",
    )  # fmt: skip
    columns = [(name, name, getattr(estimates, name)) for name in single]
    many = (
        ("element_force", estimates.element_force),
        ("parameter", estimates.parameters),
        ("parameter_std", estimates.parameter_std),
    )
    for name, table in many:
        columns += [(f"{name}_{i + 1}", f"{name}[{i}]", table[:, i]) for i in range(table.shape[1])]
    return [*columns, ("status", "status", estimates.status.astype(float))]


def vector_text(samples: Samples, columns: list[tuple[str, str, np.ndarray]]) -> str:
    """Return the test vector as CSV, every number with all its digits.

    Args:
        samples: the inputs.
        columns: from ``columns_of``.
    """
    inputs = ("position", "effort", "reference_position", "reference_velocity")
    head = ",".join(["stamp_ns", *inputs, *(f"python_{name}" for name, _member, _values in columns)])
    table = np.column_stack([*(getattr(samples, name) for name in inputs), *(values for *_names, values in columns)])
    rows = [
        f"{stamp}," + ",".join(f"{value:.17g}" for value in row)
        for stamp, row in zip(samples.stamp_ns, table, strict=True)
    ]
    return "\n".join([head, *rows]) + "\n"
