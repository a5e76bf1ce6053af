"""Axes that feel each other: the same bits in any split, the right neighbour, no force from one that went silent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sgms_observer.errors import ConfigurationError
from sgms_observer.observer.all_axes import MAX_AGE_NS, AllAxes
from sgms_observer.observer.axis_observer import AxisObserver, OtherMotion
from sgms_observer.observer.samples import Estimates, Samples
from sgms_observer.settings.axis import AxisSettings, CompensationSettings, EffectSettings, Settings, coupled_number
from sgms_observer.settings.load import settings_from_tree

PERIOD = 1e-3
COUNT = 1200
COUPLED = AxisSettings(
    name="x",
    effects=(EffectSettings("cross_axis_coupling", (1.5, 10.0)),),
    compensation=CompensationSettings(enabled=True, gain=1.0, look_ahead=PERIOD, fade_std=100.0),
)
OTHER = replace(COUPLED, name="y", effects=())


def samples(amplitude: float, frequency: float) -> Samples:
    t = PERIOD * np.arange(COUNT)
    omega = 2.0 * np.pi * frequency
    position, velocity = amplitude * np.sin(omega * t), amplitude * omega * np.cos(omega * t)
    stamps = (np.arange(1, COUNT + 1) * 1_000_000).astype(np.int64)
    return Samples(stamps, position, 4.0 * np.sign(velocity), position, velocity)


def part(block: Samples, first: int, last: int) -> Samples:
    return Samples(*(getattr(block, name)[first:last] for name in block.__dataclass_fields__))


X, Y = samples(2e-3, 1.0), samples(5e-3, 3.0)


def in_blocks(axes: tuple[AxisSettings, ...], size: int, silent_from: int = COUNT) -> list[Estimates]:
    """Return the estimates of the first axis, block by block; the second one's samples end at ``silent_from``."""
    everything, found = AllAxes(axes, PERIOD), []
    for first in range(0, COUNT, size):
        blocks = {0: part(X, first, first + size)}
        if first < silent_from:
            blocks[1] = part(Y, first, min(first + size, silent_from))
        found.append(everything.step(blocks)[0])
    return found


def joined(blocks: list[Estimates], name: str) -> np.ndarray:
    return np.concatenate([getattr(block, name) for block in blocks])


@pytest.mark.parametrize("name", ["friction", "compensation", "innovation"])
def test_any_split_into_blocks_gives_the_same_bits(name: str) -> None:
    whole = joined(in_blocks((COUPLED, OTHER), COUNT), name)
    assert np.array_equal(joined(in_blocks((COUPLED, OTHER), 7), name), whole, equal_nan=True)
    assert np.array_equal(joined(in_blocks((COUPLED, OTHER), 1), name), whole, equal_nan=True)


def test_the_force_is_that_of_the_other_axis() -> None:
    with_it = joined(in_blocks((COUPLED, OTHER), COUNT), "compensation")
    without = joined(in_blocks((replace(COUPLED, effects=()), OTHER), COUNT), "compensation")
    t = PERIOD * (np.arange(COUNT) + 1.0)  # where the look-ahead ends
    omega = 6.0 * np.pi
    expected = -1.5 * 5e-3 * omega**2 * np.sin(omega * t) + 10.0 * 5e-3 * omega * np.cos(omega * t)
    error = (with_it - without - expected)[200:]  # the set-point's acceleration comes from differences
    assert np.sqrt(np.mean(error**2)) < 0.03 * np.sqrt(np.mean(expected**2))


def test_an_axis_that_went_silent_leaves_no_force_behind() -> None:
    with_it = joined(in_blocks((COUPLED, OTHER), 10, silent_from=600), "compensation")
    without = joined(in_blocks((replace(COUPLED, effects=()), OTHER), 10, silent_from=600), "compensation")
    last = 600 + MAX_AGE_NS // 1_000_000
    assert np.abs(with_it - without)[590 : last - 2].min() > 0.0
    assert np.abs(with_it - without)[last + 20 :].max() < 1e-9


def test_an_observer_alone_takes_the_motion_that_it_is_given() -> None:
    zero, one = np.zeros(COUNT), np.ones(COUNT)
    alone = AxisObserver(COUPLED, PERIOD).step(X).compensation
    assert np.array_equal(
        alone, AxisObserver(COUPLED, PERIOD).step(X, OtherMotion(zero, zero, zero, zero)).compensation
    )
    moved = AxisObserver(COUPLED, PERIOD).step(X, OtherMotion(one, zero, 0.1 * one, zero)).compensation
    assert (moved - alone)[300:] == pytest.approx(1.0)


def test_the_neighbour_is_the_axis_before_or_the_one_that_is_named() -> None:
    axes = [replace(OTHER, name=name) for name in ("x", "y", "z")]
    assert [coupled_number(axes, number) for number in range(3)] == [2, 0, 1]
    assert coupled_number([replace(axes[0], coupled_axis="y"), *axes[1:]], 0) == 1
    assert coupled_number(axes[:1], 0) is None
    settings = Settings(axes=tuple(axes))
    assert [settings.coupled_to(axis) for axis in axes] == [axes[2], axes[0], axes[1]]
    tree = {"axes": ["x", "y"], "x": {"coupled_axis": "y"}, "y": {"coupled_axis": "y"}}
    with pytest.raises(ConfigurationError) as caught:
        settings_from_tree(tree)
    assert caught.value.sentences == ("y.coupled_axis = 'y' must name another axis of axes = ['x', 'y']; correct it",)
