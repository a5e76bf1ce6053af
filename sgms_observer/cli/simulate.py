"""``sgms simulate``: the simulated stage without a ROS graph, into a bag."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

from sgms_observer.cli.options import add_output_options, add_overwrite_option
from sgms_observer.outcome import Outcome

if TYPE_CHECKING:
    from sgms_observer.bags.writer import BagWriter
    from sgms_observer.observer.samples import Estimates, Floats, Samples
    from sgms_observer.settings.axis import AxisSettings, Settings
    from sgms_observer.settings.units import Scales
    from sim_plant.closed_loop import ObserverStep, TableObserver
    from sim_plant.record import StageRecord
    from sim_plant.table import SimulatedTable

    TableStep = Callable[[int], tuple[tuple[StageRecord, ...], tuple[Estimates, ...]]]

NAME = "simulate"
HELP = "run the simulated stage of a parameter file, faster than real time, into a bag"

START_NS = 1_000_000_000
"""Stamp of the first sample [ns]: fixed, so that the same command gives the same bag; not 0, which means no stamp."""

_SAMPLES_PER_BLOCK = 1024
_SETTLING = 0.5  # s at the start of a run of a second or more that no error counts in: stage and observer settle


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments, as ``registry.Command``."""
    parser.add_argument("--config", required=True, metavar="F", help="parameter file (YAML): the axes and their stage")
    parser.add_argument("--out", required=True, metavar="BAG", help="folder of the new bag")
    parser.add_argument(
        "--duration", type=_seconds, default=10.0, metavar="S", help="time to simulate [s] (default: 10)"
    )
    parser.add_argument(
        "--seed", type=_seed, metavar="N", help="seed of every random number, instead of each axis's stage.seed"
    )
    parser.add_argument(
        "--observe",
        action="store_true",
        help="run the observer in the loop as well: its compensation moves the stage, its topics go into the bag",
    )
    parser.add_argument(
        "--storage", choices=("mcap", "sqlite3"), default="mcap", help="storage of the bag (default: mcap)"
    )
    add_overwrite_option(parser)
    add_output_options(parser)


def run(args: argparse.Namespace) -> Outcome:
    """Do the job, as ``registry.Command``."""
    from sgms_observer.bags.replacement import refuse_existing_bag
    from sgms_observer.bags.writer import BagWriter
    from sgms_observer.cli.progress import Progress
    from sgms_observer.settings.load import load_settings
    from sim_plant.table import SimulatedTable

    refuse_existing_bag(args.out, args.overwrite)
    settings = load_settings(args.config)
    table = SimulatedTable(settings, START_NS, args.seed)
    scales = tuple(axis.scales for axis in settings.axes)
    step: TableStep = _observed(settings, table) if args.observe else lambda count: (table.step(count), ())
    count = max(1, round(args.duration / settings.sample_period))
    seeds = ", ".join(f"{stage.axis.name}: {stage.axis.stage.seed}" for stage in table.stages)
    duration = count * settings.sample_period
    print(f"simulating {count} samples of {', '.join(table.names)}, {duration:g} s; seeds {seeds}")
    other = _without_compensation(settings, args.seed) if args.observe else None
    settling = round(_SETTLING / settings.sample_period) if duration >= 1.0 else 0
    errors = _Errors(settings.axes, settling, other is not None)
    start = time.perf_counter()
    with (
        BagWriter(args.out, args.storage, is_overwriting=args.overwrite) as bag,
        Progress("simulate", count) as progress,
    ):
        done = 0
        while done < count:
            records, estimates = step(min(_SAMPLES_PER_BLOCK, count - done))
            _write_records(bag, table.names, scales, records)
            if estimates:
                _write_estimates(bag, table.names, estimates, done, settings.publish_every)
            errors.add(records, estimates, other.step(len(records[0])) if other else ())
            done += len(records[0])
            progress.show(done)
    seconds = time.perf_counter() - start
    for line in errors.lines():
        print(line)
    messages = sum(bag.counts.values())
    print(f"{args.out}: {messages} messages in {seconds:.1f} s, {duration / seconds:.1f} times real time")
    return Outcome(
        result={
            "schema": 1,
            "bag": args.out,
            "axes": list(table.names),
            "seeds": {stage.axis.name: stage.axis.stage.seed for stage in table.stages},
            "duration_s": duration,
            "samples": count,
            "messages": messages,
            "errors": errors.lines(),
        }
    )


def _observed(settings: Settings, table: SimulatedTable) -> TableStep:
    """Return the step of the table with one observer per axis in the loop."""
    from sgms_observer.observer.all_axes import AllAxes
    from sim_plant.closed_loop import ClosedLoop

    observers = AllAxes(settings.axes, settings.sample_period)
    scales = [axis.scales for axis in settings.axes]
    if observers.is_coupled:

        def together(blocks: Mapping[int, Samples]) -> Iterator[tuple[int, Estimates]]:
            return observers.step({i: block.in_topic_units(scales[i]).in_si(scales[i]) for i, block in blocks.items()})

        steps: TableObserver | list[ObserverStep] = together
    else:
        steps = [_observer(axis, one.step) for axis, one in zip(settings.axes, observers.observers, strict=True)]
    has_feedback = any(axis.compensation.enabled and axis.stage.accept_compensation for axis in settings.axes)
    return ClosedLoop(table, steps, has_feedback).step


