"""Several simulated axes that move together, for instance an XY table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sgms_observer.arrays import Floats
from sgms_observer.settings.axis import Settings, coupled_number
from sim_plant.record import StageRecord, join_records
from sim_plant.stage import SimulatedStage


class SimulatedTable:
    """All axes of a parameter file, in step.

    On an axis with the effect ``cross_axis_coupling`` acts the motion of its ``coupled_axis`` one sample before (by
    default the axis before it, for the first axis the last). A table with such an axis is simulated sample by sample.

    Args:
        settings: the whole file.
        start_ns: stamp of the first sample [ns].
        seed: replaces every axis's ``stage.seed``; axes of one seed draw different noise.

    Raises:
        ConfigurationError: when the settings of an axis are not valid.
    """

    def __init__(self, settings: Settings, start_ns: int = 0, seed: int | None = None) -> None:
        axes = settings.axes
        if seed is not None:
            axes = tuple(replace(axis, stage=replace(axis.stage, seed=seed)) for axis in axes)
        self.stages = tuple(SimulatedStage(axis, settings.sample_period, start_ns) for axis in axes)
        self._neighbours = [coupled_number(axes, number) or 0 for number in range(len(axes))]
        self.is_coupled = len(self.stages) > 1 and any(stage.is_coupled for stage in self.stages)

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the axes."""
        return tuple(stage.axis.name for stage in self.stages)

    def step(self, count: int, compensation: Sequence[float | Floats] | None = None) -> tuple[StageRecord, ...]:
        """Return the next samples of every axis.

        Args:
            count: number of samples, at least 1.
            compensation: feedforward of each axis [N], as for ``SimulatedStage.step``; None for none.

        Returns:
            One record per axis.
        """
        forces: Sequence[float | Floats] = [0.0] * len(self.stages) if compensation is None else compensation
        if not self.is_coupled:
            return tuple(stage.step(count, force) for stage, force in zip(self.stages, forces, strict=True))
        columns = [np.broadcast_to(np.asarray(force, dtype=np.float64), (count,)) for force in forces]
        rows = [self._coupled_sample([float(column[k]) for column in columns]) for k in range(count)]
        return tuple(join_records(records) for records in zip(*rows, strict=True))

    def _coupled_sample(self, forces: Sequence[float]) -> list[StageRecord]:
        """Advance every axis by one sample with the motion of its neighbour at the start."""
        neighbours = [self.stages[number] for number in self._neighbours]
        motions = [(neighbour.velocity, neighbour.acceleration) for neighbour in neighbours]
        return [
            stage.step(1, force, velocity, acceleration)
            for stage, force, (velocity, acceleration) in zip(self.stages, forces, motions, strict=True)
        ]
