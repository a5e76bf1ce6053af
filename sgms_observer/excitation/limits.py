"""What the table may do while it is excited."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.units import PRISMATIC, REVOLUTE, Units


@dataclass(frozen=True)
class ExcitationLimits:
    """What the table may do.

    Attributes:
        stroke: full width of the motion [m].
        speed: largest speed [m/s].
        acceleration: largest acceleration [m/s^2].
        smallest: smallest reversal [m].
        units: of the axis; those above are a prismatic one's.
    """

    stroke: float
    speed: float
    acceleration: float
    smallest: float = 1.0e-7
    units: Units = field(default_factory=Units)

    def __post_init__(self) -> None:
        sentences = [
            f"{name} = {value:g} must be a positive number; give the table's own limit"
            for name, value in (
                ("stroke", self.stroke),
                ("speed", self.speed),
                ("acceleration", self.acceleration),
                ("smallest", self.smallest),
            )
            if not (math.isfinite(value) and value > 0.0)
        ]
        if not sentences and self.stroke < 20.0 * self.smallest:
            sentences.append(
                f"stroke = {self.units.readable(self.stroke)} leaves no room for reversals from"
                f" {self.units.readable(self.smallest)};"
                " allow 20 times as much"
            )
        if sentences:
            raise ConfigurationError(sentences)


#: What ``sgms excite`` asks of an axis whose limits nobody gave, by joint type: a cautious part of what a positioning
#: table (some centimetres, encoder in nanometres) and a robot joint (a turn, encoder of 20 bits) can do.
CAUTIOUS_LIMITS = {
    PRISMATIC: ExcitationLimits(0.02, 0.05, 1.0, 1.0e-7, Units(PRISMATIC)),
    REVOLUTE: ExcitationLimits(0.5, 0.5, 2.0, 1.0e-5, Units(REVOLUTE)),
}


def limits_of(
    joint_type: str,
    stroke: float | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    smallest: float | None = None,
) -> ExcitationLimits:
    """Return the limits that are given, and cautious ones for the rest.

    Args:
        joint_type: of the axis.
        stroke: full width of the motion [m].
        speed: largest speed [m/s].
        acceleration: largest acceleration [m/s^2].
        smallest: smallest reversal [m].

    Raises:
        ConfigurationError: one of them makes no sense.
    """
    cautious = CAUTIOUS_LIMITS[joint_type]
    return ExcitationLimits(
        cautious.stroke if stroke is None else stroke,
        cautious.speed if speed is None else speed,
        cautious.acceleration if acceleration is None else acceleration,
        cautious.smallest if smallest is None else smallest,
        cautious.units,
    )
