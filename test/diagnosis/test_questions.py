"""Questions of a report: their answers follow the run, and each state comes up where it should."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sgms_observer.diagnosis.advice import Named, next_experiment
from sgms_observer.diagnosis.changed import Changed
from sgms_observer.diagnosis.compensation_check import CompensationCheck
from sgms_observer.diagnosis.criteria import at_least, at_most
from sgms_observer.diagnosis.diagnosis import Options
from sgms_observer.diagnosis.disturbance import SlidingResidual
from sgms_observer.diagnosis.final_model import UNEXPLAINED_WHILE_SLIDING
from sgms_observer.diagnosis.gap import Gap
from sgms_observer.diagnosis.locate import Located
from sgms_observer.diagnosis.model import Model
from sgms_observer.diagnosis.questions import at_limit, questions_of, with_unit
from sgms_observer.diagnosis.tracking import PredictedTracking, TrackingError
from sgms_observer.report.page import BAD, GOOD, UNSURE
from sgms_observer.settings.axis import AxisSettings, EffectSettings
from sgms_observer.settings.units import REVOLUTE, Units

MODEL = Model.of(AxisSettings())
TIME = 1e-3 * np.arange(4000)


def motion() -> Any:
    """Return a motion to and fro."""
    return SimpleNamespace(time=TIME, position=0.01 * np.sin(5.0 * TIME), velocity=0.05 * np.cos(5.0 * TIME))


def answer(**changes: Any) -> Any:
    """Return what the questions need of an answer in which all is well, but for the changes."""
    gap = Gap(6.0, 5.0, 2.0, 1.9, 1.8, 5.0, 2.0, (4.9, 5.1), (1.9, 2.1), "held-out", 100.0, 1.1)
    fit = SimpleNamespace(model=MODEL, logs=np.zeros(len(MODEL.parameter_names())), is_converged=True)
    state = SimpleNamespace(fit_motions=(motion(),), held_out_motions=(motion(),))
    score = at_least("cogging", "z-score, held-out recordings", 9.1, 3.0)
    accepted = SimpleNamespace(candidate=SimpleNamespace(name="cogging"), tests=(score,))
    written = SimpleNamespace(before=fit, after=fit)
    run = SimpleNamespace(
        final_state=state, written=written, is_poor=False, warnings=(), rounds=(SimpleNamespace(accepted=accepted),)
    )
    values = {
        "gap": gap,
        "effects": (
            Named(
                EffectSettings("cogging", (1.4, 0.012, 0.3, 0.0, 0.0)), (0.1, 1e-5, 0.1, 0.1, 0.1), 0.98, (), 5.0, 2.0
            ),
        ),
        "changed": (),
        "learnt": (),
        "disturbance": None,
        "diagnosis": run,
        "tests": (
            at_most("model", "share of the effort that is unexplained", 0.02, 1.0 / 3.0),
            at_most("model", "surely predictable share of the residual", 0.01, 0.1),
            at_most("model", "gap over noise, where nothing predicts it", 1.1, 10.0),
            at_most("model", "friction not cancelled by the feedforward: z-score of its growth", -5.0, 3.0),
        ),
    }
    for key, value in changes.items():
        if key in values:
            values[key] = value
        else:
            setattr(written if key in ("before", "after") else run, key, value)
    return SimpleNamespace(**values)


OUTSIDE = SlidingResidual(0.5, 3.0, False, ())
BETTER = PredictedTracking(
    TrackingError(2e-6, 9e-6), TrackingError(1e-6, 5e-6), TrackingError(4e-7, 2e-6), TrackingError(2.1e-6, 9e-6), 4.0
)


def states(of: Any, tracking: PredictedTracking | None = BETTER) -> dict[str, tuple[str, str]]:
    """Return state and answer of each question."""
    lights = questions_of(of, (CompensationCheck(1.0, 2.0), CompensationCheck(0.5, 1.0)), tracking, Options(), Units())
    return {light.question: (light.state, light.answer) for light in lights}


def with_test(name: str, value: float) -> tuple[Any, ...]:
    """Return the tests of an answer, one of them with another value."""
    return tuple(
        replace(test, value=value, passed=value <= test.threshold) if test.name.startswith(name) else test
        for test in answer().tests
    )


def test_all_is_well() -> None:
    found = states(answer())
    assert {state for state, _ in found.values()} == {GOOD}
    lights = questions_of(
        answer(), (CompensationCheck(1.0, 2.0), CompensationCheck(0.5, 1.0)), BETTER, Options(), Units()
    )
    assert {light.topic for light in lights} == {"Data", "Convergence", "Believability"}
    pitch = found["Is there a 12.0 mm pitch?"][1]
    assert "by 9.1 standard errors, 3 are needed" in pitch and "from 5 to 2 %" in pitch and "0.98" in pitch
    travel = found["Do the recordings show the friction?"][1]
    assert "4 s with" in travel and "6 reversals" in travel


@pytest.mark.parametrize(
    ("changes", "question", "state", "says"),
    [
        ({"is_poor": True, "warnings": ("the axis hardly slides: move",)}, "Do the recordings show the friction?", BAD,
         "The axis hardly slides: move."),
        ({"final_state": SimpleNamespace(fit_motions=(motion(),), held_out_motions=())},
         "Was the model judged on recordings that it was not fitted to?", UNSURE, "--holdout"),
        ({"after": SimpleNamespace(model=MODEL, logs=np.zeros(1), is_converged=False)}, "Did the fits converge?",
         UNSURE, "squared residual of the augmented model"),
        ({"tests": with_test("share of the effort", 0.4)}, "Does the model explain the effort?", BAD, "33.3 %."),
        ({"tests": (*with_test("share of the effort", 0.4), at_most("cogging", UNEXPLAINED_WHILE_SLIDING, 0.054, 0.3))},
         "Does the model explain the effort?", BAD, "which hardly count a resting stage, 5.4 %."),
        ({"tests": with_test("surely predictable", 0.5)}, "Is the rest unpredictable?", BAD,
         "no name in the catalogue"),
        ({"tests": with_test("surely predictable", 0.5), "learnt": (SimpleNamespace(),)}, "Is the rest unpredictable?",
         UNSURE, "A learnt map"),
        ({"tests": with_test("surely predictable", 0.0)}, "Is the rest unpredictable?", GOOD,
         "No tried regression predicts a significant part of the squared residual (0 %, limit 10 %). The rms of the"),
        ({"tests": with_test("surely predictable", 0.02)}, "Is the rest unpredictable?", GOOD,
         "The best of the tried regressions predicts 2 % of the squared residual (limit 10 %)."),
        ({"disturbance": OUTSIDE}, "Is the rest unpredictable?", BAD, "a force of 0.5 N rms (3 times the noise) acts"),
        ({"tests": with_test("gap over noise", 20.0)}, "Is the rest unpredictable?", UNSURE, "20 times the noise"),
        ({"tests": with_test("friction not", 5.0)}, "Does the feedforward leave less friction with the new model?",
         BAD, "not added"),
        ({"tests": with_test("friction not", -2.3)}, "Does the feedforward leave less friction with the new model?",
         UNSURE, "The decrease may be chance: it is 2.3 standard errors, and 3 are needed."),
        ({"changed": (Changed("friction.coulomb_force", 6.0, 4.6, 0.1, 0.7),)}, "Did values of the file change?", GOOD,
         "from 6 to 4.6 N (90 %: +- 0.16)"),
        ({"changed": (Changed("friction.element_stiffness (sum)", 2.0, 3.0, 0.0, 0.7),)},
         "Did values of the file change?", GOOD, "element_stiffness (sum) from 2 to 3 N/m."),
        ({"changed": (Changed("effects.stribeck.share", 0.0, 0.2, 0.01, 0.7),)}, "Did values of the file change?", GOOD,
         "effects.stribeck.share from 0 to 0.2 (90 %: +- 0.016)"),
        ({"changed": (Changed("friction.model", "sgms", "gms", 0.0, 0.7),)}, "Did values of the file change?", GOOD,
         "from sgms to gms"),
    ],
)  # fmt: skip
def test_what_is_not_well_is_said(changes: dict[str, Any], question: str, state: str, says: str) -> None:
    found = states(answer(**changes))[question]
    assert found[0] == state and says in found[1]


def test_a_feedforward_that_leaves_more_is_not_said_to_leave_less() -> None:
    """The test counts the motion along which it leaves least; the figures are those along the reference."""
    checks = CompensationCheck(1.0, 0.289), CompensationCheck(0.5, 0.293)
    lights = questions_of(answer(), checks, BETTER, Options(), Units())
    light = next(one for one in lights if one.question.startswith("Does the feedforward"))
    assert light.state == UNSURE and "0.289 before, 0.293 N rms after" in light.answer
    assert light.answer.endswith("That it leaves more may be chance.")


@pytest.mark.parametrize(
    ("tracking", "state", "says"),
    [
        (BETTER, GOOD, "Better: 1 um rms and 5 um peak with the file as given, 400 nm rms and 2 um peak with"
         " augmented.yaml (2 um rms and 9 um peak without compensation)."),
        (replace(BETTER, augmented=TrackingError(9e-7, 1.1e-5)), UNSURE, "The peak is larger than without"),
        (replace(BETTER, augmented=TrackingError(9.9e-7, 5e-6)), UNSURE, "No change: 1 um rms and 5 um peak with the"
         " file as given, 990 nm rms"),
        (replace(BETTER, augmented=TrackingError(1.2e-6, 5e-6)), BAD, "Worse: 1 um rms"),
        (replace(BETTER, augmented=TrackingError(3e-6, 5e-6)), BAD, "Worse than without compensation: 1 um rms"),
        (replace(BETTER, recorded=TrackingError(2e-5, 9e-5)), UNSURE, "stage.controller may be another one"),
        (None, UNSURE, "does not stay finite"),
    ],
)  # fmt: skip
def test_better_tracking_is_promised_only_where_rms_and_peak_shrink(
    tracking: PredictedTracking | None, state: str, says: str
) -> None:
    found = states(answer(), tracking)["Will compensation with the new model improve tracking?"]
    assert found[0] == state and says in found[1]


def test_an_effect_that_is_not_told_from_another_is_not_sure() -> None:
    item = replace(answer().effects[0], alternatives=("position_periodic_friction",))
    state, says = states(answer(effects=(item,)))["Is there a 12.0 mm pitch?"]
    assert state == UNSURE and says.startswith("It could also be position periodic friction.")


def test_values_that_the_refit_stopped_at_their_tolerance_are_named() -> None:
    names = MODEL.parameter_names()
    logs = np.zeros(len(names))
    logs[names.index("mass")] = np.log1p(0.05)
    logs[names.index("coulomb_force")] = 0.9 * np.log1p(0.05)
    fit = SimpleNamespace(model=MODEL, logs=logs, is_converged=True)
    assert at_limit(fit, 0.05) == ["mass"]
    state, says = states(answer(before=fit))["Are the values of the file right within their tolerance?"]
    assert state == UNSURE and says == "mass reached the limit of its 5 % tolerance before any effect was added."


@pytest.mark.parametrize(
    ("value", "unit", "units", "text"),
    [
        (0.012, "m", Units(), "12.0 mm"), (1.0e-4, "s", Units(), "100 us"), (250.0, "Hz", Units(), "250 Hz"),
        (0.012, "m", Units(REVOLUTE), "12.0 mrad"), (1.25, "-", Units(), "1.25"), (5.0e6, "N/m", Units(), "5e+06 N/m"),
        (0.0, "N", Units(), "0 N"), (0.5, "kg", Units(), "0.500 kg"), (2.0e-4, "kg", Units(), "0.0002 kg"),
        (0.5, "kg", Units(REVOLUTE), "0.500 kg m^2"),
    ],
)  # fmt: skip
def test_a_value_has_its_unit_and_three_digits(value: float, unit: str, units: Units, text: str) -> None:
    assert with_unit(value, unit, units) == text


def test_a_value_that_the_recordings_do_not_determine_is_not_asked_about() -> None:
    """A backlash of 1 mm with a standard error of 94 mm had the question: is there backlash of 1.00 mm?"""
    item = Named(EffectSettings("backlash", (1e-3, 5.0)), (94e-3, 0.1), 0.98, (), 5.0, 2.0)
    assert item.undetermined == ("gap",)
    state, says = states(answer(effects=(item,)))["Is there backlash?"]
    assert state == GOOD and "do not determine its gap" in says


@pytest.mark.parametrize(
    ("settings", "errors", "expected"),
    [
        (EffectSettings("frictional_lag", (200.0, 1.0)), (50.0, 94.0), ("distance",)),
        (EffectSettings("frictional_lag", (200.0, 1e-4)), (50.0, 0.9e-4), ()),
        (EffectSettings("offset", (0.0,)), (0.1,), ()),
        (EffectSettings("cogging", (1.4, 0.012, 0.0, 0.0, 0.0)), (0.1, 1e-5, 0.2, 0.1, 0.1), ()),
        (EffectSettings("cogging", (1.4, 0.012, 0.3, 0.0, 0.0)), (0.1, 1e-5, 40.0, 0.1, 0.1), ("phase",)),
    ],
)
def test_a_value_is_undetermined_where_its_error_says_nothing(
    settings: EffectSettings, errors: tuple[float, ...], expected: tuple[str, ...]
) -> None:
    """A value near zero is determined where its interval is narrower than its range: an offset, a phase."""
    assert Named(settings, errors, 0.98, (), 5.0, 2.0).undetermined == expected


NOWHERE = np.zeros(2)


@pytest.mark.parametrize(
    ("located", "says"),
    [
        ([Located("position", "m", NOWHERE, NOWHERE, NOWHERE, 0.5, 0.01, 0.0, 0.1, 0.1)],
         "The residual changes with position over its whole range: record the same motion again"),
        ([Located("position", "m", NOWHERE, NOWHERE, NOWHERE, 0.5, 0.01, 0.0, 0.1, 0.1),
          Located("velocity", "m/s", NOWHERE, NOWHERE, NOWHERE, 0.4, 0.01, 0.2, 0.3, 2.0)],
         "stays at velocity 0.2 to 0.3 m/s,"),
        ([Located("time", "s", NOWHERE, NOWHERE, NOWHERE, 0.5, 0.01, 1.0, 2.0, 60.0)], "residual changes with time"),
    ],
)  # fmt: skip
def test_the_next_experiment_names_a_range_only_where_it_narrows_something(located: list[Located], says: str) -> None:
    found: Any = SimpleNamespace(rounds=())
    text = next_experiment("unknown_effect", [], located, found, Units(), True, has_disturbance=False)
    assert text is not None and says in text


@pytest.mark.parametrize(
    ("coordinate", "unit", "said"), [("position", "m", "1 to 2 rad,"), ("effort", "N", "1 to 2 N m,")]
)
def test_the_next_experiment_speaks_in_the_units_of_the_joint(coordinate: str, unit: str, said: str) -> None:
    none = np.zeros(2)
    told = Located(coordinate, unit, none, none, none, 0.5, 0.01, 1.0, 2.0)
    found: Any = SimpleNamespace(rounds=())
    text = next_experiment("unknown_effect", [], [told], found, Units(REVOLUTE), True, has_disturbance=False)
    assert text is not None and said in text
