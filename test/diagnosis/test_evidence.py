"""Predictive evidence: blocks left out, improvements with their chance, free-form terms, the ceiling."""

import math
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
from sklearn.ensemble import HistGradientBoostingRegressor
from workflow_case import AXIS, evaluation_of, record

from sgms_observer.diagnosis import decision
from sgms_observer.diagnosis.candidates import Candidate
from sgms_observer.diagnosis.coordinates import coordinates_of
from sgms_observer.diagnosis.criteria import Criteria, at_least, at_most
from sgms_observer.diagnosis.decision import (
    FORM,
    decide,
    free_form_prediction,
    free_form_tests,
    physical_tests,
    range_tests,
    strength,
    strength_beyond_tolerance,
)
from sgms_observer.diagnosis.evaluation import evidence_of
from sgms_observer.diagnosis.evidence import (
    Improvement,
    blocks_of,
    fit_residuals,
    held_out_residuals,
    improvement,
    in_blocks,
    left_out_residuals,
    preference,
)
from sgms_observer.diagnosis.fit import FRICTION_VALUES, Freedom, Refit, RefitSetup, limits
from sgms_observer.diagnosis.free_form import ALL, LEAF_TIME, TREES, free_form
from sgms_observer.diagnosis.gap import WeightedResidual
from sgms_observer.diagnosis.model import VISCOUS, Model
from sgms_observer.diagnosis.motion import EffortLag, Motion, motion_of
from sgms_observer.diagnosis.uncertainty import as_time_series
from sgms_observer.diagnosis.whitened import WhitenedData, data_with_own_noise
from sgms_observer.settings.axis import EffectSettings

MODEL = Model.of(AXIS)
COGGING = EffectSettings("cogging", (0.6, 0.01, 0.3, 0.0, 0.0))
CRITERIA = Criteria()


def moved(effects: tuple[EffectSettings, ...] = (), seed: int = 1, duration: float = 12.0) -> Motion:
    """Return a short motion at a low rate."""
    return motion_of(record(effects, seed=seed, duration=duration, period=1.0 / 250.0), band=25.0)


@pytest.fixture(scope="module")
def data() -> WhitenedData:
    """Two recordings with their noise."""
    return data_with_own_noise((moved(duration=5.0), moved(seed=2, duration=4.0)), MODEL)


def test_a_block_is_predicted_as_by_the_fit_without_it(data: WhitenedData) -> None:
    rng, count = np.random.default_rng(3), len(data.residual(MODEL))
    columns, target = rng.normal(size=(count, 4)), rng.normal(size=count)
    prior = 3.0 * np.eye(4)
    rows, wanted = np.vstack([columns, prior]), np.concatenate([target, np.zeros(4)])
    solution = np.linalg.lstsq(rows, wanted)[0]
    found = Refit(MODEL, np.zeros(4), (), columns @ solution - target, 0.0, rows, np.zeros(0), ())
    left = left_out_residuals(found, data, CRITERIA.block)
    pieces: list[np.ndarray] = []
    for motion, series in zip(data.motions, as_time_series(np.column_stack([columns, target]), data), strict=True):
        pieces += blocks_of(series, len(motion.time) * motion.period / len(series), CRITERIA.block)
    assert len(left) == len(pieces) > 15
    for place, piece in enumerate(pieces):
        kept = [one for i, one in enumerate(pieces) if i != place]
        others = np.vstack([*kept, np.column_stack([prior, np.zeros(4)])])
        again = np.linalg.lstsq(others[:, :-1], others[:, -1])[0]
        assert left[place] == pytest.approx(piece[:, :-1] @ again - piece[:, -1], rel=1e-6, abs=1e-9)


def test_an_improvement_counts_chance_and_nothing_else() -> None:
    rng = np.random.default_rng(1)
    noise = [rng.normal(size=50) for _ in range(40)]
    shape = [np.sin(np.arange(50.0)) for _ in noise]
    with_it = [one + 0.5 * other for one, other in zip(noise, shape, strict=True)]
    gain = improvement(with_it, noise)
    assert gain.decrease == pytest.approx(sum(float(a @ a - b @ b) for a, b in zip(with_it, noise, strict=True)))
    assert gain.z_score > 5.0
    assert improvement(noise, with_it).z_score < -2.0  # what the worse model leaves is part of the chance
    assert improvement(noise, noise).z_score == 0.0
    chance = [improvement([one + 0.01 * rng.normal(size=50) for one in noise], noise).z_score for _ in range(200)]
    assert np.mean(np.abs(chance) > 3.0) < 0.05


