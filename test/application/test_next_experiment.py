"""The step of a commissioning that separates what is ambiguous, with a stand-in for the diagnosis and the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from start_file import start_file

from sgms_observer.application.commission import next_experiment as step
from sgms_observer.application.commission.ledger import DONE, EXPERIMENTS, FAILED, LEARN_BAG, OWN_MOTION, Ledger
from sgms_observer.application.commission.motion import Motion, representative_motion
from sgms_observer.application.commission.run import STEPS, commission
from sgms_observer.application.commission.session import OutOfTime, Plan, Request, Session
from sgms_observer.errors import DataError
from sgms_observer.settings.axis import AxisSettings

START = start_file("effects: {names: [asymmetric_coulomb], asymmetric_coulomb: {share: 0.05}}")
AXIS = AxisSettings(name="x", mass=3.0)

Effects = list[dict[str, Any]]


def found(name: str, *others: str) -> dict[str, Any]:
    return {"name": name, "alternatives": list(others)}


AMBIGUOUS = [found("asymmetric_coulomb", "offset")]


class Bench:
    """A session behind a first diagnosis, whose table and diagnosis are stand-ins.

    Args:
        folder: of the commissioning.
        answers: effects that each further diagnosis names.
        monkeypatch: puts the stand-ins in.
    """

    def __init__(self, folder: Path, answers: Sequence[Effects], monkeypatch: pytest.MonkeyPatch) -> None:
        self.folder, self.answers = folder, list(answers)
        self.played: list[Motion] = []
        self.diagnosed: list[list[str]] = []
        self.said: list[str] = []
        self.gaps: list[float] = []
        self.on_motion: Callable[[], None] = lambda: None
        self.on_diagnosis: Callable[[], None] = lambda: None
        monkeypatch.setattr(step, "diagnose_bags_of", self._diagnose)
        monkeypatch.setattr(step, "with_noise_of", self._with_noise)
        (folder / "start.yaml").write_text(START)

    def session(self, effects: Effects | None = None, seconds: float = 1800.0) -> Session:
        """Return a session of a folder, as it was left or prepared with the effects of a first diagnosis."""
        out = self.folder / "out"
        request = Request(str(self.folder / "start.yaml"), out, seconds=seconds)
        plan = Plan.of(request)
        ledger = Ledger.open(out, request.as_json(), False) if out.exists() else Ledger(out, request.as_json())
        session = Session(plan, ledger, None, lambda _: True, self.said.append, lambda *_: None)  # type: ignore[arg-type]
        monkeypatched: Any = session
        monkeypatched.record = self._record
        if effects is not None:
            out.mkdir()
            representative_motion(plan.limits, plan.settings.sample_period).write(out / OWN_MOTION)
            ledger.facts = {"origin": 0.0}
            self.answers.insert(0, effects)
            self._diagnose(session, [LEARN_BAG], "diagnosis")
            self.diagnosed.clear()
            ledger.note("diagnose", DONE, 1.0, "prepared by the test", ["commission.json"])
        return session

    def _record(self, motion: Motion, bag: str) -> None:
        self.on_motion()
        self.played.append(motion)
        (self.folder / "out" / bag).mkdir(parents=True)

    def _with_noise(self, bag: str, axis: AxisSettings) -> AxisSettings:
        """Return the model with the noise of the file: nothing was recorded here."""
        assert bag == str(self.folder / "out" / LEARN_BAG)
        return axis

    def _diagnose(self, session: Session, bags: Sequence[str], out: str) -> tuple[str, list[str]]:
        self.on_diagnosis()
        self.diagnosed.append(list(bags))
        folder = session.path(out)
        folder.mkdir(exist_ok=True)
        (folder / "augmented.yaml").write_text(START)
        (folder / "result.json").write_text("{}")
        session.ledger.effects = self.answers.pop(0)
        gap = self.gaps.pop(0) if self.gaps else 3.0
        session.ledger.facts |= {"diagnosis": out, "diagnosis_seconds": 40.0, "gap": {
            "after": gap, "interval_after": [0.9 * gap, 1.1 * gap], "unweighted": {"after": gap}}}  # fmt: skip
        return f"named {session.ledger.effects[0]['name']}", []


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Bench]:
    return lambda *answers: Bench(tmp_path, answers, monkeypatch)


def test_an_ambiguous_pair_is_separated(bench: Callable[..., Bench]) -> None:
    """The designed motion is played and recorded, and the next diagnosis learns from it too."""
    table = bench([found("asymmetric_coulomb")])
    session = table.session(AMBIGUOUS)
    sentence, files = step.next_experiment(session)
    assert table.diagnosed == [[LEARN_BAG, "recordings/experiment_1"]]
    assert (
        session.ledger.effects == [found("asymmetric_coulomb")] and session.ledger.facts["diagnosis"] == "diagnosis_1"
    )
    assert "experiment 1 for asymmetric_coulomb, offset" in sentence and "nothing is ambiguous" in sentence
    assert all(session.path(name).exists() or name == "commission.json" for name in files)
    (motion,) = table.played
    limits = session.plan.limits
    assert motion.duration <= step.EXPERIMENT_SECONDS[0] and np.max(np.abs(motion.position)) <= 0.5 * limits.stroke
    assert motion.peak_speed <= limits.speed and motion.peak_acceleration <= 1.001 * limits.acceleration
    reversals = np.count_nonzero(np.diff(np.sign(motion.velocity[motion.velocity != 0.0])))
    assert reversals > 10  # at a constant sliding force, one that depends on the direction is an offset


def test_what_stays_ambiguous_ends_after_three_experiments(bench: Callable[..., Bench]) -> None:
    table = bench(AMBIGUOUS, AMBIGUOUS, AMBIGUOUS)
    sentence, _ = step.next_experiment(table.session(AMBIGUOUS))
    assert len(table.played) == step.MAX_EXPERIMENTS == len(table.diagnosed[-1]) - 1
    assert "asymmetric_coulomb, offset stay ambiguous after 3 experiments" in sentence


def test_a_diagnosis_that_predicts_worse_within_the_error_is_used(bench: Callable[..., Bench]) -> None:
    """3.35 lies outside the interval of 3.0, but both gaps have an error."""
    table = bench([found("asymmetric_coulomb")])
    table.gaps = [3.0, 3.35]
    session = table.session(AMBIGUOUS)
    sentence, _ = step.next_experiment(session)
    assert session.ledger.facts["diagnosis"] == "diagnosis_1" and "predicts your own motion better" not in sentence


def test_a_diagnosis_that_predicts_worse_is_not_used(bench: Callable[..., Bench]) -> None:
    """The one before is used again, and what another experiment may separate still has its turn."""
    both = [*AMBIGUOUS, found("spring", "cogging")]
    table = bench([found("spring")], AMBIGUOUS)
    table.gaps = [3.0, 3.5, 2.9]
    session = table.session(both)
    sentence, _ = step.next_experiment(session)
    assert len(table.played) == 2 and "the diagnosis before predicts your own motion better (gap 3 %)" in sentence
    assert table.diagnosed[-1] == [LEARN_BAG, "recordings/experiment_2"]
    assert session.ledger.effects == AMBIGUOUS and session.ledger.facts["diagnosis"] == "diagnosis_2"
    assert sentence.endswith("asymmetric_coulomb, offset stay ambiguous after 2 experiments")


def test_without_another_experiment_the_better_diagnosis_stays(bench: Callable[..., Bench]) -> None:
    table = bench([found("spring")])
    table.gaps = [3.0, 3.5]
    session = table.session(AMBIGUOUS)
    sentence, _ = step.next_experiment(session)
    assert len(table.played) == 1 and "stay ambiguous after one experiment" in sentence
    assert session.ledger.effects == AMBIGUOUS and session.ledger.facts["diagnosis"] == "diagnosis"
    assert session.ledger.facts["gap"]["after"] == 3.0


def test_what_was_not_tried_goes_first(bench: Callable[..., Bench]) -> None:
    both = [*AMBIGUOUS, found("spring", "cogging")]
    table = bench(both, AMBIGUOUS, [found("spring")])
    sentence, _ = step.next_experiment(table.session(both))
    places = [sentence.index(f"experiment {n} for {pair}") for n, pair in (
        (1, "asymmetric_coulomb, offset"), (2, "spring, cogging"), (3, "asymmetric_coulomb, offset"),
    )]  # fmt: skip
    assert places == sorted(places)


def test_a_rerun_goes_on_behind_what_is_recorded(bench: Callable[..., Bench]) -> None:
    """Ctrl-C in the second motion, then in its diagnosis: no motion that is recorded is played again."""
    table = bench(AMBIGUOUS, [found("asymmetric_coulomb")])

    def interrupt() -> None:
        raise KeyboardInterrupt

    table.on_diagnosis = lambda: setattr(table, "on_motion", interrupt)
    session = table.session(AMBIGUOUS)
    table.on_motion = lambda: None
    with pytest.raises(KeyboardInterrupt):
        step.next_experiment(session)
    session.ledger.note("next_experiment", FAILED, 1.0, "interrupted")
    assert len(table.played) == 1 and len(table.diagnosed) == 1

    table.on_motion, table.on_diagnosis = (lambda: None), interrupt
    session = table.session()
    with pytest.raises(KeyboardInterrupt):
        step.next_experiment(session)
    session.ledger.note("next_experiment", FAILED, 1.0, "interrupted")
    assert len(table.played) == 2 and len(table.diagnosed) == 1

    table.on_motion, table.on_diagnosis = interrupt, (lambda: None)
    sentence, _ = step.next_experiment(table.session())
    assert table.diagnosed[-1] == [LEARN_BAG, "recordings/experiment_1", "recordings/experiment_2"]
    assert "experiment 1 for" in sentence and "experiment 2 for" in sentence and "nothing is ambiguous" in sentence


def test_nothing_moves_where_motion_does_not_help(bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step, "separating", lambda *_: None)
    table = bench()
    sentence, _ = step.next_experiment(table.session(AMBIGUOUS))
    assert "no motion within these limits separates asymmetric_coulomb, offset" in sentence and not table.played


def test_nothing_moves_without_time_for_it(bench: Callable[..., Bench]) -> None:
    table = bench()
    sentence, _ = step.next_experiment(table.session(AMBIGUOUS, seconds=120.0))
    assert "no time was left to separate asymmetric_coulomb, offset" in sentence and not table.played


def test_a_diagnosis_without_time_for_it_leaves_the_one_before(bench: Callable[..., Bench]) -> None:
    """The compensation keeps its share of the time; a rerun diagnoses what is recorded."""
    table = bench([found("asymmetric_coulomb")])
    session = table.session(AMBIGUOUS)
    reserved: list[float] = []

    def gives_up() -> None:
        reserved.append(session.reserved)
        raise OutOfTime("stopped")

    table.on_motion = lambda: setattr(table, "on_diagnosis", gives_up)
    sentence, files = step.next_experiment(session)
    assert reserved[0] > 60.0 and session.reserved == 0.0
    assert "the diagnosis before goes on" in sentence and session.ledger.effects == AMBIGUOUS
    assert len(table.played) == 1 and not all(session.path(name).exists() for name in files)
    session.ledger.note("next_experiment", DONE, 1.0, sentence, files)

    table.on_motion = table.on_diagnosis = lambda: None
    again = table.session()
    assert not again.ledger.is_finished("next_experiment")
    sentence, files = step.next_experiment(again)
    assert len(table.played) == 1 and again.ledger.effects == [found("asymmetric_coulomb")]
    assert all(session.path(name).exists() or name == "commission.json" for name in files)


def test_a_stopped_experiment_fails_the_step_and_keeps_the_folder(
    bench: Callable[..., Bench], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The commissioning as a whole: a guard stops the experiment; the steps before it stay done."""
    table = bench()
    session = table.session(AMBIGUOUS)
    only = tuple(one for one in STEPS if one.name in ("diagnose", "next_experiment"))
    monkeypatch.setattr("sgms_observer.application.commission.run.STEPS", only)
    monkeypatch.setattr("sgms_observer.application.commission.check.connect", lambda _: "there")

    def stalls() -> None:
        raise DataError("axis x stalls")

    table.on_motion = stalls
    with pytest.raises(DataError, match="stalls"):
        commission(session, nullcontext())
    again = table.session().ledger
    assert again.is_finished("diagnose") and not again.is_finished("next_experiment")
    assert again.effects == AMBIGUOUS and not again.facts[EXPERIMENTS]


def test_only_what_motion_can_separate_is_tried() -> None:
    def sets(*effects: dict[str, Any]) -> list[tuple[str, ...]]:
        return step.ambiguous_sets(effects, AXIS)

    assert sets(found("cogging")) == []
    assert sets(found("cogging", "spring"), found("offset")) == [("cogging", "spring")]
    assert sets(found("actuator_gain", "mass_error")) == []
    assert sets(found("offset", "gravity")) == [("offset",)]  # gravity is the offset on a prismatic axis
    assert sets(found("cogging", "spring", "offset")) == [
        ("cogging", "spring", "offset"), ("cogging", "spring"), ("cogging", "offset"),
    ]  # fmt: skip
