"""One simulated axis: mass, friction, effects, encoder and position controller."""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.effects.compiled import SCRATCH, CompiledEffects
from sgms_observer.errors import ConfigurationError
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings, StageSettings
from sim_plant import kernel
from sim_plant.integration import EffectArrays, TrueFriction, true_friction
from sim_plant.kernel import PLAN_DISTURBANCE, PLAN_ENCODER_NOISE, PLAN_FORCE_NOISE, ControllerGains, controller_gains
from sim_plant.record import RecordBuffer, StageRecord
from sim_plant.reference import FollowedReference, Reference, make_reference

SAMPLES_PER_PLAN = 512

CONTROL_PERIOD = 1.0e-4
"""Longest time between two runs of the controller [s]; a longer sample period contains several."""


class Plan:
    """Reference and noise of one axis, one fixed block after the other.

    Args:
        settings: the axis's stage.
        reference: the axis's set-point.
        name: of the axis; axes of one seed draw different noise.
        tick: time between two runs of the controller [s].
        ticks_per_sample: ticks from one published sample to the next.
    """

    def __init__(
        self, settings: StageSettings, reference: Reference, name: str, tick: float, ticks_per_sample: int
    ) -> None:
        self._settings = settings
        self._reference = reference
        self.followed = reference if isinstance(reference, FollowedReference) else None
        self._tick = tick
        self._ticks_per_sample = ticks_per_sample
        streams = np.random.SeedSequence([settings.seed, zlib.crc32(name.encode())]).spawn(3)
        self._encoder, self._force, self._disturbance = (np.random.default_rng(stream) for stream in streams)
        self._next_block = 0
        self.ticks = np.zeros((4, SAMPLES_PER_PLAN * ticks_per_sample))
        self.samples = np.zeros((2, SAMPLES_PER_PLAN))

    def reference_at(self, time: Floats) -> tuple[Floats, Floats]:
        """Return set-points [m] and their velocities [m/s], each of shape (n,).

        Args:
            time: since the first sample [s], shape (n,).
        """
        return self._reference.at(time)[:2]

    def advance(self) -> None:
        """Replace ``ticks`` (reference, encoder noise) and ``samples`` (force noise, disturbance) by the next block."""
        count = SAMPLES_PER_PLAN * self._ticks_per_sample
        time = self._tick * np.arange(self._next_block * count, (self._next_block + 1) * count, dtype=np.float64)
        self._next_block += 1
        if self.followed is None:
            self.ticks[:PLAN_ENCODER_NOISE] = self._reference.at(time)
        _draw(self._encoder, self._settings.encoder.noise, self.ticks[PLAN_ENCODER_NOISE])
        _draw(self._force, self._settings.force_noise, self.samples[PLAN_FORCE_NOISE])
        _draw(self._disturbance, self._settings.disturbance_noise, self.samples[PLAN_DISTURBANCE])

    def ask_reference(self, first: int, end: int) -> None:
        """Fill in the set-points of the next samples, where set-points arrive while the stage runs.

        Args:
            first: number of the first sample in the block.
            end: number after the last one.
        """
        if self.followed is not None:
            start = (self._next_block - 1) * SAMPLES_PER_PLAN
            ticks = self._ticks_per_sample
            time = self._tick * np.arange((start + first) * ticks, (start + end) * ticks, dtype=np.float64)
            self.ticks[:PLAN_ENCODER_NOISE, first * ticks : end * ticks] = self.followed.at(time)


def _draw(generator: np.random.Generator, deviation: float, row: Floats) -> None:
    """Fill ``row`` with white noise of the given standard deviation."""
    if deviation > 0.0:
        row[:] = deviation * generator.standard_normal(len(row))


class StageParts(NamedTuple):
    """Arguments of the kernel of a stage."""

    constants: kernel.StageConstants
    friction: TrueFriction
    effects: EffectArrays
    gains: ControllerGains
    memory: kernel.StageMemory
    compiled_effects: CompiledEffects


