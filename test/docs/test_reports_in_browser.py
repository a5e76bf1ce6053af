"""Reports as a reader meets them: drawn, readable on a telephone and on paper, harmless whatever names they show.

The reports of demonstration, identification, diagnosis and fleet are looked at beside the tests that make them.
"""

from __future__ import annotations

import importlib.util
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from browser import Browser
from looks import check_report

from sgms_observer.observer.axis_observer import AxisObserver
from sgms_observer.observer.samples import Samples
from sgms_observer.report.drawing import sheet
from sgms_observer.report.page import Section, Table, write_page
from sgms_observer.settings.load import load_settings

ROOT = Path(__file__).resolve().parents[2]
HOSTILE = "<script>window.taken = 1</script><img src=x onerror='window.taken = 1'>\"'&{{ 7 * 7 }}"


def test_report_shows_what_bags_and_files_say_and_runs_none_of_it(tmp_path: Path, browser: Browser) -> None:
    with sheet("one", f"A picture of {HOSTILE}") as drawn:
        drawn.axes[0].plot([0.0, 1.0], [0.0, 1.0])
    assert drawn.picture is not None
    table = Table([HOSTILE, "N"], [[HOSTILE, "1"]] * 3, HOSTILE)
    section = Section(HOSTILE, [HOSTILE, "word " * 40], [table], [drawn.picture])
    page = write_page(tmp_path, HOSTILE, HOSTILE, [section], HOSTILE)
    view = check_report(browser, page, 1)
    assert len(view.images) == 1 and view.images[0][2].endswith(HOSTILE)


def test_report_of_the_emps_example(tmp_path: Path, browser: Browser, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its page with made-up records in the place of the real ones."""
    spec = importlib.util.spec_from_file_location("emps", ROOT / "examples" / "emps.py")
    assert spec is not None and spec.loader is not None
    emps = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "emps", emps)
    spec.loader.exec_module(emps)
    phase = 0.005 * np.arange(4000)
    effort = 20.0 * np.tanh(20.0 * np.cos(phase)) - 95.0 * 25.0 * 0.05 * np.sin(phase)
    stamps = 10**9 + 1_000_000 * np.arange(phase.size)
    nothing = np.full(phase.size, math.nan)
    samples = Samples(stamps, 0.05 * np.sin(phase), effort, nothing, nothing)
    settings = load_settings(ROOT / "config" / "emps.yaml")
    estimates = AxisObserver(settings.axes[0], settings.sample_period).step(samples)
    observed = [emps.Observed(name, samples, estimates) for name in ("train", HOSTILE)]
    page = tmp_path / "report.html"
    page.write_text(emps.report([item.sentence for item in observed], observed), encoding="utf-8")
    check_report(browser, page, 2)
