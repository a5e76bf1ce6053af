"""The page of a replay: whether the model fits, friction and compensation over time, and the recorded outputs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sgms_observer.arrays import Floats, Ints
from sgms_observer.errors import SgmsError
from sgms_observer.observer.outgoing import ESTIMATE
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.report.drawing import MAX_BREAKS, Line, Panel, extreme_rows, time_plot, with_breaks
from sgms_observer.report.page import BAD, GOOD, UNSURE, Light, Page, Plot, Section, Table
from sgms_observer.report.recorded import SETTLE, recorded_lateness, signal_of
from sgms_observer.report.run_pictures import Run, hysteresis_picture, reversal_picture
from sgms_observer.settings.axis import AxisSettings
from sgms_observer.status import MAX_NIS, Status

_MOST_ROWS = 60_000
"""Rows of the whole recording that are kept for the plot, about; each is the largest or smallest of its piece."""
_MOST_RECENT = 20_000
"""Rows of the last motion that are kept whole, for friction over velocity and position."""
_MOST_COMPARED = 2_000_000
"""Longest recording whose outputs are compared: they are read into memory [samples]."""
_MOVES = 0.2
"""A block shows motion where its largest velocity reaches this share of the largest one so far."""
_TRUTH = "friction_true"

TIME, POSITION, SET_POINT, VELOCITY, FRICTION, STD, COMPENSATION, INNOVATION = range(8)


class AxisView:
    """What a page shows of one axis, gathered block by block in a memory that does not grow with the recording.

    The recorder's clock is no time to count from: a stamp may be earlier or later than the receive time of its message.

    Args:
        axis: its settings.
        first_ns: stamp from which the time of all axes counts [ns].
        expected: samples that the recording holds, about.
    """

    def __init__(self, axis: AxisSettings, first_ns: int, expected: float) -> None:
        self.axis, self._first_ns = axis, first_ns
        self._last, self._breaks = 0.0, 0
        self._share = min(1.0, _MOST_ROWS / max(1.0, expected))
        self._kept: list[Floats] = []
        self._recent: list[Floats] = []
        self._fastest = 0.0
        self.samples = 0
        self.lowest, self.highest, self.largest_compensation = math.inf, -math.inf, 0.0
        self._squares, self._tracked, self.tracking_peak = 0.0, 0, 0.0

    def add(self, samples: Samples, estimates: Estimates) -> None:
        """Take in a block of samples and their estimates."""
        is_starting = estimates.status == Status.STARTING
        friction = np.where(is_starting, math.nan, estimates.friction)
        time = np.asarray((samples.stamp_ns - self._first_ns) * 1e-9, dtype=np.float64)
        columns = (samples.position, samples.reference_position, estimates.velocity, friction,
                   estimates.friction_std, estimates.compensation, estimates.innovation)  # fmt: skip
        self.samples += len(time)
        maximum_gap = self.axis.filter.maximum_gap if self._breaks < MAX_BREAKS else math.inf
        if self._kept and time[0] - self._last > maximum_gap:
            self._breaks += 1
            hole = np.full((1, 1 + len(columns)), math.nan)
            hole[0, TIME] = 0.5 * (self._last + time[0])
            self._kept.append(hole)
            self._recent.append(hole)
        self._last = float(time[-1])
        count = len(time)
        time, signals = with_breaks(time, columns, maximum_gap)
        self._breaks += len(time) - count
        block = np.stack([time, *signals], axis=1)
        most = max(1, round(self._share * len(time)))
        signals = [block[:, SET_POINT] - block[:, POSITION], *(block[:, k] for k in (FRICTION, INNOVATION))]
        self._kept.append(block[extreme_rows(signals, most)])
        self._keep_recent(block)
        self.lowest = min(self.lowest, float(np.nanmin(block[:, FRICTION], initial=math.inf)))
        self.highest = max(self.highest, float(np.nanmax(block[:, FRICTION], initial=-math.inf)))
        largest = float(np.nanmax(np.abs(block[:, COMPENSATION]), initial=0.0))
        self.largest_compensation = max(self.largest_compensation, largest)
        error = signals[0][np.isfinite(signals[0])]
        self._squares += float(np.sum(error**2))
        self._tracked += len(error)
        self.tracking_peak = max(self.tracking_peak, float(np.max(np.abs(error), initial=0.0)))

    @property
    def rows(self) -> Floats:
        """Return the kept rows of the whole recording, a column for each signal."""
        return np.concatenate(self._kept)

    @property
    def tracking_rms(self) -> float:
        """Return the rms tracking error [m]; NaN without a set-point."""
        return math.sqrt(self._squares / self._tracked) if self._tracked else math.nan

    def recent(self, truth: tuple[Ints, Floats] | None) -> Run:
        """Return the last motion, whole.

        Args:
            truth: stamps [ns] and true friction [N]; None if it is not known.
        """
        rows = np.concatenate(self._recent)
        unknown = np.full(len(rows), math.nan)
        true = unknown if truth is None else self._truth_at(rows, truth)
        return Run(rows[:, TIME], rows[:, POSITION], rows[:, VELOCITY], rows[:, SET_POINT], rows[:, FRICTION],
                   rows[:, STD], true, rows[:, COMPENSATION], self.axis.units)  # fmt: skip

    def truth_at_rows(self, truth: tuple[Ints, Floats]) -> Floats:
        """Return the true friction at the kept rows [N]; NaN where it is not known.

        Args:
            truth: stamps [ns] and true friction [N].
        """
        return self._truth_at(self.rows, truth)

    def _truth_at(self, rows: Floats, truth: tuple[Ints, Floats]) -> Floats:
        """Return the true friction at rows [N]; NaN where it is not known, and where a line breaks."""
        return np.where(np.isnan(rows[:, POSITION]), math.nan, _at(truth, self._stamps(rows)))

    def _stamps(self, rows: Floats) -> Ints:
        return self._first_ns + np.rint(rows[:, TIME] * 1e9).astype(np.int64)

    def _keep_recent(self, block: Floats) -> None:
        fastest = float(np.nanmax(np.abs(block[:, VELOCITY]), initial=0.0))
        self._fastest = max(self._fastest, fastest)
        if self._recent and fastest < _MOVES * self._fastest:
            return
        if self._recent and block[0, TIME] > self._recent[-1][-1, TIME] + 2.0 * (block[-1, TIME] - block[0, TIME]):
            hole = np.full((1, block.shape[1]), math.nan)
            hole[0, TIME] = self._recent[-1][-1, TIME]
            self._recent.append(hole)
        self._recent.append(block)
        while sum(map(len, self._recent[1:])) >= _MOST_RECENT:
            del self._recent[0]


@dataclass(frozen=True)
class Recorded:
    """The outputs that a recording holds of one axis, beside those of its replay.

    Attributes:
        compared: recorded estimates of the same stamps; 0 without any.
        same: those that the replay reproduces exactly.
        difference: rms of replayed minus recorded friction [N].
        late_share: share of the samples whose compensation came late; NaN if the recording does not tell.
        truth: stamps [ns] and true friction of a simulated recording [N]; None without.
        error: rms of estimated minus true friction after ``SETTLE`` [N]; NaN without the truth.
    """

    compared: int = 0
    same: int = 0
    difference: float = math.nan
    late_share: float = math.nan
    truth: tuple[Ints, Floats] | None = None
    error: float = math.nan


def recorded_outputs(view: AxisView, bag: Path, replayed: Path, sample_period: float) -> Recorded:
    """Return what the recording holds of the outputs of one axis, and of the truth.

    Args:
        view: the axis.
        bag: the recording.
        replayed: bag with the estimates of the replay.
        sample_period: time between two samples [s].
    """
    if view.samples > _MOST_COMPARED:
        return Recorded()
    name = view.axis.name
    stamps, again = signal_of(replayed, ESTIMATE, name)
    truth, error = _effort(bag, _TRUTH, name), math.nan
    if truth is not None:
        missed = again["effort"] - _at(truth, stamps)
        error = _rms(missed[np.isfinite(missed) & (stamps >= stamps[0] + SETTLE * 1e9)])
    before = _effort(bag, ESTIMATE, name)
    found = _at(before, stamps) if before is not None else np.full(len(stamps), math.nan)
    is_there = np.isfinite(found)
    compared, same = int(np.sum(is_there)), int(np.sum(found == again["effort"]))
    late = math.nan
    if 2 * same > compared:  # the same settings: then the look-ahead of the file is the one of the live run
        try:
            way = recorded_lateness(bag, view.axis, stamps, sample_period)
            late = float(np.mean(way.is_late)) if way.is_known else math.nan
        except SgmsError:
            pass  # it holds no compensation or no set-point
    return Recorded(compared, same, _rms(again["effort"][is_there] - found[is_there]), late, truth, error)


def _effort(bag: Path, topic: str, axis: str) -> tuple[Ints, Floats] | None:
    """Return stamps and efforts of a topic; None if the bag does not hold it."""
    try:
        stamps, fields = signal_of(bag, topic, axis)
    except SgmsError:
        return None
    return stamps, fields["effort"]


def _at(signal: tuple[Ints, Floats], stamps: Ints) -> Floats:
    """Return a signal at stamps; NaN where it has none."""
    place = np.minimum(np.searchsorted(signal[0], stamps), len(signal[0]) - 1)
    return np.where(signal[0][place] == stamps, signal[1][place], math.nan)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan


def replay_page(
    views: Sequence[AxisView],
    figures: Mapping[str, Mapping[str, float]],
    statuses: Mapping[str, Mapping[int, int]],
    recorded: Mapping[str, Recorded],
    warnings: Sequence[str],
    source: str,
) -> Page:
    """Return the page.

    Args:
        views: one for each axis.
        figures: name of each axis to its figures, as ``sgms replay --json`` prints them.
        statuses: name of each axis to the number of its samples in each status.
        recorded: name of each axis to its recorded outputs.
        warnings: sentences about the recording.
        source: what was replayed with what, for the footer.
    """
    names = [view.axis.name for view in views]
    of_axis = {name: f" of {name}" if len(names) > 1 else "" for name in names}
    verdicts: list[str] = []
    lights: list[Light] = []
    sections: list[Section] = []
    for view, name in zip(views, names, strict=True):
        verdicts.append(_verdict(view, figures[name], recorded[name]))
        lights += _lights(of_axis[name], figures[name], statuses[name], recorded[name])
        sections.append(_section(view, of_axis[name], figures[name], recorded[name]))
    title = f"Replay of {'axis' if len(names) == 1 else 'axes'} {', '.join(names)}"
    return Page(title, " ".join(verdicts), sections, source, [f"Warning: {text}." for text in warnings], lights)


def _verdict(view: AxisView, figures: Mapping[str, float], recorded: Recorded) -> str:
    """Return the outcome of one axis in a sentence or two."""
    if not figures["corrections"]:
        return f"The observer of {view.axis.name} made no correction, so the recording does not show whether it fits."
    unit, size = view.axis.units.effort, max(abs(view.lowest), abs(view.highest))
    word = "fits" if figures["nis"] <= MAX_NIS else "does not fit"
    share = f" ({100.0 * figures['innovation'] / size:.3g} % of the largest friction)" if 0.0 < size < math.inf else ""
    innovation = f"{figures['innovation']:.3g} {unit} rms{share}"
    verdict = f"The model of {view.axis.name} {word} the recording: it predicts the friction to {innovation}."
    if math.isfinite(recorded.error):
        verdict += f" The estimated friction is {recorded.error:.3g} {unit} rms from the simulated truth."
    return verdict


def _lights(
    of_axis: str, figures: Mapping[str, float], statuses: Mapping[int, int], recorded: Recorded
) -> Sequence[Light]:
    """Return the questions about one axis."""
    fits = figures["nis"] <= MAX_NIS
    answer = (
        f"NIS is {figures['nis']:.3g}; it is near 1 where the observer knows its own uncertainty, and below 1 where"
        " it expects larger innovations than it gets, which is harmless."
    )
    if not figures["corrections"]:
        answer = "No window of the filter has an effort at every position, so there is no NIS."
    elif not fits:
        answer += f" Above {MAX_NIS:g} the model lacks something (run sgms diagnose) or a parameter is wrong."
    found = [Light("Model", f"Does the model{of_axis} fit this recording?", GOOD if fits else BAD, answer)]
    trouble = {code: n for code, n in statuses.items() if code not in (Status.RUNNING, Status.STARTING)}
    sentences = "; ".join(f"{n} samples: {Status(code).sentence}" for code, n in sorted(trouble.items()))
    state = UNSURE if trouble else GOOD
    answer = f"{sentences}." if trouble else f"All {figures['samples']:.0f} samples were used."
    found.append(Light("Samples", f"Did the observer{of_axis} run on good samples throughout?", state, answer))
    if recorded.compared:
        is_same = recorded.same == recorded.compared
        answer = f"The replay reproduces {recorded.same} of {recorded.compared} recorded estimates exactly."
        if not is_same:
            answer += " The live observer had other parameters, began earlier, or received other samples."
        state = GOOD if is_same else UNSURE
        found.append(Light("Live run", f"Does the replay{of_axis} give what the live observer gave?", state, answer))
    if math.isfinite(recorded.late_share):
        answer = f"{100.0 * recorded.late_share:.3g} % of the samples got their compensation late."
        state = UNSURE if recorded.late_share else GOOD
        found.append(Light("Live run", f"Did every compensation{of_axis} come in time?", state, answer))
    return found


def _section(view: AxisView, of_axis: str, figures: Mapping[str, float], recorded: Recorded) -> Section:
    """Return the section of one axis."""
    name, last = view.axis.name, view.recent(recorded.truth)
    text = [
        "The observer ran over the recording as the live node does. The innovation is the measured minus the predicted"
        f" {view.axis.units.effort_word} of friction, at each correction."
    ]
    pictures = (hysteresis_picture(last, f"{name}_"), reversal_picture(last, f"{name}_"))
    tables, plots = [_table(view, figures, recorded)], [_over_time(view, recorded)]
    return Section(f"Friction and compensation{of_axis}", text, tables, pictures, plots)


def _table(view: AxisView, figures: Mapping[str, float], recorded: Recorded) -> Table:
    """Return the figures of one axis."""
    units, compensation = view.axis.units, view.axis.compensation
    unit = units.effort
    limit = f"limit {compensation.limit:g} {unit}" if compensation.enabled else "switched off in the file"
    rows = [
        ("friction", f"{view.lowest:.4g} to {view.highest:.4g} {unit}"),
        ("innovation, rms", f"{figures['innovation']:.4g} {unit}"),
        ("NIS", f"{figures['nis']:.3g}"),
        ("largest compensation", f"{view.largest_compensation:.4g} {unit} ({limit})"),
    ]
    if math.isfinite(view.tracking_rms):
        peak = view.tracking_peak
        sizes = [units.readable(size, largest=peak) for size in (view.tracking_rms, peak)]
        rows.append(("tracking error in the recording", f"{sizes[0]} rms, {sizes[1]} peak"))
    if math.isfinite(recorded.error):
        rows.append((f"estimated minus true friction after {SETTLE:g} s, rms", f"{recorded.error:.4g} {unit}"))
    if recorded.compared:
        rows.append(("replayed minus recorded friction, rms", f"{recorded.difference:.4g} {unit}"))
    if math.isfinite(recorded.late_share):
        rows.append(("samples with a late compensation", f"{100.0 * recorded.late_share:.3g} %"))
    rows.append(("samples, corrections", f"{figures['samples']:.0f}, {figures['corrections']:.0f}"))
    return Table(("figure", "value"), rows)


def _over_time(view: AxisView, recorded: Recorded) -> Plot:
    """Return the signals of one axis over time."""
    rows, units = view.rows, view.axis.units
    unit = units.effort
    band = 2.0 * rows[:, STD]
    friction = [
        Line("+2 sigma", rows[:, FRICTION] + band, "reference"),
        Line("-2 sigma", rows[:, FRICTION] - band, "soft"),
        *([] if recorded.truth is None else [Line("true", view.truth_at_rows(recorded.truth), "ink")]),
        Line("estimated", rows[:, FRICTION], "estimate"),
    ]
    panels = [
        Panel(f"friction [{unit}]", friction),
        Panel(f"innovation [{unit}]", [Line("measured - predicted", _held(rows[:, INNOVATION]), "measured")]),
    ]
    if view.largest_compensation > 0.0:
        panels.append(Panel(f"compensation [{unit}]", [Line("compensation", rows[:, COMPENSATION], "accent")]))
    factor, name = units.prefixed(float(np.nanmax(np.abs(rows[:, POSITION]), initial=0.0)))
    position = [Line("measured", factor * rows[:, POSITION], "measured")]
    if math.isfinite(view.tracking_rms):
        position.append(Line("set-point", factor * rows[:, SET_POINT], "reference"))
        error_factor, error_name = units.prefixed(view.tracking_peak)
        error = error_factor * (rows[:, POSITION] - rows[:, SET_POINT])
        panels.append(Panel(f"error [{error_name}]", [Line("position - set-point", error, "measured")]))
    panels.insert(0, Panel(f"position [{name}]", position))
    caption = "Measured motion, estimated friction with two standard deviations, and the error of its prediction."
    return time_plot(f"{view.axis.name}_replay", caption, rows[:, TIME], panels)


def _held(values: Floats) -> Floats:
    """Return values with those between two corrections held, so that a line can be drawn."""
    place = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), 0))
    return values[place]
