"""A first parameter file, from a template or from a bag."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from sgms_observer.application.axis_draft import AxisDraft, recorded_draft, template_draft
from sgms_observer.application.axis_facts import read_axis_facts
from sgms_observer.application.bag_info import find_position_topic
from sgms_observer.application.parameter_template import template_text
from sgms_observer.application.recording_use import doubts_about, losses_in
from sgms_observer.bags.source import survey_bag
from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.settings.units import PRISMATIC
from sgms_observer.whole_file import refuse_existing_files, write_text

_AXIS_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


@dataclass(frozen=True)
class InitOptions:
    """What is known of the axes beforehand.

    Attributes:
        joint_type: prismatic or revolute.
        position_scale: factor from the bag's positions to m or rad.
        effort_scale: factor from the bag's efforts to N or N m.
        is_overwriting: replace a file that is there.
    """

    joint_type: str = PRISMATIC
    position_scale: float = 1.0
    effort_scale: float = 1.0
    is_overwriting: bool = False


@dataclass(frozen=True)
class Initialised:
    """A parameter file that was written.

    Attributes:
        path: the file.
        drafts: first values of each axis.
        warnings: sentences about values that are guesses, and signs and units that look wrong.
    """

    path: str
    drafts: tuple[AxisDraft, ...]
    warnings: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the result that ``--json`` prints."""
        axes = [
            {
                "name": draft.name,
                "joint_type": draft.joint_type,
                "position_scale": draft.position_scale,
                "effort_scale": draft.effort_scale,
                "mass": draft.mass,
                "coulomb_force": draft.coulomb,
                "viscous_coefficient": draft.viscous,
                "effects": {name: dict(values) for name, values in draft.effects.items()},
                "encoder_step": draft.step,
            }
            for draft in self.drafts
        ]
        period = self.drafts[0].period
        return {"schema": 1, "yaml": self.path, "sample_period": period, "axes": axes, "warnings": list(self.warnings)}


def init(
    bag: str | None, out: str, axes: Sequence[str] | None, topics: Mapping[str, str], options: InitOptions
) -> Initialised:
    """Write a first parameter file.

    Args:
        bag: a recording to take values from; None for the template alone.
        out: the file.
        axes: axes to describe; None for all joints of the bag, or ``x``.
        topics: names of the bag's topics where they differ.
        options: what is known of the axes.

    Raises:
        SgmsError: the bag cannot be read or the file not be written.
    """
    refuse_existing_files([out], options.is_overwriting)
    if options.position_scale == 0.0 or options.effort_scale == 0.0:
        raise ConfigurationError(["--position-scale and --effort-scale must not be 0; leave them out for 1"])
    if bag is None:
        drafts = [
            replace(template_draft(name, options.joint_type),
                    position_scale=options.position_scale, effort_scale=options.effort_scale)
            for name in axes or ["x"]
        ]  # fmt: skip
        found: list[str] = []
        head = "A positioning axis. Replace every value that you know, then identify the rest from a recording."
    else:
        drafts, found = _from_bag(bag, axes, topics, options)
        head = f"First values, read from {Path(bag).name} by least squares. Identify them from the same bag next."
    odd = [draft.name for draft in drafts if _AXIS_NAME.fullmatch(draft.name) is None]
    if odd:
        raise ConfigurationError(
            [f"the joint {odd[0]} cannot name a group of parameters; record or convert it as letters, digits, _ and -"]
        )
    text = template_text(drafts, head)
    settings_from_tree(yaml.load(text, Loader=yaml.SafeLoader), out)
    write_text(text, out)
    return Initialised(out, tuple(drafts), tuple(found))


def _from_bag(
    bag: str, axes: Sequence[str] | None, topics: Mapping[str, str], options: InitOptions
) -> tuple[list[AxisDraft], list[str]]:
    """Return first values of the axes of a bag, and the warnings."""
    surveys, warnings = survey_bag(bag)
    position = find_position_topic(bag, surveys, topics)
    joints = axes or [joint for joint in position.joints if position.filled[joint][0]]
    strange = [name for name in joints if name not in position.joints]
    if strange or not joints:
        held = ", ".join(position.joints) or "no joint"
        raise RecordingError(f"--axis {(strange or ['x'])[0]} is not in {position.name} of {bag}; it has {held}")
    drafts, found = [], list(warnings)
    for name in joints:
        axis = AxisSettings(name=name, joint_type=options.joint_type, position_scale=options.position_scale,
                            effort_scale=options.effort_scale)  # fmt: skip
        facts = read_axis_facts(bag, axis, position, topics)
        if facts.balance is not None and facts.balance.sign < 0:
            axis = replace(axis, effort_scale=-axis.effort_scale)
            found.append(
                f"{name}: the effort is counted against the motion; the file says effort_scale: {axis.effort_scale:g}"
            )
            facts = read_axis_facts(bag, axis, position, topics)
        draft = recorded_draft(facts, axis.joint_type, axis.position_scale, axis.effort_scale)
        found += [*doubts_about(facts, axis.joint_type), *losses_in(facts), *draft.warnings]
        drafts.append(draft)
    shortest = min(draft.period for draft in drafts)
    return [replace(draft, period=shortest) for draft in drafts], found