def test_an_improvement_is_the_decrease_of_the_square_over_its_standard_error() -> None:
    before = [np.array([2.0, 0.0]), np.array([1.0, 2.0]), np.array([0.0, 0.0])]
    after = [np.array([1.0, 0.0]), np.array([3.0, 0.0]), np.array([0.5, 0.0])]
    found = improvement(before, after)
    assert found.decrease == pytest.approx(4.0 - 1.0 + 5.0 - 9.0 - 0.25)
    chance = 2.0 * np.array([1.0 * 1.0, 3.0 * -2.0, 0.5 * -0.5])
    assert found.z_score == pytest.approx(found.decrease / np.sqrt(chance @ chance))
    assert found.before == pytest.approx(9.0)
    tiny = [0.1 * one for one in before], [0.1 * one for one in after]
    assert improvement(*tiny).z_score == pytest.approx(found.z_score)
    assert improvement(before, [0.0 * one for one in before]).z_score == 0.0  # no residual, no standard error


def test_the_share_of_an_improvement_lies_between_nothing_and_all() -> None:
    assert Improvement(2.0, 1.0, 8.0).share == 0.25 and Improvement(0.02, 1.0, 0.08).share == pytest.approx(0.25)
    assert Improvement(-2.0, -1.0, 8.0).share == 0.0
    assert Improvement(0.0, 0.0, 0.0).share == Improvement(-1.0, 0.0, 0.0).share == 0.0


def test_a_series_is_cut_into_blocks_of_about_one_length() -> None:
    series = np.arange(100.0)
    for length, count in ((0.25, 4), (0.3, 3), (0.5, 2), (0.8, 1), (60.0, 1)):
        blocks = blocks_of(series, 0.01, length)
        assert len(blocks) == count and np.array_equal(np.concatenate(blocks), series)
        assert max(map(len, blocks)) - min(map(len, blocks)) <= 1
    motions = [SimpleNamespace(residual_period=0.01), SimpleNamespace(residual_period=0.02)]
    parts = in_blocks([series, series], motions, 0.5)  # type: ignore[arg-type]
    assert [len(part) for part in parts] == [50] * 2 + [25] * 4
    with pytest.raises(ValueError, match="argument 2"):
        in_blocks([series], motions, 0.5)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="argument 2"):
        improvement([series], [series, series])


def test_residuals_of_blocks_are_the_recordings_in_their_order(data: WhitenedData) -> None:
    residual = data.residual(MODEL)
    found = Refit(MODEL, np.zeros(4), (), residual, 0.0, np.zeros((len(residual), 4)), np.zeros(0), ())
    whole = np.concatenate([series[:, 0] for series in as_time_series(residual[:, None], data)])
    for blocks in (fit_residuals(found, data, 0.5), held_out_residuals(MODEL, data, 0.5)):
        assert len(blocks) == 18  # 5 s and 4 s
        assert all(block.ndim == 1 for block in blocks)
        assert np.array_equal(np.concatenate(blocks), whole)
    assert held_out_residuals(MODEL, replace(data, motions=()), 0.5) == []


def test_criteria_are_the_conventions_that_the_docs_give_reasons_for() -> None:
    from scipy import stats

    assert round(1.0 / stats.norm.sf(CRITERIA.min_z_score), -1) == 740.0
    assert pytest.approx(stats.norm.ppf(0.95), abs=5e-4) == CRITERIA.interval_z_score
    others = {name: value for name, value in asdict(CRITERIA).items() if not name.endswith("z_score")}
    assert others == {
        "min_closed_share": 0.05, "min_imitable_share": 0.5, "max_gap_over_noise": 10.0, "max_sliding_over_noise": 2.0,
        "max_unexplained": 1.0 / 3.0, "max_rate_share": 0.4, "min_gap_over_floor": 1.1, "min_predictable_share": 0.1,
        "block": 0.5, "max_effects": 4,
    }  # fmt: skip
    assert CRITERIA.is_noise(2.2, 2.0) and CRITERIA.is_noise(0.0, 2.0) and not CRITERIA.is_noise(2.21, 2.0)
    assert Criteria(min_z_score=50.0).z_score_of(1) == math.inf  # beyond what a number can hold


