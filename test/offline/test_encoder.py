"""Encoder steps are found in exact and in rounded logs, and are not invented."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.offline.encoder import encoder_step, position_noise

TIME = 1.0e-3 * np.arange(20_000)
SMOOTH = 0.05 * np.sin(TIME) + 0.01 * np.sin(9.0 * TIME)


def _on_grid(step: float, position: np.ndarray = SMOOTH) -> np.ndarray:
    return np.round(position / step) * step


@pytest.mark.parametrize("step", [5.0e-8, 1.0e-5, 88.0e-6, 2.0 * np.pi / 4096])
def test_the_step_of_an_exact_log_is_found(step: float) -> None:
    assert encoder_step(_on_grid(step)) == pytest.approx(step, rel=1e-4)


@pytest.mark.parametrize("log", [1.0e-5, 2.0e-5])
def test_the_step_is_found_where_the_log_rounds_it(log: float) -> None:
    assert encoder_step(_on_grid(log, _on_grid(88.0e-6))) == pytest.approx(88.0e-6, rel=0.01)


def test_single_precision_and_degrees_do_not_hide_the_step() -> None:
    step = 2.0 * np.pi / 4096
    assert encoder_step(_on_grid(step).astype(np.float32).astype(float)) == pytest.approx(step, rel=1e-3)
    assert encoder_step(np.rad2deg(_on_grid(step))) == pytest.approx(np.rad2deg(step), rel=1e-4)


def test_no_step_is_invented() -> None:
    noise = np.random.default_rng(2).normal(0.0, 5.0e-9, len(TIME))
    assert encoder_step(SMOOTH) == 0.0
    assert encoder_step(SMOOTH + noise) == 0.0
    assert encoder_step(np.zeros(500)) == 0.0


@pytest.mark.parametrize("frequency", [0.5, 1.25])
def test_a_motion_that_repeats_exactly_is_no_coarse_encoder(frequency: float) -> None:
    time = np.arange(6000) / 250.0
    position = np.round(0.02 * np.sin(2.0 * np.pi * frequency * time) / 1.0e-8) * 1.0e-8
    assert encoder_step(position) < 1.1e-8  # 1.6 and 9.8 um from the few differences near the reversals alone


def test_noise_of_a_moving_axis_is_that_of_its_encoder() -> None:
    noise = np.random.default_rng(2).normal(0.0, 5.0e-8, len(TIME))
    assert position_noise(SMOOTH + noise) == pytest.approx(5.0e-8, rel=0.1)
    assert position_noise(_on_grid(1.0e-5)) >= 1.0e-5 / np.sqrt(12.0)
