"""Effects that only say how the contact law differs, drags that give energy, and evidence that contradicts itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from workflow_case import AXIS, record

from sgms_observer.diagnosis import pruning, workflow
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.criteria import Criteria, Test, at_least
from sgms_observer.diagnosis.decision import Decision, comparisons, z_score_between
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.evaluation import Evidence
from sgms_observer.diagnosis.evidence import Improvement, preference
from sgms_observer.diagnosis.fit import FRICTION_VALUES
from sgms_observer.diagnosis.gap import effort_rms
from sgms_observer.diagnosis.gap_data import GapData
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.effects.catalogue import effect, is_drag
from sgms_observer.effects.catalogue import names as catalogue_names
from sgms_observer.effects.learnt_map import LearntMap
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings

PERIOD = 1.0 / 250.0
OPTIONS = Options(workers=1, band=25.0)
CRITERIA = Criteria()
FALL = EffectSettings("stribeck", (0.25, 0.02))
PERIODIC = EffectSettings("periodic_disturbance", (0.8, 3.0, 0.4))
LAW_NAMES = ("stribeck", "quadratic_drag", "spring")


@pytest.fixture(autouse=True)
def few_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for a few effects, so that a run takes seconds; a force that is periodic in time is not among them."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: LAW_NAMES)


def made(effects: tuple[EffectSettings, ...], seed: int) -> Recording:
    return record(effects, seed=seed, duration=12.0, period=PERIOD)


def answered(*effects: EffectSettings) -> Answer:
    found = diagnose([made(effects, 1)], [made(effects, 2)], AXIS, OPTIONS)
    return answer_of(found, AXIS, OPTIONS)


@pytest.fixture(scope="module")
def explained() -> Answer:
    """Return the answer on a friction that falls with speed, where nothing else is hidden."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workflow, "catalogue_names", lambda: LAW_NAMES)
        return answered(FALL)


