"""Simulates the stage into a bag, with or without the observer in its loop, and summarises the errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.bags.writer import BagWriter
from sgms_observer.observer.all_axes import AllAxes
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.units import Scales
from sim_plant.closed_loop import ClosedLoop, ObserverStep, TableObserver
from sim_plant.record import StageRecord
from sim_plant.table import SimulatedTable

TableStep = Callable[[int], tuple[tuple[StageRecord, ...], tuple[Estimates, ...]]]

START_NS = 1_000_000_000
"""Stamp of the first sample [ns]: fixed, so that the same command gives the same bag; not 0, which means no stamp."""

_SAMPLES_PER_BLOCK = 1024
_SETTLING = 0.5  # s at the start that the errors leave out in a run of a second or more: stage and observer settle


class Simulation:
    """A table before its simulation.

    Args:
        settings: the axes and their stages.
        seconds: time to simulate [s].
        seed: of every random number; None for the seeds of the axes.
        is_observed: run the observer in the loop as well.

    Attributes:
        count: samples.
        duration: their time [s].
        seeds: name of each axis to its seed.
    """

    def __init__(self, settings: Settings, seconds: float, seed: int | None, is_observed: bool) -> None:
        self.settings = settings
        self.table = SimulatedTable(settings, START_NS, seed)
        self.count = max(1, round(seconds / settings.sample_period))
        self.duration = self.count * settings.sample_period
        self.seeds = {stage.axis.name: stage.axis.stage.seed for stage in self.table.stages}
        self.other = _without_compensation(settings, seed) if is_observed else None
        self.is_observed = is_observed


@dataclass(frozen=True)
class Simulated:
    """Result of a simulation.

    Attributes:
        messages: messages written.
        errors: a sentence for each axis.
    """

    messages: int
    errors: tuple[str, ...]

    def as_json(self, simulation: Simulation, bag: str) -> dict[str, object]:
        """Return the result that ``--json`` prints."""
        return {
            "schema": 1,
            "bag": bag,
            "axes": list(simulation.seeds),
            "seeds": simulation.seeds,
            "duration_s": simulation.duration,
            "samples": simulation.count,
            "messages": self.messages,
            "errors": list(self.errors),
        }


def simulate(
    simulation: Simulation, out: str, storage: str, is_overwriting: bool, show: Callable[[float], None]
) -> Simulated:
    """Simulate into a bag.

    Args:
        simulation: the table and its settings.
        out: folder of the new bag.
        storage: ``mcap`` or ``sqlite3``.
        is_overwriting: replace a bag that is there.
        show: called with the number of simulated samples.

    Raises:
        RecordingError: the bag cannot be written.
    """
    settings, table, other, count = simulation.settings, simulation.table, simulation.other, simulation.count
    scales = tuple(axis.scales for axis in settings.axes)
    step: TableStep = _observed(settings, table) if simulation.is_observed else lambda size: (table.step(size), ())
    settling = round(_SETTLING / settings.sample_period) if simulation.duration >= 1.0 else 0
    errors = _Errors(settings.axes, settling, other is not None)
    with BagWriter(out, storage, is_overwriting=is_overwriting) as bag:
        done = 0
        while done < count:
            records, estimates = step(min(_SAMPLES_PER_BLOCK, count - done))
            _write_records(bag, table.names, scales, records)
            if estimates:
                _write_estimates(bag, table.names, estimates, done, settings.publish_every)
            errors.add(records, estimates, other.step(len(records[0])) if other else ())
            done += len(records[0])
            show(done)
    return Simulated(sum(bag.counts.values()), tuple(errors.lines()))


def _observed(settings: Settings, table: SimulatedTable) -> TableStep:
    """Return the step of the table with one observer per axis in the loop."""
    observers = AllAxes(settings.axes, settings.sample_period)
    scales = [axis.scales for axis in settings.axes]
    if observers.is_coupled:

        def together(blocks: Mapping[int, Samples]) -> Mapping[int, Estimates]:
            return observers.step({i: block.in_topic_units(scales[i]).in_si(scales[i]) for i, block in blocks.items()})

        steps: TableObserver | list[ObserverStep] = together
    else:
        steps = [_observer(axis, one.step) for axis, one in zip(settings.axes, observers.observers, strict=True)]
    has_feedback = any(axis.compensation.enabled and axis.stage.accept_compensation for axis in settings.axes)
    return ClosedLoop(table, steps, has_feedback).step


def _observer(axis: AxisSettings, step: Callable[[Samples], Estimates]) -> Callable[[Samples], Estimates]:
    """Return an observer that gets the values of the bag: in topic units, converted back to SI."""
    scales = axis.scales
    return step if scales.are_one else lambda samples: step(samples.in_topic_units(scales).in_si(scales))


def _without_compensation(settings: Settings, seed: int | None) -> SimulatedTable | None:
    """Return the same table without compensation, or None if no axis has one."""
    if not any(axis.compensation.enabled and axis.stage.accept_compensation for axis in settings.axes):
        return None
    return SimulatedTable(settings, START_NS, seed)


def _write_records(
    bag: BagWriter, names: Sequence[str], scales: Sequence[Scales], records: Sequence[StageRecord]
) -> None:
    """Write what a real stage publishes, in topic units, and the truth in SI."""
    stamp_ns = records[0].stamp_ns
    measured = [record.samples.in_topic_units(of_axis) for record, of_axis in zip(records, scales, strict=True)]
    # The reference first: a reader pairs position and effort as soon as it has both, and does not wait for the first
    # reference.
    bag.write_joint_states(
        "reference", stamp_ns, names,
        position=_columns("reference_position", measured), velocity=_columns("reference_velocity", measured),
    )  # fmt: skip
    bag.write_joint_states("position", stamp_ns, names, position=_columns("position", measured))
    bag.write_joint_states("control_effort", stamp_ns, names, effort=_columns("effort", measured))
    bag.write_joint_states(
        "friction_true", stamp_ns, names,
        position=_columns("position", records), velocity=_columns("velocity", records),
        effort=_columns("friction", records),
    )  # fmt: skip


def _write_estimates(
    bag: BagWriter, names: Sequence[str], estimates: Sequence[Estimates], first: int, publish_every: int
) -> None:
    """Write every ``publish_every``-th estimate of the run; ``first`` is the number of the block's first sample."""
    if publish_every > 1:
        rows = slice(-first % publish_every, None, publish_every)
        estimates = [
            replace(block, **{field.name: getattr(block, field.name)[rows] for field in fields(block)})
            for block in estimates
        ]
    write_estimates(bag, names, estimates)


