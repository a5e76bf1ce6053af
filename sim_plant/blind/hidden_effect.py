"""What is hidden in one plant: slots of the kernel, series in time, a changed contact, comparable figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from numpy.random import Generator

from sgms_observer.arrays import Floats
from sim_plant.blind import slots
from sim_plant.blind.stage import Motion, TrueStage


@dataclass(frozen=True)
class Around:
    """What a series in time may depend on: sample times [s] and the other axis (None where it is not recorded).

    Attributes:
        time: sample times from the recording's start [s].
        rng: chance of this recording.
        other_position: position of the other axis [m].
        other_acceleration: its acceleration [m/s^2].
    """

    time: Floats
    rng: Generator
    other_position: Floats | None = None
    other_acceleration: Floats | None = None


Series = Callable[[Around], Floats]


@dataclass(frozen=True)
class Hidden:
    """A hidden effect of one strength.

    Attributes:
        slots: entries of the kernel's vector.
        known: the stage its owner knows (where the effect asks for a special one).
        true: the stage as it is.
        force: hidden force against positive motion over time [N].
        level: factor on the sliding level over time [-].
        viscous: factor on the viscous coefficient over time [-].
        truth: figures that mean the same in the catalogue, SI units; see ``docs/blind.md``.
    """

    known: TrueStage
    true: TrueStage
    slots: dict[int, float] = field(default_factory=dict)
    force: Series | None = None
    level: Series | None = None
    viscous: Series | None = None
    truth: dict[str, float] = field(default_factory=dict)

    def vector(self) -> Floats:
        """Return the kernel's parameter vector."""
        vector = slots.nothing_hidden()
        for index, value in self.slots.items():
            vector[index] = value
        return vector


Maker = Callable[[float], Hidden]
"""Strength (share of the Coulomb force) to what is hidden."""

Draw = Callable[[TrueStage, Motion, Generator], Maker]
"""Stage, main motion and chance to a maker: every figure but the strength is drawn here."""


@dataclass(frozen=True)
class Kind:
    """One entry of the menu.

    Attributes:
        name: catalogue name, or a name of its own outside of it.
        draw: see ``Draw``.
        is_direct: the strength is the size; otherwise the strength is scaled until the measured force has the size.
        is_inside: whether the catalogue knows it.
        smallest: smallest size at which it counts as a discrepancy (inside the owner's tolerance it does not).
        needs_other_axis: whether a second axis has to be recorded.
    """

    name: str
    draw: Draw
    is_direct: bool = False
    is_inside: bool = True
    smallest: float = 0.0
    needs_other_axis: bool = False
