"""Block V: exact on what it must be exact on, one delay for everything, the same bits for any split."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sgms_observer.errors import ConfigurationError
from sgms_observer.filters.differentiator import Differentiator, effort_noise_gain, window_samples
from sgms_observer.filters.motion import IS_DENSE, IS_REJECTED, LEAD
from sgms_observer.settings.axis import FilterSettings

KINDS = ("lowpass", "savgol", "kalman")
START_NS = 1_700_000_000_123_456_789
SEED = 4


def stamps(count: int, period: float, jitter: float = 0.0, keep: float = 1.0) -> np.ndarray:
    """Return increasing stamps [ns] with uniform jitter, of which a share ``keep`` arrived."""
    random = np.random.default_rng(SEED)
    ns = START_NS + np.arange(count) * round(period * 1e9)
    ns = ns + np.round(random.uniform(-jitter, jitter, count) * period * 1e9).astype(np.int64)
    return ns[random.random(count) < keep]


def seconds(stamp_ns: np.ndarray) -> np.ndarray:
    """Return stamps as seconds since the first."""
    return (stamp_ns - stamp_ns[0]) * 1e-9


def instants(motion, stamp_ns: np.ndarray) -> np.ndarray:
    """Return the time of each row's instant: the sample's less what the lead periods bridge [s]."""
    return seconds(stamp_ns) - motion.table[:, LEAD + motion.delay_samples :].sum(axis=1)


@pytest.mark.parametrize("period", [1e-4, 1e-3])
@pytest.mark.parametrize("jitter, keep", [(0.0, 1.0), (0.2, 1.0), (0.2, 0.9)])
@pytest.mark.parametrize("degree", [2, 3, 5])
def test_savgol_is_exact_on_polynomials_of_its_degree(period, jitter, keep, degree):
    random = np.random.default_rng(SEED)
    coefficients = random.normal(size=degree + 1)
    settings = FilterSettings(kind="savgol", degree=degree, window=12 * period, jump_speed=1e6)
    differentiator = Differentiator(settings, period)
    ns = stamps(200, period, jitter, keep)
    scale = 100 * period  # the polynomial's own time, so that every term counts
    q = np.polynomial.Polynomial(coefficients)
    x = seconds(ns) / scale
    motion = differentiator.step(ns, q(x), np.zeros(len(ns)))
    ready = motion.is_ready
    assert ready.sum() == len(ns) - window_samples(differentiator.settings, period) + 1
    at = instants(motion, ns) / scale
    np.testing.assert_allclose(motion.position[ready], q(at)[ready], atol=1e-10)
    np.testing.assert_allclose(motion.velocity[ready] * scale, q.deriv(1)(at)[ready], atol=1e-7)
    np.testing.assert_allclose(motion.acceleration[ready] * scale**2, q.deriv(2)(at)[ready], atol=1e-4)
    np.testing.assert_allclose(motion.present_velocity[ready] * scale, q.deriv(1)(x)[ready], atol=1e-6)
    np.testing.assert_allclose(motion.present_acceleration[ready] * scale**2, q.deriv(2)(x)[ready], atol=1e-3)
    np.testing.assert_allclose(motion.present_position[ready], q(x)[ready], atol=1e-9)


@pytest.mark.parametrize("jitter, keep", [(0.0, 1.0), (0.2, 0.9)])
def test_kalman_is_exact_on_constant_acceleration(jitter, keep):
    differentiator = Differentiator(FilterSettings(kind="kalman", lag=5e-4), 1e-4)
    ns = stamps(2000, 1e-4, jitter, keep)
    q = np.polynomial.Polynomial([0.2, 0.01, 0.15])
    motion = differentiator.step(ns, q(seconds(ns)), np.zeros(len(ns)))
    settled = np.arange(len(ns)) > 300
    at = instants(motion, ns)
    np.testing.assert_allclose(motion.velocity[settled], q.deriv(1)(at)[settled], atol=1e-8)
    np.testing.assert_allclose(motion.acceleration[settled], q.deriv(2)(at)[settled], atol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_every_output_has_the_delay_it_claims(kind):
    """A slow sine through the filter: the phase of every output, to a hundredth of a sample."""
    period, frequency = 1e-4, 8.0
    # the tracking filter's delay is its lag once that is long against its time constants
    differentiator = Differentiator(FilterSettings(kind=kind, effort_is_held=False, lag=6e-3), period)
    ns = stamps(10_000, period)
    angle = 2 * math.pi * frequency * seconds(ns)
    motion = differentiator.step(ns, np.sin(angle), np.sin(angle))
    late = slice(5000, 10_000)  # four whole periods
    for name, ahead in (("position", 0.0), ("velocity", 0.25), ("acceleration", 0.5), ("effort", 0.0)):
        signal = getattr(motion, name)[late]
        carrier = np.exp(-1j * angle[late])
        phase = np.angle(np.sum(signal * carrier) / np.sum(np.sin(angle[late]) * carrier))
        lag = (2 * math.pi * ahead - phase) / (2 * math.pi * frequency)
        lag = (lag + 0.5 / frequency) % (1 / frequency) - 0.5 / frequency
        assert lag == pytest.approx(differentiator.delay, abs=0.01 * period), name


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("jitter, keep", [(0.0, 1.0), (0.2, 0.9)])
def test_effort_is_weighted_exactly_as_the_acceleration(kind, jitter, keep):
    """A free mass under steps and noise, held between samples: u - m a vanishes although u is anything but smooth."""
    if kind == "lowpass" and jitter:
        pytest.skip("the low-pass averages over uneven periods only approximately")
    random = np.random.default_rng(SEED)
    mass, period = 2.0, 1e-3
    ns = stamps(3000, period, jitter, keep)
    effort = random.normal(size=len(ns)) + np.repeat(random.choice([-5.0, 5.0], 100), 30)[: len(ns)]
    h = np.diff(ns) * 1e-9
    velocity = np.concatenate(([0.0], np.cumsum(effort[:-1] / mass * h)))
    position = np.concatenate(([0.0], np.cumsum(velocity[:-1] * h + 0.5 * effort[:-1] / mass * h * h)))
    settings = FilterSettings(kind=kind, cutoff=100.0, lag=4e-3, position_noise=1e-6, window=14e-3)
    motion = Differentiator(settings, period).step(ns, position, effort)
    settled = np.arange(len(ns)) > 400
    left_over = motion.effort - mass * motion.acceleration
    assert np.std(motion.effort[settled]) > 1.0
    np.testing.assert_allclose(left_over[settled], 0.0, atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
def test_any_split_into_blocks_gives_the_same_bits(kind):
    random = np.random.default_rng(SEED)
    ns = stamps(700, 1e-4, 0.2, 0.95)
    ns[300:] += 100_000_000  # a pause beyond maximum_gap
    position = np.cumsum(random.normal(size=len(ns))) * 1e-6
    effort = random.normal(size=len(ns))
    effort[120:125] = np.nan
    position[200] = np.nan
    differentiator = Differentiator(FilterSettings(kind=kind), 1e-4)
    whole = differentiator.step(ns, position, effort).table
    differentiator.reset()
    again = differentiator.step(ns, position, effort).table
    differentiator.reset()
    cuts = np.sort(random.integers(0, len(ns), 80))
    parts = [
        differentiator.step(a, b, c).table
        for a, b, c in zip(*(np.split(x, cuts) for x in (ns, position, effort)), strict=True)
    ]
    np.testing.assert_array_equal(whole, again)
    np.testing.assert_array_equal(whole, np.concatenate(parts))


@pytest.mark.parametrize("kind", KINDS)
def test_lead_velocities_bridge_the_delay(kind):
    ns = stamps(3000, 1e-4, 0.1)
    t = seconds(ns)
    motion = Differentiator(FilterSettings(kind=kind), 1e-4).step(ns, 2e-4 * np.sin(2 * math.pi * 5 * t), 0 * t)
    ready = motion.is_ready & (np.arange(len(ns)) > 500)
    lead_velocity, lead_period = np.split(motion.table[:, LEAD:], 2, axis=1)
    travel = (lead_velocity * lead_period).sum(axis=1)
    np.testing.assert_allclose((motion.position + travel)[ready], motion.present_position[ready], atol=2e-9)
    truth = 2e-4 * 10 * math.pi * np.cos(2 * math.pi * 5 * t)
    np.testing.assert_allclose(motion.present_velocity[ready], truth[ready], atol=3e-5)
    step = np.diff(motion.position, prepend=0)
    np.testing.assert_allclose(motion.step_velocity[ready] * motion.period[ready], step[ready])


@pytest.mark.parametrize("kind", KINDS)
def test_missing_effort_is_missing_only_where_it_is_needed(kind):
    ns = stamps(2000, 1e-4)
    t = seconds(ns)
    effort = np.sin(40 * t)
    gone = effort.copy()
    gone[1000:1003] = np.nan
    complete = Differentiator(FilterSettings(kind=kind), 1e-4).step(ns, 0 * t, effort).effort
    missing = Differentiator(FilterSettings(kind=kind), 1e-4).step(ns, 0 * t, gone).effort
    rows = np.flatnonzero(np.isnan(missing) & ~np.isnan(complete))
    assert rows.size > 0
    assert rows[0] >= 1000
    assert rows[-1] < 1000 + 60
    clear = ~np.isnan(missing) & ~np.isnan(complete)
    assert np.abs(missing - complete)[clear].max() < 1e-3 * np.abs(np.diff(effort)).max() * 40


@pytest.mark.parametrize("kind", KINDS)
def test_a_pause_restarts_and_a_bad_sample_is_rejected(kind):
    ns = stamps(600, 1e-4)
    ns[400:] += 30_000_000
    position = 1e-3 * seconds(ns)
    position[100] = np.nan
    ns[150] = ns[149]
    motion = Differentiator(FilterSettings(kind=kind), 1e-4).step(ns, position, np.zeros(600))
    assert np.flatnonzero(motion.is_restart).tolist() == [400]
    assert np.flatnonzero(motion.table[:, IS_REJECTED]).tolist() == [100, 150]
    assert not motion.is_ready[[100, 150]].any()
    assert motion.period[100] == 0.0
    assert motion.is_ready[399] and not motion.is_ready[400:405].any() and motion.is_ready[599]
    assert np.isfinite(motion.table[motion.is_ready]).all()
    np.testing.assert_allclose(motion.velocity[[399, 599]], 1e-3, rtol=1e-4)


@pytest.mark.parametrize("kind", KINDS)
def test_a_jump_and_a_clock_set_back_restart_and_dense_samples_are_marked(kind):
    ns = stamps(900, 1e-4)
    ns[500:] -= 3_600_000_000_000
    position = 0.5 * seconds(stamps(900, 1e-4))  # half a metre per second is no jump, not even at the first sample
    position[200:] -= 0.02  # an encoder that wraps
    ns[700:] -= 60_000 * np.arange(200)
    motion = Differentiator(FilterSettings(kind=kind), 1e-4).step(ns, position, np.zeros(900))
    assert np.flatnonzero(motion.is_restart).tolist() == [200, 500]
    assert np.flatnonzero(motion.is_jump).tolist() == [200]
    assert np.flatnonzero(motion.table[:, IS_DENSE]).tolist() == list(range(701, 900))
    assert not motion.table[:, IS_REJECTED].any()
    assert motion.is_ready[[199, 499]].all() and not motion.is_ready[[200, 500]].any()
    np.testing.assert_allclose(motion.velocity[[199, 499, 690]], 0.5, rtol=1e-4)


def test_the_papers_lowpass_is_the_textbook_one():
    """Against scipy's Butterworth on the finite difference."""
    from scipy.signal import butter, lfilter

    period = 1e-4
    ns = stamps(2000, period)
    q = 2e-4 * np.sin(2 * math.pi * 5 * seconds(ns))
    motion = Differentiator(FilterSettings(kind="lowpass", align_effort=False), period).step(ns, q, np.cos(seconds(ns)))
    b, a = butter(2, 500.0, fs=1 / period)
    velocity = lfilter(b, a, np.diff(q, prepend=q[0]) / period)
    np.testing.assert_allclose(motion.velocity[50:], velocity[50:], atol=1e-12)
    np.testing.assert_allclose(motion.acceleration[50:], np.diff(velocity)[49:] / period, atol=1e-8)
    np.testing.assert_array_equal(motion.effort[50:], np.cos(seconds(ns))[50:])
    assert (motion.delay_samples, motion.table.shape) == (0, (2000, LEAD))


@pytest.mark.parametrize("kind", KINDS)
def test_noise_gain_is_what_noise_really_loses(kind):
    settings = FilterSettings(kind=kind)
    ns = stamps(100_000, 1e-4)
    noise = np.random.default_rng(SEED).normal(size=len(ns))
    effort = Differentiator(settings, 1e-4).step(ns, np.zeros(len(ns)), noise).effort
    assert np.nanstd(effort) == pytest.approx(effort_noise_gain(settings, 1e-4), rel=0.03)


def test_impossible_settings_are_refused_in_sentences():
    with pytest.raises(ConfigurationError, match=r"filter.cutoff = 500 Hz must be below half the sample rate"):
        Differentiator(FilterSettings(kind="lowpass", cutoff=500.0), 1e-3)
    with pytest.raises(ConfigurationError, match=r"filter.maximum_gap = 0.001 s must be at least two"):
        Differentiator(FilterSettings(maximum_gap=1e-3), 1e-3)