@pytest.fixture(scope="module")
def dragged() -> Answer:
    """Return the answer on a quadratic drag."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workflow, "catalogue_names", lambda: LAW_NAMES)
        return answered(EffectSettings("quadratic_drag", (1200.0,)))


def effort_of(answer: Answer) -> float:
    """Return the rms effort that the gap of an answer refers to [N]."""
    return effort_rms(answer.motions, answer.weights)


def test_law_effects_are_of_the_catalogue() -> None:
    assert sum(effect(name).is_contact_law for name in catalogue_names()) == 7


def test_a_law_effect_that_explains_all_is_a_name(explained: Answer) -> None:
    assert [item.settings.name for item in explained.effects] == ["stribeck"]
    assert not any(item.name.startswith("effects.stribeck") for item in explained.changed)


def test_drags_are_forces_beside_the_contact() -> None:
    assert {name for name in catalogue_names() if is_drag(name)} == {
        "eddy_current",
        "nonlinear_viscous",
        "quadratic_drag",
    }


@pytest.mark.parametrize("is_brake", [True, False])
def test_a_drag_predicts_better_than_the_logarithmic_friction_of_a_contact(
    is_brake: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Friction that grows with the logarithm of the velocity looks like the broad peak of an eddy-current brake."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("eddy_current",))
    speeds = np.geomspace(1.0e-4, 0.2, 40)
    forces = 0.15 * np.log(speeds / speeds[0])
    grid, values = (tuple(np.concatenate((-side[::-1], side))) for side in (speeds, forces))
    friction = LearntMap(("velocity",), (grid,), values).settings()
    answer = answered(EffectSettings("eddy_current", (1.0, 0.02, 0.0)) if is_brake else friction)
    assert [item.settings.name for item in answer.effects] == ["eddy_current"] * is_brake
    (test,) = [one for one in answer.tests if "than logarithmic friction" in one.name]
    assert (test.of, test.passed) == ("eddy_current", is_brake)


LAW_TEST = "residual above noise / closed residual"


@pytest.mark.parametrize("hidden", [FALL, EffectSettings("quadratic_drag", (1200.0,))])
def test_it_has_a_name_beside_what_nothing_predicts(hidden: EffectSettings, explained: Answer) -> None:
    """The rest is a force that is periodic in time. It is not looked for, and smaller than what the effect closes."""
    pumps = [EffectSettings("periodic_disturbance", (0.25, 3.0, phase)) for phase in (0.4, 3.5)]
    learn, judge = (made((hidden, pump), seed) for seed, pump in enumerate(pumps, 1))
    alone = explained if hidden is FALL else answered(hidden)
    answer = answer_of(diagnose([learn], [judge], AXIS, OPTIONS), AXIS, OPTIONS)
    assert answer.gap.after > 2.0 * alone.gap.after and not answer.learnt
    assert [item.settings.name for item in answer.effects] == [hidden.name]


def test_an_effect_that_closes_less_than_it_leaves_is_a_changed_value(
    monkeypatch: pytest.MonkeyPatch, explained: Answer
) -> None:
    """A contact of another law leaves what no model predicts. Here it is a periodic force, and the noise is known."""
    noise = 0.01 * explained.gap.noise * effort_of(explained)
    monkeypatch.setattr(GapData, "noise", lambda _: noise)
    answer = answered(FALL, PERIODIC)
    assert answer.gap.after**2 - answer.gap.noise**2 > answer.gap.before**2 - answer.gap.after**2 > 0.0
    assert not answer.effects and any(item.name.startswith("effects.stribeck") for item in answer.changed)
    assert any(test.name == LAW_TEST and test.of == "stribeck" and not test.passed for test in answer.tests)


def test_beside_a_second_one_neither_has_a_name(explained: Answer) -> None:
    found = explained.diagnosis
    first = next(item for item in found.rounds if item.accepted)
    assert first.accepted is not None
    candidate = first.accepted.candidate
    lag = EffectSettings("frictional_lag", (20.0, 2e-6))
    refit = replace(candidate.refit, effects=(*candidate.refit.effects, lag))
    second = replace(first, accepted=replace(first.accepted, candidate=replace(candidate, name=lag.name, refit=refit)))
    both = replace(found, rounds=(first, second))
    assert both.accepted == [first] and both.unnamed_contact_effects == {"frictional_lag"}
    answer = answer_of(both, AXIS, OPTIONS)
    (test,) = [one for one in answer.tests if one.name == "other parts of another contact law"]
    assert not answer.effects and (test.of, test.value, test.passed) == ("stribeck", 1.0, False)
    assert any(item.name == "effects.stribeck.share" for item in answer.changed)
    refused = replace(both, refused_contact_effects=at_least("stribeck", LAW_TEST, 0.0, 1.0))
    assert not refused.accepted and refused.unnamed_contact_effects == {"stribeck", "frictional_lag"}


@pytest.mark.parametrize(
    ("changed", "parts"), [((), 0), (("static_force",), 1), (("static_force", "coulomb_force"), 2)]
)
def test_beside_friction_values_that_left_their_tolerance_it_has_no_name(
    changed: tuple[str, ...], parts: int, explained: Answer
) -> None:
    """A fall of the friction was named, on a file whose static force had to fall by 15 % beside it."""
    answer = beside_changed(explained, changed)
    (test,) = [one for one in answer.tests if one.name == "other parts of another contact law"]
    assert test.value == parts and test.passed == (not changed) == bool(answer.effects)


@pytest.mark.parametrize(
    ("changed", "parts"), [(("static_force", "stribeck_velocity"), 0), (("static_force", "coulomb_force"), 1)]
)
def test_what_is_judged_in_fast_sliding_has_a_name_beside_values_that_act_at_low_speed(
    changed: tuple[str, ...], parts: int, dragged: Answer
) -> None:
    """A quadratic drag on a LuGre contact had no name, because the Stribeck velocity of the file had changed."""
    answer = beside_changed(dragged, changed)
    (test,) = [one for one in answer.tests if one.name == "other parts of another contact law"]
    assert test.value == parts and test.passed == (parts == 0) == bool(answer.effects)


def beside_changed(answer: Answer, changed: tuple[str, ...]) -> Answer:
    """Return the answer of the same diagnosis, had the file values of the friction that are 20 % larger."""
    found = answer.diagnosis
    freedom = replace(found.written.setup.freedom, friction=FRICTION_VALUES)
    written = replace(found.written, setup=replace(found.written.setup, freedom=freedom))
    file = replace(found.nominal.friction, **{name: 1.2 * getattr(found.nominal.friction, name) for name in changed})
    return answer_of(replace(found, written=written, nominal=replace(found.nominal, friction=file)), AXIS, OPTIONS)


@pytest.mark.parametrize(("share", "is_named"), [(0.51, True), (0.49, False)])
def test_beside_everything_else_it_closes_more_than_it_leaves(share: float, is_named: bool, explained: Answer) -> None:
    found = explained.diagnosis
    assert found.written.shares_above_noise["stribeck"] > 0.51
    written = replace(found.written, shares_above_noise={"stribeck": share})
    answer = answer_of(replace(found, written=written), AXIS, OPTIONS)
    assert [item.settings.name for item in answer.effects] == ["stribeck"] * is_named
    (test,) = [one for one in answer.tests if one.name.endswith("beside the others, of another contact law")]
    assert test.passed == is_named


def test_beside_a_predictable_remainder_it_is_a_changed_value(monkeypatch: pytest.MonkeyPatch) -> None:
    """The spring is not looked for. A map learns it, so the fall is not all that the model misses."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("stribeck",))
    answer = answered(FALL, EffectSettings("spring", (10.0, 0.0)))
    assert answer.remainder == "learnt" and not answer.effects
    share = {item.name: item for item in answer.changed}["effects.stribeck.share"]
    assert share.before == 0.0 and share.after > 0.0 and share.std_error > 0.0
    assert "stribeck" in [item.name for item in answer.model.effects]


