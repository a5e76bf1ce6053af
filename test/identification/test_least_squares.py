"""The inverse dynamic model against data made for it, and against the published parameters of EMPS."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.signal import lfilter

from sgms_observer.errors import DataError
from sgms_observer.identification.confidence import (
    _correlation_bandwidth,
    _long_run_covariance,
    least_squares_covariance,
)
from sgms_observer.identification.least_squares import ASYMMETRIC, fit_inverse_model, regression
from sgms_observer.offline.recording import Recording

DATA = Path(os.environ.get("SGMS_DATA", Path(__file__).resolve().parents[3] / "shared" / "data")) / "emps"
PUBLISHED = {"mass": 95.1089, "viscous_coefficient": 203.5034, "coulomb_force": 20.3935, "offset": -3.1648}


def _emps(name: str) -> Recording:
    if not (DATA / name).exists():
        pytest.skip(f"EMPS data are not at {DATA}; set SGMS_DATA to the folder that holds emps/")
    data = loadmat(str(DATA / name))
    effort = float(data["gtau"].item()) * data["vir"].ravel()
    return Recording(name, 1e-3, data["qm"].ravel().astype(float), effort, data["qg"].ravel().astype(float))


def _sliding_axis(seed: int, noise: float) -> Recording:
    period = 1e-3
    time = period * np.arange(20_000)
    position = 0.05 * np.sin(2.0 * np.pi * 0.5 * time) + 0.01 * np.sin(2.0 * np.pi * 1.7 * time)
    velocity = np.gradient(position, period)
    acceleration = np.gradient(velocity, period)
    effort = 12.0 * acceleration + 30.0 * velocity + 4.0 * np.sign(velocity) - 0.7
    effort = effort + np.random.default_rng(seed).normal(0.0, noise, len(time))
    return Recording("made", period, position, effort, np.full(len(time), np.nan))


def test_recovers_known_parameters() -> None:
    fit = fit_inverse_model([_sliding_axis(seed=3, noise=0.05)])
    assert fit.value("mass") == pytest.approx(12.0, rel=1e-2)
    assert fit.value("viscous_coefficient") == pytest.approx(30.0, rel=1e-2)
    assert fit.value("coulomb_force") == pytest.approx(4.0, rel=1e-2)
    assert fit.value("offset") == pytest.approx(-0.7, rel=1e-2)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    inside = 0
    seeds = range(40)
    for seed in seeds:
        fit = fit_inverse_model([_sliding_axis(seed, noise=1.0)])
        inside += abs(fit.value("mass") - 12.0) < 1.96 * fit.std_error[0]
    assert 0.80 <= inside / len(seeds) <= 1.0


def test_emps_published_parameters() -> None:
    train, pulses = _emps("DATA_EMPS.mat"), _emps("DATA_EMPS_PULSES.mat")
    fit = fit_inverse_model([train])
    for name, published in PUBLISHED.items():
        assert fit.value(name) == pytest.approx(published, rel=0.01), name
    assert 100.0 * fit.relative_error == pytest.approx(4.08, rel=0.01)
    other = regression(pulses, fit.names, fit.cutoff)
    residual = np.linalg.norm(other.effort - other.regressor @ fit.values) / np.linalg.norm(other.effort)
    assert 100.0 * residual == pytest.approx(5.98, rel=0.01)
    asymmetric = fit_inverse_model([train], ASYMMETRIC)
    assert 100.0 * asymmetric.relative_error == pytest.approx(3.11, rel=0.01)


def test_one_way_motion_is_refused_with_a_sentence() -> None:
    period = 1e-3
    position = 0.01 * period * np.arange(10_000)
    still = Recording("still", period, position, np.ones(10_000), np.full(10_000, np.nan))
    with pytest.raises(DataError, match=r"apart|never excite"):
        fit_inverse_model([still])


def test_a_piece_without_rows_has_no_scores() -> None:
    """A piece that is shorter than the filters take to settle leaves none; numpy warned of means of nothing."""
    rng = np.random.default_rng(3)
    jacobian, residual = rng.normal(size=(300, 2)), rng.normal(size=300)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        covariance = least_squares_covariance([jacobian, jacobian[:0]], [residual, residual[:0]])
    assert np.array_equal(covariance, least_squares_covariance([jacobian], [residual]))


def test_long_run_covariance_is_the_sum_over_lags_with_weights_of_bartlett() -> None:
    rng = np.random.default_rng(4)
    scores = lfilter([1.0], [1.0, -0.9], rng.normal(size=(500, 3)), axis=0) * [1.0, 1.0e-6, 50.0]
    centred = scores - scores.mean(axis=0)
    lags = _correlation_bandwidth(centred / centred.std(axis=0))
    assert lags > 10
    expected = centred.T @ centred
    for lag in range(1, lags + 1):
        product = centred[lag:].T @ centred[:-lag]
        expected += (1.0 - lag / (lags + 1.0)) * (product + product.T)
    assert _long_run_covariance(scores) == pytest.approx(expected, rel=1e-9)
