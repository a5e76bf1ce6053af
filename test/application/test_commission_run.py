"""A whole commissioning on a simulated axis without a graph: every way to stop it, its time, its folder, its question.

What is learnt from the recordings is a stand-in: motions, guard, ledger, page and the steps of the observer are not.
"""

from __future__ import annotations

import io
import json
import math
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from start_file import start_file

from sgms_observer.application.commission import compensate, run
from sgms_observer.application.commission.compensate import Consistency, consistency_of
from sgms_observer.application.commission.ledger import (
    DONE,
    FAILED,
    IDENTIFIED,
    REPORT,
    SKIPPED,
    WRITTEN,
    Ledger,
)
from sgms_observer.application.commission.motion import Motion, approach
from sgms_observer.application.commission.run import STEPS, StepWork, commission
from sgms_observer.application.commission.session import OutOfTime, Plan, Request, Session
from sgms_observer.application.commission.table import Heard, HeldUp, Topics, Watch
from sgms_observer.bags.reader import read_joint_states
from sgms_observer.bags.writer import BagWriter
from sgms_observer.cli import main as command_line
from sgms_observer.errors import ConfigurationError, DataError, RecordingError
from sgms_observer.observer.samples import Samples
from sgms_observer.settings.load import load_settings

START = start_file("compensation: {limit: 9.0}")
NAMES = [step.name for step in STEPS]
PERIOD = 1.0e-3
BLOCK = 50
TRACKING_ERROR = 4.0e-6

Fault = Callable[["Axis", np.ndarray, np.ndarray], None]
"""Changes position and effort of a block of samples in place, or raises what the link would raise."""


class Axis:
    """An axis without a graph: it follows with an error that friction makes and compensation removes.

    Args:
        limits: what it may do.
    """

    lead = 0.2

    def __init__(self, limits: Any) -> None:
        self._limits = limits
        self.gain, self.set_point = 0.0, 0.0
        self.has_observer = False
        self.played = 0
        self.fault: Fault | None = None
        self.stands_at, self.stood_at = 0.0, math.nan

    def __enter__(self) -> Axis:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop_observer()

    def listen(self, seconds: float) -> Topics:
        count = round(seconds / PERIOD)
        stamps = np.arange(count, dtype=np.int64) * 1_000_000
        nothing = np.full(count, np.nan)
        samples = Samples(stamps, np.full(count, self.stands_at), np.zeros(count), nothing, nothing)
        return Topics({"position": ("x",), "control_effort": ("x",)}, samples, count, seconds, 1, 0, 0)

    def play(self, motion: Motion, origin: float, watch: Watch, bag: Path | None = None) -> None:
        self.played += 1
        way = approach(self.set_point - origin, motion.position[0], self._limits, PERIOD)
        whole = motion.after(way)
        point, velocity = origin + whole.position, whole.velocity
        stamps = np.arange(len(point), dtype=np.int64) * 1_000_000
        seconds = stamps * 1e-9 - way.duration
        place = point + TRACKING_ERROR * (1.0 - self.gain) * np.sign(velocity)
        effort = 5.0 * np.sign(velocity)
        for first in range(0, len(point), BLOCK):
            rows = slice(first, first + BLOCK)
            try:
                if self.fault is not None and seconds[first] > 0.5:
                    self.stood_at = place[first] if math.isnan(self.stood_at) else self.stood_at
                    self.fault(self, place[rows], effort[rows])
                watch(
                    Heard(Samples(stamps[rows], place[rows], effort[rows], point[rows], velocity[rows]), seconds[rows])
                )
            except BaseException:
                self.release()
                self.set_point = float(point[first])
                raise
        self.set_point = float(point[-1])
        if bag is not None:
            shutil.rmtree(bag, ignore_errors=True)
            with BagWriter(bag) as written:
                written.write_joint_states("position", stamps, ["x"], position=place)
                written.write_joint_states("reference", stamps, ["x"], position=point, velocity=velocity)

    def start_observer(self, config: Path) -> None:
        assert not load_settings(config).axes[0].compensation.enabled
        self.has_observer = True

    def stop_observer(self) -> None:
        self.has_observer, self.gain = False, 0.0

    def compensate(self, gain: float) -> None:
        assert self.has_observer
        self.gain = gain

    def release(self) -> None:
        self.gain = 0.0

    def delays(self) -> tuple[float, float]:
        return 1e-3, 2e-3


