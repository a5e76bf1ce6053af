"""Effects that more elements than the owner's could stand in for: a missing element, a load behind play."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from workflow_case import AXIS, FRICTION, record

from sgms_observer.discrepancy import prune
from sgms_observer.discrepancy.decide import ALARM, BOLD, FAR, STRUCTURAL_ALARM, Round, alarm_threshold, verdict_of
from sgms_observer.discrepancy.fit import Refits, judged_with, refit
from sgms_observer.discrepancy.gate import Gate
from sgms_observer.discrepancy.model import Model
from sgms_observer.discrepancy.motion import motion_of
from sgms_observer.discrepancy.name import Candidate
from sgms_observer.discrepancy.ranges import believable
from sgms_observer.discrepancy.twins import Calibration
from sgms_observer.discrepancy.workflow import Options, diagnose
from sgms_observer.settings.axis import EffectSettings

MODEL = Model.of(AXIS)
MISSING = EffectSettings("presliding", (1.2, 1.5e-4))
OFFSET = EffectSettings("offset", (0.6,))
SCREEN: Any = None


@dataclass(frozen=True)
class KnownGaps(Gate):
    """A gate that knows the gap of each model by its mass."""

    gaps: tuple[tuple[float, float], ...] = ()

    def gap(self, model: Model) -> float:
        """Return the gap that goes with the mass."""
        return dict(self.gaps)[model.mass]


def fit_of(mass: float, *effects: EffectSettings) -> Any:
    """Return a fit that was not made, of a model with this mass."""
    judged = judged_with((motion_of(record(duration=4.0)),), MODEL)
    return replace(refit(judged, MODEL, 0.05, effects, iterations=0), model=Model(mass, FRICTION, effects))


def said(gaps: dict[float, float], effect: EffectSettings | None) -> str:
    """Return the verdict with these gaps: 1 found, 2 with the effect; owner's elements: 3 without, 4 with."""
    found, current, *owners = (fit_of(mass, *([effect] if effect and mass in (2.0, 4.0) else [])) for mass in gaps)
    gate = KnownGaps((), 1.0, True, tuple(gaps.items()))
    none = np.zeros(1)
    rounds = [Round(SCREEN, {}, (), none, none, False, ())]
    if effect is not None:
        rounds.insert(0, Round(SCREEN, {}, (Candidate(effect.name, current, 500.0, ()),), none, none, True, ()))
    return verdict_of(rounds, current, None, None, False, gate, found, (owners[0], owners[1]))


def test_a_missing_element_may_close_the_gap_with_the_owners_elements() -> None:
    bent = {1.0: 2.2, 2.0: 1.9, 3.0: 3.7, 4.0: 1.9}  # twice as many elements left little to close
    assert said(bent, MISSING) == "effect_found"
    assert said(bent, OFFSET) == "unknown_effect"
    assert said({**bent, 4.0: 3.0}, MISSING) == "unknown_effect"


def test_a_gap_far_above_the_floor_is_not_nothing() -> None:
    for times, verdict in ((0.9, "no_effect"), (1.1, "unknown_effect")):
        assert said(dict.fromkeys((1.0, 2.0, 3.0, 4.0), times * FAR), None) == verdict


def test_what_returns_every_second_may_take_more_in_a_longer_recording() -> None:
    def threshold(name: str, seconds: float) -> float:
        return alarm_threshold(name, Calibration({}, {}, np.array([7.0]), seconds))

    assert threshold("presliding", 12.0) == threshold("presliding", 30.0) == STRUCTURAL_ALARM["presliding"]
    assert threshold("presliding", 60.0) == 2.0 * STRUCTURAL_ALARM["presliding"]
    assert threshold("cogging", 60.0) == ALARM  # nothing that a contact leaves behind looks like it


def test_a_missing_element_is_one_too_few_never_one_too_many() -> None:
    motions = (motion_of(record(duration=4.0)),)
    assert believable("presliding", "force", motions, MODEL) == (0.0, np.inf)
    assert believable("offset", "force", motions, MODEL)[0] == -np.inf


def test_an_effect_more_leaves_no_more_cost() -> None:
    found = diagnose([record((MISSING,))], [record((MISSING,), seed=2, duration=12.0)], AXIS, Options(workers=2))
    assert found.verdict == "effect_found"
    assert [item.name for item in found.after.effects] == ["presliding"]
    assert found.after.cost < found.before.cost


@pytest.mark.parametrize(("force", "kept"), [(0.6, True), (0.02, False)])
def test_what_takes_much_need_only_help_on_held_out_data(
    force: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(prune, "sureness", lambda before, after, motions: 1.0)  # it helps there, and is not sure
    effects = (EffectSettings("offset", (force,)), EffectSettings("cogging", (0.5, 0.01, 0.3, 0.0, 0.0)))
    motion = motion_of(record(effects))
    judged = judged_with((motion,), MODEL.with_effects(effects))
    current = refit(judged, MODEL, 0.05, effects, iterations=4)
    without = refit(judged, MODEL, 0.05, effects[1:], current.logs, iterations=6)
    assert (2.0 * (without.cost - current.cost) > BOLD) == kept
    none = np.zeros(1)
    rounds = [
        Round(SCREEN, {}, (Candidate(item.name, current, 1.0, ()),), none, none, True, ()) for item in effects
    ]
    after, _ = prune.pruned(Refits(judged, MODEL, 0.05), current, rounds, Gate((motion,), 1.0))
    assert ("offset" in {item.name for item in after.effects}) == kept
