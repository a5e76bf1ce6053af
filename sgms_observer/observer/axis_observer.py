"""The observer of one axis: samples in, estimates out. Node, replay and simulation all call ``AxisObserver.step``."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.compensation.feedforward import Compensator
from sgms_observer.compensation.feedforward_kernel import standstill_velocity
from sgms_observer.compensation.horizon import Horizon, KnownMotion, grid_of
from sgms_observer.compensation.motion_ahead import AHEAD_ACCELERATION, AHEAD_POSITION, AHEAD_VELOCITY, AHEAD_WIDTH
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.estimators.estimator import Estimator
from sgms_observer.estimators.interval import stribeck_level
from sgms_observer.estimators.layout import COULOMB, STATIC, STRIBECK, ModelArrays
from sgms_observer.filters.differentiator import Differentiator
from sgms_observer.jit import njit
from sgms_observer.observer.block_arrays import BlockArrays, Observed
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import AxisSettings

_SAMPLES = 3000
_RATE = 40.0  # rad/s
_AMPLITUDE = 1.0e-4  # m


@njit
def _levels(model: ModelArrays, velocity: Floats, out: Floats) -> None:
    """Write the nominal Stribeck level at each velocity [N]."""
    for i in range(velocity.shape[0]):
        out[i] = stribeck_level(velocity[i], model.scalars[STATIC], model.scalars[COULOMB], model.scalars[STRIBECK])


@dataclass(frozen=True)
class OtherMotion:
    """Motion of another axis at the samples of this one; row i belongs to sample i.

    Attributes:
        velocity: filtered velocity at the row's instant [m/s], shape (n,).
        acceleration: filtered acceleration there [m/s^2], shape (n,).
        velocity_ahead: velocity of its set-point at the time when a compensation acts [m/s], shape (n,).
        acceleration_ahead: acceleration there [m/s^2], shape (n,).
    """

    velocity: Floats
    acceleration: Floats
    velocity_ahead: Floats
    acceleration_ahead: Floats


class FilteredBlock(NamedTuple):
    """A block between the two halves of ``AxisObserver.step``.

    Attributes:
        samples: the block.
        arrays: motion and ahead are filled.
        seconds: computing time of the first half [s].
    """

    samples: Samples
    arrays: BlockArrays
    seconds: float

    def as_other(self) -> OtherMotion:
        """Return the motion for the coupling effect of another axis."""
        motion, ahead = self.arrays.motion, self.arrays.ahead
        return OtherMotion(motion.velocity, motion.acceleration, ahead[:, AHEAD_VELOCITY], ahead[:, AHEAD_ACCELERATION])


class AxisObserver:
    """Blocks V, Y, Z and F of the paper's Fig. 4 for one axis, and the compensation.

    Args:
        axis: checked settings of the axis.
        sample_period: nominal time between two samples [s].

    Raises:
        ConfigurationError: if the settings do not fit the sample period.
    """

    def __init__(self, axis: AxisSettings, sample_period: float) -> None:
        self.axis = axis
        self.sample_period = sample_period
        self.effects = CompiledEffects(axis.effects, sample_period)
        self.differentiator = Differentiator(axis.filter, sample_period)
        self.estimator = Estimator(axis.estimator, axis.friction, axis.mass + self.effects.added_mass)
        self.compensator = Compensator(
            axis.compensation,
            self.estimator.model,
            self.estimator.parameters,
            self.effects,
            standstill_velocity(axis.filter, sample_period),
        )
        self.deadline_misses = 0
        self._effects_state = self.effects.initial_state()
        self._ahead_state = self.effects.initial_state()
        self._origin_ns: int | None = None
        self._latest_effort = 0.0

    def reset(self) -> None:
        """Forget every sample and all estimates; the compensation moves to zero within its slew limit."""
        self.differentiator.reset()
        self.estimator.reset()
        self.compensator.reset()
        self._effects_state = self.effects.initial_state()
        self._ahead_state = self.effects.initial_state()
        self._origin_ns = None
        self.deadline_misses = 0

    def step(self, samples: Samples, other: OtherMotion | None = None) -> Estimates:
        """Process a block of samples.

        Args:
            samples: the block, n samples in the order of their stamps.
            other: motion of the axis that ``cross_axis_coupling`` follows at the same samples, or None for none.

        Returns:
            Estimates, one row per sample; the same bits for any split of the samples into blocks.
        """
        return self.observe(samples, other).estimates()

    def observe(self, samples: Samples, other: OtherMotion | None = None) -> Observed:
        """Do ``step`` without sorting the estimates by name, so that a caller can send the compensation first.

        Args:
            samples: as for ``step``.
            other: as for ``step``.
        """
        return self.estimate(self.filter(samples), other)

    def filter(self, samples: Samples) -> FilteredBlock:
        """Do the first half of ``observe``, which needs no other axis.

        Args:
            samples: as for ``step``.

        Returns:
            The block for ``estimate``, which has to follow before the next ``filter``.
        """
        start = time.perf_counter()
        arrays = self.make_arrays(len(samples.stamp_ns))
        table = arrays.motion.table
        position = self.effects.corrected_position(samples.position)
        effort = self.effects.arrived_effort(samples.effort, self._effects_state)
        self.differentiator.fill(samples.stamp_ns, position, effort, table)
        self.compensator.fill_ahead(table, samples.reference_position, samples.reference_velocity, arrays.ahead)
        return FilteredBlock(samples, arrays, time.perf_counter() - start)

    def estimate(self, block: FilteredBlock, other: OtherMotion | None = None) -> Observed:
        """Do the second half of ``observe``.

        Args:
            block: from ``filter``.
            other: as for ``step``.
        """
        start = time.perf_counter()
        samples, arrays, seconds = block
        motion, ahead, filtered_effort, effort, results, compensation, _, force, factor = arrays
        table = motion.table
        if self.effects.has_force_or_level:
            if len(samples.stamp_ns):
                self._latest_effort = float(motion.effort[-1])
                self._origin_ns = int(samples.stamp_ns[0]) if self._origin_ns is None else self._origin_ns
            since = self._since(samples.stamp_ns)
            path = motion.position, motion.velocity, motion.acceleration
            coupling = None if other is None else (other.velocity, other.acceleration)
            force, factor = self._evaluate(
                path, since - self.differentiator.delay, motion.effort, motion.period, self._effects_state, coupling
            )
            np.subtract(filtered_effort, force, out=effort)
        else:
            np.copyto(effort, filtered_effort)
        self.estimator.fill(table, effort, factor, results.table)
        if self.axis.estimator.deadline > 0.0:
            self._watch_deadline(seconds + time.perf_counter() - start, len(samples.stamp_ns))
        if self.effects.has_force_or_level:
            path = ahead[:, AHEAD_POSITION], ahead[:, AHEAD_VELOCITY], ahead[:, AHEAD_ACCELERATION]
            coupling = None if other is None else (other.velocity_ahead, other.acceleration_ahead)
            later = since + self.compensator.look_ahead_time
            force, factor = self._evaluate(path, later, motion.effort, motion.period, self._ahead_state, coupling)
        self.compensator.fill(table, results.table, ahead, force, factor, compensation)
        return Observed(samples.stamp_ns, arrays, seconds + time.perf_counter() - start)

    def horizon(
        self, latest: Estimates, known: KnownMotion, duration: float, other: KnownMotion | None = None
    ) -> Horizon | None:
        """Return the future compensation along a reference that is known ahead; does not change the state.

        Args:
            latest: estimates of the latest ``step``, at least one sample.
            known: the reference ahead.
            duration: largest time from the latest sample to the end of the horizon [s].
            other: reference of the axis that ``cross_axis_coupling`` follows, or None if it is not known.

        Returns:
            The horizon; None if the reference is too short or differs from the present set-point.
        """
        stamp = int(latest.stamp_ns[-1])
        duration = min(duration, (known.end_ns - stamp) * 1e-9)
        ahead = self.compensator.look_ahead_time
        if not ahead < duration or not self._follows(known, stamp):
            return None
        time, first = grid_of(ahead, duration, self.sample_period)
        time_ns = stamp + np.rint(time * 1e9).astype(np.int64)
        motion = np.array(known.at(time_ns))
        force, factor = np.zeros(len(time)), np.ones(len(time))
        if self.effects.has_force_or_level:
            count = len(time) - first
            position, velocity, acceleration = motion[:, first:].copy()
            effort, period = np.full(count, self._latest_effort), np.full(count, time[first + 1] - time[first])
            coupling = None if other is None else other.at(time_ns[first:])[1:]
            force[first:], factor[first:] = self._evaluate(
                (position, velocity, acceleration), self._since(time_ns[first:]), effort, period,
                self._ahead_state.copy(), coupling,
            )  # fmt: skip
            factor[:first] = factor[first]
        row = (latest.parameters[-1], float(latest.friction_std[-1]), int(latest.status[-1]))
        values = self.compensator.horizon(time, first, motion, force, factor, row)
        return Horizon(time_ns[first:] - round(self.effects.delay * 1e9), values)

    def _follows(self, known: KnownMotion, stamp: int) -> bool:
        """Return whether the set-point of the latest sample lies on the reference that is known ahead.

        The tolerance is two sample periods at the largest speed, plus eight units in the last place for the scales.
        """
        allowed = 2.0 * self.sample_period * known.largest_speed
        allowed += 8.0 * float(np.spacing(np.abs(known.position).max()))
        if not known.time_ns[0] <= stamp:
            return False
        return bool(abs(known.at(np.array([stamp]))[0][0] - self.compensator.set_point) <= allowed)

    def make_arrays(self, count: int) -> BlockArrays:
        """Return arrays for a block of samples.

        Args:
            count: number of samples.
        """
        motion, results = self.differentiator.make_room(count), self.estimator.make_room(count)
        ahead, effort, compensation = np.empty((count, AHEAD_WIDTH)), np.empty(count), np.empty((count, 1))
        return BlockArrays(
            *(motion, ahead, motion.effort, effort, results, compensation[:, 0], compensation),
            *(np.zeros(count), np.ones(count)),
        )

    def _since(self, stamp_ns: Ints) -> Floats:
        """Return the time since the first sample [s]."""
        return np.asarray(stamp_ns - (self._origin_ns or 0), dtype=np.float64) * 1e-9

    def _evaluate(
        self,
        path: tuple[Floats, Floats, Floats],
        since: Floats,
        effort: Floats,
        period: Floats,
        state: Floats,
        other: tuple[Floats, Floats] | None,
    ) -> tuple[Floats, Floats]:
        """Return the effects' force [N] and factor on the Stribeck level along a path."""
        position, velocity, acceleration = (np.ascontiguousarray(values) for values in path)
        level = np.empty(len(velocity))
        _levels(self.estimator.model, velocity, level)
        effort, period = np.ascontiguousarray(effort), np.ascontiguousarray(period)
        return self.effects.evaluate(
            position, velocity, acceleration, since, effort, period, level, state, *(other or (None, None))
        )

    def _watch_deadline(self, seconds: float, samples: int) -> None:
        """Let the EKF do the next correction if this live step took longer than the deadline."""
        if samples == 1 and seconds > self.axis.estimator.deadline:
            self.deadline_misses += 1
            self.estimator.miss_deadline()


def run_all_kernels(observer: AxisObserver) -> None:
    """Run an observer over a small synthetic motion and look ahead. Its state is not usable afterwards.

    Args:
        observer: observer of the axis whose kernels are compiled, with its compensation enabled.
    """
    seconds = np.arange(2 * _SAMPLES) * observer.sample_period
    stamps = np.rint(seconds * 1e9).astype(np.int64)
    position, velocity = _AMPLITUDE * np.sin(_RATE * seconds), _AMPLITUDE * _RATE * np.cos(_RATE * seconds)
    past = slice(0, _SAMPLES)
    effort = np.sign(velocity[past])
    latest = observer.step(Samples(stamps[past], position[past], effort, position[past], velocity[past]))
    observer.horizon(latest, KnownMotion(stamps, position, velocity), 1.0)
