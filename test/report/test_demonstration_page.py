"""The page of a demonstration, without a graph: warnings, lead, questions, and the whole run in a plot that zooms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report

from sgms_observer.report.demonstration import Half
from sgms_observer.report.demonstration_run import Evaluated, demonstration_page
from sgms_observer.report.page import BAD, GOOD, UNSURE, write_page
from sgms_observer.report.run_pictures import Run, Tracking
from sgms_observer.settings.axis import AxisSettings

WITHOUT = Half(10_000, 0.02, 0.005, 0.96, 3.0e-6, 6.0e-6, math.nan, 3.0e-6, 6.0e-6)
WITH = Half(10_000, 0.02, 0.005, 0.96, 3.0e-7, 2.0e-6, 0.0, 3.0e-7, 2.0e-6)


def _evaluated(name: str) -> Evaluated:
    time = 1e-3 * np.arange(20_000)
    reference = 1e-3 * np.sin(3.0 * time)
    error = np.where(time < 10.0, 3.0e-6, 3.0e-7) * np.cos(9.0 * time)
    velocity = 3e-3 * np.cos(3.0 * time)
    friction = 4.0 * np.tanh(velocity / 1e-4)
    deviation = np.full(time.size, 0.03)
    run = Run(time, reference + error, velocity, reference, friction + 0.02, deviation, friction, friction)
    return Evaluated(AxisSettings(name), run, Tracking(time, error), 10.0, WITHOUT, WITH, 1.0, 20_000, 20_000)


def test_the_page_reads_well_and_is_of_the_same_kind_as_the_others(tmp_path: Path, browser: Browser) -> None:
    page = demonstration_page([_evaluated("x"), _evaluated("y")], "All is well.", ["Warning: late."], "bag")
    assert len(page.plots) == 2 and len(page.lead) == 2 and page.warnings == ["Warning: late."]
    assert {light.topic for light in page.lights} == {"Friction", "Tracking", "Live run"}
    assert all(light.state == GOOD for light in page.lights)
    assert "The replay reproduces 20000 of 20000 live estimates exactly." in {light.answer for light in page.lights}
    assert any(light.question.endswith("of y smaller with compensation?") for light in page.lights)
    check_report(browser, write_page(page, tmp_path), 18)


@pytest.mark.parametrize(
    "changes, question, state",
    [
        ({"with_it": replace(WITH, tracking_peak=7.0e-6)}, "Is the tracking error", UNSURE),
        ({"with_it": replace(WITH, tracking_peak=7.0e-6, tracking_rms=4.0e-6)}, "Is the tracking error", BAD),
        ({"with_it": replace(WITH, late_share=0.01)}, "Did every compensation", UNSURE),
        ({"with_it": replace(WITH, late_share=0.9, clear_rms=math.nan)}, "Did every compensation", UNSURE),
        ({"with_it": replace(WITH, late_share=math.nan)}, "Did every compensation", UNSURE),
        ({"without": replace(WITHOUT, coverage=0.5)}, "Is the estimated friction", BAD),
        ({"share": 0.4}, "Does every sample", BAD),
        ({"same": 19_999}, "Does the replay", BAD),
    ],
)
def test_lights_show_what_went_wrong(changes: dict[str, object], question: str, state: str) -> None:
    page = demonstration_page([replace(_evaluated("x"), **changes)], "Not all is well.", [], "bag")
    assert [light.state for light in page.lights if light.question.startswith(question)] == [state]
    assert [light.state for light in page.lights].count(GOOD) == 4
