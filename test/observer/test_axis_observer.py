"""The observer of one axis: the same bits for any split, what its estimates are, and what a reset forgets."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import (
    AxisSettings,
    CompensationSettings,
    EffectSettings,
    EstimatorSettings,
    FilterSettings,
)
from sgms_observer.status import Status

PERIOD = 1e-4
COUNT = 1500
SEED = 20


def recording() -> Samples:
    """A noisy sine with everything that happens: missing efforts, a lost position, a stamp back, a pause."""
    generator = np.random.default_rng(SEED)
    time = PERIOD * np.arange(COUNT)
    velocity = 2e-4 * 60.0 * np.cos(60.0 * time)
    effort = 4.0 * np.tanh(velocity / 1e-3) + generator.normal(0.0, 0.1, COUNT)
    effort[400:430] = np.nan
    stamps = np.rint(time * 1e9).astype(np.int64) + 1_000_000_000
    stamps[700] = stamps[690]
    stamps[1100:] += 50_000_000
    position = 2e-4 * np.sin(60.0 * time) + generator.normal(0.0, 5e-9, COUNT)
    reference = position.copy()
    position[600] = np.nan
    reference[900:] = np.nan
    return Samples(stamps, position, effort, reference, np.where(np.arange(COUNT) < 900, velocity, np.nan))


def part(samples: Samples, first: int, last: int) -> Samples:
    return Samples(**{field.name: getattr(samples, field.name)[first:last] for field in fields(Samples)})


def settings(kind: str, filter_kind: str, effects: tuple[EffectSettings, ...] = ()) -> AxisSettings:
    return AxisSettings(
        effects=effects,
        filter=FilterSettings(kind=filter_kind),
        estimator=EstimatorSettings(kind=kind, parameters=("kappa", "offset")),
        compensation=CompensationSettings(enabled=True, timeout=0.01),
    )


EFFECTS = (EffectSettings("cogging"), EffectSettings("thermal_drift"), EffectSettings("actuator_delay"))


@pytest.mark.parametrize("kind", ["ekf", "mhe"])
@pytest.mark.parametrize("filter_kind", ["lowpass", "savgol", "kalman"])
@pytest.mark.parametrize("effects", [(), EFFECTS], ids=["plain", "effects"])
def test_any_split_into_blocks_gives_the_same_bits(
    kind: str, filter_kind: str, effects: tuple[EffectSettings, ...]
) -> None:
    samples = recording()
    axis = settings(kind, filter_kind, effects)
    whole = AxisObserver(axis, PERIOD).step(samples)
    edges = np.unique(np.random.default_rng(SEED).integers(0, COUNT, 40)).tolist()
    for cuts in ([0, *edges, COUNT], list(range(COUNT + 1))):
        observer = AxisObserver(axis, PERIOD)
        parts = [observer.step(part(samples, a, b)) for a, b in pairwise(cuts)]
        for field in fields(Estimates):
            joined = np.concatenate([getattr(block, field.name) for block in parts])
            np.testing.assert_array_equal(joined, getattr(whole, field.name), err_msg=field.name)


def test_reset_forgets_everything_but_the_compensation_that_is_out() -> None:
    samples = recording()
    axis = replace(settings("mhe", "savgol"), compensation=CompensationSettings())
    observer = AxisObserver(axis, PERIOD)
    first = observer.step(samples)
    observer.reset()
    again = observer.step(samples)
    for field in fields(Estimates):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(again, field.name), err_msg=field.name)


def test_deflections_belong_to_the_forces_and_the_learnt_stiffness() -> None:
    axis = settings("mhe", "savgol")
    estimates = AxisObserver(axis, PERIOD).step(recording())
    stiffness = estimates.parameters[:, :1] * np.array(axis.friction.element_stiffness)
    np.testing.assert_allclose(estimates.element_deflection * stiffness, estimates.element_force, rtol=1e-14)
    assert np.ptp(estimates.parameters[:, 0]) > 0.0


def test_trouble_is_said_in_the_status() -> None:
    estimates = AxisObserver(settings("ekf", "savgol"), PERIOD).step(recording())
    assert estimates.status[600] == estimates.status[700] == Status.SAMPLE_REJECTED
    assert estimates.status[1100] == Status.RESTARTED_AFTER_GAP
    assert Status.PREDICTING in estimates.status[400:450]
    assert np.isfinite(estimates.friction).all() and np.isfinite(estimates.compensation).all()
