"""Feedforward of the friction of the motion to come.

Where a reference is published, the element states are carried along the reference, not along the measurement: the
measured position would feed the presliding springs back with the delay of filter and actuator, which rings. They
start from the observer's states, use the observer's estimated parameters, and look ahead over the delay from
measurement to actuation. The force, with the mass's own that the controller commands, is then turned into the command
that lets it arrive: dead zone, gain and limit of the actuator. Without a reference the observer's states are carried
along the estimated velocity.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sgms_observer.compensation import horizon
from sgms_observer.compensation.motion_ahead import (
    ACCELERATION,
    AHEAD_ACCELERATION,
    AHEAD_WIDTH,
    HAS_REFERENCE,
    JERK,
    LAST_POSITION,
    MEMORY_SIZE,
    SET_VELOCITY,
    TRAVEL,
    look_ahead_block,
)
from sgms_observer.compensation.preview import advance_elements, preview_elements
from sgms_observer.compensation.safety import safe_output
from sgms_observer.compensation.trust import contradicts, fade, next_steady, next_trust
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.effects.kernels import needed_command
from sgms_observer.estimators.block import FRICTION_STD, RESULT_SIZE, STATUS
from sgms_observer.estimators.layout import (
    MASS,
    MODEL_SIZE,
    OFFSET,
    VISCOUS,
    Floats,
    Integers,
    ModelArrays,
    ParameterArrays,
    apply_parameters,
)
from sgms_observer.filters.motion import ELAPSED, LEAD, PRESENT_VELOCITY
from sgms_observer.jit import njit
from sgms_observer.settings.observer import CompensationSettings
from sgms_observer.status import Status

# one array: the state that evolves, the settings, then what each status means (``_GOOD`` and ``_RESTART``)
OUTPUT, TRUST, RAW, IS_ALIGNED, STEADY, HELD, STATE_SIZE = range(7)
(
    ENABLED, GAIN, LIMIT, SLEW, LOOK_AHEAD, STANDSTILL, SET_POINT_STANDSTILL, FADE_STD, TIMEOUT, VERDICT,
) = range(STATE_SIZE, STATE_SIZE + 10)  # fmt: skip

# Without a reference a motion counts once the estimated velocity has kept its sign for so long, or is this many times
# the standstill velocity: the noise of a velocity at rest does neither.
_STEADY_TIME = 5.0e-3
_CLEARLY_MOVING = 10.0
_GOOD = (Status.RUNNING, Status.FALLBACK_NOT_CONVERGED, Status.FALLBACK_DEADLINE)
_RESTART = (Status.STARTING, Status.RESTARTED_AFTER_GAP, Status.RESTARTED_AFTER_JUMP)


@dataclass(frozen=True)
class Preview:
    """What one block of samples offers the compensation; row i belongs to sample i.

    Attributes:
        period: time since the previous sample [s], shape (n,).
        velocity: estimated velocity now [m/s], shape (n,).
        element_force: the observer's element forces now [N], shape (n, n_z).
        parameters: estimated parameters, SI units (kappa as share), shape (n, n_p).
        friction_std: standard deviation of the friction estimate [N], shape (n,).
        reference_position: set-point [m], NaN where there is none, shape (n,).
        reference_velocity: its velocity [m/s], NaN where there is none, shape (n,).
        effects_force: force that the effects of the YAML will take from the actuator where the look-ahead ends [N],
            shape (n,).
        effects_factor: their factor on the Stribeck level there [-], shape (n,).
        status: ``Status`` codes, shape (n,).
    """

    period: Floats
    velocity: Floats
    element_force: Floats
    parameters: Floats
    friction_std: Floats
    reference_position: Floats
    reference_velocity: Floats
    effects_force: Floats
    effects_factor: Floats
    status: NDArray[np.uint8]


class ActuatorPath(NamedTuple):
    """What lies between the command and the force, and the masses along a reference.

    Attributes:
        kinds, p_at, parameters: effects as ``needed_command`` takes them; no kinds where the path changes no force.
        delay: from the command to the force [s].
        mass: that the controller commands the force of itself, for the present and not for what is ahead [kg].
        added_mass: that effects add to it, and nobody else commands the force of [kg].
    """

    kinds: Integers
    p_at: Integers
    parameters: Floats
    delay: float
    mass: float
    added_mass: float


@njit
def _is_finite(values: Floats) -> bool:
    """Return whether every value is a finite number."""
    total = 0.0
    for value in values:
        total += value
    return math.isfinite(total)


@njit
def _compensate(
    state: Floats,
    carried: Floats,
    carried_modes: Integers,
    scalars: Floats,
    elements: Floats,
    kinds: Floats,
    path: ActuatorPath,
    motion: Floats,
    results: Floats,
    ahead: Floats,
    effects_force: Floats,
    effects_factor: Floats,
    out: Floats,
) -> None:
    """Compute the compensation sample by sample; ``state``, ``carried`` and ``carried_modes`` evolve in place."""
    n_z, n_p = elements.shape[1], kinds.shape[0]
    first_parameter = RESULT_SIZE + 3 * n_z
    row = np.empty(MODEL_SIZE)
    bars = np.empty((3, n_z))
    unit = np.ones(n_p)
    forces = np.empty(n_z)
    modes = np.zeros(n_z, dtype=np.int64)
    apply_parameters(scalars, elements, kinds[:0], unit[:0], unit[:0], row, bars)
    for k in range(motion.shape[0]):
        h = motion[k, ELAPSED]
        verdict = state[VERDICT + int(results[k, STATUS])]
        element_force = results[k, RESULT_SIZE : RESULT_SIZE + n_z]
        is_enabled = state[ENABLED] > 0.5
        trust = next_trust(state[TRUST], verdict, h, state[TIMEOUT]) if is_enabled else 0.0
        state[TRUST] = trust
        if n_p > 0:
            apply_parameters(scalars, elements, kinds, unit, results[k, first_parameter:], row, bars)
        factor = effects_factor[k] if effects_factor[k] > 0.0 else 1.0
        if verdict == 2 or not is_enabled:
            state[RAW] = 0.0
        set_velocity = ahead[k, SET_VELOCITY]
        if ahead[k, HAS_REFERENCE] > 0.5:
            if state[IS_ALIGNED] < 0.5 or verdict == 2 or not _is_finite(carried):
                for i in range(n_z):
                    carried[i] = element_force[i] if math.isfinite(element_force[i]) else 0.0
                    carried_modes[i] = 0
                state[IS_ALIGNED] = 1.0
            elif h > 0.0:
                travel = ahead[k, TRAVEL]
                advance_elements(carried, carried_modes, travel, abs(travel) / h, factor, row, bars)
            limit = state[SET_POINT_STANDSTILL]
            is_moving = limit == 0.0 or abs(set_velocity) > limit or ahead[k, TRAVEL] != 0.0
            acceleration, jerk = ahead[k, ACCELERATION], ahead[k, JERK]
            state[HELD] = 0.0 if is_moving else state[HELD] + h
            if state[HELD] > state[LOOK_AHEAD]:  # what was predicted has come or not: where the set-point is counts
                is_moving = True
                set_velocity = acceleration = jerk = 0.0
            for i in range(n_z):
                forces[i] = carried[i]
                modes[i] = carried_modes[i]
        else:
            state[IS_ALIGNED] = 0.0
            acceleration = jerk = 0.0
            state[STEADY] = next_steady(state[STEADY], set_velocity, h, state[STANDSTILL])
            is_moving = abs(state[STEADY]) >= _STEADY_TIME or abs(set_velocity) > _CLEARLY_MOVING * state[STANDSTILL]
            estimated = 0.0
            for i in range(n_z):
                forces[i] = element_force[i]
                modes[i] = 0
                estimated += element_force[i]
            if not is_moving and contradicts(estimated, results[k, FRICTION_STD], state[RAW]):
                state[RAW] = 0.0
        if is_enabled and is_moving and math.isfinite(set_velocity):
            velocity = preview_elements(
                forces, modes, set_velocity, acceleration, jerk, state[LOOK_AHEAD], factor, row, bars
            )
            total = row[VISCOUS] * velocity
            for i in range(n_z):
                total += forces[i]
            state[RAW] = total
        wanted = 0.0
        if trust > 0.0:
            share = state[GAIN] * trust * fade(results[k, FRICTION_STD], state[FADE_STD])
            needed = state[RAW] + row[OFFSET] + effects_force[k]
            inertia = commanded = 0.0
            if ahead[k, HAS_REFERENCE] > 0.5:
                needed += path.added_mass * ahead[k, AHEAD_ACCELERATION]
                inertia = path.mass * ahead[k, AHEAD_ACCELERATION]
                commanded = inertia - path.mass * ahead[k, JERK] * path.delay
            if path.kinds.shape[0] > 0:
                needed = needed_command(path.kinds, path.p_at, path.parameters, needed + inertia) - commanded
            wanted = share * needed
        state[OUTPUT] = safe_output(state[OUTPUT], wanted, h, state[LIMIT], state[SLEW])
        out[k] = state[OUTPUT]


@njit
def _compensate_block(
    state: Floats,
    carried: Floats,
    carried_modes: Integers,
    scalars: Floats,
    elements: Floats,
    kinds: Floats,
    path_kinds: Integers,
    path_p_at: Integers,
    path_parameters: Floats,
    path_numbers: Floats,
    motion: Floats,
    results: Floats,
    ahead: Floats,
    effects_force: Floats,
    effects_factor: Floats,
    out: Floats,
) -> None:
    """Call ``_compensate`` from Python with nothing but arrays: to see a named tuple's type takes numba 2 us a call."""
    path = ActuatorPath(
        path_kinds, path_p_at, path_parameters, path_numbers[0], path_numbers[1], path_numbers[2]
    )
    _compensate(
        state, carried, carried_modes, scalars, elements, kinds, path, motion, results, ahead,
        effects_force, effects_factor, out,
    )  # fmt: skip


