"""Contents of a bag, and the commands that can use it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sgms_observer.application.axis_facts import AxisFacts, read_axis_facts
from sgms_observer.application.gravity_unit import gravity_warnings
from sgms_observer.bags.source import BagReader, TopicSurvey, missing_topic, needed_inputs, survey_bag
from sgms_observer.diagnosis.motion import MIN_DURATION
from sgms_observer.errors import ConfigurationError, RecordingError
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.units import PRISMATIC, REVOLUTE, Units

MIN_STEPS = 50.0
"""Smallest range over encoder step; below it neither speed nor presliding is resolved."""
MIN_REVERSALS = 2
"""Smallest number of reversals; with fewer, offset, gravity and friction cannot be separated."""
MIN_REVERSALS_TO_DIAGNOSE = 4
"""A diagnosis fits to some blocks and evaluates on others, and each needs a motion in both directions."""
MAX_UNEXPLAINED = 0.9
"""Largest unexplained share of the effort about its mean; above it the effort does not belong to the motion."""
MAX_MISSING = 0.5
"""Largest share of samples without effort."""
_ENOUGH_TO_DIAGNOSE = 30.0
"""Seconds in pieces that a diagnosis can use; with less it often cannot tell what is missing."""
_STAMP_UNIT = 1.0e-9  # s, unit of a message's stamp; a smaller jitter is rounding
_MAX_RANGE = {PRISMATIC: 20.0, REVOLUTE: 100.0}  # m, rad: a long gantry, sixteen turns
_MAX_SPEED = {PRISMATIC: 20.0, REVOLUTE: 2000.0}  # m/s, rad/s: a fast linear motor, a spindle of 19,000 rev/min
_MAX_MASS = {PRISMATIC: 1.0e5, REVOLUTE: 1.0e5}  # kg, kg m^2
_MIN_MASS = {PRISMATIC: 1.0e-3, REVOLUTE: 1.0e-7}
_BALANCE_UNITS = {"mass": "kg", "viscous_coefficient": "N s/m", "coulomb_force": "N"}
"""Units of the printed values of the balance of forces on a prismatic axis."""

NOTHING = "nothing"


@dataclass(frozen=True)
class Use:
    """Whether a recording can be used for a purpose.

    Attributes:
        purpose: identify, diagnose or replay.
        is_possible: whether it can be used.
        reason: why not; empty if it can.
    """

    purpose: str
    is_possible: bool
    reason: str


def uses_of(facts: AxisFacts) -> tuple[Use, ...]:
    """Return the purposes that the recording of an axis can be used for."""
    identify = _reason_against_identification(facts)
    diagnose = identify or _reason_against_diagnosis(facts)
    reasons = {"identify": identify, "diagnose": diagnose, "replay": _reason_against_replay(facts)}
    return tuple(Use(purpose, not reason, reason) for purpose, reason in reasons.items())


def _reason_against_diagnosis(facts: AxisFacts) -> str:
    """Return why a recording that can be identified from cannot be diagnosed; empty where it can."""
    if facts.reversals < MIN_REVERSALS_TO_DIAGNOSE:
        return (
            f"the motion reverses {facts.reversals} times; diagnosis compares blocks that hold both directions and"
            f" needs {MIN_REVERSALS_TO_DIAGNOSE} at least: record a longer motion back and forth, or give several"
            " recordings"
        )
    if max(facts.piece_durations) < MIN_DURATION:
        return (
            f"the longest piece without a pause lasts {max(facts.piece_durations):.3g} s, and {MIN_DURATION:g} s are"
            " needed: record 30 s or more"
        )
    return ""


def doubts_about(facts: AxisFacts, joint_type: str | None) -> tuple[str, ...]:
    """Return a sentence for each suspicious sign and unit.

    Args:
        facts: what the recording shows.
        joint_type: prismatic or revolute; None if it is not known.
    """
    balance = facts.balance
    if balance is None or balance.sign >= 0:
        return unit_doubts(facts, joint_type)
    sign = (
        f"{facts.name}: the sign of control_effort is reversed relative to position (friction would add"
        f" {-balance.dissipation:.3g} +- {balance.dissipation_error:.2g} W); set effort_scale: -1"
    )
    return (*unit_doubts(facts, joint_type), sign)


def unit_doubts(facts: AxisFacts, joint_type: str | None) -> tuple[str, ...]:
    """Return a sentence for each suspicious unit; arguments as of ``doubts_about``."""
    found = []
    units = Units(joint_type or PRISMATIC)
    stroke, speed = min(facts.stroke, facts.recorded_range), facts.peak_speed  # an unwrapped table turns many times
    unit = units.position if joint_type else "m or rad"
    largest = _MAX_RANGE[joint_type or PRISMATIC]
    fastest = _MAX_SPEED[joint_type or REVOLUTE]
    if stroke > largest or speed > fastest:
        found.append(
            f"{facts.name}: the position spans {stroke:.4g} {unit} at up to {speed:.4g} per second, more than a stage"
            " moves; if it is in degrees set position_scale: 0.01745329252, if in millimetres 0.001, if in"
            " encoder counts the length of one count"
        )
    found += gravity_warnings(facts.name, facts.gravity, joint_type)
    balance = facts.balance
    if balance is not None and balance.sign >= 0 and balance.is_significant("mass"):
        mass = balance.value("mass")
        smallest, heaviest = _MIN_MASS[joint_type or REVOLUTE], _MAX_MASS[joint_type or PRISMATIC]
        if balance.is_mass_negative:
            found.append(
                f"{facts.name}: effort and position give a negative mass, {mass:.3g} {units.mass}; check that both"
                " belong to the same axis and side of the gear"
            )
        elif mass > 0.0 and not smallest <= mass <= heaviest:
            found.append(
                f"{facts.name}: effort and position give a mass of {mass:.3g}"
                f" {units.mass if joint_type else 'kg or kg m^2'}; check their units, and set effort_scale or"
                " position_scale"
            )
        elif mass < 0.0 and not found:
            found.append(
                f"{facts.name}: the mass comes out below zero, {mass:.3g} +- {balance.std_error('mass'):.2g}"
                f" {units.mass if joint_type else 'kg or kg m^2'}; a spring, or gravity over an angle in another unit,"
                " acts like that: check position_scale"
            )
    return tuple(found)


def losses_in(facts: AxisFacts) -> tuple[str, ...]:
    """Return a sentence for each kind of missing or unusable samples."""
    found = []
    if facts.missing_positions:
        found.append(
            f"{facts.name}: {facts.missing_positions} messages have no number as the position and are left out; check"
            " the encoder and its driver"
        )
    if 0.0 < facts.missing_efforts < 1.0:
        found.append(
            f"{facts.name}: {100.0 * facts.missing_efforts:.3g} % of the samples have no effort: no message with the"
            " same stamp, or no number in it; record control_effort at the rate of position"
        )
    if facts.cut_off:
        found.append(f"{facts.name}: {facts.cut_off}")
    if facts.gaps:
        found.append(
            f"{facts.name}: {facts.gaps} pauses lack samples, the longest {facts.longest_gap:.3g} s; record with a"
            " longer queue or on a less busy machine"
        )
    if facts.duplicate_stamps or facts.backward_stamps:
        found.append(
            f"{facts.name}: {facts.duplicate_stamps} stamps repeat the one before and {facts.backward_stamps} step"
            " back; the observer does not use these samples: stamp each sample when it is taken"
        )
    return tuple(found)


def _reason_against_identification(facts: AxisFacts) -> str:
    """Return the reason why an identification would fail; empty without one."""
    balance = facts.balance
    if facts.missing_efforts > MAX_MISSING and not facts.has_slow_effort:
        if facts.effort_fault:
            return facts.effort_fault
        return (
            f"{100.0 * facts.missing_efforts:.3g} % of the samples have no effort: record control_effort at the rate of"
            " position"
        )
    if facts.fault:
        return facts.fault
    if math.isfinite(facts.effort_rms) and facts.effort_range[0] == facts.effort_range[1]:
        return f"the effort is always {facts.effort_rms:.4g}: record the effort that the actuator applies"
    if facts.stroke <= 0.0:
        return "the position never changes: record a motion"
    if facts.encoder_step > 0.0 and facts.stroke < MIN_STEPS * facts.encoder_step:
        return (
            f"the motion spans {facts.stroke / facts.encoder_step:.3g} steps of the encoder, and {MIN_STEPS:g} are"
            " needed to resolve speed and presliding: move further, or use a finer encoder"
        )
    if facts.reversals < MIN_REVERSALS:
        return (
            f"the motion reverses {facts.reversals} times, and {MIN_REVERSALS} are needed to separate friction from"
            " a constant force: record a motion back and forth"
        )
    if balance is None:
        return "the motion does not separate mass, friction and offset: vary speed and direction"
    if balance.sign < 0:
        return (
            "the sign of control_effort is reversed relative to position: reverse the sign of effort_scale in the"
            " parameter file"
        )
    if balance.unexplained > MAX_UNEXPLAINED:
        return (
            f"mass and friction leave {100.0 * balance.unexplained:.3g} % of the effort unexplained below"
            f" {balance.corner:.3g} Hz: check that effort and position belong to the same axis, and their units"
        )
    return ""


def _reason_against_replay(facts: AxisFacts) -> str:
    """Return the reason why the observer would estimate nothing; empty without one."""
    if not facts.missing_efforts < 1.0:
        if facts.effort_fault:
            return facts.effort_fault
        return "no sample has an effort: record control_effort"
    if facts.has_slow_effort:
        return (
            f"control_effort comes at {1.0 / facts.effort_period:.6g} Hz and position at {facts.rate:.6g} Hz, so the"
            " observer makes no correction: record both at one rate"
        )
    return ""


def refuse_learnt_from(bags: Sequence[str], holdout: Sequence[str]) -> None:
    """Refuse a bag that is both fitted and held out.

    Raises:
        ConfigurationError: a bag is both.
    """
    known = {Path(bag).resolve() for bag in bags}
    for bag in holdout:
        if Path(bag).resolve() in known:
            raise ConfigurationError(
                [f"--holdout {bag} is also fitted to, so it is not held out: leave it out of one of both"]
            )


@dataclass(frozen=True)
class AxisInfo:
    """One axis of a bag.

    Attributes:
        facts: what the recording shows.
        uses: purposes that it can be used for.
        warnings: sentences about suspicious signs and units, and missing samples.
    """

    facts: AxisFacts
    uses: tuple[Use, ...]
    warnings: tuple[str, ...]

    @property
    def usable_for(self) -> tuple[str, ...]:
        """Return the purposes that the recording can be used for."""
        return tuple(use.purpose for use in self.uses if use.is_possible)


@dataclass(frozen=True)
class BagInfo:
    """What is in a bag.

    Attributes:
        path: the bag.
        topics: its topics.
        inputs: position, control_effort and reference to the topic that holds it, or None.
        axes: its axes.
        warnings: sentences about unreadable parts.
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
                    "doubts": list(axis.warnings),
                }
                for axis in self.axes
            ],
            "warnings": list(self.warnings),
        }

    def lines(self) -> list[str]:
        """Return the printed lines without the warnings."""
        found = [f"{self.path}: {len(self.topics)} topic{'' if len(self.topics) == 1 else 's'}"]
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
    """Return the contents of a bag.

    Args:
        bag: the recording.
        topics: names of the input topics where they differ.
        axes: names of the axes; None for all joints of the position topic.
        joint_type: of the axes, or None if it is not known.

    Raises:
        RecordingError: the bag cannot be read, or lacks a topic or an axis that was named.
    """
    surveys, warnings = survey_bag(bag)
    with BagReader(bag) as reader:
        inputs = needed_inputs(reader, topics)
    position = next((survey for survey in surveys if survey.name == inputs["position"]), None)
    sentences = list(warnings)
    if position is None:
        with BagReader(bag) as reader:
            sentences.append(str(missing_topic(reader, "position", "position")))
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
        gravity, unit = (None, None) if joint_type else (True, "m or rad")
        effort = next((survey for survey in surveys if survey.name == inputs["control_effort"]), None)
        facts = read_axis_facts(bag, axis, position, topics, gravity, unit=unit, effort=effort)
        found.append(AxisInfo(facts, uses_of(facts), doubts_about(facts, joint_type) + losses_in(facts)))
    return BagInfo(str(bag), surveys, inputs, tuple(found), tuple(sentences), joint_type)


