"""Everything the observer node does with messages, without ROS: bytes in, blocks of messages out."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from sgms_observer.nodes.horizons import HorizonExchange
from sgms_observer.nodes.intake import Intake
from sgms_observer.nodes.statistics import AxisStatistics, StepClock
from sgms_observer.observer.all_axes import AllAxes
from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.trial import run_all_kernels
from sgms_observer.observer.outgoing import Outgoing, OutgoingBlock, ParameterReport
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import Settings


@dataclass(frozen=True)
class Processed:
    """What one call of ``Engine.process`` gave.

    Attributes:
        estimates: number of the axis to its new estimates.
        blocks: messages to publish.
        reports: estimated parameters to publish.
    """

    estimates: dict[int, Estimates]
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
        self.latest: dict[int, Estimates] = {}
        self.intake = Intake(settings.scales, settings.sample_period)
        self.horizons = HorizonExchange(settings, self._all_axes)
        self._outgoing = Outgoing(settings)

    def warm_up(self) -> None:
        """Run every kernel once, so that none is compiled or loaded when the first sample arrives."""
        for axis in self.settings.axes:
            enabled = replace(axis, compensation=replace(axis.compensation, enabled=True))
            run_all_kernels(AxisObserver(enabled, self.settings.sample_period))

    def process(self) -> Processed:
        """Estimate over everything that came in and is complete."""
        blocks: list[OutgoingBlock] = []
        reports: list[ParameterReport] = []
        estimates: dict[int, Estimates] = {}
        for group in self._groups():
            estimates = {}
            start = time.perf_counter()
            for number, block in self._all_axes.step(group):
                self.clock.add(time.perf_counter() - start, len(group[number].stamp_ns))
                self.statistics[number].add(block)
                estimates[number] = self.latest[number] = block
                start = time.perf_counter()
            blocks += self._outgoing.blocks(estimates)
            reports += self._outgoing.reports(estimates)
        return Processed(estimates, blocks, reports)

    def _groups(self) -> Iterator[dict[int, Samples]]:
        """Yield the new samples by axis; a second block of an axis, which follows a reset of the clock, comes later."""
        group: dict[int, Samples] = {}
        for number, samples in self.intake.pop():
            if number in group:
                yield group
                group = {}
            group[number] = samples
        if group:
            yield group

    def reset(self) -> None:
        """Forget every sample and everything learnt; counts go on."""
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
        """Let an axis's compensation go on from what really went out last.

        Args:
            number: of the axis.
            output: the force [N].
        """
        self.observers[number].compensator.continue_from(output)

    def tune_compensation(self, settings: Settings) -> None:
        """Take over the compensation's settings while everything else goes on.

        Args:
            settings: settings that differ in ``compensation`` only.
        """
        self.settings = settings
        for observer, axis in zip(self.observers, settings.axes, strict=True):
            observer.compensator.configure(axis.compensation)
        self.horizons.configure(settings)
