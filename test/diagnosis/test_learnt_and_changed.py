"""What has no name is learnt, what the file says and no longer holds is listed, and both end up in files that load."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import workflow_case
from workflow_case import AXIS, record

from sgms_observer.application.bag_info import refuse_learnt_from
from sgms_observer.diagnosis import workflow
from sgms_observer.diagnosis.answer import Answer, answer_of
from sgms_observer.diagnosis.compensation_check import CompensationCheck
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.evidence import Improvement
from sgms_observer.diagnosis.gap import WeightedResidual, residuals, rms
from sgms_observer.diagnosis.gap_data import GapData
from sgms_observer.diagnosis.map_fit import AT_REST, fit_map
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.motion import motion_of
from sgms_observer.diagnosis.report import sentence
from sgms_observer.diagnosis.result import result_of, write_augmented
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.effects.catalogue import effect
from sgms_observer.effects.effect import named_values
from sgms_observer.effects.learnt_map import LearntMap
from sgms_observer.errors import ConfigurationError
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sgms_observer.settings.load import load_settings
from sgms_observer.settings.write import write_settings

PERIOD = 1.0 / 250.0
OPTIONS = Options(workers=1, band=25.0)
SEARCHED = ("spring", "offset", "asymmetric_coulomb", "quadratic_drag")
OFFSET = EffectSettings("offset", (0.3,))


@pytest.fixture(autouse=True)
def few_effects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Look for a few effects, so that a run takes seconds."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: SEARCHED)


def made(effects: tuple[EffectSettings, ...], seed: int, duration: float = 12.0) -> Recording:
    """Return a short recording at a low rate."""
    return record(effects, seed=seed, duration=duration, period=PERIOD)


def hidden_map(level: np.ndarray) -> LearntMap:
    """Return a friction level that varies along the position, the same both ways."""
    span = float(np.max(np.abs(made((), 1).position)))
    grid = tuple(np.linspace(-1.5 * span, 1.5 * span, len(level)).tolist())
    return LearntMap(("position", "direction"), (grid, ()), tuple(np.column_stack([-level, level]).ravel()))


LEVEL = np.array([0.0, 0.9, -0.6, 1.2, 0.1, 1.4, -0.8, 0.7, 1.1, -0.5, 0.6])


@pytest.fixture(scope="module")
def rail() -> tuple[Recording, Recording]:
    """Two recordings of one rail whose friction varies along it."""
    effects = (hidden_map(LEVEL).settings(),)
    return made(effects, 1), made(effects, 2)


def file_of(tmp_path: Path) -> Path:
    """Return a parameter file of the axis."""
    path = tmp_path / "axis.yaml"
    friction = AXIS.friction
    path.write_text(
        "/**:\n  ros__parameters:\n    axes: [x]\n    sample_period: 0.004\n    x:\n"
        f"      mass: {AXIS.mass}\n      stage: {{encoder: {{resolution: 1.0e-8}}}}\n      friction:\n"
        f"        element_stiffness: {[float(x) for x in friction.element_stiffness]}\n"
        f"        element_fraction: {[float(x) for x in friction.element_fraction]}\n"
        f"        element_damping: {[0.0] * 3}\n        viscous_coefficient: {friction.viscous_coefficient}\n"
        f"        static_force: {friction.static_force}\n        coulomb_force: {friction.coulomb_force}\n"
        f"        stribeck_velocity: {friction.stribeck_velocity}\n",
        encoding="utf-8",
    )
    return path


def test_a_friction_level_along_the_rail_is_learnt_and_its_file_loads_and_closes_the_gap(
    rail: tuple[Recording, Recording], tmp_path: Path
) -> None:
    one, other = (motion_of(record, band=25.0) for record in rail)
    model = Model.of(AXIS)
    known, judge = (
        WeightedResidual([motion], left := residuals(model, [motion]), [np.ones_like(part) for part in left])
        for motion in (one, other)
    )
    found = fit_map(known, judge, "learnt_map", AXIS.units, OPTIONS.criteria)
    assert found is not None and found.coordinates == ("position", "direction")
    assert found.share > 0.7
    assert "friction level that varies along the position" in found.sentence
    table = found.map.table()
    places = np.asarray(found.map.grids[0])
    level = np.interp(places, np.asarray(hidden_map(LEVEL).grids[0]), LEVEL)
    assert np.corrcoef(0.5 * (table[:, 1] - table[:, 0]), level)[0, 1] > 0.9
    config = file_of(tmp_path)
    settings = found.settings
    changes: dict[str, object] = {"effects.names": [settings.name]}
    for key, value in (named_values(effect(settings.name), settings.values) or {}).items():
        changes[f"effects.{settings.name}.{key}"] = list(value) if isinstance(value, tuple) else value
    write_settings(load_settings(config), tmp_path / "with_map.yaml", {"x": changes}, {"": "learnt"})
    axis = load_settings(tmp_path / "with_map.yaml").axes[0]
    after = residuals(Model.of(axis), [other])
    assert rms(after) < 0.6 * rms(judge.residual)
    assert rms(after) == pytest.approx(
        rms(residuals(model.with_effects([settings]), [other])), rel=1e-3
    )  # the file says what was learnt


RELAXATION = LearntMap(("rest", "direction"), ((0.0, 1.0), ()), (0.0, 0.0, 2.0, -2.0)).settings()
"""Friction that relaxes by 2 N a second while the stage rests, in the direction that it came from."""


def test_a_relaxation_at_rest_is_learnt() -> None:
    hidden, model = RELAXATION, Model.of(AXIS)
    known, judge = (
        WeightedResidual([motion], left := residuals(model, [motion]), [np.ones_like(part) for part in left])
        for motion in (motion_of(record((hidden,), seed=seed, duration=30.0)) for seed in (1, 2))
    )
    found = fit_map(known, judge, "learnt_map", AXIS.units, OPTIONS.criteria, AT_REST)
    assert found is not None and found.coordinates == ("rest", "direction")
    assert found.share > 0.7
    grid = np.array(found.map.grids[0])
    for column, slope in zip(found.map.table().T, (2.0, -2.0), strict=True):
        assert np.polyfit(grid, column, 1)[0] == pytest.approx(slope, rel=0.2)


def test_a_relaxation_at_rest_is_no_unknown_effect() -> None:
    """A stage at rest shows what its contact holds: that may be another contact law."""
    learn, judge = (made((RELAXATION,), seed, duration=24.0) for seed in (1, 2))
    options = replace(OPTIONS, criteria=replace(OPTIONS.criteria, max_gap_over_noise=2.0))
    answer = answer_of(diagnose([learn], [judge], AXIS, options), AXIS, options)
    assert [item.coordinates for item in answer.learnt] == [("rest", "direction")]
    assert answer.gap_with_learnt < 0.9 * answer.gap.after
    assert (answer.verdict, answer.remainder) == ("cannot_tell", "learnt")
    (far,) = [test for test in answer.tests if test.name == "gap over noise, where nothing predicts it"]
    assert not far.passed and not answer.warnings  # something predicts it: the recordings contain its cause
    said = sentence(answer, AXIS.units)
    assert "may be another contact law" in said and said.endswith("a learnt map of it was added.")


def test_diagnose_learns_the_rail_and_takes_the_map_of_its_own_file_for_granted(
    rail: tuple[Recording, Recording], tmp_path: Path
) -> None:
    config = file_of(tmp_path)
    first = answered(rail, load_settings(config).axes[0])
    assert first.learnt and first.remainder == "learnt"
    assert first.gap_with_learnt < 0.7 * first.gap.after
    write_augmented(first, load_settings(config), "x", tmp_path / "out")
    axis = load_settings(tmp_path / "out" / "augmented.yaml").axes[0]
    assert first.learnt[0].map.name in [item.name for item in axis.effects]
    second = answered(rail, axis)
    assert second.gap.given < 0.7 * first.gap.given
    assert second.gap.given == pytest.approx(first.gap_with_learnt, rel=0.1)


def test_a_second_map_is_learnt_where_the_first_leaves_something_predictable() -> None:
    speeds = (-0.08, -0.04, 0.0, 0.04, 0.08)
    drag = LearntMap(("velocity",), (speeds,), (-1.5, 1.5, 0.0, 1.5, -1.5), name="learnt_map_2")
    hidden = (hidden_map(np.array([1.5, -0.5, 1.5, 0.0, -1.0])).settings(), drag.settings())
    records = [made(hidden, seed, duration=24.0) for seed in (1, 2, 3, 4)]
    answer = answer_of(diagnose(records[:2], records[2:], AXIS, OPTIONS), AXIS, OPTIONS)
    assert sorted(item.coordinates for item in answer.learnt) == [("position", "direction"), ("velocity",)]
    first = answer.diagnosis.written.after.model.with_effects([answer.learnt[0].settings])
    assert rms(answer.residual_after) < 0.7 * rms(residuals(first, answer.motions))


def test_a_small_effect_is_named_beside_one_that_closes_nearly_everything() -> None:
    spring, drag = EffectSettings("spring", (150.0, 0.0)), EffectSettings("quadratic_drag", (100.0,))
    answer = answered((made((spring, drag), 1), made((spring, drag), 2)), AXIS)
    assert [item.settings.name for item in answer.effects] == ["spring", "quadratic_drag"]
    closed = answer.effects[0].gap_before ** 2 - answer.effects[0].gap_after ** 2
    assert closed > 0.95 * answer.gap.before**2  # what is left for the drag is less than min_closed_share of the whole


def test_of_two_names_for_one_force_the_one_with_fewer_parameters_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("cogging", "gravity"))
    hidden = (EffectSettings("gravity", (3.0, 0.4, 1.0)),)
    axis = replace(AXIS, joint_type="revolute")
    answer = answered((made(hidden, 1), made(hidden, 2)), axis)
    assert [item.settings.name for item in answer.effects] == ["gravity"]
    assert answer.verdict == "effect_found"  # cogging with the pitch of a turn is no other explanation


def test_a_ripple_is_named_although_the_same_recording_also_lacks_a_drag(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("cogging",))
    time = np.arange(round(24.0 / PERIOD)) * PERIOD
    position = 0.013 * np.sin(2.0 * np.pi * 0.5013 * time) + 0.009 * np.sin(2.0 * np.pi * 0.173 * time)
    monkeypatch.setattr(workflow_case, "rich_position", lambda *_: position)
    hidden = (EffectSettings("cogging", (0.4, 0.004, 0.3, 0.0, 0.0)), EffectSettings("asymmetric_viscous", (15.0,)))
    recording = made(hidden, 1, duration=24.0)
    answer = answer_of(diagnose([recording], [], AXIS, OPTIONS), AXIS, OPTIONS)
    assert [item.settings.name for item in answer.effects] == ["cogging"]
    assert answer.effects[0].settings.values[1] == pytest.approx(0.004, rel=0.01)


ROUGH = 0.8 * np.random.default_rng(61).standard_normal(61)


@pytest.mark.parametrize(
    ("ripple", "pitch", "along", "is_named"),
    [(0.4, 0.002, LEVEL, True), (0.4, 0.02, LEVEL, False), (0.0, 0.002, ROUGH, False)],
    ids=["short_pitch", "long_pitch", "rough_rail"],
)
def test_a_ripple_has_its_name_beside_a_map_of_the_rail_that_cannot_take_it(
    ripple: float, pitch: float, along: np.ndarray, is_named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The force along the rail closes more than the ripple does. A map of 24 points can take a long pitch, but not a
    short one. It cannot take a rough rail either, which one pitch does not describe."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("cogging",))
    monkeypatch.setattr(workflow_case, "rich_position", slow_strokes)
    places = tuple(np.linspace(-0.024, 0.024, len(along)).tolist())
    rail = LearntMap(("position",), (places,), tuple(along.tolist()))
    hidden = (EffectSettings("cogging", (ripple, pitch, 0.3, 0.0, 0.0)), rail.settings())
    answer = answered((made(hidden, 1, duration=24.0), made(hidden, 2, duration=24.0)), AXIS)
    found = [item.settings.values[1] for item in answer.effects]
    assert found == ([pytest.approx(pitch, rel=0.01)] if is_named else [])
    assert answer.remainder == "learnt" and answer.learnt[0].coordinates[0] == "position"
    told = f"something without a name is missing: with a learnt map of it, {answer.gap_with_learnt:.3g} % is left."
    assert (told in sentence(answer, AXIS.units)) is is_named


def slow_strokes(duration: float, seed: int, period: float) -> np.ndarray:
    """Return strokes over 44 mm, slow and fast [m]; the seed gives the phases."""
    time = np.arange(round(duration / period)) * period
    return 0.013 * np.sin(2.0 * np.pi * 0.5013 * time + seed) + 0.009 * np.sin(2.0 * np.pi * 0.173 * time + 2.0 * seed)


def test_parts_left_out_in_turn_are_enough_to_learn_from(rail: tuple[Recording, Recording]) -> None:
    answer = answer_of(diagnose(rail, [], AXIS, OPTIONS), AXIS, OPTIONS)
    assert answer.verdict == "unknown_effect" and answer.remainder == "learnt"
    assert answer.gap.held_out == "cross-validated"
    assert answer.gap_with_learnt < 0.7 * answer.gap.after


@pytest.mark.parametrize(("share", "is_learnt"), [(0.11, True), (0.09, False)])
def test_a_map_that_hardly_closes_the_gap_is_not_learnt(
    share: float, is_learnt: bool, rail: tuple[Recording, Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(GapData, "reduction", lambda *_: Improvement(share, 9.0, 1.0))
    answer = answered(rail, AXIS)
    assert bool(answer.learnt) is is_learnt


def answered(pair: tuple[Recording, ...], axis: AxisSettings) -> Answer:
    """Return the answer on two recordings, the second held out."""
    return answer_of(diagnose(pair[:1], pair[1:], axis, OPTIONS), axis, OPTIONS)


def test_a_coulomb_force_that_moved_is_listed_with_its_old_and_new_value() -> None:
    friction = replace(AXIS.friction, coulomb_force=5.6, static_force=7.0)
    axis = replace(AXIS, friction=friction)
    answer = answered((made((), 1), made((), 2)), axis)
    listed = {item.name: item for item in answer.changed}
    moved = listed["friction.coulomb_force"]
    assert moved.before == 5.6
    assert moved.after == pytest.approx(4.0, rel=0.05)
    assert moved.closes > 0.5
    result = result_of(answer, (CompensationCheck(1.0, 1.0), CompensationCheck(1.0, 1.0)), None, AXIS.units)
    (entry,) = [item for item in result["changed"] if item["name"] == "friction.coulomb_force"]
    assert set(entry) == {"name", "from", "to", "std_error", "closes"} and entry["std_error"] > 0.0


def test_a_listed_offset_that_moved_is_listed() -> None:
    axis = replace(AXIS, effects=(OFFSET,))
    hidden = (EffectSettings("offset", (0.9,)),)
    answer = answered((made(hidden, 1), made(hidden, 2)), axis)
    listed = {item.name: item for item in answer.changed}
    assert listed["effects.offset.force"].before == pytest.approx(0.3)
    assert listed["effects.offset.force"].after == pytest.approx(0.9, rel=0.05)


def test_a_listed_offset_that_is_not_there_is_no_asymmetry(monkeypatch: pytest.MonkeyPatch) -> None:
    """An asymmetry can cancel it while the contact slides. Another value of what the file lists is simpler."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("offset", "asymmetric_coulomb"))
    axis = replace(AXIS, effects=(OFFSET,))
    learn, judge = (record(seed=seed, duration=12.0) for seed in (1, 2))
    options = Options(workers=1, band=100.0)
    answer = answer_of(diagnose([learn], [judge], axis, options), axis, options)
    assert [item.settings.name for item in answer.effects] == ["offset"]
    (moved,) = [item for item in answer.changed if item.name == "effects.offset.force"]
    assert moved.before == 0.3 and abs(moved.after) < 0.03