def _observer(axis: AxisSettings, step: Callable[[Samples], Estimates]) -> Callable[[Samples], Estimates]:
    """Return an observer that sees an axis as the bag has it: in topic units, brought back to SI."""
    scales = axis.scales
    return step if scales.are_one else lambda samples: step(samples.in_topic_units(scales).in_si(scales))


def _without_compensation(settings: Settings, seed: int | None) -> SimulatedTable | None:
    """Return the same table for comparison, if the compensation reaches it at all."""
    from sim_plant.table import SimulatedTable

    if not any(axis.compensation.enabled and axis.stage.accept_compensation for axis in settings.axes):
        return None
    return SimulatedTable(settings, START_NS, seed)


def _write_records(
    bag: BagWriter, names: Sequence[str], scales: Sequence[Scales], records: Sequence[StageRecord]
) -> None:
    """Write what a real stage publishes, in topic units, and the truth in SI."""
    import numpy as np

    def columns(field: str, blocks: Sequence[StageRecord | Samples]) -> np.typing.NDArray[np.float64]:
        return np.column_stack([getattr(block, field) for block in blocks])

    stamp_ns = records[0].stamp_ns
    seen = [record.samples.in_topic_units(own) for record, own in zip(records, scales, strict=True)]
    # The reference first: a reader pairs position and effort as soon as it has both, and waits for no reference
    # that it has never heard of.
    bag.write_joint_states(
        "reference", stamp_ns, names,
        position=columns("reference_position", seen), velocity=columns("reference_velocity", seen),
    )  # fmt: skip
    bag.write_joint_states("position", stamp_ns, names, position=columns("position", seen))
    bag.write_joint_states("control_effort", stamp_ns, names, effort=columns("effort", seen))
    bag.write_joint_states(
        "friction_true", stamp_ns, names,
        position=columns("position", records), velocity=columns("velocity", records),
        effort=columns("friction", records),
    )  # fmt: skip


def _write_estimates(
    bag: BagWriter, names: Sequence[str], estimates: Sequence[Estimates], first: int, publish_every: int
) -> None:
    """Write every ``publish_every``-th estimate of the run; ``first`` is the number of the block's first sample."""
    from dataclasses import fields, replace

    from sgms_observer.bags.estimate_topics import write_estimates

    if publish_every > 1:
        kept = slice(-first % publish_every, None, publish_every)
        estimates = [
            replace(block, **{field.name: getattr(block, field.name)[kept] for field in fields(block)})
            for block in estimates
        ]
    write_estimates(bag, names, estimates)


class _Errors:
    """Tracking error and, with an observer, friction error of every axis; the first ``_SETTLING`` does not count.

    Args:
        axes: the axes.
        first: samples that do not count.
        has_other: whether the same stage without compensation runs beside it.
    """

    def __init__(self, axes: Sequence[AxisSettings], first: int, has_other: bool) -> None:
        self._axes = axes
        self._skip = first
        self._tracking = [_Size() for _ in axes]
        self._without = [_Size() for _ in axes] if has_other else []
        self._friction = [_Size() for _ in axes]

    def add(
        self, records: Sequence[StageRecord], estimates: Sequence[Estimates], others: Sequence[StageRecord]
    ) -> None:
        """Take in one block of every axis, and of every axis without compensation."""
        counts = slice(min(self._skip, len(records[0])), None)
        self._skip -= counts.start
        for sizes, blocks in ((self._tracking, records), (self._without, others)):
            for size, record in zip(sizes, blocks, strict=False):
                size.add((record.position - record.reference_position)[counts])
        for size, record, estimate in zip(self._friction, records, estimates, strict=False):
            size.add((record.friction - estimate.friction)[counts])

    def lines(self) -> list[str]:
        """Return one line per axis, for people."""
        lines = []
        for i, axis in enumerate(self._axes):
            size, other = self._tracking[i], self._without[i] if self._without else None
            readable = partial(axis.units.readable, largest=max(size.peak, other.peak if other else 0.0))
            line = f"{axis.name}: tracking error {readable(size.rms)} rms, {readable(size.peak)} peak"
            if other:
                line += (
                    f"; without compensation {readable(other.rms)} rms, {readable(other.peak)} peak:"
                    f" {_ratio(other.rms, size.rms)} and {_ratio(other.peak, size.peak)} times as large"
                )
            if self._friction[i].count:
                line += f"; friction estimate {self._friction[i].rms:.3g} {axis.units.effort} rms off the truth"
            lines.append(line)
        return lines


class _Size:
    """How large an error is: sum of squares and largest magnitude."""

    def __init__(self) -> None:
        self.count = 0
        self.peak = 0.0
        self._squares = 0.0

    def add(self, error: Floats) -> None:
        """Take in a block of errors."""
        self.count += len(error)
        self._squares += float(error @ error)
        self.peak = max(self.peak, float(abs(error).max(initial=0.0)))

    @property
    def rms(self) -> float:
        """Return the root mean square."""
        return math.sqrt(self._squares / max(1, self.count))


def _ratio(first: float, second: float) -> str:
    """Return how many times as large the first number is."""
    return f"{first / second:.1f}" if second > 0.0 else "inf"


def _seconds(text: str) -> float:
    """Return a duration, or say why it is none."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is no duration; give seconds above 0")
    return value


def _seed(text: str) -> int:
    """Return a seed, or say why it is none."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is no seed; give a whole number from 0 on")
    return value
