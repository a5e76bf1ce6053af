"""The band keeps the acceleration noise of the encoder out, in any unit and from any start file."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sgms_observer.errors import ConfigurationError, DataError
from sgms_observer.offline.band import NOISE_SHARE, choose_band, refuse_cutoff, rough_mass
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings

PERIOD = 1.0e-3
TIME = PERIOD * np.arange(20_000)
MASS = 12.0


def _recording(noise: float) -> Recording:
    position = 0.05 * np.sin(np.pi * TIME) + 0.01 * np.sin(2.0 * np.pi * 1.7 * TIME)
    velocity = np.gradient(position, PERIOD)
    effort = MASS * np.gradient(velocity, PERIOD) + 30.0 * velocity + 4.0 * np.sign(velocity) - 0.7
    noisy = position + np.random.default_rng(1).normal(0.0, noise, len(TIME))
    return Recording("made", PERIOD, noisy, effort)


def test_a_fine_encoder_is_judged_up_to_a_tenth_of_the_sample_rate() -> None:
    band = choose_band([_recording(1.0e-9)], AxisSettings())
    assert band.corner == pytest.approx(100.0)
    assert "sample rate" in band.sentence()


def test_noise_of_the_acceleration_stays_within_its_share_of_the_effort() -> None:
    recording = _recording(2.0e-5)
    corner = choose_band([recording], AxisSettings()).corner
    noise = recording.position - _recording(0.0).position
    spectrum = np.fft.rfft(noise)
    frequency = np.fft.rfftfreq(len(noise), PERIOD)
    inertial = np.fft.irfft(MASS * (2.0 * np.pi * frequency) ** 2 * spectrum * (frequency < corner), len(noise))
    assert np.std(inertial) == pytest.approx(NOISE_SHARE * np.std(recording.effort), rel=0.25)


def test_the_start_file_does_not_move_the_band() -> None:
    recordings = [_recording(2.0e-5)]
    heavy = replace(AxisSettings(), mass=500.0)
    assert choose_band(recordings, heavy).corner == choose_band(recordings, AxisSettings()).corner
    assert rough_mass(recordings, 500.0) == pytest.approx(MASS, rel=0.15)


def test_units_do_not_move_the_band() -> None:
    recording = _recording(2.0e-5)
    scaled = replace(recording, position=1.0e3 * recording.position, effort=1.0e-2 * recording.effort)
    corners = [choose_band([one], AxisSettings()).corner for one in (scaled, recording)]
    assert corners[0] == pytest.approx(corners[1], rel=0.1)


def test_the_user_overrides_the_band() -> None:
    assert choose_band([_recording(2.0e-5)], AxisSettings(), 7.0).corner == 7.0


@pytest.mark.parametrize("cutoff", [-5.0, math.nan, math.inf])
def test_a_corner_that_is_no_frequency_is_refused(cutoff: float) -> None:
    with pytest.raises(ConfigurationError, match="must be a positive number"):
        refuse_cutoff(cutoff)


@pytest.mark.parametrize("cutoff", [1e-9, 0.1, 500.0, 1e6])
def test_a_corner_beyond_the_recordings_is_refused(cutoff: float) -> None:
    """The diagnosis ended in an internal error at 1e-9 Hz, and took any corner above half the sample rate."""
    with pytest.raises(DataError, match="must lie between"):
        choose_band([_recording(2.0e-5)], AxisSettings(), cutoff)