def identified(session: Session) -> tuple[str, list[str]]:
    path = session.path(IDENTIFIED)
    path.parent.mkdir(exist_ok=True)
    path.write_text(START)
    return "identified", [IDENTIFIED]


def diagnosed(session: Session) -> tuple[str, list[str]]:
    (session.ledger.folder / "diagnosis").mkdir(exist_ok=True)
    session.path("diagnosis/augmented.yaml").write_text(START)
    session.ledger.facts |= {"diagnosis": "diagnosis", "gap": {"before": 9.0, "after": 2.0, "floor": 1.0}}
    session.ledger.effects = [{"name": "offset", "parameters": {"force": 0.4}, "std_error": {"force": 0.1},
                               "confidence": 0.99, "alternatives": [], "gap_after": 2.0}]  # fmt: skip
    return "effect_found", ["diagnosis/augmented.yaml"]


class Run:
    """The command in a folder, again and again.

    Args:
        folder: where it runs.
    """

    def __init__(self, folder: Path) -> None:
        self.out = folder / "out"
        self.config = folder / "start.yaml"
        self.config.write_text(START)
        self.said: list[str] = []

    def session(
        self, fault: Fault | None = None, in_step: str = "", seconds: float = 1800.0, motion: str | Path = ""
    ) -> Session:
        """Return a session as the command makes it; the fault acts in the motions of one step."""
        request = Request(str(self.config), self.out, motion=str(motion), seconds=seconds)
        plan = Plan.of(request)
        ledger = Ledger.open(self.out, request.as_json(), False)
        self.said = []
        self.axis: Any = Axis(plan.limits)

        def confirm(_: str) -> bool:
            self.axis.fault = fault if in_step not in ledger.steps and self._at(ledger) == in_step else None
            return True

        return Session(plan, ledger, self.axis, confirm, self.said.append, lambda *_: None)

    @staticmethod
    def _at(ledger: Ledger) -> str:
        return next((name for name in NAMES if not ledger.is_finished(name)), "")

    def whole(self, **changes: Any) -> dict[str, Any]:
        """Run it and return commission.json."""
        commission(self.session(**changes), nullcontext())
        return self.result()

    def result(self) -> dict[str, Any]:
        return json.loads((self.out / "commission.json").read_text())

    def states(self) -> dict[str, str]:
        return {step["name"]: step["state"] for step in self.result()["steps"]}


@pytest.fixture
def way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Run:
    stand_ins = {
        "identify": identified, "diagnose": diagnosed,
        "next_experiment": lambda _: ("nothing is ambiguous", ["commission.json"]),
    }  # fmt: skip
    steps = tuple(StepWork(one.name, stand_ins.get(one.name, one.work), one.moves) for one in STEPS)
    monkeypatch.setattr(run, "STEPS", steps)
    monkeypatch.setattr(compensate, "consistency_of", lambda *_: Consistency(1.0, 0.1))
    return Run(tmp_path)


def stalls(axis: Axis, place: np.ndarray, effort: np.ndarray) -> None:
    place[:] = axis.stood_at


def has_a_wrong_sign(axis: Axis, place: np.ndarray, effort: np.ndarray) -> None:
    effort *= -1.0


def leaves_its_stroke(axis: Axis, place: np.ndarray, effort: np.ndarray) -> None:
    place += 0.02


def is_lost(axis: Axis, place: np.ndarray, effort: np.ndarray) -> None:
    raise DataError("position of axis x stopped arriving for 0.5 s during the motion")


def is_interrupted(axis: Axis, place: np.ndarray, effort: np.ndarray) -> None:
    raise KeyboardInterrupt


ABORTS: list[tuple[Fault, str, tuple[str, ...]]] = [
    (leaves_its_stroke, "outside the", ("record", "compensate", "before_and_after")),
    (is_lost, "stopped arriving", ("check", "observe", "compensate")),
    (is_interrupted, "interrupted by the user", ("record", "compensate", "before_and_after")),
    (stalls, "stalls|away from its reference", ("check", "compensate")),
    (has_a_wrong_sign, "sign is wrong", ("check",)),
]


