"""What is in a bag, and what it can be used for."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sgms_observer.application.axis_facts import AxisFacts, read_axis_facts
from sgms_observer.application.recording_use import Use, doubts_about, losses_in, uses_of
from sgms_observer.bags.source import BagReader, TopicSurvey, find_inputs, missing_topic, survey_bag
from sgms_observer.errors import RecordingError
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import PRISMATIC, Units

NOTHING = "nothing"


@dataclass(frozen=True)
class AxisInfo:
    """One axis of a bag.

    Attributes:
        facts: what the recording shows.
        uses: what it can be used for.
        doubts: sentences about signs and units that look wrong, and samples that were lost.
    """

    facts: AxisFacts
    uses: tuple[Use, ...]
    doubts: tuple[str, ...]

    @property
    def usable_for(self) -> tuple[str, ...]:
        """Return the purposes that the recording serves."""
        return tuple(use.purpose for use in self.uses if use.is_possible)


@dataclass(frozen=True)
class BagInfo:
    """What is in a bag.

    Attributes:
        path: the bag.
        topics: its topics.
        inputs: position, control_effort and reference to the topic that holds it, or None.
        axes: its axes.
        warnings: sentences about what could not be read.
        joint_type: of the axes, or None if it is not known.
    """

    path: str
    topics: tuple[TopicSurvey, ...]
    inputs: dict[str, str | None]
    axes: tuple[AxisInfo, ...]
    warnings: tuple[str, ...]
    joint_type: str | None

    def as_json(self) -> dict[str, Any]:
        """Return the result that ``--json`` prints."""
        return {
            "schema": 1,
            "bag": self.path,
            "topics": [
                {
                    "name": topic.name,
                    "type": topic.kind,
                    "messages": topic.messages,
                    "rate_hz": topic.rate or None,
                    "joints": list(topic.joints),
                }
                for topic in self.topics
            ],
            "inputs": self.inputs,
            "axes": [
                {
                    **axis.facts.as_json(),
                    "uses": [
                        {"for": use.purpose, "possible": use.is_possible, "reason": use.reason or None}
                        for use in axis.uses
                    ],
                    "doubts": list(axis.doubts),
                }
                for axis in self.axes
            ],
            "warnings": list(self.warnings),
        }

    def lines(self) -> list[str]:
        """Return what people read."""
        found = [f"{self.path}: {len(self.topics)} topics"]
        for topic in self.topics:
            rate = f" at {topic.rate:.6g} Hz" if topic.rate else ""
            joints = f", joints {', '.join(topic.joints)}" if topic.joints else ""
            found.append(f"  {topic.name} ({topic.kind or 'unknown type'}): {topic.messages} messages{rate}{joints}")
        for axis in self.axes:
            found += _axis_lines(axis, self.joint_type)
        return found


def inspect_bag(
    bag: str | Path, topics: Mapping[str, str], axes: Sequence[str] | None = None, joint_type: str | None = None
) -> BagInfo:
    """Return what is in a bag.

    Args:
        bag: the recording.
        topics: names of the input topics where they differ.
        axes: axes to look at; None for all joints of the position topic.
        joint_type: of the axes, or None if it is not known.

    Raises:
        RecordingError: the bag cannot be read, or lacks a topic or an axis that was named.
    """
    surveys, warnings = survey_bag(bag)
    with BagReader(bag) as reader:
        inputs = find_inputs(reader, topics)
    position = next((survey for survey in surveys if survey.name == inputs["position"]), None)
    sentences = list(warnings)
    if position is None:
        with BagReader(bag) as reader:
            sentences.append(str(missing_topic(reader, topics.get("position", "position"), "position")))
        return BagInfo(str(bag), surveys, inputs, (), tuple(sentences), joint_type)
    joints = [joint for joint in position.joints if position.filled[joint][0]]
    if not joints:
        sentences.append(f"{position.name} of {bag} holds no position of any joint; record it again")
    strange = [axis for axis in axes or () if axis not in position.joints]
    if strange:
        held_joints = ", ".join(position.joints) or "no joint"
        raise RecordingError(f"--axis {strange[0]} is not in {position.name} of {bag}; it has {held_joints}")
    found = []
    for name in axes or joints:
        axis = AxisSettings(name=name, joint_type=joint_type or PRISMATIC)
        gravity = None if joint_type else True
        facts = read_axis_facts(bag, axis, position, topics, gravity)
        found.append(AxisInfo(facts, uses_of(facts), doubts_about(facts, joint_type) + losses_in(facts)))
    return BagInfo(str(bag), surveys, inputs, tuple(found), tuple(sentences), joint_type)


def find_position_topic(bag: str | Path, surveys: Sequence[TopicSurvey], topics: Mapping[str, str]) -> TopicSurvey:
    """Return the topic that holds the positions.

    Args:
        bag: the recording.
        surveys: its topics.
        topics: names of the input topics where they differ.

    Raises:
        RecordingError: there is none; one sentence with the remedy.
    """
    with BagReader(bag) as reader:
        inputs = find_inputs(reader, topics)
        name = inputs["position"]
        if name is None:
            raise missing_topic(reader, topics.get("position", "position"), "position")
    return next(survey for survey in surveys if survey.name == name)


def _axis_lines(axis: AxisInfo, joint_type: str | None) -> list[str]:
    """Return what people read about one axis."""
    facts = axis.facts
    units = Units(joint_type or PRISMATIC)

    def text(value: float, unit: str) -> str:
        return units.readable(value, unit) if joint_type else f"{value:.4g}"

    low, high = facts.position_range
    step = f"encoder step {text(facts.encoder_step, 'm')}" if facts.encoder_step else "no encoder step shows"
    speed = f", up to {text(facts.peak_speed, 'm/s')}" if math.isfinite(facts.peak_speed) else ""
    lines = [
        f"axis {facts.name}: {facts.samples} samples, {facts.duration:.6g} s at {facts.rate:.6g} Hz, jitter"
        f" {1e6 * facts.jitter:.3g} us, {facts.gaps} gaps, {facts.duplicate_stamps} duplicate stamps",
        f"  position {text(low, 'm')} to {text(high, 'm')}, {step}{speed}, {facts.reversals} reversals",
    ]
    if facts.missing_efforts < 1.0:
        missing = f", missing in {100.0 * facts.missing_efforts:.3g} % of the samples" if facts.missing_efforts else ""
        low, high = facts.effort_range
        lines.append(f"  effort {text(low, 'N')} to {text(high, 'N')}, rms {text(facts.effort_rms, 'N')}{missing}")
    if facts.balance is not None:
        sign = {1: "the effort is counted as the motion", -1: "the effort is counted against the motion", 0: ""}
        values = ", ".join(
            f"{name} {facts.balance.value(name):.4g} +- {facts.balance.std_error(name):.2g}"
            for name in facts.balance.names[:3]
        )
        told = sign[facts.balance.sign] or "the sign of the effort does not show"
        lines.append(
            f"  below {facts.balance.corner:.3g} Hz: {values}; {100.0 * facts.balance.unexplained:.3g} % unexplained;"
            f" {told}"
        )
    lines += [f"  note: {note}" for note in facts.notes]
    lines += [f"  Warning: {doubt}" for doubt in axis.doubts]
    lines.append(f"  usable for: {', '.join(axis.usable_for) or NOTHING}")
    lines += [f"  not for {use.purpose}: {use.reason}" for use in axis.uses if not use.is_possible]
    return lines