class Compensator:
    """Compensation of one axis, block by block; the split into blocks does not change a bit.

    Args:
        settings: checked settings.
        model: nominal friction model with mass and offset.
        parameters: which parameters the observer estimates.
        effects: of the axis, or None; their path of the effort is inverted, their delay adds to the look-ahead.
        standstill: estimated speed that noise alone reaches hardly ever [m/s]; ``standstill_velocity`` overrides it.
    """

    def __init__(
        self,
        settings: CompensationSettings,
        model: ModelArrays,
        parameters: ParameterArrays,
        effects: CompiledEffects | None = None,
        standstill: float = 0.0,
    ) -> None:
        self._model = model
        self._kinds = parameters.kinds
        self._standstill = standstill
        self._delay = effects.delay if effects else 0.0
        nothing = np.zeros(0, dtype=np.int64)
        added_mass = effects.added_mass if effects else 0.0
        self._path = ActuatorPath(
            effects.kinds if effects and effects.has_effort_path else nothing,
            effects.p_at if effects else nothing,
            effects.parameters if effects else np.zeros(0),
            self._delay,
            float(model.scalars[MASS]) - added_mass,
            added_mass,
        )
        n_z = model.elements.shape[1]
        self._state = np.ones(VERDICT + 256)
        self._state[:VERDICT] = 0.0
        self._state[[VERDICT + status for status in _GOOD]] = 0.0
        self._state[[VERDICT + status for status in _RESTART]] = 2.0
        self._carried = np.zeros(n_z)
        self._modes = np.zeros(n_z, dtype=np.int64)
        self._memory = np.zeros(MEMORY_SIZE)
        path = self._path
        numbers = np.array([path.delay, path.mass, path.added_mass])
        self._fixed = (
            *(self._state, self._carried, self._modes, model.scalars, model.elements, self._kinds),
            *(path.kinds, path.p_at, path.parameters, numbers),
        )
        self.configure(settings)

    def configure(self, settings: CompensationSettings) -> None:
        """Take other settings from the next sample on; the output moves there within the slew limit.

        Args:
            settings: checked settings.
        """
        self._state[ENABLED:VERDICT] = (
            float(settings.enabled),
            settings.gain,
            settings.limit,
            settings.slew_limit,
            settings.look_ahead + self._delay,
            settings.standstill_velocity or self._standstill,
            settings.standstill_velocity,
            settings.fade_std,
            settings.timeout,
        )
        time, standstill, at_rest = self._state[[LOOK_AHEAD, STANDSTILL, SET_POINT_STANDSTILL]].tolist()
        self._reach: tuple[float, float, float] = time, standstill, at_rest

    @property
    def path(self) -> ActuatorPath:
        """Return what lies between command and force."""
        return self._path

    @property
    def state(self) -> Floats:
        """Return a copy of what evolves, the settings, and what each status means, as the kernel takes them."""
        return self._state.copy()

    @property
    def output(self) -> float:
        """Return the latest force [N], from which the slew limit counts."""
        return float(self._state[OUTPUT])

    def continue_from(self, output: float) -> None:
        """Go on from another output, the one that really went out; trust has to be regained.

        Args:
            output: the force [N].
        """
        self._state[OUTPUT] = output
        self._state[TRUST] = 0.0

    def reset(self) -> None:
        """Forget everything but the last output, from which the slew limit counts."""
        output = self._state[OUTPUT]
        self._state[:STATE_SIZE] = 0.0
        self._state[OUTPUT] = output
        self._carried[:] = 0.0
        self._modes[:] = 0
        self._memory[:] = 0.0

    def step(self, block: Preview) -> Floats:
        """Return the compensation of each sample of a block [N], shape (n,).

        Args:
            block: what the samples offer.
        """
        count, n_z = block.element_force.shape
        n_p = block.parameters.shape[1]
        motion = np.zeros((count, LEAD))
        motion[:, ELAPSED], motion[:, PRESENT_VELOCITY] = block.period, block.velocity
        results = np.zeros((count, RESULT_SIZE + 3 * n_z + 2 * n_p))
        results[:, FRICTION_STD], results[:, STATUS] = block.friction_std, block.status
        results[:, RESULT_SIZE : RESULT_SIZE + n_z] = block.element_force
        results[:, RESULT_SIZE + 3 * n_z : RESULT_SIZE + 3 * n_z + n_p] = block.parameters
        ahead = self.look_ahead(motion, block.reference_position, block.reference_velocity)
        return self.step_tables(motion, results, ahead, block.effects_force, block.effects_factor)

    @property
    def look_ahead_time(self) -> float:
        """Return the time from a sample to the action of its compensation [s]."""
        return float(self._state[LOOK_AHEAD])

    def look_ahead(self, motion: Floats, reference_position: Floats, reference_velocity: Floats) -> Floats:
        """Return where the axis is meant to be when the compensation of each sample acts; once for each block.

        Args:
            motion: ``Motion.table`` [SI units], shape (n, width).
            reference_position: as in ``Preview`` [m], shape (n,).
            reference_velocity: as in ``Preview`` [m/s], shape (n,).

        Returns:
            Columns as named in ``motion_ahead`` [SI units], shape (n, AHEAD_WIDTH).
        """
        ahead = np.empty((len(motion), AHEAD_WIDTH))
        look_ahead_block(self._memory, *self._reach, motion, reference_position, reference_velocity, ahead)
        return ahead

    @property
    def set_point(self) -> float:
        """Return the set-point that came with the latest sample [m]; NaN where there was none."""
        return float(self._memory[LAST_POSITION]) if self._state[IS_ALIGNED] > 0.5 else math.nan

    def horizon(
        self,
        time: Floats,
        first: int,
        motion: Floats,
        effects_force: Floats,
        effects_factor: Floats,
        latest: tuple[Floats, float, int],
    ) -> Floats:
        """Return the compensation along a motion that is known ahead of the latest sample [N], shape (n - first,).

        Args:
            time: since the latest sample [s], increasing from 0, shape (n,).
            first: first row to return.
            motion: set-point [m], velocity [m/s] and acceleration [m/s^2] at each time, shape (3, n).
            effects_force: as in ``Preview`` [N], shape (n,).
            effects_factor: as in ``Preview`` [-], shape (n,).
            latest: parameters [SI units; kappa as share], friction_std [N] and status of the latest sample.
        """
        state = self._state
        parameters, friction_std, status = latest
        scalars = np.empty(horizon.HORIZON_SIZE)
        scalars[horizon.START], scalars[horizon.END] = time[first], time[-1]
        is_good = state[VERDICT + status] == 0.0
        scalars[horizon.TRUST] = state[TRUST] if state[ENABLED] > 0.5 else 0.0
        scalars[horizon.TRUST_RATE] = 1.0 / state[TIMEOUT] if is_good and state[ENABLED] > 0.5 else 0.0
        scalars[horizon.SHARE] = state[GAIN] * fade(friction_std, state[FADE_STD])
        scalars[horizon.STANDSTILL], scalars[horizon.RAW] = state[SET_POINT_STANDSTILL], state[RAW]
        scalars[horizon.LIMIT], scalars[horizon.SLEW] = state[LIMIT], state[SLEW]
        scalars[horizon.FADE] = state[TIMEOUT]
        out = np.empty(len(time) - first)
        horizon.horizon_block(
            self._carried, self._modes, self._model.scalars, self._model.elements, self._kinds, parameters, self._path,
            scalars, first, time, motion, effects_force, effects_factor, out,
        )  # fmt: skip
        return out

    def step_tables(
        self, motion: Floats, results: Floats, ahead: Floats, effects_force: Floats, effects_factor: Floats
    ) -> Floats:
        """Return the compensation of each sample of a block, from the tables of filter and estimator.

        Args:
            motion: ``Motion.table`` [SI units], shape (n, width).
            results: ``Results.table`` [SI units], shape (n, width).
            ahead: from ``look_ahead`` [SI units], shape (n, AHEAD_WIDTH).
            effects_force: as in ``Preview`` [N], shape (n,).
            effects_factor: as in ``Preview`` [-], shape (n,).

        Returns:
            The force to add to the controller's output [N], shape (n,).
        """
        out = np.empty(len(motion))
        _compensate_block(*self._fixed, motion, results, ahead, effects_force, effects_factor, out)
        return out
