"""Estimates of all axes as the topics of ``shared/interfaces.md``, in a bag."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sgms_observer.bags.writer import BagWriter
from sgms_observer.observer.samples import Estimates


def write_estimates(writer: BagWriter, names: Sequence[str], estimates: Sequence[Estimates]) -> None:
    """Write a block of estimates to friction_estimate, _std, _compensation and _elements.

    Args:
        writer: the open bag.
        names: the axes.
        estimates: one block per axis, with the same stamps.
    """
    stamp_ns = estimates[0].stamp_ns
    writer.write_joint_states(
        "friction_estimate", stamp_ns, names,
        position=_columns([e.position for e in estimates]),
        velocity=_columns([e.velocity for e in estimates]),
        effort=_columns([e.friction for e in estimates]),
    )  # fmt: skip
    writer.write_joint_states("friction_std", stamp_ns, names, effort=_columns([e.friction_std for e in estimates]))
    writer.write_joint_states(
        "friction_compensation", stamp_ns, names, effort=_columns([e.compensation for e in estimates])
    )
    elements = [
        f"{name}/{i + 1}"
        for name, estimate in zip(names, estimates, strict=True)
        for i in range(estimate.element_force.shape[1])
    ]
    writer.write_joint_states(
        "friction_elements", stamp_ns, elements,
        position=np.hstack([e.element_deflection for e in estimates]),
        effort=np.hstack([e.element_force for e in estimates]),
    )  # fmt: skip


def _columns(rows: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return one column per axis, shape (n, k)."""
    return np.column_stack(rows)
