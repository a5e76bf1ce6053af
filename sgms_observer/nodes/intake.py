"""Converts messages of the input topics to samples of each axis. Imports no ROS: it takes the bytes of raw topics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from sgms_observer.bags.cdr import JointStateDecoder, JointStateFields
from sgms_observer.errors import DataError
from sgms_observer.observer.pairing import Pairing
from sgms_observer.settings.units import ScaledAxes, scales_by_axis

_KEPT_NAME_LISTS = 64
_Places = list[tuple[Pairing, int]]
_Push = Callable[[Pairing, int, JointStateFields], bool]
"""Passes the numbers of one axis in a decoded message to its pairing; returns False where they are missing."""


@dataclass
class IntakeCounts:
    """Counts of the messages of all axes together.

    Attributes:
        messages: messages that arrived.
        malformed: messages that were no JointState.
        short: messages whose array had no entry for an axis that they name.
        foreign: messages that name none of the axes.
        repeated_names: lists of names that name an axis twice; the first entry counts.
        too_late: compensations that were published after the time at which they apply.
    """

    messages: int = 0
    malformed: int = 0
    short: int = 0
    foreign: int = 0
    repeated_names: int = 0
    too_late: int = 0

    def sentences(self, axes: Sequence[str]) -> tuple[str, ...]:
        """Return one sentence for each kind of trouble that occurred.

        Args:
            axes: names of the axes, for the sentences.
        """
        found = (
            (self.malformed, "messages were no JointState and were dropped; check the publisher's type"),
            (self.short, "messages had no number for an axis that they name; fill position or effort for every name"),
            (self.foreign, f"messages named none of the axes {', '.join(axes)}; set axes to the names in the messages"),
            (self.repeated_names, "lists of names held an axis twice; its first entry is used, correct the publisher"),
            (
                self.too_late,
                "compensations went out when their samples were older than look_ahead and timeout together, too late to"
                " be applied; free the machine, or publish reference_horizon",
            ),
        )
        return tuple(f"{count} {text}" for count, text in found if count)


class Intake:
    """Decodes messages, finds each axis by its name, and pairs position, effort and reference by their stamps.

    Args:
        axes: names of the axes, as in the messages, with their factors from the messages to SI (``Settings.scales``).
        sample_period: nominal time between two samples [s].
    """

    def __init__(self, axes: ScaledAxes, sample_period: float) -> None:
        scales = scales_by_axis(axes)
        self.axes = tuple(scales)
        self.counts = IntakeCounts()
        self.pairings = tuple(Pairing(sample_period, scale) for scale in scales.values())
        self._known: dict[tuple[str, ...], _Places] = {}
        self._decoders = {topic: JointStateDecoder() for topic in ("position", "control_effort", "reference")}

    def position(self, message: bytes) -> bool:
        """Take in a message of the topic ``position``.

        Args:
            message: a serialized JointState.

        Returns:
            Whether ``pop`` would yield anything of the axes that it names.
        """
        return self._take("position", message, _push_position)

    def effort(self, message: bytes) -> bool:
        """Take in a message of the topic ``control_effort``, as ``position``.

        Args:
            message: a serialized JointState.
        """
        return self._take("control_effort", message, _push_effort)

    def position_and_effort(self, message: bytes) -> bool:
        """Take in a message of a topic that is ``position`` and ``control_effort`` at once, as ``position``.

        Args:
            message: a serialized JointState.
        """
        return self._take("position", message, _push_both)

    def reference(self, message: bytes) -> bool:
        """Take in a message of the topic ``reference``, as ``position``.

        Args:
            message: a serialized JointState.
        """
        return self._take("reference", message, _push_reference)

    def _take(self, topic: str, message: bytes, push: _Push) -> bool:
        self.counts.messages += 1
        try:
            decoded = self._decoders[topic].decode(message)
        except DataError:
            self.counts.malformed += 1
            return False
        places = self._known.get(decoded[1])
        if places is None:
            places = self._find(decoded[1])
        if not places:
            self.counts.foreign += 1
            return False
        has_samples = False
        for pairing, place in places:
            if not push(pairing, place, decoded):
                self.counts.short += 1
            has_samples = has_samples or pairing.has_samples
        return has_samples

    def _find(self, names: tuple[str, ...]) -> _Places:
        """Return each axis's pairing with its place in this list of names, and remember it."""
        self.counts.repeated_names += any(names.count(axis) > 1 for axis in self.axes)
        places = [
            (pairing, names.index(axis))
            for axis, pairing in zip(self.axes, self.pairings, strict=True)
            if axis in names
        ]
        if len(self._known) < _KEPT_NAME_LISTS:
            self._known[names] = places
        return places


def _push_position(pairing: Pairing, place: int, message: JointStateFields) -> bool:
    position = message[2]
    if place >= len(position):
        return False
    pairing.push_position(message[0], position[place])
    return True


def _push_effort(pairing: Pairing, place: int, message: JointStateFields) -> bool:
    effort = message[4]
    if place >= len(effort):
        return False
    pairing.push_effort(message[0], effort[place])
    return True


def _push_both(pairing: Pairing, place: int, message: JointStateFields) -> bool:
    """Push the position first, as replay does."""
    has_position = _push_position(pairing, place, message)
    has_effort = _push_effort(pairing, place, message)
    return has_position and has_effort


def _push_reference(pairing: Pairing, place: int, message: JointStateFields) -> bool:
    position, velocity = message[2], message[3]
    if place >= len(position):
        return False
    pairing.push_reference(message[0], position[place], velocity[place] if place < len(velocity) else math.nan)
    return True
