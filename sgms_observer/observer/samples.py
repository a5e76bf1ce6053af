"""Input and output of an observer: blocks of samples of one axis as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

from sgms_observer.arrays import Bytes, Floats, Ints
from sgms_observer.settings.units import Scales


class _Block:
    """A frozen dataclass of arrays that is created for every live sample."""

    @classmethod
    def of(cls, **fields: Any) -> Self:
        """Return a block without the slow constructor of a frozen dataclass.

        Args:
            fields: all fields by name.
        """
        block = object.__new__(cls)
        block.__dict__.update(fields)
        return block


@dataclass(frozen=True)
class Samples(_Block):
    """A block of n samples of one axis, in the order of their stamps.

    Attributes:
        stamp_ns: sample time [ns], int64, shape (n,).
        position: measured position [m], shape (n,).
        effort: effort of the actuator [N], shape (n,); NaN where it is missing.
        reference_position: set-point [m], shape (n,); NaN where there is none.
        reference_velocity: velocity of the set-point [m/s], shape (n,); NaN where there is none.
    """

    stamp_ns: Ints
    position: Floats
    effort: Floats
    reference_position: Floats
    reference_velocity: Floats

    def in_si(self, scales: Scales) -> Samples:
        """Return samples in SI from samples as topics and bags carry them.

        Args:
            scales: scales of the axis.
        """
        if scales.are_one:
            return self
        factor = scales.position
        return Samples(
            self.stamp_ns,
            factor * self.position,
            scales.effort * self.effort,
            factor * self.reference_position,
            factor * self.reference_velocity,
        )

    def in_topic_units(self, scales: Scales) -> Samples:
        """Return samples as topics and bags carry them, from samples in SI.

        Args:
            scales: scales of the axis.
        """
        if scales.are_one:
            return self
        factor = scales.position
        return Samples(
            self.stamp_ns,
            self.position / factor,
            self.effort / scales.effort,
            self.reference_position / factor,
            self.reference_velocity / factor,
        )


@dataclass(frozen=True)
class Estimates(_Block):
    """Estimates for a block of n samples of one axis; row i belongs to ``stamp_ns[i]``.

    Attributes:
        stamp_ns: sample time [ns], int64, shape (n,).
        position: filtered position [m], shape (n,).
        velocity: filtered velocity [m/s], shape (n,).
        acceleration: filtered acceleration [m/s^2], shape (n,).
        friction: estimated friction force [N], shape (n,).
        friction_std: its standard deviation, eq. 13 [N], shape (n,).
        element_force: force of each element [N], shape (n, n_z).
        element_deflection: deflection of each element [m], shape (n, n_z).
        parameters: estimated parameters p in SI units, shape (n, n_p).
        parameter_std: their standard deviations [SI units], shape (n, n_p).
        innovation: measured minus predicted friction [N], shape (n,); NaN between corrections.
        innovation_std: its predicted standard deviation [N], shape (n,); NaN between corrections.
        compensation: feedforward to add to the controller's output [N], shape (n,).
        status: ``Status`` codes, uint8, shape (n,).
    """

    stamp_ns: Ints
    position: Floats
    velocity: Floats
    acceleration: Floats
    friction: Floats
    friction_std: Floats
    element_force: Floats
    element_deflection: Floats
    parameters: Floats
    parameter_std: Floats
    innovation: Floats
    innovation_std: Floats
    compensation: Floats
    status: Bytes
