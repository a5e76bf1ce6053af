"""The compiled effects of one axis, shared by stage, observer, replay, identification and compensation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import accumulate

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.effects import kernels
from sgms_observer.effects.catalogue import effect, is_built_in
from sgms_observer.effects.effect import Effect, EffectSettings, Place
from sgms_observer.effects.user_kernels import compile_user_effects
from sgms_observer.errors import ConfigurationError

SCRATCH = 16
"""Length of the ``out`` array ``kernels.effects_step`` needs."""


def _starts(groups: Iterable[Sequence[float]]) -> Ints:
    """Return where each group starts in the row of all groups, and where the last one ends."""
    return np.array([0, *accumulate(map(len, groups))], dtype=np.int64)


class CompiledEffects:
    """Effects as flat arrays for the kernels.

    Another kernel calls ``kernels.effects_step(*effects.arguments(state), q, v, ...)`` with the arrays unpacked;
    whole blocks go through ``evaluate``. The caller holds the state, so that any split into blocks gives the same bits.

    Args:
        settings: the axis's effects with their values, in the catalogue's order of parameters; empty for defaults.
        sample_period: time between two samples [s]; a delay counts in it.

    Raises:
        ConfigurationError: an unknown effect, a wrong number of values, or a value outside its range.
    """

    def __init__(self, settings: Sequence[EffectSettings], sample_period: float) -> None:
        entries = [effect(item.name) for item in settings]
        values = [item.values or entry.defaults for item, entry in zip(settings, entries, strict=True)]
        faults = [
            fault
            for entry, value in zip(entries, values, strict=True)
            for fault in entry.check(tuple(value), "effects")
        ]
        if faults:
            raise ConfigurationError(faults)
        users = [entry for entry in entries if not is_built_in(entry.name)]
        self.names = tuple(entry.name for entry in entries)
        self.sample_period = sample_period
        self.kinds = np.array(
            [
                kernels.KIND[entry.name] if is_built_in(entry.name) else kernels.FIRST_USER_KIND + users.index(entry)
                for entry in entries
            ],
            dtype=np.int64,
        )
        self.parameters = np.array([value for group in values for value in group], dtype=np.float64)
        self.p_at = _starts(values)
        states = [self._initial(entry, value) for entry, value in zip(entries, values, strict=True)]
        self._initial_state = np.array([value for group in states for value in group], dtype=np.float64)
        self.s_at = _starts(states)
        self.user = compile_user_effects(users)
        places = {entry.place for entry in entries}
        has_moving_mass = any(entry.place is Place.PLANT and entry.advance is not None for entry in entries)
        self.has_force_or_level = bool(places & {Place.ADDED_FORCE, Place.LEVEL_FACTOR}) or has_moving_mass
        self.has_effort_path = Place.EFFORT_PATH in places
        self.has_position = Place.MEASURED_POSITION in places

    def _initial(self, entry: Effect, values: Sequence[float]) -> tuple[float, ...]:
        """Return an effect's state at the start; a delay's ring is as long as its delay needs."""
        if not entry.is_delay:
            return entry.initial_state
        samples = values[0] / self.sample_period
        whole = math.floor(samples)
        return (float(whole), samples - whole, 0.0, 0.0) + (0.0,) * (whole + 2)

    @property
    def added_mass(self) -> float:
        """Mass to add to the model's own [kg]; the force of ``evaluate`` does not contain it."""
        total = 0.0
        for name, start in zip(self.names, self.p_at, strict=False):
            if effect(name).added_mass != 0.0:
                total += effect(name).added_mass * float(self.parameters[start])
        return total

    def initial_state(self) -> Floats:
        """Return a fresh state of every effect, for one run."""
        return self._initial_state.copy()

    def evaluate(
        self,
        position: Floats,
        velocity: Floats,
        acceleration: Floats,
        time: Floats,
        effort: Floats,
        period: Floats,
        level: Floats,
        state: Floats,
        other_velocity: Floats | None = None,
        other_acceleration: Floats | None = None,
    ) -> tuple[Floats, Floats]:
        """Advance force and level effects over a block of samples.

        Args:
            position, velocity, acceleration: motion [m, m/s, m/s^2], shape (n,).
            time: time since the first sample [s], shape (n,).
            effort: effort [N], shape (n,).
            period: length of the step that ends at each sample [s], shape (n,).
            level: the friction model's Stribeck level at ``velocity`` [N], shape (n,).
            state: changed in place [SI units of each effect]; see ``initial_state``.
            other_velocity, other_acceleration: motion of the other axis [m/s, m/s^2], or None.

        Returns:
            Added force [N] and level factor [-], each of shape (n,). In the balance
            ``effort = (mass + added_mass) * acceleration + friction(level * factor) + force``.
        """
        n = position.shape[0]
        force, factor = np.zeros(n), np.ones(n)
        if self.has_force_or_level:
            zero = np.zeros(n)
            # numba compiles the kernel again for every mixture of whole and strided arrays, which takes 2 s
            q, v, a, t, u, dt, sliding, v2, a2 = map(np.ascontiguousarray, (
                position, velocity, acceleration, time, effort, period, level,
                zero if other_velocity is None else other_velocity,
                zero if other_acceleration is None else other_acceleration,
            ))  # fmt: skip
            kernels.effects_block(
                self.kinds, self.p_at, self.s_at, self.parameters, state, self.user,
                q, v, a, t, u, dt, sliding, v2, a2, np.zeros(SCRATCH), force, factor,
            )  # fmt: skip
        return force, factor

    def arrived_effort(self, effort: Floats, state: Floats) -> Floats:
        """Return the effort that reaches the mass [N].

        Args:
            effort: effort as published [N], shape (n,).
            state: changed in place (a delay's memory) [SI units of each effect]; see ``initial_state``.
        """
        if not self.has_effort_path:
            return effort
        arrived = np.empty_like(effort)
        kernels.effort_block(self.kinds, self.p_at, self.s_at, self.parameters, state, effort, arrived)
        return arrived

    def needed_command(self, force: Floats, period: float | None = None) -> Floats:
        """Return the command for which a force reaches the mass [N]: the inverse of the effort's path.

        Where the command is not determined it is the limit (beyond a saturation) or 0 (inside a dead zone). With a
        delay the command leads the force; at the end of the block the last force is held.

        Args:
            force: needed at the mass [N], shape (n,); smooth between its samples.
            period: time between them [s]; the sample period if left out.
        """
        if not self.has_effort_path:
            return force
        ahead = force
        if self.delay > 0.0:
            place = np.arange(len(force)) + self.delay / (period or self.sample_period)
            ahead = np.interp(place, np.arange(len(force)), force)
        command = np.empty_like(ahead)
        kernels.command_block(self.kinds, self.p_at, self.parameters, np.ascontiguousarray(ahead), command)
        return command

    @property
    def delay(self) -> float:
        """Time from the commanded effort to the force [s]."""
        starts = zip(self.names, self.p_at, strict=False)
        return sum(float(self.parameters[start]) for name, start in starts if effect(name).is_delay)

    def measured_position(self, position: Floats) -> Floats:
        """Return the position that the encoder measures [m].

        Args:
            position: true positions [m], shape (n,).
        """
        return self._position(position, False)

    def corrected_position(self, position: Floats) -> Floats:
        """Return the true positions [m].

        Args:
            position: what the encoder shows [m], shape (n,).
        """
        return self._position(position, True)

    def _position(self, position: Floats, is_correction: bool) -> Floats:
        """Run the position effects forward or backward over a block."""
        if not self.has_position:
            return position
        result = np.empty_like(position)
        kernels.position_block(self.kinds, self.p_at, self.parameters, position, is_correction, result)
        return result
