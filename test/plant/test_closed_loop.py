"""The observer in the loop: sample by sample, one sample late, and only where it is asked for."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from stages import paper_axis, with_reference

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import AxisSettings, EffectSettings, Settings
from sim_plant.closed_loop import ClosedLoop
from sim_plant.record import StageRecord, join_records
from sim_plant.table import SimulatedTable


def estimates_of(samples: Samples, compensation: float) -> Estimates:
    n = len(samples.stamp_ns)
    row, table = np.zeros(n), np.zeros((n, 1))
    return Estimates(
        samples.stamp_ns, samples.position, row, row, row, row, table, table, table, table, row, row,
        np.full(n, compensation), np.zeros(n, np.uint8),
    )  # fmt: skip


def test_compensation_arrives_with_the_next_sample() -> None:
    def observe(samples: Samples) -> Estimates:
        assert len(samples.stamp_ns) == 1
        return estimates_of(samples, samples.stamp_ns[0] * 1e-6)

    loop = ClosedLoop(SimulatedTable(Settings(axes=(paper_axis(),))), [observe])
    first, second = loop.step(30)[0][0], loop.step(20)[0][0]
    compensation = np.concatenate([first.compensation, second.compensation])
    assert_array_equal(compensation, np.concatenate([[0.0], np.arange(49) * 1e5 * 1e-6]))


def test_coupled_axes_are_answered_alike() -> None:
    coupling = (EffectSettings("cross_axis_coupling", (0.0, 0.0)),)
    x = replace(paper_axis(), name="x")
    y = replace(with_reference(paper_axis("sgms"), frequency=7.0), name="y")

    def run(axes: tuple[AxisSettings, ...]) -> list[StageRecord]:
        def observe(samples: Samples) -> Estimates:
            return estimates_of(samples, 1e4 * float(samples.position[-1]))

        loop = ClosedLoop(SimulatedTable(Settings(axes=axes)), [observe, observe])
        return [join_records(blocks) for blocks in zip(*(loop.step(n)[0] for n in (40, 60)), strict=True)]

    for alone, coupled in zip(run((x, y)), run((x, replace(y, stage_effects=coupling))), strict=True):
        assert np.abs(alone.compensation).max() > 0.1
        np.testing.assert_allclose(coupled.position, alone.position, rtol=0.0, atol=1e-15)


def observed(axis: AxisSettings, samples: int, has_feedback: bool) -> tuple[np.ndarray, Estimates]:
    observer = AxisObserver(axis, 1e-4)
    loop = ClosedLoop(SimulatedTable(Settings(axes=(axis,))), [observer.step], has_feedback)
    (record,), (estimates,) = loop.step(samples)
    return record.position - record.reference_position, estimates


def test_without_compensation_blocks_and_samples_give_the_same_bits() -> None:
    error, blocks = observed(paper_axis(), 900, False)
    error_by_sample, samples = observed(paper_axis(), 900, True)
    assert_array_equal(error, error_by_sample)
    for field in fields(Estimates):
        assert_array_equal(getattr(blocks, field.name), getattr(samples, field.name), err_msg=field.name)


@pytest.mark.parametrize("seed", [1])
def test_compensation_makes_the_papers_stage_track_better(seed: int) -> None:
    print(f"seed {seed}")
    axis = paper_axis("gms", seed=seed, force_noise=0.05)
    with_compensation = replace(axis, compensation=replace(axis.compensation, enabled=True))
    plain, _ = observed(axis, 8000, False)
    helped, _ = observed(with_compensation, 8000, True)
    assert helped[4000:].std() < 0.7 * plain[4000:].std()
