"""One reversal is drawn from so near that presliding shows, however long the strokes are."""

from __future__ import annotations

import re
from itertools import pairwise

import numpy as np
import pytest
from test_page_size import identified_axis

from sgms_observer.identification.report import identification_page
from sgms_observer.identification.table import Row
from sgms_observer.report.reversal_picture import presliding_distance, reversal_picture, turning_rows
from sgms_observer.settings.units import REVOLUTE, Units

DISTANCE = 2.0e-6


def to_and_fro(turns: list[float], rows: int = 4000) -> np.ndarray:
    """Return positions that turn at given places, slow near them [m]."""
    ease = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, rows))
    return np.concatenate([start + (end - start) * ease for start, end in pairwise(turns)])


def friction(position: np.ndarray) -> np.ndarray:
    """Return the friction of one element that slips after ``DISTANCE`` at 4 N."""
    force = np.zeros(len(position))
    for row, step in enumerate(np.diff(position), 1):
        force[row] = np.clip(force[row - 1] + 4.0 / DISTANCE * step, -4.0, 4.0)
    return force


def test_presliding_ends_where_the_elements_reach_most_of_the_sliding_force() -> None:
    assert presliding_distance([2.0e6], [4.0]) == pytest.approx(0.9 * 2.0e-6)
    weak = presliding_distance([2.0e6, 400.0], [3.8, 0.2])
    assert weak == pytest.approx(1.8e-6, rel=0.01)  # and not the 0.5 mm after which the weak element slips


def test_rows_are_found_where_the_motion_turns_and_not_where_noise_does() -> None:
    position = to_and_fro([0.0, 0.02, -0.02, 0.01])
    noisy = position + 1e-8 * np.random.default_rng(1).normal(size=len(position))
    found = turning_rows(noisy, DISTANCE)
    assert found == pytest.approx([4000, 8000], abs=20)
    assert turning_rows(noisy[:3000], DISTANCE) == []


@pytest.mark.parametrize(("units", "label"), [(Units(), "um"), (Units(REVOLUTE), "urad")])
def test_a_reversal_of_a_long_stroke_is_drawn_in_micrometres(units: Units, label: str) -> None:
    position = to_and_fro([0.0, 0.02, -0.02, 0.01])
    force = friction(position)
    picture = reversal_picture("near", [(position, force, 0.98 * force)], DISTANCE, units)
    assert picture is not None
    assert f">distance from the turning point [{label}]<" in picture.svg
    assert ">measured<" in picture.svg and ">modelled<" in picture.svg
    ticks = [
        float(text.replace("\u2212", "-")) for text in re.findall(r">([\u2212-]?\d+(?:\.\d+)?)</text>", picture.svg)
    ]
    assert max(map(abs, ticks)) == pytest.approx(20.0, abs=1.0)  # ten times 2 um, of 40 mm
    assert f"2 {label}" in picture.caption


def test_the_slowest_of_the_reversals_is_shown_and_none_where_there_are_too_few_rows() -> None:
    fast, slow = to_and_fro([0.0, 0.02, 0.0], 30), to_and_fro([0.0, 0.001, 0.0], 4000)
    assert reversal_picture("near", [(fast, friction(fast), friction(fast))], DISTANCE, Units()) is None
    both = [(one, friction(one), friction(one)) for one in (fast, slow)]
    picture, alone = (reversal_picture("near", pieces, DISTANCE, Units()) for pieces in (both, both[1:]))
    assert picture is not None and alone is not None and picture.svg == alone.svg


def test_an_identification_shows_one() -> None:
    rows = [
        Row("friction.static_force", 4.0, 0.1, "N", True),
        Row("friction.element_stiffness[1]", 2.0e2, 1.0, "N/m", True),
        Row("friction.element_fraction[1]", 1.0, 0.1, "-", True),
    ]
    captions = {}
    for name, own in (("with", rows), ("without", rows[:1])):
        page = identification_page([identified_axis("x", 1, tuple(own))], "out.yaml", ["first"], [])
        captions[name] = " ".join(picture.caption for section in page.sections for picture in section.pictures)
    assert "One reversal, magnified" in captions["with"] and "18 mm" in captions["with"]
    assert "One reversal" not in captions["without"]
