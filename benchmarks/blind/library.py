"""A candidate library as a practitioner would write it: columns over a recording, one or more per effect name.

Written for the baselines alone. It is generous to them: the friction of the nominal model is simulated, every column
and the effort pass the same zero-phase filter, and mass and friction level are refitted with every candidate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.signal import butter, lfilter, lfiltic, sosfiltfilt

from sgms_observer.arrays import Floats
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.diagnosis.model import Model, predict
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.load import load_settings

KEEP_EVERY = 4  # 250 Hz after the 100 Hz filter


@dataclass(frozen=True)
class Signals:
    """What columns are made of: position, velocity, acceleration, time, effort, element friction, the other axis."""

    x: Floats
    v: Floats
    a: Floats
    t: Floats
    u: Floats
    friction: Floats
    other_v: Floats
    other_a: Floats
    nominal_residual: Floats
    period: float
    knee: float

    def fine(self, column: Floats) -> Floats:
        """Return a column filtered and thinned, its ends dropped."""
        sos = butter(4, 2.0 * self.period * 90.0, output="sos")
        return np.asarray(sosfiltfilt(sos, column)[200:-200:KEEP_EVERY])


def read_signals(bag: Path, config: Path) -> Signals:
    """Return the signals of a bag's first axis under the YAML's model."""
    axis = load_settings(config).axes[0]
    position = read_joint_states(bag, "/position")
    effort = read_joint_states(bag, "/control_effort")
    period = float(np.median(np.diff(position.stamp_ns))) * 1.0e-9
    other = np.asarray(position.position)[:, 1] if len(position.names) > 1 else None
    columns = np.asarray(position.position)[:, 0], np.asarray(effort.effort)[:, 0]
    record = Recording(bag.name, period, *columns, other_position=other)
    motion = motion_of(record)
    prediction = predict(Model.of(axis), motion)
    return Signals(
        x=motion.position,
        v=motion.velocity,
        a=motion.acceleration,
        t=motion.time,
        u=motion.effort,
        friction=prediction.friction,
        other_v=motion.other_velocity,
        other_a=motion.other_acceleration,
        nominal_residual=prediction.residual,
        period=motion.period,
        knee=axis.friction.stribeck_velocity,
    )


def nominal_columns(s: Signals) -> list[Floats]:
    """Return what the refit of the nominal model may move: mass, viscous coefficient, level, Stribeck rise."""
    bell = np.exp(-((s.v / s.knee) ** 2))
    return [s.a, s.v, s.friction, s.friction * bell, s.friction * bell * (s.v / s.knee) ** 2]


def lagged(values: Floats, keep: float) -> Floats:
    """Return first-order smoothing of ``values``."""
    return np.asarray(
        lfilter([1.0 - keep], [1.0, -keep], values, zi=lfiltic([1.0 - keep], [1.0, -keep], values[:1]))[0]
    )


def dahl(s: Signals, reach: float) -> Floats:
    """Return the state of a Dahl element of ``reach`` [m]."""
    travel = np.concatenate(([0.0], np.diff(s.x)))
    state, out = 0.0, np.empty(travel.size)
    for k, step in enumerate(travel):
        keep = np.exp(-abs(step) / reach)
        state = state * keep + np.sign(step) * (1.0 - keep)
        out[k] = state
    return out


Columns = Callable[[Signals], list[Floats]]


def loudest_lines(s: Signals) -> list[float]:
    """Return the five strongest frequencies of the nominal residual between 1.5 and 30 Hz."""
    spectrum = np.abs(np.fft.rfft(s.nominal_residual, 4 * s.t.size))
    frequency = np.fft.rfftfreq(4 * s.t.size, s.period)
    spectrum[(frequency < 1.5) | (frequency > 30.0)] = 0.0
    lines: list[float] = []
    while len(lines) < 5:
        lines.append(float(frequency[int(np.argmax(spectrum))]))
        spectrum[np.abs(frequency - lines[-1]) < 0.2] = 0.0
    return lines


@dataclass(frozen=True)
class Candidate:
    """One filled-in candidate: name, number of fitted figures, how to make its columns, and they for one recording."""

    name: str
    cost: int
    make: Callable[[Signals], list[Floats]]
    block: Floats


def pool(s: Signals) -> list[Candidate]:
    """Return every candidate whose columns are not empty on this recording, scaled to unit norm."""
    found = []
    for name, cost, make in candidates(s):
        block = np.stack([s.fine(column) for column in make(s)], axis=1)
        norm = np.linalg.norm(block, axis=0)
        if np.all(norm > 1.0e-12):
            found.append(Candidate(name, cost, make, block / norm))
    return found


def candidates(signals: Signals) -> Iterator[tuple[str, int, Columns]]:
    """Yield name, number of fitted figures, and columns; figures that enter bent are gridded.

    The gain of the actuator is left out: with the effort itself among the columns least squares explains everything.
    """
    pitches = np.geomspace(0.004, 0.04, 90)

    def swing(pitch: float) -> Columns:
        return lambda s: [np.sin(2 * np.pi * s.x / pitch), np.cos(2 * np.pi * s.x / pitch)]

    def rippled(pitch: float) -> Columns:
        return lambda s: [s.friction * np.sin(2 * np.pi * s.x / pitch), s.friction * np.cos(2 * np.pi * s.x / pitch)]

    for pitch in pitches:
        yield "cogging", 3, swing(pitch)
        yield "position_periodic_friction", 3, rippled(pitch)
    for share in np.linspace(-0.9, 0.9, 19):
        for width in (0.08, 0.16, 0.3):

            def spot(s: Signals, share: float = share, width: float = width) -> list[Floats]:
                reach = np.max(np.abs(s.x))
                return [s.friction * np.exp(-0.5 * ((s.x / reach - share) / width) ** 2)]

            yield "position_dependent_friction", 3, spot
    yield "spring", 2, lambda s: [s.x - s.x.mean(), np.ones(s.x.size)]
    yield "offset", 1, lambda s: [np.ones(s.x.size)]
    yield "asymmetric_coulomb", 1, lambda s: [s.friction * np.tanh(s.v / 1e-4)]
    yield "asymmetric_viscous", 1, lambda s: [np.abs(s.v)]
    yield "quadratic_drag", 1, lambda s: [s.v * np.abs(s.v)]
    yield "load_dependent_friction", 1, lambda s: [s.friction * np.abs(s.a)]
    yield "actuator_delay", 1, lambda s: [np.gradient(s.u, s.period)]
    for exponent in (0.3, 0.5, 0.7):
        yield "nonlinear_viscous", 2, lambda s, n=exponent: [np.sign(s.v) * np.abs(s.v) ** n]
    for peak in np.geomspace(0.01, 0.15, 8):
        yield "eddy_current", 2, lambda s, p=peak: [2 * (s.v / p) / (1 + (s.v / p) ** 2)]
        yield "stribeck", 2, lambda s, p=peak: [s.friction * np.exp(-((s.v / p) ** 2))]
    for reach in (3e-5, 6e-5, 1.2e-4, 2.5e-4):
        yield "presliding", 2, lambda s, r=reach: [dahl(s, r)]
        yield "backlash", 2, lambda s, r=reach: [s.friction * (1.0 - dahl(s, r) ** 4)]
    for time in (3.0, 6.0, 12.0):
        yield "thermal_drift", 2, lambda s, tau=time: [s.friction * (1.0 - np.exp(-s.t / tau))]
    for share in np.linspace(0.1, 0.9, 17):

        def step(s: Signals, share: float = share) -> list[Floats]:
            travel = np.cumsum(np.abs(s.v))
            return [s.friction * (travel > share * travel[-1])]

        yield "wear_step", 2, step
    for time in (2e-3, 5e-3, 1.5e-2, 4e-2):

        def lag(s: Signals, time: float = time) -> list[Floats]:
            bell = np.exp(-((s.v / s.knee) ** 2))
            return [s.friction * (lagged(bell, float(np.exp(-s.period / time))) - bell)]

        yield "frictional_lag", 2, lag

    def rested(s: Signals) -> list[Floats]:
        still = lagged((np.abs(s.v) < 1e-4).astype(float), float(np.exp(-s.period / 0.3)))
        return [s.friction * still * (np.abs(s.v) > 1e-4)]

    yield "dwell_breakaway", 2, rested
    for share in (0.5, 0.7, 0.9):

        def clipped(s: Signals, share: float = share) -> list[Floats]:
            limit = share * np.quantile(np.abs(s.u), 0.999)
            return [np.sign(s.u) * np.maximum(np.abs(s.u) - limit, 0.0)]

        yield "actuator_saturation", 2, clipped
    yield "actuator_dead_zone", 1, lambda s: [np.tanh(s.u / (0.1 * np.std(s.u)))]
    for frequency in np.geomspace(15.0, 95.0, 12):

        def mode(s: Signals, frequency: float = frequency) -> list[Floats]:
            step = 2 * np.pi * frequency * s.period
            keep = np.exp(-0.05 * step)
            poles = [1.0, -2.0 * keep * np.cos(step), keep**2]
            return [s.a - lfilter([sum(poles)], poles, s.a)]

        yield "flexible_mode", 3, mode
    for pitch in (1e-5, 2e-5, 4e-5, 1e-4, 2e-4):

        def grating(s: Signals, pitch: float = pitch) -> list[Floats]:
            turns = [np.sin(2 * np.pi * s.x / pitch), np.cos(2 * np.pi * s.x / pitch)]
            return [np.gradient(np.gradient(turn, s.period), s.period) for turn in turns]

        yield "encoder_interpolation_error", 3, grating
    for frequency in loudest_lines(signals):

        def hum(s: Signals, frequency: float = frequency) -> list[Floats]:
            return [np.sin(2 * np.pi * frequency * s.t), np.cos(2 * np.pi * frequency * s.t)]

        yield "periodic_disturbance", 3, hum
    yield "cross_axis_coupling", 2, lambda s: [s.other_a, s.other_v]
