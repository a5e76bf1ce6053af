"""Plausible ranges of effect parameters, and the units in which a fit moves them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import Motion, lowest_rate
from sgms_observer.diagnosis.search import CONTACT_SHARE, MODE_RATE
from sgms_observer.diagnosis.sliding_force import PRESLIDING
from sgms_observer.effects.catalogue import effect, is_drag
from sgms_observer.settings.axis import EffectSettings

MIN_DISTANCE_SHARE = 0.75
"""Smallest backlash gap or memory distance over the largest slip deflection: a smaller one is part of the contact."""
MIN_STOP_SHARE = 0.01
"""Smallest deflection of a stop over the largest slip deflection: a smaller one is not identifiable."""
MAX_WEAR_WIDTH_SHARE = 0.08
"""Largest width of a wear step, as a share of the travel."""
MIN_DRIFT_SHARE, MAX_DRIFT_SHARE = 0.05, 5.0
"""Time constants of a drift, as shares of the recording's length."""
MIN_ATTRACTION_SHARE = 0.2
"""Smallest attraction rate, in Coulomb forces per second."""
MAX_PITCH_SHARE = 0.7
"""Largest pitch, as a share of the stroke."""
FADED = math.log(20.0) ** -0.5
"""Largest velocity of a Stribeck rise over the largest recorded speed: there it has faded to 5 %, as settling is
counted."""
MIN_MASS_SHARE = 0.1
"""Smallest moving mass after a mass error, as a share of the mass of the file."""


def plausible_range(name: str, parameter: str, motions: Sequence[Motion], nominal: Model) -> tuple[float, float]:
    """Return the range in which an effect differs from other effects in these recordings.

    A ripple with a pitch above the stroke is a slope. A spring with a far rest position is an offset. A tight spot
    beyond the stroke is a slope too, and one wider than the stroke another Coulomb force. A wear step wider than the
    travel is a drift. A memory shorter than the slip deflection is a part of the contact.
    """
    position = np.concatenate([motion.position for motion in motions])
    stroke = float(np.ptp(position))
    if parameter == "pitch":
        return 0.0, max(MAX_PITCH_SHARE * stroke, nominal.joint_period or 0.0)
    if name == "flexible_mode" and parameter == "frequency":
        return 0.0, MODE_RATE * lowest_rate(motions)
    # a drag dissipates energy; a negative one describes another contact law
    if is_drag(name) and effect(name).parameter(parameter).is_strength:
        return 0.0, np.inf
    if name == "mass_error":
        return (MIN_MASS_SHARE - 1.0) * nominal.mass, np.inf
    if name == "flexible_mode" and parameter == "damping_ratio":  # above it there is no resonance
        return 0.0, 0.5**0.5
    if name == "actuator_saturation":  # a limit above the recorded effort has no effect
        return 0.0, max(float(np.max(np.abs(motion.effort))) for motion in motions)
    if name == "actuator_dead_zone":
        return 0.0, float(np.sqrt(np.mean(np.square(np.concatenate([motion.effort for motion in motions])))))
    if parameter == "rest_position":
        return float(position.min()) - 0.5 * stroke, float(position.max()) + 0.5 * stroke
    if name == "position_dependent_friction" and parameter == "center":
        return float(position.min()), float(position.max())
    if name == "position_dependent_friction" and parameter == "width":  # half of it: one standard deviation
        return 0.0, 0.5 * stroke
    if name == "wear_step" and parameter == "width":
        return 0.0, MAX_WEAR_WIDTH_SHARE * max(float(np.sum(np.abs(np.diff(motion.position)))) for motion in motions)
    if name == "thermal_drift" and parameter == "time_constant":
        length = max(float(motion.time[-1]) for motion in motions)
        return MIN_DRIFT_SHARE * length, MAX_DRIFT_SHARE * length
    if name == "stribeck" and parameter == "velocity":
        # a smaller velocity is the nominal Stribeck curve; a rise that does not fade within the recorded speeds is
        # another Coulomb or viscous force
        least = 2.5 * nominal.friction.stribeck_velocity
        return least, max(least, *(FADED * float(np.max(np.abs(motion.velocity))) for motion in motions))
    if parameter == "rest_velocity":  # faster, what rises with the time is the Stribeck curve
        return 0.0, nominal.friction.stribeck_velocity
    if name == "frictional_lag" and parameter == "distance":
        return 0.05 * nominal.slip_deflection, np.inf
    if parameter == "attraction_rate":  # a smaller rate is not identifiable
        return MIN_ATTRACTION_SHARE * nominal.friction.coulomb_force, np.inf
    if name == PRESLIDING and parameter == "force":  # a negative one is left to the elements
        return 0.0, np.inf
    if name == PRESLIDING and parameter == "distance":  # a larger distance is a spring, not a contact
        slip = nominal.slip_deflection
        return MIN_DISTANCE_SHARE * slip, max(3.0 * slip, CONTACT_SHARE * stroke)
    if parameter == "stop":  # a softer stop is a missing element
        return MIN_STOP_SHARE * nominal.slip_deflection, 0.5 * nominal.slip_deflection
    if parameter in ("gap", "memory_distance", "distance"):
        return MIN_DISTANCE_SHARE * nominal.slip_deflection, np.inf
    return -np.inf, np.inf


def unit_of(settings: EffectSettings, index: int, nominal: Model, stroke: float) -> float:
    """Return the unit in which a fit moves a parameter of an effect; ``stroke`` is the range of the positions."""
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
