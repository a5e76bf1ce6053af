"""What a commissioning asks of the table; ``nodes.table_link`` does it on the ROS graph."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from sgms_observer.application.commission.motion import Motion
from sgms_observer.errors import DataError
from sgms_observer.observer.samples import Samples

LEAD = 0.2
"""How long before its stamp a set-point is sent [s], to a table that follows set-points at their stamps."""

Floats = NDArray[np.float64]


class HeldUp(DataError):
    """A motion that was stopped because a computer was busy: it may be played again."""


@dataclass(frozen=True)
class Topics:
    """What came on the graph within a time.

    Attributes:
        names: the axes that each topic named.
        samples: positions with the efforts of their stamps [SI units].
        efforts: messages of the effort.
        seconds: how long it was listened [s].
        reference_readers: nodes that subscribe to the reference.
        reference_senders: other nodes that publish it.
        compensation_senders: nodes that publish the compensation.
    """

    names: Mapping[str, tuple[str, ...]]
    samples: Samples
    efforts: int
    seconds: float
    reference_readers: int
    reference_senders: int
    compensation_senders: int


@dataclass(frozen=True)
class Heard:
    """The newest samples during a motion.

    Attributes:
        samples: in SI, with the set-point of each stamp.
        time: since the motion began, negative on the way to its start [s], shape (n,).
    """

    samples: Samples
    time: Floats


Watch = Callable[[Heard], None]
"""Looks at the newest samples of a motion; what it raises stops the motion and takes the compensation to zero."""


class Table(Protocol):
    """One axis of a table.

    Attributes:
        lead: how long before its stamp a set-point is sent [s].
    """

    lead: float

    def listen(self, seconds: float) -> Topics:
        """Return what comes on the graph within a time, once position and effort arrive.

        Args:
            seconds: how long to listen [s].
        """
        ...

    def play(self, motion: Motion, origin: float, watch: Watch, bag: Path | None = None) -> None:
        """Play a motion, after a gentle move to its start, and return when the table rests at its end.

        Whatever stops it early, an exception of ``watch``, Ctrl-C or a silent topic, first takes the compensation to
        zero and brings the set-point to rest within the allowed acceleration.

        Args:
            motion: relative to the origin.
            origin: position of its zero [m].
            watch: is shown the samples as they come.
            bag: where to record it, from where the axis slides; None to record nothing.

        Raises:
            DataError: a topic is silent, nobody listens, or this machine is too busy.
        """
        ...

    @property
    def has_observer(self) -> bool:
        """Return whether an observer of this commissioning's own runs."""
        ...

    def start_observer(self, config: Path) -> None:
        """Start an observer of this commissioning's own, and return when it publishes.

        Args:
            config: parameter file.
        """
        ...

    def stop_observer(self) -> None:
        """Stop the observer; it takes its compensation to zero first."""
        ...

    def compensate(self, gain: float) -> None:
        """Set the gain of the axis's compensation; 0 switches it off.

        Args:
            gain: share of the predicted friction.
        """
        ...

    def release(self) -> None:
        """Switch the compensation off at once, in the middle of a motion."""
        ...

    def delays(self) -> tuple[float, float]:
        """Return the median and the 99th percentile of the time from a sample to its compensation [s]."""
        ...
