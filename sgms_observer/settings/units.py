"""Units of an axis: metres and newtons where it slides, radians and newton metres where it turns."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

PRISMATIC, REVOLUTE = "prismatic", "revolute"
#: The words of URDF.
JOINT_TYPES = (PRISMATIC, REVOLUTE)

#: SI prefixes of printed numbers, largest first; smaller numbers keep the last one.
_PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "u"), (1e-9, "n"))

MAX_ROUNDING = 1e-9
"""A position below this share of the largest one of its motion is rounding: sums of steps leave 1e-15."""

_REVOLUTE_WORDS = {"m": "rad", "N": "N m", "kg": "kg m^2"}
#: Smallest positive and largest magnitude of a quantity on any machine, so that every declared range is finite.
#: They are wide: they refuse an error of six zeros, not a choice.
_PHYSICAL = {
    "-": (1e-9, 1e9),
    "Hz": (1e-4, 1e7),
    "N": (1e-9, 1e7),
    "N s/m": (1e-9, 1e9),
    "N/m": (1e-6, 1e13),
    "N/s": (1e-9, 1e12),
    "kg": (1e-12, 1e7),
    "m": (1e-15, 1e6),
    "m/s": (1e-12, 1e5),
    "m/s^2": (1e-9, 1e7),
    "m/s^3": (1e-9, 1e10),
    "rad": (1e-12, 1e6),
    "s": (1e-9, 1e6),
}
_OF_ANY_OTHER = (1e-12, 1e12)
_WORD = re.compile(r"(?<![A-Za-z])(kg|N|m)(?![A-Za-z])")


def physical_range(unit: str) -> tuple[float, float]:
    """Return the smallest positive and the largest magnitude that a quantity of this unit may have.

    Args:
        unit: of a prismatic axis; the numbers are wide enough for a revolute one.
    """
    return _PHYSICAL.get(unit, _OF_ANY_OTHER)


@dataclass(frozen=True)
class Scales:
    """Factors from the units of topics and bags to SI.

    Attributes:
        position: m (or rad) per unit of position, velocity and reference.
        effort: N (or N m) per unit of control_effort.
    """

    position: float = 1.0
    effort: float = 1.0

    @property
    def are_one(self) -> bool:
        """Return whether topics and bags are in SI already."""
        return self.position == 1.0 and self.effort == 1.0


#: Topics and bags in SI.
UNSCALED = Scales()
#: Names of axes with their scales, or the names alone of axes whose topics and bags are in SI.
ScaledAxes = Mapping[str, Scales] | Sequence[str]


def scales_by_axis(axes: ScaledAxes) -> dict[str, Scales]:
    """Return each axis's name with its scales."""
    return dict(axes) if isinstance(axes, Mapping) else dict.fromkeys(axes, UNSCALED)


@dataclass(frozen=True)
class Units:
    """Units of one axis, as they stand in messages, files and pictures.

    Attributes:
        joint_type: ``prismatic`` or ``revolute``.
    """

    joint_type: str = PRISMATIC

    @property
    def is_revolute(self) -> bool:
        """Return whether the axis turns."""
        return self.joint_type == REVOLUTE

    def of(self, unit: str) -> str:
        """Return the unit of this axis for the one that the quantity has on a prismatic axis.

        Args:
            unit: ``m``, ``N s/m``, ``kg``, ...; units without lengths, forces and masses stay as they are.
        """
        return _WORD.sub(lambda found: _REVOLUTE_WORDS[found[1]], unit) if self.is_revolute else unit

    @property
    def position(self) -> str:
        """Return ``m`` or ``rad``."""
        return self.of("m")

    @property
    def velocity(self) -> str:
        """Return ``m/s`` or ``rad/s``."""
        return self.of("m/s")

    @property
    def acceleration(self) -> str:
        """Return ``m/s^2`` or ``rad/s^2``."""
        return self.of("m/s^2")

    @property
    def effort(self) -> str:
        """Return ``N`` or ``N m``."""
        return self.of("N")

    @property
    def mass(self) -> str:
        """Return ``kg`` or ``kg m^2``."""
        return self.of("kg")

    @property
    def damping(self) -> str:
        """Return ``N s/m`` or ``N m s/rad``."""
        return self.of("N s/m")

    @property
    def stiffness(self) -> str:
        """Return ``N/m`` or ``N m/rad``."""
        return self.of("N/m")

    @property
    def effort_word(self) -> str:
        """Return ``force`` or ``torque``."""
        return "torque" if self.is_revolute else "force"

    def prefixed(self, size: float, unit: str = "m") -> tuple[float, str]:
        """Return the factor and the unit in which numbers of this size are easy to read, from ``n`` to no prefix.

        Kilograms have a prefix already and get no second one.

        Args:
            size: largest number to be shown, in the unit without a prefix.
            unit: what it has on a prismatic axis; its first word gets the prefix (``um/s``, ``mrad``).
        """
        if unit.startswith("kg"):
            return 1.0, self.of(unit)
        prefix_size, prefix = next(
            (entry for entry in _PREFIXES if abs(size) >= entry[0] * (1 - 1e-9)),
            _PREFIXES[-1] if size and math.isfinite(size) else _PREFIXES[0],
        )
        return 1.0 / prefix_size, f"{prefix}{self.of(unit)}"

    def readable(self, value: float, unit: str = "m", largest: float | None = None) -> str:
        """Return a number with the unit in which it is easy to read: ``31.4 nm``, ``1.2 mm/s``, ``250 urad``.

        Args:
            value: in the unit without a prefix.
            unit: what it has on a prismatic axis.
            largest: chooses the prefix instead of ``value``, for numbers that people compare.
        """
        rounded = float(f"{value:.3g}") if math.isfinite(value) else value
        factor, name = self.prefixed(rounded if largest is None else largest, unit)
        number = float(f"{rounded * factor:.3g}")
        whole = f"{number:.0f}"
        return f"{whole if 1e3 <= abs(number) < 1e6 and float(whole) == number else f'{number:.3g}'} {name}"

    def readable_positions(self, *positions: float) -> list[str]:
        """Return positions of one motion as ``readable`` does; one that is only rounding of the largest is 0.

        Args:
            positions: [m], [rad] on a revolute joint.
        """
        largest = max(map(abs, positions))
        return [
            self.readable(0.0, largest=largest) if abs(position) <= MAX_ROUNDING * largest else self.readable(position)
            for position in positions
        ]
