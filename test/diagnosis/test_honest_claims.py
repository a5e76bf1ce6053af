"""What a diagnosis may claim: the contact the data show, names that held-out data bear out, errors that hold."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from workflow_case import AXIS, PERIOD, evaluation_of, record, rich_position

from sgms_observer.diagnosis import candidates
from sgms_observer.diagnosis.candidates import Candidate, finish_fit, first_fit, fitted_candidates
from sgms_observer.diagnosis.changed_contact import CHANGE_HYPOTHESES, changed_candidate, freed_setup
from sgms_observer.diagnosis.criteria import Criteria
from sgms_observer.diagnosis.decision import Decision, decide, strength_over_error
from sgms_observer.diagnosis.diagnosis import FitState, Options, Recordings, Round, WrittenFits
from sgms_observer.diagnosis.evaluation import EvaluationData, evidence_of
from sgms_observer.diagnosis.evidence import improvement, in_blocks
from sgms_observer.diagnosis.fit import FRICTION_VALUES, Freedom, Refit, RefitSetup, refit
from sgms_observer.diagnosis.gap import residuals
from sgms_observer.diagnosis.model import COULOMB, STATIC, Model, predict
from sgms_observer.diagnosis.motion import HELD_LAG, Motion, motion_of
from sgms_observer.diagnosis.pruning import (
    _size_beyond_tolerance,
    with_friction_of_file,
    without_insignificant_effects,
    without_redundant_effects,
)
from sgms_observer.diagnosis.screen import Screen
from sgms_observer.diagnosis.search import TRIAL_SHARE
from sgms_observer.diagnosis.sliding_force import start_logs
from sgms_observer.diagnosis.uncertainty import (
    Accuracy,
    RecordingEstimates,
    Scatter,
    as_time_series,
    covariances_with_common_values,
    leave_one_out_shifts,
    recording_estimates,
)
from sgms_observer.diagnosis.whitened import data_with_own_noise
from sgms_observer.diagnosis.workflow import diagnose
from sgms_observer.effects.catalogue import effect, names
from sgms_observer.offline.recording import Recording
from sgms_observer.settings.axis import EffectSettings
from sim_plant.blind.score import NINETY_PERCENT

MODEL = Model.of(AXIS)
OFFSET = EffectSettings("offset", (0.6,))


@pytest.mark.parametrize("is_unsmoothed", [False, True])
@pytest.mark.parametrize("effects", [(), (OFFSET,)])
def test_the_contact_is_read_off_the_recording_with_what_was_found_in_the_model(
    is_unsmoothed: bool, effects: Any
) -> None:
    motion = motion_of(record(effects, is_unsmoothed=is_unsmoothed))
    evaluation = evaluation_of((motion,), MODEL.with_effects(effects))
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    found = setup.fit(effects)
    unsmoothed = changed_candidate(setup, found, CHANGE_HYPOTHESES[2])
    is_better = unsmoothed.refit.cost < found.cost
    assert (
        is_better and decide(unsmoothed, found, evidence_of(found, evaluation), evaluation).tests[0].passed
    ) == is_unsmoothed


@pytest.mark.parametrize("model", ["sgms", "gms"])
def test_a_lag_that_the_file_has_not_is_an_effect_and_no_change_of_the_contact(model: str) -> None:
    """Another contact law with a lag of its own predicted better than the frictional lag and took its name."""
    nominal = replace(MODEL, friction=replace(MODEL.friction, model=model, attraction_rate=400.0))
    data = data_with_own_noise((motion_of(record(duration=6.0)),), nominal)
    for name in CHANGE_HYPOTHESES:
        free = freed_setup(RefitSetup(data, nominal, 0.05), name).nominal
        assert ("attraction_rate" in free.parameter_names()) == (model == "gms")
    assert free.is_unsmoothed == (model == "sgms") and free.relaxation > 0.0


def gained(before: Model, after: Model, motion: Motion) -> float:
    """Return the z-score of what the later model predicts better."""
    return improvement(*(in_blocks(residuals(model, (motion,)), (motion,), 0.5) for model in (before, after))).z_score


def test_an_effect_at_few_moments_is_sure_and_a_change_that_means_nothing_is_not() -> None:
    noise = record(duration=10.0)
    t = np.arange(len(noise.position)) * PERIOD
    rare = replace(noise, effort=noise.effort + np.where((t > 6.0) & (t < 6.4), 0.6, 0.0))
    motion = motion_of(rare)
    late = EffectSettings("wear_step", (0.0, 1.0, 0.01))
    with_it = MODEL.with_effects([OFFSET])
    least = 3.0
    assert gained(MODEL, with_it, motion) < 0.0  # an offset all the time is wrong nearly all the time
    held = replace(rare, effort=noise.effort + np.where(t > 6.0, 0.6, 0.0))
    assert gained(MODEL, with_it, motion_of(held)) < least
    assert gained(MODEL, with_it, motion_of(record((OFFSET,), duration=10.0))) > 3.0 * least
    assert gained(MODEL, MODEL.with_effects([late]), motion) == pytest.approx(0.0)


def test_a_missing_element_starts_with_the_level_as_it_is() -> None:
    logs = np.zeros(len(MODEL.parameter_names()))
    moved = start_logs(logs, MODEL, EffectSettings("presliding", (0.8, 1e-4)))
    assert np.exp(moved[COULOMB]) == pytest.approx(0.8) and np.exp(moved[STATIC]) == pytest.approx(0.84)
    assert np.array_equal(start_logs(logs, MODEL, OFFSET), logs)


def test_the_screening_does_not_exclude_a_dead_zone_which_the_coulomb_force_absorbs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The residual of a file that has absorbed it may look like a dead zone of the other sign, which there is not."""
    motion = motion_of(record(duration=8.0))
    model = MODEL.with_effects([EffectSettings("actuator_dead_zone", (0.6,))])
    data = data_with_own_noise((motion,), model)
    found = refit(data, model, 0.05)
    screen = Screen(data, found, 0.05, Freedom(), ("actuator_dead_zone", "spring"))
    assert screen.screenings["actuator_dead_zone"].chi2_reduction == 0.0 and not screen.starts("actuator_dead_zone")
    (start,) = screen.starts("actuator_dead_zone", has_trial=True)
    assert start.values[0] == pytest.approx(TRIAL_SHARE * found.model.friction.coulomb_force)
    assert screen.starts("spring", has_trial=True) == screen.starts("spring"), "a shape that reduces the residual"
    fitted: list[str] = []
    monkeypatch.setattr(candidates, "first_fit", lambda _setup, before, start, _: fitted.append(start.name) or before)
    fitted_candidates(RefitSetup(data, model, 0.05), screen, found, 1, [])
    assert "actuator_dead_zone" in fitted


