"""Grids of shapes of each effect for the screening. A shape is linear in the strengths of the effect.

The columns come from the formulas of the catalogue: a column is the change of the residual by the effect at a small
strength. The grids only give start values; a fit moves them to their best values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sgms_observer.arrays import Floats
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion, lowest_rate
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

Combine = Callable[[Floats], tuple[float, ...]]

STANDARD_SIGNAL_PERIODS = (4e-6, 8e-6, 1e-5, 2e-5, 4e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1e-3, 2e-3)  # m
STANDARD_LINES = (512, 1000, 1024, 2000, 2048, 2500, 3600, 4096, 5000, 8192, 9000, 10000, 18000)  # per revolution
CONTACT_SHARE = 0.05
"""Largest slip deflection of a contact, as a share of the stroke: a larger one is a spring."""
MODE_BELOW_BAND, MODE_ABOVE_BAND, MODE_RATE = 0.15, 1.4, 0.4
"""Limits of the frequency of a flexible mode: two as shares of the band, one as a share of the sample rate. Below the
first the mass moves rigidly. Above the second the mode acts as a smaller mass."""
MAX_PITCHES = 400
PITCH_STEP = 0.4
"""Step of the spatial frequency times the stroke: small enough for a start in the main lobe."""
MOVING_SPEED_SHARE = 0.02
"""The stage counts as resting below this share of the 99.5 % quantile of the speed."""
REST_SPEED_SHARE = 0.01
"""The contact counts as resting below this share of the Stribeck velocity: the sliding force changes by 1e-4 there."""
ENCODER_STEP_TIME = 0.1
"""Shortest time between two encoder steps that counts as rest [s]."""
TRIAL_SHARE = 0.05  # strength of the columns as a share of the Coulomb force


@dataclass(frozen=True)
class Shape:
    """One shape of an effect.

    Attributes:
        name: the effect.
        bases: parameter values of each column.
        combine: function from the coefficients of the columns to parameter values.
        is_positive: whether the coefficient of a single column has to be positive.
    """

    name: str
    bases: tuple[tuple[float, ...], ...]
    combine: Combine
    is_positive: bool = False

    def columns(self) -> list[EffectSettings]:
        """Return the effect with the values of each column, inside its bounds."""
        return [self._inside(values) for values in self.bases]

    def settings(self, coefficients: Floats) -> EffectSettings:
        """Return the effect with these coefficients of the columns, inside its bounds."""
        return self._inside(self.combine(coefficients))

    def _inside(self, values: tuple[float, ...]) -> EffectSettings:
        """Return the effect with every value inside its bounds."""
        parameters = effect(self.name).parameters
        return EffectSettings(
            self.name,
            tuple(float(min(max(v, p.minimum), p.maximum)) for v, p in zip(values, parameters, strict=True)),
        )


def scaled(name: str, strengths: Sequence[int], values: Sequence[float], is_positive: bool = False) -> Shape:
    """Return a shape with one column: ``values``, with the entries ``strengths`` scaled together."""

    def combine(c: Floats) -> tuple[float, ...]:
        return tuple(v * float(c[0]) if i in strengths else v for i, v in enumerate(values))

    return Shape(name, (tuple(values),), combine, is_positive)


def unscaled(name: str, values: Sequence[float]) -> Shape:
    """Return a shape with one column and fixed values, for effects whose strength determines the shape."""
    return Shape(name, (tuple(values),), lambda c: tuple(values), is_positive=True)


def sine_and_cosine(name: str, size: float, period: float) -> Shape:
    """Return a sine and a cosine of one period."""
    tail = (0.0,) * (len(effect(name).parameters) - 3)

    def combine(c: Floats) -> tuple[float, ...]:
        return (size * math.hypot(c[0], c[1]), period, math.atan2(c[1], c[0]), *tail)

    return Shape(name, ((size, period, 0.0, *tail), (size, period, 0.5 * math.pi, *tail)), combine)


def sums_over_waves(position: Floats, weights: Floats, waves: Floats) -> NDArray[np.complex128]:
    """Return the weighted sum of ``exp(2 pi i position wave)`` over the samples, for each wave.

    Args:
        position: shape (n,) [m].
        weights: of the samples, shape (n,).
        waves: spatial frequencies [1/m]; each costs one multiplication per sample where they are evenly spaced.
    """
    found = np.zeros(len(waves), dtype=np.complex128)
    turned, turn, last = weights.astype(np.complex128), np.ones(1), 0.0
    for k, step in enumerate(np.diff(waves, prepend=0.0)):
        if not math.isclose(step, last, rel_tol=1.0e-6):  # rounded differences of an even grid are equal
            turn, last = np.exp(2.0j * np.pi * step * position), step
        turned *= turn
        found[k] = turned.sum()
    return found


def shapes(name: str, motions: Sequence[Motion], model: Model) -> list[Shape]:
    """Return the shapes of an effect that these recordings can show.

    Args:
        name: the effect.
        motions: recordings.
        model: nominal model, which sets the units.
    """
    force = TRIAL_SHARE * model.friction.coulomb_force
    position = np.concatenate([motion.position for motion in motions])
    speed = np.concatenate([np.abs(motion.velocity) for motion in motions])
    effort = np.concatenate([np.abs(motion.effort) for motion in motions])
    middle, stroke = float(np.mean([position.min(), position.max()])), float(np.ptp(position))
    fast, mean_speed = float(np.quantile(speed, 0.995)), max(float(np.mean(speed)), 1.0e-5)
    fast_acceleration = float(np.quantile(np.concatenate([np.abs(motion.acceleration) for motion in motions]), 0.99))
    length = max(float(motion.time[-1]) for motion in motions)
    travel = max(float(np.sum(np.abs(np.diff(motion.position)))) for motion in motions)
    v_s, slip = model.friction.stribeck_velocity, model.slip_deflection
    rest = max(REST_SPEED_SHARE * v_s, max(motion.resolution for motion in motions) / ENCODER_STEP_TIME)
    longest, period = max(3.0 * slip, CONTACT_SHARE * stroke), model.joint_period
    grid = np.geomspace
    match name:
        case "cogging":
            return [sine_and_cosine(name, force, pitch) for pitch in pitches(motions, period)]
        case "position_periodic_friction":
            return [sine_and_cosine(name, TRIAL_SHARE, pitch) for pitch in pitches(motions, period)]
        case "periodic_disturbance":
            return []  # scanned by its own spectrum, see ``screen``
        case "spring":
            bases = ((force / stroke, middle), (2.0 * force / stroke, middle + 0.5 * stroke))

            def line(c: Floats) -> tuple[float, ...]:
                slope = force / stroke * (c[0] + 2.0 * c[1])
                constant = -middle * force / stroke * c[0] - (middle + 0.5 * stroke) * 2.0 * force / stroke * c[1]
                return (slope, -constant / slope if slope != 0.0 else middle)

            return [Shape(name, bases, line)]
        case "offset":
            return [scaled(name, (0,), (force,))]
        case "asymmetric_viscous":
            return [scaled(name, (0,), (force / fast,))]
        case "nonlinear_viscous":
            return [scaled(name, (0,), (force, n, fast)) for n in (0.2, 0.3, 0.45, 0.6, 0.75, 1.4, 3.0)]
        case "quadratic_drag":
            return [scaled(name, (0,), (force / fast**2,))]
        case "eddy_current":
            return [scaled(name, (0,), (force, fast * r, 0.0), True) for r in (0.08, 0.15, 0.25, 0.4, 0.7, 1.2)]
        case "cross_axis_coupling":
            if not any(motion.has_other for motion in motions):
                return []
            size = max(float(np.std(np.concatenate([motion.other_acceleration for motion in motions]))), 1e-12)
            speed2 = max(float(np.std(np.concatenate([motion.other_velocity for motion in motions]))), 1e-12)
            a, v = force / size, force / speed2
            return [Shape(name, ((a, 0.0), (0.0, v)), lambda c: (a * float(c[0]), v * float(c[1])))]
        case "presliding":
            return [scaled(name, (0,), (force, d)) for d in grid(0.8 * slip, longest, 8)]
        case "mass_error":
            return [scaled(name, (0,), (TRIAL_SHARE * model.mass,))]
        case "flexible_mode":
            zetas, slowest = (0.03, 0.15), min(motion.band for motion in motions)
            fastest = min(MODE_ABOVE_BAND * slowest, MODE_RATE * lowest_rate(motions))
            modes = grid(MODE_BELOW_BAND * slowest, fastest, 24)
            return [scaled(name, (0,), (TRIAL_SHARE * model.mass, f, z), True) for f in modes for z in zetas]
        case "position_dependent_friction":
            places = np.linspace(position.min(), position.max(), 17)
            widths = stroke * np.array([0.04, 0.09, 0.2])
            return [scaled(name, (0,), (TRIAL_SHARE, q, w)) for q in places for w in widths]
        case "asymmetric_coulomb":
            return [scaled(name, (0,), (TRIAL_SHARE,))]
        case "stribeck":
            return [scaled(name, (0,), (TRIAL_SHARE, v)) for v in grid(3.0 * v_s, max(0.5 * fast, 4.0 * v_s), 7)]
        case "load_dependent_friction":
            return [scaled(name, (0,), (TRIAL_SHARE / fast_acceleration,))]
        case "thermal_drift":
            return [
                scaled(name, (0,), (TRIAL_SHARE, tau, share, mean_speed))
                for tau in length * np.array([0.1, 0.25, 0.5, 1.0, 3.0])
                for share in (0.0, 1.0)
            ]
        case "wear_step":
            moments = travel * np.linspace(0.05, 0.95, 19)
            return [scaled(name, (0,), (TRIAL_SHARE, s, w * travel)) for s in moments for w in (0.01, 0.05)]
        case "dwell_breakaway":
            return [
                scaled(name, (0,), (TRIAL_SHARE, t, d, rest))
                for t in (0.05, 0.2, 0.8)
                for d in grid(0.8 * slip, longest, 5)
            ]
        case "frictional_lag":
            coulomb, mean_slip = model.friction.coulomb_force, _mean_slip_deflection(model)
            return [
                unscaled(name, (coulomb / tau, r * mean_slip)) for tau in grid(0.002, 0.2, 7) for r in (0.5, 1.5, 5.0)
            ]
        case "backlash":
            stop = 0.1 * slip
            return [scaled(name, (1,), (gap, TRIAL_SHARE, stop), True) for gap in grid(0.8 * slip, longest, 8)]
        case "gravity":
            return gravity_shapes(force, model)
        case "actuator_gain":
            return [Shape(name, ((1.0 + TRIAL_SHARE,),), lambda c: (1.0 + TRIAL_SHARE * float(c[0]),))]
        case "actuator_saturation":
            return [unscaled(name, (float(np.quantile(effort, q)),)) for q in (0.93, 0.96, 0.98, 0.99, 0.995, 0.998)]
        case "actuator_dead_zone":
            return [scaled(name, (0,), (force,), True)]
        case "actuator_delay":
            return [scaled(name, (0,), (2.0e-4,), True)]
        case "encoder_interpolation_error":
            periods = STANDARD_SIGNAL_PERIODS if period is None else [period / lines for lines in STANDARD_LINES]
            return [sine_and_cosine(name, 1.0e-3 * p, p) for p in periods if p < 0.2 * stroke]
        case "quantisation":
            return []  # read off the position itself, see ``audit``
        case _:
            return _generic(name, force)


def gravity_shapes(force: float, model: Model) -> list[Shape]:
    """Return the shape of gravity: a sine of the angle; a constant force of a prismatic axis is an offset."""
    if model.joint_period is None:
        return []

    def combine(c: Floats) -> tuple[float, ...]:
        return (force * math.hypot(c[0], c[1]), math.atan2(c[1], c[0]), 1.0)

    return [Shape("gravity", ((force, 0.0, 1.0), (force, 0.5 * math.pi, 1.0)), combine)]


def pitches(motions: Sequence[Motion], period: float | None) -> list[float]:
    """Return the pitches to screen, the longest first.

    The longest is two thirds of the stroke. The shortest is limited by the encoder, by the band at the 10 % quantile of
    the moving speed, and by about ``MAX_PITCHES``. The period of the joint and its half are always included.

    Args:
        motions: recordings.
        period: period of the joint [its unit], or None.
    """
    position = np.concatenate([motion.position for motion in motions])
    stroke = float(np.ptp(position))
    speed = np.concatenate([np.abs(motion.velocity) for motion in motions])
    moving = speed[speed > MOVING_SPEED_SHARE * float(np.quantile(speed, 0.995))]
    slow = float(np.quantile(moving, 0.1)) if len(moving) else 0.0
    resolution = max(motion.resolution for motion in motions)
    shortest = max(slow / min(motion.band for motion in motions), 8.0 * resolution, stroke / MAX_PITCHES * PITCH_STEP)
    implied = [] if period is None else [period, 0.5 * period]
    found = [1.0 / f for f in np.arange(1.5 / stroke, 1.0 / shortest, PITCH_STEP / stroke)] if stroke > 0.0 else []
    return [*implied, *found]


def _mean_slip_deflection(model: Model) -> float:
    """Return the mean slip deflection of the elements [m]."""
    friction = model.friction
    shares = np.array(friction.element_fraction)
    return float(np.sum(shares * shares * friction.coulomb_force / np.array(friction.element_stiffness)))


def _generic(name: str, force: float) -> list[Shape]:
    """Return shapes of an effect of the user: small strengths, shape parameters around their defaults."""
    entry = effect(name)
    strong = [i for i, p in enumerate(entry.parameters) if p.is_strength]
    found = []
    for factor in (0.3, 1.0, 3.0):
        values = []
        for i, p in enumerate(entry.parameters):
            size = force if p.unit == "N" else TRIAL_SHARE
            value = size if i in strong else p.default * factor
            values.append(min(max(value, p.minimum), p.maximum))
        found.append(scaled(name, strong, values))
    return found if len(strong) < len(entry.parameters) else found[1:2]
