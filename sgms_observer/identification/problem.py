"""The identification problem: a recording prepared once, and residual with Jacobian as functions of the parameters.

Both sides of ``u(t - delay) = m a + sigma_v v + friction(x) + offset`` pass the same zero-phase low-pass, so that no
filter delay enters and the noise of the twice differentiated position stays small. The friction is driven by a position
that is filtered less: it may follow sharp reversals, while the noise that mass times acceleration would add, and that
a stiff element could imitate, is gone from the balance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import signal
from scipy.interpolate import CubicSpline

from sgms_observer.effects.compiled import CompiledEffects
from sgms_observer.errors import DataError
from sgms_observer.formulas import vectorised
from sgms_observer.identification.simulation import SHARED, ElementShape, friction_and_slopes
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.friction import FrictionSettings

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

MASS, VISCOUS, OFFSET, DELAY, RHO, V_S, RATE, RELAXATION, ELEMENTS = range(9)
SCALARS = (
    "mass", "viscous_coefficient", "offset", "delay", "stribeck_ratio", "stribeck_velocity", "relaxation_rate",
    "damping_over_stiffness",
)  # fmt: skip

stribeck_level = vectorised("friction").stribeck_level

MOTION_OVER_BALANCE = 2.5
"""Corner of the low-pass on the position that drives the friction, over the corner of the balance."""

_ORDER = 4
_WORKING_RATE = 10.0  # samples of the driving position per period of its corner
_ROW_RATE = 8.0  # rows of the balance per period of its corner
_BORDER = 4.0  # of the filter's time constants 1/cutoff dropped at either end
_FORGET = 3.0  # slip deflections of one-way travel after which the unknown start no longer matters


@dataclass(frozen=True)
class Prepared:
    """One recording, filtered: the driving position at the working rate, the balance in fewer rows.

    Attributes:
        name: where it comes from.
        period: working period [s].
        position: position that drives the friction [m], at the working rate.
        factor: known effects' factor on the Stribeck level [-], at the working rate.
        sections: second-order sections of the balance's low-pass at the working rate.
        stride: working samples per row.
        time: of each row [s], from 0.
        velocity: of each row [m/s].
        acceleration: of each row [m/s^2].
        effort: spline through the filtered effort [N] over time [s].
        usable: rows away from the filter's borders.
    """

    name: str
    period: float
    position: Floats
    factor: Floats
    sections: Floats
    stride: int
    time: Floats
    velocity: Floats
    acceleration: Floats
    effort: CubicSpline
    usable: Booleans

    def low_pass(self, values: Floats) -> Floats:
        """Return the rows of signals at the working rate, through the balance's zero-phase low-pass."""
        return np.asarray(signal.sosfiltfilt(self.sections, values, axis=0)[:: self.stride])

    def settled(self, slip_deflection: float) -> Booleans:
        """Return usable rows after the elements have forgotten how they started.

        Args:
            slip_deflection: largest deflection at which an element slips [m].
        """
        way = np.sign(np.diff(self.position))
        turning = np.concatenate(([True], way[1:] != way[:-1]))
        since = np.maximum.accumulate(np.where(turning, np.arange(len(turning)), 0))
        run = np.abs(self.position[1:] - self.position[since])
        far = np.flatnonzero(run > _FORGET * slip_deflection)
        mask = self.usable.copy()
        mask[: (int(far[0]) // self.stride + 1 if len(far) else len(mask))] = False
        return mask


@dataclass(frozen=True)
class KnownEffects:
    """Effects of the start settings that identification takes as they are.

    Attributes:
        settings: the effects, without the offset, which is identified.
        friction: start friction; its Stribeck level enters effects that scale with it.
    """

    settings: tuple[EffectSettings, ...]
    friction: FrictionSettings


def prepare(recording: Recording, cutoff: float, known: KnownEffects | None = None) -> Prepared:
    """Filter a recording and bring it to the working rate.

    Args:
        recording: evenly sampled position and effort.
        cutoff: corner of the balance's low-pass [Hz].
        known: effects to take out first.

    Raises:
        DataError: if the recording is too short or too slowly sampled.
    """
    rate = 1.0 / recording.period
    motion_cutoff = MOTION_OVER_BALANCE * cutoff
    if motion_cutoff >= 0.45 * rate:
        raise DataError(
            f"{recording.name} is sampled at {rate:.4g} Hz; choose a cutoff below {0.18 * rate:.4g} Hz,"
            f" not {cutoff:.4g} Hz"
        )
    if recording.duration < 20.0 * _BORDER / cutoff:
        raise DataError(f"{recording.name} lasts {recording.duration:.3g} s; a cutoff of {cutoff:.4g} Hz needs more")
    recording = _dense(recording, _WORKING_RATE * motion_cutoff)
    rate = 1.0 / recording.period
    effects = CompiledEffects(known.settings if known else (), recording.period)
    state = effects.initial_state()
    sharp = _low_pass(motion_cutoff, rate)
    both = np.concatenate([sharp, _low_pass(cutoff, rate)])
    measured = effects.corrected_position(recording.position)
    effort = effects.arrived_effort(recording.effort, state)
    position = signal.sosfiltfilt(sharp, measured)
    factor = np.ones(len(position))
    if known and effects.has_force_or_level:
        force, factor = _known_force(effects, known, recording.period, position, effort, state)
        effort = effort - force
    step = max(1, int(rate / (_WORKING_RATE * motion_cutoff) + 1e-6))
    period = recording.period * step
    stride = max(1, int(1.0 / (_ROW_RATE * cutoff * period) + 1e-6))
    smooth = signal.sosfiltfilt(both, measured)
    velocity: Floats = np.gradient(smooth) / recording.period
    acceleration: Floats = np.gradient(velocity) / recording.period
    keep = slice(None, None, step * stride)
    time = np.asarray(period * stride * np.arange(len(smooth[keep])))
    border = int(np.ceil(_BORDER / cutoff / (period * stride)))
    usable = np.zeros(len(time), dtype=bool)
    usable[border:-border] = True
    return Prepared(
        name=recording.name,
        period=period,
        position=np.ascontiguousarray(position[::step]),
        factor=np.ascontiguousarray(factor[::step]),
        sections=np.concatenate([_low_pass(motion_cutoff, 1.0 / period), _low_pass(cutoff, 1.0 / period)]),
        stride=stride,
        time=time,
        velocity=velocity[keep],
        acceleration=acceleration[keep],
        effort=CubicSpline(time, signal.sosfiltfilt(both, effort)[keep]),
        usable=usable,
    )


def _dense(recording: Recording, rate: float) -> Recording:
    """Return the recording at ``rate`` [Hz] at least: band-limited, between and through the samples.

    At 1 kHz a friction that turns within a sample, and a central difference at the balance's corner, would be wrong by
    per cents; between the samples the position is as well known as at them.
    """
    times = math.ceil(rate * recording.period - 1e-6)
    if times <= 1:
        return recording
    position, effort = (
        np.asarray(signal.resample_poly(values, times, 1, padtype="line"))
        for values in (recording.position, recording.effort)
    )
    keep = (len(recording) - 1) * times + 1
    return replace(
        recording,
        period=recording.period / times,
        position=position[:keep],
        effort=effort[:keep],
        reference_position=None,
        other_position=None,
    )


def _low_pass(cutoff: float, rate: float) -> Floats:
    """Return the second-order sections of the low-pass."""
    return np.asarray(signal.butter(_ORDER, 2.0 * cutoff / rate, output="sos"))


def _known_force(
    effects: CompiledEffects, known: KnownEffects, period: float, position: Floats, effort: Floats, state: Floats
) -> tuple[Floats, Floats]:
    """Return the known effects' force [N] and factor on the Stribeck level along the motion."""
    velocity: Floats = np.gradient(position) / period
    acceleration: Floats = np.gradient(velocity) / period
    curve = known.friction
    level = stribeck_level(velocity, curve.static_force, curve.coulomb_force, curve.stribeck_velocity)
    seconds: Floats = np.asarray(period * np.arange(len(position)))
    periods = np.full(len(position), period)
    return effects.evaluate(position, velocity, acceleration, seconds, effort, periods, level, state)


@dataclass(frozen=True)
class Parameters:
    """Physical parameters of the model under identification.

    Attributes:
        scalars: the entries named in ``SCALARS``, SI units, shape (8,).
        kappa: element stiffness [N/m], shape (n_z,).
        level: element Coulomb force a_i [N], shape (n_z,).
    """

    scalars: Floats
    kappa: Floats
    level: Floats

    @property
    def count(self) -> int:
        """Number of elements."""
        return len(self.kappa)

    @property
    def slip_deflection(self) -> Floats:
        """Deflection at which each element slips at rest [m]."""
        return np.asarray(self.level * max(1.0, self.scalars[RHO]) / self.kappa)

    def vector(self) -> Floats:
        """Return all as one vector: scalars, kappa, a."""
        return np.concatenate([self.scalars, self.kappa, self.level])

    def with_vector(self, values: Floats) -> Parameters:
        """Return the parameters that ``values`` lists in the order of ``vector``."""
        n_z = self.count
        return Parameters(values[:ELEMENTS], values[ELEMENTS : ELEMENTS + n_z], values[ELEMENTS + n_z :])

    def names(self) -> tuple[str, ...]:
        """Return the name of each entry of ``vector``."""
        elements = range(1, self.count + 1)
        return (*SCALARS, *(f"element_stiffness[{i}]" for i in elements), *(f"element_force[{i}]" for i in elements))


def residual_and_jacobian(data: Prepared, parameters: Parameters, shape: ElementShape) -> tuple[Floats, Floats]:
    """Predicted minus measured effort and its derivative by ``parameters.vector()``.

    Args:
        data: prepared recording.
        parameters: physical parameters.
        shape: kind of model and its smoothing.

    Returns:
        Residual [N], shape (n,), and Jacobian, shape (n, 8 + 2 n_z).
    """
    scalars = parameters.scalars
    shared = scalars[[RHO, V_S, RATE]]
    friction, slopes = friction_and_slopes(
        data.position, data.period, parameters.kappa, parameters.level, shared, shape, data.factor
    )
    rate: Floats = np.gradient(friction) / data.period
    lasting = scalars[RELAXATION]
    if lasting != 0.0:  # sigma_i = lasting * kappa_i: the force of every element leads by the same time
        friction = friction + lasting * rate
        slopes = slopes + lasting * np.gradient(slopes, axis=0) / data.period
    filtered = data.low_pass(np.column_stack([friction, slopes, rate]))
    shifted = np.clip(data.time - scalars[DELAY], data.time[0], data.time[-1])
    n_z = parameters.count
    residual = (
        scalars[MASS] * data.acceleration
        + scalars[VISCOUS] * data.velocity
        + scalars[OFFSET]
        + filtered[:, 0]
        - data.effort(shifted)
    )
    jacobian = np.empty((len(residual), ELEMENTS + 2 * n_z))
    jacobian[:, MASS] = data.acceleration
    jacobian[:, VISCOUS] = data.velocity
    jacobian[:, OFFSET] = 1.0
    jacobian[:, DELAY] = data.effort(shifted, 1)
    jacobian[:, [RHO, V_S, RATE]] = filtered[:, 1 + 2 * n_z : 1 + 2 * n_z + SHARED]
    jacobian[:, RELAXATION] = filtered[:, -1]
    jacobian[:, ELEMENTS:] = filtered[:, 1 : 1 + 2 * n_z]
    return residual, jacobian


def chunk_numbers(data: Sequence[Prepared], count: int) -> list[NDArray[np.int64]]:
    """Number the rows of all recordings by chunks of equal duration.

    Args:
        data: prepared recordings.
        count: chunks over all of them together.

    Returns:
        Chunk number of each row, per recording; numbers do not repeat between recordings.
    """
    total = sum(float(piece.time[-1]) for piece in data)
    numbers = []
    first = 0
    for piece in data:
        own = max(1, round(count * float(piece.time[-1]) / total))
        numbers.append(first + np.minimum(np.arange(len(piece.time)) * own // len(piece.time), own - 1))
        first += own
    return numbers