@pytest.mark.parametrize(
    ("step", "fault", "words"), [(step, fault, words) for fault, words, steps in ABORTS for step in steps]
)
def test_an_abort_leaves_no_force_a_page_and_a_folder_to_go_on_with(
    way: Run, step: str, fault: Fault, words: str
) -> None:
    with pytest.raises((DataError, KeyboardInterrupt)):
        way.whole(fault=fault, in_step=step)
    assert way.axis.gain == 0.0
    result, states = way.result(), way.states()
    at = NAMES.index(step)
    assert [states[name] for name in NAMES] == [*[DONE] * at, FAILED, *[SKIPPED] * (len(NAMES) - at - 2), DONE]
    sentence = result["steps"][at]["sentence"]
    assert any(word in sentence for word in words.split("|")), sentence
    assert result["usable"] is False and result["tracking"] == {}
    assert result["reason"] == f"step {step} failed: {sentence}"
    page = (way.out / REPORT).read_text()
    assert sentence.split(";")[0] in page
    assert (f"because step {step} failed" in page) == (step != "before_and_after")
    assert ("not diagnosed yet" in page) == (at < NAMES.index("diagnose"))

    again = way.whole()
    assert list(way.states().values()) == [*[SKIPPED] * at, *[DONE] * (len(NAMES) - at)]
    assert again["usable"] is True and again["reason"] is None and again["yaml"] == "commissioned.yaml"
    assert way.axis.gain == 0.0
    assert "times smaller" in again["steps"][-2]["sentence"] and "must not" not in (way.out / REPORT).read_text()


def test_after_a_stop_between_two_steps_the_page_is_written_again(way: Run) -> None:
    """Ctrl-C at the end of the diagnosis. It is noted at the next step, where the rerun begins."""
    session = way.session()

    def stop(sentence: str) -> None:
        if sentence.startswith("diagnose: "):
            raise KeyboardInterrupt

    session.say = stop
    with pytest.raises(KeyboardInterrupt):
        commission(session, nullcontext())
    first = (way.out / REPORT).read_text()
    assert [name for name, state in way.states().items() if state == FAILED] == ["next_experiment"]
    assert way.states()["report"] == DONE and "step next_experiment failed: interrupted by the user" in first
    way.whole()
    assert list(way.states()) == NAMES and way.states()["report"] == DONE
    assert (way.out / REPORT).read_text() != first


def test_a_rerun_that_is_stopped_before_it_did_anything_changes_nothing(way: Run) -> None:
    """A file of a step was taken away. Ctrl-C comes before that step begins again."""
    result = way.whole()
    (way.out / "commissioned.yaml").unlink()
    session, stops = way.session(), [KeyboardInterrupt()]

    def stop(_: str) -> None:
        if stops:
            raise stops.pop()

    session.say = stop
    with pytest.raises(KeyboardInterrupt):
        commission(session, nullcontext())
    after = way.result()
    assert [step["sentence"] for step in after.pop("steps")] == [step["sentence"] for step in result.pop("steps")]
    assert after == result and after["usable"] is True


def test_after_a_graph_that_was_not_joined_the_page_is_written_again(way: Run) -> None:
    @contextmanager
    def no_graph() -> Iterator[object]:
        raise RecordingError("no graph")
        yield

    with pytest.raises(RecordingError, match="no graph"):
        commission(way.session(), no_graph())
    first = (way.out / REPORT).read_text()
    way.whole()
    assert list(way.states()) == NAMES and (way.out / REPORT).read_text() != first


@pytest.mark.parametrize("step", ["check", "compensate", "before_and_after"])
def test_a_motion_that_a_busy_computer_stopped_is_played_again_as_it_was(way: Run, step: str) -> None:
    """With a guard that knows nothing of the attempt before, and with the gain that it is about."""
    stopped_at: list[float] = []

    def is_held_up(axis: Axis, *_: Any) -> None:
        if len(stopped_at) < 2:
            stopped_at.append(axis.gain)
            raise HeldUp("this machine was busy")

    result = way.whole(fault=is_held_up, in_step=step)
    assert result["usable"] is True and len(stopped_at) == 2 and stopped_at[0] == stopped_at[1]
    warnings = result["steps"][NAMES.index(step)]["warnings"]
    assert [one for one in warnings if "played again" in one] == [
        "Warning: this machine was busy. The motion is played again."
    ] * 2
    told = result["steps"][NAMES.index("compensate")]["sentence"]
    assert "0.3: 2.29" in told and "0.6: 1.31" in told and "gain 0.9 is kept" in told


