"""Effects that a refit of the nominal model takes in whole: mass or actuator gain outside the owner's tolerance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from sgms_observer.diagnosis.fit import Refit, prior_widths
from sgms_observer.diagnosis.model import COULOMB, KNEE, MASS, STATIC, VISCOUS, Model

OUTSIDE = 1.1
"""A mass this many tolerances off is an error of its own."""
GAIN_TAKES = 12.0
"""What a common factor has to explain of the parameters' deviations, in squared standard deviations."""
BEYOND_BELIEF = 2.5
"""A refit that moves a friction parameter by this many tolerances has swallowed an effect: the tolerance is then kept
hard while effects are named."""


@dataclass(frozen=True)
class Deviation:
    """A deviation of the refitted nominal parameters that has a name.

    Attributes:
        name: ``mass_error`` or ``actuator_gain``.
        value: the effect's parameter.
        std_error: its standard error.
        alternatives: names it may as well be.
    """

    name: str
    value: float
    std_error: float
    alternatives: tuple[str, ...] = ()


def named_deviation(nominal: Model, found: Refit, tolerance: float) -> Deviation | None:
    """Return the name of what the refitted nominal parameters say together, or None.

    Args:
        nominal: the given model.
        found: its refit.
        tolerance: largest relative error its owner expects.
    """
    widths = prior_widths(nominal, tolerance)
    rows = [MASS, VISCOUS, COULOMB, STATIC]
    logs, sigma = found.logs[rows], widths[rows]
    common = float(np.sum(logs / sigma**2) / np.sum(1.0 / sigma**2))
    whole = float(np.sum((logs / sigma) ** 2))
    by_gain = whole - float(np.sum(((logs - common) / sigma) ** 2))
    by_mass = float((logs[0] / sigma[0]) ** 2)
    is_mass_off = abs(logs[0]) > OUTSIDE * tolerance
    if by_gain > GAIN_TAKES and by_gain > by_mass + 2.0:
        gain = float(np.exp(-common))
        error = float(gain * sigma[0] / np.sqrt(len(rows)))
        return Deviation(
            "actuator_gain", gain, error, ("mass_error",) if is_mass_off and by_gain < by_mass + 8.0 else ()
        )
    if is_mass_off:
        mass = found.model.mass - nominal.mass
        alternatives = ("actuator_gain",) if by_gain > GAIN_TAKES and by_gain > by_mass - 4.0 else ()
        return Deviation("mass_error", mass, 0.5 * tolerance * nominal.mass, alternatives)
    return None


def is_beyond_belief(found: Refit, nominal: Model, tolerance: float) -> bool:
    """Return whether the refit moved friction parameters so far that it must have swallowed an effect.

    Args:
        found: a refit.
        nominal: the given model.
        tolerance: largest relative error its owner expects.
    """
    deviation = named_deviation(nominal, found, tolerance)
    common = -np.log(deviation.value) if deviation is not None and deviation.name == "actuator_gain" else 0.0
    moved = found.logs[VISCOUS : KNEE + 1] - common * np.array([1.0, 1.0, 1.0, 0.0])
    return bool(np.max(np.abs(moved)) > BEYOND_BELIEF * tolerance)
