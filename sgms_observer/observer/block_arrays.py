"""The arrays of one block of an axis's samples, from the filter to the compensation, and what they say by name."""

from __future__ import annotations

from typing import NamedTuple

from sgms_observer.arrays import Floats, Ints
from sgms_observer.estimators.estimator import Results
from sgms_observer.filters.motion import Motion
from sgms_observer.observer.samples import Estimates


class BlockArrays(NamedTuple):
    """What the kernels fill for a block of n samples.

    Attributes:
        motion: filtered motion.
        ahead: set-point at the time when the compensation acts, columns of ``motion_ahead``, shape (n, AHEAD_WIDTH).
        filtered_effort: the column of the motion [N], shape (n,).
        effort: the same less the effects' forces [N], shape (n,).
        results: results of the estimator.
        compensation: feedforward to add to the controller's output [N], shape (n,).
        compensation_column: the same memory, shape (n, 1).
        no_force: zeros [N], shape (n,).
        no_factor: ones [-], shape (n,).
    """

    motion: Motion
    ahead: Floats
    filtered_effort: Floats
    effort: Floats
    results: Results
    compensation: Floats
    compensation_column: Floats
    no_force: Floats
    no_factor: Floats


class Observed(NamedTuple):
    """A block after ``AxisObserver.observe``, with the compensation ready to be sent.

    Attributes:
        stamp_ns: sample time [ns], shape (n,).
        arrays: all filled.
        seconds: computing time [s].
    """

    stamp_ns: Ints
    arrays: BlockArrays
    seconds: float

    @property
    def results(self) -> Results:
        """Return the results of the estimator."""
        return self.arrays.results

    @property
    def compensation(self) -> Floats:
        """Return the feedforward to add to the controller's output [N], shape (n,)."""
        return self.arrays.compensation

    @property
    def parameters(self) -> Floats:
        """Return the estimated parameters [SI units; kappa as share], shape (n, n_p)."""
        return self.arrays.results.parameters

    @property
    def parameter_std(self) -> Floats:
        """Return their standard deviations, shape (n, n_p)."""
        return self.arrays.results.parameter_std

    def estimates(self) -> Estimates:
        """Return the estimates of the block, by name."""
        motion, results = self.arrays.motion, self.arrays.results
        return Estimates.of(
            stamp_ns=self.stamp_ns,
            position=motion.present_position,
            velocity=motion.present_velocity,
            acceleration=motion.present_acceleration,
            friction=results.friction,
            friction_std=results.friction_std,
            element_force=results.element_force,
            element_deflection=results.element_deflection,
            parameters=results.parameters,
            parameter_std=results.parameter_std,
            innovation=results.innovation,
            innovation_std=results.innovation_std,
            compensation=self.compensation,
            status=results.status,
        )
