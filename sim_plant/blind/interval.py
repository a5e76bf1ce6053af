"""Confidence intervals of counted shares."""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

TWO_SIDED_95 = 1.959963984540054


@dataclass(frozen=True)
class Share:
    """A counted share with its Wilson interval.

    Attributes:
        hits: how many.
        total: out of how many.
    """

    hits: int
    total: int

    @property
    def value(self) -> float:
        """Return the share; NaN out of none."""
        return self.hits / self.total if self.total else float("nan")

    @property
    def bounds(self) -> tuple[float, float]:
        """Return the 95 % interval of Wilson (1927)."""
        if not self.total:
            return 0.0, 1.0
        z2 = TWO_SIDED_95**2
        middle = (self.hits + 0.5 * z2) / (self.total + z2)
        half = TWO_SIDED_95 / (self.total + z2) * sqrt(self.hits * (self.total - self.hits) / self.total + 0.25 * z2)
        return max(0.0, middle - half), min(1.0, middle + half)

    def __str__(self) -> str:
        """Return ``96.0 % (95/99, 90.0-98.4)``."""
        if not self.total:
            return "no case"
        low, high = self.bounds
        return f"{100 * self.value:.1f} % ({self.hits}/{self.total}, {100 * low:.1f}-{100 * high:.1f})"


def count(flags: list[bool]) -> Share:
    """Return the share of true flags."""
    return Share(sum(flags), len(flags))
