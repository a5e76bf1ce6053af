"""Settings of one axis and of the whole package, as checked frozen dataclasses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from sgms_observer.effects.effect import EffectSettings
from sgms_observer.errors import ConfigurationError
from sgms_observer.settings.declaration import section, setting
from sgms_observer.settings.friction import FrictionSettings
from sgms_observer.settings.observer import CompensationSettings, EstimatorSettings, FilterSettings
from sgms_observer.settings.stage import StageSettings
from sgms_observer.settings.units import JOINT_TYPES, PRISMATIC, Scales, Units

__all__ = ["SAVE_FILE", "AxisSettings", "EffectSettings", "Settings", "coupled_number"]

#: Where ~/save_parameters writes unless the parameter file says otherwise.
SAVE_FILE = "learnt.yaml"


@dataclass(frozen=True)
class AxisSettings:
    """Everything about one axis."""

    name: str = "x"
    joint_type: str = setting(
        PRISMATIC,
        "prismatic: the axis slides (m, N, kg); revolute: it turns, and every unit of the axis follows"
        " (rad, N m, kg m^2)",
        choices=JOINT_TYPES,
    )
    position_scale: float = setting(
        1.0,
        "factor from position, velocity and reference as they come in topics and bags to m or rad; negative turns"
        " the axis round, 0.01745329252 is for degrees",
        is_nonzero=True,
    )
    effort_scale: float = setting(
        1.0,
        "factor from control_effort as it comes in topics and bags to N or N m; negative where the drive counts it"
        " against the position",
        is_nonzero=True,
    )
    mass: float = setting(10.0, "moving mass; of a revolute axis its moment of inertia", "kg", above=0.0)
    coupled_axis: str = setting(
        "", "axis whose motion cross_axis_coupling follows; empty for the axis before it, of the first axis the last"
    )
    friction: FrictionSettings = section(FrictionSettings, "friction model")
    effects: tuple[EffectSettings, ...] = ()
    stage: StageSettings = section(StageSettings, "simulated stage")
    stage_friction: FrictionSettings | None = None  # x.stage.friction: true friction where it differs
    stage_effects: tuple[EffectSettings, ...] | None = None  # x.stage.effects: true effects where they differ
    filter: FilterSettings = section(FilterSettings, "velocity and acceleration filter")
    estimator: EstimatorSettings = section(EstimatorSettings, "estimator")
    compensation: CompensationSettings = section(CompensationSettings, "feedforward compensation")

    @property
    def units(self) -> Units:
        """Return the units that belong to the axis's joint type."""
        return Units(self.joint_type)

    @property
    def scales(self) -> Scales:
        """Return the factors from what topics and bags carry to the axis's units."""
        return Scales(self.position_scale, self.effort_scale)


@dataclass(frozen=True)
class Settings:
    """A whole parameter file: the axes and what they share."""

    axes: tuple[AxisSettings, ...] = (AxisSettings(),)
    sample_period: float = setting(1.0e-4, "nominal time between two samples", "s", minimum=1.0e-6, maximum=1.0)
    publish_every: int = setting(
        1,
        "samples from one published estimate to the next; the compensation follows every sample",
        "samples",
        minimum=1,
    )
    gather_time: float = setting(
        0.0,
        "time for which observer_node gathers samples that come faster than this, to estimate over them together; "
        "0 takes each at once",
        "s",
        minimum=0.0,
        maximum=0.1,
    )
    autostart: bool = setting(True, "configure and activate the node by itself")
    save_file: str = setting(
        SAVE_FILE, "file that ~/save_parameters writes; relative names start at the folder of the parameter file"
    )
    effect_files: tuple[str, ...] = setting((), "Python files with effects of the user's own")
    source: dict[str, Any] = field(default_factory=dict, compare=False)  # the YAML's tree as read, for writing it back
    folder: str = field(default=".", compare=False)  # where relative file names in ``source`` start

    @property
    def scales(self) -> dict[str, Scales]:
        """Return each axis's name with its factors from topics and bags to SI."""
        return {axis.name: axis.scales for axis in self.axes}

    def wanted_axes(self, names: Sequence[str], source: str) -> tuple[AxisSettings, ...]:
        """Return the axes with these names, in their order; all of them where no name is given.

        Args:
            names: what ``--axis`` gave.
            source: the parameter file, for the error.

        Raises:
            ConfigurationError: an axis is not there.
        """
        known = {axis.name: axis for axis in self.axes}
        strange = [name for name in names if name not in known]
        if strange:
            raise ConfigurationError([f"--axis {strange[0]} is not in {source}; it has {', '.join(known)}"])
        return tuple(known[name] for name in dict.fromkeys(names)) or self.axes

    def coupled_to(self, axis: AxisSettings) -> AxisSettings | None:
        """Return the axis whose motion acts on one by ``cross_axis_coupling``; None where there is none.

        Args:
            axis: one of ``axes``.
        """
        number = coupled_number(self.axes, self.axes.index(axis))
        return None if number is None else self.axes[number]


def coupled_number(axes: Sequence[AxisSettings], number: int) -> int | None:
    """Return the number of the axis whose motion acts on this one by ``cross_axis_coupling``; None where there is none.

    Args:
        axes: of the file.
        number: of this axis.
    """
    if len(axes) < 2:
        return None
    names = [axis.name for axis in axes]
    wanted = axes[number].coupled_axis
    return names.index(wanted) if wanted in names else (number - 1) % len(axes)
