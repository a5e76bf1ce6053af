"""Checks a parameter file, and whether it fits a recording; all faults at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.node_parameters import missing_parameters


@dataclass(frozen=True)
class Checked:
    """Result of a check.

    Attributes:
        faults: one sentence for each fault.
        warnings: sentences about suspicious values.
        axes: the axes that were compared with the recording.
    """

    faults: tuple[str, ...]
    warnings: tuple[str, ...]
    axes: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the result that ``--json`` prints."""
        return {
            "schema": 1,
            "fits": not self.faults,
            "axes": list(self.axes),
            "faults": list(self.faults),
            "warnings": list(self.warnings),
        }


def check(config: str, axes: Sequence[str], bag: str | None, topics: Mapping[str, str]) -> Checked:
    """Check a parameter file, and compare it with a recording.

    Args:
        config: path of the file.
        axes: names of the axes; empty for all.
        bag: the recording, or None.
        topics: names of the bag's topics where they differ.

    Raises:
        RecordingError: the bag cannot be read at all.
    """
    try:
        settings = load_settings(config)
        wanted = settings.wanted_axes(axes, config)
    except ConfigurationError as error:
        return Checked(error.sentences, (), ())
    names = tuple(axis.name for axis in wanted)
    faults, warnings = tuple(missing_parameters(settings, wanted)), tuple(_late_compensations(settings, wanted))
    if not bag:
        return Checked(faults, warnings, names)
    from sgms_observer.application.bag_comparison import compare  # takes 0.8 s to load; a file alone takes 0.1 s

    found = compare(settings, bag, names, topics)
    return Checked((*faults, *found.faults), (*warnings, *found.warnings), found.axes)


def _late_compensations(settings: Settings, axes: Sequence[AxisSettings]) -> Iterator[str]:
    """Yield a warning for each axis whose ``gather_time`` is not shorter than its ``look_ahead``."""
    wait = settings.gather_time
    for axis in axes:
        ahead = axis.compensation.look_ahead
        if settings.sample_period < wait and 0.0 < ahead <= wait:
            yield (
                f"{axis.name}.compensation.look_ahead = {ahead:g} s is not longer than gather_time = {wait:g} s: the"
                " first compensations of every block come too late; set gather_time well below look_ahead"
            )
