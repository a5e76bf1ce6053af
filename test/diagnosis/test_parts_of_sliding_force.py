"""Effects that more elements could stand in for, and the verdict that the tests of the whole lead to."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from workflow_case import AXIS, FRICTION, record

from sgms_observer.diagnosis.answer import verdict_of
from sgms_observer.diagnosis.criteria import Criteria, at_most
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.named import Named
from sgms_observer.diagnosis.ranges import plausible_range
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.settings.axis import EffectSettings

MODEL = Model.of(AXIS)
MISSING = EffectSettings("presliding", (1.2, 1.5e-4))


def named(*alternatives: str) -> Named:
    """Return a named offset with these alternatives."""
    return Named(EffectSettings("offset", (0.6,)), (0.01,), 0.9, alternatives, 4.0, 1.0)


@pytest.mark.parametrize(
    ("is_poor", "effects", "predictable", "unexplained", "verdict"),
    [
        (True, [named()], 0.0, 0.0, "cannot_tell"),
        (False, [named()], 0.0, 0.0, "effect_found"),
        (False, [named()], 0.5, 0.0, "effect_found"),  # a name may stand beside an unknown remainder
        (False, [named(), named("cogging")], 0.0, 0.0, "ambiguous"),
        (False, [], 0.5, 0.0, "unknown_effect"),
        (False, [], 0.5, 0.5, "cannot_tell"),  # nothing is known of an unusable model
        (False, [], 0.05, 0.0, "no_effect"),
        (False, [], 0.05, 0.5, "cannot_tell"),
    ],
)
def test_the_verdict_follows_from_names_and_the_tests_of_the_whole(
    is_poor: bool, effects: list[Named], predictable: float, unexplained: float, verdict: str
) -> None:
    criteria = Criteria()
    found: Any = type("Found", (), {"is_poor": is_poor, "is_contact_hidden": False})
    rest = at_most("model", "surely predictable", predictable, criteria.min_predictable_share)
    whole = at_most("model", "unexplained", unexplained, criteria.max_unexplained)
    assert verdict_of(found, effects, rest, False, whole, ()) == verdict


def test_more_shapes_tried_need_a_larger_z_score_and_the_name_of_an_effect_does_not_matter() -> None:
    criteria = Criteria()
    needed = [criteria.z_score_of(trials) for trials in (1, 10, 100, 1000)]
    assert needed[0] == pytest.approx(criteria.min_z_score)
    assert all(one < other for one, other in pairwise(needed))
    assert needed[-1] < 5.0


def test_a_missing_element_is_one_too_few_never_one_too_many() -> None:
    motions = (motion_of(record(duration=4.0)),)
    assert plausible_range("presliding", "force", motions, MODEL) == (0.0, np.inf)
    assert plausible_range("offset", "force", motions, MODEL)[0] == -np.inf


def test_a_missing_element_is_found_and_leaves_no_more_cost() -> None:
    found = diagnose([record((MISSING,))], [record((MISSING,), seed=2, duration=12.0)], AXIS, Options(workers=2))
    assert [item.name for item in found.written.after.effects] == ["presliding"]
    assert found.written.after.cost < found.written.before.cost
    assert FRICTION.coulomb_force > MISSING.values[0]
