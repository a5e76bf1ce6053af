"""Runs the observer over a recording: reads, estimates and writes in parallel, and summarises each axis."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from sgms_observer.bags.writer import BagWriter
    from sgms_observer.observer.outgoing import Outgoing
    from sgms_observer.observer.samples import Estimates, Samples
    from sgms_observer.report.replayed import AxisView
    from sgms_observer.settings.axis import Settings

Given = TypeVar("Given")
_READ_AHEAD = 64  # blocks that are read in advance, some 7 MB: reading begins while kernels are loaded
_WAITING = 2  # blocks of estimates that wait to be written
_LOOK = 0.01  # s between two checks of a thread that is to end
_TURN = 5e-4  # s, Python's thread switch interval


@dataclass(frozen=True)
class Replayed:
    """Result of a replay.

    Attributes:
        tallies: statistics of each axis by its name.
        warnings: sentences about the recording.
        messages: messages written.
        duration: time from the first message of the recording to the last [s].
        views: pictures and tables of each axis for the page; empty without a page.
        settings: settings of the observer.
    """

    tallies: dict[str, Tally]
    warnings: tuple[str, ...]
    messages: int
    duration: float
    views: tuple[AxisView, ...]
    settings: Settings

    @property
    def is_usable(self) -> bool:
        """Return whether the observer of every axis made a correction; without one nothing was estimated."""
        return all(tally.corrections for tally in self.tallies.values())

    def as_json(self, bag: str, report: str | None) -> dict[str, object]:
        """Return the result that ``--json`` prints: the new bag, and the page if there is one."""
        axes = {name: tally.figures() for name, tally in self.tallies.items()}
        return {
            "schema": 1,
            "bag": bag,
            "report": report,
            "messages": self.messages,
            "duration_s": self.duration,
            "axes": axes,
            "warnings": list(self.warnings),
        }


def replay_bag(
    bag: str,
    config: str,
    out: str,
    storage: str,
    topics: Mapping[str, str],
    show: Callable[[float], None],
    *,
    axes: Sequence[str] | None = None,
    is_overwriting: bool = False,
    has_report: bool = False,
) -> Replayed:
    """Run the observer over a recording and write what the node would publish.

    Args:
        bag: the recording.
        config: parameter file.
        out: folder of the new bag.
        storage: ``mcap`` or ``sqlite3``.
        topics: names of the input topics where they differ.
        show: called with the completed share, 0 to 1.
        axes: axes of the file to observe; None for all.
        is_overwriting: replace a bag that is there.
        has_report: collect the data of ``write_report``.

    Raises:
        SgmsError: a file cannot be read, written or used.
    """
    from dataclasses import replace

    from sgms_observer.bags.bag_folder import refuse_existing_bag, refuse_own_recording
    from sgms_observer.bags.reader import BagSamples
    from sgms_observer.bags.writer import BagWriter
    from sgms_observer.settings.load import load_settings
    from sgms_observer.settings.node_parameters import refuse_missing
    from sgms_observer.status import MAX_NIS

    refuse_own_recording(out, [bag])
    refuse_existing_bag(out, is_overwriting)
    settings = load_settings(config)
    wanted = settings.wanted_axes(axes or (), config)
    refuse_missing(settings, wanted)
    settings = replace(settings, axes=tuple(axis for axis in settings.axes if axis in wanted))
    names = [axis.name for axis in settings.axes]
    source = BagSamples(bag, settings.scales, settings.sample_period, topics=topics)
    source.refuse_unknown_axes()
    first, last = source.span_ns
    tallies = {axis.name: Tally(axis.units.effort) for axis in settings.axes}
    views: tuple[AxisView, ...] = ()
    if has_report:
        from sgms_observer.report.replayed import AxisView

        expected = (last - first) * 1e-9 / settings.sample_period
    with _short_turns(), in_own_thread(_blocks_of_all_axes(source, names), _READ_AHEAD) as samples:
        from sgms_observer.observer.all_axes import AllAxes
        from sgms_observer.observer.outgoing import Outgoing

        observers = AllAxes(settings.axes, settings.sample_period)
        outgoing = Outgoing(settings)
        observed = ((block, observers.step(block)) for block in samples)
        writer = BagWriter(out, storage, is_overwriting=is_overwriting)
        with writer as written, in_own_thread(observed, _WAITING) as blocks:
            for block, estimates in blocks:
                if has_report and not views:
                    begin = min(int(samples_of_axis.stamp_ns[0]) for samples_of_axis in block.values())
                    views = tuple(AxisView(axis, begin, expected) for axis in settings.axes)
                for number, estimate in estimates.items():
                    tallies[names[number]].add(estimate)
                    if views:
                        views[number].add(block[number], estimate)
                _write(written, outgoing, estimates)
                latest = max(int(estimate.stamp_ns[-1]) for estimate in estimates.values())
                show((latest - first) / max(1, last - first))
    messages = sum(written.counts.values())
    warnings = list(source.warnings)
    for name, tally in tallies.items():
        if not tally.corrections:
            warnings.append(
                f"{name}: the observer made no correction, because no window of its filter has a control_effort at"
                " every position; record both topics at one rate and with the same stamps"
            )
        elif (nis := tally.figures()["nis"]) > MAX_NIS:
            warnings.append(
                f"{name}: NIS {nis:.4g} is above {MAX_NIS:g}: the model lacks something or a parameter is wrong;"
                " run sgms diagnose"
            )
    return Replayed(tallies, tuple(warnings), messages, (last - first) * 1e-9, views, settings)


def write_report(done: Replayed, bag: str, config: str, out: str) -> str:
    """Write the page about a replay into the folder of its bag and return its path."""
    from pathlib import Path

    from sgms_observer.bags.bag_folder import REPORT
    from sgms_observer.report.page import render_page
    from sgms_observer.report.replayed import recorded_outputs, replay_page
    from sgms_observer.whole_file import write_text

    period = done.settings.sample_period
    recorded = {view.axis.name: recorded_outputs(view, Path(bag), Path(out), period) for view in done.views}
    figures = {name: tally.figures() for name, tally in done.tallies.items()}
    statuses = {name: tally.statuses for name, tally in done.tallies.items()}
    source = f"{Path(bag).name}, replayed with {Path(config).name}."
    path = Path(out) / REPORT
    write_text(render_page(replay_page(done.views, figures, statuses, recorded, done.warnings, source)), path)
    return str(path)


def _blocks_of_all_axes(source: Iterable[tuple[str, Samples]], names: Sequence[str]) -> Iterator[dict[int, Samples]]:
    """Gather blocks of the axes that came together, so that axes with the same stamps share their messages."""
    gathered: dict[int, Samples] = {}
    for name, samples in source:
        number = names.index(name)
        if number in gathered:
            yield gathered
            gathered = {}
        gathered[number] = samples
    if gathered:
        yield gathered


@contextmanager
def _short_turns() -> Iterator[None]:
    """Shorten Python's thread switch interval (5 ms): the code between two kernels takes less time."""
    usual = sys.getswitchinterval()
    sys.setswitchinterval(_TURN)
    try:
        yield
    finally:
        sys.setswitchinterval(usual)


