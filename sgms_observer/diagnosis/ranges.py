"""Ranges and units of effect parameters: in which one gives its effect its name, and by what it is moved in a fit."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion
from sgms_observer.diagnosis.search import CONTACT_SHARE, MODE_RATE
from sgms_observer.diagnosis.sliding_force import PRESLIDING
from sgms_observer.effects.catalogue import effect
from sgms_observer.settings.axis import EffectSettings

MIN_DISTANCE_SHARE = 0.75
"""Shortest play or memory, as a share of the contact's largest slip deflection: less is part of the contact."""
MIN_STOP_SHARE = 0.01
"""Shortest give of a wall, as a share of the same: less no recording tells."""
MAX_WEAR_WIDTH_SHARE = 0.08
"""Widest step of wear, as a share of the travel."""
MIN_DRIFT_SHARE, MAX_DRIFT_SHARE = 0.05, 5.0
"""Time constants of a drift, as shares of the recording's length."""
MIN_ATTRACTION_SHARE = 0.2
"""Slowest attraction, in Coulomb forces per second."""
MAX_PITCH_SHARE = 0.7
"""Longest period in position, as a share of the stroke."""

DRAGS = {"nonlinear_viscous": ("force",), "quadratic_drag": ("coefficient",)}
"""Strengths of drags."""
MIN_MASS_SHARE = 0.1
"""Least moving mass with a mass error, as a share of the file's: less, or a negative one, is no stage."""


def plausible_range(name: str, parameter: str, motions: Sequence[Motion], nominal: Model) -> tuple[float, float]:
    """Return the range in which a parameter gives its effect the shape of its name in these recordings.

    A ripple longer than the stroke is a slope, a spring whose rest lies far away is an offset, a step wider than the
    travel is a drift, a memory shorter than the contact's reach is the contact's own business.
    """
    position = np.concatenate([motion.position for motion in motions])
    stroke = float(np.ptp(position))
    if parameter == "pitch":
        return 0.0, max(MAX_PITCH_SHARE * stroke, nominal.joint_period or 0.0)
    if name == "flexible_mode" and parameter == "frequency":
        return 0.0, MODE_RATE * min(motion.step / motion.period for motion in motions)
    if parameter in DRAGS.get(name, ()):  # a drag takes energy; one that gives some is another contact law
        return 0.0, np.inf
    if name == "mass_error":
        return (MIN_MASS_SHARE - 1.0) * nominal.mass, np.inf
    if name == "flexible_mode" and parameter == "damping_ratio":  # above it nothing resonates
        return 0.0, 0.5**0.5
    if name == "actuator_saturation":  # a limit beyond the recorded effort limits nothing
        return 0.0, max(float(np.max(np.abs(motion.effort))) for motion in motions)
    if name == "actuator_dead_zone":
        return 0.0, float(np.sqrt(np.mean(np.square(np.concatenate([motion.effort for motion in motions])))))
    if parameter == "rest_position":
        return float(position.min()) - 0.5 * stroke, float(position.max()) + 0.5 * stroke
    if name == "wear_step" and parameter == "width":
        return 0.0, MAX_WEAR_WIDTH_SHARE * max(float(np.sum(np.abs(np.diff(motion.position)))) for motion in motions)
    if name == "thermal_drift" and parameter == "time_constant":
        length = max(float(motion.time[-1]) for motion in motions)
        return MIN_DRIFT_SHARE * length, MAX_DRIFT_SHARE * length
    if name == "stribeck" and parameter == "velocity":  # slower is the nominal curve itself
        return 2.5 * nominal.friction.stribeck_velocity, np.inf
    if name == "frictional_lag" and parameter == "distance":
        return 0.05 * nominal.slip_deflection, np.inf
    if parameter == "attraction_rate":  # slower than a recording can tell
        return MIN_ATTRACTION_SHARE * nominal.friction.coulomb_force, np.inf
    if name == PRESLIDING and parameter == "force":  # an element too many is the elements' own business
        return 0.0, np.inf
    if name == PRESLIDING and parameter == "distance":  # what gives over millimetres is no contact
        slip = nominal.slip_deflection
        return MIN_DISTANCE_SHARE * slip, max(3.0 * slip, CONTACT_SHARE * stroke)
    if parameter == "stop":  # softer is a missing element, not a wall
        return MIN_STOP_SHARE * nominal.slip_deflection, 0.5 * nominal.slip_deflection
    if parameter in ("gap", "memory_distance", "distance"):
        return MIN_DISTANCE_SHARE * nominal.slip_deflection, np.inf
    return -np.inf, np.inf


def unit_of(settings: EffectSettings, index: int, nominal: Model, stroke: float) -> float:
    """Return the unit in which an effect's parameter is moved; ``stroke`` is the range of the recordings."""
    parameter = effect(settings.name).parameters[index]
    if parameter.unit == "N":
        return nominal.friction.coulomb_force
    if parameter.unit == "rad" or (parameter.unit == "-" and parameter.is_strength):
        return 1.0
    if parameter.unit == "kg":
        return nominal.mass
    if parameter.unit == "N s/m":
        return max(nominal.friction.viscous_coefficient, abs(settings.values[index]), 1e-9)
    value = abs(settings.values[index])
    if parameter.name in ("center", "rest_position"):
        return 0.1 * stroke
    return value if value > 0.0 else 1.0