def test_a_fit_from_far_too_strong_a_start_does_not_end_worse_than_without_the_effect() -> None:
    motion = motion_of(record(duration=8.0))
    data = data_with_own_noise((motion,), MODEL)
    before = refit(data, MODEL, 0.05)
    columns = Screen(data, before, 0.05, Freedom(), ()).nominal_columns
    far = first_fit(RefitSetup(data, MODEL, 0.05), before, EffectSettings("stribeck", (2.9, 8e-3)), columns)
    assert far.cost < 1.05 * before.cost


def test_a_mass_on_a_spring_answers_in_phase_with_the_acceleration_it_feels() -> None:
    rate, own, damping, mass = 30.0, 40.0, 0.05, 0.5
    t = np.arange(8000) * PERIOD
    omega, natural = 2.0 * np.pi * rate, 2.0 * np.pi * own
    motion = motion_of(Recording("test", PERIOD, 1e-4 * np.sin(omega * t), np.zeros(len(t))))
    hung = MODEL.with_effects([EffectSettings("flexible_mode", (mass, own, damping))])
    force = predict(MODEL, motion).residual - predict(hung, motion).residual
    turn = np.exp(-1j * omega * t[4000:7000])
    answer = np.sum(force[4000:7000] * turn) / np.sum(motion.acceleration[4000:7000] * turn)
    expected = mass * omega**2 / (natural**2 - omega**2 + 2j * damping * natural * omega)
    assert answer == pytest.approx(expected, rel=0.02)  # half a step's lead would be 9 % here


def accepted(setup: RefitSetup, found: Refit, without: Refit, name: str, evaluation: EvaluationData) -> Round:
    """Return a round that added an effect, whatever its tests say."""
    item = Candidate(name, setup, found, 1)
    later = evidence_of(found, evaluation)
    gain = improvement(evidence_of(without, evaluation).all, later.all)
    decision = Decision(item, later, gain, gain, ())
    return Round({}, (decision,), decision, {})


