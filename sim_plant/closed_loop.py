"""The simulated table with an observer in the loop: its compensation is added to the effort of the next sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import partial

import numpy as np

from sgms_observer.observer.samples import Estimates, Samples
from sim_plant.record import StageRecord, join_records
from sim_plant.table import SimulatedTable

ObserverStep = Callable[[Samples], Estimates]
"""Function from new samples of one axis to estimates, such as ``AxisObserver.step``."""

TableObserver = Callable[[Mapping[int, Samples]], Mapping[int, Estimates]]
"""The same for all axes together, by number, such as ``AllAxes.step``."""


class ClosedLoop:
    """A table and one observer per axis.

    At sample k the stage publishes position and effort; the observer answers with a compensation; the stage adds it to
    the controller's output from sample k + 1 on, as the live nodes do when no message is late.

    Args:
        table: the simulated axes.
        observers: one per axis, in the order of the table; or one for all axes, which then step together.
        has_feedback: whether the compensation reaches the stage; without it whole blocks are computed at once, with
            the same result as a compensation of zero.
    """

    def __init__(
        self, table: SimulatedTable, observers: Sequence[ObserverStep] | TableObserver, has_feedback: bool = True
    ) -> None:
        self._table = table
        self._together = observers if callable(observers) else None
        self._observers = () if callable(observers) else tuple(observers)
        self._has_feedback = has_feedback
        self._compensation = [0.0] * len(table.stages)

    def step(self, count: int) -> tuple[tuple[StageRecord, ...], tuple[Estimates, ...]]:
        """Return the next samples of every axis and their estimates.

        Args:
            count: number of samples, at least 1.

        Returns:
            One record and one block of estimates per axis.
        """
        if not self._has_feedback:
            together = self._table.step(count)
            return together, self._observe(together)
        if self._table.is_coupled or self._together is not None:
            return self._step_together(count)
        records: list[StageRecord] = []
        estimates: list[Estimates] = []
        for i, stage in enumerate(self._table.stages):
            rows: list[Estimates] = []
            record, self._compensation[i] = stage.step_answered(
                count, partial(_answer, self._observers[i], rows), self._compensation[i]
            )
            records.append(record)
            estimates.append(_join_estimates(rows))
        return tuple(records), tuple(estimates)

    def _step_together(self, count: int) -> tuple[tuple[StageRecord, ...], tuple[Estimates, ...]]:
        """Step coupled axes, all by one sample at a time."""
        record_rows, estimate_rows = [], []
        for _ in range(count):
            records = self._table.step(1, self._compensation)
            estimates = self._observe(records)
            self._compensation = [float(estimate.compensation[-1]) for estimate in estimates]
            record_rows.append(records)
            estimate_rows.append(estimates)
        return (
            tuple(join_records(rows) for rows in zip(*record_rows, strict=True)),
            tuple(_join_estimates(rows) for rows in zip(*estimate_rows, strict=True)),
        )

    def _observe(self, records: Sequence[StageRecord]) -> tuple[Estimates, ...]:
        if self._together is not None:
            found = self._together({number: record.samples for number, record in enumerate(records)})
            return tuple(found[number] for number in range(len(records)))
        return tuple(observe(record.samples) for observe, record in zip(self._observers, records, strict=True))


def _answer(observe: ObserverStep, rows: list[Estimates], samples: Samples) -> float:
    """Step one observer, append its estimates to ``rows``, and return its compensation [N]."""
    estimates = observe(samples)
    rows.append(estimates)
    return float(estimates.compensation[-1])


def _join_estimates(blocks: Sequence[Estimates]) -> Estimates:
    """Return consecutive blocks of estimates, at least one, as one."""
    if len(blocks) == 1:
        return blocks[0]
    return Estimates(
        **{field.name: np.concatenate([getattr(block, field.name) for block in blocks]) for field in fields(Estimates)}
    )