def to_and_fro(amplitude: float, period: float) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and positions [m] of two periods of a cosine [m, s], which starts and ends at rest."""
    time = PERIOD * np.arange(round(2.0 * period / PERIOD) + 1)
    return time, amplitude * np.cos(2.0 * np.pi * time / period)


def rows(time: np.ndarray, position: np.ndarray) -> str:
    """Return a CSV without a velocity: it needs none."""
    return "time,position\n" + "".join(f"{at:.9g},{place:.12g}\n" for at, place in zip(time, position, strict=True))


@pytest.mark.parametrize("is_bag", [False, True])
def test_before_and_after_play_the_motion_of_the_user(way: Run, tmp_path: Path, is_bag: bool) -> None:
    """The positions of the file are those of the axis, which begins at 100 mm here."""
    time, position = to_and_fro(3.0e-3, 2.0)
    position += 0.1
    own = tmp_path / ("bag" if is_bag else "own.csv")
    if is_bag:
        with BagWriter(own) as bag:
            stamps = np.rint(1e9 * (time + 50.0)).astype(np.int64)
            bag.write_joint_states("reference", stamps, ["w", "x"], position=np.column_stack([9.0 * time, position]))
    else:
        own.write_text(rows(time, position))
    session = way.session(motion=own)
    way.axis.stands_at = way.axis.set_point = 0.1
    commission(session, nullcontext())
    result = way.result()
    assert result["usable"] is True
    assert f"; {own}: 4.6 s over 6 mm, at up to 9.42 mm/s" in result["steps"][NAMES.index("excite")]["sentence"]
    for name in ("own", "before", "after"):
        played = read_joint_states(way.out / "recordings" / name, "reference").position[:, 0]
        np.testing.assert_allclose(played[-300 - len(position) : -300], position, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(played[-300:], position[-1], rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "has 0 lines of time and position, and a reference needs at least two"),
        ("time,position\n0,0.001\n", "has 1 lines of time and position"),
        ("position\n0.001\n0.002\n", "line 2: the position is missing; write time [s] and position with a comma"),
        ("time,position\n0,far\n1,0.002\n", "line 2: 'far' is not a number"),
        ("time,position\n0,0.001\n1,nan\n", "line 3: '1,nan' is not finite"),
        ("0;0,001\n1;0,002\n", "line 1: '0;0,001' has semicolons and commas; write numbers with a decimal point"),
        ("time,position\n0,0.0\n2,1e-3\n1,0.0\n", "line 4: time 1.0 s does not come after 2.0 s; sort the lines"),
        (rows(*to_and_fro(15.0e-3, 3.0)), "goes as far as 15 mm, more than the 10 mm that are allowed around 0"),
        (rows(*to_and_fro(9.0e-3, 0.7)), "moves at up to 80.8 mm/s, more than the 50 mm/s that are allowed"),
        (rows(*to_and_fro(1.0e-3, 0.14)), "accelerates by up to 2.01 m/s^2, more than the 1 m/s^2 that are allowed"),
    ],
)  # fmt: skip
def test_an_unusable_motion_of_the_user_is_one_sentence_and_nothing_is_recorded(
    way: Run, tmp_path: Path, text: str, sentence: str
) -> None:
    own = tmp_path / "own.csv"
    own.write_text(text)
    with pytest.raises(ConfigurationError) as error:
        commission(way.session(motion=own), nullcontext())
    assert len(error.value.sentences) == 1 and str(own) in str(error.value) and sentence in str(error.value)
    assert way.axis.played == 1 and way.states()["excite"] == FAILED  # the check of the signs was played


def test_a_motion_of_the_user_that_is_not_there_is_one_sentence(way: Run, tmp_path: Path) -> None:
    """A bag has to hold the reference of this axis. The same command goes on when the file is there."""
    other, still, later = (tmp_path / name for name in ("other", "still", "later.csv"))
    for bag, name, stamps in ((other, "y", np.arange(5)), (still, "x", np.zeros(5, np.int64))):
        with BagWriter(bag) as written:
            written.write_joint_states("reference", stamps, [name], position=np.zeros((5, 1)))
    for own, sentence in (
        (tmp_path / "no", "does not exist; check the path"),
        (other, "has no reference of axis x; record one with the topic reference"),
        (still, "holds no motion: give a bag with the topic reference, or a CSV of excite"),
        (later, "cannot be read: .*No such file"),
    ):
        shutil.rmtree(way.out, ignore_errors=True)
        with pytest.raises((ConfigurationError, RecordingError), match=sentence) as error:
            commission(way.session(motion=own), nullcontext())
        assert str(own) in str(error.value) and way.states()["excite"] == FAILED
    later.write_text(rows(*to_and_fro(3.0e-3, 2.0)))
    commission(way.session(motion=later), nullcontext())
    assert way.result()["usable"] is True


def test_what_was_found_behind_a_step_that_is_done_again_is_forgotten(way: Run) -> None:
    """The bag of a finished commissioning is gone, and its second recording fails."""
    assert way.whole()["usable"] is True
    shutil.rmtree(way.out / "recordings" / "own")
    with pytest.raises(DataError):
        way.whole(fault=is_lost, in_step="record")
    result = way.result()
    assert result["usable"] is False and result["yaml"] is None
    assert result["tracking"] == {} and result["effects"] == []


def test_what_cannot_end_in_time_is_not_begun_and_the_page_says_so(way: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compensate, "OBSERVER_START", 0.0)
    result = way.whole(seconds=33.0)
    states = way.states()
    assert [states[name] for name in NAMES] == [*[DONE] * 7, SKIPPED, SKIPPED, DONE]
    sentence = result["steps"][7]["sentence"]
    assert sentence.startswith("not begun: the motion (compensation, 3 times with rising gain) takes about")
    assert "s of --time are left" in sentence and result["reason"] == f"step compensate was left out: {sentence}"
    assert way.axis.played == 4 and way.axis.gain == 0.0  # signs, both recordings, the observer's
    page = (way.out / REPORT).read_text()
    assert "Warning: the result must not be used as it is: step compensate was left out" in page
    assert way.whole()["usable"] is True


def test_long_work_is_given_up_at_the_end_of_the_time(way: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """And is not begun again with less time than it had."""

    def endless(session: Session) -> tuple[str, list[str]]:
        session._end = time.monotonic() - 1.0
        session.progress("diagnose", 0.5)
        raise AssertionError

    steps = tuple(StepWork(one.name, endless if one.name == "diagnose" else one.work, one.moves) for one in run.STEPS)
    with monkeypatch.context() as patch:
        patch.setattr(run, "STEPS", steps)
        result = way.whole()
    assert way.states()["diagnose"] == SKIPPED and way.states()["report"] == DONE
    assert "stopped, because the time of --time was over" in result["reason"]
    assert (way.out / REPORT).exists()
    result["facts"][run.STOPPED_AFTER]["diagnose"] = 100.0
    (way.out / "commission.json").write_text(json.dumps(result))
    assert "diagnose takes about 100 s" in way.whole(seconds=90.0)["reason"]
    assert way.whole(seconds=1800.0)["usable"] is True


def test_a_motion_ends_with_the_time(way: Run) -> None:
    session = way.session()

    def late(*_: Any) -> None:
        session._end = time.monotonic() - 1.0

    way.axis.fault = late
    session.ledger.facts["origin"] = 0.0
    with pytest.raises(OutOfTime):
        session.play(Motion(PERIOD, np.zeros(2000)))


@pytest.mark.parametrize("name", WRITTEN)
def test_a_folder_with_files_of_others_is_refused(way: Run, name: str) -> None:
    way.out.mkdir()
    (way.out / name).mkdir()
    with pytest.raises(RecordingError, match="is not overwritten"):
        way.session()
    (way.out / name).rename(way.out / "notes")
    way.session()


def test_a_changed_parameter_file_is_refused_in_one_sentence(way: Run) -> None:
    with pytest.raises(DataError):
        way.whole(fault=is_lost, in_step="observe")
    way.config.write_text(START.replace("9.0", "8.0"))
    with pytest.raises(ConfigurationError, match=r"changed since the commissioning in .* began; put it back") as error:
        way.session()
    assert len(error.value.sentences) == 1
    way.config.write_text(START)
    assert way.whole()["usable"] is True


def test_an_axis_that_stands_elsewhere_is_not_moved(way: Run) -> None:
    with pytest.raises(DataError):
        way.whole(fault=is_lost, in_step="record")
    session = way.session()
    way.axis.stands_at = 0.03
    with pytest.raises(ConfigurationError, match="stands at 30 mm, outside the stroke"):
        commission(session, nullcontext())
    assert way.axis.played == 0


@pytest.mark.parametrize(("limit", "has_warning"), [("9.0", False), ("6.0", False), ("3.0", True), ("20.0", True)])
def test_the_limit_is_compared_with_the_static_force(way: Run, limit: str, has_warning: bool) -> None:
    way.config.write_text(START.replace("9.0", limit))
    way.whole()
    found = [one for one in way.said if one.startswith(f"Warning: compensation.limit = {limit[:-2]} N does not fit")]
    assert bool(found) == has_warning
    if found:
        assert "9 N, is safe" in found[0] and list(found) == way.result()["steps"][0]["warnings"]
        assert "compensation.limit = " in (way.out / REPORT).read_text()


def test_an_observer_that_is_inconsistent_is_corrected_before_it_compensates(
    way: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    def judged(_: Path, config: Path, name: str) -> Consistency:
        return Consistency(4.0 * (0.1 / load_settings(config).axes[0].estimator.measurement_std) ** 2, 0.1)

    monkeypatch.setattr(compensate, "consistency_of", judged)
    sentence = way.whole()["steps"][NAMES.index("observe")]["sentence"]
    assert sentence.startswith("NIS 1 with estimator.measurement_std 200 mN")
    assert load_settings(way.out / "commissioned.yaml").axes[0].estimator.measurement_std == 0.2


def test_an_observer_that_stays_inconsistent_is_a_warning(way: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compensate, "consistency_of", lambda *_: Consistency(9.0, 0.1))
    warnings = way.whole()["steps"][NAMES.index("observe")]["warnings"]
    assert len(warnings) == 1 and warnings[0].startswith("Warning: NIS is 9 and should be at most 2")


def test_an_estimate_that_is_too_uncertain_is_not_fed_forward(way: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compensate, "consistency_of", lambda *_: Consistency(1.0, 0.8))
    with pytest.raises(DataError, match="80 % of the Coulomb force"):
        way.whole()
    assert way.states()["observe"] == FAILED and way.states()["compensate"] == SKIPPED
    assert not way.axis.has_observer


def test_the_consistency_of_an_observer_over_a_recording(tmp_path: Path) -> None:
    """Of a right model it is good; of one whose friction is half as large the innovations are too large."""
    config, wrong, bag = tmp_path / "right.yaml", tmp_path / "wrong.yaml", tmp_path / "bag"
    config.write_text(start_file("stage: {encoder: {noise: 1.0e-9}, force_noise: 0.02, reference: {kind: sine}}"))
    wrong.write_text(start_file("friction: {model: gms, static_force: 3.0, coulomb_force: 2.0}").replace(
        "      friction: {model: gms, static_force: 6.0}\n", ""))  # fmt: skip
    assert command_line.main(["simulate", "--config", str(config), "--out", str(bag), "--duration", "2"]) == 0
    right = consistency_of(bag, config, "x")
    assert not right.is_inconsistent and 0.0 < right.std_share < 0.2
    assert consistency_of(bag, wrong, "x").is_inconsistent


def test_what_does_not_improve_tracking_is_the_reason(way: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compensate, "MIN_IMPROVEMENT", 0.0)
    result = way.whole()
    assert result["usable"] is False and "rms tracking error with compensation is not below" in result["reason"]
    assert result["reason"] in result["steps"][-2]["sentence"]
    assert f"must not be used as it is: {result['reason']}." in (way.out / REPORT).read_text()


@pytest.mark.parametrize("option", ["--quiet", "--json", None])
def test_the_question_is_on_stderr_and_stdout_stays_clean(
    way: Run, option: str | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nobody says yes to a question that is not shown; what is no yes moves nothing."""
    pytest.importorskip("rclpy")
    axes: list[Axis] = []

    def link(axis: Any, limits: Any, folder: Path, topics: Any) -> Any:
        axes.append(Axis(limits))
        return axes[-1]

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    monkeypatch.setattr(sys, "stdin", Terminal("maybe\n"))
    monkeypatch.setattr("sgms_observer.nodes.table_link.TableLink", link)
    options = ["commission", "--config", str(way.config), "--out", str(way.out), *([option] if option else [])]
    assert command_line.main(options) == 1
    said = capsys.readouterr()
    assert "check of the signs: axis x moves between" in said.err and "Move? [y/N]" in said.err
    assert "e-" not in said.err.split("moves between")[1].split(" for ")[0], "rounding is shown as 0"
    assert "not confirmed" in said.err
    assert option is None or said.out == ""
    assert axes[0].played == 0