@pytest.mark.parametrize(("stiffness", "kept"), [(0.0, False), (30.0, True)])
def test_an_effect_that_a_later_one_made_needless_is_taken_out(stiffness: float, kept: bool) -> None:
    hidden = (EffectSettings("spring", (stiffness, 0.0)), OFFSET)
    source = record(hidden)
    motion = motion_of(source)
    effects = (EffectSettings("spring", (stiffness or 0.1, 0.0)), OFFSET)
    evaluation = evaluation_of((motion,), MODEL.with_effects(hidden))
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.05)
    current = finish_fit(setup, setup.fit(effects))
    nothing = setup.fit(())
    first = setup.fit(effects[:1])
    rounds = [
        accepted(setup, first, nothing, "spring", evaluation),
        accepted(setup, current, first, "offset", evaluation),
    ]
    state = FitState(Recordings((source,), (), HELD_LAG, 100.0), (motion,), (), setup, current)
    after, left = without_redundant_effects(state, rounds, Options())
    assert [item.name for item in after.current.effects] == (["spring", "offset"] if kept else ["offset"])
    assert [item.accepted is not None for item in left] == [kept, True]
    (test,) = (left[0].accepted or left[0].decisions[0]).tests
    assert test.name == "z-score beside the other effects"
    assert test.passed == kept and (test.value >= test.threshold) == kept


@pytest.mark.parametrize("ratio", [1.0, 1.6])
def test_friction_values_that_an_effect_explains_stay_within_the_tolerance(ratio: float) -> None:
    """A change of the contact freed the Coulomb force before the dead zone was found, and could imitate it since."""
    hidden = (EffectSettings("actuator_dead_zone", (0.6,)),)
    source = record(hidden)
    motion = motion_of(source)
    file = replace(MODEL, friction=replace(MODEL.friction, stribeck_velocity=ratio * MODEL.friction.stribeck_velocity))
    evaluation = evaluation_of((motion,), MODEL.with_effects(hidden))
    setup = RefitSetup(evaluation.fit_data, file, 0.05, Freedom(friction=FRICTION_VALUES))
    current = finish_fit(setup, setup.fit(hidden))
    state = FitState(Recordings((source,), (), HELD_LAG, 100.0), (motion,), (), setup, current)
    rounds = [accepted(setup, current, setup.fit(()), "actuator_dead_zone", evaluation)]
    judged = state.evaluation(Options())
    found = with_friction_of_file(state, rounds, judged)
    assert found.setup.freedom.friction == (frozenset() if ratio == 1.0 else {"stribeck_velocity"})
    assert with_friction_of_file(state, [], judged) is state, "without an effect they stay free"
    beside, without = (
        [each.current.model.friction.coulomb_force / MODEL.friction.coulomb_force for each in pair]
        for pair in ((state, found), [one.without("actuator_dead_zone") for one in (state, found)])
    )
    assert beside[0] == pytest.approx(beside[1], rel=0.02)
    assert without[0] > 1.1 and without[1] < 1.051


COGGING = EffectSettings("cogging", (0.5, 7e-4, 0.0, 0.0, 0.0))
OTHER_FRICTION = EffectSettings("stribeck", (-0.4, 0.02))
"""Another friction at low speed."""


def refit_beside(
    other: EffectSettings, named: EffectSettings, reference: np.ndarray | None = None
) -> tuple[FitState, Round]:
    """Return what becomes of a named effect beside another hidden one that is not looked for."""
    source = replace(record((other, named)), reference_position=reference)
    motion = motion_of(source)
    evaluation = evaluation_of((motion,), MODEL.with_effects((other, named)))
    setup = RefitSetup(evaluation.fit_data, MODEL, 0.01)
    nothing = setup.fit(())
    current = finish_fit(setup, setup.fit((named,)))
    found = FitState(Recordings((source,), (), HELD_LAG, 100.0), (motion,), (), setup, nothing)
    rounds = [accepted(setup, current, nothing, named.name, evaluation)]
    after, left, _ = without_insignificant_effects(found, replace(found, current=current), rounds, MODEL, Options())
    return after, left[0]


@pytest.mark.parametrize(("gain", "kept"), [(0.97, False), (0.8, True)])
def test_what_a_contact_law_can_imitate_closes_more_than_it_leaves(gain: float, kept: bool) -> None:
    after, item = refit_beside(COGGING, EffectSettings("actuator_gain", (gain,)))
    (test,) = [one for one in item.decisions[0].tests if one.name.endswith("in the place of another contact law")]
    assert test.passed == kept == (test.value >= 0.5)
    assert len(after.current.effects) == int(kept)


@pytest.mark.parametrize(
    ("other", "named", "kept"),
    [
        (OTHER_FRICTION, EffectSettings("mass_error", (1.0,)), True),
        (OTHER_FRICTION, EffectSettings("flexible_mode", (2.0, 15.0, 0.03)), True),
        (COGGING, EffectSettings("mass_error", (0.3,)), False),
    ],
)
def test_an_inertia_that_closes_less_than_half_shows_in_fast_sliding(
    other: EffectSettings, named: EffectSettings, kept: bool
) -> None:
    """Another friction at low speed is a matter of the contact; a force along the whole way is not."""
    after, item = refit_beside(other, named)
    (test,) = [one for one in item.decisions[0].tests if "beside logarithmic friction" in one.name]
    assert test.passed == kept == (test.value >= 0.5)
    assert len(after.current.effects) == int(kept)


