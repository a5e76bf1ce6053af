"""Reports as a reader meets them: drawn, readable on a telephone and on paper, harmless whatever names they show."""

from __future__ import annotations

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest
from browser import Browser
from looks import TELEPHONE, check

from sgms_observer.report.drawing import sheet
from sgms_observer.report.page import Section, Table, write_page

ONE_AXIS = """/**:
  ros__parameters:
    axes: [x]
    sample_period: 1.0e-3
    x:
      mass: 3.0
      stage: {friction: {model: gms}, encoder: {noise: 1.0e-9}, force_noise: 0.01}
      filter: {window: 8.0e-3}
      estimator: {kind: mhe, correction_every: 2}
"""
HOSTILE = "<script>window.taken = 1</script><img src=x onerror='window.taken = 1'>\"'&{{ 7 * 7 }}"


def _run(*arguments: str) -> None:
    result = subprocess.run([sys.executable, "-m", "sgms_observer", *arguments], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


@pytest.fixture
def config(tmp_path: Path) -> Path:
    """Return a parameter file that is quick to simulate."""
    file = tmp_path / "axis.yaml"
    file.write_text(ONE_AXIS, encoding="utf-8")
    return file


@pytest.mark.skipif(find_spec("rclpy") is None, reason="ROS 2 is not installed")
def test_report_of_the_demonstration(config: Path, tmp_path: Path, browser: Browser) -> None:
    _run("demo", "--config", str(config), "--duration", "4", "--out", str(tmp_path / "demo"))
    report = tmp_path / "demo" / "report.html"
    check(browser, report)
    view = browser.look(report, TELEPHONE)
    assert len(view.images) >= 4
    assert view.requests == (), "a report must be readable offline"
    assert browser.print(report).startswith(b"%PDF")


def test_report_shows_what_bags_and_files_say_and_runs_none_of_it(tmp_path: Path, browser: Browser) -> None:
    with sheet("one", f"A picture of {HOSTILE}") as drawn:
        drawn.axes[0].plot([0.0, 1.0], [0.0, 1.0])
    assert drawn.picture is not None
    table = Table([HOSTILE, "N"], [[HOSTILE, "1"]] * 3, HOSTILE)
    section = Section(HOSTILE, [HOSTILE, "word " * 40], [table], [drawn.picture])
    page = write_page(tmp_path, HOSTILE, HOSTILE, [section], HOSTILE)
    check(browser, page)
    view = browser.look(page, TELEPHONE)
    assert len(view.images) == 1 and view.images[0][2].endswith(HOSTILE)
    assert view.requests == ()
