"""One simulated axis: mass, friction, effects, encoder and position controller."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from sgms_observer.effects.compiled import SCRATCH, CompiledEffects
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import AxisSettings
from sim_plant import kernel
from sim_plant.controller import controller_gains
from sim_plant.integration import EffectArrays
from sim_plant.plan import SAMPLES_PER_PLAN, Plan
from sim_plant.record import StageRecord, join_records
from sim_plant.reference import make_reference
from sim_plant.true_friction import true_friction

Floats = NDArray[np.float64]

CONTROL_PERIOD = 1.0e-4
"""Longest time between two runs of the controller [s]; a longer sample period holds several."""


class SimulatedStage:
    """The truth of one axis, sample by sample; any split of a run into ``step`` calls gives the same bits.

    Args:
        axis: the axis; ``stage``, ``stage_friction`` and ``stage_effects`` are the truth where they differ.
        sample_period: time between two published samples [s].
        start_ns: stamp of the first sample [ns].

    Raises:
        ConfigurationError: when reference, effects or masses make no stage.
    """

    def __init__(self, axis: AxisSettings, sample_period: float, start_ns: int = 0) -> None:
        settings = axis.stage
        ticks = max(1, math.ceil(sample_period / CONTROL_PERIOD - 1e-9))
        tick = sample_period / ticks
        effects = CompiledEffects(axis.effects if axis.stage_effects is None else axis.stage_effects, tick)
        self.axis = axis
        self.sample_period = sample_period
        self.start_ns = start_ns
        self.is_coupled = "cross_axis_coupling" in effects.names
        self._friction = true_friction(axis.stage_friction or axis.friction)
        self._effects = EffectArrays(effects.kinds, effects.p_at, effects.s_at, effects.parameters)
        self._user = effects.user
        self._gains = controller_gains(settings.controller, axis.mass, tick)
        substeps = max(1, math.ceil(settings.substeps * tick / CONTROL_PERIOD - 1e-9))
        delay = round(settings.actuation_delay / tick * substeps)
        self._constants = kernel.StageConstants(
            mass=self._moving_mass(effects),
            tick=tick,
            substeps=substeps,
            ticks_per_sample=ticks,
            delay_substeps=delay,
            resolution=float(settings.encoder.resolution),
        )
        self._plan = Plan(settings, make_reference(settings.reference, axis.name), axis.name, tick, ticks)
        self._memory = self._at_rest(effects, delay // substeps + 2)
        self._done = 0

    def _moving_mass(self, effects: CompiledEffects) -> float:
        """Return the mass the kernel accelerates [kg]."""
        mass = float(self.axis.stage.mass or self.axis.mass)
        total = mass + effects.added_mass
        if total <= 0.0:
            raise ConfigurationError(
                [
                    f"{self.axis.name}: the stage's mass of {mass:g} kg with {effects.added_mass:g} kg from its effects"
                    " leaves nothing to move; lower the mass of flexible_mode or mass_error"
                ]
            )
        return total

    def _at_rest(self, effects: CompiledEffects, ring: int) -> kernel.StageMemory:
        """Return the memory of a stage that rests at the first position of its reference, relaxed."""
        elements = len(self._friction.stiffness)
        state = effects.initial_state()
        self._plan.advance()
        motion = np.zeros(6)
        motion[0] = self._plan.ticks[kernel.PLAN_POSITION, 0]
        return kernel.StageMemory(
            motion=motion,
            controller=np.array([math.nan, 0.0, 0.0]),
            force=np.zeros(elements),
            mode=np.zeros(elements, dtype=np.int64),
            effect_state=state,
            next_force=np.zeros(elements),
            next_mode=np.zeros(elements, dtype=np.int64),
            next_effect_state=state.copy(),
            scratch=np.zeros(SCRATCH),
            efforts=np.zeros(ring),
        )

    @property
    def samples_done(self) -> int:
        """Return how many samples this stage has given."""
        return self._done

    @property
    def position(self) -> float:
        """Return the true position now [m]."""
        return float(self._memory.motion[0])

    @property
    def velocity(self) -> float:
        """Return the true velocity now [m/s]."""
        return float(self._memory.motion[1])

    @property
    def acceleration(self) -> float:
        """Return the mean true acceleration over the last integration step [m/s^2]."""
        return float(self._memory.motion[2])

    def step(
        self,
        count: int,
        compensation: float | Floats = 0.0,
        other_velocity: float = 0.0,
        other_acceleration: float = 0.0,
    ) -> StageRecord:
        """Give the next samples, and move on to the instant of the sample after them.

        Args:
            count: number of samples, at least 1.
            compensation: feedforward to add to the controller's output [N]: one value for all samples, or one per
                sample, shape (count,). Values that are not finite count as 0; all do without ``accept_compensation``.
            other_velocity: velocity of the axis this one is coupled to [m/s].
            other_acceleration: its acceleration [m/s^2].

        Returns:
            The samples.

        Raises:
            ValueError: when ``compensation`` has another shape.
        """
        taken = self._taken(compensation, count)
        other = np.array([other_velocity, other_acceleration])
        records = []
        first = 0
        while first < count:
            inside = self._done % SAMPLES_PER_PLAN
            if inside == 0 and self._done > 0:
                self._plan.advance()
            length = min(count - first, SAMPLES_PER_PLAN - inside)
            records.append(self._run(inside, taken[first : first + length], other))
            first += length
        return join_records(records)

    def _taken(self, compensation: float | Floats, count: int) -> Floats:
        """Return the feedforward that goes into the effort at each sample [N]."""
        if not self.axis.stage.accept_compensation:
            return np.zeros(count)
        if isinstance(compensation, float):
            return np.full(count, compensation if math.isfinite(compensation) else 0.0)
        wanted = np.broadcast_to(np.asarray(compensation, dtype=np.float64), (count,))
        return np.where(np.isfinite(wanted), wanted, 0.0)

    def _run(self, inside: int, compensation: Floats, other: Floats) -> StageRecord:
        """Run samples that lie in one block of the plan, from its sample ``inside`` on."""
        count = len(compensation)
        ticks = self._constants.ticks_per_sample
        recorded = np.empty((kernel.RECORDED, count))
        element_force = np.empty((count, len(self._memory.force)))
        kernel.run_samples(
            self._constants, self._friction, self._effects, self._user, self._gains, self._memory,
            self._done * ticks, inside, self._plan.ticks, self._plan.samples, compensation, other,
            recorded, element_force,
        )  # fmt: skip
        index = np.arange(self._done, self._done + count)
        self._done += count
        time = (index * self.sample_period).astype(np.float64)
        reference = self._plan.ticks[:3, inside * ticks : (inside + count) * ticks : ticks]
        return StageRecord(
            stamp_ns=self.start_ns + np.rint(index * (self.sample_period * 1e9)).astype(np.int64),
            time=time,
            position=recorded[kernel.POSITION],
            velocity=recorded[kernel.VELOCITY],
            acceleration=recorded[kernel.ACCELERATION],
            measured_position=recorded[kernel.MEASURED],
            control_effort=recorded[kernel.CONTROL],
            effort_applied=recorded[kernel.APPLIED],
            reference_position=reference[kernel.PLAN_POSITION].copy(),
            reference_velocity=reference[kernel.PLAN_VELOCITY].copy(),
            reference_acceleration=reference[kernel.PLAN_ACCELERATION].copy(),
            friction=recorded[kernel.FRICTION],
            element_force=element_force,
            effect_force=recorded[kernel.EFFECT],
            compensation=compensation,
        )