def test_a_large_effect_does_not_outweigh_a_predictable_remainder(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the rest is compared with is closed by the fall alone, not by the offset beside it."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("stribeck", "offset"))
    answer = answered(FALL, EffectSettings("spring", (20.0, 0.0)), EffectSettings("offset", (3.0,)))
    assert answer.remainder == "learnt"
    assert [item.settings.name for item in answer.effects] == ["offset"]


def test_a_drag_that_gives_energy_has_no_name() -> None:
    top = float(np.max(np.abs(np.gradient(made((), 1).position, PERIOD))))
    gives = answered(EffectSettings("quadratic_drag", (-4.0 / top**2,)))
    takes = answered(EffectSettings("quadratic_drag", (4.0 / top**2,)))
    assert "quadratic_drag" not in [item.settings.name for item in gives.effects]
    assert [item.settings.name for item in takes.effects] == ["quadratic_drag"]


def test_elements_leave_the_file_where_recordings_show_them_elsewhere() -> None:
    learn, judge = ([record(seed=seed, duration=8.0)] for seed in (1, 2))
    right = diagnose([made((), 1)], [made((), 2)], AXIS, OPTIONS)
    friction = replace(AXIS.friction, element_stiffness=tuple(0.6 * x for x in AXIS.friction.element_stiffness))
    wrong = diagnose(learn, judge, replace(AXIS, friction=friction), replace(OPTIONS, band=100.0))
    assert not wrong.file_state.setup.freedom.has_narrow_elements
    moved = [
        abs(sum(found.file_state.current.model.friction.element_stiffness) / sum(stiffness) - 1.0)
        for found, stiffness in ((right, AXIS.friction.element_stiffness), (wrong, friction.element_stiffness))
    ]
    assert moved[0] < 0.1 and moved[1] > 0.4


def decision(name: str, learn: float, held: float) -> Decision:
    """Return a decision on an effect whose residual has these sizes in 40 blocks each, with the same scatter."""
    rng = np.random.default_rng(3)
    noise = [rng.standard_normal(50) for _ in range(80)]
    blocks = [size * (1.0 + 0.01 * one) for size, one in zip([learn] * 40 + [held] * 40, noise, strict=True)]
    evidence = Evidence(blocks[:40], blocks[40:], [])
    candidate: Any = type("Named", (), {"name": name, "settings": FALL})()
    nothing = Improvement(0.0, 0.0, 1.0)
    return Decision(candidate, evidence, nothing, nothing, (Test("x", "x", 1.0, 0.0, True),))


def alternatives(best: Decision, others: list[Decision]) -> tuple[str, ...]:
    """Return the rivals that do not predict significantly worse."""
    return tuple(name for name, test in comparisons(best, others, CRITERIA).items() if not test.passed)


def test_held_out_recordings_may_contradict() -> None:
    first, second, worse = decision("spring", 1.0, 2.1), decision("offset", 1.5, 2.0), decision("gravity", 1.5, 2.5)
    assert z_score_between(first.evidence, worse.evidence, CRITERIA) > 3.0  # both kinds of recordings agree
    forth, back = (
        z_score_between(first.evidence, second.evidence, CRITERIA),
        z_score_between(second.evidence, first.evidence, CRITERIA),
    )
    assert forth == -back < -3.0  # the held-out ones alone decide
    assert alternatives(first, [first, second, worse]) == ("offset",)


def test_held_out_recordings_that_show_neither_do_not_contradict() -> None:
    """A difference of the held-out residuals within its scatter says nothing, whatever its sign."""
    first, second = decision("spring", 1.0, 2.0), decision("offset", 1.5, 2.0)
    assert abs(preference(first.evidence.held_out, second.evidence.held_out)) < CRITERIA.interval_z_score
    assert z_score_between(first.evidence, second.evidence, CRITERIA) > 3.0


def test_the_general_form_of_an_effect_is_no_other_explanation() -> None:
    names = ("quadratic_drag", "nonlinear_viscous", "eddy_current")
    drag, general, other = (decision(name, 1.0, 1.0) for name in names)
    assert alternatives(drag, [drag, general, other]) == ("eddy_current",)
    assert alternatives(general, [drag, general, other]) == ("quadratic_drag", "eddy_current")


def test_an_effect_that_leaves_more_than_another_hypothesis_does_not_end_the_search(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The noise is fitted to the residual: what a wrong effect leaves looks like noise until something leaves less."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("actuator_gain", "actuator_dead_zone", "frictional_lag"))
    hidden = (EffectSettings("actuator_dead_zone", (0.5,)), EffectSettings("frictional_lag", (300.0, 1.0e-6)))
    learn, judge = (record(hidden, seed=seed, duration=15.0) for seed in (1, 2))
    options = Options(workers=1, band=100.0)
    found = diagnose([learn], [judge], AXIS, options)
    names = [item.accepted.candidate.name for item in found.rounds if item.accepted]
    assert "actuator_gain" not in names and {"frictional_lag", "changed contact law"} & set(names)
    assert found.evaluation.gap < CRITERIA.min_gap_over_floor * found.final_state.least
    # An effect that passed beside a change of the file does not take its place, however well it predicts.
    change = found.rounds[0].accepted
    assert change is not None and change.candidate.settings is None and found.rounds[0].comparisons
    monkeypatch.setattr(pruning, "z_score_between", lambda *_: 10.0)
    _, rounds = pruning.compared_again(found.final_state, found.rounds, [], options)
    assert rounds[0].accepted is change


@pytest.mark.parametrize("fall", [0.25, 0.6])
def test_of_several_none_has_a_name(fall: float) -> None:
    """The drag is small beside the deep fall of the friction, and as large as the shallow one.

    Two of them together can describe the friction curve of another contact law that contains neither.
    """
    top = float(np.max(np.abs(np.gradient(made((), 1).position, PERIOD))))
    drag = EffectSettings("quadratic_drag", (1.5 / top**2,))
    answer = answered(EffectSettings("stribeck", (fall, 0.02)), drag)
    assert {"stribeck", "quadratic_drag"} <= {item.name for item in answer.model.effects}
    assert not answer.effects
    assert {"effects.stribeck.share", "effects.quadratic_drag.coefficient"} <= {item.name for item in answer.changed}
