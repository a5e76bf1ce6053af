"""Block V: velocity, acceleration and the effort that belongs to them, from measured position and effort."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.errors import ConfigurationError
from sgms_observer.filters import layout, lowpass, polynomial, tracking
from sgms_observer.filters.kernel import filter_block
from sgms_observer.filters.motion import Motion, row_width
from sgms_observer.settings.axis import FilterSettings

_KINDS = {"lowpass": layout.LOWPASS, "savgol": layout.SAVGOL, "kalman": layout.KALMAN}
_PULSE = 1.0e-3  # of the step that counts as a jump
_NOMINAL_WITHIN = 2.0e-9  # s: what rounding to nanoseconds does to a period; such stamps count as even


class Differentiator:
    """Filters of block V; every kind works sample by sample, so any split into blocks gives the same bits.

    A row returned with sample k belongs to an *instant* ``delay`` before it. All of the row's values share that
    instant; its lead velocities bridge the way from the instant to the sample.

    Args:
        settings: kind and size of the filter.
        sample_period: nominal time between two samples [s].

    Attributes:
        delay: time from a row's instant to its sample [s]; 0 for the paper's low-pass, which ignores its delay.
        delay_samples: lead velocities per row, L; at the nominal period L samples are the delay.
        config: the fixed numbers ``kernel.filter_sample`` takes, for callers with a compiled loop of their own.
        state: the memory ``kernel.filter_sample`` takes and updates.
        row: the latest row, which ``kernel.filter_sample`` takes and updates.
        fill: does ``step`` into the table of ``make_room``, its last argument.

    Raises:
        ConfigurationError: if the settings do not fit the sample period.
    """

    def __init__(self, settings: FilterSettings, sample_period: float) -> None:
        self.settings = settings
        self.sample_period = sample_period
        _require_fit(settings, sample_period)
        if settings.kind == "lowpass":
            method_config = lowpass.lowpass_config(settings.cutoff, sample_period)
            self.delay = float(method_config[1]) if settings.align_effort else 0.0
            self.delay_samples = round(self.delay / sample_period)
            ready_after = 2 + math.ceil(10.0 / (float(method_config[0]) * sample_period))
            size = lowpass.SIZE
        elif settings.kind == "savgol":
            window = window_samples(settings, sample_period)
            method_config = polynomial.polynomial_config(window, settings.degree, sample_period)
            self.delay_samples = window // 2
            self.delay = self.delay_samples * sample_period
            ready_after = window
            size = polynomial.polynomial_state_size(window)
        else:
            self.delay_samples = round(settings.lag / sample_period)
            self.delay = self.delay_samples * sample_period
            memory = math.ceil(5.0 * _tracking_time(settings, sample_period) / sample_period)
            method_config = tracking.tracking_config(
                settings.position_noise, settings.jerk_density, memory + self.delay_samples
            )
            ready_after = self.delay_samples + 1 + memory
            size = tracking.tracking_state_size(self.delay_samples)
        fixed = np.zeros(layout.OWN)
        fixed[layout.KIND] = _KINDS[settings.kind]
        fixed[layout.SAMPLE_PERIOD] = sample_period
        fixed[layout.PERIOD_TOLERANCE] = _NOMINAL_WITHIN
        fixed[layout.MAXIMUM_GAP] = settings.maximum_gap
        fixed[layout.IS_ALIGNED] = settings.align_effort
        fixed[layout.IS_HELD] = settings.effort_is_held
        fixed[layout.DELAY_SAMPLES] = self.delay_samples
        fixed[layout.READY_AFTER] = ready_after
        fixed[layout.JUMP_SPEED] = settings.jump_speed
        self.config: Floats = np.concatenate((fixed, method_config))
        self.state: Floats = np.zeros(size)
        self.row: Floats = np.zeros(row_width(self.delay_samples))
        self.fill: Callable[..., None] = partial(filter_block, self.config, self.state, self.row)

    def reset(self) -> None:
        """Forget every sample."""
        self.state[:] = 0.0
        self.row[:] = 0.0

    def step(self, stamp_ns: Ints, position: Floats, effort: Floats) -> Motion:
        """Take the next block of samples.

        Args:
            stamp_ns: sample times [ns], int64, shape (n,).
            position: measured positions [m], shape (n,).
            effort: efforts [N], NaN where missing, shape (n,).

        Returns:
            One row per sample.
        """
        motion = self.make_room(len(stamp_ns))
        self.fill(stamp_ns, position, effort, motion.table)
        return motion

    def make_room(self, count: int) -> Motion:
        """Return a motion for ``fill``.

        Args:
            count: number of samples.
        """
        return Motion(np.empty((count, len(self.row))), self.delay_samples)


def effort_noise_gain(settings: FilterSettings, sample_period: float) -> float:
    """Return what is left of white noise on the effort: its standard deviation after the filter over that before.

    Times the noise of one effort sample this is ``estimator.measurement_std`` where the position is free of noise.

    Args:
        settings: the filter.
        sample_period: nominal time between two samples [s].
    """
    differentiator = Differentiator(settings, sample_period)
    if not settings.align_effort:
        return 1.0
    ready = int(differentiator.config[layout.READY_AFTER])
    count = 4 * ready + 100
    stamp_ns = np.round(np.arange(count) * sample_period * 1e9).astype(np.int64)
    effort = np.zeros(count)
    effort[ready + 1 + differentiator.delay_samples] = 1.0
    weights = differentiator.step(stamp_ns, np.zeros(count), effort).effort[ready:]
    return float(np.sqrt(np.sum(weights * weights)))


def velocity_noise_gain(settings: FilterSettings, sample_period: float) -> float:
    """Return the standard deviation of the present velocity over that of white noise on the position [1/s].

    It is the length of the filter's impulse response, ``sqrt(sum w_i^2)``.

    Args:
        settings: the filter.
        sample_period: nominal time between two samples [s].
    """
    differentiator = Differentiator(settings, sample_period)
    ready = int(differentiator.config[layout.READY_AFTER])
    count = 4 * ready + 100
    stamp_ns = np.round(np.arange(count) * sample_period * 1e9).astype(np.int64)
    pulse = _PULSE * settings.jump_speed * sample_period
    position = np.zeros(count)
    position[ready + 1] = pulse
    weights = differentiator.step(stamp_ns, position, np.zeros(count)).present_velocity[ready:] / pulse
    return float(np.sqrt(np.sum(weights * weights)))


def window_samples(settings: FilterSettings, sample_period: float) -> int:
    """Return the polynomial's window in samples: odd, as long as set, and long enough for the degree to smooth.

    Args:
        settings: ``window`` and ``degree``.
        sample_period: nominal time between two samples [s].
    """
    return 1 + 2 * max(round(0.5 * settings.window / sample_period), settings.degree // 2 + 1)


def _tracking_time(settings: FilterSettings, sample_period: float) -> float:
    """Return the time constant of the steady tracking filter [s].

    Its poles lie at radius (jerk density / (noise sqrt(period)))^(1/3) for short periods; never below one period.
    """
    noise_density = settings.position_noise * math.sqrt(sample_period)
    return max(math.cbrt(noise_density / settings.jerk_density), sample_period)


def _require_fit(settings: FilterSettings, sample_period: float) -> None:
    """Refuse what cannot work at this sample period, all faults at once."""
    sentences = []
    if settings.kind == "lowpass" and settings.cutoff >= 0.5 / sample_period:
        sentences.append(
            f"filter.cutoff = {settings.cutoff:g} Hz must be below half the sample rate ({0.5 / sample_period:g} Hz);"
            " lower the cut-off or choose kind savgol"
        )
    if settings.maximum_gap < 2.0 * sample_period:
        sentences.append(
            f"filter.maximum_gap = {settings.maximum_gap:g} s must be at least two sample periods"
            f" ({2.0 * sample_period:g} s); raise it"
        )
    if sentences:
        raise ConfigurationError(sentences)
