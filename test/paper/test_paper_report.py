"""The page of ``sgms paper``: its answers follow the figures, and it reads well."""

from __future__ import annotations

import base64
import copy
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser
from looks import check_report

from sgms_observer.paper.conditions import ESTIMATORS, MODELS, PAPER, ROWS
from sgms_observer.paper.figures import estimates_over_time
from sgms_observer.paper.report import paper_page
from sgms_observer.paper.table import MAIN, READINGS
from sgms_observer.report.page import BAD, GOOD, UNSURE, write_page


def a_table(factor: float = 0.5) -> dict[str, Any]:
    """Return what table2.json holds, every cell a multiple of the paper's."""
    cells = {r: {m: {e: factor * PAPER[r][m][e] for e in ESTIMATORS} for m in MODELS} for r in ROWS}
    return {
        **copy.deepcopy(cells),
        "standard_deviation": cells,
        "readings": {reading.name: {"mean": cells} for reading in READINGS},
        "dependence": {"stage": {"1 kg": cells}, "process": {"Q": cells}},
        "conditions": {
            "seeds": [1, 2], "period": 2, "mass": 10.0, "bandwidth": 100.0, "noise": 0.1,
            "description": MAIN.description,
        },
    }  # fmt: skip


def a_beyond(error: float = 0.02, kappa: float = 1.01, nis: float = 1.0) -> dict[str, Any]:
    """Return what beyond.json holds."""
    score = {"nrmse": error, "kappa_over_truth_after_ten_periods": kappa}
    found = {"nis_mean": nis, "band_coverage": 0.96}
    rows = dict.fromkeys(ROWS, score)
    return {
        **rows,
        "ladder": {"a step": rows},
        "best_without": {"a part": rows},
        "consistency": {"bounds": [0.7, 1.3], **dict.fromkeys(ROWS, found)},
        "conditions": {"period": 11},
    }


def states(table: dict[str, Any], beyond: dict[str, Any]) -> list[str]:
    """Return the states of the lights, in their order."""
    return [light.state for light in paper_page(table, beyond, []).lights]


def test_all_is_reached() -> None:
    assert states(a_table(), a_beyond()) == [GOOD] * 6
    page = paper_page(a_table(), a_beyond(), [])
    assert "0.02 % of its range, live; the best cell of the paper's Table II is 0.93 %" in page.verdict


def test_a_cell_above_the_papers_is_named() -> None:
    table = a_table()
    table["plus20"]["gms"]["mhe_z"] = 5.0
    light = paper_page(table, a_beyond(), []).lights[0]
    assert light.state == UNSURE
    assert light.answer == "11 of 12 cells are. Above: MHE(z) of GMS at kappa +20 %: 5.00 %."
    assert states(a_table(2.0), a_beyond())[0] == BAD


def test_findings_that_do_not_come_out_are_said() -> None:
    table = a_table()
    table["minus20"]["sgms"]["mhe_zp"] = 9.0
    assert states(table, a_beyond())[1] == UNSURE
    assert states(a_table(), a_beyond(error=1.0))[2] == BAD
    assert [states(a_table(), a_beyond(kappa=kappa))[3] for kappa in (0.95, 1.15, 1.3)] == [GOOD, UNSURE, BAD]
    assert states(a_table(), a_beyond(nis=1.5))[4:] == [UNSURE, UNSURE]


def test_page_reads_well_in_a_browser(tmp_path: Path, browser: Browser) -> None:
    page = write_page(paper_page(a_table(), a_beyond(), [], estimates_over_time()), tmp_path)
    check_report(browser, page, 1)
    plots = re.findall(r'<script type="application/json">(.*?)</script>', page.read_text(encoding="utf-8"))
    for plot in map(json.loads, plots):
        labels = [[line["label"] for line in panel["lines"]] for panel in plot["panels"]]
        assert labels == [["stage", "EKF(z)", "MHE(z,p)"], ["EKF(z)", "MHE(z,p)"], ["velocity"], ["position"]]
    assert len(plots) == len(ROWS)


def test_errors_over_time_are_those_of_the_table() -> None:
    """The start, where an estimator knows no friction yet, does not hide them."""
    for plot in estimates_over_time():
        errors = plot.draw(20_000).content["panels"][1]["lines"]
        for line in errors:
            values = np.frombuffer(base64.b64decode(line["values"]), "<f4")
            assert np.isnan(values[:150]).all() and np.isfinite(values[300:]).all()
            assert 0.005 < np.nanmax(np.abs(values)) < 1.0


@pytest.mark.parametrize("row", ROWS)
def test_every_cell_stands_in_the_table(row: str) -> None:
    cells = [cell for line in paper_page(a_table(), a_beyond(), []).sections[0].tables[0].rows for cell in line]
    for model in MODELS:
        for name in ESTIMATORS:
            assert any(cell.endswith(f"({PAPER[row][model][name]:.2f})") for cell in cells)
