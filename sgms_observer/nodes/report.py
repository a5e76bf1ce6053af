"""The observer node's ``/diagnostics``, as entries of a DiagnosticArray. No ROS in here."""

from __future__ import annotations

import math
from collections.abc import Sequence

from sgms_observer.bags.diagnostics_cdr import ERROR, OK, WARN, DiagnosticStatus
from sgms_observer.nodes.engine import Engine
from sgms_observer.nodes.intake import IntakeCounts
from sgms_observer.nodes.statistics import AxisStatistics, Growth, StepTimes
from sgms_observer.observer.pairing import PairingCounts
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.status import MAX_LIVE_NIS, Status

HIGH_NIS = "innovations are larger than the model expects; raise measurement_std or identify the model anew"
NO_SAMPLES = "no samples arrive; check that position and control_effort are published and remapped"
_LEVELS = {Status.RUNNING: OK, Status.STARTING: OK}


def _number(value: float) -> str:
    """Return a number as text, six digits of it."""
    return f"{value:.6g}"


def axis_entry(
    name: str,
    axis: str,
    statistics: AxisStatistics,
    counts: PairingCounts,
    new: PairingCounts,
    seconds: float,
) -> DiagnosticStatus:
    """Return the diagnostics of one axis.

    Args:
        name: the node's full name.
        axis: the axis's name.
        statistics: results of the estimator since the last report.
        counts: counts of the axis's messages since the start.
        new: the same since the last report.
        seconds: time since the last report [s].
    """
    level = _LEVELS.get(statistics.worst, WARN)
    sentence = statistics.worst.sentence
    state = statistics.latest.name.lower()
    if statistics.samples == 0:
        level, sentence = ERROR if statistics.total else WARN, NO_SAMPLES
        state = "without samples" if statistics.total else state
    elif level == OK and statistics.nis > MAX_LIVE_NIS:
        level, sentence = WARN, HIGH_NIS
    troubles = new.sentences()
    if troubles and (level == OK or sentence == NO_SAMPLES):
        level, sentence = max(level, WARN), troubles[0]
    dropped = counts.late + counts.duplicates + counts.invalid
    values = {
        "state": state,
        "rate [Hz]": _number(statistics.samples / seconds if seconds > 0.0 else math.nan),
        "samples": str(statistics.total),
        "dropped": str(dropped),
        "rejected": str(statistics.rejected),
        "without effort": str(counts.missing_efforts),
        "unmatched efforts": str(counts.unmatched_efforts),
        "unmatched references": str(counts.unmatched_references),
        "clock resets": str(counts.clock_resets),
        "NIS": _number(statistics.nis),
        **{f"samples {status.name.lower()}": str(count) for status, count in sorted(statistics.totals.items())},
    }
    return DiagnosticStatus(level, f"{name}: axis {axis}", sentence, axis, tuple(values.items()))


def _axis_sentences(entry: DiagnosticStatus, statistics: AxisStatistics, new: PairingCounts) -> list[str]:
    """Return the sentences about an axis for the log, each once."""
    troubles = [status.sentence for status in sorted(statistics.recent) if _LEVELS.get(status, WARN) != OK]
    troubles += [HIGH_NIS] if statistics.nis > MAX_LIVE_NIS else []
    messages = [entry.message] if entry.level != OK else []
    return list(dict.fromkeys([*new.sentences(), *troubles, *messages]))


def scale_sentences(axes: Sequence[AxisSettings]) -> list[str]:
    """Return a sentence for each axis whose compensation has other units than its control_effort.

    Args:
        axes: the axes with their present settings.
    """
    return [
        f"axis {axis.name}: friction_compensation is in {axis.units.effort} and control_effort is not; divide it by"
        f" effort_scale = {axis.effort_scale:g} where it is added to the controller's output"
        for axis in axes
        if axis.compensation.enabled and axis.effort_scale != 1.0
    ]


def node_entry(
    name: str,
    axes: Sequence[str],
    state: str,
    counts: IntakeCounts,
    new: IntakeCounts,
    times: StepTimes,
    deadline_misses: int,
    seconds: float,
    faults: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> DiagnosticStatus:
    """Return the diagnostics of the node.

    Args:
        name: the node's full name.
        axes: names of the axes.
        state: lifecycle state.
        counts: counts of the messages of all axes since the start.
        new: the same since the last report.
        times: computing times of the steps.
        deadline_misses: steps that took longer than their samples lasted, since the start.
        seconds: time since the last report [s].
        faults: sentences about what keeps the node from its work.
        remarks: sentences about what disturbs it.
    """
    sentences = [*faults, *remarks, *new.sentences(axes)]
    values = {
        "state": state,
        "messages": str(counts.messages),
        "malformed": str(counts.malformed),
        "foreign": str(counts.foreign),
        "short": str(counts.short),
        "repeated names": str(counts.repeated_names),
        "compensations too late": str(counts.too_late),
        "step time p50 [us]": _number(times.median * 1e6),
        "step time p99 [us]": _number(times.p99 * 1e6),
        "step time max [us]": _number(times.longest * 1e6),
        "samples per step": _number(times.samples_per_step),
        "deadline misses": str(deadline_misses),
        "period [s]": _number(seconds),
    }
    level = ERROR if faults else WARN if sentences else OK
    sentence = sentences[0] if sentences else f"the node is {state}"
    return DiagnosticStatus(level, name, sentence, "", tuple(values.items()))


class Report:
    """Reports on an engine, each time about the period since the last report."""

    def __init__(self) -> None:
        self._growth = Growth()

    def take(
        self, name: str, engine: Engine, seconds: float, faults: Sequence[str], remarks: Sequence[str]
    ) -> tuple[list[DiagnosticStatus], list[str]]:
        """Return the entries about the time since the last call, and the sentences for the log.

        Args:
            name: the active node's full name.
            engine: of the node; the statistics of its axes are reset.
            seconds: time since the last call [s].
            faults: sentences about what keeps the node from its work.
            remarks: sentences about what disturbs it.
        """
        counts, clock = engine.intake.counts, engine.clock
        new = self._growth.take("messages", counts)
        entries = [
            node_entry(
                *(name, engine.axes, "active", counts, new, clock.take(), clock.deadline_misses, seconds),
                *(faults, remarks),
            )
        ]
        sentences = [*faults, *remarks, *new.sentences(engine.axes)]
        for axis, statistics, pairing in zip(engine.axes, engine.statistics, engine.intake.pairings, strict=True):
            grown = self._growth.take(axis, pairing.counts)
            entry = axis_entry(name, axis, statistics, pairing.counts, grown, seconds)
            entries.append(entry)
            sentences += [f"axis {axis}: {sentence}" for sentence in _axis_sentences(entry, statistics, grown)]
            statistics.start_anew()
        return entries, sentences