class SimulatedStage:
    """The truth of one axis, sample by sample; any split of a run into ``step`` calls gives the same bits.

    Args:
        axis: the axis; ``stage``, ``stage_friction`` and ``stage_effects`` are the truth where they differ.
        sample_period: time between two published samples [s].
        start_ns: stamp of the first sample [ns].
        reference: of the stage; that of the settings if None.

    Raises:
        ConfigurationError: when reference, effects or masses are not valid.
    """

    def __init__(
        self, axis: AxisSettings, sample_period: float, start_ns: int = 0, reference: Reference | None = None
    ) -> None:
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
        self._compiled = effects
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
        followed = make_reference(settings.reference, axis.name) if reference is None else reference
        self._plan = Plan(settings, followed, axis.name, tick, ticks)
        self._memory = self._at_rest(effects, delay // substeps + 2)
        self._done = 0

    def _moving_mass(self, effects: CompiledEffects) -> float:
        """Return the mass the kernel accelerates [kg]."""
        mass = float(self.axis.stage.mass or self.axis.mass)
        total = mass + effects.added_mass
        unit = self.axis.units.mass
        if total <= 0.0:
            raise ConfigurationError(
                [
                    f"{self.axis.name}: the stage's mass of {mass:g} {unit} and the {effects.added_mass:g} {unit} of"
                    " its effects have no positive sum; lower the mass of flexible_mode or mass_error"
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
    def parts(self) -> StageParts:
        """Return the arguments of the kernel, for another caller of the kernel."""
        return StageParts(self._constants, self._friction, self._effects, self._gains, self._memory, self._compiled)

    @property
    def followed(self) -> FollowedReference | None:
        """Return the motion through arriving set-points, where the reference is of that kind."""
        return self._plan.followed

    @property
    def samples_done(self) -> int:
        """Return the number of samples so far."""
        return self._done

    def reference_ahead(self, time: Floats) -> tuple[Floats, Floats]:
        """Return set-points [m] and their velocities [m/s] before and after the next sample, each of shape (n,).

        Args:
            time: since the next sample [s]; what is before the first sample counts as that, shape (n,).
        """
        return self._plan.reference_at(np.maximum(self._done * self.sample_period + time, 0.0))

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
        """Return the next samples, and advance to the instant of the sample after them.

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
        buffer = self._buffer(count)
        buffer.compensation[:] = self._taken(compensation, count)
        other = np.array([other_velocity, other_acceleration])
        first = 0
        while first < count:
            length = min(count - first, SAMPLES_PER_PLAN - self._done % SAMPLES_PER_PLAN)
            self._run(buffer, first, first + length, other)
            first += length
        return buffer.record()

    def step_answered(
        self, count: int, answer: Callable[[Samples], float], compensation: float = 0.0
    ) -> tuple[StageRecord, float]:
        """Return the next samples; after each of them ``answer`` gives the compensation of the next one.

        Args:
            count: number of samples, at least 1.
            answer: called with each sample as an observer gets it; returns the feedforward from the next sample on [N].
            compensation: feedforward at the first sample [N].

        Returns:
            The samples, and the last answer [N].
        """
        buffer = self._buffer(count)
        other = np.zeros(2)
        for k in range(count):
            buffer.compensation[k] = self._taken(compensation, 1)[0]
            self._run(buffer, k, k + 1, other)
            compensation = answer(buffer.samples(k))
        return buffer.record(), compensation

    def _buffer(self, count: int) -> RecordBuffer:
        """Return a buffer for the next samples."""
        return RecordBuffer(self._done, count, len(self._memory.force), self.sample_period, self.start_ns)

    def _taken(self, compensation: float | Floats, count: int) -> Floats:
        """Return the feedforward in the effort at each sample [N]."""
        if not self.axis.stage.accept_compensation:
            return np.zeros(count)
        if isinstance(compensation, float):
            return np.full(count, compensation if math.isfinite(compensation) else 0.0)
        wanted = np.broadcast_to(np.asarray(compensation, dtype=np.float64), (count,))
        return np.where(np.isfinite(wanted), wanted, 0.0)

    def _run(self, buffer: RecordBuffer, first: int, end: int, other: Floats) -> None:
        """Fill the rows from ``first`` to ``end`` of the buffer; they lie in one block of the plan."""
        inside = self._done % SAMPLES_PER_PLAN
        if inside == 0 and self._done > 0:
            self._plan.advance()
        self._plan.ask_reference(inside, inside + end - first)
        kernel.run_samples(
            self._constants, self._friction, self._effects, self._user, self._gains, self._memory,
            self._done * self._constants.ticks_per_sample, inside, self._plan.ticks, self._plan.samples,
            buffer.compensation[first:end], other, buffer.recorded[first:end], buffer.element_force[first:end],
        )  # fmt: skip
        self._done += end - first