@contextmanager
def in_own_thread(given: Iterable[Given], most: int) -> Iterator[Iterator[Given]]:
    """Yield the items, in order, which a second thread makes; it begins at once and ends with the block.

    Kernels, numpy and file access release Python's lock, so that reading, estimating and writing use several cores. The
    memory does not depend on the length of the bag. An error of the thread is raised where its items are taken.

    Args:
        given: makes the items.
        most: largest number of waiting items.
    """
    from queue import Queue
    from threading import Event, Thread

    waiting: Queue[tuple[Given | None, BaseException | None]] = Queue(most)
    is_over = Event()

    def make() -> None:
        try:
            for item in given:
                waiting.put((item, None))
                if is_over.is_set():
                    return
        except BaseException as error:
            waiting.put((None, error))
        else:
            waiting.put((None, None))

    def made() -> Iterator[Given]:
        while True:
            item, error = waiting.get()
            if error is not None:
                raise error
            if item is None:
                return
            yield item

    thread = Thread(target=make, name="replay", daemon=True)
    thread.start()
    try:
        yield made()
    finally:
        is_over.set()
        while thread.is_alive():
            while not waiting.empty():
                waiting.get()
            thread.join(_LOOK)


def _write(bag: BagWriter, outgoing: Outgoing, estimates: dict[int, Estimates]) -> None:
    """Write what the node would publish."""
    from sgms_observer.bags.diagnostics_cdr import encode_diagnostics, parameter_entry
    from sgms_observer.observer.outgoing import PARAMETERS

    for block in outgoing.blocks(estimates):
        position, velocity, effort = (block.values.get(field) for field in ("position", "velocity", "effort"))
        bag.write_joint_states(
            block.topic, block.stamp_ns, block.names, position=position, velocity=velocity, effort=effort
        )
    for report in outgoing.reports(estimates):
        message = encode_diagnostics(report.stamp_ns, [parameter_entry(report)])
        bag.write(PARAMETERS, "diagnostic_msgs/msg/DiagnosticArray", report.stamp_ns, message)


class Tally:
    """Statistics of one axis: innovations and statuses.

    Args:
        unit: of the axis's effort.

    Attributes:
        corrections: number of corrections.
        statuses: number of samples in each status.
    """

    def __init__(self, unit: str) -> None:
        self.unit = unit
        self.corrections = 0
        self._samples = 0
        self._squares = 0.0
        self._nis = 0.0
        self.statuses: dict[int, int] = {}

    def add(self, estimates: Estimates) -> None:
        """Count a block of estimates."""
        import numpy as np

        is_corrected = np.isfinite(estimates.innovation)
        innovation = estimates.innovation[is_corrected]
        self._samples += len(is_corrected)
        self.corrections += len(innovation)
        self._squares += float(np.sum(innovation**2))
        self._nis += float(np.sum((innovation / estimates.innovation_std[is_corrected]) ** 2))
        for status, count in zip(*np.unique(estimates.status, return_counts=True), strict=True):
            self.statuses[int(status)] = self.statuses.get(int(status), 0) + int(count)

    def figures(self) -> dict[str, float]:
        """Return samples, corrections, innovation (rms, in ``unit``), NIS and the number of bad samples.

        Innovation and NIS are NaN without a correction.
        """
        from sgms_observer.status import Status

        corrections = self.corrections or float("nan")
        return {
            "samples": self._samples,
            "corrections": self.corrections,
            "innovation": (self._squares / corrections) ** 0.5,
            "nis": self._nis / corrections,
            "in_trouble": sum(
                count for code, count in self.statuses.items() if code not in (Status.RUNNING, Status.STARTING)
            ),
        }

    def sentence(self) -> str:
        """Return the axis's sentence."""
        from sgms_observer.status import Status

        figures = self.figures()
        parts = [f"{figures['samples']} samples, {figures['corrections']} corrections"]
        if self.corrections:
            parts[0] += f", innovation {figures['innovation']:.4g} {self.unit} rms, NIS {figures['nis']:.3g}"
        for status in Status:
            if status not in (Status.RUNNING, Status.STARTING) and self.statuses.get(status):
                parts.append(f"{self.statuses[status]} samples: {status.sentence}")
        return "; ".join(parts)
