"""The figures of a demonstration, without a graph."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.application.simulate import Simulation, simulate
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.report.demonstration import (
    MIN_RECORDED_SHARE,
    Half,
    axis_result,
    headline,
    late_warnings,
    missing_warnings,
    result_of,
)
from sgms_observer.report.demonstration_run import present
from sgms_observer.report.recorded import SETTLE
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.units import Units

DEMO = Path(__file__).parents[2] / "config" / "demo.yaml"


def _half(rms: float, peak: float, late: float) -> Half:
    return Half(1000, 0.05, 0.0123, 0.95, rms, peak, late, rms, peak)


def test_the_result_is_what_other_programs_read() -> None:
    found = axis_result(_half(3.0e-6, 4.0e-6, math.nan), _half(3.0e-7, 5.0e-6, 0.004), 10, 12)
    assert json.loads(json.dumps(result_of({"x": found}), allow_nan=False)) == {
        "schema": 1,
        "axes": {
            "x": {
                "friction_rms": 0.05,
                "friction_nrmse": 0.0123,
                "tracking": {"rms_before": 3.0e-6, "rms_after": 3.0e-7, "peak_before": 4.0e-6, "peak_after": 5.0e-6},
                "late_share": 0.004,
                "replay_equal": 10,
                "replay_total": 12,
            }
        },
    }


@pytest.mark.parametrize("late, said", [(0.004, "0.4 % of the compensation messages"), (math.nan, "does not tell")])
def test_the_headline_says_rms_peaks_and_late_messages(late: float, said: str) -> None:
    text = headline("x", _half(3.0e-6, 4.0e-6, math.nan), _half(3.0e-7, 8.0e-6, late), Units())
    assert "rms 10.0x smaller (3 um to 0.3 um)" in text
    assert "peak 2.0x larger (4 um to 8 um)" in text
    assert said in text
    assert "1.23 % of its range" in text


def test_an_error_that_hardly_changed_is_about_the_same() -> None:
    text = headline("x", _half(3.0e-6, 4.0e-6, 0.0), _half(2.9e-6, 4.1e-6, 0.0), Units())
    assert "rms about the same (3 um to 2.9 um), peak about the same (4 um to 4.1 um)" in text


@pytest.mark.parametrize("late, clear_peak, is_warned", [
    (0.01, 1.0e-6, True), (0.01, 3.5e-6, True), (0.01, 3.7e-6, False), (0.01, 4.0e-6, False),
    (0.0, 1.0e-6, False), (math.nan, 1.0e-6, False), (0.5, math.nan, True),
])  # fmt: skip
def test_late_compensations_that_make_the_peak_are_a_warning(late: float, clear_peak: float, is_warned: bool) -> None:
    with_it = replace(_half(3.0e-7, 4.0e-6, late), clear_peak=clear_peak)
    (*warned,) = late_warnings("x", _half(3.0e-6, 5.0e-6, math.nan), with_it, Units())
    assert [text.startswith("Warning: axis x: ") and " 4 um, " in text for text in warned] == [True] * is_warned


def test_a_share_that_is_not_known_is_null() -> None:
    assert axis_result(_half(1.0, 1.0, 0.0), _half(1.0, 1.0, math.nan), 1, 1)["late_share"] is None


def test_a_run_of_which_much_is_missing_is_a_warning() -> None:
    assert missing_warnings("x", MIN_RECORDED_SHARE) == []
    (warning,) = missing_warnings("x", 0.22)
    assert "the friction figures are about those alone" in warning
    assert "only 22 % of the samples" in warning and warning.startswith("Warning: axis x")


def test_the_tracking_error_counts_every_sample_also_where_few_estimates_are_published(tmp_path: Path) -> None:
    settings = replace(load_settings(DEMO), publish_every=7)
    bag = tmp_path / "bag"
    simulate(Simulation(settings, 6.0, 1, is_observed=True), str(bag), "mcap", False, lambda _: None)
    truth, reference, estimates = (
        read_joint_states(bag, topic) for topic in ("friction_true", "reference", "friction_estimate")
    )
    assert len(estimates.stamp_ns) < len(truth.stamp_ns) / 6
    switched, answered = (int(estimates.stamp_ns[0] + seconds * 1e9) for seconds in (3.0, 3.1))
    found = present(bag, settings, switched, answered, tmp_path).result["axes"]["x"]["tracking"]
    error = np.abs(truth.position[:, 0] - reference.position[:, 0])
    settled = round(SETTLE * 1e9)
    for begin, end, half in (
        (estimates.stamp_ns[0] + settled, switched, "before"),
        (answered + settled, estimates.stamp_ns[-1], "after"),
    ):
        is_of_half = (truth.stamp_ns >= begin) & (truth.stamp_ns < end)
        peak = np.max(error[is_of_half])
        assert found[f"peak_{half}"] == pytest.approx(peak, rel=1e-9)
        assert found[f"rms_{half}"] == pytest.approx(np.sqrt(np.mean(error[is_of_half] ** 2)), rel=1e-9)
        assert np.max(error[is_of_half & np.isin(truth.stamp_ns, estimates.stamp_ns)]) < peak