@pytest.mark.parametrize("kept", [False, True])
def test_a_delay_that_closes_less_than_half_shows_in_the_response_to_the_reference(kept: bool) -> None:
    """Another friction at low speed is a matter of the contact, also for the lag of the effort."""
    reference = rich_position(20.0, seed=1) if kept else None
    delay = EffectSettings("actuator_delay", (1.0e-3,))
    after, item = refit_beside(OTHER_FRICTION, delay, reference)
    (test,) = [one for one in item.decisions[0].tests if one.name.startswith(DELAY if kept else OTHER_LAW)]
    assert test.passed == kept == (test.value >= 0.5)
    assert len(after.current.effects) == int(kept)


DELAY, OTHER_LAW = "smallest likely share of the delay", "share of the squared gap above the noise in the place"
SCATTER = "strength over its scatter between recordings"
WITH_SCATTER = "strength over its error with any significant scatter between recordings"
REPLICATED = "strength over its standard error, in held-out recordings too"


@pytest.mark.parametrize(("there", "is_named"), [(0.57, True), (0.45, True), (-0.2, False)])
def test_an_effect_has_to_appear_in_the_held_out_recording_to_be_named(there: float, is_named: bool) -> None:
    learn, held = record((OFFSET,), duration=12.0), record((EffectSettings("offset", (there,)),), 2, 12.0)
    others = frozenset(name for name in names() if name != "offset") | frozenset(CHANGE_HYPOTHESES)
    found = diagnose([learn], [held], AXIS, Options(workers=1, excluded=others))
    assert [item.accepted.candidate.name for item in found.accepted if item.accepted] == ["offset"] * is_named
    tests = [test for item in found.rounds for one in item.decisions for test in one.tests]
    (shrinks,) = [test for test in tests if test.name.startswith("held-out gap")]
    assert shrinks.passed == is_named
    if is_named:
        (told,) = [test for test in tests if test.name == REPLICATED]
        assert told.passed


def estimates(*pairs: tuple[float, float], from_file: float = 0.0) -> RecordingEstimates:
    """Return estimates of one parameter: value and standard error of the fit, then of each other recording.

    Args:
        pairs: value and standard error.
        from_file: the part of each error that comes from the tolerance of the file.
    """
    values, errors = map(np.array, zip(*pairs, strict=True))
    covariance = np.diag(errors**2 - from_file**2) + from_file**2
    return RecordingEstimates(((0, 0),), values[:, None], covariance[None])


def test_a_strength_counts_as_far_as_the_other_recordings_show_it() -> None:
    def z_score(*pairs: tuple[float, float], default: float = 0.0) -> float:
        return estimates(*pairs).smaller_z_score(0, default, 3.0)

    assert z_score((0.6, 0.05)) == pytest.approx(12.0)
    assert z_score((0.6, 0.05), (0.45, 0.01)) == pytest.approx(12.0), "a size may differ"
    assert z_score((0.6, 0.05), (0.01, 0.1)) == pytest.approx(0.1), "not there"
    assert z_score((0.6, 0.05), (-0.3, 0.1)) == pytest.approx(-3.0), "the other sign"
    assert z_score((-0.6, 0.05), (-0.3, 0.1)) == pytest.approx(3.0)
    assert z_score((1.2, 0.05), (1.1, 0.05), default=1.0) == pytest.approx(2.0), "of a gain: from one"
    assert z_score((0.6, 0.05), (0.0, 0.5)) == pytest.approx(12.0), "would not surely show it"
    assert z_score((0.6, 0.05), (9.0, 0.0)) == pytest.approx(12.0), "says nothing of it"
    assert z_score((0.6, 0.05), (0.2, 0.1), (0.3, 0.1)) == pytest.approx(0.25 / 0.1 * np.sqrt(2.0)), "the mean of two"
    same_file = estimates((0.6, 0.05), (0.2, 0.1), (0.3, 0.1), from_file=0.05).smaller_z_score(0, 0.0, 3.0)
    assert same_file == pytest.approx(0.25 / np.hypot(np.sqrt(0.0075 / 2.0), 0.05)), "both have the same wrong file"


