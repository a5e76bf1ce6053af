"""A page stays below four megabytes, however many axes it has and however long their recordings are."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from looks import LARGEST_PAGE

from sgms_observer.identification.answer import Answer
from sgms_observer.identification.report import IdentifiedAxis, identification_page
from sgms_observer.identification.table import Row
from sgms_observer.identification.trace import Trace, Traces
from sgms_observer.report.drawing import Line, Panel, time_plot
from sgms_observer.report.page import MAX_POINTS, Page, Section, render_page
from sgms_observer.settings.units import Units


def _trace(name: str, seed: int, count: int = 100_000) -> Trace:
    """Return a long noisy piece: noise is what a drawing cannot shorten."""
    noise = np.random.default_rng(seed)
    time = 1e-3 * np.arange(count)
    velocity = 0.05 * np.cos(time) + 1e-3 * noise.normal(size=count)
    friction = 4.0 * np.sign(velocity) + noise.normal(size=count)
    position = 0.05 * np.sin(time) + 1e-5 * noise.normal(size=count)
    return Trace(
        name, time, position, velocity, friction + noise.normal(size=count), noise.normal(size=count), friction,
        np.abs(velocity) > 0.01,
    )  # fmt: skip


ROWS = tuple(Row(f"friction.part[{k}]", 1.0, 0.1, "N", True) for k in range(25))


def identified_axis(name: str, seed: int, rows: tuple[Row, ...] = ROWS) -> IdentifiedAxis:
    """Return an identified axis with long recordings."""
    traces = Traces((_trace("first", seed),), (_trace("second", seed + 100),), np.sign)
    return IdentifiedAxis(name, Units(), Answer({}, {}, rows), traces, 100.0, 0.1, 0.1, True, ())


@pytest.mark.parametrize("axes", [1, 7])
def test_the_page_of_an_identification_stays_small(axes: int) -> None:
    page = identification_page(
        [identified_axis(f"joint_{k}", k) for k in range(axes)], "out.yaml", ["first"], ["second"]
    )
    assert len(page.plots) == 2 * axes
    assert len(render_page(page).encode()) < LARGEST_PAGE


@pytest.mark.parametrize("plots, lines", [(1, 4), (1, 12), (40, 4)])
def test_plots_share_the_points_of_the_page(plots: int, lines: int) -> None:
    time = 1e-3 * np.arange(3 * MAX_POINTS)
    wave = np.random.default_rng(1).normal(size=time.size)
    panels = [Panel("force [N]", [Line(f"line {k}", wave, "measured") for k in range(lines)])]
    sections = [Section("a", plots=[time_plot(f"plot_{k}", "b", time, panels) for k in range(plots)])]
    text = render_page(Page("title", "verdict", sections))
    contents = [json.loads(found) for found in re.findall(r'<script type="application/json">(.*?)</script>', text)]
    assert len(contents) == plots
    size = sum(len(content["time"]) * (1 + lines) for content in contents)
    assert size < 0.4 * LARGEST_PAGE
    assert min(len(content["time"]) for content in contents) > 500
