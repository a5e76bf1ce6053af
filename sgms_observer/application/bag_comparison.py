"""Compares a parameter file with a recording: rate, units, signs, sizes and lengths."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from sgms_observer.application.axis_facts import AxisFacts, read_axis_facts
from sgms_observer.application.bag_info import losses_in, unit_doubts, uses_of
from sgms_observer.bags.source import BagReader, find_inputs, missing_topic, survey_bag
from sgms_observer.errors import RecordingError
from sgms_observer.settings.axis import AxisSettings, Settings

MAX_RATE_ERROR = 0.1
"""Largest relative difference of the recorded period from sample_period; the delay of the filters differs by as
much."""
MAX_VALUE_RATIO = 10.0
"""Largest ratio of the file's mass or Coulomb force to the recording's: wear and load change less, a wrong unit
more."""
MAX_STROKE_RATIO = 1000.0
"""Largest ratio of the recorded range to that of the simulated reference: a millimetre instead of a metre."""
MAX_STEP_RATIO = 2.0
"""Largest ratio of the recorded encoder step to stage.encoder.resolution."""


@dataclass(frozen=True)
class Comparison:
    """Result of a comparison.

    Attributes:
        faults: one sentence for each fault.
        warnings: sentences about suspicious values.
        axes: the axes that were compared.
    """

    faults: tuple[str, ...]
    warnings: tuple[str, ...]
    axes: tuple[str, ...]


def compare(settings: Settings, bag: str, axes: Sequence[str], topics: Mapping[str, str]) -> Comparison:
    """Compare a parameter file with a recording.

    Args:
        settings: of the file.
        bag: the recording.
        axes: axes of the file to compare.
        topics: names of the bag's topics where they differ.

    Raises:
        RecordingError: the bag cannot be read at all.
    """
    surveys, warnings = survey_bag(bag)
    faults: list[str] = []
    with BagReader(bag) as reader:
        inputs = find_inputs(reader, topics)
        for key in dict.fromkeys(("position", "control_effort", *topics)):
            if inputs[key] is None:
                faults.append(str(missing_topic(reader, topics.get(key, key), key)))
    if inputs["position"] is None:
        return Comparison(tuple(faults), warnings, ())
    by_name = {survey.name: survey for survey in surveys}
    position, effort = by_name[inputs["position"]], by_name.get(inputs["control_effort"] or "")
    found = list(warnings)
    for axis in (axis for axis in settings.axes if axis.name in axes):
        if axis.name not in position.joints:
            held = ", ".join(position.joints) or "no joint"
            faults.append(f"{position.name} of {bag} holds {held}, not {axis.name}; name the axis as the bag does")
            continue
        try:
            facts = read_axis_facts(bag, axis, position, topics, effort=effort)
        except RecordingError as error:
            faults.append(str(error))
            continue
        faults += _faults(axis, facts, settings.sample_period)
        found += losses_in(facts)
        reasons = [(use.purpose, use.reason) for use in uses_of(facts) if use.reason not in ("", facts.effort_fault)]
        found += [f"{axis.name}: not for {purpose}: {reason}" for purpose, reason in reasons]
        found += [f"{axis.name}: {note}" for note in facts.notes]
    strange = [joint for joint in position.joints if joint not in {axis.name for axis in settings.axes}]
    if strange:
        found.append(f"{position.name} of {bag} also holds {', '.join(strange)}, which the file does not describe")
    return Comparison(tuple(dict.fromkeys(faults)), tuple(dict.fromkeys(found)), tuple(axes))


def _faults(axis: AxisSettings, facts: AxisFacts, period: float) -> Iterator[str]:
    """Yield a sentence for each thing that does not fit."""
    yield from _timing(axis, facts, period)
    if facts.effort_fault:
        yield f"{axis.name}: {facts.effort_fault}"
    yield from unit_doubts(facts, axis.joint_type)
    if facts.balance is not None and facts.balance.sign < 0:
        yield (
            f"{axis.name}.effort_scale = {axis.effort_scale:g} has the wrong sign: with it control_effort is reversed"
            f" relative to position; set it to {-axis.effort_scale:g}"
        )
    else:
        yield from _sizes(axis, facts)
    yield from _lengths(axis, facts)


def _timing(axis: AxisSettings, facts: AxisFacts, period: float) -> Iterator[str]:
    """Yield what the recording's rate contradicts."""
    if facts.period > 0.0 and abs(facts.period / period - 1.0) > MAX_RATE_ERROR:
        yield (
            f"sample_period = {period:.6g} s does not fit {axis.name}, which was recorded every {facts.period:.6g} s"
            f" ({facts.rate:.6g} Hz); set sample_period: {facts.period:.6g}"
        )


def _sizes(axis: AxisSettings, facts: AxisFacts) -> Iterator[str]:
    """Yield the file's mass and friction that are far from what the recording shows."""
    if facts.balance is None:
        return
    sources = (
        ("mass", "mass", axis.mass, axis.units.mass),
        ("friction.coulomb_force", "coulomb_force", axis.friction.coulomb_force, axis.units.effort),
    )
    for key, name, given, unit in sources:
        shown = facts.balance.value(name)
        if not facts.balance.is_significant(name) or shown <= 0.0:
            continue
        if max(given / shown, shown / given) > MAX_VALUE_RATIO:
            yield (
                f"{axis.name}.{key} = {given:.4g} {unit} does not fit the recording, which shows about {shown:.3g}"
                f" {unit}; correct it, or position_scale and effort_scale if the bag is in other units"
            )


def _lengths(axis: AxisSettings, facts: AxisFacts) -> Iterator[str]:
    """Yield the file's lengths that the recorded range or encoder contradicts."""
    from sgms_observer.effects import catalogue

    units, stroke = axis.units, facts.stroke
    if not stroke > 0.0:
        return
    readable_stroke = units.readable(stroke)
    friction = axis.friction
    deflection = max(
        share * friction.static_force / stiffness
        for share, stiffness in zip(friction.element_fraction, friction.element_stiffness, strict=True)
    )
    if deflection > stroke:
        yield (
            f"{axis.name}.friction.element_stiffness lets an element slip after {units.readable(deflection)}, further"
            f" than the motion of {readable_stroke}; raise the stiffness"
        )
    reference = axis.stage.reference
    simulated = 2.0 * reference.amplitude if reference.kind == "sine" else reference.amplitude
    has_stroke = reference.kind in ("sine", "point_to_point") and simulated > 0.0
    if has_stroke and max(stroke / simulated, simulated / stroke) > MAX_STROKE_RATIO:
        yield (
            f"{axis.name}.stage.reference spans {units.readable(simulated)}, the recording {readable_stroke}; correct"
            " position_scale, or the reference"
        )
    for effect in axis.effects:
        for parameter, value in zip(catalogue.effect(effect.name).parameters, effect.values, strict=True):
            if parameter.name == "pitch" and abs(value) > stroke:
                yield (
                    f"{axis.name}.effects.{effect.name}.pitch = {units.readable(abs(value))} is longer than the motion"
                    f" of {readable_stroke}; correct it, or record a longer motion"
                )
    resolution = axis.stage.encoder.resolution
    if resolution > 0.0 and facts.encoder_step > 0.0:
        ratio = max(resolution / facts.encoder_step, facts.encoder_step / resolution)
        if ratio > MAX_STEP_RATIO:
            yield (
                f"{axis.name}.stage.encoder.resolution = {units.readable(resolution)} does not fit the recording, whose"
                f" encoder steps {units.readable(facts.encoder_step)}; correct it, or position_scale"
            )