def test_what_the_best_of_many_needs_keeps_the_chance_of_all_together() -> None:
    from scipy import stats

    for trials in (1, 7, 300):
        needed = CRITERIA.z_score_of(trials)
        assert trials * stats.norm.sf(needed) == pytest.approx(stats.norm.sf(CRITERIA.min_z_score), rel=1e-6)
    assert CRITERIA.z_score_of(0) == pytest.approx(CRITERIA.min_z_score)
    assert np.isfinite(CRITERIA.z_score_of(10**9))


def test_a_test_says_value_threshold_and_outcome() -> None:
    assert at_least("cogging", "z", 3.0, 3.0).passed and not at_least("cogging", "z", 2.9, 3.0).passed
    assert at_most("cogging", "z", 3.0, 3.0).passed and not at_most("cogging", "z", 3.1, 3.0).passed
    assert not at_least("cogging", "z", float("nan"), 3.0).passed
    assert not at_most("cogging", "z", float("nan"), 3.0).passed


@pytest.mark.parametrize("has_held_out", [False, True])
def test_nothing_predicts_noise_and_the_ceiling_sees_what_hangs_on_the_speed(has_held_out: bool) -> None:
    learn, held = moved(), moved(seed=2)
    rng = np.random.default_rng(2)

    def alike(motion: Motion, residual: np.ndarray) -> WeightedResidual:
        return WeightedResidual([motion], [residual], [np.ones(len(residual))])

    def noise(motion: Motion) -> np.ndarray:
        return rng.normal(size=len(motion.thinned(motion.time)))

    def wave(motion: Motion) -> np.ndarray:
        speed = motion.thinned(motion.velocity)
        return np.cos(2.0 * speed / np.std(speed)) + 0.2 * noise(motion)

    for make, is_seen in ((noise, False), (wave, True)):
        known = alike(learn, make(learn))
        found = free_form(ALL, known, alike(held, make(held)) if has_held_out else known, CRITERIA, 1)
        surely = found.improvement.share if found.improvement.z_score > CRITERIA.min_z_score else 0.0
        assert (surely > 0.6) == is_seen
        assert is_seen or surely == 0.0