def find_input_topics(
    bag: str | Path, surveys: Sequence[TopicSurvey], topics: Mapping[str, str]
) -> tuple[TopicSurvey, TopicSurvey | None]:
    """Return the topic that holds the positions and the one that holds the efforts, or None.

    Args:
        bag: the recording.
        surveys: its topics.
        topics: names of the input topics where they differ.

    Raises:
        RecordingError: there is none, or a topic that was named is not there; one sentence with the remedy.
    """
    with BagReader(bag) as reader:
        inputs = needed_inputs(reader, topics, ["position"])
    by_name = {survey.name: survey for survey in surveys}
    return by_name[inputs["position"] or ""], by_name.get(inputs["control_effort"] or "")


def _axis_lines(axis: AxisInfo, joint_type: str | None) -> list[str]:
    """Return the printed lines about one axis."""
    facts = axis.facts
    units = Units(joint_type or PRISMATIC)

    def text(value: float, unit: str) -> str:
        return units.readable(value, unit) if joint_type else f"{value:.4g}"

    low, high = facts.position_range
    step = f"encoder step {text(facts.encoder_step, 'm')}" if facts.encoder_step else "no encoder step found"
    speed = f", peak speed {text(facts.peak_speed, 'm/s')}" if math.isfinite(facts.peak_speed) else ""
    jitter = 1e6 * facts.jitter if facts.jitter >= _STAMP_UNIT else 0.0
    with_effort = f" (with an effort {1.0 / facts.effort_period:.6g} Hz)" if facts.has_slow_effort else ""
    lines = [
        f"axis {facts.name}: {facts.samples} samples, {facts.duration:.6g} s at {facts.rate:.6g} Hz{with_effort},"
        f" jitter {jitter:.3g} us, {facts.gaps} gaps, {facts.duplicate_stamps} duplicate stamps",
        f"  position {text(low, 'm')} to {text(high, 'm')}, {step}{speed}, {facts.reversals} reversals",
    ]
    if facts.missing_efforts < 1.0:
        missing = f", missing in {100.0 * facts.missing_efforts:.3g} % of the samples" if facts.missing_efforts else ""
        low, high = facts.effort_range
        lines.append(f"  effort {text(low, 'N')} to {text(high, 'N')}, rms {text(facts.effort_rms, 'N')}{missing}")
    if facts.balance is not None:
        signs = {
            1: "control_effort and position have the same sign",
            -1: "the sign of control_effort is reversed relative to position",
            0: "the sign of control_effort is not known",
        }
        values = ", ".join(
            f"{name} {facts.balance.value(name):.4g} +- {facts.balance.std_error(name):.2g}"
            + (f" {units.of(_BALANCE_UNITS[name])}" if joint_type else "")
            for name in facts.balance.names[:3]
        )
        gravity = " with gravity A sin q + B cos q" if "gravity_sin" in facts.balance.names else ""
        lines.append(
            f"  below {facts.balance.corner:.3g} Hz{gravity}: {values};"
            f" {100.0 * facts.balance.unexplained:.3g} % unexplained; {signs[facts.balance.sign]}"
        )
    lines += [f"  note: {note}" for note in facts.notes]
    lines += [f"  note: {note}" for note in _time_to_diagnose(facts) if "diagnose" in axis.usable_for]
    lines.append(f"  usable for: {', '.join(axis.usable_for) or NOTHING}")
    lines += [f"  not for {use.purpose}: {use.reason}" for use in axis.uses if not use.is_possible]
    return lines


def _time_to_diagnose(facts: AxisFacts) -> list[str]:
    """Return a note where a diagnosis leaves out a part of a recording, or has little to judge by."""
    whole = sum(facts.piece_durations)
    used = sum(duration for duration in facts.piece_durations if duration >= MIN_DURATION)
    if not 0.0 < used < _ENOUGH_TO_DIAGNOSE:
        return []
    parts = f", in pieces of {MIN_DURATION:g} s or more between pauses" if used < whole else ""
    return [f"a diagnosis can use {used:.3g} of {whole:.3g} s{parts}; {_ENOUGH_TO_DIAGNOSE:g} s are better"]
