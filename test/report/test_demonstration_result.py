"""The figures of a demonstration, without a graph."""

from __future__ import annotations

import json
import math

import pytest

from sgms_observer.report.demonstration_result import Half, axis_result, headline, result_of
from sgms_observer.settings.units import Units


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


def test_a_share_that_is_not_known_is_null() -> None:
    assert axis_result(_half(1.0, 1.0, 0.0), _half(1.0, 1.0, math.nan), 1, 1)["late_share"] is None