def test_a_strength_counts_as_far_as_recordings_agree_on_it() -> None:
    def over_scatter(*pairs: tuple[float, float], default: float = 0.0, from_file: float = 0.0) -> float:
        return estimates(*pairs, from_file=from_file).strength_over_scatter(0, default)

    assert over_scatter((0.6, 0.05)) == pytest.approx(12.0)
    assert over_scatter((0.6, 0.05), (0.58, 0.05), (0.62, 0.05)) == pytest.approx(12.0 * np.sqrt(3.0)), (
        "the mean of all"
    )
    assert over_scatter((8.0, 4.0), (13.0, 4.0)) == pytest.approx(10.5 / 4.0 * np.sqrt(2.0)), "none determines it alone"
    assert over_scatter((8.0, 4.0), (9.0, 0.0)) == pytest.approx(2.0), "a recording without an error says nothing of it"
    assert 3.0 < over_scatter((0.6, 0.05), (0.45, 0.01)) < 12.0, "a size may differ"
    assert over_scatter((0.6, 0.01), (0.1, 0.01), (1.5, 0.01)) < 1.645, "each sure, but of no common size"
    assert over_scatter((1.2, 0.05), (1.2, 0.05), default=1.0) == pytest.approx(4.0 * np.sqrt(2.0)), "a gain: from one"
    file = over_scatter((1.2, 0.05), (1.2, 0.05), default=1.0, from_file=0.05)
    assert file == pytest.approx(4.0), "both have the same wrong file"
    half = over_scatter((1.2, 0.05), (1.2, 0.05), default=1.0, from_file=0.04)
    assert half == pytest.approx(0.2 / np.hypot(0.03 / np.sqrt(2.0), 0.04)), "only the rest shrinks"
    assert over_scatter((0.1, 0.05), (5.0, 0.2)) == pytest.approx(2.0), "hardly a scatter, and no mean either"
    assert over_scatter((0.3, 0.1), (-3.0, 0.25)) == 0.0, "a mean of the other sign"
    assert over_scatter((0.6, np.inf), (0.6, 0.1)) == 0.0, "the fit says nothing"


def test_recordings_of_one_machine_are_compared_with_one_set_of_friction_values() -> None:
    """With values of their own, two recordings shared a dead zone and the Coulomb force out differently."""
    hidden = (EffectSettings("actuator_dead_zone", (0.6,)),)
    learn, other = (motion_of(record(hidden, seed, 12.0)) for seed in (1, 2))
    setup = RefitSetup(data_with_own_noise((learn,), MODEL.with_effects(hidden)), MODEL, 0.05)
    found = finish_fit(setup, setup.fit(hidden))
    shifted = found.logs.copy()
    shifted[COULOMB] += 0.03
    wrong = setup.fit(found.effects, shifted, is_nominal_held=True)
    alike, apart = (recording_estimates(setup, wrong, [other], common).values[:, 0] for common in (True, False))
    assert abs(alike[1] - alike[0]) < 0.3 * abs(apart[1] - apart[0])


def test_recordings_with_one_set_of_friction_values_differ_by_their_noise_only() -> None:
    """A wrong file moves the gain of every recording alike. What is left of their difference is 28 times smaller."""
    gain = (EffectSettings("actuator_gain", (0.85,)),)
    for seed in (10, 13, 16):
        learn, *others = (motion_of(record(gain, seed + k, 8.0)) for k in range(3))
        setup = RefitSetup(data_with_own_noise((learn,), MODEL.with_effects(gain)), MODEL, 0.05)
        fit = finish_fit(setup, setup.fit(gain))
        found = recording_estimates(setup, fit, others, has_common_values=True)
        for one, other in ((0, 1), (0, 2), (1, 2)):
            at = np.ix_([one, other], [one, other])
            error = float(np.sqrt(np.array([1.0, -1.0]) @ found.covariances[0][at] @ np.array([1.0, -1.0])))
            assert abs(found.values[one, 0] - found.values[other, 0]) < 3.5 * error
            assert error < 0.1 * float(found.errors.min())
    alone = recording_estimates(setup, fit, others)
    assert alone.covariances[0, 0, 1] > 0.9 * alone.errors[0, 0] * alone.errors[1, 0], "the same wrong file"


