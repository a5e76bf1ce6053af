"""The compensator by itself: off until enabled, the same in any split, gone when the data are."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgms_observer.compensation.feedforward import Compensator
from sgms_observer.compensation.motion_ahead import AHEAD_WIDTH
from sgms_observer.estimators.block import FRICTION_STD, RESULT_SIZE, STATUS
from sgms_observer.estimators.layout import ModelArrays, ParameterArrays, model_arrays, parameter_arrays
from sgms_observer.filters.motion import ELAPSED, LEAD, PRESENT_VELOCITY
from sgms_observer.settings.axis import CompensationSettings, EstimatorSettings, FrictionSettings
from sgms_observer.status import Status

PERIOD = 1e-4
ON = CompensationSettings(enabled=True, gain=1.0, timeout=0.01)


@dataclass(frozen=True)
class Block:
    """What a compensator gets for a block of n samples [SI units]; all of shape (n,) but the forces and parameters."""

    period: np.ndarray
    velocity: np.ndarray
    element_force: np.ndarray
    parameters: np.ndarray
    friction_std: np.ndarray
    reference_position: np.ndarray
    reference_velocity: np.ndarray
    effects_force: np.ndarray
    effects_factor: np.ndarray
    status: np.ndarray


def compensate(compensator: Compensator, block: Block) -> np.ndarray:
    """Return the compensation of each sample of a block [N], from tables of filter and estimator made of it."""
    count, n_z = block.element_force.shape
    n_p = block.parameters.shape[1]
    motion = np.zeros((count, LEAD))
    motion[:, ELAPSED], motion[:, PRESENT_VELOCITY] = block.period, block.velocity
    results = np.zeros((count, RESULT_SIZE + 3 * n_z + 2 * n_p))
    results[:, FRICTION_STD], results[:, STATUS] = block.friction_std, block.status
    results[:, RESULT_SIZE : RESULT_SIZE + n_z] = block.element_force
    results[:, RESULT_SIZE + 3 * n_z : RESULT_SIZE + 3 * n_z + n_p] = block.parameters
    ahead, out = np.empty((count, AHEAD_WIDTH)), np.empty(count)
    compensator.fill_ahead(motion, block.reference_position, block.reference_velocity, ahead)
    compensator.fill(motion, results, ahead, block.effects_force, block.effects_factor, out)
    return out


def _model(friction: FrictionSettings | None = None) -> ModelArrays:
    return model_arrays(friction or FrictionSettings(), mass=10.0)


def _parameters(names: tuple[str, ...] = ()) -> ParameterArrays:
    return parameter_arrays(EstimatorSettings(parameters=names), _model())


def _sine(count: int, amplitude: float = 2e-4, frequency: float = 5.0) -> Block:
    time = PERIOD * np.arange(count)
    omega = 2.0 * np.pi * frequency
    position = amplitude * np.sin(omega * time)
    velocity = omega * amplitude * np.cos(omega * time)
    return Block(
        period=np.full(count, PERIOD),
        velocity=velocity,
        element_force=np.zeros((count, 4)),
        parameters=np.zeros((count, 0)),
        friction_std=np.zeros(count),
        reference_position=position,
        reference_velocity=velocity,
        effects_force=np.zeros(count),
        effects_factor=np.ones(count),
        status=np.zeros(count, dtype=np.uint8),
    )


def _part(block: Block, first: int, last: int) -> Block:
    return Block(**{name: getattr(block, name)[first:last] for name in block.__dataclass_fields__})


def test_off_until_enabled() -> None:
    compensator = Compensator(CompensationSettings(), _model(), _parameters())
    assert not np.any(compensate(compensator, _sine(3000)))


def test_steady_sliding_is_the_stribeck_curve_with_the_viscous_term() -> None:
    block = _sine(2000)
    speed = 0.01
    block = replace(
        block,
        reference_position=speed * PERIOD * np.arange(2000),
        reference_velocity=np.full(2000, speed),
    )
    out = compensate(Compensator(ON, _model(), _parameters()), block)
    assert out[-1] == pytest.approx(4.0 + 20.0 * speed, rel=1e-6)


@settings(max_examples=20, deadline=None)
@given(cuts=st.lists(st.integers(0, 3000), max_size=12), look_ahead=st.sampled_from([0.0, 3e-4]))
def test_the_split_into_blocks_does_not_change_a_bit(cuts: list[int], look_ahead: float) -> None:
    chosen = replace(ON, look_ahead=look_ahead)
    block = _sine(3000)
    whole = compensate(Compensator(chosen, _model(), _parameters()), block)
    edges = [0, *sorted(cuts), 3000]
    split = Compensator(chosen, _model(), _parameters())
    parts = [compensate(split, _part(block, a, b)) for a, b in itertools.pairwise(edges)]
    assert np.array_equal(whole, np.concatenate(parts))


def test_look_ahead_leads_by_its_time() -> None:
    block = _sine(6000)
    now = compensate(Compensator(ON, _model(), _parameters()), block)
    ahead = compensate(Compensator(replace(ON, look_ahead=5 * PERIOD), _model(), _parameters()), block)
    late = np.sqrt(np.mean((ahead[3000:-5] - now[3000:-5]) ** 2))
    aligned = np.sqrt(np.mean((ahead[3000:-5] - now[3005:]) ** 2))
    assert aligned < 0.2 * late  # the look-ahead is one coarser step


@pytest.mark.parametrize("status", [Status.SAMPLE_REJECTED, Status.PREDICTING, Status.FALLBACK_NOT_FINITE])
def test_data_that_stay_bad_end_at_zero(status: Status) -> None:
    block = _sine(4000)
    block.status[2000:] = int(status)
    out = compensate(Compensator(ON, _model(), _parameters()), block)
    assert np.max(np.abs(out[1500:2000])) > 1.0
    assert not np.any(out[2000 + round(ON.timeout / PERIOD) + 10 :])


def test_one_rejected_sample_is_hardly_felt() -> None:
    block = _sine(4000)
    out = compensate(Compensator(ON, _model(), _parameters()), block)
    block.status[2500] = int(Status.SAMPLE_REJECTED)
    other = compensate(Compensator(ON, _model(), _parameters()), block)
    assert np.max(np.abs(out - other)) < 0.02 * np.max(np.abs(out))


def test_uncertainty_fades_it() -> None:
    block = _sine(4000)
    full = compensate(Compensator(ON, _model(), _parameters()), block)
    faded = compensate(Compensator(ON, _model(), _parameters()), replace(block, friction_std=np.full(4000, 0.75)))
    gone = compensate(Compensator(ON, _model(), _parameters()), replace(block, friction_std=np.full(4000, 1.0)))
    unknown = compensate(Compensator(ON, _model(), _parameters()), replace(block, friction_std=np.full(4000, math.nan)))
    assert np.max(np.abs(faded - 0.5 * full)) < 0.05 * np.max(np.abs(full))
    assert not np.any(gone)
    assert not np.any(unknown)


@pytest.mark.parametrize("model", ["sgms", "gms"])
def test_a_resting_reference_holds_whatever_the_measurement_does(model: str) -> None:
    count = 4000
    block = _sine(count)
    position = np.minimum(0.01 * PERIOD * np.arange(count), 0.01 * PERIOD * 1000)
    noise = np.random.default_rng(5).normal(0.0, 1e-3, count)
    block = replace(
        block,
        velocity=noise,
        element_force=np.random.default_rng(6).normal(0.0, 1.0, (count, 4)),
        reference_position=position,
        reference_velocity=np.where(np.arange(count) < 1000, 0.01, 0.0),
    )
    out = compensate(Compensator(ON, _model(FrictionSettings(model=model)), _parameters()), block)
    assert np.ptp(out[1100:]) == 0.0
    assert out[-1] > 1.0


def test_estimated_parameters_are_used() -> None:
    block = _sine(4000)
    names = ("coulomb_force", "offset")
    estimates = np.tile([3.0, 0.5], (4000, 1))
    block = replace(
        block,
        parameters=estimates,
        reference_position=0.02 * PERIOD * np.arange(4000),
        reference_velocity=np.full(4000, 0.02),
    )
    out = compensate(Compensator(ON, _model(), _parameters(names)), block)
    assert out[-1] == pytest.approx(3.0 + 0.5 + 20.0 * 0.02, rel=1e-6)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 2**31),
    poison=st.sampled_from(["velocity", "element_force", "friction_std", "reference_position", "reference_velocity",
                            "effects_force", "effects_factor", "period"]),
    value=st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e300, 0.0]),
)  # fmt: skip
def test_poisoned_input_stays_inside_limit_and_slew_and_is_overcome(seed: int, poison: str, value: float) -> None:
    rng = np.random.default_rng(seed)
    block = _sine(4000)
    values = getattr(block, poison).copy()
    values[rng.integers(500, 2000, 50)] = value
    chosen = replace(ON, limit=3.0)
    out = compensate(Compensator(chosen, _model(), _parameters()), replace(block, **{poison: values}))
    assert np.all(np.isfinite(out))
    assert np.max(np.abs(out)) <= 3.0
    assert np.max(np.abs(np.diff(out))) <= chosen.slew_limit * PERIOD * (1.0 + 1e-9) or poison == "period"
    clean = compensate(Compensator(chosen, _model(), _parameters()), block)
    assert np.max(np.abs(out[3500:] - clean[3500:])) < 0.02


def test_after_an_interruption_it_ramps_up_from_what_was_published() -> None:
    block = _sine(4000)
    compensator = Compensator(ON, _model(), _parameters())
    before = compensate(compensator, _part(block, 0, 2000))
    compensator.continue_from(0.0)
    after = compensate(compensator, _part(block, 2000, 4000))
    assert abs(before[-1]) > 1.0
    assert abs(after[0]) <= ON.slew_limit * PERIOD
    assert abs(after[round(0.5 * ON.timeout / PERIOD)]) < 0.7 * np.max(np.abs(before))
    assert np.array_equal(after[200:], compensate(Compensator(ON, _model(), _parameters()), block)[2200:])
