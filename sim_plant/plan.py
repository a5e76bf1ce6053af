"""What happens to a stage whatever it does: reference and noise, drawn block by block of fixed length.

Blocks of fixed length make every draw belong to one sample, however the caller splits the run.
"""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray

from sgms_observer.settings.stage import StageSettings
from sim_plant.followed_reference import FollowedReference
from sim_plant.kernel import PLAN_DISTURBANCE, PLAN_ENCODER_NOISE, PLAN_FORCE_NOISE
from sim_plant.reference import Reference

Floats = NDArray[np.float64]

SAMPLES_PER_PLAN = 512


class Plan:
    """Reference and noise of one axis, one fixed block after the other.

    Args:
        settings: the axis's stage.
        reference: the axis's set-point.
        name: of the axis; axes of one seed draw different noise.
        tick: time between two runs of the controller [s].
        ticks_per_sample: ticks from one published sample to the next.
    """

    def __init__(
        self, settings: StageSettings, reference: Reference, name: str, tick: float, ticks_per_sample: int
    ) -> None:
        self._settings = settings
        self._reference = reference
        self.followed = reference if isinstance(reference, FollowedReference) else None
        self._tick = tick
        self._ticks_per_sample = ticks_per_sample
        streams = np.random.SeedSequence([settings.seed, zlib.crc32(name.encode())]).spawn(3)
        self._encoder, self._force, self._disturbance = (np.random.default_rng(stream) for stream in streams)
        self._next_block = 0
        self.ticks = np.zeros((4, SAMPLES_PER_PLAN * ticks_per_sample))
        self.samples = np.zeros((2, SAMPLES_PER_PLAN))

    def reference_at(self, time: Floats) -> tuple[Floats, Floats]:
        """Return set-points [m] and their velocities [m/s], each of shape (n,).

        Args:
            time: since the first sample [s], shape (n,).
        """
        return self._reference.at(time)[:2]

    def advance(self) -> None:
        """Replace ``ticks`` (reference, encoder noise) and ``samples`` (force noise, disturbance) by the next block."""
        count = SAMPLES_PER_PLAN * self._ticks_per_sample
        time = self._tick * np.arange(self._next_block * count, (self._next_block + 1) * count, dtype=np.float64)
        self._next_block += 1
        if self.followed is None:
            self.ticks[:PLAN_ENCODER_NOISE] = self._reference.at(time)
        _draw(self._encoder, self._settings.encoder.noise, self.ticks[PLAN_ENCODER_NOISE])
        _draw(self._force, self._settings.force_noise, self.samples[PLAN_FORCE_NOISE])
        _draw(self._disturbance, self._settings.disturbance_noise, self.samples[PLAN_DISTURBANCE])

    def ask_reference(self, first: int, end: int) -> None:
        """Fill in the set-points of samples that are about to run, where they come while the stage runs.

        Args:
            first: number of the first sample in the block.
            end: number behind the last one.
        """
        if self.followed is not None:
            start = (self._next_block - 1) * SAMPLES_PER_PLAN
            ticks = self._ticks_per_sample
            time = self._tick * np.arange((start + first) * ticks, (start + end) * ticks, dtype=np.float64)
            self.ticks[:PLAN_ENCODER_NOISE, first * ticks : end * ticks] = self.followed.at(time)


def _draw(generator: np.random.Generator, deviation: float, row: Floats) -> None:
    """Fill ``row`` with white noise of the given standard deviation."""
    if deviation > 0.0:
        row[:] = deviation * generator.standard_normal(len(row))
