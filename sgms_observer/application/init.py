"""A first parameter file, commented, from a template or from a bag."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import yaml

from sgms_observer.application.axis_draft import FRACTIONS, AxisDraft, recorded_draft, template_draft
from sgms_observer.application.axis_facts import read_axis_facts
from sgms_observer.application.bag_info import doubts_about, find_input_topics, losses_in, unit_doubts
from sgms_observer.bags.source import survey_bag
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.late_stamps import is_significantly_not_held
from sgms_observer.diagnosis.model import Model
from sgms_observer.errors import ConfigurationError, DataError, RecordingError
from sgms_observer.offline.band import choose_band
from sgms_observer.offline.recording import read_recordings
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.settings.units import PRISMATIC, Units
from sgms_observer.whole_file import refuse_existing_files, write_text

FIRST_LIMIT_SHARE = 1.5
"""First limit of the compensation over the static force: room for a friction that was identified too low."""
_COLUMN = 61  # where the comments start, as in config/table.yaml

_HEAD = """\
# {head}
# What this file leaves out has the default of docs/parameters.md. The same file serves the nodes and the command line:
#   ros2 run sgms_observer observer_node --config FILE
#   sgms identify BAG --config FILE --out identified.yaml
"""

_AXIS_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_-]*")


def _template_text(drafts: Sequence[AxisDraft], head: str) -> str:
    """Return the text of a parameter file with first values of each axis; ``head`` gives their source."""
    period = drafts[0].period
    names = ", ".join(f'"{draft.name}"' for draft in drafts)
    lines = [
        ("/**:", "for every node; /observer_node: for that one only"),
        ("  ros__parameters:", ""),
        (f"    axes: [{names}]", "as in `name` of the messages; quotes, because ROS reads a bare y as true"),
        (f"    sample_period: {number(period)}", f"s, from one position to the next: {1.0 / period:.6g} Hz"),
        ("    autostart: true", "false: wait for a lifecycle manager to configure and activate"),
    ]
    for draft in drafts:
        lines += [("", ""), *_axis(draft)]
    return _HEAD.format(head=head) + "\n".join(_line(*line) for line in lines) + "\n"


def number(value: float) -> str:
    """Return a number as YAML reads it as one, with six digits."""
    text = f"{value:.6g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        return f"{mantissa if '.' in mantissa else mantissa + '.0'}e{int(exponent)}"
    return text if "." in text else text + ".0"


def _axis(draft: AxisDraft) -> list[tuple[str, str]]:
    """Return the lines of one axis with their comments."""
    units = Units(draft.joint_type)
    force, length = units.effort, units.position
    scales = "from the topics' and bags' units to"
    body = "moment of inertia at the joint" if units.is_revolute else "all that moves with this axis"
    stiffness = ", ".join(map(number, draft.element_stiffness))
    zeros = ", ".join(["0.0"] * len(FRACTIONS))
    amplitude = 0.25 * draft.stroke
    frequency = min(draft.speed / (4.0 * math.pi * amplitude), 0.02 / draft.period)
    return [
        (f'    "{draft.name}":', ""),
        (f"      joint_type: {draft.joint_type}", "prismatic: slides (m, N, kg); revolute: turns (rad, N m, kg m^2)"),
        (f"      position_scale: {number(draft.position_scale)}", f"{scales} {length}; 0.01745329252 for degrees"),
        (
            f"      effort_scale: {number(draft.effort_scale)}",
            f"{scales} {force}; negative where its sign is reversed relative to position",
        ),
        (f"      mass: {number(draft.mass)}", _said(draft, "mass", f"{units.mass}, {body}")),
        ("      friction:", ""),
        ("        model: sgms", "sgms: smooth, for the estimator; gms: with frictional lag"),
        ("        reset: rate_independent", "right at every speed; paper: eq. 7 as printed, too stiff in creep"),
        (f"        element_stiffness: [{stiffness}]", f"{units.stiffness}, kappa: slopes of the presliding hysteresis"),
        (
            f"        element_fraction: [{', '.join(map(str, FRACTIONS))}]",
            "nu: share of each element in the sliding force; sums to 1",
        ),
        (f"        element_damping: [{zeros}]", f"{units.damping}, sigma: micro-viscous damping; zero unless measured"),
        (
            f"        viscous_coefficient: {number(draft.viscous)}",
            _said(draft, "viscous", f"{units.damping}: slope of the friction at high speed"),
        ),
        (f"        static_force: {number(draft.static)}", f"{force}, f_S: friction where sliding begins"),
        (
            f"        coulomb_force: {number(draft.coulomb)}",
            _said(draft, "coulomb", f"{force}, f_C: friction at speed without the viscous part"),
        ),
        (
            f"        stribeck_velocity: {number(draft.stribeck_velocity)}",
            f"{units.velocity}, v_s: speed at which static has fallen towards Coulomb",
        ),
        (
            f"        attraction_rate: {number(draft.attraction_rate)}",
            f"{units.of('N/s')}, C: frictional lag, of the gms model only",
        ),
        ("", ""),
        *_effects(draft),
        ("", ""),
        ("      filter:", "velocity and acceleration from the position"),
        ("        kind: savgol", "savgol: known delay; lowpass: the paper's; kalman: noisy encoders"),
        (f"        window: {number(draft.window)}", "s: longer is smoother and later (the delay is half of it)"),
        ("        degree: 3", "of the polynomial over the window"),
        (f"        position_noise: {number(draft.noise)}", f"{length}, standard deviation of the encoder's noise"),
        (
            f"        effort_is_held: {str(draft.is_held).lower()}",
            "the drive holds each effort until the next one"
            if draft.is_held
            else "the effort acts at its stamp; from the bag",
        ),
        (f"        maximum_gap: {number(draft.pause(0.02))}", "s: after a longer pause filters and estimator restart"),
        (
            f"        jump_speed: {number(max(10.0, 10.0 * draft.speed))}",
            f"{units.velocity}: a larger change from one sample to the next is a jump",
        ),
        ("", ""),
        ("      estimator:", ""),
        ("        kind: mhe", "mhe: moving horizon; ekf: extended Kalman filter, cheaper"),
        (f"        correction_every: {draft.correction_every}", "samples from one correction to the next"),
        ("        horizon: 4", "corrections that the window looks back on"),
        (
            f"        measurement_std: {number(draft.residual)}",
            f"{force}: standard deviation of effort minus inertia minus friction",
        ),
        ("        parameters: []", "[kappa] to follow the stiffness on line; [] to hold the values above"),
        ("", ""),
        ("      compensation:", "feedforward on friction_compensation"),
        ("        enabled: false", "switch on after a look at friction_estimate and friction_std, with gain 0.3 first"),
        ("        gain: 0.9", "share of the predicted friction; 1 leaves no margin against overshoot"),
        (f"        limit: {number(FIRST_LIMIT_SHARE * draft.static)}", f"{force}, never more than this"),
        (f"        slew_limit: {number(5.0e3 * draft.coulomb)}", f"{units.of('N/s')}, never faster than this"),
        (
            "        standstill_velocity: 0.0",
            f"{units.velocity} that noise may give to an axis at rest; 0: derived from position_noise",
        ),
        (f"        fade_std: {number(0.25 * draft.coulomb)}", f"{force} of uncertainty at which it has faded to zero"),
        (f"        timeout: {number(draft.pause(0.05))}", "s without good samples until it goes to zero"),
        ("", ""),
        ("      stage:", "for stage_node and `sgms simulate` only: the simulated axis"),
        ("        controller:", ""),
        (f"          bandwidth: {number(min(100.0, 0.05 / draft.period))}", "Hz of the position loop"),
        (f"          effort_limit: {number(draft.effort)}", f"{force} the actuator can give"),
        ("        reference:", ""),
        ("          kind: sine", "sine, multi_sine, point_to_point, file or topic"),
        (f"          amplitude: {number(amplitude)}", length),
        (f"          frequency: {number(frequency)}", "Hz"),
        ("        encoder:", ""),
        (f"          resolution: {number(draft.step)}", _said(draft, "step", f"{length} per count")),
        ("        seed: 1", "of every random number of this axis"),
    ]


def _effects(draft: AxisDraft) -> list[tuple[str, str]]:
    """Return the lines of the effects that a recording shows, or of none."""
    units = Units(draft.joint_type)
    meanings = {
        "gravity": f"{units.effort} at the horizontal, and the angle from hanging down at position zero",
        "offset": units.effort,
    }
    lines = [
        ("      effects:", "what else acts on the axis; `sgms diagnose` finds and adds it"),
        (f"        names: [{', '.join(draft.effects)}]", "of docs/catalogue.md"),
    ]
    for name, values in draft.effects.items():
        content = ", ".join(f"{key}: {number(value)}" for key, value in values.items())
        lines.append((f"        {name}: {{{content}}}", f"{meanings[name]}; from the bag"))
    return lines


def _said(draft: AxisDraft, key: str, text: str) -> str:
    """Return a comment with the source of the value."""
    return f"{text}; {draft.remarks[key]}" if key in draft.remarks else text


def _line(text: str, comment: str) -> str:
    return f"{text:<{_COLUMN - 1}} # {comment}" if comment else text


@dataclass(frozen=True)
class InitOptions:
    """Known facts about the axes.

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
        warnings: sentences about guessed values, and suspicious signs and units.
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
        axes: names of the axes; None for all joints of the bag, or ``x``.
        topics: names of the bag's topics where they differ.
        options: known facts about the axes.

    Raises:
        SgmsError: the bag cannot be read or the file not be written.
    """
    refuse_existing_files([out], options.is_overwriting)
    if not all(math.isfinite(scale) and scale for scale in (options.position_scale, options.effort_scale)):
        raise ConfigurationError(["--position-scale and --effort-scale must be finite and not 0; leave them out for 1"])
    if bag is None:
        drafts = [
            replace(template_draft(name, options.joint_type),
                    position_scale=options.position_scale, effort_scale=options.effort_scale)
            for name in axes or ["x"]
        ]  # fmt: skip
        found: list[str] = []
        odd_units: list[str] = []
        head = "A positioning axis. Replace every value that you know, then identify the rest from a recording."
    else:
        drafts, found, odd_units = _from_bag(bag, axes, topics, options)
        head = f"First values, read from {Path(bag).name} by least squares. Identify them from the same bag next."
    odd = [draft.name for draft in drafts if _AXIS_NAME.fullmatch(draft.name) is None]
    if odd:
        raise ConfigurationError(
            [f"the joint {odd[0]} cannot name a group of parameters; record or convert it as letters, digits, _ and -"]
        )
    text = _template_text(drafts, head)
    try:
        settings = settings_from_tree(yaml.load(text, Loader=yaml.SafeLoader), out)
    except ConfigurationError as error:
        axes_at_fault = {sentence.partition(".")[0] for sentence in error.sentences}
        of_units = [one for one in odd_units if one.partition(":")[0] in axes_at_fault and "position_scale" in one]
        if not of_units:
            raise
        raise ConfigurationError([f"{of_units[0]}, as --position-scale; no file was written"]) from error
    if bag is not None:
        drafts = [
            replace(draft, is_held=not _acts_at_stamps(bag, axis, topics))
            for draft, axis in zip(drafts, settings.axes, strict=True)
        ]
        text = _template_text(drafts, head)
    write_text(text, out)
    return Initialised(out, tuple(drafts), tuple(found))


def _acts_at_stamps(bag: str, axis: AxisSettings, topics: Mapping[str, str]) -> bool:
    """Return whether the effort of a bag surely acts at its stamps; false where the bag does not show it.

    Args:
        bag: the recording.
        axis: first values.
        topics: names of the bag's topics where they differ.
    """
    try:
        recordings = read_recordings(bag, axis, topics=topics)
        band = choose_band(recordings, axis).corner
    except (DataError, RecordingError):
        return False
    return is_significantly_not_held(recordings, Model.of(axis).with_effects(axis.effects), band, Criteria())


def _from_bag(
    bag: str, axes: Sequence[str] | None, topics: Mapping[str, str], options: InitOptions
) -> tuple[list[AxisDraft], list[str], list[str]]:
    """Return first values of the axes of a bag, the warnings, and the ones about units."""
    surveys, warnings = survey_bag(bag)
    position, effort = find_input_topics(bag, surveys, topics)
    joints = axes or [joint for joint in position.joints if position.filled[joint][0]]
    strange = [name for name in joints if name not in position.joints]
    if strange:
        held = ", ".join(position.joints) or "no joint"
        raise RecordingError(f"--axis {strange[0]} is not in {position.name} of {bag}; it has {held}")
    if not joints:
        raise RecordingError(f"{position.name} of {bag} holds no position of any joint; record it again")
    drafts, found, odd_units = [], list(warnings), list[str]()
    for name in joints:
        axis = AxisSettings(name=name, joint_type=options.joint_type, position_scale=options.position_scale,
                            effort_scale=options.effort_scale)  # fmt: skip
        facts = read_axis_facts(bag, axis, position, topics, effort=effort)
        if facts.balance is not None and facts.balance.sign < 0:
            axis = replace(axis, effort_scale=-axis.effort_scale)
            found.append(
                f"{name}: the sign of control_effort is reversed relative to position; the file has effort_scale:"
                f" {axis.effort_scale:g}"
            )
            facts = read_axis_facts(bag, axis, position, topics, effort=effort)
        draft = recorded_draft(facts, axis.joint_type, axis.position_scale, axis.effort_scale)
        notes = [f"{name}: {note}" for note in facts.notes]
        odd_units += unit_doubts(facts, axis.joint_type)
        found += [*doubts_about(facts, axis.joint_type), *losses_in(facts), *notes, *draft.warnings]
        drafts.append(draft)
    shortest = min(draft.period for draft in drafts)
    return [replace(draft, period=shortest) for draft in drafts], found, odd_units