def test_estimates_with_one_set_of_friction_values_have_the_covariance_of_a_linear_model() -> None:
    """Prior rows may hold effect parameters too: of an effect of the file, and of those that share a sliding force."""
    rng = np.random.default_rng(3)
    nominal, count, rows, fits = 3, 2, 60, []
    prior = np.hstack([np.diag([2.0, 3.0, 4.0]), np.array([[0.0, 0.0], [1.5, 0.0], [0.0, 2.0]])])
    for _ in range(3):
        jacobian = np.vstack([rng.normal(size=(rows, nominal + count)), prior])
        fits.append(SimpleNamespace(jacobian=jacobian, scales=np.array([0.5, 2.0]), free=((0, 0), (0, 1))))
    accuracies, by_source = [], []
    for fit, used in zip(fits, (slice(None), slice(nominal, None), slice(nominal, None)), strict=True):
        columns = fit.jacobian[:, used]
        solution = np.linalg.solve(columns.T @ columns, columns.T)  # of all rows
        errors = np.sqrt(np.sum(solution[-count:] ** 2, axis=1)) * fit.scales
        inverse = solution @ solution.T
        accuracies.append(Accuracy(errors, solution[:, rows:].T, (inverse, np.zeros_like(inverse))))
        by_source.append(solution)
    # change of each estimate with the noise of recordings 0, 1, 2 and with the error of the prior rows
    first, changes = by_source[0], []
    for k, (fit, solution) in enumerate(zip(fits, by_source, strict=True)):
        change = np.zeros((count, 3 * rows + len(prior)))
        change[:, k * rows : (k + 1) * rows] += solution[-count:, :rows]
        change[:, 3 * rows :] += solution[-count:, rows:]
        if k:
            of_nominal = -solution @ fit.jacobian[:, :nominal]
            change[:, :rows] += of_nominal @ first[:nominal, :rows]
            change[:, 3 * rows :] += of_nominal @ first[:nominal, rows:]
        changes.append(fit.scales[:, None] * change)
    expected = np.einsum("kps,lps->pkl", changes, changes)
    assert covariances_with_common_values(cast(Any, fits), accuracies) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("there", "is_one"), [(0.6, True), (0.4, False)])
def test_a_dead_zone_that_differs_by_a_third_between_recordings_is_no_dead_zone(there: float, is_one: bool) -> None:
    learn, other = (
        motion_of(record((EffectSettings("actuator_dead_zone", (width,)),), seed, 12.0))
        for seed, width in ((1, 0.6), (2, there))
    )
    hidden = (EffectSettings("actuator_dead_zone", (0.6,)),)
    setup = RefitSetup(data_with_own_noise((learn,), MODEL.with_effects(hidden)), MODEL, 0.05)
    found = recording_estimates(setup, finish_fit(setup, setup.fit(hidden)), [other], has_common_values=True)
    strength = found.size_over(0, 0.0, float(found.errors_with_significant_scatter(1.645)[0]))
    assert (strength > 1.645) == is_one


def test_two_recordings_hardly_tell_how_much_a_size_scatters() -> None:
    """Each shows a gain surely. They differ by a quarter of it, of which Student's distribution makes all."""
    found = estimates((0.84, 0.002), (0.88, 0.002))
    assert found.strength_over_scatter(0, 1.0) > 3.0
    assert found.size_over(0, 1.0, float(found.errors_with_significant_scatter(1.645)[0])) < 1.645


def test_a_scatter_that_is_not_significant_keeps_no_gain_within_the_tolerance() -> None:
    """Two recordings of second with a gain: 0.869 and 0.892 with values of their own, 0.869 twice with those of one."""
    alone = estimates((0.869, 0.0098), (0.892, 0.0098))
    common = estimates((0.869, 0.0098), (0.8689, 0.0098), from_file=0.00979)
    unused: Any = None
    after: Any = SimpleNamespace(model=MODEL, effects=(EffectSettings("actuator_gain", (0.869,)),))
    written = WrittenFits(unused, after, unused, alone, alone, common)
    setup, evaluation = SimpleNamespace(nominal=MODEL, tolerance=0.05), SimpleNamespace(criteria=Criteria())
    closed_gap: Any = SimpleNamespace(written=written, setup=setup, evaluation=evaluation)
    beyond = _size_beyond_tolerance("actuator_gain", closed_gap)
    assert beyond == pytest.approx((1.0 / 0.869 - 1.05) / (0.0098 / 0.869))
    assert written.error_of_value(0, 1.645) == pytest.approx(0.0098)
    assert written.errors[0, 0] > 4.0 * 0.0098, "the reported interval holds every scatter"
    differing = replace(written, with_common_values=estimates((0.90, 0.01), (0.92, 0.01), from_file=0.00999))
    assert differing.error_of_value(0, 1.645) > 4.0 * 0.01, "with one file, a difference of two errors is sure"
    assert written.error_of_value(1, 1.645) == 0.0, "no free value"