def test_a_file_that_holds_has_no_changed_values() -> None:
    hidden = (OFFSET,)
    assert answered((made(hidden, 1), made(hidden, 2)), replace(AXIS, effects=hidden)).changed == ()


def test_a_recording_that_was_learnt_from_does_not_judge(tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    refuse_learnt_from([str(bag)], [str(tmp_path / "other")])
    for same in (str(bag), str(tmp_path / "." / "bag") + "/", str(tmp_path / "x" / ".." / "bag")):
        with pytest.raises(ConfigurationError, match="also fitted to"):
            refuse_learnt_from([str(bag)], [same])


def _along_the_rail(level: np.ndarray, common: np.ndarray, places: np.ndarray) -> EffectSettings:
    """Return a friction level and a force that is the same both ways, along the rail [N]."""
    values = np.column_stack([common - level, common + level]).ravel()
    return LearntMap(("position", "direction"), (tuple(places.tolist()), ()), tuple(values.tolist())).settings()


def _answer_with_pieces(hidden: EffectSettings, monkeypatch: pytest.MonkeyPatch) -> Answer:
    """Return the answer of a search that does not ask whether a map over its coordinates predicts better than an
    effect, as where the data are too few to tell."""
    monkeypatch.setattr(workflow, "catalogue_names", lambda: ("spring", "position_dependent_friction", "offset"))
    options = replace(OPTIONS, criteria=replace(OPTIONS.criteria, min_predictable_share=0.99))
    return answer_of(diagnose([made((hidden,), 3)], [made((hidden,), 4)], AXIS, options), AXIS, options)


@pytest.mark.parametrize("is_pair", [True, False])
def test_pieces_of_a_force_along_the_rail_have_no_names(is_pair: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tight spot and a spring keep both names; in backward motion another force than in forward motion keeps none."""
    span = 0.028
    places = np.linspace(-1.5 * span, 1.5 * span, 41)
    bump, ramp = np.exp(-(((places / span - 0.3) / 0.5) ** 2)), places / span
    hidden = _along_the_rail(1.2 * bump, 0.5 * ramp, places)
    if not is_pair:
        hidden = _along_the_rail(0.9 * bump, 0.9 * bump + 0.3 * ramp, places)
    answer = _answer_with_pieces(hidden, monkeypatch)
    assert {item.settings.name for item in answer.effects} == {"spring", "position_dependent_friction"}
    title = "z-score of all effects over the position beyond one map over it"
    assert [test.name for test in answer.doubtful] == ([] if is_pair else [title])


@pytest.mark.parametrize(("constant", "is_piece"), [(0.0, True), (0.6, False)])
def test_an_offset_that_does_not_act_everywhere_is_a_piece_of_the_map_beside_it(
    constant: float, is_piece: bool
) -> None:
    """A force that falls off after the start has a mean, which may close more than the rest of it."""
    times = np.linspace(0.0, 12.0, 25)
    force = constant + 0.6 * np.exp(-times / 4.0)
    hidden = LearntMap(("time",), (tuple(times.tolist()),), tuple(force.tolist())).settings()
    answer = answer_of(diagnose([made((hidden,), 5)], [made((hidden,), 6)], AXIS, OPTIONS), AXIS, OPTIONS)
    assert answer.effects[0].settings.name == "offset" and answer.learnt
    title = "share of a constant force that acts where the learnt maps beside it are lowest"
    assert [test.name for test in answer.doubtful] == ([title] if is_piece else [])


@pytest.mark.parametrize("hysteresis", [0.12, 0.06, 0.0])
def test_a_spring_that_pulls_harder_one_way_is_told(hysteresis: float) -> None:
    """Also where too little is left for a map to be learnt."""
    places = np.linspace(-0.042, 0.042, 41)
    force = 60.0 * places
    hidden = _along_the_rail(hysteresis * np.abs(force), force, places)
    answer = answer_of(diagnose([made((hidden,), 7)], [made((hidden,), 8)], AXIS, OPTIONS), AXIS, OPTIONS)
    assert [item.settings.name for item in answer.effects] == ["spring"]
    title = "z-score of a force that differs between the directions"
    is_hysteretic = hysteresis > 0.0
    failed = [test for test in answer.tests if test.name == title and not test.passed]
    assert len(failed) == is_hysteretic and (answer.remainder == "none") != is_hysteretic
    told = "Beside spring, the force along the position differs between the directions"
    assert (told in sentence(replace(answer, learnt=()), AXIS.units)) == is_hysteretic