def test_the_regression_over_bins_is_the_one_over_the_coordinates_themselves() -> None:
    learn, held = moved(), moved(seed=2)
    known, wanted = coordinates_of(learn, ALL), coordinates_of(held, ALL)
    target = np.cos(known[:, 2] / np.std(known[:, 2])) + 0.2 * np.random.default_rng(4).normal(size=len(known))
    weights = np.random.default_rng(5).uniform(0.2, 1.0, len(known))
    weights[:200] = 0.0
    assert min(counts := [len(np.unique(column)) for column in known.T]) < 255 < max(counts)  # both kinds of bins
    evaluated = WeightedResidual([held], [np.zeros(len(wanted))], [np.ones(len(wanted))])
    found = free_form(ALL, WeightedResidual([learn], [target], [weights]), evaluated, CRITERIA, 1)
    leaf = max(20, min(round(LEAF_TIME / learn.residual_period), len(known) // 20))
    direct = HistGradientBoostingRegressor(
        max_iter=TREES, learning_rate=0.06, min_samples_leaf=leaf, early_stopping=False, random_state=1
    )
    assert np.array_equal(found.predicted[0], direct.fit(known, target, weights**2).predict(wanted))


def test_a_name_is_earned_where_a_free_form_term_over_its_coordinates_does_no_better() -> None:
    motion = moved((COGGING,))
    evaluation = evaluation_of((motion,), MODEL.with_effects([COGGING]))
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    plain = setup.fit(())
    assert free_form_prediction(("position",), plain.model, evaluation).improvement.share > 0.6
    assert free_form_prediction(("dwell",), plain.model, evaluation).improvement.share < 0.3
    for start, is_earned in ((COGGING, True), (EffectSettings("spring", (10.0, 0.0)), False)):
        found = setup.fit((start,))
        item = Candidate(start.name, setup, found, 1)
        closed = improvement(evidence_of(plain, evaluation).force, evidence_of(found, evaluation).force)
        (test,) = free_form_tests(item, plain, closed, evaluation)
        assert test.passed == is_earned, (start.name, test.value)
        assert test.name == "share that is surely predicted better by a free-form term over position"


@pytest.mark.parametrize(
    ("hidden", "passes"), [(EffectSettings("mass_error", (2.0,)), True), (EffectSettings("spring", (40.0, 0.0)), False)]
)
def test_a_mass_is_judged_in_fast_sliding_where_the_contact_predicts_better(
    hidden: EffectSettings, passes: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A regression over the coordinates of a contact describes the contact; a mass is a force beside it."""
    refused = at_most(hidden.name, f"{FORM} over velocity", 0.6, CRITERIA.min_predictable_share)
    monkeypatch.setattr(decision, "free_form_tests", lambda *_: [refused])
    effects = (hidden, EffectSettings("stribeck", (0.6, 0.02)))
    learn, held = moved(effects), moved(effects, seed=2)
    evaluation = evaluation_of((learn,), MODEL.with_effects(effects), (held,))
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    plain, found = setup.fit(()), setup.fit((hidden,))
    made = decide(Candidate(hidden.name, setup, found, 1), plain, evidence_of(plain, evaluation), evaluation)
    assert [test for test in made.tests if not test.passed] == ([] if passes else [refused])
    assert made.tests[-1].name.endswith("where the contact slides fast") == passes


def test_a_hypothesis_that_fails_says_which_test_with_its_value() -> None:
    motion = moved((COGGING,))
    evaluation = evaluation_of((motion,), MODEL.with_effects([COGGING]))
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    plain = setup.fit(())
    fast = setup.fit((EffectSettings("periodic_disturbance", (0.01, 11.0, 0.0)),))
    decision = decide(
        Candidate("periodic_disturbance", setup, fast, 50), plain, evidence_of(plain, evaluation), evaluation
    )
    failed = [test for test in decision.tests if not test.passed]
    assert failed and not decision.passed
    assert all(test.of == "periodic_disturbance" and np.isfinite([test.value, test.threshold]).all() for test in failed)


def test_an_effect_at_a_bound_or_beyond_the_recordings_fails() -> None:
    motion = moved()
    evaluation = evaluation_of((motion,), MODEL)
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    plain = setup.fit(())
    rate = motion.step / motion.period
    most = float(np.max(np.abs(motion.effort)))

    def item(name: str, *values: float) -> Candidate:
        effects = (EffectSettings(name, values),)
        return Candidate(name, setup, replace(plain, effects=effects), 1)

    slow, fast = (item("periodic_disturbance", 0.1, share * rate, 0.0) for share in (0.39, 0.41))
    assert all(test.passed for test in physical_tests(slow, math.inf, evaluation))
    assert not all(test.passed for test in physical_tests(fast, math.inf, evaluation))
    low = item("actuator_saturation", 1e-3 * most)
    assert not all(test.passed for test in physical_tests(low, math.inf, evaluation))
    assert not all(test.passed for test in range_tests(item("actuator_saturation", most)))
    assert not all(test.passed for test in range_tests(item("mass_error", -0.9 * MODEL.mass)))  # nothing is left
    assert all(test.passed for test in range_tests(item("mass_error", -0.5 * MODEL.mass)))
    stroke = float(np.ptp(motion.position))
    assert not all(test.passed for test in range_tests(item("cogging", 0.5, 0.7 * stroke, 0.1, 0.0, 0.0)))
    assert all(test.passed for test in range_tests(item("cogging", 0.5, 0.2 * stroke, 0.1, 0.0, 0.0)))


@pytest.mark.parametrize(
    ("name", "values", "freedom", "passes"),
    [
        ("quadratic_drag", (5.0,), Freedom(friction=FRICTION_VALUES), False),
        ("quadratic_drag", (5.0,), Freedom(), True),
        ("quadratic_drag", (5.0,), Freedom(friction=frozenset({"stribeck_velocity"})), True),
        ("offset", (0.5,), Freedom(friction=FRICTION_VALUES), True),
    ],
)
def test_beside_freed_friction_at_its_end_no_effect_that_a_contact_can_imitate_passes(
    name: str, values: tuple[float, ...], freedom: Freedom, passes: bool
) -> None:
    """The fit would exchange more of the viscous friction for the drag, if its range were wider."""
    evaluation = evaluation_of((moved(),), MODEL)
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05, freedom)
    logs = np.zeros(len(MODEL.parameter_names()))
    logs[VISCOUS] = -limits(MODEL, 0.05, freedom)[VISCOUS]
    fit = replace(setup.fit((), evaluations=1), effects=(EffectSettings(name, values),), logs=logs)
    (test,) = range_tests(Candidate(name, setup, fit, 1))
    assert test.passed == passes


@pytest.mark.parametrize("lag", [0.0, 0.5])
def test_a_delay_that_a_held_effort_or_inexact_stamps_may_make_fails(lag: float) -> None:
    motion = replace(moved(), lag=EffortLag((lag,)))
    evaluation = evaluation_of((motion,), MODEL)
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    plain = setup.fit(())
    rate = motion.step / motion.period

    def delayed(samples: float, error: float) -> Candidate:
        delay = EffectSettings("actuator_delay", (samples / rate,))
        refit = replace(plain, effects=(delay,), jacobian=np.array([[rate / error]]), scales=np.ones(1), free=((0, 0),))
        return Candidate("actuator_delay", setup, refit, 1)

    for total, error, is_long in ((0.66, 0.01, True), (0.64, 0.01, False), (0.66, 0.02, False), (0.52, 0.001, False)):
        candidate = delayed(total - lag, error)
        *_, test = physical_tests(candidate, strength(candidate), evaluation)
        assert test.name == "shortest likely lag of the effort over sample period"
        assert test.value == pytest.approx(max(lag, total - CRITERIA.min_z_score * error))
        assert test.passed == is_long


@pytest.mark.parametrize(("mass", "is_beyond"), [(5.4, True), (5.1, False)])
def test_a_mass_beyond_its_tolerance_is_sure_though_the_mass_within_is_not(mass: float, is_beyond: bool) -> None:
    motion = motion_of(record(duration=10.0, mass=mass))
    setup = RefitSetup(data_with_own_noise([motion], MODEL), MODEL, 0.05)
    before = setup.fit(())
    error = EffectSettings("mass_error", (0.1,))
    item = Candidate("mass_error", setup, setup.fit((error,), before.logs), 1)
    assert strength(item) < CRITERIA.min_z_score
    beyond = strength_beyond_tolerance(item, before)
    assert beyond > CRITERIA.min_z_score if is_beyond else beyond == 0.0


def test_a_preference_is_the_mean_gain_over_its_standard_error() -> None:
    one = [np.array([1.0, 1.0]), np.array([2.0, 0.0]), np.array([0.0, 1.0])]
    other = [np.array([2.0, 1.0]), np.array([2.0, 3.0]), np.array([1.0, 1.0])]
    gains = [3.0, 9.0, 1.0]  # how much more the other one leaves
    expected = np.mean(gains) / (np.std(gains, ddof=1) / np.sqrt(3.0))
    assert preference(one, other) == pytest.approx(expected)
    assert preference(other, one) == pytest.approx(-expected)
    assert preference([1e-3 * block for block in one], [1e-3 * block for block in other]) == pytest.approx(expected)


def test_no_preference_without_scatter() -> None:
    block, worse = np.array([1.0, 2.0]), np.array([2.0, 2.0])
    assert preference([block], [worse]) == 0.0  # one block says nothing of the scatter
    assert preference([block] * 2, [worse] * 2) == 0.0
    assert preference([block, block], [worse, block]) == pytest.approx(1.0)  # gains 3, 0
