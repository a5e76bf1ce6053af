"""Figures 2, 3, 5-7: the properties they show, and that the files appear."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.paper import figures
from sgms_observer.paper.conditions import CHOSEN, simulate


@pytest.mark.parametrize("is_gms", [True, False])
def test_hysteresis_returns_to_the_point_it_left(is_gms):
    """Return-point memory: a closed minor loop ends where it began."""
    position, friction = figures.hysteresis(figures.EIGHT, is_gms)
    unit = figures.SLIP_DISTANCE
    at = [int(k) for k in np.flatnonzero(np.abs(position + 0.6 * unit) < 1e-13)]
    assert len(at) >= 1
    steps = np.diff(position, prepend=0.0)
    assert np.sum(friction * steps) > 0.0  # it dissipates


@pytest.mark.parametrize("is_gms", [True, False])
def test_no_drift_below_breakaway(is_gms):
    time, position = figures.drift(figures.EIGHT, is_gms)
    tops = [np.max(position[(time >= t) & (time < t + 0.25)]) for t in (0.5, 1.0, 1.5)]
    swing = np.ptp(position[time > 0.5])
    assert np.ptp(tops) < 0.01 * swing


def test_lag_loop_is_open_for_gms():
    """Frictional lag: at one velocity GMS friction is lower on the way up... and the loop has an area."""
    velocity, friction = figures.lag(figures.EIGHT, True, False)
    half = len(velocity) // 2
    rising = np.interp(1.0e-6, velocity[:half], friction[:half])
    falling = np.interp(1.0e-6, velocity[half:][::-1], friction[half:][::-1])
    assert rising - falling > 0.05


def test_onsets_lie_between_reversal_and_sliding():
    record = simulate(CHOSEN, 2, figures.SEED)
    reversal, sliding = figures.onsets(record)
    assert 0.345 < reversal < 0.355
    assert reversal < sliding < reversal + 0.03


def test_all_figures_are_drawn():
    pictures = [
        *figures.figure_two(), *figures.figure_three(), figures.figure_five(),
        *figures.figures_six_and_seven(),
    ]  # fmt: skip
    wanted = {f"figure{n}{letter}" for n in (2, 3) for letter in "abcd"} | {f"figure{n}" for n in (5, 6, 7)}
    assert {picture.name for picture in pictures} == wanted
    assert all(picture.png.startswith(b"\x89PNG") and "</svg>" in picture.svg for picture in pictures)
