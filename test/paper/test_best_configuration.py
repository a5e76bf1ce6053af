"""Beyond the table: what the best configuration reaches, live, and whether it knows its own error."""

from __future__ import annotations

import numpy as np
import pytest

from sgms_observer.paper import best_configuration as best
from sgms_observer.paper.conditions import CHOSEN, ROWS, simulate

SEEDS = (21, 22)


@pytest.fixture(scope="module")
def records():
    return [simulate(CHOSEN, best.PERIODS, seed) for seed in SEEDS]


@pytest.mark.parametrize("row", ROWS)
def test_half_a_percent_and_kappa_within_ten(records, row):
    result = best.score(best.BEST, records)[row]
    assert result["nrmse"] <= 0.5
    assert result["worst_kappa_error"] <= 0.1


def test_the_best_sees_position_and_effort_only(records):
    """Nothing but the two measured signals and their stamps reaches the estimate."""
    record = records[0]
    blind = record.__class__(**{
        name: getattr(record, name)
        if name in ("stamp_ns", "time", "measured_position", "control_effort")
        else np.full_like(getattr(record, name), np.nan)
        for name in record.__dataclass_fields__
    })  # fmt: skip
    np.testing.assert_array_equal(best.run(best.BEST, record, 0.8).live, best.run(best.BEST, blind, 0.8).live)


def test_each_structural_lever_carries(records):
    few = records[:1]
    least = best.score(best.BEST, few)["minus20"]["nrmse"]
    for name in ("the effort's alignment", "slip memory and attraction (S-GMS)", "estimating kappa"):
        assert best.score(best.WITHOUT[name], few)["minus20"]["nrmse"] > 2.0 * least, name


def test_consistency():
    found = best.consistency(12)
    lower, upper = found["bounds"]
    for row in ROWS:
        assert lower <= found[row]["nis_mean"] <= upper
        assert 0.90 <= found[row]["band_coverage"] <= 0.99
        assert found[row]["share_of_corrections_within_bounds"] >= 0.85


def test_every_run_is_counted(monkeypatch):
    monkeypatch.setattr(best, "LADDER", {"best": best.BEST})
    monkeypatch.setattr(best, "WITHOUT", {})
    runs: list[int] = []
    result = best.beyond(2, 2, lambda: runs.append(1))
    assert len(runs) == best.runs_beyond(2, 2) and set(result["ladder"]) == {"best"}
