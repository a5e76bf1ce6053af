"""Designs a reference within the limits of a table, with the most information about the asked quantities."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.errors import ConfigurationError
from sgms_observer.excitation.design import Choice, Design, spread_evenly
from sgms_observer.excitation.goals import Goals, goals_of
from sgms_observer.excitation.limits import ExcitationLimits, Track
from sgms_observer.excitation.question import Question
from sgms_observer.excitation.segments import Place, Segment, library, velocity_of
from sgms_observer.settings.axis import AxisSettings

DURATION = 60.0
"""Default duration of a reference [s]: enough for the default question on a table of some centimetres."""
MAX_RATE = 1.0e5
"""Highest rate of the set-points [Hz]."""
MAX_DURATION = 86_400.0
"""Longest reference [s]: a day."""
MIN_DURATION = 8.0
"""Shortest reference [s]: it has room for a band and two of the slower segments."""
_DESIGN_PERIOD = 1.0e-3  # s; segments are compared at this rate at most
_REST = 0.5  # s at rest at the beginning and at the end
_QUANTILE = 1.96  # standard deviations in half a 95 % interval
_NOT_RELATIVE = ("offset", "delay")  # parameters whose interval is absolute, not a share of their value
_SHOWN = 3  # largest number of quantities that a section is labelled with


class HiddenError(ConfigurationError):
    """None of the asked quantities is detectable within the limits."""


@dataclass(frozen=True)
class Section:
    """One part of a reference.

    Attributes:
        name: of the motion.
        start: when it begins [s].
        end: when it ends [s].
        shows: quantities that lose most information without parts of this kind.
        kind: of the motion.
    """

    name: str
    start: float
    end: float
    shows: str
    kind: str


@dataclass(frozen=True)
class Excitation:
    """A reference that begins and ends at rest at the position of the table.

    Attributes:
        time: [s], shape (n,).
        position: [m], shape (n,).
        velocity: [m/s], shape (n,).
        sections: its parts.
        expected: half the 95 % interval of each parameter over its value that is expected if the file is right [-];
            empty where parameters were not asked for.
        efficiency: by effect: information that it brings, over that of the best single kind of motion [-].
        hidden: asked effects that are not detectable within the limits.
        inseparable: asked effects that are detectable, but that no reference within the limits separates from similar
            effects.
        summary: sentences about range, peaks, duration and content.
        warnings: sentences about effects that are not detectable or stay ambiguous.
    """

    time: Floats
    position: Floats
    velocity: Floats
    sections: tuple[Section, ...]
    expected: dict[str, float]
    efficiency: dict[str, float]
    hidden: tuple[str, ...]
    inseparable: tuple[str, ...]
    summary: tuple[str, ...]
    warnings: tuple[str, ...]

    @property
    def peak_speed(self) -> float:
        """Largest speed [m/s]."""
        return float(np.max(np.abs(self.velocity)))

    @property
    def peak_acceleration(self) -> float:
        """Largest acceleration between two samples [m/s^2]."""
        return float(np.max(np.abs(np.diff(self.velocity) / np.diff(self.time))))


def design_excitation(
    axis: AxisSettings,
    limits: ExcitationLimits,
    asked: Sequence[str] = (),
    start: float = 0.0,
    seconds: float = DURATION,
    rate: float = 1000.0,
    centre: float | None = None,
    report: Callable[[float], None] = lambda share: None,
) -> Excitation:
    """Return the reference, among sequences of simple motions, with the most information about the asked quantities.

    Args:
        axis: settings; the design assumes their friction, effects and noise, and contacts that differ from them.
        limits: what the table may do.
        asked: ``identify``, ``diagnose`` or names of effects; empty for identify and diagnose together.
        start: position of the table; the reference begins and ends there at rest [m].
        seconds: longest duration [s].
        rate: samples per second of the reference [Hz].
        centre: middle of the window of ``limits.stroke`` [m]; None for ``start``.
        report: called with the completed share.

    Raises:
        HiddenError: none of the asked quantities is detectable within the limits.
        ConfigurationError: the question is not valid, the start is outside the window, or the time is too short.
    """
    question = Question.of(asked, axis)
    middle = start if centre is None else centre
    readable = limits.units.readable
    faults = []
    if not (math.isfinite(rate) and rate >= 20.0):
        faults.append(f"rate = {rate:g} Hz must be at least 20 Hz; give the rate of the set-points")
    elif rate > MAX_RATE:
        faults.append(f"rate = {rate:g} Hz is too high for set-points; give {MAX_RATE:g} Hz at most")
    if not seconds >= MIN_DURATION:
        faults.append(f"duration = {seconds:g} s is too short for a recording; allow {MIN_DURATION:g} s or more")
    elif seconds > MAX_DURATION:
        faults.append(f"duration = {seconds:g} s is too long for a recording; give {MAX_DURATION:g} s at most")
    if abs(start - middle) > 0.5 * limits.stroke * (1.0 + 1.0e-9):
        faults.append(
            f"the table stands at {readable(start)}, outside of the window of {readable(limits.stroke)} around"
            f" {readable(middle)}; move it there, or give --stroke and --centre that hold it"
        )
    if faults:
        raise ConfigurationError(faults)
    place = Place.of(axis, limits, start, middle)
    period = max(1.0 / rate, _DESIGN_PERIOD)
    left = seconds - _around(place, limits, period, start, []).samples * period
    segments = library(place, limits, period, left)
    if not segments:
        raise ConfigurationError([f"duration = {seconds:g} s is too short within these limits; allow more time"])
    goals = goals_of(question, axis, limits, place, segments, period, left, report)
    if not goals.goals:
        raise HiddenError(
            [f"{', '.join(question.effects)} cannot be shown within these limits; allow more stroke, speed or time"]
        )
    durations = np.array([len(velocity) * period for _segment, velocity in segments])
    design = Design(goals.goals, durations, left)
    choice = design.choose()
    order = [segments[number][0] for number in spread_evenly(choice.counts)]
    track = _around(place, limits, 1.0 / rate, start, order)
    while order and track.samples / rate > seconds:  # rounding of ramps to other samples
        order.pop()
        track = _around(place, limits, 1.0 / rate, start, order)
    velocity = np.concatenate([np.zeros(1), track.motion()])
    position = start + np.cumsum(velocity) / rate
    expected, efficiency = _expected(goals, choice), _efficiency(goals, choice)
    shows = _shows(design, choice)
    sections = _sections(order, {segments[k][0].name: text for k, text in shows.items()}, place, limits, rate, start)
    return Excitation(
        np.arange(len(velocity)) / rate, position, velocity, sections, expected, efficiency, goals.hidden,
        goals.inseparable,
        _summary(axis, limits, position, velocity, rate, sections, expected, efficiency),
        _warnings(axis, question, goals),
    )  # fmt: skip


def _around(place: Place, limits: ExcitationLimits, period: float, start: float, order: Sequence[Segment]) -> Track:
    """Return the move from the start to home, the segments, and the move back."""
    track = Track(period, limits, place.low, place.high, start)
    track.dwell(_REST)
    track.move(place.home - place.approach, math.inf)
    track.move(place.home, math.inf)
    track.dwell(_REST)
    for segment in order:
        track.append(velocity_of(segment, place, limits, period))
    track.move(start, math.inf)
    track.dwell(_REST)
    return track


def _expected(goals: Goals, choice: Choice) -> dict[str, float]:
    """Return the expected interval of each parameter that is known relative to its value, if the file is right."""
    for goal in goals.goals:
        if not goal.is_smallest:
            left = goal.left(choice.counts.astype(float)).tolist()
            return {
                name: _QUANTILE / math.sqrt(value)
                for name, value in zip(goal.names, left, strict=True)
                if name not in _NOT_RELATIVE
            }
    return {}


def _efficiency(goals: Goals, choice: Choice) -> dict[str, float]:
    """Return the smallest efficiency of each effect."""
    out: dict[str, float] = {}
    for goal, values in zip(goals.goals, choice.efficiency, strict=True):
        if goal.is_smallest:
            for name, value in zip(goal.names, values.tolist(), strict=True):
                out[name] = min(value, out.get(name, math.inf))
    return out


def _shows(design: Design, choice: Choice) -> dict[int, str]:
    """Return for each segment the quantities that lose most information without it."""
    out = {}
    for number in np.flatnonzero(choice.counts).tolist():
        without = choice.counts.astype(float)
        without[number] = 0.0
        lost: dict[str, float] = {}
        for goal, best, now in zip(design.goals, design.best, choice.efficiency, strict=True):
            rest = goal.left(without) / best / now
            for label, share in zip(goal.names, rest.tolist(), strict=True):
                lost[label] = min(share, lost.get(label, 1.0))
        out[number] = ", ".join(sorted(lost, key=lambda label: lost[label])[:_SHOWN])
    return out


def _sections(
    order: Sequence[Segment], shows: dict[str, str], place: Place, limits: ExcitationLimits, rate: float, start: float
) -> tuple[Section, ...]:
    """Return the parts of the reference."""
    track = _around(place, limits, 1.0 / rate, start, [])
    home = Track(1.0 / rate, limits, place.low, place.high, start)
    home.dwell(_REST)
    home.move(place.home - place.approach, math.inf)
    home.move(place.home, math.inf)
    home.dwell(_REST)
    samples = home.samples
    out = [Section("rest and move to the first segment", 0.0, samples / rate, "noise", "rest")]
    for segment in order:
        end = samples + len(velocity_of(segment, place, limits, 1.0 / rate))
        text = shows.get(segment.name, "")
        out.append(Section(f"{segment.kind}: {segment.name}", samples / rate, end / rate, text, segment.kind))
        samples = end
    end = samples + track.samples - home.samples
    return (*out, Section("move back and rest", samples / rate, end / rate, "noise", "rest"))


def _summary(
    axis: AxisSettings, limits: ExcitationLimits, position: Floats, velocity: Floats, rate: float,
    sections: Sequence[Section], expected: dict[str, float], efficiency: dict[str, float],
) -> tuple[str, ...]:  # fmt: skip
    """Return sentences about range, peaks, duration and content."""
    readable = limits.units.readable
    ends = float(position.min()), float(position.max()), float(position[0])
    low, high, start = limits.units.readable_positions(*ends)
    fastest, hardest = float(np.max(np.abs(velocity))), float(np.max(np.abs(np.diff(velocity)))) * rate
    seconds: dict[str, float] = {}
    for section in sections:
        seconds[section.kind] = seconds.get(section.kind, 0.0) + section.end - section.start
    content = ", ".join(f"{kind} {time:.1f} s" for kind, time in sorted(seconds.items(), key=lambda item: -item[1]))
    lines = [
        f"{axis.name}: from {low} to {high}, starting and ending at {start}, at most {readable(fastest, 'm/s')} and"
        f" {readable(hardest, 'm/s^2')}, {(len(position) - 1) / rate:.2f} s",
        f"{axis.name}: {content}",
    ]
    if expected:
        widest = sorted(expected, key=lambda name: -expected[name])[:_SHOWN]
        lines.append(
            f"{axis.name}: expected 95 % intervals if the file is right: mass +- {_percent(expected['mass'])}, least"
            f" known {', '.join(f'{name} +- {_percent(expected[name])}' for name in widest)}"
        )
    if efficiency:
        least = sorted(efficiency, key=lambda name: efficiency[name])[:_SHOWN]
        lines.append(
            f"{axis.name}: least information about effects: "
            + ", ".join(f"{name} ({_percent(efficiency[name])})" for name in least)
            + " of what the best single kind of motion would bring in the same time"
        )
    return tuple(lines)


def _warnings(axis: AxisSettings, question: Question, goals: Goals) -> tuple[str, ...]:
    """Return sentences about effects that are not detectable or stay ambiguous."""
    warnings = []
    if goals.hidden:
        warnings.append(
            f"{axis.name}: no motion within these limits separates {', '.join(goals.hidden)} from the"
            " parameters and the other effects of the file; allow more stroke, speed or time."
        )
    if goals.inseparable and not question.is_everything:
        warnings.append(
            f"{axis.name}: no motion within these limits separates {', '.join(goals.inseparable)} from"
            " similar effects; allow more stroke, speed or time."
        )
    return tuple(warnings)


def _percent(share: float) -> str:
    """Return a share in percent with two digits, 110 % and not 1.1e+02 %."""
    return f"{float(f'{100.0 * share:.2g}'):g} %"
