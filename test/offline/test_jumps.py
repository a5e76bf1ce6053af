"""Jumps of the position are found, and no motion is taken for one, whatever its rate and encoder."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sgms_observer.errors import DataError
from sgms_observer.observer.samples import Samples
from sgms_observer.offline.jumps import find_jumps, without_jumps
from sgms_observer.offline.recording import recordings_from_samples

RATES = (20.0, 50.0, 100.0, 500.0, 1000.0, 10_000.0)
COUNT = 6000
MANY = settings(max_examples=80, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])


def moves(time: np.ndarray, draw: np.random.Generator, shortest: float) -> np.ndarray:
    """Return quick moves back and forth or stick-slip of stroke 1, each of ``shortest`` sample periods at least."""
    period, position = float(time[1]), np.zeros(len(time))
    length = draw.uniform(shortest, 10.0 * shortest) * period
    pause = length + draw.uniform(20.0, 200.0) * period
    has_one_direction = draw.random() < 0.5
    for number, start in enumerate(np.arange(pause, time[-1], pause)):
        share = np.clip((time - start - draw.uniform(0.0, period)) / length, 0.0, 1.0)
        position += share**2 * (3.0 - 2.0 * share) * (1.0 if has_one_direction or number % 2 else -1.0)
    return position


def motion(kind: str, rate: float, draw: np.random.Generator) -> np.ndarray:
    """Return positions of a stage, about 1 in size."""
    time = np.arange(COUNT) / rate
    if kind == "quick":
        return moves(time, draw, 3.0)
    if kind == "triangle":
        return np.abs(np.mod(draw.uniform(1.0e-4, 0.01) * np.arange(COUNT), 2.0) - 1.0)
    rates = rate * 10.0 ** draw.uniform(-4.0, -0.7, 3)
    return sum(
        draw.random() * np.sin(2.0 * np.pi * one * time + draw.uniform(0.0, 6.0)) for one in rates
    ) + draw.uniform(-1.0, 1.0) * time * (kind == "one way")


def stamps(rate: float) -> np.ndarray:
    """Return even stamps [ns]."""
    return np.round(np.arange(COUNT) * 1.0e9 / rate).astype(np.int64)


def samples(position: np.ndarray, rate: float = 1000.0, reference: np.ndarray | None = None) -> Samples:
    """Return samples with an effort."""
    nothing = np.full(len(position), np.nan)
    set_points = nothing if reference is None else reference
    return Samples(stamps(rate)[: len(position)], position, np.cos(position), set_points, nothing)


@MANY
@given(
    kind=st.sampled_from(["sines", "one way", "triangle", "quick"]), rate=st.sampled_from(RATES),
    seed=st.integers(0, 10_000), stroke=st.floats(1.0e-5, 1.0e3), steps=st.sampled_from([0.0, 30.0, 3.0e3, 1.0e5]),
    noise=st.sampled_from([0.0, 1.0e-6, 1.0e-3]), held=st.sampled_from([1, 1, 2, 4]),
    lost=st.sampled_from([0.0, 0.0, 1.0e-3, 0.3]),
)  # fmt: skip
def test_no_motion_is_a_jump(
    kind: str, rate: float, seed: int, stroke: float, steps: float, noise: float, held: int, lost: float
) -> None:
    """A slow log of a fast axis, a coarse encoder, a sensor that is read less often, and lost samples."""
    draw = np.random.default_rng(seed)
    position = motion(kind, rate, draw) + noise * draw.standard_normal(COUNT)
    if steps:
        position = np.round(steps * position) / steps
    if kind != "quick":  # a move between two readings of the sensor is a jump
        position = position[np.arange(COUNT) // held * held]
    kept = draw.random(COUNT) >= lost
    assert len(find_jumps(stroke * position[kept], stamps(rate)[kept])) == 0


@MANY
@given(
    rate=st.sampled_from([50.0, 1000.0]), seed=st.integers(0, 10_000), speed=st.floats(0.3, 3.0),
    period=st.sampled_from([2.0 * np.pi, 360.0, 65_536.0, 4000.0]), start=st.floats(0.0, 1.0),
)  # fmt: skip
def test_an_angle_that_wraps_is_unwrapped(rate: float, seed: int, speed: float, period: float, start: float) -> None:
    """Turns back and forth by several periods, also with a reference, from 0 or from the middle."""
    draw = np.random.default_rng(seed)
    time = np.arange(COUNT) / COUNT
    turns = 5.0 * speed * np.sin(2.0 * np.pi * draw.uniform(0.5, 2.0) * time) + draw.uniform(0.0, 3.0) * time
    step = 1.0 if period > 1000.0 else 1.0e-5 * period
    true = step * np.floor((turns * period + draw.normal(0.0, step, COUNT)) / step)
    lag = 0.01 * period * np.sin(9.0 * time)
    wrapped = np.mod(true + start * period, period) - start * period
    set_points = np.mod(true + lag + start * period, period) - start * period
    done = without_jumps(samples(wrapped, rate, set_points), "log", "rad")
    (note,) = done.notes
    told = re.fullmatch(r"log: the position wraps \d+ times by (\S+) rad; it was unwrapped", note)
    assert told and float(told[1]) == pytest.approx(period, rel=1.0e-3 if period == 4000.0 else 1.0e-5)
    assert len(done.cuts_ns) == 0
    off = abs(float(told[1]) - period) if period == 4000.0 else 0.0  # by noise of one count, in a counter of any range
    assert np.ptp(done.samples.position - true) < off * (np.ptp(turns) + 1.0) + 1.0e-6 * period
    set_point_lag = done.samples.reference_position - done.samples.position
    assert set_point_lag == pytest.approx(lag, abs=off + 1.0e-6 * period)


def test_an_angle_that_rests_where_it_wraps() -> None:
    """Noise of the encoder takes it back and forth over zero."""
    time = np.arange(COUNT) / 1000.0
    true = np.where(time < 3.0, 0.0, 10.0 * np.sin(time - 3.0)) + np.random.default_rng(1).normal(0.0, 1.0e-4, COUNT)
    done = without_jumps(samples(np.mod(true, 2.0 * np.pi)), "log", "rad")
    assert "it was unwrapped" in done.notes[0]
    assert np.ptp(done.samples.position - true) < 1.0e-6


SLOW = 0.05 * np.sin(2.0 * np.pi * 0.5 * np.arange(COUNT) / 1000.0)


def test_a_homing_cuts_the_recording_with_time_and_size() -> None:
    position = np.round(SLOW + 0.113 * (np.arange(COUNT) >= 2000), 6)
    found = recordings_from_samples(samples(position), "log", unit="m")
    assert [len(piece) for piece in found] == [2000, 4000]
    assert found.notes == (
        "log: the position jumps within one sample by 0.113 m at 2.000 s; the recording is cut there: home the axis"
        " before a recording, and check the encoder",
    )


def test_an_axis_that_is_set_to_zero_once_does_not_wrap() -> None:
    """Its jump is as large as the range of its positions, as that of a counter; a counter wraps more than once."""
    position = 0.1 * np.minimum(np.arange(COUNT) / 3000.0, 1.0) + 1.0e-6 * (np.arange(COUNT) % 2)
    position[3000:] += SLOW[3000:] - 0.1
    assert [note for note in without_jumps(samples(position), "log", "m").notes if "wraps" in note] == []


@pytest.mark.parametrize("count", [1, 2])
def test_single_wrong_positions_are_missing(count: int) -> None:
    """A dropout to zero, and spikes; the motion goes on where it was."""
    right = np.round(0.2 + SLOW, 6)
    position = right.copy()
    for place in (700, 2100, 4900):
        position[place : place + count] = 0.0
    position[3333] += 0.5
    found = recordings_from_samples(samples(position), "log", unit="m")
    (piece,) = found
    assert np.abs(piece.position - right).max() < 2.0e-6
    assert found.notes[0] == (
        f"log: {3 * count + 1} single positions lie far off the motion, the first at 0.700 s; they count as missing:"
        " check the encoder and its cable"
    )


def test_one_wrong_position_and_one_wrap_are_told_in_the_singular() -> None:
    position = np.round(0.2 + SLOW, 6)
    position[1234] += 0.5
    assert without_jumps(samples(position), "log", "m").notes == (
        "log: a single position lies far off the motion, at 1.234 s; it counts as missing: check the encoder and its"
        " cable",
    )
    turning = np.mod(1.2 * np.arange(COUNT) / 1000.0, 2.0 * np.pi)
    assert without_jumps(samples(turning), "log", "rad").notes == (
        "log: the position wraps once by 6.28319 rad; it was unwrapped",
    )


def test_a_counter_wraps_beside_wrong_positions() -> None:
    true = np.floor(30_000.0 * np.arange(COUNT) / 1000.0 + 1.0e4 * SLOW)
    position = np.mod(true, 65_536.0)
    position[[500, 1500]] = 7.0e5
    done = without_jumps(samples(position), "log", "rad")
    assert "wraps 2 times by 65536 rad" in done.notes[0] and "2 single positions" in done.notes[1]
    assert np.nanmax(np.abs(done.samples.position - true)) == 0.0


def test_a_log_of_jumps_alone_is_refused_with_their_times() -> None:
    position = SLOW + 1.0 * (np.arange(COUNT) // 150 % 2)
    with pytest.raises(DataError, match=r"pauses and jumps .* 200 samples; record it again; log: the position jumps"):
        recordings_from_samples(samples(position), "log")


def test_a_jump_of_the_other_axis_cuts_too() -> None:
    other = np.round(SLOW + 0.3 * (np.arange(COUNT) >= 3500), 6)
    found = recordings_from_samples(samples(np.round(SLOW, 6)), "log", samples(other))
    assert [len(piece) for piece in found] == [3500, 2500]
    assert found.notes[0].startswith("log, other axis: the position jumps")