def write_estimates(bag: BagWriter, names: Sequence[str], estimates: Sequence[Estimates]) -> None:
    """Write a block of estimates to friction_estimate, _std, _compensation and _elements.

    Args:
        bag: the open bag.
        names: the axes.
        estimates: one block per axis, with the same stamps.
    """
    stamp_ns = estimates[0].stamp_ns
    bag.write_joint_states(
        "friction_estimate", stamp_ns, names,
        position=_columns("position", estimates),
        velocity=_columns("velocity", estimates),
        effort=_columns("friction", estimates),
    )  # fmt: skip
    bag.write_joint_states("friction_std", stamp_ns, names, effort=_columns("friction_std", estimates))
    bag.write_joint_states("friction_compensation", stamp_ns, names, effort=_columns("compensation", estimates))
    elements = [
        f"{name}/{i + 1}"
        for name, estimate in zip(names, estimates, strict=True)
        for i in range(estimate.element_force.shape[1])
    ]
    bag.write_joint_states(
        "friction_elements", stamp_ns, elements,
        position=np.hstack([e.element_deflection for e in estimates]),
        effort=np.hstack([e.element_force for e in estimates]),
    )  # fmt: skip


def _columns(field: str, blocks: Sequence[StageRecord | Samples | Estimates]) -> Floats:
    """Return one column per axis, shape (n, k)."""
    return np.column_stack([getattr(block, field) for block in blocks])


class _Errors:
    """Tracking error and, with an observer, friction error of every axis; the first ``_SETTLING`` does not count.

    Args:
        axes: the axes.
        first: samples that do not count.
        has_other: whether the same stage is also simulated without compensation.
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
        """Count one block of every axis, and of every axis without compensation."""
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
    """Size of an error: sum of squares and largest magnitude."""

    def __init__(self) -> None:
        self.count = 0
        self.peak = 0.0
        self._squares = 0.0

    def add(self, error: Floats) -> None:
        """Count a block of errors."""
        self.count += len(error)
        self._squares += float(error @ error)
        self.peak = max(self.peak, float(abs(error).max(initial=0.0)))

    @property
    def rms(self) -> float:
        """Return the root mean square."""
        return math.sqrt(self._squares / max(1, self.count))


def _ratio(first: float, second: float) -> str:
    """Return the ratio of the numbers as text."""
    return f"{first / second:.1f}" if second > 0.0 else "inf"
