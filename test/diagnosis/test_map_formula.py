"""Where a short formula predicts as well as a learnt map, the diagnosis proposes it."""

import re
from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
import pytest
from workflow_case import AXIS, record

from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.map_columns import path_of
from sgms_observer.diagnosis.map_fit import fit_map
from sgms_observer.diagnosis.map_formula import Formula, formula_of
from sgms_observer.diagnosis.motion import Motion, motion_of
from sgms_observer.effects.learnt_map import LearntMap, learnt_coordinates

PERIOD = 1.0 / 250.0
LENGTH = 0.045
ONE_WAY = ("position", "direction")
Table = Callable[[np.ndarray], np.ndarray]


@cache
def measured(seed: int) -> Motion:
    """Return the motion of a recording."""
    return motion_of(record(seed=seed, duration=12.0, period=PERIOD), band=25.0)


def formula_for(coordinates: Sequence[str], table: Table, is_held_out: bool = True) -> Formula | None:
    """Return the formula for a force in the residual of two recordings, one to learn from and one to judge on."""
    grid = np.linspace(-LENGTH, LENGTH, 61)
    grids = (tuple(grid), ())[: len(coordinates)]
    hidden = LearntMap(tuple(coordinates), grids, tuple(table(grid).ravel()))
    rests = []
    for seed in (1, 2):
        motion = measured(seed)
        force = hidden.force(path_of(motion))
        noise = 0.05 * np.random.default_rng(seed).standard_normal(len(force))
        left = motion.low_pass(force + noise)
        rests.append(WeightedResidual([motion], [left], [np.ones_like(left)]))
    known, judged = rests if is_held_out else (rests[0], rests[0])
    found = fit_map(known, judged, "learnt_map", AXIS.units, Criteria(), [tuple(coordinates)])
    assert found is not None
    return formula_of(found.map, known, judged, AXIS.units, Criteria())


@pytest.mark.parametrize("is_held_out", [True, False])
def test_a_line_is_found_with_its_slope(is_held_out: bool) -> None:
    found = formula_for(("position",), lambda x: 40.0 * x, is_held_out)
    assert found is not None and found.parameter_count == 2
    slope = float(re.search(r"\+ (\S+) position \(N, position in m, -?\S+ to \S+\)$", found.text)[1])  # type: ignore[index]
    assert slope == pytest.approx(40.0, rel=0.03)


def test_a_wave_is_found_with_its_pitch() -> None:
    found = formula_for(("position",), lambda x: np.sin(2.0 * np.pi * x / 0.021 + 0.4))
    assert found is not None
    pitch = float(re.search(r"sin\(2 pi position / (\S+)", found.text)[1])  # type: ignore[index]
    assert pitch == pytest.approx(0.021, rel=0.03)
    assert "direction" not in found.text and "motion" not in found.text


def test_friction_in_one_place_is_a_bump_times_the_direction() -> None:
    def bump(x: np.ndarray) -> np.ndarray:
        level = np.exp(-(((x - 0.01) / 0.005) ** 2))
        return np.column_stack([-level, level])

    found = formula_for(ONE_WAY, bump)
    assert found is not None and "exp(-((position - " in found.text
    assert found.text.split(" (N, ")[0].endswith("times the direction")
    level = found.map.table()[:, 1]
    assert found.map.grids[0][int(np.argmax(level))] == pytest.approx(0.01, abs=0.002)


def test_a_force_in_forward_motion_only_is_told_as_such() -> None:
    found = formula_for(ONE_WAY, lambda x: np.column_stack([0.0 * x, 1.0 + 30.0 * x]))
    assert found is not None and "in forward motion, 0 in backward motion" in found.text


@pytest.mark.parametrize("seed", range(4))
def test_a_shape_without_a_short_formula_stays_a_map(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heights = 2.0 * rng.standard_normal(13)
    places = np.linspace(-LENGTH, LENGTH, len(heights))
    assert formula_for(("position",), lambda x: np.interp(x, places, heights)) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_parabola_is_found_with_its_coefficients(seed: int) -> None:
    rng = np.random.default_rng(seed)
    slope, bend = rng.uniform(20.0, 40.0), rng.uniform(1500.0, 2500.0)
    found = formula_for(("position",), lambda x: slope * x + bend * x**2)
    assert found is not None and 0.0 <= max(found.left, 0.0) <= Criteria().min_predictable_share
    assert found.parameter_count == 3
    first, second = re.search(r"\+ (\S+) position \+ (\S+) position\^2", found.text).groups()  # type: ignore[union-attr]
    assert float(first) == pytest.approx(slope, rel=0.05)
    assert float(second) == pytest.approx(bend, rel=0.05)


def test_a_map_keeps_to_the_forces_it_has_seen_where_no_data_are() -> None:
    """High speed and high load never come together here: the smoothness alone would go on in a straight line."""
    over = ("velocity", "load")
    rests = []
    for seed in (1, 2):
        motion = measured(seed)
        load = learnt_coordinates(over, path_of(motion))[:, 1]
        force = (0.2 + 0.05 * load) * np.tanh(motion.velocity / 0.02)
        left = motion.low_pass(force + 0.05 * np.random.default_rng(seed).standard_normal(len(force)))
        rests.append(WeightedResidual([motion], [left], [np.ones_like(left)]))
    found = fit_map(*rests, "learnt_map", AXIS.units, Criteria(), [over])
    assert found is not None and found.share > 0.9
    values = np.array(found.map.values)
    weight = found.map.basis(path_of(measured(1))).toarray().sum(axis=0)
    reached, unseen = values[weight > 0.0], values[weight == 0.0]
    assert len(unseen) and reached.min() <= unseen.min() and unseen.max() <= reached.max()
