"""The work of the observer node without ROS: bytes of messages in, blocks of messages out; ``~/save_parameters``."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sgms_observer.effects.catalogue import effect
from sgms_observer.nodes.horizons import HorizonExchange
from sgms_observer.nodes.intake import Intake
from sgms_observer.nodes.statistics import AxisStatistics, StepClock
from sgms_observer.observer.all_axes import AllAxes
from sgms_observer.observer.axis_observer import AxisObserver, run_all_kernels
from sgms_observer.observer.block_arrays import Observed
from sgms_observer.observer.next_sample import Step, prepare_next
from sgms_observer.observer.outgoing import Outgoing, OutgoingBlock, ParameterReport
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.axis import AxisSettings, Settings
from sgms_observer.settings.declaration import declared_sections, declared_settings
from sgms_observer.settings.write import write_settings

_OF_FRICTION = ("viscous_coefficient", "coulomb_force", "static_force", "stribeck_velocity")


def parameter_changes(axis: AxisSettings, values: dict[str, float], added_mass: float = 0.0) -> dict[str, Any]:
    """Return the settings that follow from estimated parameters.

    Args:
        axis: the settings that the observer started from.
        values: estimated parameter to its value: SI units, kappa as a share of the nominal stiffness.
        added_mass: mass that effects add to the axis's own [kg]; an estimated mass contains it.

    Returns:
        Name of the setting inside the axis (``friction.static_force``) to its new value.
    """
    changes: dict[str, Any] = {}
    for name, value in values.items():
        if name == "kappa":
            changes["friction.element_stiffness"] = [value * kappa for kappa in axis.friction.element_stiffness]
        elif name in _OF_FRICTION:
            changes[f"friction.{name}"] = value
        elif name == "mass":
            changes["mass"] = value - added_mass
        elif name == "offset":
            changes |= _offset(axis, value)
    return changes


def parameter_remarks(axis: AxisSettings, changes: Mapping[str, Any], writer: str) -> dict[str, str]:
    """Return the remark for each changed setting: its unit, and the node that estimated it.

    Args:
        axis: the settings that the observer started from.
        changes: result of ``parameter_changes``.
        writer: name of the node.
    """
    remarks = {}
    for name in changes:
        unit = _unit(name)
        remarks[name] = f"{axis.units.of(unit)}; learnt by {writer}" if unit != "-" else f"learnt by {writer}"
    return remarks


def _unit(name: str) -> str:
    """Return the unit of a setting of an axis that slides, or ``-``."""
    *groups, key = name.split(".")
    if groups[:1] == ["effects"]:
        parameters = effect(groups[1]).parameters if len(groups) > 1 else ()
        return next((parameter.unit for parameter in parameters if parameter.name == key), "-")
    kind: type = AxisSettings
    for group in groups:
        kind = declared_sections(kind)[group][0]
    return declared_settings(kind)[key].unit


def _offset(axis: AxisSettings, value: float) -> dict[str, Any]:
    """Return the effect ``offset`` with its force plus the estimated one [N]."""
    names = [effect.name for effect in axis.effects]
    known = next((effect.values[0] for effect in axis.effects if effect.name == "offset"), 0.0)
    changes: dict[str, Any] = {"effects.offset.force": known + value}
    if "offset" not in names:
        changes["effects.names"] = [*names, "offset"]
    return changes


def _always() -> bool:
    return True


@dataclass(frozen=True)
class Processed:
    """Result of one call of ``Engine.process``.

    Attributes:
        observed: number of the axis to the observation of its latest samples.
        blocks: messages to publish.
        reports: estimated parameters to publish.
    """

    observed: dict[int, Observed]
    blocks: list[OutgoingBlock]
    reports: list[ParameterReport]


class Engine:
    """The observers of all axes between the input topics and the output topics.

    Args:
        settings: the checked settings.

    Raises:
        ConfigurationError: the settings of an axis do not fit the sample period.
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.axes = tuple(axis.name for axis in settings.axes)
        self._all_axes = AllAxes(settings.axes, settings.sample_period)
        self.observers = self._all_axes.observers
        self.clock = StepClock(settings.sample_period)
        self.statistics = [AxisStatistics() for _ in settings.axes]
        self.latest: dict[int, Observed] = {}
        self.intake = Intake(settings.scales, settings.sample_period)
        self.horizons = HorizonExchange(settings, self._all_axes)
        self._outgoing = Outgoing(settings)
        self._prepared: tuple[Callable[[int, Sequence[float]], None], list[Step]] | None = None

    def warm_up(self) -> None:
        """Run every kernel once, so that none is compiled or loaded when the first sample arrives."""
        for axis in self.settings.axes:
            enabled = replace(axis, compensation=replace(axis.compensation, enabled=True))
            run_all_kernels(AxisObserver(enabled, self.settings.sample_period))

    def process(
        self, send: Callable[[OutgoingBlock], None] | None = None, are_others_read: Callable[[], bool] = _always
    ) -> Processed:
        """Estimate over all complete samples.

        Args:
            send: called with each block of compensations as soon as it is ready; without it they are returned with the
                others.
            are_others_read: returns whether a node reads other messages than compensations; if not, none are made.
        """
        processed = Processed({}, [], [])
        if send is not None and (prepared := self._observe_prepared()) is not None:
            self._note(prepared, processed)
            self._add_others(prepared, processed, are_others_read)
            return processed
        for group in self._groups():
            observed = self._all_axes.observe(group)
            is_sent = send is not None and self._send_together(observed, send)
            self._note(observed, processed)
            if not is_sent:
                for block in self._outgoing.compensations({n: found.estimates() for n, found in observed.items()}):
                    processed.blocks.append(block) if send is None else send(block)
            self._add_others(observed, processed, are_others_read)
        return processed

    def prepare(self, send: Callable[[int, Sequence[float]], None]) -> None:
        """Prepare the next sample of all axes, so that its compensation is published earlier.

        Args:
            send: called with stamp [ns] and compensation of each axis [N] if one sample of every axis arrives alone and
                all have one stamp; ``process`` does not return these compensations again.
        """
        for pairing in self.intake.pairings:
            pairing.prepare()
        if self._prepared is None and not self._all_axes.is_coupled:
            steps = [prepare_next(observer) for observer in self.observers]
            if all(step is not None for step in steps):
                self._prepared = send, [step for step in steps if step is not None]

    def _observe_prepared(self) -> dict[int, Observed] | None:
        """Observe the prepared sample and send its compensation; return None where other samples have arrived."""
        pairings = self.intake.pairings
        if self._prepared is None or (stamp_ns := pairings[0].alone_ns) is None:
            return None
        for pairing in pairings[1:]:
            if pairing.alone_ns != stamp_ns:
                return None
        (send, steps), self._prepared = self._prepared, None
        observed, forces = {}, []
        for number, step in enumerate(steps):
            observed[number] = found = step(pairings[number].pop_alone())
            forces.append(found.arrays.compensation.item())
        send(stamp_ns, forces)
        return observed

    def _send_together(self, observed: dict[int, Observed], send: Callable[[OutgoingBlock], None]) -> bool:
        """Send the compensations of axes with equal stamps; return whether they have equal stamps."""
        block = self._outgoing.compensation_of_all(observed)
        if block is not None:
            send(block)
        return block is not None

    def _note(self, observed: dict[int, Observed], processed: Processed) -> None:
        """Count the samples, and report their parameters where a report is due."""
        processed.observed.clear()
        processed.observed.update(observed)
        self.latest.update(observed)
        for number, found in observed.items():
            self.clock.add(found.seconds, len(found.stamp_ns))
            self.statistics[number].add(found.arrays.results)
        processed.reports.extend(self._outgoing.reports(observed))

    def _add_others(
        self, observed: dict[int, Observed], processed: Processed, are_others_read: Callable[[], bool]
    ) -> None:
        """Add the messages other than compensations, if a node reads them."""
        if are_others_read():
            estimates = {number: found.estimates() for number, found in observed.items()}
            processed.blocks.extend(self._outgoing.others(estimates))
        else:
            self._outgoing.pass_over(observed)

    def _groups(self) -> list[dict[int, Samples]]:
        """Return the new samples by axis; a second block of an axis, after a clock reset, comes with the next call."""
        groups: list[dict[int, Samples]] = []
        group: dict[int, Samples] = {}
        for number, pairing in enumerate(self.intake.pairings):
            while (samples := pairing.pop()) is not None:
                if number in group:
                    groups.append(group)
                    group = {}
                group[number] = samples
        return [*groups, group] if group else groups

    def reset(self) -> None:
        """Drop all samples and estimates; the counts are kept."""
        before = self.intake
        self.intake = Intake(self.settings.scales, self.settings.sample_period)
        self.intake.counts = before.counts
        for pairing, old in zip(self.intake.pairings, before.pairings, strict=True):
            pairing.counts = old.counts
        self._outgoing = Outgoing(self.settings)
        self.latest.clear()
        self.horizons.reset()
        self._all_axes.reset()

    def continue_compensation(self, number: int, output: float) -> None:
        """Set the last published force of an axis, from which its compensation continues.

        Args:
            number: of the axis.
            output: the force [N].
        """
        self.observers[number].compensator.continue_from(output)

    def tune_compensation(self, settings: Settings) -> None:
        """Apply new settings of the compensation without a restart.

        Args:
            settings: settings that differ in ``compensation`` only.
        """
        self.settings = settings
        self._prepared = None
        for observer, axis in zip(self.observers, settings.axes, strict=True):
            observer.compensator.configure(axis.compensation)
        self.horizons.configure(settings)


def save_learnt(settings: Settings, engine: Engine, name: str) -> str:
    """Write the file, and return the sentence about it.

    Args:
        settings: of the node, with those that the stage node reads.
        engine: of the node.
        name: of the node.

    Raises:
        SgmsError: the file cannot be written.
    """
    changes, comments = {}, {}
    for number, latest in engine.latest.items():
        axis = settings.axes[number]
        values = dict(zip(axis.estimator.parameters, latest.parameters[-1].tolist(), strict=True))
        if values:
            changes[axis.name] = parameter_changes(axis, values, engine.observers[number].effects.added_mass)
            for parameter, remark in parameter_remarks(axis, changes[axis.name], name).items():
                comments[f"{axis.name}.{parameter}"] = remark
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    samples = max((statistics.total for statistics in engine.statistics), default=0)
    comments[""] = f"Written by {name} on {now} after {samples} samples."
    path = Path(settings.save_file).expanduser().resolve()
    write_settings(replace(settings, source={}), path, changes, comments)  # every value written out
    what = (
        ", ".join(f"{axis}: {' '.join(names)}" for axis, names in changes.items())
        or "no parameter was estimated; the settings are written unchanged"
    )
    return f"wrote {path} ({what})"