def test_a_recording_that_hardly_determines_a_strength_does_not_refuse_it() -> None:
    """Two estimates differ by 1.5 standard errors, as one pair of seven does where nothing differs."""
    found = estimates((0.6, 0.05), (0.27, 0.21))
    assert found.size_over(0, 0.0, float(found.std_errors[0])) < 1.645, "Student's distribution makes that of it"
    assert found.errors_with_significant_scatter(1.645)[0] == pytest.approx(0.05)
    assert found.errors_with_significant_scatter(1.5)[0] == pytest.approx(found.std_errors[0])
    assert estimates((0.6, 0.05)).errors_with_significant_scatter(1.645)[0] == pytest.approx(0.05)
    others = [(0.4 + 0.1 * k, 0.1) for k in range(5)]
    all_six = estimates((0.6, 0.05), *others)
    assert all_six.errors_with_significant_scatter(1.645)[0] > 0.05, "five others do"


@pytest.mark.parametrize(
    ("owner", "method", "title", "value", "is_named"),
    [
        (WrittenFits, "strength_over_error", WITH_SCATTER, 1.6, False),
        (WrittenFits, "strength_over_error", WITH_SCATTER, 1.7, True),
        (RecordingEstimates, "strength_over_scatter", SCATTER, 2.9, False),
        (RecordingEstimates, "strength_over_scatter", SCATTER, 3.1, True),
    ],
)
def test_a_strength_of_another_size_in_each_recording_is_not_named(
    owner: type, method: str, title: str, value: float, is_named: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A contact can imitate a gain, so its interval with the scatter has to exclude zero, too."""
    monkeypatch.setattr(owner, method, lambda *_: value)
    gain = EffectSettings("actuator_gain", (0.8,))
    learn, held = (record((gain,), seed, 12.0) for seed in (1, 2))
    others = frozenset(name for name in names() if name != gain.name) | frozenset(CHANGE_HYPOTHESES)
    found = diagnose([learn], [held], AXIS, Options(workers=1, excluded=others))
    (test,) = [one for item in found.rounds for one in item.tests if one.name == title]
    assert test.value == value and test.passed == is_named == bool(found.accepted)


def test_a_gain_that_another_contact_law_feigns_is_within_the_tolerance_of_the_file() -> None:
    """A presliding that only the gain may explain: mass and Coulomb force would be wrong by less than 5 %."""
    learn, held = (record((EffectSettings("presliding", (0.3, 2e-5)),), seed, 12.0) for seed in (1, 2))
    others = frozenset(name for name in names() if name != "actuator_gain") | frozenset(CHANGE_HYPOTHESES)
    found = diagnose([learn], [held], AXIS, Options(workers=1, excluded=others))
    sizes = [one for item in found.rounds for one in item.tests if one.name.startswith("size beyond")]
    assert len(sizes) > 1 and not any(one.passed for one in sizes) and not found.accepted


def test_the_strength_of_a_gain_is_how_far_it_is_from_one() -> None:
    assert strength_over_error(EffectSettings("actuator_gain", (0.994,)), {0: 0.015}, (1.0,)) == pytest.approx(0.4)
    assert strength_over_error(OFFSET, {0: 0.1}, (0.0,)) == pytest.approx(6.0)
    assert strength_over_error(OFFSET, {0: 0.1}, (0.5,)) == pytest.approx(1.0)  # the file has 0.5 N


def test_the_strength_of_a_lag_is_how_far_its_time_is_from_zero() -> None:
    """A rate of 200 +- 600 N/s lies 1600 standard errors below the default, and says nothing of the lag."""
    lag, without = EffectSettings("frictional_lag", (200.0, 1e-5)), effect("frictional_lag").defaults
    assert strength_over_error(lag, {0: 600.0}, without) == pytest.approx(0.33, abs=0.01)
    assert strength_over_error(lag, {0: 20.0}, without) == pytest.approx(10.0, abs=0.01)
    found = estimates((200.0, 20.0), (250.0, 25.0))
    times = found.linear([lag])
    assert times.values[:, 0] == pytest.approx([5e-3, 4e-3])
    assert times.errors[:, 0] == pytest.approx([5e-4, 5e-4]), "of the same logarithm, at the value of the fit"
    offset = estimates((0.6, 0.1))
    assert offset.linear([OFFSET]).values == offset.values


def test_errors_grow_with_what_comes_back_in_every_block_and_hold_for_plain_noise() -> None:
    sizes = []
    for effort in (0.0, 0.25):
        source = record((OFFSET,))
        t = np.arange(len(source.position)) * PERIOD
        wave = effort * np.sin(2.0 * np.pi * 0.31 * t)  # slow, and no shape of the model
        motion = motion_of(replace(source, effort=source.effort + wave))
        data = data_with_own_noise((motion,), MODEL.with_effects([OFFSET]))
        found = refit(data, MODEL, 0.05, (OFFSET,))
        columns = np.column_stack([found.jacobian[: len(found.residual)], found.residual])
        whole = sum(np.sum(part**2, axis=0) for part in as_time_series(columns, data))
        assert whole == pytest.approx(np.sum(columns**2, axis=0), rel=1e-9)
        sizes.append(float(Accuracy.of(found, data, is_nominal_held=False).errors[0] / found.standard_errors()[0, 0]))
    assert 1.0 <= sizes[0] < 2.0
    assert sizes[1] > 2.0 * sizes[0]


def test_what_the_residual_does_not_depend_on_has_no_standard_error() -> None:
    """The inverse of the normal matrix would take no information for no error."""
    data = data_with_own_noise((motion_of(record(duration=8.0)),), MODEL)
    found = refit(data, MODEL, 0.05, (EffectSettings("position_dependent_friction", (0.2, 0.0, 0.003)),), evaluations=1)
    strength, place, width = Accuracy.of(found, data, is_nominal_held=False).errors
    assert min(strength, place, width) > 0.0
    jacobian = found.jacobian.copy()
    jacobian[:, -1] *= 1.0e-9
    blind = Accuracy.of(replace(found, jacobian=jacobian), data, is_nominal_held=False).errors
    assert blind[:2] == pytest.approx((strength, place), rel=0.5) and blind[2] == 0.0


def test_what_recordings_differ_by_belongs_to_the_error() -> None:
    def between(*pairs: tuple[float, float], from_file: float = 0.0) -> float:
        found = estimates(*pairs, from_file=from_file)
        return Scatter.of(found.values[:, 0], found.covariances[0]).variance

    assert between((1.0, 0.1), (1.05, 0.1), (0.97, 0.1)) == 0.0
    assert 0.3 < np.sqrt(between((1.0, 0.1), (2.0, 0.1), (1.5, 0.1))) < 0.6
    assert between((1.0, 1.0e-12), (2.0, 0.5)) == 0.0, "one holds all the weight"
    assert 0.3 < np.sqrt(between((1.0, 1.0e-5), (2.0, 0.1), (1.5, 0.1))) < 1.0, "an accurate one counts"
    assert between((1.0, 0.1), (9.0, 0.0), (1.02, 0.1)) == 0.0, "one that never reaches the limit says nothing about it"
    assert between((1.0, 0.1), (1.1, 0.1)) == 0.0
    from_noise = between((1.0, 0.1), (1.1, 0.1), from_file=0.0999)
    assert np.sqrt(2.0 * from_noise) == pytest.approx(0.1, rel=0.01), (
        "what both have of the file does not tell them apart"
    )


def test_leaving_out_a_part_moves_the_solution_as_solving_without_it_does() -> None:
    rng = np.random.default_rng(5)
    columns, target = rng.normal(size=(40, 3)), rng.normal(size=40)
    solution = np.linalg.lstsq(columns, target)[0]
    parts = np.array_split(np.column_stack([columns, columns @ solution - target]), 8)
    for place, moved in enumerate(leave_one_out_shifts(parts, columns.T @ columns)):
        kept = np.arange(40) // 5 != place
        assert solution + moved == pytest.approx(np.linalg.lstsq(columns[kept], target[kept])[0], rel=1e-9)


def test_an_interval_from_three_recordings_that_differ_holds_the_truth() -> None:
    rng = np.random.default_rng(11)
    error, spread, draws = 0.05, 0.3, 2000
    covariance, held, held_without = error**2 * np.eye(3), 0, 0
    for _ in range(draws):
        values = 10.0 + spread * rng.normal(size=3) + error * rng.normal(size=3)
        off = abs(values[0] - 10.0) / NINETY_PERCENT
        held += off < np.hypot(error, Scatter.of(values, covariance).deviation)
        held_without += off < np.hypot(error, np.sqrt(Scatter.of(values, covariance).variance))
    assert held_without < 0.85 * draws < held < 0.95 * draws


def test_what_an_effect_improves_is_the_square_of_its_strength_over_its_error() -> None:
    motion = motion_of(record((OFFSET,), duration=8.0))
    data = data_with_own_noise((motion,), MODEL.with_effects([OFFSET]))
    found = refit(data, MODEL, 0.05, (OFFSET,))
    without = refit(data, MODEL, 0.05, ())
    power = (found.effects[0].values[0] / found.standard_errors()[0, 0]) ** 2
    assert power == pytest.approx(2.0 * (without.cost - found.cost), rel=0.2)
