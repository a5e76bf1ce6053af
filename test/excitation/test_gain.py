"""The design is worth its time: it expects narrower intervals than the fixed recipe, in the same time and limits."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sgms_observer.arrays import Floats
from sgms_observer.excitation.design import Goal
from sgms_observer.excitation.goals import followed
from sgms_observer.excitation.limits import ExcitationLimits
from sgms_observer.excitation.reference import design_excitation
from sgms_observer.excitation.sensitivity import SIZE, Sensitivity, contacts
from sgms_observer.settings.axis import AxisSettings, EffectSettings

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "benchmarks"))

from excitation_recipe import build_recipe

RATE = 1000.0
LIMITS = ExcitationLimits(0.02, 0.05, 1.0)
START = AxisSettings(effects=(EffectSettings("offset", (0.2,)),))
MIN_GAIN = 1.5


def _half_widths(table: AxisSettings, reference: Floats) -> dict[str, float]:
    """Return the expected half interval of each parameter of a table that follows a reference, over its value."""
    contact = contacts(table.friction, LIMITS.smallest)[0]
    model = Sensitivity(table, contact, followed(reference, 1.0 / RATE, table, table.friction), 1.0 / RATE)
    found, (_, listed) = model.parameters(), model.slopes_of_listed()
    columns = np.column_stack([found.columns, listed])
    wanted = np.zeros((len(found.asked), columns.shape[1]))
    wanted[:, : len(found.names)] = np.array(list(found.asked.values()))
    prior = np.diag([1.0] * len(found.names) + [SIZE**2] * listed.shape[1])
    goal = Goal(
        tuple(found.asked), (columns.T @ columns)[None], (columns.T @ model.errors())[None], prior, wanted,
        np.ones(wanted.shape, dtype=bool), np.ones(len(wanted)), False, 1.0,
    )  # fmt: skip
    return dict(zip(found.asked, 1.96 / np.sqrt(goal.left(np.ones(1))), strict=True))


@pytest.mark.parametrize("is_as_in_the_file", [True, False])
def test_the_design_expects_narrower_intervals_than_the_recipe(is_as_in_the_file: bool) -> None:
    """Of the table of the start file, and of one with other friction, which no design could know."""
    friction = replace(
        START.friction, coulomb_force=5.0, static_force=6.5, stribeck_velocity=2.0e-3,
        element_stiffness=tuple(0.6 * value for value in START.friction.element_stiffness),
    )  # fmt: skip
    table = START if is_as_in_the_file else replace(START, mass=14.0, friction=friction)
    recipe = build_recipe(START, LIMITS, 1.0 / RATE)
    design = design_excitation(START, LIMITS, ("identify",), 0.0, (len(recipe) - 1) / RATE, RATE)
    assert len(design.position) <= len(recipe)
    before, after = _half_widths(table, recipe), _half_widths(table, design.position)
    ratios = {name: before[name] / after[name] for name in before}
    mean = float(np.exp(np.mean(np.log(list(ratios.values())))))
    assert mean >= MIN_GAIN, ratios
