"""Tables of a diagnosis's report: numbers as in the pictures beside them, and ranges that say where something is."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sgms_observer.diagnosis import result
from sgms_observer.diagnosis.changed import Changed
from sgms_observer.diagnosis.locate import BINS, Located, locate
from sgms_observer.diagnosis.named import NOT_DETERMINED, Named
from sgms_observer.diagnosis.report_tables import changed_table, effect_tables, located_table, prefixed_unit
from sgms_observer.settings.axis import EffectSettings
from sgms_observer.settings.load import settings_from_tree
from sgms_observer.settings.units import REVOLUTE, Units

NONE = np.zeros(2)


def located(low: float, high: float, visited: float, unit: str = "m") -> Located:
    """Return a coordinate with the largest residuals in a range."""
    return Located("position", unit, NONE, NONE, NONE, 0.5, 0.01, low, high, visited)


@pytest.mark.parametrize(
    ("item", "units", "text"),
    [
        (located(-0.00372, 0.01, 0.1), Units(), "-3.72 .. 10 mm"),
        (located(-0.00372, 0.01, 0.1), Units(REVOLUTE), "-3.72 .. 10 mrad"),
        (located(-15.4, 15.3, 30.8, "N"), Units(), "all over its range"),
        (located(-15.4, 12.0, 30.8, "N"), Units(), "-15.4 .. 12 N"),
    ],
)
def test_a_range_is_prefixed_and_is_left_out_where_it_is_nearly_all(item: Located, units: Units, text: str) -> None:
    answer: Any = SimpleNamespace(located=(item,))
    assert located_table(answer, units).rows[0][1] == text


def test_the_range_of_the_residual_is_compared_with_all_that_was_visited() -> None:
    """A force at one place lies in a range; one that grows both ways from the middle does not."""
    time = 0.004 * np.arange(20_000)
    position = 0.02 * np.sin(0.7 * time)
    motion: Any = SimpleNamespace(
        residual_period=0.004, velocity=np.gradient(position, time), thinned=lambda values: values,
        cached=lambda *_: dict.fromkeys(COORDINATES, position),
    )  # fmt: skip
    bump, slope = np.exp(-(((position - 0.01) / 0.002) ** 2)), 50.0 * position
    for force, is_in_a_range in ((bump, True), (slope, False)):
        found = next(item for item in locate([force], [motion], 1) if item.coordinate == "position")
        assert found.visited == pytest.approx(0.04, rel=0.01) and len(found.centres) == BINS
        assert found.is_in_a_range == is_in_a_range


COORDINATES = (
    "position", "velocity", "acceleration", "time", "effort", "time since reversal", "distance since reversal", "dwell"
)  # fmt: skip


def test_parameters_of_an_effect_have_the_units_of_the_pictures() -> None:
    cogging = Named(EffectSettings("cogging", (0.8025, 0.0050248, 0.3, 0.0, 0.0)), (0.0076, 1.2e-5, 0.005, 0.0, 0.0),
                    1.0, (), 18.0, 11.0)  # fmt: skip
    answer: Any = SimpleNamespace(effects=(cogging,))
    rows = {row[0]: row[1:] for row in effect_tables(answer, Units())[0].rows}
    assert rows["pitch"] == ("5.0248", "5.005 .. 5.045", "mm")
    assert rows["amplitude"] == ("802.5", "790 .. 815", "mN")
    assert rows["phase"] == ("0.3", "0.2918 .. 0.3082", "rad")
    assert rows["second_amplitude"] == ("0", "fixed", "N")
    turning = {row[0]: row[1:] for row in effect_tables(answer, Units(REVOLUTE))[0].rows}
    assert turning["pitch"][2] == "mrad"


def test_changed_values_have_one_prefix_for_all_their_numbers() -> None:
    changed = (
        Changed("friction.stribeck_velocity", 0.001, 0.0021, 0.0001, 0.5),
        Changed("friction.model", "sgms", "gms", 0.0, 0.5),
    )
    answer: Any = SimpleNamespace(changed=changed)
    rows = changed_table(answer, Units())[0].rows
    assert rows[0][1:5] == ("1", "2.1", "0.1", "mm/s")
    assert rows[1][1:5] == ("sgms", "gms", "not known", "")


@pytest.mark.parametrize(
    ("size", "unit", "found"), [(0.5, "kg", "kg"), (0.2, "Hz", "Hz"), (0.99999, "m", "m"), (0.9, "m", "mm")]
)
def test_a_prefix_makes_numbers_easier_to_read(size: float, unit: str, found: str) -> None:
    assert prefixed_unit(size, unit, Units())[1] == found


def test_a_value_that_the_recordings_do_not_determine_is_not_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Table and YAML say so; result.json keeps the numbers. A distance read 1 m, with an interval of -154 to 156 m."""
    item = Named(EffectSettings("frictional_lag", (200.0, 1.0)), (50.0, 94.0), 0.98, (), 5.0, 2.0)
    answer: Any = SimpleNamespace(effects=(item,), verdict="effect_found", gap=SimpleNamespace(before=5.0, after=2.0))
    rows = effect_tables(answer, Units())[0].rows
    assert rows[0][:2] == ("attraction_rate", "200") and rows[1] == ("distance", NOT_DETERMINED, "-", "-")
    changes = {"effects.names": ["frictional_lag"], "effects.frictional_lag.attraction_rate": 200.0,
               "effects.frictional_lag.distance": 1.0}  # fmt: skip
    monkeypatch.setattr(result, "changes_of", lambda _: changes)
    settings = settings_from_tree({"axes": ["x"], "x": {"mass": 3.0}})
    result.write_augmented(answer, settings, "x", tmp_path)
    lines = (tmp_path / "augmented.yaml").read_text().splitlines()
    assert [line.split(":")[0].strip() for line in lines if NOT_DETERMINED in line] == ["distance"]
