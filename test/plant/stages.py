"""Stages that several tests of the plant share."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.settings.axis import AxisSettings
from sim_plant.record import StageRecord


def paper_axis(model: str = "gms", friction: dict[str, Any] | None = None, **stage: Any) -> AxisSettings:
    """Return the paper's test: Table I, 200 um at 5 Hz, with a mass of 3 kg under a 100 Hz controller."""
    axis = AxisSettings(mass=3.0)
    return replace(
        axis,
        friction=replace(axis.friction, model=model, **(friction or {})),
        stage=replace(axis.stage, **stage),
    )


def with_reference(axis: AxisSettings, **reference: Any) -> AxisSettings:
    """Return ``axis`` under another set-point."""
    return replace(axis, stage=replace(axis.stage, reference=replace(axis.stage.reference, **reference)))


def with_controller(axis: AxisSettings, **controller: Any) -> AxisSettings:
    """Return ``axis`` under another controller."""
    return replace(axis, stage=replace(axis.stage, controller=replace(axis.stage.controller, **controller)))


def under_open_loop(axis: AxisSettings) -> AxisSettings:
    """Return ``axis`` without a controller to speak of: the compensation alone is the effort."""
    return with_reference(with_controller(axis, bandwidth=1e-9), amplitude=0.0)


def stored_energy(axis: AxisSettings, record: StageRecord) -> Floats:
    """Return kinetic energy plus the elements' elastic energy at each sample [J]."""
    stiffness = np.array(axis.friction.element_stiffness)
    elastic = (record.element_force**2 / (2.0 * stiffness)).sum(axis=1)
    return 0.5 * axis.mass * record.velocity**2 + elastic


def work_of_effort(record: StageRecord) -> Floats:
    """Return the work of the effort from each sample to the next [J]; exact for an effort held over the sample."""
    return record.effort_applied[:-1] * np.diff(record.position)
