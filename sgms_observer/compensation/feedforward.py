"""Feedforward of the friction of the future motion.

If a reference is published, the element states are simulated along the reference, not along the measurement. Feedback
of the measured position over the presliding stiffness, with the delay of filter and actuator, would oscillate. The
simulation starts from the states of the observer, uses its estimated parameters, and looks ahead over the delay from
measurement to actuation. The friction plus the inertial force that the controller commands is then converted to the
command of the actuator: dead zone, gain and limit are inverted. Without a reference, the states of the observer are
simulated along the estimated velocity.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.compensation import horizon
from sgms_observer.compensation.feedforward_kernel import (
    ENABLED,
    FADE_STD,
    GAIN,
    IS_ALIGNED,
    LIMIT,
    LOOK_AHEAD,
    OUTPUT,
    RAW,
    SET_POINT_STANDSTILL,
    SLEW,
    STANDSTILL,
    STATE_SIZE,
    TIMEOUT,
    TRUST,
    VERDICT,
    ActuatorPath,
    compensate_block,
    fade,
)
from sgms_observer.compensation.motion_ahead import (
    LAST_POSITION,
    MEMORY_SIZE,
    look_ahead_block,
)
from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.estimators.layout import (
    MASS,
    ModelArrays,
    ParameterArrays,
)
from sgms_observer.settings.axis import CompensationSettings
from sgms_observer.status import Status

_GOOD = (Status.RUNNING, Status.FALLBACK_NOT_CONVERGED, Status.FALLBACK_DEADLINE)
_RESTART = (Status.STARTING, Status.RESTARTED_AFTER_GAP, Status.RESTARTED_AFTER_JUMP)


class Compensator:
    """Compensation of one axis, block by block; the split into blocks does not change a bit.

    Args:
        settings: checked settings.
        model: nominal friction model with mass and offset.
        parameters: which parameters the observer estimates.
        effects: effects of the axis, or None. Their effort path is inverted, their delay adds to the look-ahead.
        standstill: estimated speed that noise alone rarely exceeds [m/s]; ``standstill_velocity`` overrides it.

    Attributes:
        fill_ahead: looks ahead over a block of n samples, once for each block. In: ``Motion.table``, set-points [m] and
            their velocities [m/s], NaN where there are none. Out, its last argument: columns as in ``motion_ahead``.
        fill: compensates the same block. In: ``Motion.table``, ``Results.table``, what ``fill_ahead`` wrote, and the
            effects' force [N] and factor on the Stribeck level [-] at the end of the look-ahead. Out, its last
            argument: the force to add to the controller's output [N], shape (n,).
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
        self.fill: Callable[..., None] = partial(
            compensate_block,
            *(self._state, self._carried, self._modes, model.scalars, model.elements, self._kinds),
            *(path.kinds, path.p_at, path.parameters, numbers),
        )
        self.configure(settings)

    def configure(self, settings: CompensationSettings) -> None:
        """Use other settings from the next sample on; the output changes within the slew limit.

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
        self.fill_ahead: Callable[..., None] = partial(look_ahead_block, self._memory, time, standstill, at_rest)

    @property
    def path(self) -> ActuatorPath:
        """Return the path from command to force."""
        return self._path

    @property
    def state(self) -> Floats:
        """Return a copy of the array of the kernel: state, settings and class of each status."""
        return self._state.copy()

    def continue_from(self, output: float) -> None:
        """Continue from another output, the one that was actually applied; trust starts again at zero.

        Args:
            output: the force [N].
        """
        self._state[OUTPUT] = output
        self._state[TRUST] = 0.0

    def reset(self) -> None:
        """Forget everything except the last output, the start of the slew limit."""
        output = self._state[OUTPUT]
        self._state[:STATE_SIZE] = 0.0
        self._state[OUTPUT] = output
        self._carried[:] = 0.0
        self._modes[:] = 0
        self._memory[:] = 0.0

    @property
    def look_ahead_time(self) -> float:
        """Return the time from a sample to the action of its compensation [s]."""
        return float(self._state[LOOK_AHEAD])

    @property
    def set_point(self) -> float:
        """Return the set-point of the latest sample [m]; NaN if there was none."""
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
            effects_force: force of the effects at each time [N], shape (n,).
            effects_factor: their factor on the Stribeck level there [-], shape (n,).
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
