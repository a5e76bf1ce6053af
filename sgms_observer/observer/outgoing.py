"""Conversion of estimates to messages: which rows are published, and which axes share a message.

Node and replay use the same conversion, so a replayed bag holds the same messages as the live run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from sgms_observer.arrays import Booleans, Floats, Ints
from sgms_observer.observer.block_arrays import Observed
from sgms_observer.observer.samples import Estimates
from sgms_observer.settings.axis import Settings

ESTIMATE = "friction_estimate"
STD = "friction_std"
COMPENSATION = "friction_compensation"
ELEMENTS = "friction_elements"
PARAMETERS = "friction_parameters"
HORIZON = "compensation_horizon"
REFERENCE_HORIZON = "reference_horizon"
OTHER_TOPICS = (ESTIMATE, STD, ELEMENTS)
JOINT_STATE_TOPICS = (COMPENSATION, *OTHER_TOPICS)

PARAMETERS_EVERY_NS = 100_000_000
"""Sample time from one message of ``friction_parameters`` to the next [ns]."""


class OutgoingBlock(NamedTuple):
    """n JointStates of one topic.

    Attributes:
        topic: name of the topic.
        names: entries of ``name``, k of them.
        stamp_ns: stamps [ns], shape (n,).
        values: any of ``position``, ``velocity``, ``effort``, in this order, each of shape (n, k) [m], [m/s], [N].
    """

    topic: str
    names: tuple[str, ...]
    stamp_ns: Ints
    values: Mapping[str, Floats]


@dataclass(frozen=True)
class ParameterReport:
    """Content of ``friction_parameters`` for one axis at one time.

    Attributes:
        axis: name of the axis.
        stamp_ns: time of the sample [ns].
        names: estimated parameters.
        values: their values [SI units; kappa as a share].
        std: their standard deviations, in the units of ``values``.
    """

    axis: str
    stamp_ns: int
    names: tuple[str, ...]
    values: tuple[float, ...]
    std: tuple[float, ...]


class Outgoing:
    """Converts blocks of estimates to blocks of messages.

    Args:
        settings: all axes, and how many estimates are published.
    """

    def __init__(self, settings: Settings) -> None:
        self._axes = tuple(axis.name for axis in settings.axes)
        self._alone = tuple((name,) for name in self._axes)
        self._elements = tuple(
            tuple(f"{axis.name}/{i + 1}" for i in range(len(axis.friction.element_stiffness))) for axis in settings.axes
        )
        self._parameters = tuple(axis.estimator.parameters for axis in settings.axes)
        self._every = settings.publish_every
        self._sample_counts = [0] * len(self._axes)
        self._reported = [-1] * len(self._axes)

    def blocks(self, estimates: Mapping[int, Estimates]) -> list[OutgoingBlock]:
        """Return the messages for new estimates.

        Args:
            estimates: number of the axis to its new estimates.

        Returns:
            Blocks of messages; axes with the same stamps share a message.
        """
        return [*self.compensations(estimates), *self.others(estimates)]

    def compensations(self, estimates: Mapping[int, Estimates]) -> list[OutgoingBlock]:
        """Return the messages of ``blocks`` with the compensation.

        Args:
            estimates: as for ``blocks``.
        """
        return [self._effort(COMPENSATION, axes, group, "compensation") for axes, group in _by_stamps(estimates)]

    def compensation_of_all(self, observed: Mapping[int, Observed]) -> OutgoingBlock | None:
        """Return the message of ``compensations`` for axes with equal stamps, without estimates; None for other axes.

        Args:
            observed: number of the axis to the observation of its new samples.
        """
        if len(observed) == 1:
            ((axis, (stamp_ns, arrays, _)),) = observed.items()
            return OutgoingBlock(COMPENSATION, self._alone[axis], stamp_ns, {"effort": arrays.compensation_column})
        first, *others = observed.values()
        if any(not np.array_equal(first.stamp_ns, block.stamp_ns) for block in others):
            return None
        names = tuple(self._axes[axis] for axis in observed)
        effort = np.stack([block.compensation for block in observed.values()], axis=1)
        return OutgoingBlock(COMPENSATION, names, first.stamp_ns, {"effort": effort})

    def others(self, estimates: Mapping[int, Estimates]) -> list[OutgoingBlock]:
        """Return the other messages of ``blocks``.

        Args:
            estimates: as for ``blocks``.
        """
        found = []
        published = {
            axis: rows for axis, block in estimates.items() if (rows := self._published(axis, block)) is not None
        }
        for axes, group in _by_stamps(published):
            stamps = group[0].stamp_ns
            names = tuple(self._axes[axis] for axis in axes)
            motion = {
                "position": _columns(group, "position"),
                "velocity": _columns(group, "velocity"),
                "effort": _columns(group, "friction"),
            }
            elements = {
                "position": _side_by_side([block.element_deflection for block in group]),
                "effort": _side_by_side([block.element_force for block in group]),
            }
            element_names = tuple(name for axis in axes for name in self._elements[axis])
            found.append(OutgoingBlock(ESTIMATE, names, stamps, motion))
            found.append(self._effort(STD, axes, group, "friction_std"))
            found.append(OutgoingBlock(ELEMENTS, element_names, stamps, elements))
        return found

    def pass_over(self, observed: Mapping[int, Observed]) -> None:
        """Count samples without a call of ``others``, so that ``publish_every`` counts every sample.

        Args:
            observed: number of the axis to the observation of its new samples.
        """
        if self._every > 1:
            for axis, block in observed.items():
                self._sample_counts[axis] += len(block.stamp_ns)

    def reports(self, estimates: Mapping[int, Estimates | Observed]) -> list[ParameterReport]:
        """Return the reports of the estimated parameters, at most ten per second of sample time.

        Args:
            estimates: number of the axis to its new estimates.
        """
        found = []
        for axis, block in estimates.items():
            if not self._parameters[axis]:
                continue
            last = int(block.stamp_ns[-1]) // PARAMETERS_EVERY_NS
            if int(block.stamp_ns[0]) // PARAMETERS_EVERY_NS == last == self._reported[axis]:
                continue  # nothing is due; stamps increase inside a block
            slots = block.stamp_ns // PARAMETERS_EVERY_NS
            before = np.concatenate([[self._reported[axis]], slots[:-1]])
            self._reported[axis] = int(slots[-1])
            for row in np.flatnonzero(slots != before):
                found.append(
                    ParameterReport(
                        self._axes[axis],
                        int(block.stamp_ns[row]),
                        self._parameters[axis],
                        tuple(block.parameters[row].tolist()),
                        tuple(block.parameter_std[row].tolist()),
                    )
                )
        return found

    def _effort(self, topic: str, axes: Sequence[int], group: Sequence[Estimates], field: str) -> OutgoingBlock:
        """Return messages that carry an effort only."""
        names = tuple(self._axes[axis] for axis in axes)
        return OutgoingBlock(topic, names, group[0].stamp_ns, {"effort": _columns(group, field)})

    def _published(self, axis: int, block: Estimates) -> Estimates | None:
        """Return the rows that ``publish_every`` lets through."""
        if self._every == 1:
            return block
        first = -self._sample_counts[axis] % self._every
        self._sample_counts[axis] += len(block.stamp_ns)
        return _select_rows(block, slice(first, None, self._every)) if first < len(block.stamp_ns) else None


def _select_rows(block: Estimates, rows: slice | Booleans) -> Estimates:
    """Return some rows of a block of estimates."""
    return Estimates(**{field.name: getattr(block, field.name)[rows] for field in fields(Estimates)})


def _side_by_side(values: Sequence[Floats]) -> Floats:
    """Return arrays of several axes side by side, shape (n, all columns)."""
    return values[0] if len(values) == 1 else np.concatenate(values, axis=1)


def _columns(group: Sequence[Estimates], field: str) -> Floats:
    """Return one field of several axes side by side, shape (n, axes)."""
    if len(group) == 1:
        column: Floats = getattr(group[0], field)[:, np.newaxis]
        return column
    return np.stack([getattr(block, field) for block in group], axis=1)


def _by_stamps(estimates: Mapping[int, Estimates]) -> list[tuple[tuple[int, ...], list[Estimates]]]:
    """Group axes with equal stamps. Otherwise the common stamps form one group and the others one group per axis."""
    axes = tuple(estimates)
    blocks = list(estimates.values())
    if len(blocks) <= 1 or all(np.array_equal(blocks[0].stamp_ns, block.stamp_ns) for block in blocks[1:]):
        return [(axes, blocks)] if blocks and len(blocks[0].stamp_ns) else []
    common = blocks[0].stamp_ns
    for block in blocks[1:]:
        common = common[np.isin(common, block.stamp_ns)]
    shared = [np.isin(block.stamp_ns, common) for block in blocks]
    groups = []
    if common.size:
        groups.append((axes, [_select_rows(block, mask) for block, mask in zip(blocks, shared, strict=True)]))
    for axis, block, mask in zip(axes, blocks, shared, strict=True):
        if not mask.all():
            groups.append(((axis,), [_select_rows(block, ~mask)]))
    return groups
